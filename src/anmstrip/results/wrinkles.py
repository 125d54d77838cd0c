"""Wrinkles of a shell: what compresses its free spans, and how far they are from smooth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
import numpy as np
from numpy.typing import NDArray
from anmstrip.fem.sampling import shape_of
from anmstrip.fem.sampling import quadrature_points
from anmstrip.results.fields import Surface
from anmstrip.results.state import State

Array = NDArray[np.float64]

CLOSE = 0.5
"""Share of the compression that a span bears, above which it is told."""

PART = 0.1
"""Share of the largest compression that counts as compressed."""

LAYERS = 4.0
"""Distance of a free span from a roller, in √(D/T): where it lifts off a strip is stressed so."""

SMOOTH = 2
"""Degree in y of what is no wrinkle: a line across may be shifted, tilted and bowed."""


@dataclass(frozen=True)
class Span:
    """A stretch of the strip between rollers or ends, where its membrane is compressed most.

    Attributes
    ----------
    before, after : str
        Rollers or ends.
    start, end : float
        Reference x (m).
    compression : float
        N/m, at least 0.
    bearable : float
        What the span bears under the tension of that place (N/m).
    share : float
        Of the width that is compressed there.
    """

    before: str
    after: str
    start: float
    end: float
    compression: float
    bearable: float
    share: float

    def __str__(self) -> str:
        return (
            f"compressed by {self.compression:.3g} N/m between {self.before} and {self.after}, "
            f"over {100.0 * self.share:.0f} % of the width; "
            f"wrinkles are likely above {self.bearable:.3g} N/m."
        )


@dataclass(frozen=True)
class Wrinkling:
    """What is known of wrinkles in a state of a shell.

    Attributes
    ----------
    state : State
    """

    state: State

    @cached_property
    def spans(self) -> list[Span]:
        """Free spans, from entry to exit."""
        return [self._span(*ends) for ends in _ends(self.state)]

    @property
    def compression(self) -> float:
        """Largest principal compression of the free spans (N/m), at least 0."""
        return max((span.compression for span in self.spans), default=0.0)

    @property
    def warnings(self) -> list[str]:
        """Spans that are near to wrinkling, in words."""
        near = [span for span in self.spans if span.compression > CLOSE * span.bearable]
        return [f"The strip is {span}" for span in near]

    def _span(self, before: str, after: str, start: float, end: float) -> Span:
        strip = self.state.plan.model.strip
        x, forces = quadrature_points(strip)[0], self.state.principal_forces
        inside = (start <= x) & (x <= end)
        if not inside.any():
            return Span(before, after, start, end, 0.0, np.inf, 0.0)
        weights = strip.weights().ravel()[inside]
        x, (low, high) = x[inside], forces[inside].T
        worst = int(low.argmin())
        beside = np.abs(x - x[worst]) <= 0.5 * strip.cell_sizes[0].max()
        compressed = beside & (low < PART * low[worst])
        d, q = strip.bending_stiffness, np.pi / (end - start)
        bearable = 2.0 * q * np.sqrt(d * (d * q**2 + max(high[worst], 0.0))) + 2.0 * d * q**2
        share = weights[compressed].sum() / weights[beside].sum()
        compression = max(-float(low[worst]), 0.0)
        return Span(before, after, start, end, compression, float(bearable), float(share))

    def amplitudes(self, surface: Surface | None = None) -> list[float] | None:
        """Largest distance, along the normal, from the parabola nearest to a line across (m).

        For every span, of its lines of points x = const; ``None`` on triangles, which have none.

        Parameters
        ----------
        surface : Surface, optional
            Of the strip, if there is one already.
        """
        strip = self.state.plan.model.strip
        if shape_of(strip) != "quad":
            return None
        surface = Surface(strip, None, None) if surface is None else surface
        lines = _lines(surface, self.state.full, strip.cell_sizes[0].min())
        x = np.array([line.x for line in lines])
        along = np.gradient(np.stack([line.middle for line in lines]), x, axis=0)
        heights = np.array([line.height(t) for line, t in zip(lines, along, strict=True)])
        inside = ((span.start <= x) & (x <= span.end) for span in self.spans)
        return [float(heights[part].max(initial=0.0)) for part in inside]

    def amplitude(self, surface: Surface | None = None) -> float | None:
        """The largest of them (m)."""
        found = self.amplitudes(surface)
        return None if found is None else max(found, default=0.0)


@dataclass(frozen=True)
class _Line:
    """A line of points across the strip, with the parabola that is nearest to it."""

    x: float
    fit: Array
    off: Array

    @property
    def middle(self) -> Array:
        """Of the parabola, shape (3,)."""
        return np.asarray(self.fit[-1])

    def height(self, along: Array) -> float:
        """Largest distance of the points from the parabola, normal to a direction along (m)."""
        normal = np.cross(along, self.fit[-2])
        return float(np.abs(self.off @ normal).max() / np.linalg.norm(normal))


def _lines(surface: Surface, full: Array, element: float) -> list[_Line]:
    """All lines of points that a parabola does not fit anyway, from entry to exit."""
    reference = surface.reference
    points = reference.T + surface.interpolated(full)
    rows = np.round(reference[0] / (1e-3 * element)).astype(np.int64)
    order = np.lexsort((reference[1], rows))
    cuts = np.flatnonzero(np.diff(rows[order])) + 1
    lines = [part for part in np.split(order, cuts) if len(part) > SMOOTH + 1]
    return [_fitted(reference[0, part[0]], reference[1, part], points[part]) for part in lines]


def _fitted(x: float, y: Array, points: Array) -> _Line:
    basis = np.vander(y, SMOOTH + 1)
    fit = np.asarray(np.linalg.lstsq(basis, points, rcond=None)[0], dtype=np.float64)
    return _Line(float(x), fit, points - basis @ fit)


def _ends(state: State) -> Iterator[tuple[str, str, float, float]]:
    """Names and reference x of both ends of every free span."""
    model = state.plan.model
    x, layer = model.strip.nodes[0], np.sqrt(model.strip.bending_stiffness / model.scales.tension)
    touched = [(name, c) for name, c in state.contacts.items() if c.touching.any()]
    reach = LAYERS * layer * np.array([-1.0, 1.0])
    arcs = sorted((*(contact.arc + reach), name) for name, contact in touched)
    stations = [(x.min(), x.min(), "the entry"), *arcs, (x.max(), x.max(), "the exit")]
    for (_, start, before), (end, _, after) in pairwise(stations):
        if start < end:
            yield before, after, float(start), float(end)
