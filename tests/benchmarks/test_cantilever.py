"""A cantilever under end shear: known tip, few tangents, Newton's method beside it."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.newton import LoadSteps, load_steps
from anmstrip.continuation.path import Cost, Outcome, PathStopped
from anmstrip.linalg.solvers import SparseSolver

EXAMPLE = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "cantilever.py"))
cantilever, bent = EXAMPLE["cantilever"], EXAMPLE["bent"]

TIP = (-3.28944, 6.69973)
"""U, W (m) on 16 elements, by Newton's method on the same mesh (measured)."""

ELASTICA = 10.0 * np.array([-0.32894124, 0.66996418])
"""U, W (m) of the inextensible elastica at P L²/EI = 4, computed by elliptic integrals."""


@pytest.fixture(scope="module")
def equations():
    return cantilever()


def test_the_example_holds(claim, capsys):
    series, newton = EXAMPLE["main"]()
    assert series.tangents <= 3
    for axis, found, elastica in zip("xz", series.tip, ELASTICA, strict=True):
        claim(
            f"tip of the cantilever along {axis} (m)",
            found,
            elastica,
            5e-5,
            "inextensible elastica, elliptic integrals",
        )
    assert series.tip == pytest.approx(TIP, abs=1e-5)
    assert newton.tip == pytest.approx(TIP, abs=1e-5)
    assert capsys.readouterr().out.count("tangents") == 2


def test_the_tolerance_is_the_error_that_one_gets(equations):
    exact = np.array(bent(equations, newton=True).tip)
    for tolerance in (1e-3, 1e-5, 1e-7):
        found = bent(equations, tolerance=tolerance)
        assert np.abs(found.tip - exact).max() < 10.0 * tolerance
        assert found.tangents <= 6


def test_the_error_against_the_elastica_is_the_membrane_strain():
    """ε = P/(E b t); at the same bending stiffness the error goes down with it."""
    shares = []
    for thickness in (0.1, 0.05):
        strain = 4.0 / (1200.0 / thickness**2)
        tip = bent(cantilever(32, thickness), tolerance=1e-7).tip
        shares.append(np.abs(tip - ELASTICA).max() / np.abs(ELASTICA).max() / strain)
    assert all(0.8 < share < 1.2 for share in shares), shares


def test_the_mesh_converges():
    finest = np.array(bent(cantilever(64), tolerance=1e-8).tip)
    coarse, fine = (
        np.linalg.norm(bent(cantilever(n), tolerance=1e-8).tip - finest) for n in (8, 16)
    )
    assert coarse / fine > 2.0**4 * 0.8


def test_what_newton_counts(equations):
    """Cost agrees with what the steps say, and one step from straight is its best."""
    u, cost = np.zeros(len(equations.supports.free)), Cost()
    steps = list(load_steps(equations, u, solver=SparseSolver(), cost=cost))
    assert steps[-1].control == 1.0
    assert all(step.imbalance <= 1e-8 for step in steps)
    assert cost.factorisations == cost.solves == sum(step.iterations for step in steps)
    at_once = Cost()
    settings = LoadSteps(first=1.0, most=50)
    (step,) = load_steps(equations, u, solver=SparseSolver(), settings=settings, cost=at_once)
    assert 10 < at_once.factorisations < cost.factorisations
    np.testing.assert_allclose(step.u, steps[-1].u, atol=1e-6)


def test_newton_halves_steps_that_fail(equations):
    cost = Cost()
    settings = LoadSteps(first=1.0, most=8, wanted=4)
    u = np.zeros(len(equations.supports.free))
    steps = list(load_steps(equations, u, solver=SparseSolver(), settings=settings, cost=cost))
    assert steps[-1].control == 1.0
    assert cost.factorisations > sum(step.iterations for step in steps)


def test_newton_that_cannot_converge_says_so(equations):
    settings = LoadSteps(most=1)
    u = np.zeros(len(equations.supports.free))
    with pytest.raises(PathStopped) as stopped:
        list(load_steps(equations, u, solver=SparseSolver(), settings=settings))
    assert stopped.value.outcome is Outcome.STALLED


def test_the_whole_path_is_in_equilibrium(equations):
    """Inside the branches as well as at their ends, and the force grows monotonically."""
    settings = Settings(order=20, tolerance=1e-4, arclength=True)
    u = np.zeros(len(equations.supports.free))
    steps = list(follow(equations, u, solver=SparseSolver(), settings=settings))
    controls = [step.branch(a)[1] for step in steps for a in np.linspace(0, step.branch.length, 6)]
    assert (np.diff(controls) >= 0.0).all()
    for step in steps:
        for a in np.linspace(0.0, step.branch.length, 6):
            assert equations.imbalance(equations.residual(*step.branch(a))) <= 1e-4
