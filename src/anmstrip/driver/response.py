"""Response of a stationary state to small oscillating changes of what a line depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from anmstrip.arrays import Array
from anmstrip.driver.run import Run
from anmstrip.driver.sensitivities import Explicit, Partials, Readings, StationaryTangent
from anmstrip.errors import InputError, Mistake, nearest
from anmstrip.linalg.bordered import Bordered
from anmstrip.linalg.direct import equilibrated
from anmstrip.results.files import write_table
from anmstrip.results.state import State
from anmstrip.scene.schema import SceneSpec

DECADES, POINTS = (-2.0, 2.0), 41
"""Frequencies by default: powers of ten of V/L with the length L of the strip, and how many."""


@dataclass(frozen=True)
class Oscillation:
    """Small oscillations about a stationary state: (K + i ω C) u = −b.

    K is the tangent of the stationary state, and C = ∂R/∂v.  Material moves with c ∂r/∂X + ∂r/∂t,
    so that friction sees a velocity ∂r/∂t as it sees a change ∂r/∂t / c of the slope ∂r/∂X.

    Parameters
    ----------
    tangent : StationaryTangent
    key : str
        Of the parameter that oscillates, as in the sensitivities.
    explicit : mapping
        Derivatives of the effects with respect to it.
    """

    tangent: StationaryTangent
    key: str
    explicit: Explicit

    @property
    def speed(self) -> float:
        """c (m/s)."""
        return float(self.tangent.state.strip_speed or 0.0)

    @cached_property
    def by_velocity(self) -> Array:
        """Derivative of friction at its points by ∂r/∂t, (count, count + 1, points)."""
        part, count = self.tangent.law_part("friction"), self.tangent.model.strip.count
        inputs, points = part.shape
        unit = np.broadcast_to(np.eye(inputs)[count : 2 * count, :, None], (count, inputs, points))
        return part.orders.derivative(unit) / self.speed

    @cached_property
    def rate(self) -> Array:
        """Derivative of friction at its points by the rate of the parameter, (count + 1, points).

        A roller that is yawed moves its surface with w × (r − c), w the vertical.
        """
        tangent, state = self.tangent, self.tangent.state
        names = [roller.name for roller in tangent.friction.roller.members]
        which = [n for n, name in enumerate(names) if self.key == f"rollers.{name}.yaw"]
        if not which:
            return np.zeros(self.by_velocity.shape[1:])
        operator = tangent.friction.contact.operator
        place = operator.reference + operator.apply(state.full)
        x, y, _ = place - state.controls[f"rollers.{names[which[0]]}.centre"][:, None]
        surface = np.zeros((3, len(x)))
        seen = tangent.areas["friction"][:, [which[0]]].indices
        surface[:, seen] = np.stack([-y, x, 0.0 * x])[:, seen]
        return -np.einsum("ijp,ip->jp", self.by_velocity, surface)

    @cached_property
    def matrices(self) -> tuple[csc_matrix, csc_matrix, Array]:
        """K and C over the free unknowns, and factors that equilibrate them."""
        tangent, model = self.tangent, self.tangent.model
        part, count = tangent.law_part("friction"), model.strip.count
        derivative = np.zeros((part.shape[0], *self.by_velocity.shape[1:]))
        derivative[:count] = self.by_velocity
        blocks = model.pattern.zeros(model.others)
        part.operator.add_tangent(derivative, model.pattern, blocks)
        resistance = tangent.series.restricted(model.closed_rows(blocks), tangent.free)
        k, c = (
            m.assembled() if isinstance(m, Bordered) else m for m in (tangent.matrix, resistance)
        )
        return k, c, equilibrated(k)

    def at(self, omega: float) -> dict[str, complex]:
        """Complex amplitudes of what is read off, for an amplitude of one of the parameter.

        Parameters
        ----------
        omega : float
            Angular frequency ω (rad/s).
        """
        tangent, (k, c, d) = self.tangent, self.matrices
        rate = {"friction": self.rate}
        forces = [tangent.gathered(e) for e in (self.explicit, rate)]
        supports = tangent.state.plan.supports
        static, moving = (supports.gathered(tangent.model.closed(f)) for f in forces)
        matrix = csc_matrix((k + 1j * omega * c).multiply(d[:, None]).multiply(d))
        u = -splu(matrix).solve((static + 1j * omega * moving) * d) * d
        full = supports.change(u.real, 0.0) + 1j * supports.change(u.imag, 0.0)
        moved = tangent.friction.contact.operator
        velocity = 1j * omega * (moved.apply(full.real) + 1j * moved.apply(full.imag))
        rubbing = np.einsum("ijp,ip->jp", self.by_velocity, velocity) + 1j * omega * self.rate
        real = {**self.explicit, "friction": self.explicit.get("friction", 0.0) + rubbing.real}
        first = Readings(tangent, self.key, real, full.real).read()
        second = Readings(tangent, "", {"friction": rubbing.imag}, full.imag).read()
        return {name: complex(first[name], second[name]) for name in first}


def response(state: State, own: Sequence[bool], key: str, omegas: Array) -> dict[str, Array]:
    """Complex amplitudes of what is read off a stationary state over the frequency.

    Parameters
    ----------
    state : State
        Of a steady stage.
    own : sequence of bool
        Rollers that have a coefficient of friction of their own.
    key : str
        Parameter that oscillates: a key of the sensitivities, such as ``rollers.r1.yaw``.
    omegas : ndarray, shape (n,)
        Angular frequencies (rad/s).

    Returns
    -------
    dict
        Reading → amplitudes for an amplitude of one of the parameter, shape (n,).

    Raises
    ------
    InputError
        The state depends on no such parameter.
    """
    tangent = StationaryTangent(state)
    found = dict(Partials(tangent, tuple(own)))
    if key not in found:
        raise unknown_name(f"--to {key}", key, "what the stationary state depends on", found)
    oscillation = Oscillation(tangent, key, found[key])
    rows = [oscillation.at(float(omega)) for omega in omegas]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def respond(scene: SceneSpec, of: str, to: str, directory: Path) -> str:
    """Run a scene, and write the response of its last state: ``response.csv`` and ``.png``.

    Parameters
    ----------
    scene : SceneSpec
        Its last stage is steady.
    of : str
        A reading of the sensitivities; one of the roller that `to` names goes without its name.
    to : str
        A parameter of the sensitivities.
    directory : Path

    Returns
    -------
    str
        What was found, in a sentence; it begins with "Done" if the state was reached.

    Raises
    ------
    InputError
        The scene does not end in a steady stage, or has no such reading or parameter.
    """
    from anmstrip.pictures.curves import response_figure, save_figure

    last = scene.stages[-1]
    if not last.steady:
        expected = "true in the last stage: a response is that of a stationary state"
        raise scene.refused(f"stages.{last.name}.steady", False, expected, "steady = true")
    run = Run(scene)
    if run.assembly.coupled < run.assembly.unknowns:
        expected = "a strip that stays elastic: what oscillates is not followed into yielding"
        raise scene.refused("material", None, expected, "the same scene without plasticity")
    for _ in run:
        pass
    state = run.state
    if state is None or state.strip_speed is None or not run.outcome.done:
        return run.message
    unit = state.strip_speed / run.assembly.strip.length
    omega = unit * np.logspace(*DECADES, POINTS)
    found = response(state, [r.friction is not None for r in scene.rollers], to, omega)
    name = of if of in found else f"{to.removeprefix('rollers.').partition('.')[0]}_{of}"
    if name not in found:
        raise unknown_name(f"--of {of}", of, "what is read off a stationary state", found)
    gain, phase = np.abs(found[name]), np.degrees(np.unwrap(np.angle(found[name])))
    table = {"omega": omega, "gain": gain, "phase": phase}
    rows = [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]
    directory.mkdir(parents=True, exist_ok=True)
    write_table(directory / "response.csv", list(table), rows)
    figure = response_figure(omega, gain, phase, f"{name} to {to}")
    save_figure(figure, directory / "response.png")
    return (
        f"Done: {name} answers to {to} with {gain[0]:.6g} at {omega[0]:.3g} rad/s and with "
        f"{gain[-1]:.6g} at {omega[-1]:.3g} rad/s."
    )


def unknown_name(place: str, key: str, expected: str, known: Any) -> InputError:
    """Return the error of a name that is not among the known ones."""
    return InputError([Mistake(place, key, key, expected, nearest(key, list(known)))])
