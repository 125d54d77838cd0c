"""The error budget: every part against runs on finer meshes, with stricter tolerances."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import reported_scenes as scenes
from reported_files import Results, ran

from anmstrip import Scene

COARSE = "strip.refined=0.2"
KINDS = ("tension", "force", "position")


def read_off(results: Results) -> tuple[dict[str, float], dict[str, float]]:
    """Tensions (N/m) and rollers' forces (N) of a summary."""
    summary = results.summary
    tensions = {name: edge["tension"] for name, edge in summary["edges"].items()}
    forces = {}
    for name, r in summary["rollers"].items():
        tensions |= {f"{name} in": r["tension_in"], f"{name} out": r["tension_out"]}
        forces |= {f"{name} normal": r["normal_force"], f"{name} drag": r["drag"]}
    return tensions, forces


def truth(results: Results, better: Results) -> dict[str, float]:
    """Largest differences between two runs; positions at corners of the first one's elements."""
    found = [
        max(abs(there[key] - here[key]) for key in here)
        for here, there in zip(read_off(results), read_off(better), strict=True)
    ]
    (points, displaced), (others, exact) = (
        (s.points - s.fields["displacement"], s.fields["displacement"])
        for s in (results.last, better.last)
    )
    apart = np.abs(others[None] - points[:, None]).sum(axis=2)
    same = apart.min(axis=1) < 1e-9
    moved = np.abs(displaced[same] - exact[apart.argmin(axis=1)[same]])
    return dict(zip(KINDS, [*found, float(moved.max())], strict=True))


def run(scene: str, directory: Path, *settings: str) -> Results:
    directory.mkdir()
    results = ran(scene, directory, *settings, options=("--quiet",))
    assert results.exit_code == 0, results.printed
    return results


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A strip held while the roller turns, on long elements, to a tolerance that is not strict."""
    given = (COARSE, "strip.cells=[8, 2]", "solver.tolerance=1e-3")
    return run(scenes.TURNING, tmp_path_factory.mktemp("errors") / "coarse", *given)


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Results:
    given = (COARSE, "strip.cells=[8, 2]", "solver.tolerance=1e-7")
    return run(scenes.TURNING, tmp_path_factory.mktemp("errors") / "strict", *given)


def test_the_mesh_costs_what_a_mesh_four_times_as_fine_saves(
    strict: Results, tmp_path: Path
) -> None:
    given = ("strip.refined=0.05", "strip.cells=[32, 2]", "solver.tolerance=1e-7")
    true = truth(strict, run(scenes.TURNING, tmp_path / "finer", *given))
    for kind, error in strict.summary["errors"]["mesh"].items():
        assert 0.5 * true[kind] < error < 2.0 * true[kind], kind


def test_the_estimate_takes_the_place_of_the_rule_of_thumb(coarse: Results, tmp_path: Path) -> None:
    """Long elements are told of at the end only where they are seen beside the tolerance."""
    loose = run(scenes.TURNING, tmp_path / "loose", COARSE, "solver.tolerance=5e-2")
    assert loose.summary["errors"]["mesh"]["tension"] < 5e-2 * 1.0e4
    assert coarse.summary["errors"]["mesh"]["tension"] > 1e-3 * 1.2e4
    rule = "elements over r1 are "
    assert not any(rule in words for words in loose.summary["warnings"])
    assert rule not in loose.printed
    assert sum(rule in words for words in coarse.summary["warnings"]) == 1
    assert rule in coarse.printed


def test_path_and_time_cost_what_a_strict_tolerance_saves(coarse: Results, strict: Results) -> None:
    """Local errors are bounds where the motion is not smooth: not less than a third of the truth
    and not more than ten times it.  Held at its entry, the strip is where it is but for 1e-10 m."""
    true, found = truth(coarse, strict), coarse.summary["errors"]
    for kind in ("tension", "force"):
        sum_of_both = found["path"][kind] + found["time"][kind]
        assert true[kind] / 3.0 < sum_of_both < 10.0 * true[kind], kind
        assert strict.summary["errors"]["time"][kind] < 0.1 * found["time"][kind]
    assert max(true["position"], found["time"]["position"]) < 1e-10


def test_a_path_without_rates_is_off_by_what_the_last_step_left(tmp_path: Path) -> None:
    """Newton's method finds it to all digits."""
    scene = scenes.PLATE
    loose = run(scene, tmp_path / "loose", "solver.tolerance=1e-3")
    best = run(scene, tmp_path / "best", "solver.tolerance=1e-8")
    true, found = truth(loose, best), loose.summary["errors"]
    assert found["time"] is None
    assert found["path"]["force"] == pytest.approx(true["force"], rel=0.05)
    assert found["path"]["position"] == pytest.approx(true["position"], rel=0.05)


@pytest.mark.slow
def test_a_released_edge_keeps_the_force_that_a_coarse_mesh_gave_it(tmp_path: Path) -> None:
    """Held, the entry takes up what it is released with, which the mesh makes wrong."""
    held, _, turn = scenes.TURNING.rpartition('[[stages]]\nname = "turn"')
    released = held + '[[stages]]\nname = "turn"\nentry.release = true' + turn
    given = "solver.tolerance=1e-5", "stages.turn.duration=0.05", "friction.speed=1e-3"
    found = run(released, tmp_path / "coarse", *given, COARSE, "strip.cells=[8, 2]")
    finer = run(released, tmp_path / "finer", *given, "strip.refined=0.05", "strip.cells=[32, 2]")
    true, error = truth(found, finer), found.summary["errors"]["mesh"]
    assert 0.4 * true["tension"] < error["tension"] < 2.5 * true["tension"]


def test_the_laws_cost_their_largest_shares(shell: Results) -> None:
    """In the mean over the width: what uneven gaps give to a fibre they take from another."""
    rollers, effects = shell.summary["rollers"].values(), ("creep", "cone")
    shares = [
        sum(r["regularisation_effect"][name] for name in effects) + r["penetration"] / radius
        for r, radius in zip(rollers, (0.5, 0.4), strict=True)
    ]
    pulls = [max(r["tension_in"], r["tension_out"]) for r in rollers]
    found = shell.summary["errors"]["regularisation"]
    assert found["tension"] == pytest.approx(max(np.multiply(shares, pulls)))
    pushes = [r["normal_force"] for r in rollers]
    assert found["force"] == pytest.approx(max(np.multiply(shares, pushes)))
    stiffness, crept = 2.0e11 * 1.0e-3, []
    for r, pull, radius in zip(rollers, pulls, (0.5, 0.4), strict=True):
        strain = r["regularisation_effect"]["creep"] * pull / stiffness
        crept.append(r["penetration"] + strain * r["wrap"] * radius)
    assert found["position"] == pytest.approx(max(crept))


@pytest.mark.slow
def test_the_laws_of_a_shell_cost_what_sharper_ones_save(tmp_path: Path) -> None:
    """K a hundred times as large, η a hundredth: within the factor of 5 of the other parts."""
    example, ends = Path(__file__).parents[2] / "examples" / "capstan.toml", []
    for name, sharper in (("soft", ()), ("sharp", ("contact.stiffness=1e11", "contact.eta=1.0"))):
        found = Scene.load(example, ["solver.tolerance=1e-5", *sharper]).run(tmp_path / name)
        *_, last = found
        roller = last.state.rollers["r1"]
        ends.append((last.state.tension("entry"), roller.normal_force))
    told = json.loads((tmp_path / "soft" / "summary.json").read_text())["errors"]["regularisation"]
    saved = np.abs(np.subtract(*ends))
    assert np.log([told["tension"], told["force"]] / saved) == pytest.approx(0.0, abs=np.log(5.0))


WORDS = {
    "path": "the path",
    "time": "the steps in time",
    "mesh": "the mesh",
    "regularisation": "the laws of contact and friction",
}


@pytest.mark.parametrize("name", ["shell", "plate"])
def test_the_budget_is_printed_and_in_the_page(name: str, request: pytest.FixtureRequest) -> None:
    results: Results = request.getfixturevalue(name)
    told = [" ".join(line.split()) for line in results.printed.splitlines()]
    page = (results.directory / "report.html").read_text(encoding="utf-8")
    for key, part in results.summary["errors"].items():
        values = ["–"] * 3 if part is None else [f"{part[kind]:.2g}" for kind in KINDS]
        assert " ".join([WORDS[key], *values]) in told
        assert "".join(f"<td>{cell}</td>" for cell in (WORDS[key], *values)) in page


def test_an_interrupted_run_has_the_same_budget(coarse: Results, tmp_path: Path) -> None:
    """Stopped twice inside the stage in time, whose error has a history."""
    given = (COARSE, "strip.cells=[8, 2]", "solver.tolerance=1e-3")
    directory = tmp_path / "stopped"
    directory.mkdir()
    steps = coarse.summary["steps"]
    for most, options in ((steps - 5, ()), (steps - 2, ("--resume",)), (1000, ("--resume",))):
        found = ran(
            scenes.TURNING, directory, *given, f"solver.max_steps={most}",
            options=("--quiet", *options),
        )  # fmt: skip
    assert found.exit_code == 0, found.printed
    expected: dict[str, Any] = coarse.summary["errors"]
    again = json.loads((found.directory / "summary.json").read_text(encoding="utf-8"))["errors"]
    for key, part in expected.items():
        assert again[key] == pytest.approx(part, rel=1e-3), key


def test_what_can_yield_has_no_part_of_the_mesh_yet(tmp_path: Path) -> None:
    """Its own unknowns belong to the points of its mesh."""
    yielding = scenes.STRIP + scenes.PULL_AND_WRAP.split('[[stages]]\nname = "wrap"')[0]
    yielding = yielding.replace(
        "poisson = 0.3", "poisson = 0.3\nyield_stress = 2.0e8\nplasticity = {}", 1
    )
    found = run("[contact]\n" + yielding, tmp_path / "yields", "solver.tolerance=1e-3")
    assert found.summary["errors"]["mesh"] is None
    assert found.summary["errors"]["path"] is not None


def test_a_mesh_that_is_too_coarse_is_named(tmp_path: Path) -> None:
    """One long element over the roller: its tensions are far from those of half its length."""
    found = run(scenes.TURNING, tmp_path / "long", "strip.refined=0.8", "strip.cells=[5, 2]",
                "solver.tolerance=1e-3")  # fmt: skip
    mesh = found.summary["errors"]["mesh"]
    (warning,) = [text for text in found.summary["warnings"] if "half the length" in text]
    if mesh is None:
        assert "from the mesh alone" in warning
    else:
        assert mesh["tension"] > 0.1 * 11547.0
        assert f"wrong by about {mesh['tension']:.2g} N/m" in warning


# compression that a coarse shell makes up ---------------------------------------------------------

PRESS = Path(__file__).parents[2] / "examples" / "press.toml"
FALSE = "wrinkles there may come from the mesh alone"


def test_false_compression_of_a_coarse_shell_is_warned_of(tmp_path: Path) -> None:
    """Against a run on a mesh that is fine enough, where hardly anything is compressed."""
    text = PRESS.read_text(encoding="utf-8")
    given = ("strip.refined=10.0", "contact.onset=1e-2", "solver.tolerance=1e-5")
    coarse, half, finer = (
        run(text, tmp_path / f"{n}", f"strip.cells=[{n}, {n // 4}]", *given) for n in (8, 16, 32)
    )
    told = [words for words in coarse.summary["warnings"] if FALSE in words]
    assert len(told) == 2
    largest, halved, smallest = (
        results.summary["compressive_membrane_force"] for results in (coarse, half, finer)
    )
    assert f"compressed by {largest:.3g} N/m between r1 and the exit, but by " in told[1]
    assert float(told[1].partition("but by ")[2].split()[0]) == pytest.approx(halved, rel=0.02)
    assert smallest < halved < 0.3 * largest
    assert not any(FALSE in words for words in finer.summary["warnings"])
