"""Studies: what they write, and that an effect that is off costs nothing."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import effects
import harness
import stability
from anmstrip.driver.scene import Scene
from figures import Plot, by_problem, few_ticks
from harness import Report, Sheet
from motions import Trial
from strips import growing, steps_of

OFF = {"contact", "laws", "transport"}
"""Modules of mechanics that a strip with nothing but its membrane has no use for."""


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Directory and output of the quick study of effects."""
    directory = tmp_path_factory.mktemp("effects")
    return directory, str(harness.run(effects.study, quick=True, directory=directory))


def rows_of(directory: Path) -> list[dict[str, str]]:
    with (directory / "effects.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows
    return rows


@pytest.mark.slow
def test_files(quick: tuple[Path, str]) -> None:
    directory, printed = quick
    names = ("effects.csv", "effects.md", "effects.png")
    assert sorted(path.name for path in directory.iterdir()) == list(names)
    assert all(str(directory / name) in printed for name in names)
    report = (directory / "effects.md").read_text(encoding="utf-8")
    assert "python examples/benchmarks/effects.py --quick" in report
    assert report.count("\n## ") == 6
    assert (directory / "effects.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("level", effects.LEVELS)
@pytest.mark.slow
def test_what_is_off_has_no_row(quick: tuple[Path, str], level: str) -> None:
    """Every step brings its own effect, and no row for those still to come."""
    rows = [row for row in rows_of(quick[0]) if row["level"] == level]
    own = "tension" if level == "plate" else "membrane"
    brings: dict[str, str | None] = {"moving roller": None}
    expected: list[str] = ["force on exit"]
    for step in steps_of(level):
        name = brings.get(step, step)
        expected += [] if name is None else [name]
        found = [row["effect"] for row in rows if row["added"] == step]
        assert sorted(found) == sorted(expected)
    assert own in expected
    assert all(float(row["seconds"]) > 0.0 for row in rows)
    assert {row["added"] for row in rows} == {*steps_of(level)}


@pytest.mark.slow
def test_points(quick: tuple[Path, str]) -> None:
    """Laws have points; constant matrices and dead loads have none."""
    for row in rows_of(quick[0]):
        constant = row["effect"] in ("bending", "weight", "force on exit")
        assert (int(row["points"]) == 0) is constant


def cells_of(directory: Path, label: str, occurrence: int = 0) -> list[str]:
    """Cells of a line of the report's tables, by its first cell."""
    report = (directory / "effects.md").read_text(encoding="utf-8")
    lines = [line for line in report.splitlines() if line.startswith(f"| {label} |")]
    return [cell.strip() for cell in lines[occurrence].strip("|").split("|")]


@pytest.mark.slow
def test_a_section_stands_for_a_shell(quick: tuple[Path, str]) -> None:
    """Tensions to 0.2 % on the coarsest mesh; e^(f θ) less bending is 1.25."""
    *_, per_expansion, ratio = cells_of(quick[0], "shell / section")
    assert float(ratio) == pytest.approx(1.0, rel=2e-3)
    assert float(per_expansion) > 2.0
    behind = 1 + len(effects.LAYERS["section"])  # rows of strip that yields
    assert float(cells_of(quick[0], "section", -1 - behind)[-1]) == pytest.approx(1.25, rel=0.02)


@pytest.mark.slow
def test_a_plate_stands_for_a_shell_at_small_wraps(quick: tuple[Path, str]) -> None:
    """Normal force T θ at θ = 1°, and lift, to 1 %."""
    *_, force, lift = cells_of(quick[0], "shell / plate")
    assert float(force) == pytest.approx(1.0, rel=1e-2)
    assert float(lift) == pytest.approx(1.0, rel=1e-2)
    assert float(cells_of(quick[0], "plate", -1)[-2]) == pytest.approx(1e4 * 0.01745, rel=0.05)


@pytest.mark.slow
def test_strip_that_yields_costs_more_with_more_layers(quick: tuple[Path, str]) -> None:
    """Per expansion, beside elastic strip of the same level."""
    for level, layers in effects.LAYERS.items():
        names = ["elastic", *(f"{number} layers" for number in layers)]
        shares = [float(cells_of(quick[0], f"{level} | {name}")[-1]) for name in names]
        assert shares[0] == 1.0 < shares[1] and shares[0] < shares[2]


@pytest.mark.slow
def test_effects_that_are_off_are_not_imported(quick: tuple[Path, str]) -> None:
    """In a process of its own: a module comes with the step that needs it, not before."""
    steps = steps_of("section")
    brought = {step: cells_of(quick[0], f"+ {step}")[1].split(", ") for step in steps}
    assert "shell" in brought["membrane"]
    assert brought["bending"] == brought["weight"] == brought["friction"] == ["none"]
    assert {*brought["contact"]} == {"contact", "laws"}
    modules = [module for step in steps for module in brought[step] if module != "none"]
    assert len(modules) == len({*modules})


@pytest.mark.slow
def test_a_written_run_imports_no_effect_that_is_off(quick: tuple[Path, str]) -> None:
    """With the membrane alone, pictures included: no bending, no contact, no friction."""
    run = cells_of(quick[0], "a run of the first, written")[1].split(", ")
    built = cells_of(quick[0], "+ membrane")[1].split(", ")
    assert "shell" in built
    assert OFF.isdisjoint({*run, *built})


def test_expansions_are_complete() -> None:
    """All orders are made, so that times can be compared."""
    for added, scene in growing("plate", (30, 2)):
        assert effects.timed("plate", added, scene, 1, 5).order == effects.ORDER


@pytest.mark.parametrize("level", effects.LEVELS)
def test_growing_scenes_differ_by_one_effect(level: str) -> None:
    scenes = dict(growing(level, (30, 2)))
    assert tuple(scenes) == steps_of(level)
    assert all(isinstance(scene, Scene) for scene in scenes.values())
    assert not scenes[steps_of(level)[0]].strip.bending
    assert scenes["bending"].strip.bending
    assert scenes["weight"].contact is None
    assert scenes["contact"].contact is not None
    assert scenes["contact"].friction is None


def test_report_is_written_as_it_is_printed(tmp_path: Path) -> None:
    sheet = Sheet("A title", ("a", "b"), (("x", 1.23456), ("y", None)), "A note.")
    data = Sheet("", ("a",), (("x",), (2,)))
    report = Report("toy", "Toy", data, (sheet,), {"a.png": b"1"}, "python toy.py", 9.0, 3.0)
    names = [path.name for path in report.write(tmp_path / "there")]
    assert names == ["toy.csv", "toy.md", "a.png"]
    assert (tmp_path / "there" / "toy.csv").read_text(encoding="utf-8") == "a\nx\n2\n"
    text = (tmp_path / "there" / "toy.md").read_text(encoding="utf-8")
    for words in ("    python toy.py", "## A title", "A note.", "| x | 1.235 |", "| y | – |"):
        assert words in text
    assert "1.235" in str(report)
    assert "33 % of one core. The machine was busy" in str(report)
    assert "busy" not in replace(report, processor=8.9).taken


def test_sweeps_say_what_is_wrong() -> None:
    """A sweep fails by an outcome, by an error, or by growing work."""
    good = Trial(1.0, 1.0, 1e-9, 5, 10, "done")
    trials = {
        "done": [good, replace(good, tangents=15)],
        "x = 10: it stopped": [good, replace(good, outcome="it stopped")],
        "x = 10: error 0.1": [good, replace(good, error=0.1)],
        "1990 tangents more per decade": [good, replace(good, tangents=2000)],
        "6 steps more per decade": [good, replace(good, steps=11)],
    }
    for words, (first, last) in trials.items():
        found = {1.0: first, 10.0: last}
        sweep = stability.Sweep("D1", "toy", "node", "x", found.__getitem__, (1.0, 10.0), 1e-6)
        assert stability.outcome(sweep, sweep.trials(quick=True)) == words


def test_sweeps_cover_the_list() -> None:
    """All cases but rejected steps and restarts, which have no range."""
    assert {s.case for s in stability.SWEEPS} == {f"D{k}" for k in range(1, 19) if k != 15}


def test_more_curves_than_a_legend_tells_apart_have_a_panel_for_each_problem() -> None:
    points = ([1.0, 2.0], [3.0, 4.0])
    names = [f"{problem}, {order}" for problem in ("beam", "shell") for order in range(5)]
    (few,) = by_problem(Plot("x", "y", dict.fromkeys(names[:9], points)))
    assert list(few.curves) == names[:9]
    panels = by_problem(Plot("x", "y", dict.fromkeys(names, points)))
    assert [panel.title for panel in panels] == ["beam", "shell"]
    assert all(list(panel.curves) == [f"order {k}" for k in range(5)] for panel in panels)


@pytest.mark.parametrize(("end", "labels"), [(8.0, ["1", "2", "5"]), (1e3, [])])
def test_ticks_of_less_than_two_decades_are_round_numbers(end: float, labels: list[str]) -> None:
    axes = Figure().subplots()
    axes.set(xscale="log", xlim=(1.0, end))
    few_ticks(axes.xaxis)
    shown = [axes.xaxis.get_major_formatter()(at) for at in axes.get_xticks() if 1.0 <= at <= end]
    assert not labels or shown == labels
    assert {text.get_text() for text in axes.get_xticklabels(minor=True)} <= {""}
