"""Wrinkles of a shell: what compresses its free spans, how far they are from smooth, and where they
begin along a path.

The compressive part of the membrane forces takes G off the stiffness.  If compression grows by μ,
the tangent K becomes K + (1 − μ) G: it is singular at the real eigenvalues μ of (K + G) φ = μ G φ,
and K itself where one of them is 1.  As det K / det (K + G) = Π (1 − 1/μ), the number of real
factors below 1 changes with the sign of the determinant, and tells two modes that come at once.
Where friction makes K unsymmetric inertia has no such meaning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import islice, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals, orth
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs, eigsh

from anmstrip.arrays import Array
from anmstrip.continuation.path import Cost
from anmstrip.equilibrium import Equilibrium, StageProblem
from anmstrip.fem.geometry import normal_vector
from anmstrip.fem.operators import Blocks, CellOperator, Pattern
from anmstrip.fem.sampling import l2_projection, quadrature_points, shape_of
from anmstrip.fem.strip import Strip
from anmstrip.linalg.direct import SingularTangentError
from anmstrip.linalg.solvers import Bordered, LinearSolver, SparseSolver
from anmstrip.mechanics.shell import Membrane, eigenstrain, principal_forces
from anmstrip.results.fields import FieldSampler
from anmstrip.results.rollers import FREE_DISTANCE
from anmstrip.results.state import State

NEAR_BUCKLING = 0.5
"""Share of the compression that a span bears, as a mean along it, above which it is told.

Where strip begins to wrinkle beside a crown (``examples/roller_wrinkles.py``) the mean is 0.84 to
0.91 of it, the largest compression 1.4 to 1.9 times as much.  Four elements across make up 26 N/m
where strip lifts off a straight roller in a span of 30 m: 1.5 times as much, as a mean 0.05 times.
"""

COLUMN_FACTORS = 4.0, 2.046, 1.0
"""Of Euler's π² D/L²: of a column whose slope is held at both ends, at one, or at none."""

FIBRE_WIDTH = 0.1
"""Width, in elements, of a line along which a mean is taken: one of points."""

COMPRESSED_SHARE = 0.1
"""Share of the largest compression that counts as compressed."""

PEAK_SHARE = 0.01
"""Least share of the width that a compressed part takes up, as of a peak at one point."""

I_UNIT = 1e-5
"""Strain of one I-unit of flatness."""

GAUSS_POINTS = np.polynomial.legendre.leggauss(4)[0]
"""Places across an element, from -1 to 1, at which strains are known."""

TO_SIDES = np.linalg.inv(np.vander(GAUSS_POINTS)).T @ np.vander([-1.0, 1.0], 4).T
"""From values there to those of the cubic through them at both sides, (4, 2)."""

PLACES = np.linspace(-1.0, 1.0, 65)[1::2]
"""Middles of equal parts of an element."""

TO_PLACES = np.linalg.inv(np.vander(GAUSS_POINTS)).T @ np.vander(PLACES, 4).T
"""The same to those, (4, parts)."""

SMOOTH_DEGREE = 2
"""Degree in y of what is no wrinkle: a line across may be shifted, tilted and bowed."""


@dataclass(frozen=True)
class Span:
    """A stretch of the strip between rollers or ends, and what compresses its membrane."""

    before: str  # roller or end
    after: str
    start: float  # reference x (m)
    end: float
    compression: float  # the largest (N/m), at least 0
    mean: float  # of the compression along the span, of the line where that is largest (N/m)
    bearable: float  # what the span bears all along, under the tension of that line (N/m)
    share: float  # of the width that is compressed there
    points: NDArray[np.bool_] = field(compare=False, repr=False)  # at which it is looked for
    part: float = 0.0  # what that part of the width bears along between stretched ones (N/m)
    spacing: float = np.inf  # of waves across, if those are what compression makes (m)

    @property
    def near(self) -> bool:
        """Whether it bears hardly more than what compresses it.

        A wave is as long as its span, or bears more: what works on it is the mean along.
        """
        return self.mean > NEAR_BUCKLING * self.bearable

    def __str__(self) -> str:
        return (
            f"compressed by {self.compression:.3g} N/m between {self.before} and {self.after}, "
            f"over {100.0 * self.share:.0f} % of the width; by a rule of thumb it wrinkles above "
            f"about {max(self.bearable * self.compression / self.mean, self.part):.3g} N/m."
        )


def free_spans(state: State) -> Iterator[Span]:
    """Yield the spans between entry, rollers and exit where the strip is free, in this order.

    Each by :func:`bearable_compression` where the line along it is that compression works on most,
    under the tension of its most compressed point.  In a stretched sheet that is in the middle: at
    the corners of its clamped ends compression has no bound, and no length.
    """
    model = state.plan.model
    strip, d = model.strip, model.strip.bending_stiffness
    begin, stop = strip.span
    reach = FREE_DISTANCE * np.sqrt(d / model.scales.tension) * np.array([-1.0, 1.0])
    arcs = sorted((*(contact.arc + reach), name) for name, contact in state.touched.items())
    stations = [(begin, begin, "the entry"), *arcs, (stop, stop, "the exit")]
    (positions, fibres, _), weights = quadrature_points(strip), strip.weights().ravel()
    lines = np.round(fibres / (FIBRE_WIDTH * strip.cell_sizes[1].max())).astype(np.int64)
    lines -= lines.min()
    for (_, start, before), (end, _, after) in pairwise(stations):
        if start >= end:
            continue
        place = before, after, float(start), float(end)
        q = np.pi / float(np.diff(state.unstressed_length(np.array([start, end])))[0])
        within = (start <= positions) & (positions <= end)
        least = COMPRESSED_SHARE * bearable_compression(d, q, model.scales.tension)
        inside = within & far_from_supports(state, least)
        if not inside.any():
            yield Span(*place, 0.0, 0.0, np.inf, 0.0, inside)
            continue
        low, high = state.principal_forces.T
        pressure = np.where(inside, np.maximum(-low, 0.0), 0.0)
        summed = pressure * weights, weights
        work, area = (np.bincount(lines[within], each[within]) for each in summed)
        means = np.divide(work, area, out=np.zeros_like(work), where=area > 0.0)
        fibre = inside & (lines == means.argmax())
        worst = int(np.where(fibre if means.any() else inside, low, np.inf).argmin())
        beside = inside & (np.abs(positions - positions[worst]) <= 0.5 * strip.cell_sizes[0].max())
        n, tension = state.membrane_forces[..., worst], max(high[worst], 0.0)
        forces = state.membrane_forces[0, 0] if n[0, 0] < n[1, 1] else None
        compressed = compressed_parts(strip, low, COMPRESSED_SHARE * low[worst], forces)
        share = np.average(compressed[beside], weights=weights[beside])
        spacing, part, borne = np.inf, 0.0, bearable_compression(d, q, tension)
        if n[1, 1] < n[0, 0]:
            spacing = wave_spacing(d, q, tension)
        elif n[0, 0] < n[1, 1] and share < 1.0 - COMPRESSED_SHARE:  # the rest of the width holds it
            edge = np.abs(fibres[worst]) > 0.5 * strip.width * (1.0 - COMPRESSED_SHARE)
            wide = max(float(share), PEAK_SHARE) * strip.width
            part = band_compression(d, wide, edge=bool(edge))
        else:  # as a column, of which no roller holds the slope at an end, or as a plate
            ends = {"entry": before == "the entry", "exit": after == "the exit"}
            turning = sum(free and gives_way(state, name, 1) for name, free in ends.items())
            held = sum(not gives_way(state, name, 0) for name in ("left", "right"))
            borne = COLUMN_FACTORS[turning] * d * q**2
            borne = max(borne, plate_compression(d, q, strip.width, held))
        pressed, mean = float(pressure.max()), float(means.max())
        yield Span(*place, pressed, mean, borne, float(share), inside, part, spacing)


def gives_way(state: State, name: str, order: int) -> bool:
    """Whether nothing holds the height of an edge (order 0), or its slope (1)."""
    strip = state.plan.model.strip
    if name not in strip.edges:
        return True
    unknowns = strip.edge_unknowns(name, *([2] if k == order else () for k in range(3)))
    return bool(np.isin(unknowns, state.plan.supports.free).any())


def plate_compression(d: float, q: float, width: float, held: int) -> float:
    """Compression along (N/m) that a plate bears by one or both of its sides that are held.

    (q + k²/q)² D at least 4 D k² with k = π/W; with one side free q² D + 0.425 D k² (Timoshenko &
    Gere, § 9.4).
    """
    k = np.pi / width
    both = (max(q, k) + k**2 / max(q, k)) ** 2
    return float(d * (0.0, q**2 + 0.425 * k**2, both)[held])


def compressed_parts(strip: Strip, low: Array, level: float, along: Array | None) -> Array:
    """Share of the width around every point at which it is compressed below a level, (points,).

    Parameters
    ----------
    strip : Strip
    low : ndarray, shape (points,)
        Least principal forces (N/m).
    level : float
        N/m.
    along : ndarray, shape (points,), optional
        Forces along (N/m), if these compress.  On rectangles by the cubic through a line of points
        across an element: at an edge a part of the width may end between two of them.
    """
    if along is None or shape_of(strip) != "quad":
        return (low < level).astype(float)
    lines = along.reshape(-1, len(GAUSS_POINTS), len(GAUSS_POINTS))  # element, across, along
    below = np.einsum("eyx,yp->epx", lines, TO_PLACES) < level
    return np.broadcast_to(below.mean(axis=1, keepdims=True), lines.shape).ravel()


def band_compression(d: float, width: float, *, edge: bool) -> float:
    """Compression along (N/m) above which a part of the width waves between stretched ones.

    A long plate on simple supports bears 4 π² D/b², and 0.425 π² D/b² with one edge free, each of
    the two edges half of the width (Timoshenko & Gere, Theory of elastic stability, § 9.2, 1961).
    It is half of that, as waves go on into what is stretched: at the onsets of quadratic flatness
    the largest compression is 17 and 1.7 to 2.8 times D/b².
    """
    number, b = (0.425, 0.5 * width) if edge else (4.0, width)
    return float(0.5 * number * d * (np.pi / b) ** 2)


def bearable_compression(d: float, q: float, tension: float) -> float:
    """Compression across (N/m) that a plate in tension bears, 2 q √(D (D q² + T)) + 2 D q².

    Parameters
    ----------
    d : float
        D (N m).
    q : float
        π over its length (1/m).
    tension : float
        T along it (N/m).
    """
    return float(2.0 * q * np.sqrt(d * (d * q**2 + tension)) + 2.0 * d * q**2)


def wave_spacing(d: float, q: float, tension: float) -> float:
    """Distance (m) of the crests that come at :func:`bearable_compression`, 2π/k.

    Of all waves across [D (k² + q²)² + T q²]/k² is least at k⁴ = q⁴ + T q²/D.
    """
    return float(2.0 * np.pi * (q**4 + tension * q**2 / d) ** -0.25)


def far_from_supports(state: State, least: float) -> NDArray[np.bool_]:
    """Return which quadrature points are far from nodes that alone are held across.

    A side force P on one node compresses by 2 P/(π r) at a distance r, without bound.  Left out is
    what is nearer than half a width, as far as that is more than a least compression (N/m).
    """
    strip, names = state.plan.model.strip, ("u", "u_x", "u_y")
    across = [strip.count * strip.dofs(name) + 1 for name in names]
    free = [np.isin(unknowns, state.plan.supports.free) for unknowns in across]
    alone = ~free[0] & free[1] & free[2]
    reach = 2.0 / np.pi * np.abs(state.imbalance[across[0][alone]]) / max(least, 1e-300)
    away = quadrature_points(strip)[:2, :, None] - strip.nodes[:2, None, alone]
    near = np.linalg.norm(away, axis=0) <= np.minimum(reach, 0.5 * strip.width)
    return ~np.asarray(near.any(axis=1))


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


class Wrinkling:
    """Compression and wrinkles in a state of a shell.

    Parameters
    ----------
    state : State

    Attributes
    ----------
    spans : list of Span
        Free spans, from entry to exit.
    compression : float
        Largest principal compression of the free spans (N/m), at least 0.
    near : list of Span
        Spans that are near to wrinkling.
    warnings : list of str
        The same in words.
    """

    def __init__(self, state: State) -> None:
        self.state, self.spans = state, list(free_spans(state))
        self.compression = max((span.compression for span in self.spans), default=0.0)
        self.near = [span for span in self.spans if span.near]
        self.warnings = [f"the strip is {span}" for span in self.near]

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
        sampler = sampler or FieldSampler(strip)
        reference = sampler.reference
        points = reference.T + sampler.interpolate(self.state.full)
        rows = np.round(reference[0] / (1e-3 * strip.cell_sizes[0].min())).astype(np.int64)
        order = np.lexsort((reference[1], rows))
        lines = np.split(order, np.flatnonzero(np.diff(rows[order])) + 1)
        lines = [line for line in lines if len(line) > SMOOTH_DEGREE + 1]
        x = reference[0, [line[0] for line in lines]]
        bases = [np.vander(reference[1, line], SMOOTH_DEGREE + 1) for line in lines]
        pairs = list(zip(bases, lines, strict=True))
        fits = np.stack([np.linalg.lstsq(b, points[k], rcond=None)[0] for b, k in pairs])
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

    def amplitudes(self) -> list[float] | None:
        """Heights of :meth:`waves` (m)."""
        found = self.waves()
        return None if found is None else [height for height, _ in found]

    def wave(self, sampler: FieldSampler | None = None) -> tuple[float, float] | None:
        """Return the highest of :meth:`waves`."""
        found = self.waves(sampler)
        return None if found is None else max(found, default=(0.0, 0.0))

    @cached_property
    def flatness(self) -> dict[str, float]:
        """Latent and manifest flatness (I-units of 1e-5) of an uneven strip; empty of another.

        Latent is by how much the unstressed lengths of fibres differ, as means along the
        strip: what waves and stress share.  Manifest is by how much the waves of fibres differ, of
        the free span where that is most: arc over chord of a fibre, less 1, which is (π²/4)(H/λ)²
        of waves H high.  Both reach to the sides of all elements by cubics, since corners of what
        is typed are there.  Empty on triangles, too.
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
            each = profile.reshape(-1, len(GAUSS_POINTS))
            return float(np.ptp(np.concatenate([each, each @ TO_SIDES], axis=1))) / I_UNIT

        everywhere, waves = np.ones(len(x), dtype=bool), [0.0]
        for span in self.spans:
            if (inside := (span.start <= x) & (x <= span.end)).any():
                chords = np.linalg.norm([sums(t, inside) for t in tangents], axis=0)
                waves.append(unevenness(sums(lengths, inside) / chords - 1.0))
        area = sums(np.ones(len(x)), everywhere)
        latent = unevenness(sums(np.sqrt(1.0 + 2.0 * own[0, 0]), everywhere) / area)
        return {"latent_flatness": latent, "manifest_flatness": max(waves)}


TRACKED_MODES = 6
"""Modes of which the factors are looked at along a path."""

ONSET_TOLERANCE = 1e-4
"""Share of a step to which an onset is dated: of a tension that is halved in ten steps to 1e-5."""

COLUMN_SHARE = 0.2
"""Share of what a span bears across that it may bear along: as a column a quarter."""

SYMMETRY_ROUND_OFF = 1e-12
"""Asymmetry of a tangent, over its largest entry, that is none."""

EIGENVALUE_TOLERANCE = 1e-8
"""Relative error of the inverse of a factor.  Round-off of contact, 1e11 times as stiff as bending,
leaves 1e-7 of a solution: with 0 ARPACK goes on for three times as many, and may end astray."""

ROUGH_TOLERANCE = 1e-2
"""The same where it is only asked whether the lowest factor is far from 1, and on a finer mesh.
The lowest alone takes 21 solutions of a furnace strip and is 5e-4 wrong; all that are tracked take
40 instead of 70, and the lowest of them keeps eight digits."""

MAX_GALERKIN = 4
"""States in which modes are looked for to date an onset by those of states nearby: it takes one to
three of them.  Where these lead astray, as modes are born and end there, the bracket is divided."""

FACTOR_TOLERANCE = 1e-3
"""Distance of a dated factor from its level; else it was a complex pair that was born there."""

FAR_FROM_BUCKLING = 1.5
"""Lowest factor above which nothing is about to wrinkle, nor in the next state."""

PROPORTION_MARGIN = 2.0
"""How much faster than compression grows factors may fall: those of strip that is pressed in its
middle alone fell from 8.3 to 1 while that grew fivefold.  A state is not looked at where in this
proportion factors stay far: a shell on a roller would look at every step, half of its time."""

ONSET_FACTOR, BIFURCATION, WAVES = 1.01, "bifurcation", "waves"
DATED_FACTORS = {ONSET_FACTOR: "wrinkles", 1.0: BIFURCATION}
"""Factors that are dated: the first where it falls, the second both ways.  Where the strip is bent
a little as a mode is, its path has no bifurcation: it turns aside, and the factor remains above 1
by less than this in the cases of ``examples/conveyed_wrinkles.py``."""

SAME_ONSET = 0.01
"""Part of a stage within which onsets are those of one state on the finer mesh: the bifurcation
behind a mode that is about to wrinkle is 0.002 of it away."""

RATE_SHARE = 0.05
"""Share of a branch over which the rate at which a mode comes to its onset is a difference."""

WAVE_HEIGHT = 0.5
"""Height of waves over the thickness from which on strip waves that is near its onset and bent a
little as its mode is, so that its path turns aside.  It is within 4 % of the onset of flat strip
in ``tests/benchmarks/test_waves.py``, and earlier where rollers bend the strip more."""


def compressive_stiffness(
    membrane: Membrane, forces: Array, pattern: Pattern, others: int = 0, growth: Any = 1.0
) -> Blocks:
    """Blocks of G, see :class:`~anmstrip.fem.operators.Pattern`, from N (d, d, points).

    Of a model with so many other unknowns besides those of the strip, whose labels hold g times
    their length of it.
    """
    values, vectors = principal_forces(forces)
    part = np.einsum("pak,pk,pbk->abp", vectors, -np.minimum(values, 0.0), vectors)
    part[0] /= growth
    part[:, 0] /= growth
    m, blocks = pattern.count, pattern.zeros(others)
    derivative = np.einsum("ij,bap->jbiap", np.eye(m), part * growth)
    membrane.operator.add_tangent(derivative, pattern, blocks)
    return blocks


def is_symmetric(matrix: csc_matrix) -> bool:
    """Whether a matrix is its transpose but for round-off."""
    return bool(abs(matrix - matrix.T).max() <= SYMMETRY_ROUND_OFF * abs(matrix).max())


def buckling_modes(
    tangent: csc_matrix | Bordered,
    compressive: csc_matrix | Bordered,
    solver: LinearSolver,
    count: int,
    tolerance: float = EIGENVALUE_TOLERANCE,
) -> tuple[Array, Array]:
    """The lowest factors μ, ascending, and modes φ in columns.

    Lanczos' method finds them where K + G is symmetric and positive definite.  It is indefinite
    where strip may slide off a concave roller, say, and not symmetric with friction: there
    Arnoldi's method finds the real ones among as many as are looked for, which may be none; a
    complex pair makes no tangent singular.

    Parameters
    ----------
    tangent, compressive : csc_matrix or Bordered, shape (n, n)
        K and G.
    solver : LinearSolver
    count : int
        Number of modes.
    tolerance : float
        Relative error of the inverse of a factor.
    """
    spared, n = tangent + compressive, tangent.shape[0]
    symmetric = False
    if not isinstance(spared, Bordered) and is_symmetric(spared):
        spared, symmetric = csc_matrix(0.5 * (spared + spared.T)), True
    factors = solver.factorise(spared)
    solve, start = factors.solve, factors.solve(np.cos(np.arange(1.0, n + 1.0) ** 2))
    if symmetric and not factors.negatives:
        inverse = LinearOperator((n, n), matvec=solve)
        given = {"M": spared, "Minv": inverse, "v0": start, "tol": tolerance}
        values, modes = eigsh(compressive, count, which="LA", **given)
    else:
        growing = LinearOperator((n, n), matvec=lambda u: solve(compressive @ u), dtype=float)
        values, modes = eigs(growing, count, which="LR", v0=start, tol=tolerance)
        real = values.imag == 0.0
        values, modes = values[real].real, modes[:, real].real
    order = np.argsort(values)[::-1]
    with np.errstate(divide="ignore"):
        return 1.0 / values[order], modes[:, order]


def buckling_matrices(state: State) -> tuple[csc_matrix | Bordered, csc_matrix | Bordered] | None:
    """Return K and G of a state, see :func:`buckling`; None if nothing is compressed."""
    plan, model = state.plan, state.plan.model.without_rates
    free = plan.supports.free
    if not plan.steady:
        free = free[free < model.strip.unknowns]
    equations = Equilibrium(model, replace(plan.supports, free=free), plan.controls)
    u = state.full[free] - plan.supports.start[free]
    assert state.membrane is not None
    forces = state.membrane_forces
    growth = state.controls.get("strip.growth", 1.0)
    blocks = compressive_stiffness(state.membrane, forces, model.pattern, model.others, growth)
    if not blocks.pairs.any():
        return None
    tangent = equations.recurrence(u, state.control, 1).tangent()
    return tangent, model.pattern.restricted(free).matrix(blocks)


def buckling(
    state: State,
    count: int,
    solver: LinearSolver | None = None,
    tolerance: float = EIGENVALUE_TOLERANCE,
) -> tuple[Array, Array]:
    """Factors and modes of a state, see :func:`buckling_modes`.

    Of a stationary state with its friction, its rollers and its speed; of another as if nothing
    rubbed and what turns rested.

    Returns
    -------
    factors : ndarray, shape (count,) or fewer
    modes : ndarray, shape (free, factors)
    """
    free = len(state.plan.supports.free)
    if (matrices := buckling_matrices(state)) is None:
        return np.zeros(0), np.zeros((free, 0))
    factors, modes = buckling_modes(*matrices, solver or SparseSolver(), count, tolerance)
    return factors, np.pad(modes, ((0, free - len(modes)), (0, 0)))


def mode_heights(state: State, mode: Array) -> Array:
    """A change of a state, along its normals, as heights of the flat strip; 1 m the largest.

    Parameters
    ----------
    mode : ndarray, shape (free,)

    Returns
    -------
    ndarray, shape (unknowns,)
        Upwards where the height is largest.
    """
    strip, change = state.plan.model.strip, state.plan.supports.change(mode, 0.0)
    operator = CellOperator(strip, (0, 1))
    tangents = operator.apply(state.full)[:, 1:] + strip.kinematics.flat
    normal = normal_vector(tangents)
    normal /= np.linalg.norm(normal, axis=0)
    height = np.einsum("ip,ip->p", normal, operator.apply(change)[:, 0])
    lifted = np.zeros((3, len(height)))
    lifted[2] = height / height[np.abs(height).argmax()]
    return l2_projection(strip, state.plan.model.pattern, lifted)


@dataclass(frozen=True)
class Onset:
    """A state of a path in which a shell is about to wrinkle, or in which the path bifurcates.

    Attributes
    ----------
    state : State
    heights : ndarray, shape (unknowns,)
        The mode, at a bifurcation the tangent's null vector, as heights of the flat strip; 1 m the
        largest.
    kind : str
        "wrinkles", "bifurcation" or "waves".
    number : int
        Of the mode, the lowest factor being that of 0.
    beside : tuple of State and float, or None
        A state nearby on the branch, and the factor of the mode there, if known; a watch finds it
        of the first wrinkles and of the first bifurcation.
    """

    state: State
    heights: Array
    kind: str
    number: int = 0
    beside: tuple[State, float] | None = None

    @property
    def level(self) -> float:
        """Factor of the mode in this state."""
        return next(level for level, kind in DATED_FACTORS.items() if kind == self.kind)

    def is_beside(self, other: Onset) -> bool:
        """Whether another onset is so near that a finer mesh has both in one state."""
        here, there = self.state, other.state
        return here.plan is there.plan and abs(here.control - there.control) <= SAME_ONSET

    def loads_by(self, factor: float) -> dict[str, float]:
        """Return at which loads it is if the factor of its mode, in this state, is another.

        As on another mesh; by the rate at which what compresses, over what is borne, grows here.
        """
        assert self.beside is not None
        state, beside = self.beside
        here, there = loads(self.state), loads(state)
        share = (1.0 - self.level / factor) / (self.level / beside - 1.0)
        return {key: float(here[key] + share * (there[key] - here[key])) for key in here}

    @property
    def wavelengths(self) -> tuple[float, float]:
        """Mean wavelengths along and across (m): 2π of the root of ∫ w² over ∫ w,x² or ∫ w,y²."""
        operator = CellOperator(self.state.plan.model.strip, (0, 1))
        height, *slopes = operator.apply(self.heights)[2] ** 2 @ operator.weights
        along, across = (2.0 * np.pi * float(np.sqrt(height / slope)) for slope in slopes)
        return along, across

    @property
    def highest(self) -> int:
        """Number of the node where the mode is highest."""
        strip = self.state.plan.model.strip
        return int(np.abs(strip.nodal(self.heights)[strip.node_values, 2]).argmax())

    @cached_property
    def span(self) -> tuple[str, str] | None:
        """Names of what is before and behind the free span in which the mode is highest."""
        x = self.state.plan.model.strip.nodes[0, self.highest]
        spans = (s for s in free_spans(self.state) if s.start <= x <= s.end)
        return next(((s.before, s.after) for s in spans), None)

    @property
    def facts(self) -> dict[str, Any]:
        """Entries of ``summary.json``."""
        along, across = self.wavelengths
        state, strip = self.state, self.state.plan.model.strip
        x, y = strip.nodes[:2, self.highest] + strip.flat_origin
        return {
            "kind": self.kind,
            "stage": state.plan.name,
            **loads(state),
            "x": float(x),
            "y": float(y),
            "span": self.span and list(self.span),
            "wavelength_along": along,
            "wavelength": across,
        }


def loads(state: State) -> dict[str, float]:
    """Return what says how far a path has come: time, tensions, of uneven strip its flatness."""
    tensions = {f"{name}_tension": state.tension(name) for name in ("entry", "exit")}
    flatness = Wrinkling(state).flatness
    own = {key: flatness[key] for key in ("latent_flatness",) if key in flatness}
    return {"time": state.time, **tensions, **own}


def bracket(
    change: Callable[[float], float], length: float, known: Iterable[float] = ()
) -> tuple[float, float]:
    """Return the places on a branch, of its ends and of known ones, between which a sign changes.

    The first ones; the ends of the branch if it begins with zero.
    """
    places = sorted({0.0, length, *known})
    signs = [change(a) > 0.0 for a in places]
    pairs = zip(pairwise(places), pairwise(signs), strict=True)
    return next((pair for pair, (before, after) in pairs if before != after), (0.0, length))


def dated(change: Callable[[float], float], ends: tuple[float, float], length: float) -> float:
    """Return where on a branch something changes its sign, to :data:`ONSET_TOLERANCE` of it."""
    from scipy.optimize import brentq

    return float(brentq(change, *ends, xtol=ONSET_TOLERANCE**2 * length, rtol=ONSET_TOLERANCE))


class BranchModes:
    """Factors and modes on the branch that ends in a state.

    Parameters
    ----------
    state : State
    find : callable
        From a state to its factors and modes.

    Attributes
    ----------
    known : dict
        Place → factors and modes, where these were found.
    """

    def __init__(self, state: State, find: Callable[[State], tuple[Array, Array]]) -> None:
        assert state.branch is not None
        self.state, self.find, self.length = state, find, state.branch.length
        self.known: dict[float, tuple[Array, Array]] = {}

    def at(self, a: float) -> tuple[Array, Array]:
        """Return factors and modes at a place."""
        if a not in self.known:
            self.known[a] = self.find(self.state.inside(a))
        return self.known[a]

    def among(self, a: float, ends: tuple[float, float]) -> Array:
        """Return factors at a place by Galerkin's method among the modes at two known ones.

        Nothing is factorised.  They are exact at both, and between as wrong as is the square of
        what modes change by where K is symmetric.
        """
        if a in self.known:
            return self.known[a][0]
        if (matrices := buckling_matrices(self.state.inside(a))) is None:
            return np.zeros(0)
        tangent, compressive = matrices
        basis = orth(np.hstack([self.known[end][1] for end in ends])[: tangent.shape[0]])
        pressing = basis.T @ (compressive @ basis)
        values = eigvals(pressing, basis.T @ (tangent @ basis) + pressing)
        real = np.abs(values.imag) <= EIGENVALUE_TOLERANCE * np.abs(values)
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.sort(values[real].real)[::-1])

    def dated(self, number: int, level: float) -> tuple[float, float] | None:
        """Return where a factor passes a level, and a place within its tolerance that is known.

        Where it does among the modes at two places, these are looked for; then among them and those
        on the other side.  None if it is on the same side of the level at both ends of the branch,
        as where modes are missed at one.
        """

        def excess(factors: Array) -> float:
            return level / float(factors[number]) - 1.0 if number < len(factors) else -1.0

        def here(a: float) -> float:
            return excess(self.at(a)[0])

        if here(0.0) * here(self.length) > 0.0:
            return None
        for _ in range(MAX_GALERKIN):
            ends = bracket(here, self.length, self.known)
            a = dated(lambda a: excess(self.among(a, ends)), ends, self.length)  # noqa: B023
            if a in ends:
                return a, a
            left, room = here(a), ONSET_TOLERANCE * (a + ONSET_TOLERANCE * self.length)
            ahead = (left > 0.0) == (here(ends[0]) > 0.0)
            other = ends[1] if ahead else ends[0]
            beyond = min(a + room, other) if ahead else max(a - room, other)
            there = excess(self.among(beyond, (a, other)))
            if (there > 0.0) != (left > 0.0):
                return a + (beyond - a) * left / (left - there), a
        a = dated(here, bracket(here, self.length, self.known), self.length)
        return a, a


def pressed_shares(state: State) -> dict[tuple[str, str], float]:
    """Return the compression of every free span over what it bears, by what is at its ends."""
    return {(s.before, s.after): s.compression / s.bearable for s in free_spans(state)}


def waves_on(state: State, modes: Callable[[float], Array]) -> Iterator[tuple[float, Onset]]:
    """Places on the branch that ends in a state where waves of a free span become high.

    Parameters
    ----------
    state : State
    modes : callable
        Modes at a place, in columns, ascending by their factors.
    """
    assert state.branch is not None
    strip, length = state.plan.model.strip, state.branch.length
    least, begins = WAVE_HEIGHT * strip.thickness, strip.flat_origin[0]
    heights = cache(lambda a: Wrinkling(state.inside(a)).amplitudes() or [])
    begin, end = heights(0.0), heights(length)
    for number, low in enumerate(begin if len(begin) == len(end) else []):  # none has joined
        if low < least < end[number]:

            def higher(a: float, number: int = number) -> float:
                found = heights(a)[number : number + 1]
                return found[0] / least - 1.0 if found else -1.0

            a = dated(higher, (0.0, length), length)
            here = state.inside(a)
            for span in Wrinkling(here).spans[number : number + 1]:
                onsets = (Onset(here, mode_heights(here, mode), WAVES) for mode in modes(a).T)
                inside = (o for o in onsets if span.start <= o.facts["x"] - begins <= span.end)
                yield from ((a, onset) for onset in islice(inside, 1))


class WrinkleWatch:
    """Onsets of wrinkles on rate-free paths of shells, found step after step.

    Parameters
    ----------
    cost : Cost
        Counters to which the factorisations are added.

    Attributes
    ----------
    factors : ndarray
        Of the last state, ascending, if it was looked at; those of nothing else are near 1.
    lowest : float
        Lowest factor, where it was looked at last.
    shares : dict
        Compression of the spans over what they bear, there.
    looked : tuple of State, ndarray and ndarray, or None
        The last state of this stage whose tracked modes were looked for, with these.
    dated : set of str
        Kinds of onsets found so far.
    missed : int
        States in which the modes were not found.
    """

    def __init__(self, cost: Cost) -> None:
        self.cost, self.solver = cost, SparseSolver()
        self.plan: StageProblem | None = None
        self.factors, self.lowest, self.missed = np.zeros(0), 0.0, 0
        self.shares: dict[tuple[str, str], float] = {}
        self.looked: tuple[State, Array, Array] | None = None
        self.dated = set[str]()

    def growth(self, shares: dict[tuple[str, str], float]) -> float:
        """Return how many times what presses any span grew since it was looked at; 0 if none is."""
        pressed = {span: share for span, share in shares.items() if share >= COLUMN_SHARE}
        grown = (share / max(self.shares.get(span, 0.0), 1e-9) for span, share in pressed.items())
        return max(grown, default=0.0)

    def borne(self, state: State) -> dict[tuple[str, str] | None, float]:
        """Return how many times its compression every span bears, by the modes that are known.

        By what is before and behind the span in which a mode is highest; None for no free span.
        """
        if self.plan is not state.plan or not self.growth(pressed_shares(state)):
            return {}
        if self.looked is None or self.looked[0] is not state:
            self.looked = state, *self._modes(state)
        _, factors, modes = self.looked
        found: dict[tuple[str, str] | None, float] = {}
        for factor, mode in zip(factors, modes.T, strict=True):
            found.setdefault(Onset(state, mode_heights(state, mode), WAVES).span, float(factor))
        return found

    def during(self, state: State) -> list[Onset]:
        """Return the onsets on the branch that ends in a state, in their order.

        Nothing is looked at where no span is pressed and no mode was near its onset, where the
        path has no branch or strip flows along it, and while factors that fall as compression
        grows stay far from 1; at the lowest mode alone while it is far.
        """
        if state.plasticity is not None and state.plasticity.operator.flows:
            return []
        shares = pressed_shares(state)
        if self.plan is not state.plan:
            self.plan, self.factors, self.lowest, self.shares = state.plan, np.zeros(0), 0.0, {}
            self.looked = None
        near = bool((self.factors < FAR_FROM_BUCKLING).any())
        grown = self.growth(shares)
        far = not grown or self.lowest > PROPORTION_MARGIN * FAR_FROM_BUCKLING * grown
        if state.branch is None or (far and not near):
            self.factors = np.zeros(0)
            return []
        branch, length = BranchModes(state, self._modes), state.branch.length
        if self.looked is not None and np.array_equal(self.looked[0].full, state.inside(0.0).full):
            branch.known[0.0] = self.looked[1:]
        if not near:
            lowest = self._modes(state.inside(length), 1, ROUGH_TOLERANCE)[0]
            if (lowest > FAR_FROM_BUCKLING).any():
                self.factors, self.lowest, self.shares = lowest, float(lowest[0]), shares
                return []
        ahead = branch.at(length)[0]
        looked = len(self.factors) or not (ahead < FAR_FROM_BUCKLING).any()
        before = self.factors if looked else branch.at(0.0)[0]
        self.factors = ahead
        self.lowest, self.shares = float(ahead.min(initial=np.inf)), shares
        self.looked = state, *branch.at(length)
        found = []
        for level, kind in DATED_FACTORS.items():
            counts = [int((factors < level).sum()) for factors in (before, self.factors)]
            for number in range(*(sorted(counts) if kind == BIFURCATION else counts)):
                if (places := branch.dated(number, level)) is None:
                    continue
                a, known = places
                factors, modes = branch.at(known)
                distance = np.abs(factors - level)
                if distance.min(initial=np.inf) < FACTOR_TOLERANCE:  # no birth of a complex pair
                    nearest, here = int(distance.argmin()), state.inside(a)
                    heights = mode_heights(here, modes[:, nearest])
                    found.append((a, Onset(here, heights, kind, nearest)))
        if ONSET_FACTOR < min(f.min(initial=np.inf) for f in (before, ahead)) < FAR_FROM_BUCKLING:
            found += waves_on(state, lambda a: branch.at(a)[1])
        found.sort(key=lambda each: each[0])
        return [self._with_rate(branch, a, onset) for a, onset in found]

    def _with_rate(self, branch: BranchModes, a: float, onset: Onset) -> Onset:
        """Return an onset with the factor of its mode nearby, if it is the first of its kind."""
        if onset.kind in {WAVES, *self.dated}:
            return onset
        self.dated.add(onset.kind)
        aside = a + RATE_SHARE * branch.length * (1.0 if a < 0.5 * branch.length else -1.0)
        others = branch.at(aside)[0]
        if onset.number >= len(others):
            return onset
        return replace(onset, beside=(branch.state.inside(aside), float(others[onset.number])))

    def _modes(
        self, state: State, count: int = TRACKED_MODES, tolerance: float = EIGENVALUE_TOLERANCE
    ) -> tuple[Array, Array]:
        """Return factors and modes; none where K + G is singular or ARPACK gives up."""
        self.cost.factorisations += 1
        try:
            with self.cost.timed("wrinkles"):
                return buckling(state, count, self.solver, tolerance)
        except (SingularTangentError, ArpackError):
            self.missed += 1
            return np.zeros(0), np.zeros((0, 0))

    @property
    def warnings(self) -> list[str]:
        """Sentence about the states in which there were no modes to be found."""
        if not self.missed:
            return []
        return [
            f"Buckling modes were not found in {self.missed} states, as in strip without tension: "
            "wrinkles that begin there are not reported."
        ]
