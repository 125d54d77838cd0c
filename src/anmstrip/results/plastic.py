"""What is read off strip that has yielded: along it, through its thickness, by roller."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.sampling import stations
from anmstrip.mechanics.plasticity import VON_MISES, Plasticity
from anmstrip.mechanics.shell import moduli, weaken
from anmstrip.results.strip_state import StripState

PLASTIC_COLUMNS = (
    "residual_curvature", "elongation", "plastic_share", "plastic_strain", "yield_power",
)  # fmt: skip
"""Columns of ``profile.csv`` for strip that can yield."""

LAYER_COLUMNS = ("time", "arc_length", "height", "stress", "plastic_strain", "residual_stress")

FLOWING_SHARE = 0.9
"""Share of the present yield stress from which on a layer counts as flowing.  With n = 51 its rate
is 0.5 % of the reference rate there; in a bend the stress falls from it to 0 within the core."""

MEAN_SAMPLES = 101
"""Places along free strip over which curl and crossbow are averaged."""


@dataclass(frozen=True)
class RollerBend:
    """The sharpest bend around a roller, between the middles of the spans on both sides."""

    curvature: float  # κ, positive with a stretched top (1/m)
    moment: float  # N
    plastic_share: float  # of the thickness that flows
    curl_on_roller: float  # of the strip, were it unloaded in this bend (1/m)
    crossbow_on_roller: float | None  # the same across; None of a section, which has no width
    curl: float  # of the strip unloaded behind the roller, where it has been straightened (1/m)
    crossbow: float | None  # the same across
    elongation: float  # plastic, of the middle, since the entry
    yield_power: float  # W, of the flow between the middles of the spans


class YieldedStrip:
    """A state of strip that can yield, at its quadrature points.

    What has k components has xx alone of a section, (xx, yy, xy) of a shell.

    Parameters
    ----------
    state : StripState
    effect : Plasticity

    Attributes
    ----------
    x : ndarray, shape (points,)
        Arc length (m) of the strip as it is cut.
    stations : tuple of ndarrays
        Arc lengths (m), ascending, and the number of each point among them.
    stress : ndarray, shape (k, layers, points)
        Pa.
    curvature, force, moment : ndarray, shape (k, points)
        1/m, positive with a stretched top; N/m; N.
    """

    def __init__(self, state: StripState, effect: Plasticity) -> None:
        self.state, self.effect, self.strip = state, effect, effect.strip
        self.flow, layers = effect.flow, effect.layers
        x = np.asarray(self.strip.basis.global_coordinates())[0].ravel()
        self.x = x - self.strip.span[0]
        self.stations = stations(self.strip, self.x)
        self.values = effect.operator.apply(state.full)
        self.stress = np.asarray(effect.stresses(self.values, state.controls))
        self.internal = np.asarray(effect.internal(self.values))
        self.strain = self.internal[: len(self.stress)]
        self.curvature = -np.asarray(effect.bending.bent(effect.derivatives(self.values)))
        self.force = np.einsum("l,klp->kp", layers.weights, self.stress)
        self.moment = np.einsum("l,klp->kp", layers.weights * layers.heights, self.stress)

    @classmethod
    def of(cls, state: StripState) -> YieldedStrip | None:
        """Return what is read off the layers of a state, None where nothing can yield."""
        return None if state.plasticity is None else cls(state, state.plasticity)

    @cached_property
    def residual_curvature(self) -> Array:
        """κ less that of M (1/m), what is left when the moment is taken away, (k, points)."""
        k = len(self.moment)
        stiffness = np.full((1, 1), self.strip.bending_stiffness) if k == 1 else moduli(self.strip)
        elastic = np.linalg.solve(stiffness, self.moment) / weaken(1.0, self.state.controls)
        return np.asarray(self.curvature - elastic)

    @cached_property
    def elongation(self) -> Array:
        """Plastic strain of the middle surface: ∫ε_p dζ/t, over the share of ε_x in E' ε."""
        layers = self.effect.layers
        return (layers.weights @ self.strain[0]) / (layers.weights.sum() * self.effect.contracting)

    @cached_property
    def residual_stress(self) -> Array:
        """σ − N/t − 12 M ζ/t³ (Pa), without force and moment, (k, layers, points)."""
        heights, t = self.effect.layers.heights[:, None], self.strip.thickness
        return self.stress - self.force[:, None] / t - 12.0 / t**3 * self.moment[:, None] * heights

    @cached_property
    def face_strain(self) -> Array:
        """Equivalent plastic strain, √(ε_p · A⁻¹ ε_p), of the face where it is larger."""
        faces, form = self.strain[:, [0, -1]], np.linalg.inv(VON_MISES[len(self.strain)])
        return np.asarray(np.sqrt(np.einsum("kfp,kl,lfp->fp", faces, form, faces).max(axis=0)))

    @cached_property
    def plastic_share(self) -> Array:
        """Share of the thickness that flows or is about to.

        Between two layers of which one flows the stress changes by C κ per height in the part
        that does not, and not at all in the other; so it does between two that flow in different
        directions.  Of two that flow the same way all flows, unless one has hardly begun to: the
        share does not jump as layers begin to flow.
        """
        controls = self.state.controls
        s = self.flow.driving(self.stress, self.internal) / weaken(1.0, controls, "strip.weakening")
        level, gaps = self.flow.level(s), np.diff(self.effect.layers.heights)[:, None]
        low, high = np.sort([level[1:], level[:-1]], axis=0)
        turns = self.flow.level(np.diff(s, axis=1)) > FLOWING_SHARE
        engineering = self.curvature * self.effect.twice[:, None]
        slope = weaken(self.flow.mises(self.effect.moduli @ engineering), controls)
        slope = np.tile(slope, (len(gaps), 1))
        change, elastic = self.flow.mises(np.diff(self.stress, axis=1)), gaps + 0.0 * slope
        np.divide(change, slope, out=elastic, where=change < slope * gaps)
        begun = np.minimum((high - low) / np.abs(high - FLOWING_SHARE), 1.0)
        elastic *= np.where(turns, 1.0, begun)
        plastic = np.where(high > FLOWING_SHARE, gaps - elastic, 0.0)
        return np.asarray(plastic.sum(axis=0) / gaps.sum())

    @cached_property
    def power(self) -> Array:
        """Power of the flow per area, ∫σ ε_p' dζ (W/m²).

        The middle surface of a section flows by the mean of ε_p' over the share of ε_x in E' ε.
        """
        if not self.effect.operator.flows:
            return np.zeros_like(self.x)
        rates = self.flow.rates(self.stress, self.internal, self.effect.share(self.state.controls))
        speed = 1.0 if self.effect.rate_dependent else self.state.strip_speed
        work, weights = self.stress * rates[: len(self.stress)], self.effect.layers.weights
        more = self.force[0] * (weights @ rates[0]) / weights.sum()
        found = np.einsum("l,klp->p", weights, work) + more * (1.0 / self.effect.contracting - 1.0)
        return np.asarray(found * speed)

    @cached_property
    def flowing(self) -> tuple[float, float]:
        """Power of the flow (W), and the share of its yield stress at which the strip flows.

        The share is the mean by power: at the rate ε_p' a fibre flows at (ε_p'/ε₀)^(1/n) of it.
        Both are 0 where less than a layer flows.
        """
        if not self.effect.operator.flows or not self.plastic_share.any():
            return 0.0, 0.0
        share = self.effect.share(self.state.controls)
        rates = self.flow.rates(self.stress, self.internal, share)[: len(self.stress)]
        level = self.flow.level(self.flow.driving(self.stress, self.internal) * share)
        weights = np.multiply.outer(self.effect.layers.weights, self.strip.weights().ravel())
        power = weights * (self.stress * rates).sum(axis=0)
        return float(power.sum()), float(np.average(level, weights=power))

    def mean(self, values: Array) -> Array:
        """Return the mean over the width of values at the points, at every station."""
        number, weights = self.stations[1], self.strip.weights().ravel()
        return np.bincount(number, weights * values) / np.bincount(number, weights)

    def columns(self, x: Array) -> dict[str, Array]:
        """Return the columns of a profile, and its moment, at places along the strip."""
        found = {
            "residual_curvature": self.residual_curvature[0],
            "elongation": self.elongation,
            "plastic_share": self.plastic_share,
            "plastic_strain": self.face_strain,
            "yield_power": self.strip.width * self.power,
            "moment": self.moment[0],
        }
        places, _ = self.stations
        return {name: np.interp(x, places, self.mean(values)) for name, values in found.items()}

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield rows of ``layers.csv``: every layer of every point of a section, from the entry."""
        heights = self.effect.layers.heights
        for p in np.argsort(self.x):
            for k, height in enumerate(heights):
                read = (self.x[p], height, self.stress[0, k, p], self.strain[0, k, p])
                row = (self.state.time, *read, self.residual_stress[0, k, p])
                yield dict(zip(LAYER_COLUMNS, map(float, row), strict=True))

    def free_strip(self) -> dict[str, tuple[float, float]]:
        """Return arc lengths (m) between which strip is free behind every roller that it touches.

        As far from contacts and ends as where tensions are read off; the middle of a short span.
        """
        touched, (begin, end) = self.state.contacts, self.strip.span
        passages = [p for p in self.state.passages if touched[p.names[0]].touching.any()]
        stops = [p.places[0] for p in passages[1:]]
        stops += [end - (p.places[1] - p.arc[1]) for p in passages[-1:]]
        return {
            name: (float(passage.places[1] - begin), float(stop - begin))
            for passage, stop in zip(passages, stops, strict=True)
            for name in passage.names
        }

    @property
    def curls(self) -> dict[str, float]:
        """Curl (1/m) behind every roller that the strip touches; without any, the largest."""
        bends = self.rollers()
        return {name: b.curl for name, b in bends.items()} or {"strip": self.largest_curl[0]}

    @property
    def largest_curl(self) -> tuple[float, float]:
        """The largest curl (1/m) of the strip, unloaded, and its distance (m) from the entry."""
        x, left = self.stations[0], self.mean(self.residual_curvature[0])
        k = int(np.abs(left).argmax())
        return float(left[k]), float(x[k])

    def rollers(self) -> dict[str, RollerBend]:
        """Return the sharpest bend around every roller that the strip touches, by means across.

        In the sense in which the roller bends the strip: a roller behind others may bend it less
        than the curl that they leave, the other way round.  What it leaves is a mean over the free
        strip behind it, since strip may yield again where tension straightens it.
        """
        begin, _ = self.strip.span
        middles = {n: c.middle - begin for n, c in self.state.touched.items()}
        names = sorted(middles, key=lambda name: middles[name])
        places = np.array([middles[name] for name in names])
        if not names:
            return {}
        (x, number), curvature = self.stations, self.mean(self.curvature[0])
        found, columns = {}, self.columns(x)
        left = [self.mean(part) for part in self.residual_curvature[:2]]  # along, and across
        free = self.free_strip()
        powers = np.bincount(number, self.strip.weights().ravel() * self.power)
        ends = np.concatenate([[-np.inf], 0.5 * (places[1:] + places[:-1]), [np.inf]])
        for name, low, high in zip(names, ends[:-1], ends[1:], strict=True):
            here = np.flatnonzero((x >= low) & (x < high))
            contact = self.state.contacts[name]
            push = contact.normal @ (contact.pressure * contact.area)
            sense = np.sign(push @ np.cross(self.state.slope(contact.middle), [0.0, 1.0, 0.0]))
            p = here[(sense * curvature[here]).argmax()]
            behind = np.linspace(*free[name], MEAN_SAMPLES)
            on_roller = [float(part[p]) for part in left]
            told = [float(np.interp(behind, x, part).mean()) for part in left]
            found[name] = RollerBend(
                curvature=float(curvature[p]),
                moment=float(columns["moment"][p]),
                plastic_share=float(columns["plastic_share"][p]),
                curl_on_roller=on_roller[0],
                crossbow_on_roller=on_roller[1] if on_roller[1:] else None,
                curl=told[0],
                crossbow=told[1] if told[1:] else None,
                elongation=float(columns["elongation"][here[-1]]),
                yield_power=float(powers[here].sum()),
            )
        return found


@dataclass
class MeanFlow:
    """Share of its yield stress at which strip flows: that of a steady state, or of stages in time.

    Of these it is the mean by power from the last steady state on.  On the way to a steady state
    the stresses that count in the flow law may still grow.
    """

    work: float = 0.0  # J, or W in a steady state
    weighted: float = 0.0  # that by the share
    steady: bool = False

    @property
    def level(self) -> float | None:
        """The share (1); None where nothing has flowed."""
        return self.weighted / self.work if self.work > 0.0 else None

    def add(self, state: StripState, duration: float) -> None:
        """Add the state at the end of a step that took such a time (s)."""
        strip = YieldedStrip.of(state)
        if strip is None or (state.plan.steady and state.control < 1.0):
            return
        (power, level), steady = strip.flowing, state.plan.steady
        if steady or (self.steady and power):
            self.work = self.weighted = 0.0
            self.steady = steady
        work = power * (1.0 if steady else duration)
        self.work += work
        self.weighted += work * level
