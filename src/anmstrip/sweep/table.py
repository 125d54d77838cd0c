"""The table of a sweep: a row for every scene, from the first moment on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from anmstrip.output import history
from anmstrip.sweep.variations import Variant

WAITING = "waiting"

FACTS = ("status", "message", "steps", "tangents", "wall_seconds")


class SweepTable:
    """``sweep.csv``, replaced whenever a row changes, so that it can be read at any time.

    Columns: the varied keys, `FACTS`, ``EDGE_tension`` (N/m), ``ROLLER_normal_force`` and
    all else that ``summary.json`` says of a roller, ``directory``.

    Parameters
    ----------
    path : Path
    variants : sequence of Variant
    """

    def __init__(self, path: Path, variants: Sequence[Variant]) -> None:
        self.path, self.varied = path, tuple(variants[0].values)
        self.rows = [
            {**v.values, "status": WAITING, "directory": v.directory.name} for v in variants
        ]

    def update(self, number: int, summary: Mapping[str, Any]) -> None:
        """Fill in what a scene's summary says."""
        self.rows[number].update(row_of(summary))

    def fail(self, number: int, error: BaseException) -> None:
        """Say that a scene could not be run, and why; it is tried again next time."""
        message = f"{type(error).__name__}: {error}"
        self.rows[number].update(status="failed", message=" ".join(message.split()))

    def write(self) -> None:
        """Write all rows."""
        first = (*self.varied, *FACTS)
        found = dict.fromkeys(column for row in self.rows for column in row)
        more = [column for column in found if column not in (*first, "directory")]
        history.write(self.path, (*first, *more, "directory"), self.rows)


def row_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """What the table says of a scene, from its ``summary.json``."""
    row = {fact: summary.get(fact) for fact in FACTS}
    for edge, values in summary.get("edges", {}).items():
        row[f"{edge}_tension"] = values["tension"]
    for roller, values in summary.get("rollers", {}).items():
        row |= _flat(roller, values)
    return row


def _flat(name: str, value: Any) -> dict[str, Any]:
    """Columns of a value, one for each number that it holds."""
    if not isinstance(value, Mapping):
        return {name: value}
    parts = [_flat(f"{name}_{key}", inner) for key, inner in value.items()]
    return {key: inner for part in parts for key, inner in part.items()}
