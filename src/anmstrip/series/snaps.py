"""Snaps: where no velocity balances the forces, the state goes elsewhere at once.

A quasi-static problem with friction may lose its solution: a bounded law carries no more at any
velocity, and a power law asks for velocities beyond any step of time.  What then happens is told
by the limit of a vanishing drag: −c v is added until the state rests again, with c such that it
takes some parts in a million of the whole time.  All that is a single step, marked as a snap.

Source: Martins, Monteiro Marques & Gastaldi, *On an example of nonexistence of solution to a
quasistatic frictional contact problem*, Eur. J. Mech. A 13 (1994), for the limit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from .backward_differences import Memory

if TYPE_CHECKING:
    from .implicit_dae import TimeStep

LASTING = (1e-6, 1e-4)
"""Times in which forces overcome the drag of motions as large as the problem, over the whole: the
second for snaps of single points of a stiff strip, which the first does not slow down."""

CALM, RAN = 1e-2, 3.0
"""A state rests again where its velocity changes by less than the first of these parts of its way
in this time, and has run away if its way is so many times what it is at the speed of the end."""

SOON = 1e4
"""When the state must have run away, in units of this time: otherwise no drag was missing."""

FIRST = 1e-4
"""First step, in units of this time."""

MOST = 400
"""Steps of a snap."""


def snapped(
    stepped: Callable[[Memory], TimeStep], memory: Memory, lasting: float
) -> TimeStep | None:
    """Steps with drag until the state rests, as one; None if it does not run away or not rest.

    Parameters
    ----------
    stepped : callable
        The next step with drag, from a memory.
    memory : Memory
        At the start.
    lasting : float
        Duration (s) that the drag was chosen for.
    """
    t, u, v, branches = memory.times[0], memory.states[0], memory.v, 0
    for _ in range(MOST):
        step = stepped(memory)
        memory, branches = step.memory, branches + step.branches
        way, spent = np.abs(step.u - u).max(), step.end - t
        ran = way > RAN * np.abs(step.v).max() * spent
        rests, v = np.abs(step.v - v).max() * lasting < CALM * way, step.v
        if ran and rests and step.end - step.start > lasting:
            break
        if not ran and spent > SOON * lasting:
            return None
    else:
        return None
    past = replace(_unfolded(memory), order=1)
    return replace(step, start=t, branches=branches, memory=past, snap=True)


def _unfolded(memory: Memory) -> Memory:
    """The past as far as its instants can be told apart."""
    last = next(
        (k for k, (a, b) in enumerate(pairwise(memory.times), start=1) if not a > b),
        len(memory.times),
    )
    return replace(memory, times=memory.times[:last], states=memory.states[:last])
