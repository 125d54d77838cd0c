"""Effects as series: what each adds to the orders of the residual.

Every class has the same five methods: ``residual`` (order 0), ``derivative``
(order 1 for given changes), ``advance`` (order k of what the lower orders make),
``correct`` (fix order k) and ``add_tangent``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.fem.operators import Pattern
from anmstrip.mechanics.effects import Effect, LawEffect, LinearEffect, LoadEffect
from anmstrip.series.compiled import orders_of
from anmstrip.series.power_series import Series, Tape

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Controls:
    """Given quantities, linear in λ: value(λ) = start + λ slope."""

    start: Mapping[str, Array]
    slope: Mapping[str, Array] = field(default_factory=dict)

    def at(self, control: Any) -> dict[str, Any]:
        """Values at λ, a number or a series; what does not change stays an array."""
        return {
            name: value + control * self.slope[name] if name in self.slope else value
            for name, value in self.start.items()
        }

    def rate(self, name: str) -> Array | float:
        """Derivative of one control with respect to λ."""
        return self.slope.get(name, 0.0)


class LawSeries:
    """A pointwise effect on a tape."""

    def __init__(
        self,
        effect: LawEffect,
        order: int,
        full: Array,
        velocity: Array | None,
        control: float,
        controls: Controls,
    ) -> None:
        self.effect, self.operator = effect, effect.operator
        self.tape = Tape(order)
        self.x = self.tape.variable(self.operator.apply(full))
        self.v: Series | None = None
        if effect.rate_dependent and velocity is not None:
            self.v = self.tape.variable(self.operator.apply(velocity))
        self.control = self.tape.variable(control)
        self.stress = effect.law(self.x, self.v, controls.at(self.control))
        self.orders = orders_of(self.tape, self.stress, self.operator.points)

    @cached_property
    def follows(self) -> bool:
        """Whether the law looks at what the control changes."""
        return any(x is self.control for _, op in self.tape.computed for x in op.operands)

    def _seeds(self, u: Array, v: Array | None, control: float) -> dict[Series, Array]:
        seeds = {self.x: self.operator.apply(u)} if u.any() else {}
        if control and self.follows:
            seeds[self.control] = np.array(control)
        if self.v is not None and v is not None:
            seeds[self.v] = self.operator.apply(v)
        return seeds

    def residual(self) -> Array:
        return self.operator.gather(self.stress.value)

    def derivative(self, u: Array, v: Array | None, control: float) -> Array | None:
        seeds = self._seeds(u, v, control)
        return self.operator.gather(self.orders.derivative(seeds)) if seeds else None

    def advance(self, k: int) -> Array:
        return self.operator.gather(self.orders.advance(k))

    def correct(self, k: int, u: Array, v: Array | None, control: float) -> None:
        self.orders.correct(k, self._seeds(u, v, control))

    def add_tangent(self, pattern: Pattern, blocks: Array, rate: float) -> None:
        shape = self.x.shape
        count = int(np.prod(shape[:-1]))
        unit = np.eye(count).reshape((count, *shape[:-1], 1))
        unit = np.broadcast_to(unit, (count, *shape)).copy()
        seeds = {self.x: unit}
        if self.v is not None:
            seeds[self.v] = rate * unit
        derivative = self.orders.derivative(seeds)
        self.operator.add_tangent(
            derivative.reshape(shape[:-1] + derivative.shape[1:]), pattern, blocks
        )


class LinearSeries:
    """A constant matrix: order k is K u_k."""

    def __init__(self, effect: LinearEffect, full: Array) -> None:
        self.effect, self.start = effect, full

    def residual(self) -> Array:
        return self.effect.product(self.start)

    def derivative(self, u: Array, v: Array | None, control: float) -> Array:
        return self.effect.product(u)

    def advance(self, k: int) -> None:
        return None

    def correct(self, k: int, u: Array, v: Array | None, control: float) -> None:
        """Nothing to remember."""

    def add_tangent(self, pattern: Pattern, blocks: Array, rate: float) -> None:
        self.effect.add_tangent(blocks)


class LoadSeries:
    """A dead load: of order 0 and 1 in λ."""

    def __init__(self, effect: LoadEffect, control: float, controls: Controls) -> None:
        self.effect = effect
        self.value = controls.at(control)[effect.control]
        self.slope = controls.rate(effect.control)

    def residual(self) -> Array:
        return self.effect.load_vector(self.value)

    def derivative(self, u: Array, v: Array | None, control: float) -> Array | None:
        return (
            self.effect.load_vector(control * np.asarray(self.slope))
            if np.any(self.slope)
            else None
        )

    def advance(self, k: int) -> None:
        return None

    def correct(self, k: int, u: Array, v: Array | None, control: float) -> None:
        """Nothing to remember."""

    def add_tangent(self, pattern: Pattern, blocks: Array, rate: float) -> None:
        """Dead loads do not follow."""


def series_of(
    effect: Effect,
    order: int,
    full: Array,
    velocity: Array | None,
    control: float,
    controls: Controls,
) -> LawSeries | LinearSeries | LoadSeries:
    if isinstance(effect, LinearEffect):
        return LinearSeries(effect, full)
    if isinstance(effect, LoadEffect):
        return LoadSeries(effect, control, controls)
    assert isinstance(effect, LawEffect)
    near = effect.near(full, controls.at(control))
    return LawSeries(near, order, full, velocity, control, controls)
