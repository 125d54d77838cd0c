"""One scene of a sweep, in a worker: run, gone on with, or found finished."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from anmstrip.output.files import replaced
from anmstrip.scene.schema import Scene
from anmstrip.series.outcome import Outcome

INPUT, SUMMARY, CHECKPOINT = "input.json", "summary.json", "checkpoint.npz"


def ended(scene: Scene, directory: Path) -> dict[str, Any] | None:
    """Summary of an earlier run of this very scene that came to an end, else None.

    A run that stopped by itself has ended too: the same input stops at the same place.
    """
    summary = _read(directory / SUMMARY) or {}
    interrupted = summary.get("status") in (None, Outcome.INTERRUPTED.name.lower())
    return None if interrupted or not _began(scene, directory) else summary


def run(scene: Scene, directory: Path) -> dict[str, Any]:
    """Run a scene to its end, from its checkpoint if there is one; return its summary.

    Any number of processes may die in here, and the next one goes on: results that belong
    to another input are dropped before this one's is written down.
    """
    from anmstrip.scene.run import Run  # noqa: PLC0415 (heavy, and not needed to look)

    if (summary := ended(scene, directory)) is not None:
        return summary
    if not _began(scene, directory):
        directory.mkdir(parents=True, exist_ok=True)
        for name in (INPUT, SUMMARY, CHECKPOINT):
            (directory / name).unlink(missing_ok=True)
        with replaced(directory / INPUT) as temporary:
            temporary.write_text(json.dumps(scene.to_dict(), indent=2), encoding="utf-8")
    for _ in Run(scene, directory, resume=(directory / CHECKPOINT).exists()):
        pass
    summary = _read(directory / SUMMARY)
    assert summary is not None
    return summary


def _began(scene: Scene, directory: Path) -> bool:
    """Whether what lies in a directory belongs to this scene."""
    return _read(directory / INPUT) == json.loads(json.dumps(scene.to_dict()))


def _read(path: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None
