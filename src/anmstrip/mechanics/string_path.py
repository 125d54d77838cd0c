"""The path of a taut string round circles in a plane: where a threaded strip lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anmstrip.arrays import Array

Mask = NDArray[np.bool_]

TURN_ROUND_OFF = 1e-7
"""Turns (rad) above −TURN_ROUND_OFF count as zero: the root of the rounding of a length."""

LENGTH_SAMPLES = 64
"""Places to a boundary layer at which the length of bent strip is summed up."""

LARGEST_TURN = 1.75 * np.pi
"""Turns (rad) beyond this are read as negative ones."""


class NoTangentError(ValueError):
    """Neighbours overlap, so that run `index`, the one before circle `index`, is missing."""

    def __init__(self, index: int) -> None:
        self.index = index
        super().__init__(
            f"No straight run leads to circle {index} (behind the last circle: to the exit) "
            "from what is before it, as the two overlap. Move them apart."
        )


class NotTouchedError(ValueError):
    """A taut strip does not touch circle `index`: its `turn` (rad) would be negative.

    Of several circles the one with the most negative turn is named, because a
    circle out of reach also lifts the path off its neighbours.
    """

    def __init__(self, index: int, turn: float) -> None:
        self.index, self.turn = index, turn
        super().__init__(
            f"The strip does not touch circle {index}: it would have to turn by "
            f"{np.degrees(turn):.3g} degrees there, or cross itself. Pass the circle on its "
            "other side, move it towards the strip, or leave it out."
        )


@dataclass(frozen=True)
class FixedEnd:
    """An end at a given position x, z (m), shape (2,) or (2, fibres)."""

    position: ArrayLike

    def place(self, centre: Array, rho: Array, way: int) -> Array:
        """The end, shape (2, 1) or (2, fibres), whatever its neighbour is."""
        return np.asarray(self.position, dtype=float).reshape(2, -1)


@dataclass(frozen=True)
class StraightEnd:
    """An end whose heading and straight run are given, not its place."""

    length: ArrayLike  # L > 0 (m), to the first or last circle, shape () or (fibres,)
    angle: float = 0.0  # heading t (rad); 0 along +x

    def place(self, centre: Array, rho: Array, way: int) -> Array:
        """c + ρ n ± L u, shape (2, fibres): way −1 behind the circle, +1 ahead of it."""
        u, n = frame(np.array([self.angle]))
        return centre + rho * n + way * np.asarray(self.length, dtype=float) * u


End = FixedEnd | StraightEnd


NEGLIGIBLE_WEIGHT = 1e-6
"""Weight of a run over its tension, below which it is straight."""

DEEP_CATENARY = 2.4
"""Chord over H/w of the catenary whose ends are pulled least, between level ends: 2 · 1.1997."""


def catenary(run: Array, weight: float, pull: float) -> tuple[float, float, float]:
    """Length of a catenary beyond its chord (m), and its angles to this at start and end (rad).

    With a = H/w it is as long as √(h² + (2 a sinh(L/2a))²), and slopes by sinh(x/a) at x from its
    lowest point.  All are 0 of an upright or light run, or where no catenary is pulled so little.

    Parameters
    ----------
    run : ndarray, shape (2,)
        Chord from start to end (m), across and upwards.
    weight : float
        N/m per length.
    pull : float
        At the end (N/m).

    Examples
    --------
    >>> [round(float(x), 5) for x in catenary(np.array([30.0, 0.0]), 38.5, 2600.0)]
    [0.26039, 0.22596, 0.22596]
    """
    across, rise = abs(float(run[0])), float(run[1])
    angle = _inclination(run)

    def missing(a: float) -> float:
        return weight * a * float(np.hypot(1.0, _shape(run, a)[2])) - pull

    if not NEGLIGIBLE_WEIGHT * pull < weight * across or missing(across / DEEP_CATENARY) >= 0.0:
        return 0.0, 0.0, 0.0
    from scipy.optimize import brentq

    length, first, last = _shape(run, brentq(missing, across / DEEP_CATENARY, pull / weight))
    longer = length - float(np.hypot(across, rise))
    return longer, float(angle - np.arctan(first)), float(np.arctan(last) - angle)


def least_pull(run: Array, weight: float) -> float:
    """Return the tension at its end below which no catenary hangs (N/m), 0.75 w l of a level run.

    The arguments are those of :func:`catenary`.

    Examples
    --------
    >>> round(least_pull(np.array([4.0, 0.0]), 38.5), 1)
    116.2
    """
    a = abs(float(run[0])) / DEEP_CATENARY
    return weight * a * float(np.hypot(1.0, _shape(run, a)[2])) if a else 0.0


def _shape(run: Array, a: float) -> tuple[float, float, float]:
    """Return the length of a catenary of the parameter a (m), and its slopes at start and end."""
    across, rise = abs(float(run[0])), float(run[1])
    length = float(np.hypot(rise, 2.0 * a * np.sinh(0.5 * across / a)))
    low = 0.5 * across - a * np.arctanh(rise / length)
    return length, -float(np.sinh(low / a)), float(np.sinh((across - low) / a))


def supported_catenary(
    start: Array, end: Array, weight: float, pull: float, supports: Array
) -> tuple[float, float, float]:
    """Return what :func:`catenary` does, of a run that hangs over supports under it.

    It lies on the support that is farthest above the run without it (a parabola with the slopes of
    the catenary), and hangs on both sides of that.

    Parameters
    ----------
    start, end : ndarray, shape (2,)
        x and z (m).
    weight, pull : float
        N/m per length, and at the end (N/m).
    supports : ndarray, shape (2, n)
        x and z (m); those above the chord are none.

    Examples
    --------
    >>> ends = np.array([[0.0, 0.0], [21.0, 0.0]])
    >>> tops = np.array([[3.0, 6.0, 9.0, 12.0, 15.0, 18.0], [0.0] * 6])
    >>> [round(float(x), 5) for x in supported_catenary(*ends, 77.0, 3000.0, tops)]
    [0.0052, 0.03852, 0.03852]
    """
    longer, first, last = catenary(end - start, weight, pull)
    angle, across = _inclination(end - start), end[0] - start[0]
    if not NEGLIGIBLE_WEIGHT * pull < weight * abs(across):
        return longer, first, last
    way = (supports[0] - start[0]) / across
    chord = start[1] + way * (end[1] - start[1])
    under = (way > 0.0) & (way < 1.0) & (supports[1] <= chord)
    if longer > 0.0:
        begin, stop = np.tan(angle - first), np.tan(angle + last)
        hung = start[1] + abs(across) * (begin * way + 0.5 * (stop - begin) * way**2)
    else:  # no catenary is pulled so little, and it lies on what is near its middle
        hung = supports[1] - way * (1.0 - way)
    lifted = np.where(under, supports[1] - hung, 0.0)
    if not lifted.max(initial=0.0) > 0.0:
        return longer, first, last
    top = supports[:, int(lifted.argmax())]
    before = supported_catenary(start, top, weight, pull - weight * (end[1] - top[1]), supports)
    behind = supported_catenary(top, end, weight, pull, supports)
    ways = [float(np.linalg.norm(way)) for way in (top - start, end - top, end - start)]
    return (
        before[0] + behind[0] + ways[0] + ways[1] - ways[2],
        before[1] + angle - _inclination(top - start),
        behind[2] + _inclination(end - top) - angle,
    )


def _inclination(run: Array) -> float:
    """Return the angle (rad) by which a run rises in its own direction."""
    return float(np.arctan2(run[1], abs(run[0])))


class Arcs(NamedTuple):
    """Contact of the path with the circles; each of shape (circles, fibres).

    `start` and `end` are arc lengths (m), `turn` is the angle of wrap (rad), ≥ 0.
    """

    start: Array
    end: Array
    turn: Array


@dataclass(frozen=True, eq=False)
class StringPath:
    """Straight run, arc, straight run, ..., straight run: 2 circles + 1 pieces."""

    starts: Array  # arc lengths at the joints, 0 to the whole length (m), (pieces + 1, fibres)
    points: Array  # starts of the pieces (m), (2, pieces, fibres)
    angles: Array  # headings t there (rad), up to full turns, (pieces, fibres)
    curvatures: Array  # κ = dt/ds (1/m), −1/ρ on arcs, 0 on straight runs, (pieces, fibres)

    @property
    def length(self) -> Array:
        """Whole length (m), shape (fibres,)."""
        return self.starts[-1]

    @property
    def arcs(self) -> Arcs:
        """Contact with the circles."""
        start, end = self.starts[1:-1:2], self.starts[2::2]
        return Arcs(start, end, np.abs(self.curvatures[1::2]) * (end - start))

    def pieces_at(self, s: Array, fibre: NDArray[Any]) -> NDArray[np.int_]:
        """Numbers of the pieces at arc lengths (m) of fibres, shape (...) of both."""
        found = np.empty(s.shape, dtype=int)
        for k in range(self.starts.shape[1]):
            chosen = fibre == k
            found[chosen] = np.searchsorted(self.starts[1:-1, k], s[chosen], side="right")
        return found

    def at(self, s: ArrayLike, fibre: ArrayLike) -> tuple[Array, Array]:
        """Position and direction at arc lengths s; beyond the ends straight on.

        From the start p of a piece, where t is its heading and σ = s − s_start:
        p + σ sinc(κσ/2) u(t + κσ/2) and u(t + κσ), for arcs and straight runs alike.

        Parameters
        ----------
        s, fibre : array_like of float (m) and of int
            Any shapes (...) that broadcast.

        Returns
        -------
        position (m), direction : arrays, shape (2, ...)
        """
        s, fibre = np.broadcast_arrays(np.asarray(s, dtype=float), fibre)
        piece = self.pieces_at(s, fibre)
        sigma = s - self.starts[piece, fibre]
        t, half = self.angles[piece, fibre], 0.5 * self.curvatures[piece, fibre] * sigma
        chord = sigma * np.sinc(half / np.pi) * frame(t + half)[0]
        return self.points[:, piece, fibre] + chord, frame(t + 2.0 * half)[0]

    def passing(self, point: Array, samples: int) -> tuple[float, float]:
        """Arc length (m) at which the first fibre is nearest to a point, and its sense round it.

        Parameters
        ----------
        point : ndarray, shape (2,)
            (x, z) (m).
        samples : int
            Number of places that are looked at, evenly along the path.

        Returns
        -------
        s : float
        sense : float
            +1 if it passes over the point or leaves it on its right, else −1.
        """
        s = np.linspace(0.0, float(self.length[0]), samples)
        position, heading = self.at(s, 0)
        way = point[:, None] - position
        i = int((way**2).sum(axis=0).argmin())
        right = heading[1, i] * way[0, i] - heading[0, i] * way[1, i]
        return float(s[i]), 1.0 if right >= 0.0 else -1.0

    def stiff(self, s: Array, fibre: NDArray[Any], layer: float, heights: Array) -> Array:
        """Places of a strip that bends from this path onto circles inside, at its arc lengths s.

        Along a run the strip comes to the path like e^(−x/ℓ), ℓ = √(D/T).  It lies on a circle
        smaller by a/2, a = ℓ²/R, which it leaves at the distance ℓ before the path leaves its own:
        there its curvature is 1/R.

        Parameters
        ----------
        s, fibre : ndarray of float (m) and of int, shape (points,)
        layer : float
            ℓ (m); arcs with a height are 2 ℓ long at least, runs beside them some.
        heights : ndarray, shape (circles,)
            a (m) on the left of the path, 0 where the strip stays on it.

        Returns
        -------
        ndarray, shape (2, points)
        """
        ends, count = np.full_like(self.starts[:1], np.inf), self.starts.shape[1]
        joints = np.concatenate([-ends, self.starts[1:-1], ends])
        signed = np.pad(np.repeat(heights, 2), 1)

        def moved(s: Array, fibre: NDArray[Any]) -> tuple[Array, NDArray[np.int_]]:
            """Distance to the left of the path (m), and the path's piece."""
            piece = self.pieces_at(s, fibre)
            arc, left = piece % 2, np.zeros_like(s)
            run = np.diff(self.starts, axis=0)[piece, fibre] / layer
            for joint in (piece, piece + 1):
                x = np.minimum(np.abs(s - joints[joint, fibre]) / layer, np.where(arc, 1.0, run))
                lying = 0.5 + 0.5 * x * x - np.exp(np.minimum(x, 1.0) - 1.0)
                ahead = x / run * np.exp(-1.0 - run) - np.exp(-1.0 - x)  # 0 at the next circle
                left += signed[joint] * np.where(arc, lying, ahead)
            return left - 0.5 * arc * signed[piece], piece

        numbers = np.arange(-LENGTH_SAMPLES, 12 * LENGTH_SAMPLES + 1)[:, None, None]
        steps = layer * numbers / LENGTH_SAMPLES
        outward = np.where(np.arange(len(joints) - 2) % 2, 1.0, -1.0)[:, None]
        near = (self.starts[1:-1] + steps * outward).reshape(-1, count)
        nodes = np.sort(np.vstack([self.starts, np.clip(near, 0.0, self.length)]), axis=0)
        on = np.empty_like(s)
        for k in range(count):
            at, which = nodes[:, k], np.full(len(nodes), k)
            middle, piece = moved(0.5 * (at[1:] + at[:-1]), which[1:])
            turned = (1.0 - self.curvatures[piece, k] * middle) * np.diff(at)
            length = np.hypot(turned, np.diff(moved(at, which)[0]))
            chosen = fibre == k
            on[chosen] = np.interp(s[chosen], np.append(0.0, np.cumsum(length)), at)
        position, (along, up) = self.at(on, fibre)
        return position + moved(on, fibre)[0] * np.stack([-up, along])


def string_path(
    centres: ArrayLike,
    radii: ArrayLike,
    senses: ArrayLike,
    entry: End,
    exit: End,
    crossing: ArrayLike = False,
) -> StringPath:
    """Taut path from the entry round the circles, in their order, to the exit.

    Parameters
    ----------
    centres : array_like, shape (circles, 2, fibres)
        c (m). Any array may have one fibre where others have more.
    radii : array_like, shape (circles, fibres)
        r > 0 (m).
    senses : array_like, shape (circles,)
        s: +1 over, −1 under.
    entry, exit : FixedEnd or StraightEnd
        With no circles both have to be a FixedEnd.
    crossing : array_like of bool, shape (circles,), optional
        Where the string may cross itself, so that all turns up to a full one are wraps.

    Raises
    ------
    NoTangentError
        If neighbours overlap.
    NotTouchedError
        If a circle lies beside the path of any fibre.

    Examples
    --------
    >>> ends = StraightEnd(2.0), StraightEnd(3.0, -np.pi / 2)
    >>> path = string_path([[[0.0], [-1.0]]], [[1.0]], [1], *ends)
    >>> path.length - np.pi / 2, np.degrees(path.arcs.turn[0])
    (array([5.]), array([90.]))
    >>> path.at([0.0, 2.0], 0)[0]
    array([[-2.,  0.],
           [ 0.,  0.]])
    """
    c, r, s = (np.asarray(given, dtype=float) for given in (centres, radii, senses))
    if not np.all(r > 0.0):
        raise ValueError("Radii have to be positive; over and under are told by the senses.")
    c, rho = c.swapaxes(0, 1), r * s[:, None]

    # the ends as circles of radius 0
    zero = np.zeros(1)
    if len(r):
        first, last = entry.place(c[:, 0], rho[0], -1), exit.place(c[:, -1], rho[-1], +1)
    else:
        first, last = entry.place(zero, zero, -1), exit.place(zero, zero, +1)
    fibres = np.broadcast_shapes(*(x.shape[-1:] for x in (c, rho, first, last)))
    c, first, last = (np.broadcast_to(x, x.shape[:-1] + fibres) for x in (c, first, last))
    c = np.concatenate([first[:, None], c, last[:, None]], axis=1)
    rho = np.pad(np.broadcast_to(rho, rho.shape[:1] + fibres), ((1, 1), (0, 0)))

    t, runs, leaving, arriving = straight_runs(c, rho)
    turns = wrap_angles(t, runs, rho[1:-1], np.broadcast_to(crossing, len(r)))
    arcs = np.abs(rho[1:-1]) * turns
    alternating = np.arange(1, len(arcs) + 1)  # arcs between runs
    lengths = np.insert(runs, alternating, arcs, axis=0)
    return StringPath(
        starts=np.concatenate([np.zeros_like(runs[:1]), np.cumsum(lengths, axis=0)]),
        points=np.insert(leaving, alternating, arriving[:, :-1], axis=1),
        angles=np.insert(t, alternating, t[:-1], axis=0),
        curvatures=np.insert(np.zeros_like(t), alternating, -1.0 / rho[1:-1], axis=0),
    )


def straight_runs(c: Array, rho: Array) -> tuple[Array, Array, Array, Array]:
    """Return the headings of the runs between circles, their lengths, and where they begin and end.

    Both feet c + ρ n of a run lie on one line, with d = c' − c, d·n = ρ − ρ' and d·u = L.

    Parameters
    ----------
    c : ndarray, shape (2, circles, fibres)
        Centres (m), one behind the other.
    rho : ndarray, shape (circles, fibres)
        Radii (m), below 0 of circles that the string passes under.
    """
    d, across = np.diff(c, axis=1), -np.diff(rho, axis=0)
    distance2 = np.sum(d**2, axis=0)
    wrong = (across**2 > distance2 * (1.0 + 1e-12)) | (distance2 == 0.0)
    if np.any(wrong):
        raise NoTangentError(int(np.argmax(wrong.any(axis=1))))
    runs = np.sqrt(np.maximum(distance2 - across**2, 0.0))
    t = np.arctan2(d[1], d[0]) - np.arctan2(across, runs)
    n = frame(t)[1]
    return t, runs, c[:, :-1] + rho[:-1] * n, c[:, 1:] + rho[1:] * n


def closing_point(centres: ArrayLike, radii: ArrayLike, senses: ArrayLike) -> Array:
    """Middle of the straight run of a closed path from the last circle to the first, shape (2,).

    Parameters
    ----------
    centres : array_like, shape (circles, 2)
    radii, senses : array_like, shape (circles,)
        As for :func:`string_path`.

    Raises
    ------
    NoTangentError
        If the two overlap.

    Examples
    --------
    >>> closing_point([[0.0, 0.0], [3.0, 0.0]], [1.0, 1.0], [1, 1])
    array([ 1.5, -1. ])
    """
    c, rho = np.array(centres, dtype=float)[[-1, 0]].T, np.multiply(radii, senses)[[-1, 0]]
    _, _, leaving, arriving = straight_runs(c[..., None], rho[:, None])
    return np.asarray(0.5 * (leaving + arriving)[:, 0, 0])


def wrap_angles(t: Array, runs: Array, rho: Array, crossing: Mask) -> Array:
    """Angles of wrap s (t_in − t_out) from headings, shape (circles, fibres), ≥ 0.

    A turn in [0, 2π) may stand for the negative turn − 2π of a circle that is not touched.  The
    lines on which the strip comes and goes meet, if the turn is above π, at r tan(π − turn/2)
    behind the first and ahead of the second point of contact.  A strip cannot pass through
    itself, so one of the two runs has to end before that.  This tells a lifted roller from a
    bridle at any angle; very short runs tell nothing and leave the decision to LARGEST_TURN.
    A strip that may cross itself, in a helix around the roller, is believed to be wrapped.
    """
    turn = np.mod(-np.sign(rho) * np.diff(t, axis=0) + TURN_ROUND_OFF, 2.0 * np.pi) - TURN_ROUND_OFF
    meeting = np.abs(rho) * np.tan(np.pi - 0.5 * turn)
    shorter = np.minimum(runs[:-1], runs[1:])
    untouched = (turn > LARGEST_TURN) | ((turn > np.pi) & (meeting < shorter))
    untouched &= ~crossing[:, None]
    if np.any(untouched):
        missing = np.where(untouched, 2.0 * np.pi - turn, 0.0).max(axis=1)
        raise NotTouchedError(int(np.argmax(missing)), -float(np.max(missing)))
    return np.maximum(turn, 0.0)


def frame(t: Array) -> tuple[Array, Array]:
    """Directions u and normals n of headings t, each of shape (2, ...)."""
    cos, sin = np.cos(t), np.sin(t)
    return np.stack([cos, sin]), np.stack([-sin, cos])
