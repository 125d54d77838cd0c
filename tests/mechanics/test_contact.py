"""Contact and friction with a roller, and the points where they are looked at."""

from dataclasses import replace

import numpy as np
import pytest

from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import ContactOperator, RepeatedOperator
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.laws import NortonHoff, RepulsiveSignorini, Tanh
from anmstrip.mechanics.loads import weight
from anmstrip.mechanics.roller import Roller, Sides, combine
from anmstrip.taylor.series import taylor_series
from anmstrip.timestepping.formulas import AffineVelocity
from orders import orders
from shapes import linear, rolled

XS, YS = np.array([-0.3, -0.1, 0.0, 0.05, 0.3]), np.array([-0.2, 0.0, 0.3])
RADIUS = 0.4
LAW = RepulsiveSignorini(stiffness=1e6, eta=100.0, delta=1e-2)
"""Soft: the corner of the law is √(4 η δ/K) = 2 mm wide."""

SPINNING = {
    "rollers.r.centre": np.array([0.0, 0.0, -RADIUS]),
    "rollers.r.velocity": np.array([0.1, 0.0, -0.2]),
    "rollers.r.surface_speed": np.array(0.7),
}
HOFF, TANH = NortonHoff(0.3, 0.2, 0.1, 0.5), Tanh(0.3, 0.1, 0.5)


@pytest.fixture(scope="module")
def strip():
    return Strip(grid(XS, YS), 1e-2, Material(2e9, 0.3, 1000.0))


@pytest.fixture(scope="module")
def operator(strip):
    return ContactOperator(strip)


@pytest.fixture(scope="module")
def contact(operator):
    return Contact(Roller("r", RADIUS, (0.0, 0.0, -RADIUS)), LAW, operator)


def rng_unknowns(strip, seed):
    direction = np.random.default_rng(seed).standard_normal(strip.unknowns)
    return direction * np.repeat(strip.dof_lengths, 3)


def test_weights_are_areas(strip, operator):
    assert operator.points == (2 * 4 + 1) * (2 * 2 + 1)
    assert (operator.weights > 0.0).all()
    assert operator.weights.sum() == pytest.approx(strip.length * strip.width, rel=1e-14)


def test_points_carry_the_consistent_load_of_a_uniform_pressure(strip, operator):
    """∫ φ dA of all dofs, derivatives too: Simpson's rule is exact for cubics."""
    unit = np.zeros((3, operator.points))
    unit[2] = 1.0
    found = operator.gather(unit).reshape(-1, 3)
    exact = weight(strip).load / (1000.0 * 1e-2)
    np.testing.assert_allclose(found[:, 2], exact, rtol=1e-12, atol=1e-16)
    assert np.abs(exact[strip.basis.nodal_dofs[3]]).min() > 0.0
    assert not found[:, :2].any()


def test_points_see_the_surface(strip, operator):
    """Bilinear fields are reproduced at nodes, sides and centres alike."""
    full = linear(strip, [[1.1, 0.2, 0], [0.3, 0.9, 0], [0.5, -0.4, 1]], (1.0, 2.0, 3.0))
    x, y, _ = operator.reference
    expected = [0.1 * x + 0.2 * y + 1, 0.3 * x - 0.1 * y + 2, 0.5 * x - 0.4 * y + 3]
    np.testing.assert_allclose(operator.apply(full), expected, rtol=1e-12, atol=1e-13)


def test_gather_is_the_weighted_transpose_of_apply(strip, operator):
    u = rng_unknowns(strip, 1)
    forces = np.random.default_rng(2).standard_normal((3, operator.points))
    power = (operator.apply(u) * forces * operator.weights).sum()
    assert operator.gather(forces) @ u == pytest.approx(power, rel=1e-12)


def test_restricted_operator_is_the_same_rows(strip, operator):
    chosen = np.array([0, 7, 8, 20, 44])
    part, u = operator.restricted(chosen), rng_unknowns(strip, 3)
    assert part.points == 5
    np.testing.assert_array_equal(part.chosen, chosen)
    np.testing.assert_array_equal(part.apply(u), operator.apply(u)[:, chosen])
    np.testing.assert_array_equal(part.reference, operator.reference[:, chosen])
    forces = np.random.default_rng(4).standard_normal((3, 5))
    spread = np.zeros((3, operator.points))
    spread[:, chosen] = forces
    np.testing.assert_allclose(part.gather(forces), operator.gather(spread), atol=1e-15)
    again = part.restricted(np.array([1, 3]))
    np.testing.assert_array_equal(again.chosen, chosen[[1, 3]])
    pattern = Pattern(strip)
    blocks, expected = pattern.zeros(), pattern.zeros()
    derivative = np.random.default_rng(5).standard_normal((3, 3, 5))
    every = np.zeros((3, 3, operator.points))
    every[:, :, chosen] = derivative
    part.add_tangent(derivative, pattern, blocks)
    operator.add_tangent(every, pattern, expected)
    assert expected.pairs.any()
    np.testing.assert_allclose(blocks.pairs, expected.pairs, atol=1e-15)


def test_operator_of_no_points_makes_no_force(strip, operator):
    none = operator.restricted(np.array([], dtype=int))
    assert none.apply(rng_unknowns(strip, 1)).shape == (3, 0)
    assert not none.gather(np.zeros((3, 0))).any()


def equations_of(strip, effects, rate):
    model = Model(strip, Pattern(strip), effects, Scales(1.0, 1.0, 1.0))
    supports = Supports.at_rest(strip.unknowns, np.array([], dtype=int))
    base = rng_unknowns(strip, 11) * 0.05
    velocity = AffineVelocity(rate, base, np.zeros_like(base)) if rate else None
    slope = {"rollers.r.centre": np.array([0.0, 0.0, -0.01])}
    return Equilibrium(model, supports, Controls(SPINNING, slope), velocity)


@pytest.mark.parametrize("law", [None, HOFF, TANH], ids=["frictionless", "norton-hoff", "tanh"])
@pytest.mark.parametrize("depth", [-0.02, 0.0, 0.02], ids=["apart", "touching", "pressed"])
def test_contact_tangent_is_the_derivative(strip, contact, law, depth):
    effects = [contact] if law is None else [contact, Friction(contact, law)]
    equations = equations_of(strip, effects, 3.0 if law else 0.0)
    units = np.repeat(strip.dof_lengths, 3)
    full = rolled(strip, RADIUS - depth) + 1e-3 * rng_unknowns(strip, 12)
    tangent = equations.recurrence(full, 0.3, 1).tangent()
    assert abs(tangent).max() > 0.0
    scaled = tangent.multiply(units[:, None]).multiply(units[None, :])
    antisymmetry = abs(scaled - scaled.T).max() / abs(scaled).max()
    assert (antisymmetry < 1e-12) == (law is None)
    for seed in (21, 22):
        direction, step = rng_unknowns(strip, seed), 1e-7
        ahead, back = (equations.residual(full + s * direction, 0.3) for s in (step, -step))
        expected, found = (ahead - back) / (2 * step) * units, (tangent @ direction) * units
        assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def seen(contact, x):
    """Gap, normal in space and pressure."""
    place = contact.seen(x, SPINNING)
    return place.gap, contact.normal(place), contact.pressure(place)


def test_resultant_is_the_integral_of_the_pressure(strip, contact, operator):
    """p over a cylindrical arc of half angle α gives 2 p r sin α per width."""
    full = rolled(strip, RADIUS - 1e-3)
    gap, normal, pressure = seen(contact, operator.apply(full))
    np.testing.assert_allclose(gap[np.isin(operator.reference[0], XS)].max(), gap.max())
    traction = -contact.law(operator.apply(full), None, SPINNING)
    np.testing.assert_allclose(traction, normal * pressure)
    force = operator.gather(traction).reshape(-1, 3)[strip.node_values].sum(axis=0)
    np.testing.assert_allclose(force, (traction * operator.weights).sum(axis=1), rtol=1e-12)
    flat = linear(strip, np.eye(3), (0.0, 0.0, -1e-3))
    centre = np.argmin(np.abs(operator.reference).sum(axis=0))
    at_centre = seen(contact, operator.apply(flat))[2][centre]
    assert at_centre == pytest.approx(float(LAW(np.array(-1e-3))))


def test_resultant_of_an_arc(contact):
    """Fine mesh, off-centre cylinder at uniform depth: closed form 2 p ρ sin(L/2ρ)."""
    strip = Strip(grid(np.linspace(-0.3, 0.3, 25), YS), 1e-2, Material(2e9, 0.3))
    depth = 1e-3
    radius = RADIUS - depth
    operator = ContactOperator(strip)
    fine = Contact(Roller("r", RADIUS, (0.0, 0.0, -radius)), LAW, operator)
    controls = {"rollers.r.centre": np.array([0.0, 0.0, -radius])}
    traction = -fine.law(operator.apply(rolled(strip, radius)), None, controls)
    total = (traction * operator.weights).sum(axis=1)
    pressure = float(LAW(np.array(-depth)))
    exact = 2.0 * pressure * radius * np.sin(0.3 / radius) * strip.width
    np.testing.assert_allclose(total, [0.0, 0.0, exact], rtol=1e-5, atol=1e-9 * exact)


@pytest.mark.parametrize("law", [HOFF, TANH])
def test_friction_opposes_slip_in_the_tangent_plane(strip, contact, operator, law):
    friction = Friction(contact, law)
    x = operator.apply(rolled(strip, RADIUS) + 1e-3 * rng_unknowns(strip, 13))
    v = operator.apply(rng_unknowns(strip, 14))
    _, normal, pressure = seen(contact, x)
    slip, traction = friction.in_space(x, v, SPINNING)
    assert np.abs((slip * normal).sum(axis=0)).max() < 1e-12
    assert np.abs((traction * normal).sum(axis=0)).max() < 1e-9
    assert ((slip * traction).sum(axis=0) < 0.0).all()
    speed = np.linalg.norm(slip, axis=0)
    expected = [law.effective(s) * p for s, p in zip(speed, pressure, strict=True)]
    np.testing.assert_allclose(np.linalg.norm(traction, axis=0), expected, rtol=1e-12)


def test_strip_that_moves_with_the_surface_has_no_friction(strip, contact, operator):
    """V = ċ + Ω r a × n: at the top of the roller along +x for a positive speed."""
    friction = Friction(contact, HOFF)
    x = operator.apply(rolled(strip, RADIUS))
    turning = np.cross([0.0, 1.0, 0.0], seen(contact, x)[1], axis=0)
    own = SPINNING["rollers.r.velocity"][:, None]
    surface = turning * SPINNING["rollers.r.surface_speed"] + own
    top = np.argmin(np.abs(operator.reference).sum(axis=0))
    np.testing.assert_allclose(surface[:, top], [0.8, 0.0, -0.2], atol=1e-12)
    assert np.abs(friction.in_space(x, surface, SPINNING)[1]).max() < 1e-12


@pytest.mark.parametrize("law", [HOFF, TANH])
@pytest.mark.parametrize("speed", [0.0, 1e-3, 1.0])
def test_no_pressure_no_friction(law, speed):
    traction = law(np.zeros(4), np.full((3, 4), speed))
    np.testing.assert_array_equal(np.abs(traction), np.zeros((3, 4)))


@pytest.fixture(scope="module")
def reaching(contact):
    """The same contact up to 20 mm."""
    return Contact(contact.roller, LAW, contact.operator, reach=0.02)


def lifted(strip, gap):
    """A flat strip whose line x = 0 is a gap above the roller."""
    return linear(strip, np.eye(3), (0.0, 0.0, gap))


def test_points_out_of_reach_are_left_out(strip, reaching):
    chosen = reaching.near(lifted(strip, 0.0), SPINNING).operator.chosen
    x = reaching.operator.reference[0]
    within = np.sqrt(x**2 + RADIUS**2) - RADIUS < 0.02
    assert 0 < within.sum() < len(x)
    np.testing.assert_array_equal(np.sort(chosen), np.flatnonzero(within))


@pytest.mark.parametrize("law", [HOFF, TANH])
def test_strip_out_of_reach_feels_exactly_nothing(strip, reaching, law):
    equations = equations_of(strip, [reaching, Friction(reaching, law)], 3.0)
    full = lifted(strip, 0.03)
    assert not equations.residual(full, 0.0).any()
    series = equations.recurrence(full, 0.0, 3)
    assert not series.residual.any()
    assert series.tangent().count_nonzero() == 0
    assert not series.control_derivative().any()
    assert not series.advance(2).any()


def test_pressure_begins_at_the_reach_without_a_jump(strip, reaching):
    """The force grows in proportion to the depth below the reach, from zero."""
    equations = equations_of(strip, [reaching], 0.0)
    forces = [
        np.abs(equations.residual(lifted(strip, 0.02 - depth), 0.0)).max()
        for depth in (1e-5, 1e-7, 1e-9)
    ]
    assert forces[0] > 0.0
    assert forces[1] == pytest.approx(1e-2 * forces[0], rel=1e-2)
    assert forces[2] == pytest.approx(1e-4 * forces[0], rel=1e-2)


def test_contact_orders_are_its_derivatives(contact):
    """Contact and friction at one point, on a path through first contact."""
    single = Contact(contact.roller, LAW, contact.operator.restricted(np.array([12])))
    friction = Friction(single, HOFF)
    reference = single.operator.reference
    path = np.zeros((8, 3, 1))
    path[0], path[1] = np.array([[0.05], [0.0], [0.001]]) - reference, [[0.01], [0.02], [-0.01]]
    speed = np.zeros((8, 3, 1))
    speed[0], speed[1] = [[0.5], [0.1], [0.0]], [[0.3], [-0.2], [0.1]]
    path[0, 2] -= RADIUS - np.sqrt(RADIUS**2 - 0.05**2)
    for law in (
        lambda x, v: single.law(x, None, SPINNING),
        lambda x, v: friction.law(x, v, SPINNING),
    ):
        coefficients = taylor_series(law, path, speed)

        def at(a, law=law):
            return law(path[0] + a * path[1], speed[0] + a * speed[1])[:, 0]

        size = np.abs(at(0.0)).max()
        assert size > 100.0
        for i in range(3):
            expected = orders(lambda a, i=i, at=at: at(a)[i], 0.04, 5, nodes=20)
            allowed = 1e-9 * size / 0.02 ** np.arange(5)
            assert (np.abs(coefficients[:5, i, 0] - expected) < allowed).all()


THREE = (
    Roller("a", RADIUS, (0.0, 0.0, -RADIUS)),
    Roller("b", 0.3, (0.1, 0.0, 0.31), axis=(0.1, 1.0, 0.0)),
    Roller("c", 0.25, (-0.2, 0.0, -0.26), crown=(0.0, -0.05), sides=Sides(0.1, 0.05, 0.02)),
)
SEVERAL = {
    f"rollers.{roller.name}.{key}": np.asarray(value)
    for roller, speed in zip(THREE, (0.7, -0.4, 0.2), strict=True)
    for key, value in {
        "centre": np.array(roller.centre), "velocity": np.array([0.1, 0.0, speed]),
        "surface_speed": speed,
    }.items()
}  # fmt: skip


@pytest.mark.parametrize("rubbing", [False, True], ids=["contact", "friction"])
@pytest.mark.parametrize("reach", [np.inf, (0.02, 0.01, 0.03)], ids=["all", "near"])
def test_rollers_together_do_what_each_does_alone(strip, operator, rubbing, reach):
    """Forces and tangent of all pairs are the sums over the rollers."""
    full, velocity = 1e-3 * rng_unknowns(strip, 21), rng_unknowns(strip, 22)
    reaches = np.broadcast_to(reach, 3)
    pairs = operator.restricted(np.tile(np.arange(operator.points), 3))
    many = Contact(
        combine(THREE, np.repeat(np.arange(3), operator.points)), LAW, pairs, tuple(reaches)
    )
    alone = [Contact(r, LAW, operator, float(h)) for r, h in zip(THREE, reaches, strict=True)]
    effects = [[many], alone]
    if rubbing:
        effects = [[Friction(c, HOFF) for c in some] for some in effects]
    forces, tangents = [], []
    for some in effects:
        model = Model(strip, Pattern(strip), some, Scales(1.0, 1.0, 1.0))
        supports = Supports.at_rest(strip.unknowns, np.array([], dtype=int))
        affine = AffineVelocity(5.0, velocity, np.zeros_like(velocity))
        slope = {"rollers.a.centre": np.array([0.0, 0.0, -0.01]), "rollers.b.surface_speed": 2.0}
        equations = Equilibrium(model, supports, Controls(SEVERAL, slope), affine)
        forces.append(equations.residual(full, 0.3))
        tangents.append(equations.recurrence(full, 0.3, 1).tangent())
    assert np.abs(forces[0]).max() > 0.0
    scale = np.abs(forces[1]).max()
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-12 * scale)
    difference = abs(tangents[0] - tangents[1]).max()
    assert difference < 1e-12 * abs(tangents[1]).max()


def test_one_of_several_rollers_can_be_looked_at(strip, operator):
    pairs = operator.restricted(np.tile(np.arange(operator.points), 3))
    many = Contact(combine(THREE, np.repeat(np.arange(3), operator.points)), LAW, pairs)
    assert list(many.by_roller) == ["a", "b", "c"]
    x = operator.apply(1e-3 * rng_unknowns(strip, 23))
    for roller in THREE:
        single, expected = many.by_roller[roller.name], Contact(roller, LAW, operator)
        gap, found = expected.seen(x, SEVERAL).gap, single.seen(x, SEVERAL)
        np.testing.assert_allclose(found.gap, gap, atol=1e-14)
        normal = single.normal(found)
        np.testing.assert_allclose(np.linalg.norm(normal, axis=0), 1.0)


def test_pairs_are_made_where_they_are_near(strip, operator):
    """Of every point with every roller; the numbers of all pairs only if somebody asks."""
    rollers = combine(THREE, np.repeat(np.arange(3), operator.points))
    pairs = RepeatedOperator(operator, 3)
    many = Contact(rollers, LAW, pairs, (0.02, 0.01, 0.03))
    every = operator.restricted(np.tile(np.arange(operator.points), 3))
    made = Contact(rollers, LAW, every, (0.02, 0.01, 0.03))
    full = 1e-3 * rng_unknowns(strip, 26)
    forces = [effect.force(full, None, SEVERAL) for effect in (many, made)]
    assert np.abs(forces[0]).max() > 0.0
    np.testing.assert_array_equal(*forces)
    assert not {"matrix", "weights"} & set(vars(pairs)) and "radius" not in vars(rollers)
    np.testing.assert_array_equal(pairs.weights, every.weights)
    centres = [roller.centre for roller in THREE]
    np.testing.assert_array_equal(rollers.centre.T, np.repeat(centres, operator.points, axis=0))
    np.testing.assert_array_equal(pairs.apply(full), every.apply(full))


def test_every_roller_may_have_its_own_friction(strip, operator):
    """Together as alone, with the law's coefficient where a roller has none of its own."""
    pairs = operator.restricted(np.tile(np.arange(operator.points), 3))
    contact = Contact(combine(THREE, np.repeat(np.arange(3), operator.points)), LAW, pairs)
    own = (0.1, 0.3, 0.0)
    many = Friction(contact, HOFF, own)
    x, v = (operator.apply(rng_unknowns(strip, seed)) for seed in (24, 25))
    stacked = [np.tile(values, 3) for values in (1e-3 * x, v)]
    found = many.law(*stacked, SEVERAL).reshape(3, 3, -1)
    for k, (roller, f) in enumerate(zip(THREE, own, strict=True)):
        alone = Friction(Contact(roller, LAW, operator), replace(HOFF, coefficient=f))
        expected = alone.law(1e-3 * x, v, SEVERAL)
        np.testing.assert_allclose(found[:, k], expected, rtol=1e-12, atol=1e-9)
        assert many.by_roller[roller.name].law_of_slip.coefficient == f
    assert np.abs(found[:, 1]).max() > 0.0


@pytest.mark.parametrize(
    ("before", "after", "turned"),
    [(1.0, -0.3, True), (1.0, 0.3, False), (1.0, -1e-3, False), (-1e-3, 0.5, False)],
)
@pytest.mark.parametrize("law", [HOFF, TANH])
def test_slip_turns_round_only_where_friction_is_near_its_cone_before_and_after(
    strip, contact, law, before, after, turned
):
    """At rest the strip slips against the surface by its speed; ω V_c is 0.05 m/s."""
    still = np.zeros(strip.unknowns)
    friction = Friction(contact, law)
    speeds = (np.array(speed * 1.0) for speed in (before, after))
    here = {"rollers.r.centre": np.array([0.0, 0.0, -RADIUS]), "rollers.r.velocity": np.zeros(3)}
    moments = [(still, still, {**here, "rollers.r.surface_speed": s}) for s in speeds]
    twice = (
        2.0
        * 0.3
        * (
            contact.pressure(contact.seen(0.0 * contact.operator.reference, here))
            @ contact.operator.weights
        )
    )
    assert friction.reversed_friction(*moments) == pytest.approx(
        twice if turned else 0.0, rel=1e-12
    )
