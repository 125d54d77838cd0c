"""A tape as a program for the compiled kernels.

A recorded operation on arrays becomes scalar instructions on rows, one row for each
component, see :mod:`anmstrip.series.translation`.  Arrays whose last axis runs over the
points (laned) have one row for all points, filled lane by lane; others (controls) have the
same number in every lane.

Needs numba; without it, or where an operation has no translation, the tape itself does the
same in numpy.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from .power_series import Recorded, Series, Tape

Array = NDArray[np.float64]

AVAILABLE = find_spec("numba") is not None and os.environ.get("ANMSTRIP_COMPILED", "1") != "0"
"""Whether programs are compiled; the environment variable ANMSTRIP_COMPILED=0 says no."""

BLOCK = 512
"""Points that a kernel treats at once: loops over them outlast what surrounds them, and what is
kept of them still fits in a core's cache (measured; 64 takes 1.4 times as long)."""


class Program:
    """Orders of one series of a tape, found by compiled kernels.

    Parameters
    ----------
    tape : Tape
        On which the law was recorded.
    output : Series
        The series that is asked for.
    points : int
        Length of the last axis of everything that differs from point to point; 1 where
        there are no points.

    Raises
    ------
    UntranslatableError
        For an operation without translation.
    """

    def __init__(self, tape: Tape, output: Series, points: int) -> None:
        self.points = points
        self.blocks = -(-points // BLOCK)
        self.lanes = -(-points // self.blocks)
        from .translation_rules import Translation, translate  # noqa: PLC0415, RUF100

        translation = Translation(points)
        for series in tape.inputs:
            translation.input(series)
        self.rows = {series: rows.ravel() for series, rows in translation.rows.items()}
        for series, operation in tape.computed:
            translate(translation, series, operation)
        self.output, self.output_rows = output, translation.rows[output].ravel()
        self.inputs = np.concatenate(list(self.rows.values()))
        self.code, self.parameters = translation.tables()
        self.constants = self._in_blocks(np.array(translation.constants).reshape(-1, points))
        rows = translation.remembered()
        self.kept = np.full(translation.count, -1)
        self.kept[rows] = np.arange(len(rows))
        self.w = np.empty((self.blocks, len(rows), tape.order + 1, self.lanes))
        self.w[:, self.kept[translation.fixed(rows)]] = 0.0
        self.w[:, :, 1] = 0.0
        self.w[:, :, 0] = self._in_blocks(translation.start()[rows]).swapaxes(0, 1)
        self.pending: Array | None = None
        self.none = np.zeros((len(self.inputs), self.blocks, self.lanes))

    def advance(self, k: int) -> Array:
        """Order k of the output as if the inputs' were zero, completing order k − 1 before."""
        from .kernels import advanced  # noqa: PLC0415, RUF100

        pending = self.pending is not None
        changes = self.pending if self.pending is not None else self.none
        self.pending = None
        found = advanced(
            self.code, self.parameters, self.constants, self.w, self.kept, k,
            self.inputs, changes, pending, self.output_rows,
        )  # fmt: skip
        return self._flat(found).reshape(self.output.shape)

    def correct(self, k: int, changes: Mapping[Series, Array]) -> None:
        """Remember the inputs' order k; :meth:`advance` carries it through."""
        self.pending = self._changes(changes)

    def derivative(self, seeds: Mapping[Series, Array]) -> Array:
        """Directional derivatives of the output, as :meth:`Tape.derivative`."""
        from .kernels import derivatives  # noqa: PLC0415, RUF100

        batch = next((s.shape[: s.ndim - x.ndim] for x, s in seeds.items()), ())
        count = int(np.prod(batch))
        given = np.zeros((count, len(self.inputs), self.blocks, self.lanes))
        for q in range(count):
            part = {x: s.reshape((count, *x.shape))[q] for x, s in seeds.items()}
            given[q] = self._changes(part)
        found = derivatives(
            self.code, self.parameters, self.constants, self.w, self.kept,
            self.inputs, given, self.output_rows,
        )  # fmt: skip
        return self._flat(found).reshape((*batch, *self.output.shape))

    def _changes(self, changes: Mapping[Series, Array]) -> Array:
        """What is added to every input row, zero where nothing is."""
        flat = np.zeros((len(self.inputs), self.points))
        for series, change in changes.items():
            rows = self.rows[series]
            flat[rows[0] : rows[0] + len(rows)] = change.reshape(len(rows), -1)
        return self._in_blocks(flat)

    def _in_blocks(self, flat: Array) -> Array:
        """(n, points) → (n, blocks, lanes), the last point repeated in lanes that are left."""
        spare = self.blocks * self.lanes - self.points
        if spare:
            flat = np.concatenate([flat, np.repeat(flat[:, -1:], spare, axis=1)], axis=1)
        return flat.reshape(-1, self.blocks, self.lanes)

    def _flat(self, found: Array) -> Array:
        """(…, blocks, lanes) → (…, points)."""
        return found.reshape((*found.shape[:-2], -1))[..., : self.points]


def orders_of(tape: Tape, output: Series, points: int) -> Program | Recorded:
    """The orders of a series of a tape: compiled where that can be, else interpreted."""
    if AVAILABLE and points > 0:
        from .translation import UntranslatableError  # noqa: PLC0415, RUF100

        try:
            return Program(tape, output, points)
        except UntranslatableError:
            pass
    return Recorded(tape, output)
