"""Small strips of every level of description, and orders of a residual along a line."""

import numpy as np

from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.geometry import KINEMATICS
from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import ContactOperator, SlopeOperator
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid, line
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.laws import NortonHoff, RepulsiveSignorini
from anmstrip.mechanics.loads import Pretension, edge_moment, edge_tension, pressure
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.shell import KirchhoffLove, Membrane, isometric_bending
from anmstrip.mechanics.transport import DRIVEN, AlignedFriction
from anmstrip.timestepping.formulas import AffineVelocity
from orders import orders

XS, YS = np.array([-0.5, -0.2, 0.0, 0.1, 0.5]), np.array([-0.2, 0.0, 0.3])
WIDTH, THICKNESS = 0.5, 1e-2
LAW = RepulsiveSignorini(stiffness=1e6, eta=100.0, delta=1e-2)
HOFF = NortonHoff(0.3, 0.2, 0.1, 0.5)

CONTROLS = Controls(
    {
        "pressure": np.array(3e3),
        "entry.tension": np.array(5e3),
        "exit.tension": np.array(7e3),
        "exit.moment": np.array(50.0),
        "exit.force": np.array([2e3, 0.0, 0.0]),
        "rollers.r.centre": np.array([0.01, 0.02, -0.4]),
        "rollers.r.velocity": np.array([0.1, 0.05, -0.2]),
        "rollers.r.surface_speed": np.array(0.7),
    },
    {
        "pressure": np.array(1e3),
        "exit.tension": np.array(-1e3),
        "exit.moment": np.array(20.0),
        "exit.force": np.array([500.0, 0.0, 0.0]),
        "rollers.r.centre": np.array([0.0, 0.0, -0.01]),
    },
)


def strip_of(level, xs=XS, ys=YS, poisson=0.3, thickness=THICKNESS):
    """The same strip as a shell, a section or a plate."""
    mesh = line(xs) if level == "section" else grid(xs, ys)
    return Strip(mesh, thickness, Material(2e9, poisson, 1000.0), KINEMATICS[level], np.ptp(ys))


def roller_of(level):
    """A roller that this level can see: tilted and crowned where there is a width."""
    if level == "section":
        return Roller("r", 0.4, (0.0, 0.0, -0.4))
    return Roller("r", 0.4, (0.0, 0.0, -0.4), (0.05, 1.0, -0.03), (0.02, -0.1))


def effect_of(name, strip):
    """An effect by its name, on all of a strip."""
    pattern, level = Pattern(strip), strip.kinematics
    contact = Contact(roller_of(level.name), LAW, ContactOperator(strip), np.inf, level)
    made = {
        "membrane": lambda: Membrane(strip),
        "bending": lambda: isometric_bending(strip, pattern),
        "kirchhoff-love": lambda: KirchhoffLove(strip),
        "moment": lambda: edge_moment(strip, "exit"),
        "pressure": lambda: pressure(strip),
        "entry": lambda: edge_tension(strip, "entry"),
        "exit": lambda: edge_tension(strip, "exit"),
        "pretension": lambda: Pretension(strip),
        "contact": lambda: contact,
        "friction": lambda: Friction(contact, HOFF),
        "aligned": lambda: AlignedFriction(contact, HOFF, None, (DRIVEN,), 0, SlopeOperator(strip)),
    }
    return made[name]()


CASES = [
    *((level, name) for level in ("shell", "section") for name in (
        "membrane", "bending", "kirchhoff-love", "moment", "pressure", "entry", "exit", "contact",
        "friction", "aligned")),
    *(("plate", name) for name in ("bending", "pressure", "pretension", "contact")),
]  # fmt: skip


def random_unknowns(strip, seed):
    """One number of order 1 m for every degree of freedom, in its own unit."""
    numbers = np.random.default_rng(seed).standard_normal(strip.unknowns)
    return numbers * np.repeat(strip.dof_lengths, strip.count)


def free_equations(strip, effects, controls=CONTROLS, rate=None):
    """Equilibrium with nothing held; with a rate v = rate u + base."""
    model = Model(strip, Pattern(strip), effects, Scales(strip.length, 1.0, 1.0))
    supports = Supports.at_rest(strip.unknowns, np.array([], dtype=int))
    base = 0.05 * random_unknowns(strip, 11)
    velocity = AffineVelocity(rate, base, np.zeros_like(base)) if rate else None
    return Equilibrium(model, supports, controls, velocity)


def equations_of(level, name):
    """One effect alone, and a state in which it does something."""
    strip = strip_of(level)
    rate = 3.0 if name in ("friction", "aligned") else None
    equations = free_equations(strip, [effect_of(name, strip)], rate=rate)
    return equations, 5e-3 * random_unknowns(strip, 12)


def residual_orders(equations, u, direction, control, count):
    """Orders 0 to count − 1 of R(u + a direction, control + a) by the recurrence."""
    series, nothing = equations.recurrence(u, control, count), np.zeros_like(u)
    found = [series.residual, series.tangent() @ direction + series.control_derivative()]
    series.correct(1, direction, 1.0)
    for k in range(2, count):
        found.append(series.advance(k))
        series.correct(k, nothing, 0.0)
    return np.array(found)


def interpolated_orders(equations, u, direction, control, count, weights, radius):
    """The same of weights · R, from an interpolant."""
    return orders(
        lambda a: weights @ equations.residual(u + a * direction, control + a), radius, count
    )
