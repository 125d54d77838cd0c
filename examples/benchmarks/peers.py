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
    """Who is asked.

    Attributes
    ----------
    name : str
        Of ``peer_capstan.py``.
    title : str
    quick : bool
        Whether it belongs to a quick study.
    module : str
        What it needs; empty for this program.
    """

    name: str
    title: str
    quick: bool = True
    module: str = ""

    @property
    def factors(self) -> tuple[float | str, ...]:
        """On the stiffness of contact that it is asked for."""
        return FACTORS if self.module else (MESH, *FACTORS)


PROGRAMS = (
    Program("section", "ours, section"),
    Program("threaded-section", "ours, section, threaded"),
    Program("shell", "ours, shell", quick=False),
    Program("threaded-shell", "ours, shell, threaded", quick=False),
    Program("exudyn", "EXUDYN, planar cable", module="exudyn"),
    Program("felupe", "FElupe, plane solids", quick=False, module="felupe"),
)


@dataclass(frozen=True)
class Trial:
    """One program at one stiffness: its answer, or why there is none."""

    program: Program
    stiffer: float | str
    answer: Answer | None
    outcome: str
    seconds: float

    @property
    def row(self) -> tuple[Cell, ...]:
        """Cells of the columns."""
        stiffness = self.stiffer if self.stiffer == MESH else f"x {self.stiffer:g}"
        head = (self.program.title, stiffness, self.outcome)
        a = self.answer
        if a is None:
            return (*head, self.seconds, None, None, None, None, None)
        return (*head, a.seconds, a.steps, a.tangents, a.unknowns, f"{a.ratio:.6f}", 100.0 * a.off)


def study(quick: bool = False) -> Report:
    """All programs at all stiffnesses."""
    limit = 12.0 if quick else 300.0
    programs = [p for p in PROGRAMS if (p.quick or not quick) and _there(p)]
    trials = [tried(program, factor, limit) for program in programs for factor in program.factors]
    rows = tuple(trial.row for trial in trials)
    return Report(
        name="peers",
        title="The capstan by other programs",
        data=Sheet("All trials", COLUMNS, rows),
        sheets=(Sheet("Capstan in full slip", COLUMNS, rows, _note(limit)),),
    )


def tried(program: Program, stiffer: float | str, limit: float) -> Trial:
    """A program in a process of its own; what goes wrong there is the outcome."""
    reply = ask(PROCESS, program.name, str(stiffer), limit=limit)
    answer = None if reply.said is None else Answer(**reply.said)
    return Trial(program, stiffer, answer, reply.outcome, reply.seconds)


def _there(program: Program) -> bool:
    return not program.module or installed(program.module)


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
