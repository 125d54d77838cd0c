"""Hard cases of single points with friction, each with its answer in closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Cost, Path
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.mechanics.laws import FrictionLaw, NortonHoff, RepulsiveSignorini, Signorini
from anmstrip.paper.cases import solve_case
from anmstrip.paper.mass_spring import RotatingCircle, coulomb, slip_at
from anmstrip.timestepping.index_one import instabilities
from function_equations import FunctionEquations
from motions import Motion, Trial, moved

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Slider:
    """A point on a spring, pressed on a surface that moves, and pulled along it; one unknown.

    Equilibrium: W(t) − k u + R_T = 0, with W and R_N linear in time.
    """

    law: FrictionLaw
    stiffness: float = 0.0  # k (N/m); none for a point on a slope
    normal: tuple[float, float] = (1.0, 0.0)  # R_N at t = 0 (N), and its rate (N/s)
    load: tuple[float, float] = (0.0, 0.0)  # W at t = 0 (N), and its rate (N/s)
    speed: float = 0.0  # V of the surface (m/s)

    def residual(self, u: Any, v: Any, t: Any) -> Any:
        """Shape (1,)."""
        pressed = u * 0.0 + (t * self.normal[1] + self.normal[0])
        pulled = u * -self.stiffness + (t * self.load[1] + self.load[0])
        return pulled + self.law(pressed, v - self.speed)


@dataclass(frozen=True)
class CoupledNode:
    """A point above a fixed plane whose springs couple both directions; u = (u_x, u_z).

    Equilibrium: [[1, −c], [−c, k]] u = (W + R_T, −P + R_N), with W linear in time.  With c > 0
    motion along the plane unloads the contact: sliding at u_z = 0 obeys
    (1 − c f) u_x = W − f P, and beyond f = 1/c equilibria are no longer unique.

    Source: Klarbring, *Examples of non-uniqueness and non-existence of solutions to quasistatic
    contact problems with friction*, Ingenieur-Archiv 60 (1990).
    """

    law: FrictionLaw
    contact: RepulsiveSignorini  # N/m and N
    load: tuple[float, float]  # W at t = 0 (N), and its rate (N/s)
    coupling: float = 0.8  # c (N/m)
    lift: float = 2.0  # k (N/m)
    pressing: float = 1.0  # P (N)

    @property
    def critical(self) -> float:
        """Friction coefficient 1/c beyond which sliding is unstable."""
        return 1.0 / self.coupling

    def residual(self, u: Any, v: Any, t: Any) -> Any:
        """Shape (2,)."""
        normal = self.contact(u[1])
        tangential = self.law(normal, np.stack([v[0]]))[0]
        x = tangential - u[0] + u[1] * self.coupling + (t * self.load[1] + self.load[0])
        z = normal - u[1] * self.lift + u[0] * self.coupling - self.pressing
        return np.stack([x, z])

    def sliding(self, load: float) -> float:
        """Return u_x in contact with Coulomb's law, sliding forwards."""
        f = self.law.coefficient
        return float((load - f * self.pressing) / (1.0 - self.coupling * f))

    def separated(self, load: float) -> Array:
        """Return u without contact, shape (2,)."""
        matrix = np.array([[1.0, -self.coupling], [-self.coupling, self.lift]])
        return np.linalg.solve(matrix, [load, -self.pressing])


@dataclass(frozen=True)
class WrappedLinks:
    """A chain of elastic links laid around a cylinder that stands, and pulled; n unknowns.

    At every point the chain turns by θ/n between two links, so that
    R_N = (T + T') sin(θ/2n) and (T' − T) cos(θ/2n) = |R_T|.
    """

    law: FrictionLaw
    turn: float  # θ/n (rad)
    stiffness: Array  # of the links behind the points, towards the pull (N/m), shape (n,)
    tension: float = 1.0  # at the slack end (N)
    speed: float = 1.0  # of the end that is pulled (m/s)

    @property
    def start(self) -> Array:
        """Displacements under the same tension everywhere, shape (n,)."""
        return -np.cumsum(self.tension / self.stiffness[::-1])[::-1]

    def tensions(self, u: Any, t: Any) -> tuple[Any, Any]:
        """Return tensions before and behind every point (N), shape (n,) each."""
        n = len(self.stiffness)
        behind = np.diag(self.stiffness[:-1], 1) - np.diag(self.stiffness)
        before = np.diag(self.stiffness[:-1], -1) * -1.0
        before += np.diag(np.concatenate([[0.0], self.stiffness[:-1]]))
        pulled, slack = np.zeros(n), np.zeros(n)
        pulled[-1], slack[0] = self.stiffness[-1] * self.speed, self.tension
        after = np.einsum("ij,j->i", behind, u) + t * pulled
        return np.einsum("ij,j->i", before, u) + slack, after

    def residual(self, u: Any, v: Any, t: Any) -> Any:
        """Shape (n,)."""
        before, after = self.tensions(u, t)
        normal = (before + after) * np.sin(0.5 * self.turn)
        friction = self.law(normal, np.stack([v]))[0]
        return (after - before) * np.cos(0.5 * self.turn) + friction

    def exact_ratio(self, coefficient: float) -> float:
        """Return T_n/T_0 in full slip: [(1 + f tan(θ/2n)) / (1 − f tan(θ/2n))]^n."""
        s = coefficient * np.tan(0.5 * self.turn)
        return float(((1.0 + s) / (1.0 - s)) ** len(self.stiffness))


def zero_normal_force(omega: float = 1e-3, q: float = 0.1) -> Trial:
    """D1: pressed by a force that grows from exactly 0; u = c t with c = f_eff(V − c)."""
    law = NortonHoff(0.3, q, omega, 1.0)
    slider = Slider(law, stiffness=1.0, normal=(0.0, 1.0), speed=1.0)
    motion = moved(slider.residual, np.zeros(1), (0.0, 2.0))
    c = float(brentq(lambda c: law.effective(1.0 - c) - c, 0.0, 0.9, xtol=1e-14))
    return Trial.of(motion, float(motion.end[0]), 2.0 * c)


def penetration(stiffness: float = 1e6, load: float = 10.0) -> Trial:
    """D2: gap at a reaction, h = (η δ − R²/K)/(R + η), in δ, on a rate-free path."""
    law, cost = Signorini(stiffness, 1e-3, 1.0), Cost()
    equations = FunctionEquations(
        lambda u, t: np.stack([law(u[0] + law.delta) - u[0] - t]), force=1e-12 * load
    )
    steps = list(
        follow(
            equations,
            np.zeros(1),
            solver=DenseSolver(),
            settings=Settings(tolerance=1.0, order=20),
            target=load,
            cost=cost,
        )
    )
    u = float(steps[-1].branch.end[0][0])
    gap, reaction = u + law.delta, u + load
    exact = float(law.gap(np.float64(reaction)))
    return Trial(gap, exact, abs(gap - exact), len(steps), cost.factorisations, "done")


def sharp_corner(omega: float = 1e-2, q: float = 0.1, speed: float = 1.0) -> Trial:
    """D3: dragged into slip at V; at the end u = f_eff(V) R_N/k, 0.3 m for every V_c.

    A force that ever falls, by more than the tolerance, is an error as well.
    """
    law = NortonHoff(0.3 * speed**q, q, omega, speed)
    slider = Slider(law, stiffness=1.0, speed=1.0)
    motion = moved(slider.residual, np.zeros(1), (0.0, 2.0))
    exact = law.effective(1.0)
    trial = Trial.of(motion, float(motion.end[0]), exact)
    force = np.array([0.0, *(step.u[0] for step in motion.steps)])
    falls = float(np.maximum(force[:-1] - force[1:], 0.0).max())
    return replace(trial, error=max(trial.error, falls))


def held(q: float = 0.1, omega: float = 1e-6, ratio: float = 0.5) -> Trial:
    """D4: drift in a long hold, V_c ρ^(1/q) t where ω is small beside the creep."""
    law = NortonHoff(0.3, q, omega, 1e-3)
    slider = Slider(law, load=(ratio * law.coefficient, 0.0))
    motion = moved(slider.residual, np.zeros(1), (0.0, 1e6))
    return Trial.of(
        motion, float(motion.end[0]), float(slip_at(law, ratio * law.coefficient)) * 1e6
    )


def reversal(q: float = 0.1, cycles: int = 2) -> Trial:
    """D5: work of a surface that goes to and fro by A = 1, in the last of some cycles.

    Beside that of the law solved for its slip and integrated by Radau's method; Coulomb's,
    4 f R_N (A − f R_N/k), differs by what the corners of the loop lose, 0.22 q to 0.3 q.
    """
    law = NortonHoff(0.3, q, 1e-4, 1.0)
    u, corners = np.zeros(1), [0.0, 1.0, *(1.0 + 2.0 * k for k in range(1, 2 * cycles + 1))]
    steps, tangents, work, exact, y = 0, 0, 0.0, 0.0, 0.0
    for k, span in enumerate(pairwise(corners)):
        slider = Slider(law, stiffness=1.0, speed=(-1.0) ** k)
        motion = moved(slider.residual, u, span, v=np.full(1, slider.speed))
        y, integral = _dragged(law, slider.speed, y, span)
        if k > 2 * cycles - 2:
            work += slider.speed * _integral(motion)
            exact += slider.speed * integral
        u, steps = motion.end, steps + len(motion.steps)
        tangents += motion.cost.factorisations
        if motion.outcome != "done":
            break
    return Trial(work, exact, abs(work - exact) / exact, steps, tangents, motion.outcome)


def _dragged(
    law: NortonHoff, speed: float, start: float, span: tuple[float, float]
) -> tuple[float, float]:
    """Return u at the end and ∫ u dt of u' = V − slip(u), with a spring and a normal force of 1."""
    found = solve_ivp(
        lambda t, y: [speed - float(slip_at(law, y[0])), y[0]],
        span, [start, 0.0], method="Radau", rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    return float(found.y[0, -1]), float(found.y[1, -1])


def _integral(motion: Motion) -> float:
    """Return ∫ u dt along the cubics between the steps."""
    h, times = np.diff(motion.path.knots), motion.path.knots
    u, v = (np.array(x)[:, 0] for x in zip(*(motion.path(t) for t in times), strict=True))
    return float((h * (u[1:] + u[:-1]) / 2.0 + h**2 * (v[:-1] - v[1:]) / 12.0).sum())


def beyond_the_cone(q: float = 0.1, slope: float = 1.2) -> Trial:
    """D6: a slope steeper than the cone, v = V_c (tan α/f)^(1/q)."""
    law = NortonHoff(0.3, q, 1e-6, 1e-3)
    slider = Slider(law, load=(slope * law.coefficient, 0.0))
    motion = moved(slider.residual, np.zeros(1), (0.0, 10.0))
    speed = float(motion.end[0]) / 10.0 / law.speed
    return Trial.of(motion, speed, slope ** (1.0 / q))


CONTACT = RepulsiveSignorini(1e6, 1e-2, 1e-2)
"""Of the coupled node: nearly rigid beside its springs of 1 N/m."""


def coupled(
    law: FrictionLaw, load: float = 2.2, tolerance: float = 1e-3
) -> tuple[Trial, CoupledNode, Motion]:
    """D7: the coupled node, its load ramped to a last one far past stick, beside Radau's method.

    Beyond f = 1/c it ends separated, unless a power law still bears the load at some velocity;
    the error is in units of the way to there.
    """
    node = CoupledNode(law, CONTACT, (0.0, load / 1e3))
    motion = moved(node.residual, np.zeros(2), (0.0, 1e3), tolerance=tolerance, speed=1e-4)
    apart = float(node.separated(load)[0])
    return Trial.of(motion, float(motion.end[0]), crept(node, 1e3)[1], apart), node, motion


FASTEST, FULL = 1e3, 1.0 - 1e-9
"""Velocity (m/s) that no step of the coupled node can tell, and the share of a cone that never
ends at which it goes nowhere else."""


def crept(node: CoupledNode, end: float) -> tuple[float, float]:
    """Return when the coupled node runs away, nan if it does not, and u_x at the end, by Radau.

    What has run away glides on behind where it would be without contact, as fast as that moves.
    """
    law, most = node.law, node.law.coefficient * FULL
    most = law.effective(FASTEST) if isinstance(law, NortonHoff) else most

    def gone(t: float, u: Array) -> float:
        return _ratio(node, t, float(u[0])) - most

    def velocity(t: float, u: Array) -> Array:
        ratio = float(np.clip(_ratio(node, t, float(u[0])), -most, most))
        if isinstance(law, NortonHoff):
            return np.atleast_1d(slip_at(law, ratio))
        return np.array([law.speed * np.arctanh(ratio / law.coefficient)])

    gone.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        velocity, (0.0, end), [0.0], method="Radau", rtol=1e-6, atol=1e-9, events=gone
    )
    if found.status != 1:
        return np.nan, float(found.y[0, -1])
    last, before = (node.separated(node.load[0] + node.load[1] * t)[0] for t in (end, end - 1.0))
    drawn = law.effective(last - before)
    place = brentq(lambda x: _ratio(node, end, x) - drawn, last - 0.1, last, xtol=1e-14)
    return float(found.t[-1]), float(place)


def _ratio(node: CoupledNode, t: float, x: float) -> float:
    """Return −R_T/R_N in equilibrium, with N (N/K + u_z) = η δ and N = k u_z − c u_x + P."""
    contact, k, pull = node.contact, node.lift, node.coupling * x - node.pressing
    half = 0.5 * pull * (2.0 * k / contact.stiffness + 1.0)
    a = k * (k / contact.stiffness + 1.0)
    rest = pull**2 / contact.stiffness - contact.eta * contact.delta
    z = (half + np.sqrt(half**2 - a * rest)) / a
    driving = node.load[0] + node.load[1] * t + node.coupling * z - x
    return float(driving / (k * z - pull))


def near_critical(distance: float = 1e-2) -> Trial:
    """D8: response u/(W − f) = 1/(1 − c f) at a relative distance below f = 1/c.

    Sliding at exactly V_c from the tip of the cone on, where f_eff = f.
    """
    contact = RepulsiveSignorini(1e10, 1e-10, 1e-2)
    rate, law = distance, NortonHoff((1.0 - distance) / 0.8, 0.1, 1e-8, 1.0)
    node = CoupledNode(law, contact, (law.coefficient, rate))
    motion = moved(node.residual, np.zeros(2), (0.0, 0.5), v=np.array([1.0, 0.0]))
    response = float(motion.end[0]) / (0.5 * rate)
    return Trial.of(motion, response, 1.0 / rate)


def grazing(depth: float = 0.1, stiffness: float = 1e9) -> Trial:
    """D9: an obstacle comes to −depth · δ beyond first contact, and goes; back to 1e-10.

    The error is the distance between the first and the last state, or between two
    states at mirrored instants, whichever is larger.
    """
    law, cost = RepulsiveSignorini(stiffness, 1e-3, 1e-3), Cost()

    def residual(u: Any, t: Any) -> Any:
        gap = u[0] - depth * law.delta + (t - 1.0) ** 2 * 0.1
        return np.stack([law(gap) - u[0] * 1e3])

    start = float(brentq(lambda u: float(residual(np.array([u]), 0.0)[0]), 0.0, 1.0, xtol=1e-18))
    steps = list(
        follow(
            FunctionEquations(residual, scale=law.delta, force=1e-12),
            np.array([start]),
            solver=DenseSolver(),
            settings=Settings(tolerance=1.0),
            target=2.0,
            cost=cost,
        )
    )
    path = Path(tuple(step.branch for step in steps))
    pairs = [(path(1.0 - s), path(1.0 + s)) for s in np.linspace(0.0, 1.0, 41)]
    error = max(float(abs(a[0] - b[0])) for a, b in pairs)
    back = float(steps[-1].branch.end[0][0])
    error = max(error, abs(back - start))
    return Trial(back, start, error, len(steps), cost.factorisations, "done")


def many_turns(log_ratio: float = 2.0, points: int = 40, links: float = 1.0) -> Trial:
    """D10, D14: full slip of a chain around a cylinder, by its formula for n equal turns.

    Links are as stiff as their tension asks for, and every other one ``links`` times that.
    """
    law = NortonHoff(0.3, 0.05, 1e-3, 1.0)
    f = law.effective(1.0)
    turn = log_ratio / f / points
    s = f * np.tan(0.5 * turn)
    stiffness = 100.0 * ((1.0 + s) / (1.0 - s)) ** np.arange(1, points + 1)
    stiffness[::2] *= links
    chain = WrappedLinks(law, turn, stiffness)
    motion = moved(chain.residual, chain.start, (0.0, 0.04 * points), tolerance=1e-3)
    ends = chain.tensions(motion.end, motion.steps[-1].end)[1]
    return Trial.of(motion, float(ends[-1]), chain.exact_ratio(f))


def leaves_the_cone(tolerance: float = 1e-4) -> Trial:
    """D18: the paper's rotating circle, beyond the time at which Coulomb's law has no solution.

    The regularised motion is unstable from a little before on (friction carries less than f at
    less than V_c); the error is in the date (s), 1.805 s with Coulomb's law.
    """
    case = RotatingCircle()
    found = solve_case(case, "taylor", order=19, tolerance=tolerance)
    stretches = instabilities(case.residual, found.path)
    date = max(stretches, key=lambda s: s.distance).start if stretches else np.nan
    exact = coulomb(case).until
    steps, tangents = len(found.path.errors), found.cost.factorisations
    outcome = "done" if found.stopped is None else str(found.stopped)
    return Trial(date, exact, abs(date - exact), steps, tangents, outcome)
