"""Wrinkles of a shell: what compresses its free spans, and how far they are from smooth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.sampling import quadrature_points, shape_of
from anmstrip.mechanics.shell import eigenstrain
from anmstrip.results.fields import FieldSampler
from anmstrip.results.state import State

CLOSE = 0.5
"""Share of the compression that a span bears, above which it is told."""

PART = 0.1
"""Share of the largest compression that counts as compressed."""

LAYERS = 4.0
"""Distance of a free span from a roller, in √(D/T): where it lifts off a strip is stressed so."""

I_UNIT, EDGES = 1e-5, (-0.5, 0.5)
"""Strain of one I-unit of flatness, and where the edges are, over the width."""

SMOOTH = 2
"""Degree in y of what is no wrinkle: a line across may be shifted, tilted and bowed."""


@dataclass(frozen=True)
class Span:
    """A stretch of the strip between rollers or ends, where its membrane is compressed most."""

    before: str  # roller or end
    after: str
    start: float  # reference x (m)
    end: float
    compression: float  # N/m, at least 0
    bearable: float  # what the span bears under the tension of that place (N/m)
    share: float  # of the width that is compressed there

    @property
    def near(self) -> bool:
        """Whether it bears hardly more than what compresses it."""
        return self.compression > CLOSE * self.bearable

    def __str__(self) -> str:
        return (
            f"compressed by {self.compression:.3g} N/m between {self.before} and {self.after}, "
            f"over {100.0 * self.share:.0f} % of the width; "
            f"wrinkles are likely above {self.bearable:.3g} N/m."
        )


def free_spans(state: State) -> Iterator[Span]:
    """Yield the spans between entry, rollers and exit where the strip is free, in this order.

    A plate in tension T_y along and compression across bears
    2 q √(D (D q² + T)) + 2 D q² with q = π / length.
    """
    model = state.plan.model
    strip, d = model.strip, model.strip.bending_stiffness
    ends = float(strip.nodes[0].min()), float(strip.nodes[0].max())
    reach = LAYERS * np.sqrt(d / model.scales.tension) * np.array([-1.0, 1.0])
    touched = [(name, c) for name, c in state.contacts.items() if c.touching.any()]
    arcs = sorted((*(contact.arc + reach), name) for name, contact in touched)
    stations = [(*2 * ends[:1], "the entry"), *arcs, (*2 * ends[1:], "the exit")]
    positions, weights = quadrature_points(strip)[0], strip.weights().ravel()
    for (_, start, before), (end, _, after) in pairwise(stations):
        inside = (start <= positions) & (positions <= end)
        if start >= end:
            continue
        if not inside.any():
            yield Span(before, after, float(start), float(end), 0.0, np.inf, 0.0)
            continue
        x, area, (low, high) = positions[inside], weights[inside], state.principal_forces[inside].T
        worst, q = int(low.argmin()), np.pi / (end - start)
        beside = np.abs(x - x[worst]) <= 0.5 * strip.cell_sizes[0].max()
        compressed = beside & (low < PART * low[worst])
        bearable = 2.0 * q * np.sqrt(d * (d * q**2 + max(high[worst], 0.0))) + 2.0 * d * q**2
        share, pressed = area[compressed].sum() / area[beside].sum(), max(-float(low[worst]), 0.0)
        numbers = pressed, float(bearable), float(share)
        yield Span(before, after, float(start), float(end), *numbers)


def square_integrals(y: Array, w: Array) -> Array:
    """Integrals of w² and (dw/dy)² over lines of elements, on each of which w is a cubic.

    Parameters
    ----------
    y, w : ndarray, shape (3 elements + 1,)
        Evenly spaced within every element.
    """
    nodes, weights = np.polynomial.legendre.leggauss(4)
    t, powers = 0.5 * (1.0 + nodes[:, None]), np.arange(4)
    cubics = np.linalg.inv(np.linspace(0.0, 1.0, 4)[:, None] ** powers)
    values = t**powers, powers * t ** np.maximum(powers - 1, 0)
    begin = np.arange(0, len(y) - 3, 3)
    sizes, own = y[begin + 3] - y[begin], cubics @ w[begin[:, None] + powers].T
    w2, slope2 = (0.5 * weights @ (value @ own) ** 2 for value in values)
    return np.array([w2 @ sizes, slope2 @ (1.0 / sizes)])


@dataclass(frozen=True)
class Wrinkling:
    """Compression and wrinkles in a state of a shell."""

    state: State

    @cached_property
    def spans(self) -> list[Span]:
        """Free spans, from entry to exit."""
        return list(free_spans(self.state))

    @property
    def compression(self) -> float:
        """Largest principal compression of the free spans (N/m), at least 0."""
        return max((span.compression for span in self.spans), default=0.0)

    @property
    def warnings(self) -> list[str]:
        """Spans that are near to wrinkling, in words."""
        return [f"The strip is {span}" for span in self.spans if span.near]

    def lines(self, sampler: FieldSampler | None = None) -> list[tuple[float, Array, Array]]:
        """Return x, y and w (m) of the lines x = const of points that a parabola may not fit.

        w is the distance, along the normal, from the parabola in y nearest to the line.  Triangles
        have no such lines.

        Parameters
        ----------
        sampler : FieldSampler, optional
            Points of the strip, if there are some already.
        """
        strip = self.state.plan.model.strip
        if shape_of(strip) != "quad":
            return []
        sampler = FieldSampler(strip, None, None) if sampler is None else sampler
        reference = sampler.reference
        points = reference.T + sampler.interpolate(self.state.full)
        rows = np.round(reference[0] / (1e-3 * strip.cell_sizes[0].min())).astype(np.int64)
        order = np.lexsort((reference[1], rows))
        lines = np.split(order, np.flatnonzero(np.diff(rows[order])) + 1)
        lines = [line for line in lines if len(line) > SMOOTH + 1]
        x = reference[0, [line[0] for line in lines]]
        bases = [np.vander(reference[1, line], SMOOTH + 1) for line in lines]
        pairs = list(zip(bases, lines, strict=True))
        fits = np.stack(
            [np.linalg.lstsq(basis, points[line], rcond=None)[0] for basis, line in pairs]
        )
        normals = np.cross(np.gradient(fits[:, -1], x, axis=0), fits[:, -2])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        parts = zip(x, pairs, fits, normals, strict=True)
        return [(at, reference[1, k], (points[k] - b @ fit) @ n) for at, (b, k), fit, n in parts]

    def waves(self, sampler: FieldSampler | None = None) -> list[tuple[float, float]] | None:
        """Height and spacing (m) of the waves across every span, ``None`` on triangles.

        The height is the largest distance w of :meth:`lines`, the spacing 2π √(∫w² dy / ∫w,y² dy)
        of the line where that is.  Both are 0 of a span without lines.
        """
        lines, found = self.lines(sampler), []
        for span in self.spans:
            inside = [(y, w) for x, y, w in lines if span.start <= x <= span.end]
            spacing = height = 0.0
            if inside:
                y, w = max(inside, key=lambda line: np.abs(line[1]).max())
                height, (heights, slopes) = np.abs(w).max(), square_integrals(y, w)
                spacing = 2.0 * np.pi * np.sqrt(heights / slopes) if height else 0.0
            found.append((float(height), float(spacing)))
        return found if lines else None

    def amplitudes(self, sampler: FieldSampler | None = None) -> list[float] | None:
        """Heights of :meth:`waves` (m)."""
        found = self.waves(sampler)
        return None if found is None else [height for height, _ in found]

    def wave(self, sampler: FieldSampler | None = None) -> tuple[float, float] | None:
        """Return the highest of :meth:`waves`."""
        found = self.waves(sampler)
        return None if found is None else max(found, default=(0.0, 0.0))

    @cached_property
    def flatness(self) -> dict[str, float]:
        """Latent and manifest flatness (I-units of 1e-5) of an uneven strip; empty of another.

        Latent is by how much the eigenstrain along differs between fibres, as means along the
        strip: what waves and stress share.  Manifest is by how much the waves of fibres differ, of
        the free span where that is most: arc over chord of a fibre, less 1, which is (π²/4)(H/λ)²
        of waves H high.  Both reach to the edges by cubics.  Empty on triangles, too.
        """
        strip, membrane = self.state.plan.model.strip, self.state.membrane
        own = eigenstrain(strip, self.state.controls)
        if own is None or membrane is None or shape_of(strip) != "quad":
            return {}
        x, y, _ = quadrature_points(strip)
        tangents = membrane.operator.apply(self.state.full)[:, 0] + np.eye(3)[0][:, None]
        lengths, weights = np.linalg.norm(tangents, axis=0), strip.weights().ravel()
        places, fibre = np.unique(np.round(y / strip.width, 9), return_inverse=True)

        def sums(values: Array, chosen: Array) -> Array:
            return np.asarray(np.bincount(fibre[chosen], (values * weights)[chosen], len(places)))

        def unevenness(profile: Array) -> float:
            ends = [np.polyfit(places[k], profile[k], 3) for k in (slice(4), slice(-4, None))]
            sides = [np.polyval(fit, eta) for fit, eta in zip(ends, EDGES, strict=True)]
            return float(np.ptp([*profile, *sides])) / I_UNIT

        everywhere, waves = np.ones(len(x), dtype=bool), [0.0]
        for span in self.spans:
            if (inside := (span.start <= x) & (x <= span.end)).any():
                chords = np.linalg.norm([sums(t, inside) for t in tangents], axis=0)
                waves.append(unevenness(sums(lengths, inside) / chords - 1.0))
        area = sums(np.ones(len(x)), everywhere)
        latent = unevenness(sums(own[0, 0], everywhere) / area)
        return {"latent_flatness": latent, "manifest_flatness": max(waves)}
