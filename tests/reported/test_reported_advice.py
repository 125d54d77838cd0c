"""What a run that stops says: when and where it was, and numbers that help when they are typed."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import reported_scenes as scenes
from reported_files import Results, ran, rows_of

E, NU, T = 2.0e11, 0.3, 1.0e-3


def stopped(text: str, where: Path, *settings: str) -> tuple[str, Results]:
    """Run a scene that stops; return its sentence, which the summary has as well."""
    results = ran(text, where, *settings, options=("--quiet",))
    assert results.exit_code == 1
    message = results.printed.splitlines()[0]
    assert results.summary["message"] == message
    if results.summary["steps"]:
        at = re.search(r"at t = (\S+) s:", message)
        assert at is not None
        assert float(at[1]) == pytest.approx(results.history["time"][-1], rel=1e-5)
        assert f"Stopped in stage {results.history['stage'][-1]} at" in message
    return message, results


@pytest.mark.parametrize("bound", ["steps", "tangents"])
def test_a_bound_is_doubled(bound: str, tmp_path: Path) -> None:
    """It was meant by the user; the run has made as many as it was allowed, and no more."""
    message, results = stopped(scenes.LIFTED, tmp_path, f"solver.max_{bound}=4")
    assert results.summary["status"] == f"too_many_{bound}"
    assert results.summary[bound] == 4
    assert f"Try --resume --set solver.max_{bound}=8" in message
    scene = tmp_path / "scene.toml"
    again = ran(
        scene.read_text(encoding="utf-8"), tmp_path, f"solver.max_{bound}=8",
        options=("--quiet", "--resume"),
    )  # fmt: skip
    assert again.summary[bound] == 8
    assert len(again.history["time"]) == again.summary["steps"]


def test_what_could_be_told_before_is_told(tmp_path: Path) -> None:
    """A span that is heavier than its tension: ρ t L g beside T."""
    text = scenes.LIFTED.replace("poisson = 0.3", "poisson = 0.3\ndensity = 7850.0")
    text = text.replace('name = "up"', 'name = "up"\ngravity = [0.0, 0.0, -1962.0]')
    message, _ = stopped(text, tmp_path, "solver.max_steps=2")
    weight = 1962.0 * 7850.0 * T * 1.0  # of half the strip, before or behind the roller
    assert (
        f"but in stage up a span of the strip weighs {weight:.2g} N/m, {weight / 1e4:.2g} times"
        in message
    )


def test_a_tolerance_near_round_off(tmp_path: Path) -> None:
    """Twenty times what the last digit is worth; no stage asks for less than that digit."""
    strict = ran(scenes.LIFTED, tmp_path, "solver.tolerance=2e-12", options=("--quiet",))
    message = " ".join(strict.summary["warnings"])
    found = re.search(r"worth (\S+) of the forces. Try --set solver.tolerance=(\S+)", message)
    assert found is not None
    worth, proposed = float(found[1]), float(found[2])
    assert proposed == pytest.approx(20.0 * worth, rel=0.2)  # of two numbers of one digit
    typed = ran(
        scenes.LIFTED, tmp_path, f"solver.tolerance={proposed:g}", "output.events=false",
        options=("--quiet",),
    )  # fmt: skip
    assert typed.exit_code == 0
    assert typed.history["residual"].max() <= proposed


def test_a_sharp_onset_over_a_roller(tmp_path: Path) -> None:
    """(h/4)²/2r is what elements resolve; the place is a node of the mesh, and near the roller."""
    sharp = "contact.onset=1e-11", "contact.pressure=2e4", "solver.tolerance=1e-4"
    message, _ = stopped(scenes.TURNING, tmp_path, *sharp)
    h = 0.5 * np.pi / np.ceil(0.5 * np.pi / 0.1)
    onset = (0.25 * h) ** 2 / (2.0 * 0.5)
    assert (
        f"Contact sets in over 1e-11 m, and elements resolve {onset:.2g} m. "
        f"Try --set contact.onset={onset:.1g}"
    ) in message
    at = re.search(r"worst at x = (\S+) m \(in (\w), at roller r1\)", message)
    assert at is not None
    assert float(at[1]) / h == pytest.approx(round(float(at[1]) / h), abs=1e-3)
    assert abs(float(at[1])) < 0.5 * np.pi * 0.5


def test_a_strip_that_is_pushed_buckles(tmp_path: Path) -> None:
    """E t times the strain of the way that its exit has gone; the middle of some element."""
    text = (
        scenes.STRIP.replace("refined = 0.1\n", "")
        + """
[edges.entry]
fixed = ["x", "z"]

[edges.exit]
fixed = ["x", "z"]

[[stages]]
name = "push"
duration = 2.0
exit.move = [-0.01, 0.0, 0.0]
"""
    )
    message, results = stopped(text, tmp_path, "strip.coil_set=1e-9", "solver.max_steps=12")
    pressed = re.search(r"pressed at x = (\S+) m with (\S+) N/m, and buckles", message)
    assert pressed is not None
    strain = 0.01 * results.history["time"][-1] / 2.0 / 4.0
    assert float(pressed[2]) == pytest.approx(E * T * strain, rel=5e-3)  # three digits are told
    # beyond π² D/(4 h)² of an element of 0.25 m, which is what it bears
    assert float(pressed[2]) > np.pi**2 * E * T**3 / 12.0 / (1.0 - NU**2) / (4 * 0.25) ** 2
    assert (float(pressed[1]) + 2.0) / 0.25 % 1.0 == pytest.approx(0.5, abs=0.02)
    assert "Try a larger x in stages.push.exit.move." in message


def test_a_resumed_run_has_a_row_for_every_state(tmp_path: Path) -> None:
    """The last state is written after the checkpoint, and belongs to no step; also if all is done.

    The seconds of all parts are counted.
    """
    text = scenes.LIFTED.replace("times = [0.25, 1.1, 1.2, 1.5, 2.0, 2.75]", "every = 4")
    for options in ((), ("--resume",), ("--resume",)):
        most = () if options else ("solver.max_steps=6",)
        results = ran(text, tmp_path, *most, options=("--quiet", *options))
        sets = ElementTree.parse(results.directory / "strip.pvd").iter("DataSet")
        shown = [float(found.get("timestep", "nan")) for found in sets]
        told = sorted({float(row["time"]) for row in rows_of(results.directory / "profile.csv")})
        assert shown == pytest.approx(told)
    assert results.summary["status"] == "done"
    assert sum(results.summary["seconds"].values()) < results.summary["wall_seconds"]
    assert results.summary["seconds"]["series"] > 0.0  # of a run that had nothing left to do
