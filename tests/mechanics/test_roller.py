"""Rollers in space: surfaces of revolution, frames, and the world turned around them."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from anmstrip.fem.sampling import ContactOperator
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.roller import Roller, Sides, polynomial
from levels import HOFF, LAW, random_unknowns, strip_of
from shapes import linear, rolled, rotation

number = st.floats(-1.0, 1.0)
axes = st.tuples(number, number, number).filter(lambda a: np.linalg.norm(a) > 1e-3)
SIDES = Sides(0.3, 0.2, 0.1)
PROFILES = {
    "cylinder": ((),), "taper": ((0.1,),), "crown": ((0.0, -0.2),), "odd": ((0.05, 0.1, -0.3),),
    "sides": ((), SIDES), "all": ((0.1, -0.2), SIDES),
}  # fmt: skip


@pytest.fixture(params=PROFILES.values(), ids=PROFILES)
def roller(request):
    return Roller("r", 0.5, (0.0, 0.0, 0.0), (0.3, 1.0, -0.2), *request.param)


def surface(roller, angle, s):
    """Point of the surface in the roller's frame, from its profile."""
    radius = roller.radius + sum(c * s**k for k, c in enumerate(roller.crown, start=1))
    if roller.sides is not None:
        radius -= 0.15 * sum(np.hypot(s - b, 0.1) - np.hypot(b, 0.1) for b in (0.2, -0.2))
    return np.array([radius * np.cos(angle), radius * np.sin(angle), s])


def numerical_normal(roller, angle, s):
    """From differences of the surface of revolution."""
    h = 1e-5
    around = (surface(roller, angle + h, s) - surface(roller, angle - h, s)) / (2 * h)
    along = (surface(roller, angle, s + h) - surface(roller, angle, s - h)) / (2 * h)
    normal = np.cross(around, along)
    return normal / np.linalg.norm(normal), around / np.linalg.norm(around)


def projection(roller, points):
    return roller.project(np.reshape(points, (3, -1))[: roller.rows])


def padded(roller, vector):
    return np.pad(vector, ((0, 3 - len(vector)), (0, 0)))


@pytest.mark.parametrize("angle", [0.0, 1.0, 3.0, -2.0])
@pytest.mark.parametrize("s", [-0.4, 0.0, 0.3])
def test_normal_is_that_of_the_surface_of_revolution(roller, angle, s):
    place = projection(roller, surface(roller, angle, s))
    normal, around = numerical_normal(roller, angle, s)
    np.testing.assert_allclose(padded(roller, roller.normal(place))[:, 0], normal, atol=1e-9)
    turning, meridian = roller.tangents(place, 3)[..., 0]
    np.testing.assert_allclose(turning, around, atol=1e-9)
    np.testing.assert_allclose(meridian, np.cross(normal, around), atol=1e-9)
    assert abs(place.gap[0]) < 1e-15


def distance(roller, point):
    """To the surface, by search along the meridian."""
    rho, s = np.hypot(*point[:2]), point[2]

    def squared(t):
        return (rho - roller.radius_at(t[0])) ** 2 + (s - t[0]) ** 2

    return np.sqrt(minimize(squared, [s], tol=1e-14, method="Nelder-Mead").fun)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_gap_is_the_distance_to_first_order(roller, sign):
    """Second-order error with a crown, none for a cylinder or a cone."""
    at = surface(roller, 0.7, 0.25)
    normal, _ = numerical_normal(roller, 0.7, 0.25)
    errors = []
    for gap in (1e-1, 1e-2):
        point = at + sign * gap * normal
        found = projection(roller, point).gap[0]
        assert abs(found) == pytest.approx(distance(roller, point), abs=0.2 * gap**2 + 1e-7)
        errors.append(abs(found - sign * gap))
    if len(roller.crown) < 2 and roller.sides is None:
        assert max(errors) < 1e-9
    else:
        assert errors[1] == pytest.approx(1e-2 * errors[0], rel=0.5)


@given(axis=axes)
def test_frames_are_right_handed(axis):
    roller = Roller("r", 0.5, (0.0, 0.0, 0.0), axis)
    np.testing.assert_allclose(roller.frame @ roller.frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(roller.frame) == pytest.approx(1.0)
    np.testing.assert_allclose(roller.frame[2], np.array(axis) / np.linalg.norm(axis), atol=1e-15)


def test_frame_of_a_roller_along_y_is_that_of_a_section():
    """e_1 up, e_2 = a × e_1 along x: the plane that a section moves in."""
    frame = Roller("r", 0.5, (0.0, 0.0, 0.0)).frame
    np.testing.assert_allclose(frame, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-16)


@given(angle=st.floats(-3.0, 3.0), s=st.floats(-0.5, 0.5), lift=st.floats(-0.1, 0.5))
def test_directions_are_orthonormal(angle, s, lift):
    roller = Roller("r", 0.5, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.05, 0.1, -0.3))
    point = surface(roller, angle, s)
    point[:2] *= 1.0 + lift
    place = projection(roller, point)
    basis = np.concatenate([roller.tangents(place, 3)[..., 0], roller.normal(place).T])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-14)


def test_polynomial_is_horner():
    s = np.array([0.5, -2.0])
    np.testing.assert_allclose(polynomial([1.0, 2.0, -3.0], s), 1.0 + 2.0 * s - 3.0 * s * s)
    roller = Roller("r", 0.5, (0.0, 0.0, 0.0), crown=(0.1, -0.2, 0.3))
    h = 1e-6
    difference = (roller.radius_at(s + h) - roller.radius_at(s - h)) / (2 * h)
    np.testing.assert_allclose(roller.slope_at(s), difference, rtol=1e-8)


@pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)
def test_slope_is_that_of_the_radius(profile):
    roller, s, h = (
        Roller("r", 0.5, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), *profile),
        np.array([0.3]),
        1e-6,
    )
    difference = (roller.radius_at(s + h) - roller.radius_at(s - h)) / (2 * h)
    np.testing.assert_allclose(roller.slope_at(s), difference, rtol=1e-8)


@given(alpha=st.floats(-0.5, 0.5), rho=st.floats(0.1, 2.0), s=st.floats(-1.0, 1.0))
def test_gap_to_a_cone_is_exact_at_any_distance(alpha, rho, s):
    """(ρ − r) cos α − s sin α, with tan α = taper: the distance to a straight generator."""
    cone = Roller("r", 0.6, (0.0, 0.0, 0.0), crown=(np.tan(alpha),))
    found = cone.project(np.array([[0.6 * rho], [0.8 * rho], [s]])).gap[0]
    assert found == pytest.approx((rho - 0.6) * np.cos(alpha) - s * np.sin(alpha), abs=1e-14)


def test_sides_are_cones_beside_a_cylinder():
    """Rounded over 1 mm they are within half of that, and of its slope, of sharp ones."""
    roller = Roller("r", 0.5, (0.0, 0.0, 0.0), sides=Sides(0.1, 0.3, 1e-3))
    s = np.linspace(-1.0, 1.0, 41)
    sharp = 0.5 - 0.1 * np.maximum(np.abs(s) - 0.3, 0.0)
    np.testing.assert_allclose(roller.radius_at(s), sharp, rtol=0.0, atol=0.05 * 1e-3 + 1e-7)
    assert roller.radius_at(np.zeros(1))[0] == 0.5


def contact_with(strip, roller):
    return Contact(roller, LAW, ContactOperator(strip))


def controls_of(roller, velocity, speed=0.7):
    return {
        "rollers.r.centre": np.array(roller.centre),
        "rollers.r.velocity": np.array(velocity),
        "rollers.r.surface_speed": np.array(speed),
    }


@pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)
def test_surface_velocity_is_that_of_a_rigid_body(profile):
    """V = ċ + ω × (x − c) on the surface: a point that moves so does not slip."""
    strip = strip_of("shell")
    roller = Roller("r", 0.4, (0.02, -0.1, -0.4), (0.1, 1.0, 0.2), *profile)
    contact = contact_with(strip, roller)
    x = contact.operator.apply(rolled(strip, 0.4))
    away = contact.operator.reference + x - np.array(roller.centre)[:, None]
    controls = controls_of(roller, [0.1, 0.3, -0.2])
    place = contact.seen(x, controls)
    on_surface = away - place.gap * contact.normal(place)
    if not roller.is_cylinder:  # straight down, where the gap is only of first order
        s = roller.unit_axis @ away
        radial = roller.frame[:2].T @ place.radial
        on_surface = np.outer(roller.unit_axis, s) + radial * roller.radius_at(s)
    spin = roller.unit_axis * 0.7 / roller.radius
    body = np.cross(spin, on_surface, axis=0) + np.array([[0.1], [0.3], [-0.2]])
    slip, _ = Friction(contact, HOFF).in_space(x, body, controls)
    assert np.abs(slip).max() < 1e-13
    standing, _ = Friction(contact, HOFF).in_space(x, 0.0 * body, controls)
    normal = contact.normal(place)
    tangential = body - normal * (body * normal).sum(axis=0)
    np.testing.assert_allclose(standing, -tangential, atol=1e-13)


def turned(strip, full, q):
    """The same strip with the whole of space turned."""
    reference = -linear(strip, np.zeros((3, 3)))
    return ((full + reference).reshape(-1, 3) @ q.T).ravel() - reference


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), profile=st.sampled_from(sorted(PROFILES)))
def test_turned_world_has_turned_forces(seed, profile):
    """Strip and roller turned together: contact and friction turn with them, for any axis."""
    strip, rng = strip_of("shell"), np.random.default_rng(seed)
    q = rotation(rng)
    roller = Roller("r", 0.4, (0.01, 0.02, -0.4), (0.1, 1.0, 0.05), *PROFILES[profile])
    assume(abs(roller.unit_axis[1]) > 0.5)
    other = Roller("r", 0.4, tuple(q @ roller.centre), tuple(q @ roller.axis), *PROFILES[profile])
    full = rolled(strip, 0.4) + 2e-3 * random_unknowns(strip, seed)
    v, velocity = random_unknowns(strip, seed + 1), rng.standard_normal(3)
    forces = []
    for made, state, rate, own in (
        (roller, full, v, velocity),
        (other, turned(strip, full, q), (v.reshape(-1, 3) @ q.T).ravel(), q @ velocity),
    ):
        contact = contact_with(strip, made)
        friction, controls = Friction(contact, HOFF), controls_of(made, own)
        x, w = contact.operator.apply(state), contact.operator.apply(rate)
        forces.append(
            [
                contact.operator.gather(contact.law(x, None, controls)).reshape(-1, 3),
                contact.operator.gather(friction.law(x, w, controls)).reshape(-1, 3),
            ]
        )
    for before, after in zip(*forces, strict=True):
        size = np.abs(before).max()
        assert size > 0.0
        np.testing.assert_allclose(after, before @ q.T, atol=1e-10 * size)


def test_section_feels_what_a_shell_feels_per_width():
    """A cylinder along y: pressure and friction of both are those of the same points."""
    shell, section = strip_of("shell"), strip_of("section")
    roller = Roller("r", 0.4, (0.03, 0.0, -0.4))
    controls = controls_of(roller, [0.1, 0.0, -0.2])
    rng = np.random.default_rng(3)
    x, v = 1e-2 * rng.standard_normal((2, 3, 9))
    x[1] = v[1] = 0.0
    here = ContactOperator(section)
    wide = ContactOperator(shell)
    on_line = np.isclose(wide.reference[1], 0.0)
    order = np.argsort(wide.reference[0][on_line])
    own = np.argsort(here.reference[0])
    assert len(own) == len(order) == 9
    part = wide.restricted(np.flatnonzero(on_line)[order])
    alone = here.restricted(own)
    contact = Contact(roller, LAW, part)
    thin = Contact(roller, LAW, alone, np.inf, section.kinematics)
    for effect, plane in ((contact, thin), (Friction(contact, HOFF), Friction(thin, HOFF))):
        found = plane.law(x[[0, 2]], v[[0, 2]], controls)
        expected = effect.law(x, v, controls)
        assert np.abs(expected).max() > 0.0
        np.testing.assert_allclose(found, expected[[0, 2]], rtol=1e-12)
        assert not expected[1].any()
