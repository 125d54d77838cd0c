"""The capstan beside programs that others have written, with contact made stiffer.

All get the same strip, roller and loads, and are asked for the same number: the ratio of the
tensions in full slip, which the capstan formula with bending gives.  Each runs in a process of
its own on one core, within a time limit, with settings that contact's stiffness does not change.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from harness import Cell, Report, Sheet, ask, installed, left_out, main
from peer_capstan import Answer

PROCESS = str(Path(__file__).with_name("peer_capstan.py"))

FACTORS = (1.0, 1e2, 1e4)
"""On the stiffness of contact, 1e10 Pa/m."""

MESH = "mesh"
"""Contact as sharp as the mesh resolves, instead of a stiffness."""

COUNTS = ("seconds", "steps", "tangents", "unknowns")

COLUMNS = ("program", "stiffness", "outcome", *COUNTS, "ratio", "off (%)")


@dataclass(frozen=True)
class Program:
    """A program that is asked."""

    name: str  # of ``peer_capstan.py``
    title: str
    quick: bool = True  # whether it belongs to a quick study
    module: str = ""  # that it needs; empty for this program


PROGRAMS = (
    Program("section", "ours, section"),
    Program("threaded-section", "ours, section, threaded"),
    Program("shell", "ours, shell", quick=False),
    Program("threaded-shell", "ours, shell, threaded", quick=False),
    Program("exudyn", "EXUDYN, planar cable", module="exudyn"),
    Program("felupe", "FElupe, plane solids", quick=False, module="felupe"),
)


def study(quick: bool = False) -> Report:
    """Ask all programs at all stiffnesses."""
    limit = 12.0 if quick else 300.0
    rows = tuple(
        row(program, factor, limit)
        for program in PROGRAMS
        if (program.quick or not quick) and (not program.module or installed(program.module))
        for factor in (FACTORS if program.module else (MESH, *FACTORS))
    )
    return Report(
        name="peers",
        title="The capstan by other programs",
        data=Sheet("All trials", COLUMNS, rows),
        sheets=(Sheet("Capstan in full slip", COLUMNS, rows, _note(limit)),),
    )


def row(program: Program, stiffer: float | str, limit: float) -> tuple[Cell, ...]:
    """Ask a program in a process of its own; what goes wrong there is the outcome."""
    reply = ask(PROCESS, program.name, str(stiffer), limit=limit)
    head = (program.title, stiffer if stiffer == MESH else f"x {stiffer:g}", reply.outcome)
    if reply.said is None:
        return (*head, reply.seconds, *(None,) * 5)
    a = Answer(**reply.said)
    return (*head, a.seconds, a.steps, a.tangents, a.unknowns, f"{a.ratio:.6f}", 100.0 * a.off)


def _note(limit: float) -> str:
    note = (
        "One core, seconds of the processor (of the clock where there is no answer); off is the "
        "ratio of tensions against the capstan formula with bending, with the friction law's "
        "coefficient at the speed of slip; importing a program is not counted. Ours also with "
        "contact as sharp as its mesh resolves (mesh). EXUDYN: static steps, Newton iterations "
        "as tangents. FElupe: its cylinder cannot turn, so the strip is drawn over it. "
        f"Time limit {limit:g} s. Measured elsewhere: CalculiX 2.20, one solid through the "
        "thickness, 4800 unknowns: 175 s, 977 Newton iterations, +0.18 %, and +0.25 % with "
        "contact 100 times stiffer."
    )
    missing = left_out(p.module for p in PROGRAMS if p.module)
    return " ".join(part for part in (note, missing) if part)


if __name__ == "__main__":
    main(study)
