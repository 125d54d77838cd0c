"""The studies by name.

A study is a module with a function ``study(quick)`` that returns a :class:`StudyReport`; its
line here makes it a word of the command ``anmstrip study``, and command and times are added.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from anmstrip.output.files import replaced
from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.wording import nearest
from anmstrip.studies.reports import StudyReport

STUDIES = {
    name: f"anmstrip.studies.{module}"
    for name, module in {
        "effects": "effects",
        "tolerance": "tolerance",
        "cases": "case_accuracy",
        "friction": "friction",
        "contact": "contact",
        "order": "order",
        "mesh": "mesh",
        "solvers": "solvers",
        "time": "time_steps",
        "newton": "newton_study",
        "peers": "peers",
        "stiff": "stiff",
        "stability": "stability",
        "shells": "shells",
        "wrinkles": "wrinkles",
        "roller_wrinkles": "roller_wrinkles",
    }.items()
}
"""Name → module."""

PAGE = "README.md"


def run_all(*, quick: bool, directory: Path) -> Iterator[StudyReport]:
    """Do all studies into one directory, with a page that names them."""
    for name in STUDIES:
        report = run_study(name, quick=quick, directory=directory)
        _write_page(directory)
        yield report


def _write_page(directory: Path) -> None:
    """A page that names the reports that are there."""
    lines = ["# Studies", "    anmstrip study all"]
    for name in STUDIES:
        if (report := directory / f"{name}.md").exists():
            title, command = report.read_text(encoding="utf-8").split("\n\n")[:2]
            lines.append(f"* [{title.removeprefix('# ')}]({name}.md): `{command.strip()}`")
    with replaced(directory / PAGE) as temporary:
        temporary.write_text("\n\n".join(lines) + "\n", encoding="utf-8")


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
    begin, at_work = time.perf_counter(), _at_work()
    report = import_module(STUDIES[name]).study(quick)
    report = replace(
        report,
        command=f"anmstrip study {name}{' --quick' if quick else ''}",
        seconds=time.perf_counter() - begin,
        processor=_at_work() - at_work,
    )
    where = Path(directory or f"results/study-{name}")
    files = report.write(where)
    if (where / PAGE).exists():
        _write_page(where)
    return replace(report, files=files)


def _at_work() -> float:
    """Processor time of this process and of those that it has waited for (s)."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
