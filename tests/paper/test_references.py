"""References of the mass-spring cases: checked by what they must satisfy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anmstrip.mechanics.laws import NortonHoff
from anmstrip.paper.mass_spring import (
    CASES,
    MovingPlane,
    Parameters,
    RotatingCircle,
    balanced_reactions,
    coulomb,
    reduced,
    reference_solution,
    slip_at,
)

TIMES = np.linspace(0.05, 1.75, 15)


@given(
    slip=st.floats(1e-12, 1e4),
    q=st.floats(0.02, 1.0),
    omega=st.floats(1e-8, 1.0),
    sign=st.sampled_from([-1, 1]),
)
def test_slip_at_inverts_the_friction_law(slip, q, omega, sign):
    law = NortonHoff(0.3, q, omega, 2.0)
    assert slip_at(law, sign * law.effective(slip)) == pytest.approx(sign * slip, rel=1e-10)


def test_slip_at_rest_is_zero():
    assert slip_at(NortonHoff(0.3, 0.05, 0.1, 1.0), 0.0) == 0.0


@pytest.mark.parametrize("name", CASES)
def test_the_reduced_equation_satisfies_the_full_one(name):
    case = CASES[name]()
    equation, h = reduced(case), 1e-6
    for t in TIMES:
        z = np.array(0.02)
        rate = equation.rate(t, z)
        u = equation.displacement(t, z)
        v = equation.displacement(t + h, z + h * rate) - equation.displacement(t - h, z - h * rate)
        assert case.residual(u, v / (2 * h), t) == pytest.approx(0.0 * u, abs=2e-7)


def test_coulomb_on_the_circle():
    exact = coulomb(RotatingCircle())
    assert exact.until == pytest.approx(1.805, abs=1e-3)
    t = np.linspace(1.01, 1.8, 300)
    u = exact.displacement(t)
    normal, tangential = balanced_reactions(RotatingCircle(), t, u)
    assert (np.abs(tangential) <= 0.3 * normal * (1 + 1e-9)).all()
    phi = np.arctan2(u[:, 0], u[:, 1] + 1.5)
    sticking = np.gradient(phi, t)[t > 1.12]
    assert sticking == pytest.approx(np.ones_like(sticking), rel=1e-6)
    sliding = t < 1.1
    assert tangential[sliding] == pytest.approx(0.3 * normal[sliding], rel=1e-9)
    assert np.isnan(exact.displacement(np.array([1.9]))).any()


def test_coulomb_on_the_plane():
    t = np.linspace(0.0, 3.0, 61)
    u = coulomb(MovingPlane()).displacement(t)
    normal, tangential = balanced_reactions(MovingPlane(), t, u)
    assert u[-1] == pytest.approx([0.6, -1.0])
    assert tangential == pytest.approx(0.3 * normal)
    slow = coulomb(MovingPlane(Parameters(V=0.1))).displacement(t)
    assert slow[-1, 0] == pytest.approx(0.2)


def test_the_distance_forgives_a_shift_in_time_but_no_other():
    reference = reference_solution(MovingPlane(Parameters(t_end=2.0)))
    (u,) = reference([1.5])
    v = (reference([1.51]) - reference([1.49]))[0] / 0.02
    assert reference.distance(1.5, u, 1.0) < 1e-12
    assert reference.distance(1.5, u + np.array([0.0, 1e-3]), 1.0) == pytest.approx(1e-3, rel=0.1)
    assert reference.distance(1.5, u + 1e-3 * v, 1.0) < 0.5e-3
