"""Newton's method: its parts, and as a follower of the paths of a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anmstrip.continuation.follow import follow
from anmstrip.continuation.newton import Corrections, LoadSteps, Newton, NewtonPath, load_steps
from anmstrip.continuation.path import Cost
from anmstrip.driver.run import Run
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.mechanics.laws import GradedSignorini, RepulsiveSignorini
from function_equations import FunctionEquations
from harness import run
from newton import AT_ONCE, LONG, PLAIN, STRAIGHT, bent, graded, mixed, study
from newton_methods import ByWayOf, tangent_of
from strips import capstan, pressed


def solved(function, settings):
    cost = Cost()
    equations = FunctionEquations(function)
    options = {"solver": DenseSolver(), "settings": settings, "cost": cost}
    *_, last = load_steps(equations, np.zeros(1), target=2.0, **options)
    return last.u[0], cost.factorisations


def cubic(u, load):
    """u = 1 at the load 2."""
    return u + u * u * u - load


@pytest.mark.parametrize("part", [{"degree": 1}, {"degree": 3}, {"kept": 0.05}, {"halvings": 5}])
def test_every_part_leads_to_the_same_state(part):
    found, _ = solved(cubic, replace(LoadSteps(tolerance=1e-10), **part))
    assert found == pytest.approx(1.0, abs=1e-9)


def test_a_guess_and_kept_tangents_save_factorisations():
    plain = LoadSteps(tolerance=1e-10, first=0.02, growth=1.0)
    _, without = solved(cubic, plain)
    assert solved(cubic, replace(plain, degree=2))[1] < 0.7 * without
    assert solved(cubic, replace(plain, kept=0.2))[1] < 0.9 * without


def reading(scene, method):
    run = Run(scene)
    run.march.follow = method
    for _ in run:
        pass
    assert run.outcome.done, run.message
    roller = run.state.rollers["r1"]
    return roller.normal_force, roller.tension_ratio, run.cost.factorisations


@pytest.mark.parametrize(
    "scene", [pressed("section", 2, 0.1, 1e-5), capstan("section", 2, 0.1, 1e-4)]
)
def test_a_run_by_newton_ends_where_one_by_series_does(scene):
    expected, tangents = reading(scene, follow), {}
    for name, method in {"long": NewtonPath(LONG), "mixed": mixed(STRAIGHT)}.items():
        force, ratio, tangents[name] = reading(scene, method)
        assert force == pytest.approx(expected[0], rel=1e-5)
        assert ratio == pytest.approx(expected[1], rel=1e-5)
    assert tangents["mixed"] < 0.75 * tangents["long"]


@pytest.mark.parametrize("graded_too", [False, True])
def test_a_foretold_pressure_saves_factorisations(graded_too):
    scene = pressed("section", 2, 0.1, 1e-3)
    scene = graded(scene) if graded_too else scene
    without = reading(scene, mixed(STRAIGHT, pressure=False))
    foretold = reading(scene, mixed(STRAIGHT))
    assert foretold[0] == pytest.approx(without[0], rel=1e-5)
    assert foretold[2] < 0.6 * without[2]


def test_a_penalty_by_way_of_graded_contact_ends_where_the_penalty_does():
    scene = pressed("section", 2, 0.1, 1e-3)
    law = Run(graded(scene)).march.assembly.signorini
    exact = reading(scene, NewtonPath(LONG))
    found = reading(scene, ByWayOf(law, PLAIN))
    assert found[0] == pytest.approx(exact[0], rel=1e-6)
    assert found[2] < 0.6 * reading(scene, follow)[2]


def test_a_foretold_stress_saves_factorisations():
    best, foretold = (bent(by, 1e-6, 8) for by in (NewtonPath(AT_ONCE), mixed(AT_ONCE)))
    assert foretold.value == pytest.approx(best.value, rel=1e-8)
    assert foretold.cost.factorisations < 0.5 * best.cost.factorisations


@pytest.mark.parametrize("law", [GradedSignorini(2e4, 4e-5), RepulsiveSignorini(1e10, 10.0, 1e-3)])
def test_a_law_is_linearised_at_its_pressure(law):
    pressure = np.array([1e-3, 1.0, 1e5])
    gap, slope = tangent_of(law, pressure)
    assert law(gap) == pytest.approx(pressure, rel=1e-9)
    step = 1e-5 * pressure / slope
    assert (law(gap - step) - law(gap + step)) / (2.0 * step) == pytest.approx(slope, rel=1e-6)


@pytest.mark.slow
def test_the_best_is_far_better_than_the_plain():
    scene = pressed("section", 2, 0.1, 1e-5)
    assert reading(scene, NewtonPath(LONG))[2] < 0.5 * reading(scene, NewtonPath(PLAIN))[2]


@pytest.mark.slow
def test_the_study(tmp_path: Path) -> None:
    run(study, quick=True, directory=tmp_path)
    report = (tmp_path / "newton.md").read_text(encoding="utf-8")
    assert "python examples/benchmarks/newton.py --quick" in report
    for problem in ("cantilever", "press, section", "press, shell", "capstan, shell"):
        lines = [line for line in report.splitlines() if line.startswith(f"| {problem} |")]
        assert len(lines) == (6 if problem == "cantilever" else 13)
        errors = [float(line.split("|")[-2]) for line in lines[:-1]]
        assert max(errors) < 1e-3


def test_a_spent_allowance_of_tangents_ends_the_iteration():
    equations, cost = FunctionEquations(cubic), Cost(most=2)
    newton = Newton(equations, DenseSolver(), Corrections(tolerance=1e-12, halvings=0), cost)
    assert newton.corrected(np.zeros(1), 2.0) is None
    assert cost.factorisations == 2
