"""Studies of what accuracy costs: facts that must hold on any machine, not seconds."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import all as everything
import contact
import friction
import mesh
import order
import solvers
import time_steps
from anmstrip.paper.mass_spring import reference_solution
from cantilever import elastica
from figures import Measured, crossed, exponent, fitted, measured, patiently, work_precision
from harness import Report, Sheet


def quick(name: str) -> tuple[Report, list[dict]]:
    """The quick study, and the rows of its CSV."""
    report = import_module(name).study(True)
    for png in report.figures.values():
        assert png.startswith(b"\x89PNG")
        assert len(png) < 100_000
    return report, [dict(zip(report.data.columns, row, strict=True)) for row in report.data.rows]


def sheet_of(report: Report, start: str) -> list[dict]:
    """Rows of the sheet whose title starts so."""
    found = next(s for s in report.sheets if s.title.startswith(start))
    return [dict(zip(found.columns, row, strict=True)) for row in found.rows]


# what they share ------------------------------------------------------------------


def test_straight_lines_and_powers_are_found() -> None:
    x = [1.0, 2.0, 4.0, 8.0]
    line = fitted(x, [3.0 + 2.0 * value for value in x])
    assert (line.slope, line.base, line.r2) == pytest.approx((2.0, 3.0, 1.0))
    assert fitted(x, [1.0, -1.0, 1.0, -1.0]).r2 < 0.5
    assert exponent(x, [5.0 * value**1.2 for value in x]) == pytest.approx(1.2)


def test_a_line_ends_after_a_run_that_took_too_long() -> None:
    seconds = {1.0: 0.1, 2.0: 9.0, 3.0: 0.1}
    runs = list(patiently(seconds, lambda at: Measured("a", at, 1.0, 1, seconds[at]), 5.0))
    assert [run.at for run in runs] == [1.0, 2.0]


def test_runs_make_a_table_and_a_figure() -> None:
    runs = [measured("a", at, lambda e=at: (e / 7.0, 3)) for at in (1.0, 2.0)]
    runs += [Measured("b", 2.0, 0.5, 8, 1.0)]
    table = crossed("T", runs, lambda r: r.tangents)
    assert table == Sheet("T", ("line", "1", "2"), (("a", 3, 3), ("b", None, 8)))
    assert work_precision(runs, "error").startswith(b"\x89PNG")


def test_the_elastica_is_that_of_the_table() -> None:
    """P L²/EI = 1, 4, 10, from tables by elliptic integrals."""
    table = {1: (0.05643324, 0.30172077), 4: (0.32894124, 0.66996418), 10: (0.5549956, 0.81060902)}
    for load, (along, across) in table.items():
        assert elastica(load) == pytest.approx((-along, across), abs=1e-8)


TOY = """
from harness import Report, Sheet, main
def study(quick):
    sheet = Sheet("", ("a",), ((1,),))
    return Report("NAME", "Title NAME", sheet, (sheet,))
main(study)
"""


def test_all_studies_go_into_one_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every script is run, with its options, and the page names title and command."""
    scripts = {name: tmp_path / f"{name}.py" for name in ("one", "two")}
    for name, script in scripts.items():
        script.write_text(TOY.replace("NAME", name), "utf-8")
    monkeypatch.setenv("PYTHONPATH", str(Path(everything.__file__).parent))
    monkeypatch.setattr(everything, "SCRIPTS", scripts)
    everything.run_all(tmp_path / "out", quick=True)
    page = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert "* [Title two](two.md): `python " in page
    assert page.count("--quick") == 2
    assert "numpy " in (tmp_path / "out" / "one.md").read_text(encoding="utf-8")


def test_every_script_is_there() -> None:
    """All studies of the folder are in the list, and nothing else."""
    assert all((everything.ROOT / script).exists() for script in everything.SCRIPTS.values())
    folder = everything.ROOT / "examples" / "benchmarks"
    found = {p.name for p in folder.glob("*.py") if "main(study)" in p.read_text("utf-8")}
    listed = {Path(script).name for script in everything.SCRIPTS.values()}
    assert found - {"harness.py"} == listed - {"stability.py"}


# facts of each -------------------------------------------------------------------


@pytest.mark.parametrize("formula", time_steps.ORDERS)
def test_the_order_in_time_is_that_of_the_formula(formula: int) -> None:
    reference = reference_solution(time_steps.SMOOTH, 1e-13)
    steps = [(2.0 - 0.5) / count for count in (24, 48)]
    errors = [time_steps.smooth_error(reference, formula, h)[0] for h in steps]
    assert exponent(steps, errors) == pytest.approx(formula, abs=0.5)


@pytest.mark.slow
def test_a_finer_cantilever_is_nearer_to_the_elastica() -> None:
    errors = [mesh.bending_error(cells) for cells in (4, 8, 16)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-3


def test_fixed_steps_need_the_width_of_friction() -> None:
    """Newton's method converges from 64 steps on at ω = 0.1, and from 512 at ω = 0.01."""
    mass = friction.Mass()
    for omega, fails, works in ((1e-1, 32, 64), (1e-2, 256, 512)):
        assert mass.newton(fails, omega=omega)[0] == np.inf
        error, tangents = mass.newton(works, omega=omega)
        assert error < 0.02
        assert tangents > works


@pytest.mark.slow
def test_series_follow_sharper_friction_for_little_more() -> None:
    mass = friction.Mass()
    blunt, sharp = mass.series(omega=1e-1), mass.series(omega=1e-4)
    assert max(blunt[0], sharp[0]) < mass.tolerance
    assert sharp[1] < 1.5 * blunt[1]


@pytest.mark.slow
def test_a_strip_follows_sharper_friction_in_a_straight_line() -> None:
    """A decade of ω costs about as many tangents as the one before, and never a multiple."""
    strip = friction.Strip(0.2)
    found = []
    for omega in (1e-2, 1e-4, 1e-6):
        turning = strip.turning(1e-5, omega=omega)
        list(turning.states())
        found.append(turning.march.cost.factorisations)
    first, second, third = found
    assert third - second < 1.5 * (second - first)
    assert third < 3.5 * first


@pytest.mark.slow
def test_friction_study() -> None:
    report, rows = quick("friction")
    fits = {row["line"]: row for row in sheet_of(report, "How tangents grow")}
    assert fits["strip, series, omega"]["power of 1/x"] < 0.2
    assert fits["mass, Newton, fixed steps"]["power of 1/x"] > 0.5
    for row in rows:
        if "strip, series" in row["line"]:
            assert row["error"] < 0.05


@pytest.mark.slow
def test_contact_study() -> None:
    """Penetration falls with K; what the mesh resolves is cheaper than the stiffest."""
    _, rows = quick("contact")
    stiff = rows[: len(contact.STIFFNESSES[::3])]
    assert [row["penetration"] for row in stiff] == sorted(
        (row["penetration"] for row in stiff), reverse=True
    )
    assert max(row["pressing"] for row in stiff) < 5 * min(row["pressing"] for row in stiff)
    soft = len(contact.REGULARISATIONS[::3])
    chosen, *graded = rows[len(stiff) + soft :]
    assert chosen["pressing"] < 0.6 * max(row["pressing"] for row in stiff)
    assert [row["onset"] for row in graded] == sorted(row["onset"] for row in graded)
    for row in (*stiff, chosen):
        assert abs(row["ratio error"]) < 5e-3


@pytest.mark.slow
def test_order_study() -> None:
    """A higher order needs fewer tangents, down to those of time; all problems have a best one."""
    report, rows = quick("order")
    assert len(sheet_of(report, "The best order")) == 3
    for line in {row["line"] for row in rows}:
        own = {row["order"]: row["tangents"] for row in rows if row["line"] == line}
        assert own[4] > own[12] > 0.9 * own[20]
    assert all(row["error"] < 1e-3 for row in rows if row["order"] != order.CHOSEN)


@pytest.mark.slow
def test_mesh_study() -> None:
    """Errors fall with the element length; section and shell agree."""
    report, rows = quick("mesh")
    section = [row for row in rows if row["level"] == "section"]
    shell = [row for row in rows if row["level"] == "shell"]
    for name in ("tension ratio", "bending moment"):
        errors = [row[name] for row in section]
        assert errors == sorted(errors, reverse=True)
    for one, other in zip(section, shell, strict=False):
        assert one["tension ratio"] == pytest.approx(other["tension ratio"], rel=0.05)
    assert all(row["order"] > 2.0 for row in sheet_of(report, "Cantilever")[1:])


@pytest.mark.slow
def test_solvers_study() -> None:
    """All solvers solve; one is chosen for each tangent; growth in seconds is told."""
    report, rows = quick("solvers")
    assert all(row["residual"] < 1e-13 for row in rows)
    for n in {row["unknowns"] for row in rows}:
        own = [row["chosen"] for row in rows if row["unknowns"] == n]
        assert own.count("chosen") == 1
    names = {row["solver"] for row in rows}
    assert {"band LU", "sparse LU"} <= names
    assert ("PARDISO" in names) is solvers.pardiso_is_there()
    assert all(np.isfinite(row["exponent"]) for row in sheet_of(report, "Growth"))


@pytest.mark.slow
def test_time_study() -> None:
    report, rows = quick("time_steps")
    assert len(sheet_of(report, "Smooth motion")) == 5
    errors = [row["error"] for row in rows if row["line"] == "strip, fixed, order 2"]
    assert np.all(np.diff(errors) < 0.0)


@pytest.mark.slow
def test_cases_study() -> None:
    """The tolerance is kept, and a stricter one gives a smaller error."""
    _, rows = quick("cases")
    for line in {row["line"] for row in rows}:
        own = [row for row in rows if row["line"] == line]
        assert all(row["error"] < row["tolerance"] for row in own)
        assert own[0]["error"] > own[-1]["error"]


# the tolerance ----------------------------------------------------------------------


@pytest.mark.slow
def test_the_tolerance_is_the_error() -> None:
    """Within a factor of ten upwards and of a hundred downwards, on both problems."""
    _, rows = quick("tolerance")
    ratios = np.array([row["error"] / row["tolerance"] for row in rows])
    assert len(ratios) == 10
    assert ratios.max() < 10.0
    assert ratios.min() > 0.01
