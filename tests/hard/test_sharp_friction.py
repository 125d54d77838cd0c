"""Friction that turns round within a tenth of a micrometre per second."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.simulation import march
from hard_strips import arc_ratio
from random_lines import ending_of, varied

README = Path(__file__).parents[2] / "README.md"

LAWS: dict[str, dict[str, Any]] = {
    "algebraic": {},
    "tanh": {"omega": 0.1},
    "norton-hoff": {"omega": 0.1, "exponent": 0.05},
}


def capstan(tmp_path: Path, law: str, speed: float) -> Run:
    """Run the scene of the README, whose roller turns at 1 m/s under a held strip."""
    text = README.read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0]
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    tables = Scene.load(path).to_dict()
    tables["friction"] = {"law": law, "coefficient": 0.3, "speed": speed, **LAWS[law]}
    tables["solver"]["tolerance"] = 1e-3
    run = Run(Scene.model_validate(tables))
    for _ in run:
        pass
    return run


def friction_at_one(run: Run) -> float:
    """Return |R_T|/R_N at 1 m/s, by the formula of the law."""
    given = run.scene.friction
    assert given is not None
    assert given.speed is not None
    share = {
        "algebraic": 1.0 / np.hypot(1.0, given.speed),
        "tanh": np.tanh(1.0 / given.speed),
        "norton-hoff": given.speed**-0.05,
    }
    return float(given.coefficient * share[given.law])


def misses(run: Run) -> float:
    """Relative error of the tension ratio beside that of elasticas around an arc."""
    assembly, strip = run.assembly, run.assembly.strip
    assert run.state is not None and assembly.thread is not None and assembly.friction is not None
    stiff = strip.bending_stiffness / (1e4 * 0.5**2)
    expected = arc_ratio(friction_at_one(run), assembly.thread.turns["r1"], stiff)
    found = run.state.rollers["r1"].tension_ratio
    assert found is not None
    return float(np.abs(found / expected - 1.0))


@pytest.mark.parametrize(("law", "most"), [("algebraic", 90), ("tanh", 100), ("norton-hoff", 250)])
def test_sharp_friction_ends_where_statics_says(tmp_path: Path, law: str, most: int) -> None:
    """At 1e-6 m/s 68, 71 and 135 tangents."""
    run = capstan(tmp_path, law, 1e-6)
    assert run.outcome.done, run.message
    assert misses(run) < 2e-3
    assert run.cost.expansions < most


@pytest.mark.slow
def test_all_points_begin_to_slip_within_one_step() -> None:
    """The tension is lost behind a bridle that stands: smoother laws end steps that stall.

    Where every step followed a path it took 1 611.
    """
    places = ((0.0, 0.0, "over"), (0.8, -1.2, "under"), (1.6, 0.0, "over"))
    run = Run(
        Scene.model_validate(
            {
                "strip": {"kinematics": "section", "width": 1.4, "thickness": 1.5e-3},
                "material": {"young": 2.1e11, "poisson": 0.3},
                "contact": {},
                "friction": {"coefficient": 0.12},
                "threading": {"tension": 3e4, "entry": (-3, 0, 0.5), "exit": (4.5, 0, 0.5)},
                "rollers": [
                    {"radius": 0.5, "centre": (x, 0.0, z), "wrap": wrap} for x, z, wrap in places
                ],
                "edges": {"entry": {"fixed": ["x", "z"]}},
                "stages": [{"duration": 0.1, "exit": {"tension": 3e3}}, {"duration": 1.0}],
            }
        )
    )
    for _ in run:
        pass
    assert run.outcome.done, run.message
    assert run.state is not None and run.assembly.thread is not None
    before, strip = 3e3, run.assembly.strip
    for name, turn in reversed(run.assembly.thread.turns.items()):
        before *= arc_ratio(0.12, turn, strip.bending_stiffness / (before * 0.5**2))
        found = run.state.rollers[name].tension_in
        assert found == pytest.approx(before, rel=0.02)
    assert run.cost.expansions < 400


@pytest.mark.slow
@pytest.mark.parametrize(("law", "most"), [("algebraic", 250), ("tanh", 180), ("norton-hoff", 380)])
def test_very_sharp_friction_does_not_stall(tmp_path: Path, law: str, most: int) -> None:
    """Where the paths of steps stall, smoother laws lead to their ends; without them this stops.

    The laws take 95, 114 and 196 tangents; at 1e-4 m/s 44, 46 and 87 do.
    """
    run = capstan(tmp_path, law, 1e-8)
    assert run.outcome.done, run.message
    assert misses(run) < 2e-3
    assert run.cost.expansions < most


def bridle(law: str, speed: float) -> Run:
    """Run the two rollers of the example with a law, to the end of the stage that turns them."""
    tables = Scene.load(README.parent / "examples" / "bridle.toml").to_dict()
    tables["friction"] = {"law": law, "coefficient": 0.15, "speed": speed, **LAWS[law]}
    tables["solver"]["tolerance"] = 1e-3
    run = Run(Scene.model_validate(tables))
    for _ in run:
        pass
    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "law", "most"),
    [
        ("capstan", "algebraic", 32), ("capstan", "tanh", 14), ("capstan", "norton-hoff", 32),
        ("bridle", "algebraic", 75), ("bridle", "tanh", 73), ("bridle", "norton-hoff", 85),
    ],
)  # fmt: skip
def test_tangents_stay_below_a_line_over_the_logarithm(
    tmp_path: Path, name: str, law: str, most: int
) -> None:
    """From 1 to 1e-8 m/s every run is done, and takes at most so many more for each decade."""
    first = 0
    for decade in range(9):
        speed = 10.0**-decade
        run = capstan(tmp_path, law, speed) if name == "capstan" else bridle(law, speed)
        assert run.outcome.done, run.message
        taken = run.cost.expansions
        first = first or taken
        assert taken <= first + most * decade, (decade, taken)
        if name == "bridle" and decade >= 2:  # both slip, in front of the tension that is given
            assert run.assembly.friction is not None and run.assembly.thread is not None
            assert run.state is not None
            f, turn = friction_at_one(run), run.assembly.thread.turns["lower"]
            stiff = run.assembly.strip.bending_stiffness / (1e4 * 0.5**2)
            ratio = run.state.rollers["lower"].tension_ratio
            assert ratio == pytest.approx(arc_ratio(f, turn, stiff), rel=1e-2)


def steady_line(law: str, slip_speed: float, *given: Any) -> Run:
    """Two driven rollers, of which the second is 30 ppm faster, and two idle ones with bearings.

    Return the run, not begun.
    """
    places = [(0.8 * k, 1.5 if k % 2 == 0 else 0.0) for k in range(4)]
    tables: dict[str, Any] = {
        "strip": {"width": 1.0, "thickness": 1e-3, "kinematics": "section"},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {},
        "friction": {"law": law, "coefficient": 0.3, "speed": slip_speed, **LAWS[law]},
        "rollers": [
            {"radius": 0.4, "centre": (x, 0.0, z), "wrap": "over" if z else "under"}
            | ({} if z else {"drive": "idle", "bearing": 20.0})
            for x, z in places
        ],
        "threading": {"tension": 1e4, "entry": (-0.4, 0.0, 0.0), "exit": (2.8, 0.0, 0.5)},
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [
            {
                "name": "run", "steady": True, "entry": {"tension": 1.05e4},
                "rollers": {"r1": {"surface_speed": 1.0}, "r3": {"surface_speed": 1.00003}},
            }
        ],
    }  # fmt: skip
    return Run(Scene.model_validate(tables), *given)


def settled(run: Run) -> dict[str, float]:
    """Tensions behind the rollers at the end."""
    for _ in run:
        pass
    assert run.outcome.done and run.state is not None, run.message
    return {name: reading.tension_out for name, reading in run.state.rollers.items()}


def test_many_stationary_states_end_by_way_of_smoother_laws(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the state of the whole path and of statics, also of a run that is killed just before."""
    whole = steady_line("algebraic", 1e-6)
    expected = settled(whole)
    monkeypatch.setattr(march, "LONG_PATH_STATES", 6)
    short = steady_line("algebraic", 1e-6)
    statics = {"r3": 9950.0, "r4": 1e4}
    assert settled(short) == pytest.approx(expected | statics, rel=1e-4)
    assert short.steps == 1 + 6 + 1 < whole.steps
    killed = steady_line("algebraic", 1e-6, tmp_path)
    next(step for step in killed if step.step == 7)
    killed._checkpoint(force=True)
    del killed
    resumed = steady_line("algebraic", 1e-6, tmp_path, True)
    settled(resumed)
    assert resumed.state is not None and short.state is not None
    # balanced, each, to what last digits are worth: 1e-7 of the forces
    np.testing.assert_allclose(resumed.state.full, short.state.full, rtol=0.0, atol=1e-10)
    assert resumed.cost.expansions == short.cost.expansions


def test_stationary_states_that_stall_end_by_way_of_smoother_laws() -> None:
    """A line of three rollers with saturated friction; without smoother laws it stops half-way."""
    ending = ending_of(varied(1063, Path()))
    assert ending.kind == "right", ending


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_steady_line_at_any_slip_speed(law: str) -> None:
    """Idlers take their drag over the radius, the driven rollers the rest, from 1 to 1e-8 m/s.

    Down to 1e-6 m/s the stage takes 2 to 16 tangents, at 1e-8 27, 32 and 81.
    """
    for k in range(9):
        run = steady_line(law, 10.0**-k)
        settled(run)
        assert run.state is not None
        r1, r2, _, r4 = run.state.rollers.values()
        within = 2e-3 * r2.tension_out
        assert r1.tension_in == pytest.approx(1.05e4, abs=within)
        assert r4.tension_out == pytest.approx(1e4, abs=within)
        if k:  # at 1 m/s idlers slip as fast as they turn, and bearings drag less
            assert r2.tension_out - r2.tension_in == pytest.approx(50.0, abs=within)
            assert r4.tension_out - r4.tension_in == pytest.approx(50.0, abs=within)
        assert run.stages["run"]["tangents"] <= (25 if k <= 6 else 100)
