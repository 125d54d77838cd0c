"""The studies by name.

A study is a module with a function ``study(quick)`` that returns a :class:`StudyReport`; its
line here makes it a word of the command ``anmstrip study``.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.wording import nearest
from anmstrip.studies.reports import StudyReport

STUDIES = {
    "effects": "anmstrip.studies.effects",
    "shells": "anmstrip.studies.shells",
    "wrinkles": "anmstrip.studies.wrinkles",
}
"""Name → module."""


def run_study(
    name: str, *, quick: bool = False, directory: str | Path | None = None
) -> StudyReport:
    """Do a study and write its report.

    Parameters
    ----------
    name : str
        One of :data:`STUDIES`.
    quick : bool
        Coarse meshes: the same sheets in seconds, with less to learn from them.
    directory : path, optional
        Where to write; ``results/study-<name>`` if not given.

    Returns
    -------
    StudyReport

    Raises
    ------
    InputError
        There is no such study; nothing was written.
    """
    if name not in STUDIES:
        raise InputError([Mistake("study", "", name, "a study", nearest(name, STUDIES))])
    report = import_module(STUDIES[name]).study(quick)
    files = report.write(Path(directory or f"results/study-{name}"))
    return replace(report, files=files)
