"""Contact and friction laws against their defining equations."""

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anmstrip.fem.strip import Material, Strip, grid
from anmstrip.mechanics.laws import (
    Algebraic,
    GradedSignorini,
    NortonHoff,
    RepulsiveSignorini,
    Signorini,
    TangentBeyond,
    Tanh,
)
from anmstrip.taylor.series import taylor_series

STIFFNESSES = 10.0 ** np.arange(3, 13)
LAWS = [Signorini, RepulsiveSignorini]
mpmath.mp.dps = 40


def hoff(q=0.05, omega=0.1):
    return NortonHoff(coefficient=0.3, exponent=q, omega=omega, speed=2.0)


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("stiffness", STIFFNESSES)
def test_the_inverse_contact_law_gives_the_reaction_back(kind, stiffness):
    law = kind(stiffness, eta=0.01, delta=1.0)
    reaction = np.geomspace(1e-3, 1e2, 60)
    assert law(law.gap(reaction)) == pytest.approx(reaction, rel=1e-10)


@given(gap=st.floats(-1e-3, 0.999), exponent=st.floats(3.0, 12.0))
def test_the_contact_law_is_the_root_of_its_quadratic(gap, exponent):
    K, eta, delta = 10.0**exponent, 0.01, 1.0
    R = Signorini(K, eta, delta)(gap)
    assert R * (R / K + gap) == pytest.approx(eta * (delta - gap), rel=1e-6 if gap < 0 else 1e-12)
    assert R > 0.0


@pytest.mark.parametrize("law", [GradedSignorini(1e4, 1e-6), RepulsiveSignorini(1e10, 1e-2, 1.0)])
def test_a_law_goes_on_along_its_tangent(law):
    """The same up to 1e6 Pa; beyond, by the slope R/w of p₀ exp(−h/w), and K/(1 + η δ K/R²)."""
    straight = TangentBeyond(law, 1e6)
    slope = 1e6 / 1e-6 if isinstance(law, GradedSignorini) else 1e10 / (1.0 + 1e-2 * 1e10 / 1e12)
    inside = np.linspace(straight.least, 3.0 * law.width, 20)
    assert straight(inside) == pytest.approx(law(inside), rel=1e-14)
    deeper = straight.least - 1e-5 * np.arange(1.0, 4.0)
    assert straight(deeper) == pytest.approx(1e6 + slope * 1e-5 * np.arange(1.0, 4.0), rel=1e-6)
    reactions = np.geomspace(1e3, 1e9, 20)
    assert straight(straight.gap(reactions)) == pytest.approx(reactions, rel=1e-9)
    series = taylor_series(straight, np.array([straight.least - 1e-5, 2e-6, 0.0]))
    assert series[1:] == pytest.approx([-slope * 2e-6, 0.0], rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "load"), [(Signorini, lambda h: 1.0 - h), (RepulsiveSignorini, 1)]
)
@pytest.mark.parametrize("gap", [1e-6, 0.5, 0.999, 30.0, 1e6])
def test_far_gaps_do_not_cancel(kind, load, gap):
    K, eta = mpmath.mpf(1e12), mpmath.mpf(0.01)
    p = eta * (load(mpmath.mpf(gap)) if callable(load) else load)
    exact = K / 2 * (-gap + mpmath.sqrt(mpmath.mpf(gap) ** 2 + 4 * p / K))
    assert kind(1e12, 0.01, 1.0)(gap) == pytest.approx(float(exact), rel=1e-12)


def test_the_papers_law_vanishes_at_delta_and_tends_to_minus_eta():
    law = Signorini(1e3, eta=0.01, delta=1.0)
    assert law(1.0) == 0.0
    assert law(1e6) == pytest.approx(-0.01, rel=1e-5)


def test_the_repulsive_law_is_positive_and_decays():
    law = RepulsiveSignorini(1e3, eta=0.01, delta=1.0)
    assert law(np.array([1.0, 10.0])) == pytest.approx([0.01, 0.001], rel=2e-5)


GRADED = GradedSignorini(pressure=2e4, width=1e-4)


def test_graded_contact_bears_its_pressure_on_the_surface():
    assert GRADED(0.0) == pytest.approx(2e4, rel=1e-14)
    assert GRADED.gap(2e4) == 0.0


@given(gap=st.floats(-9e-3, 5e-2))
def test_the_graded_law_grows_by_e_for_every_width(gap):
    assert GRADED(gap - GRADED.width) / GRADED(gap) == pytest.approx(np.e, rel=1e-10)


def test_a_graded_reaction_is_a_number_however_deep():
    """A strip that begins within a roller must not end in what is no number."""
    deep = GRADED(np.array([-1e-2, -1.0, -1e30, 0.0]))
    assert deep == pytest.approx([2e4 * np.exp(100.0)] * 3 + [2e4], rel=1e-12)
    orders = taylor_series(GRADED, np.array([[-1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]))
    assert np.isfinite(orders).all()
    assert orders[1] == pytest.approx([0.0, -2e8])


def test_the_inverse_graded_law_gives_the_reaction_back():
    reaction = np.geomspace(1e-4, 1e8, 60)
    assert GRADED(GRADED.gap(reaction)) == pytest.approx(reaction, rel=1e-9)


def test_far_away_graded_contact_is_nothing_at_all():
    assert GRADED(1.0) == 0.0
    orders = taylor_series(GRADED, np.array([1.0, -1.0, *np.zeros(11)]))
    assert np.array_equal(orders, np.zeros(13))


@pytest.mark.parametrize("gap", [-3e-4, 0.0, 5e-4])
def test_orders_of_the_graded_law(gap):
    def exact(a):
        return 2e4 * mpmath.exp(-gap / mpmath.mpf(GRADED.width) - a)

    path = np.zeros(13)
    path[:2] = gap, GRADED.width
    wanted = np.array(derivatives(exact, 12))
    assert taylor_series(GRADED, path) == pytest.approx(
        wanted, rel=1e-9, abs=1e-12 * abs(wanted).max()
    )


def derivatives(function, order):
    """Derivatives over factorials of a function of one variable at 0."""
    return [float(c) for c in mpmath.taylor(function, 0, order)]


@pytest.mark.parametrize("gap", [-0.02, 0.3])
def test_orders_of_the_contact_law(gap):
    K, eta, delta = 50, mpmath.mpf("0.25"), 1

    def exact(a):
        h = gap + a
        return mpmath.mpf(K) / 2 * (-h + mpmath.sqrt(h * h + 4 * eta * (delta - h) / K))

    path = np.zeros(13)
    path[:2] = gap, 1.0
    found = taylor_series(Signorini(50.0, 0.25, 1.0), path)
    assert found == pytest.approx(derivatives(exact, 12), rel=1e-9)


@pytest.mark.parametrize("slip", [0.0, 0.07, -1.5])
def test_orders_of_the_friction_law(slip):
    law = hoff()
    f, q, w, V = (mpmath.mpf(repr(x)) for x in (0.3, 0.05, 0.1, 2.0))

    def exact(a):
        v, R = slip + a, 1 + 2 * a
        return -f * R * (v * v + w * w * V * V) ** ((q - 1) / 2) * v / V**q

    path, normal = np.zeros((13, 1)), np.zeros(13)
    path[:2, 0], normal[:2] = (slip, 1.0), (1.0, 2.0)
    found = taylor_series(law, normal, path)[:, 0]
    wanted = np.array(derivatives(exact, 12))
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("law", [hoff(), Tanh(0.3, 0.1, 2.0), Algebraic(0.3, 2.0)])
@pytest.mark.parametrize("slip", [0.0, 1e-12, 1.0, 1e8])
def test_without_normal_force_there_is_no_friction_at_all(law, slip):
    assert (law(np.zeros(1), np.array([[slip], [-slip]])) == 0.0).all()


@pytest.mark.parametrize("law", [Tanh(0.3, 0.1, 2.0), Algebraic(0.3, 2.0)])
@given(slip=st.floats(-1e3, 1e3), across=st.floats(-1e3, 1e3))
def test_bounded_laws_stay_in_the_cone_and_oppose_slip(law, slip, across):
    v = np.array([slip, across])
    force = law(np.float64(5.0), v)
    assert np.hypot(*force) <= 0.3 * 5.0 * (1.0 + 1e-14)
    assert force @ v <= 0.0


def test_the_algebraic_law_in_full_slip_is_what_was_typed_and_keeps_a_slope():
    """v/√(v² + V_c²) at ten times V_c: 0.995 f R_N, slope 1/101^(3/2) of that at rest."""
    law, v = Algebraic(0.3, 2.0), np.array([20.0, 0.0])
    assert law.effective(20.0) == pytest.approx(0.3 * 10.0 / 101.0**0.5, rel=1e-12)
    assert law.effective(20.0) > 0.99 * 0.3
    slope = (law.effective(20.02) - law.effective(19.98)) / 0.04
    assert slope == pytest.approx(0.3 / 2.0 / 101.0**1.5, rel=1e-4)
    turned = law(np.float64(5.0), v[::-1])
    assert turned == pytest.approx(law(np.float64(5.0), v)[::-1], rel=1e-14)


def test_norton_hoff_leaves_the_cone_at_high_speed():
    law = NortonHoff(coefficient=0.3, exponent=0.1, omega=0.1, speed=2.0)
    assert law.effective(20.0) / 0.3 == pytest.approx(10.0**0.1, rel=1e-4)
    force = law(np.float64(1.0), np.array([20.0]))[0]
    assert force == pytest.approx(-1.2589 * 0.3, rel=1e-4)


def test_norton_hoff_tends_to_coulomb():
    law = hoff(q=1e-4, omega=1e-8)
    assert law(np.float64(1.0), np.array([1e-3]))[0] == pytest.approx(-0.3, rel=1e-3)


@pytest.mark.parametrize("law", [hoff(), Tanh(0.3, 0.1, 2.0), Algebraic(0.3, 2.0)])
def test_the_effective_coefficient_is_that_of_the_law(law):
    for slip in (1e-3, 0.1, 7.0):
        assert -law(np.float64(2.0), np.array([slip]))[0] == pytest.approx(
            2.0 * law.effective(slip)
        )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Material(-2e11, 0.3), r"Material: young = -2[0.e+1]*, expected .* above 0"),
        (lambda: Material(np.nan, 0.3), "Material: young = nan"),
        (lambda: Material(2e11, 0.5), "poisson = 0.5, expected .* above -1 and below 0.5"),
        (lambda: Material(2e11, 0.3, -1.0), "density = -1.0, expected .* of at least 0"),
        (lambda: Material(None, 0.3), "young = None"),  # type: ignore[arg-type]
        (lambda: Tanh(-0.1, 0.1, 1.0), "Tanh: coefficient = -0.1"),
        (lambda: Algebraic(np.array([0.1, np.nan]), 1.0), "coefficient = array"),
        (lambda: NortonHoff(0.1, -0.5, 0.1, 1.0), "exponent = -0.5, expected .* of at least 0"),
        (lambda: Signorini(1e10, 0.0, 1e-3), "Signorini: eta = 0.0"),
        (lambda: GradedSignorini(np.inf, 1e-4), "pressure = inf"),
        (lambda: RepulsiveSignorini(1e10, 1.0, -1e-3), "delta = -0.001"),
        (
            lambda: Strip(grid(np.arange(2.0), np.arange(2.0)), -1e-3, Material(2e11, 0.3)),
            "thickness = -",
        ),
    ],
)
def test_numbers_that_a_law_cannot_have_are_refused(make: Callable[[], object], words: str) -> None:
    """They made NaN, or a strip that pushes itself on, somewhere in a run."""
    with pytest.raises(ValueError, match=words):
        make()


def test_coefficients_that_may_vanish_and_linear_friction_are_no_mistake() -> None:
    """An exponent and a width of 0 are Coulomb's law, which the paper's figures show."""
    assert NortonHoff(1.0, 0.0, 0.0, 1.0).growth == 0.0
    assert Algebraic(np.array([0.0, 0.3]), 1.0).coefficient[0] == 0.0
    assert NortonHoff(0.0, 1.0, 0.1, 1.0).growth == 1.0
