"""Rollers that a step would pass through: what neither of its ends shows.

A step is accepted on the balance of forces at its end.  Where contact is felt only next to a
surface, a strip may cross a whole roller within one step and be in balance on its other side.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .contact import Contact

Array = NDArray[np.float64]

CHORD = 0.25
"""Longest way of a point between two looks, in radii; it is taken as straight in between."""

MOST = 1024
"""Looks at one step."""


def deepest(contact: Contact, places: Callable[[Array], Array]) -> float | None:
    """Where on its way a point lies deeper than at either end, by more than the onset.

    Parameters
    ----------
    contact : Contact
    places : callable
        Shares of the way, shape (m,), to positions in the rollers' frames, (m, rows, points).

    Returns
    -------
    float or None
        Share of the way at which the deepest of them is.
    """
    shares = np.linspace(0.0, 1.0, 3)
    y = places(shares)
    while (more := _chords(contact, y)) > 1.0 and len(shares) < MOST:
        shares = np.linspace(0.0, 1.0, min(int(np.ceil(more * (len(shares) - 1))), MOST) + 1)
        y = places(shares)
    nearest = _nearest(y)
    first, last, *between = _gaps(contact, y, nearest)
    dip = np.minimum(first, last) - between
    if not dip.max() > contact.signorini.width:
        return None
    j, point = np.unravel_index(dip.argmax(), dip.shape)
    return float(shares[j] + nearest[j, point] * (shares[j + 1] - shares[j]))


def _gaps(contact: Contact, y: Array, nearest: Array) -> Array:
    """Gaps at both ends, and where each piece is nearest to the axis, (2 + pieces, points)."""
    between = y[:-1] + nearest[:, None] * np.diff(y, axis=0)
    looks = np.concatenate([y[[0, -1]], between]).swapaxes(0, 1)
    with np.errstate(invalid="ignore"):  # on the axis there is no direction
        return np.asarray(contact.roller.seen(looks).gap)


def _chords(contact: Contact, y: Array) -> float:
    """Longest way between two looks, over what it may be."""
    moved = np.sqrt((np.diff(y, axis=0) ** 2).sum(axis=1))
    return float((moved / contact.roller.radius).max(initial=0.0)) / CHORD


def _nearest(y: Array) -> Array:
    """Share of every piece of the way at which each point is nearest to the axis."""
    step = np.diff(y[:, :2], axis=0)
    square = np.maximum((step**2).sum(axis=1), np.finfo(float).tiny)
    return np.asarray(np.clip(-(y[:-1, :2] * step).sum(axis=1) / square, 0.0, 1.0))
