"""Hard cases of a strip on a roller, beside their answers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import hard_strips as strips
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.simulation.march import March, Step
from anmstrip.simulation.meshing import Layout
from answers import right
from hard_strips import LAY, PULL, end_of, ran, tables_of, turning


@pytest.mark.parametrize("gap", [1e-3, 0.2])
def test_tangent_to_a_turning_roller(gap: float) -> None:
    """D1: the drag is no more than the cone of the faint pressure, and 0 out of reach."""
    trial = strips.tangent(gap=gap)
    right(trial, 1e-6, 40)
    assert (trial.found == 0.0) is (gap == 0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "thickness"), [(1e3, 1e-5), (1e5, 1e-5), (1e7, 1e-3), (1e12, 1e-3)]
)
def test_stiff_and_soft_contact(stiffness: float, thickness: float) -> None:
    """D2: no friction, no difference of tension, at any K; the soft with a foil pulled faintly."""
    right(strips.smooth_roller(stiffness, thickness), 3e-4, 200)


@pytest.mark.slow
@pytest.mark.parametrize(
    "hard",
    [{"omega": 1e-10}, {"q": 0.3}, {"q": 0.01}, {"speed": 1e-7}, {"thickness": 1e-5}],
    ids=str,
)
def test_capstan(hard: dict[str, Any]) -> None:
    """D3, D12, D17: e^(f_eff θ) less bending, however sharp the law or thin the strip."""
    right(strips.capstan(**hard), 1e-4 if "thickness" in hard else 5e-5, 1000)


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [1e-2, 5e-3])
def test_thick_strip_turns_about_a_line(thickness: float) -> None:
    """D17: too stiff for an arc; two elasticas meet where it slips."""
    right(strips.capstan(thickness=thickness, refined=0.025), 1e-3, 1000)


def test_line_without_friction_or_with_little_turn() -> None:
    assert strips.line_ratio(0.0, 0.7) == pytest.approx(1.0)
    small = strips.line_ratio(0.3, 1e-3)  # forces balance: 1 + f θ, to the next order
    assert small == pytest.approx(np.exp(0.3e-3), rel=1e-7)


@pytest.mark.slow
def test_capstan_of_a_shell() -> None:
    right(strips.capstan("shell", q=0.01, omega=1e-4, refined=0.1), 5e-3, 1000)


@pytest.mark.slow
@pytest.mark.parametrize(("refined", "allowed"), [(0.042, 6e-3), (0.0125, 1.2e-3)])
def test_long_hold(refined: float, allowed: float) -> None:
    """D4: it drifts at V_c ρ^(1/q) for 1000 s, and the report says how fast.

    Drift goes with the tenth power of friction.  Where the strip lifts off between two points
    makes it err to either side: for five meshes each of about 0.045, 0.022, 0.011 m by
    2.6e-3, 2.4e-3, 4e-4 (root mean square).
    """
    trial, run = strips.hold(refined=refined)
    right(trial, allowed, 1000)
    assert end_of(run).regularisation["r1"].sticking_creep == pytest.approx(trial.found, rel=1e-3)


@pytest.mark.parametrize("depth", [0.1, -0.1])
def test_grazing(depth: float) -> None:
    """D9: back to 1e-10."""
    right(strips.graze(depth), 1e-10, 30)


@pytest.mark.slow
@pytest.mark.parametrize("level", ["section", "shell"])
def test_tension_lowered_to_nothing(level: str) -> None:
    """D11: arc, line, and a little below zero: no crash, and one outcome if it ends there.

    Beyond the limit point the strip swings freely, and how far its path goes to and fro before it
    is back where the stage began is a matter of round-off: after 141 tangents on the shell, or
    1 126, or not within 2 800.
    """
    trial = strips.lowered(level)
    assert trial.outcome == "done" or trial.outcome.startswith("Stopped in stage less")
    assert trial.error <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("refined", "allowed"), [(0.1, 2e-2), (0.025, 8e-3), (0.0125, 8e-3)])
def test_driven_roller(refined: float, allowed: float) -> None:
    """D12: the mean creep, in units of (T1 − T2)/(E t)."""
    right(strips.driven(1e-4, refined), allowed, 600)


@pytest.mark.slow
@pytest.mark.parametrize(("eta", "share"), [(1e3, 0.3), (10.0, 0.5)])
def test_ironing(eta: float, share: float) -> None:
    """D13: drag = f_eff R_N; the ripple from passing nodes falls with h, and does not grow.

    Measured for elements of 0.1, 0.05, 0.025 m: 0.50, 0.14, 0.034 % with an onset of contact as
    wide as these (η = 1 kPa), like h²; 1.14, 0.49, 0.21 % with one that falls between points
    of contact (10 Pa), like h^1.2: where the strip lifts off pressure is not smooth.  Without
    friction it is the same: h^2.2 and h^1.5 down to 0.0125 m.
    """
    (coarse, rough), (fine, smooth) = (strips.ironed(h, eta) for h in (0.1, 0.05))
    right(coarse, 2e-3, 3000)
    right(fine, 2e-3, 3000)
    assert smooth < share * rough


@pytest.mark.slow
def test_other_units() -> None:
    """D16: the same steps, the same dimensionless answer; to the last bit in a unit of 2^10 per m.

    A thousand per metre rounds the data, by 1e-16.
    """
    (metres, times), (binary, alike), (millimetres, same) = map(strips.in_units, (1.0, 1024.0, 1e3))
    right(metres, 0.0, 300)
    assert (alike, binary.tangents, binary.found) == (times, metres.tangents, metres.found)
    assert millimetres.tangents == metres.tangents
    assert same == pytest.approx(times, rel=1e-9)
    assert millimetres.found == pytest.approx(metres.found, rel=1e-11)


@pytest.mark.parametrize(("elements", "thickness"), [(1, 1e-3), (10_000, 1e-3), (100, 1e-5)])
def test_slender(elements: int, thickness: float) -> None:
    """D17: one to ten thousand elements, 1 cm to 10 µm."""
    right(strips.slender(elements, thickness), 1e-7, 5)


# numbering -------------------------------------------------------------------------


@pytest.mark.parametrize("level", ["section", pytest.param("shell", marks=pytest.mark.slow)])
def test_numbering_does_not_matter(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same answers to 1e-9 with nodes numbered at random."""

    def forces(shuffled: bool) -> list[float]:
        if shuffled:
            usual = Layout.mesh.fget
            monkeypatch.setattr(Layout, "mesh", property(lambda layout: renumbered(usual(layout))))
        tables = tables_of(PULL, LAY, turning(duration=0.02), level=level, refined=0.4)
        tables["solver"]["tolerance"] = 1e-6
        run, _ = ran(tables)
        assert run.outcome.done
        reading = end_of(run).rollers["r1"]
        return [reading.normal_force, reading.tension_in, reading.drag, float(run.steps)]

    assert forces(shuffled=True) == pytest.approx(forces(shuffled=False), rel=1e-9)


def renumbered(mesh: Any) -> Any:
    """The mesh with its nodes in another order."""
    order = np.random.default_rng(1).permutation(mesh.p.shape[1])
    place = np.argsort(order)
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    edges = {"entry": (0, low), "exit": (0, high), "right": (1, low), "left": (1, high)}
    return type(mesh)(mesh.p[:, order], place[mesh.t], sort_t=False).with_boundaries(
        {
            name: lambda x, c=c, at=at: np.isclose(x[c], at[c])
            for name, (c, at) in edges.items()
            if c < len(low)
        }
    )


def test_far_points_do_not_overflow() -> None:
    """A roller a thousand kilometres away, pressed on by a law that decays."""
    tables = tables_of(PULL)
    tables["rollers"][0]["centre"] = [0.0, 0.0, -1e6]
    run = Run(Scene.model_validate(tables))
    assert list(run)
    assert run.outcome.done
    assert end_of(run).rollers["r1"].normal_force == 0.0


def test_a_strip_that_ran_away_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that hold a snap are dated and measured, in the message as well.

    Unless they move less than the error that the run may make.
    """
    through = March._in_time

    def snapping(march: March, plan: Any, settings: Any) -> Iterator[Step]:
        for arrival in through(march, plan, settings):
            yield replace(arrival, snapped=True)

    monkeypatch.setattr(March, "_in_time", snapping)
    lift = {"name": "lift", "duration": 1.0, "entry": {"move": [0.0, 0.0, 4.7e-3]}}
    run, steps = ran(tables_of(PULL, lift, refined=0.4))
    allowed = run.scene.solver.tolerance * 4.0
    heights = [step.state.full.reshape(-1, 2)[:, 1] for step in steps]
    values = run.assembly.strip.node_values
    ways = [np.abs(b - a)[values].max() for a, b in pairwise(heights)]
    late = [(step.time, way) for step, way in zip(steps[1:], ways, strict=True) if step.time > 1.0]
    told = [(time, way) for time, way in late if way > allowed]
    assert 0 < len(told) < len(late)
    found = np.array([(snap["time"], snap["distance"]) for snap in run.snaps])
    assert found == pytest.approx(np.array(told), rel=1e-2)
    assert {snap["stage"] for snap in run.snaps} == {"lift"}
    assert run.message.count("the strip ran away by") == len(told)
    assert run.facts()["snaps"] == run.snaps
