"""Rollers that turn freely: moments of friction, drives, and the border of the tangent."""

from dataclasses import replace

import numpy as np
import pytest

from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import ContactOperator, SlopeOperator
from anmstrip.fem.strip import Scales, Supports
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.roller import Roller, combine
from anmstrip.mechanics.transport import DRIVEN, AlignedFriction, Drives, TurningFriction
from anmstrip.timestepping.formulas import AffineVelocity
from levels import HOFF, LAW, roller_of, strip_of

RATE = 7.0
CONTROLS = {
    f"rollers.{name}.{key}": np.array(value)
    for name, speed in (("r", 0.0), ("s", 0.3), ("t", 0.0))
    for key, value in {
        "centre": {"r": [0.0, 0.0, -0.4], "s": [0.1, 0.0, 0.3], "t": [-0.2, 0.0, -0.31]}[name],
        "velocity": [0.1, 0.0, 0.05], "surface_speed": speed, "torque": 0.2,
    }.items()
}  # fmt: skip
"""Roller s is driven by speed, the others turn freely."""


class Line:
    """A strip between three rollers, with the travels of two surfaces."""

    def __init__(self, level):
        self.strip = strip_of(level)
        first = roller_of(level)
        self.rollers = [
            Roller("r", 0.4, (0.0, 0.0, -0.4), first.axis, first.crown),
            Roller("s", 0.3, (0.1, 0.0, 0.3), sense=-1.0),
            Roller("t", 0.3, (-0.2, 0.0, -0.31), sense=-1.0),
        ]
        operator, which = ContactOperator(self.strip), np.arange(3)
        pairs = operator.restricted(np.tile(np.arange(operator.points), 3))
        together = combine(self.rollers, np.repeat(which, operator.points))
        contact = Contact(together, LAW, pairs, (0.1, 0.1, 0.1), self.strip.kinematics)
        numbers, n = (0, DRIVEN, 1), self.strip.unknowns
        self.friction = TurningFriction(contact, HOFF, (0.3, 0.2, 0.1), numbers, 2)
        radii, bearings = np.array([0.4, 0.3]), np.array([5.0, 0.0])
        self.drives = Drives(("r", "t"), radii, bearings, 0.2, 0.7, n)
        effects = [contact, self.friction, self.drives]
        scales = Scales(1.0, 1.0, 1.0)
        self.model = Model(self.strip, Pattern(self.strip), effects, scales, ("r", "t"))
        rng = np.random.default_rng(3)
        unit = np.append(np.repeat(self.strip.dof_lengths, self.strip.count), [1.0, 1.0])
        self.full = 1e-3 * unit * rng.standard_normal(n + 2)
        self.velocity = unit * rng.standard_normal(n + 2)

    def equations(self):
        supports = Supports.at_rest(self.model.unknowns, np.array([], dtype=int))
        affine = AffineVelocity(RATE, self.velocity - RATE * self.full, 0.1 * self.velocity)
        slope = {"rollers.r.torque": np.array(3.0), "rollers.s.surface_speed": np.array(0.5)}
        return Equilibrium(self.model, supports, Controls(CONTROLS, slope), affine)


@pytest.fixture(scope="module", params=["section", "shell"])
def line(request):
    return Line(request.param)


def test_friction_on_a_strip_is_that_of_driven_rollers_as_fast(line):
    """A roller that turns freely with some speed rubs like one that is driven with it."""
    n, contact = line.strip.unknowns, line.friction.contact
    speeds = dict(zip(("r", "t"), line.velocity[n:], strict=True))
    controls = CONTROLS | {f"rollers.{k}.surface_speed": np.array(v) for k, v in speeds.items()}
    driven = Friction(contact, HOFF, (0.3, 0.2, 0.1))
    expected = driven.force(line.full[:n], line.velocity[:n], controls)
    found = line.friction.force(line.full, line.velocity, CONTROLS)
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(found[:n], expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("level", ["section", "shell"])
def test_strip_that_lies_flat_does_not_slip_beside_the_top_of_a_roller_as_fast(level):
    strip, speed = strip_of(level), 2.0
    contact = Contact(Roller("r", 0.4, (0.0, 0.0, -0.4)), LAW, ContactOperator(strip), 0.1)
    contact = replace(contact, kinematics=strip.kinematics)
    moving = np.zeros((strip.scalars, strip.count))
    moving[strip.node_values, 0] = speed
    controls = {
        "rollers.r.centre": np.array([0.0, 0.0, -0.4]),
        "rollers.r.velocity": np.zeros(3),
        "rollers.r.surface_speed": np.array(speed),
    }
    slips = []
    for friction in (
        AlignedFriction(contact, HOFF, None, (DRIVEN,), 0, SlopeOperator(strip)),
        Friction(contact, HOFF),
    ):
        x, v = (friction.operator.apply(u) for u in (np.zeros(strip.unknowns), moving.ravel()))
        slips.append(friction.sliding(x, v, controls)[2])
    x = contact.operator.reference[0]
    assert np.abs(slips[0]).max() < 1e-12
    lag = 1.0 - 0.4 / np.hypot(0.4, x)
    assert -slips[1][0] == pytest.approx(speed * lag, abs=1e-9)


def test_a_free_roller_balances_moments_about_its_axis(line):
    """Friction crossed with the distance to the axis, drag of the bearings, torque."""
    n = line.strip.unknowns
    total = line.model.force(line.full, line.velocity, Controls(CONTROLS), 0.0)[n:]
    reading, v = line.friction.by_roller, line.velocity[n:]
    for number, name in enumerate(("r", "t")):
        part, roller = reading[name], next(r for r in line.rollers if r.name == name)
        near = part.near(line.full, CONTROLS)
        x, speed = (near.operator.apply(u) for u in (line.full, line.velocity))
        _, traction = near.in_space(x, speed, CONTROLS)
        embed = line.strip.kinematics.embed
        place = near.operator.contact.reference + embed(x[:-1])
        seen = near.contact.seen(x[:-1], CONTROLS)
        place = place - np.array(roller.centre)[:, None] - seen.gap * near.contact.normal(seen)
        moments = roller.sense * (roller.unit_axis @ np.cross(place, traction, axis=0))
        torque = float(moments @ near.operator.weights)
        drag = 5.0 * v[0] / np.hypot(v[0], 0.2) if name == "r" else 0.0
        assert abs(torque) > 0.01
        expected = (torque + drag - 0.2) / roller.radius + 0.7 * v[number]
        assert total[number] == pytest.approx(expected, abs=1e-3 * abs(torque))


def test_the_border_is_the_derivative(line):
    """Columns, rows and corner, by differences along every unknown of a roller and some others."""
    equations, u = line.equations(), line.full
    tangent = equations.recurrence(u, 0.4, 1).tangent().assembled()
    size = abs(tangent).max()
    rng = np.random.default_rng(8)
    n, unit = line.strip.unknowns, line.model.units
    changes = [np.eye(n + 2)[n], np.eye(n + 2)[n + 1], unit * rng.standard_normal(n + 2)]
    for change in changes:
        h = 1e-6
        ahead, behind = (equations.residual(u + s * h * change, 0.4) for s in (1.0, -1.0))
        expected = (ahead - behind) / (2.0 * h)
        assert np.abs(expected[n:]).max() > 0.0
        np.testing.assert_allclose(tangent @ change, expected, atol=1e-7 * size)


def test_orders_are_those_of_the_residual_along_a_line(line):
    """The series of u + a u_1 and λ + a, of which the residual is a smooth function."""
    from orders import orders

    equations, count = line.equations(), 5
    rng, n = np.random.default_rng(4), line.strip.unknowns
    change = 1e-3 * line.model.units * rng.standard_normal(n + 2)
    series = equations.recurrence(line.full, 0.2, count)
    found = [series.residual]
    first = series.tangent().assembled() @ change + series.control_derivative()
    found.append(first)
    series.correct(1, change, 1.0)
    for k in range(2, count):
        found.append(series.advance(k))
        series.correct(k, np.zeros(n + 2), 0.0)
    for place in (n, n + 1):

        def at(a, place=place):
            return equations.residual(line.full + a * change, 0.2 + a)[place]

        expected = orders(at, 0.2, count)
        scale = np.abs(expected).max() / 0.2 ** np.arange(count)
        assert (np.abs(np.array(found)[:, place] - expected) < 1e-8 * scale).all()


def test_a_single_roller_turns_as_one_of_several(line):
    n, contact = line.strip.unknowns, line.friction.contact
    single = contact.by_roller["t"]
    alone = TurningFriction(single, HOFF.with_coefficient(0.1), None, (1,), 2)
    both = line.friction.force(line.full, line.velocity, CONTROLS)
    found = alone.force(line.full, line.velocity, CONTROLS)
    assert found[n] == 0.0
    assert found[n + 1] == pytest.approx(both[n + 1], rel=1e-12)
