"""What nothing holds is named before the run, with what to type; what is held is not."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.linalg import eigh

from anmstrip.advice.preview import Preview, as_sentence, free_motions, softest_motions
from anmstrip.cli import main
from anmstrip.driver.explain import explain
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.simulation.problem import Assembly

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))

FLAT: dict[str, Any] = {
    "strip": {"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [8, 2]},
    "material": {"young": 2e11, "poisson": 0.3},
    "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
    "stages": [{"name": "pull", "duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}],
}
THREADED: dict[str, Any] = {
    "strip": {"width": 1.0, "thickness": 1e-3, "cells": [16, 2], "refined": 0.05},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {},
    "friction": {"coefficient": 0.3},
    "threading": {"tension": 1e4, "entry": [-2.0, 0.0, -1.0], "exit": [2.0, 0.0, -1.0]},
    "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
    "rollers": [{"name": "r1", "radius": 0.5, "centre": [0.0, 0.0, -0.5], "wrap": "over"}],
    "stages": [{"name": "turn", "duration": 0.1, "rollers": {"r1": {"surface_speed": 1.0}}}],
}
PULLED_ALONG = {"stages": [{"name": "pull", "duration": 1.0, "exit": {"tension": 1e4}}]}
NOT_CENTRED = {"edges": {"entry": {"fixed": ["x", "z"]}}}
LOOSE = {"edges": {"entry": {"fixed": ["x", "z"], "centred": False}}}


def told_of(scene: Scene) -> list[str]:
    return list(free_motions(Preview.of(Assembly(scene))))


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        (FLAT | PULLED_ALONG, "in stage pull the exit is pulled along its own direction and free"),
        (FLAT | NOT_CENTRED, "in stage pull nothing holds the strip in y"),
        (FLAT | {"edges": {"entry": {"fixed": ["z"], "centred": True}}}, "holds the strip in x"),
        (FLAT | {"edges": {"entry": {"fixed": ["x"], "centred": True}}}, "holds the strip in z"),
        (THREADED | LOOSE, "in stage threading nothing holds the strip in y"),
    ],
)
def test_what_is_free_is_named_and_held_by_what_is_told(tables: dict[str, Any], words: str) -> None:
    scene = Scene.model_validate(copy.deepcopy(tables))
    (told,) = told_of(scene)
    assert words in told
    found = re.search(r"--set '?([\w.]+=(?:\[.*?\]|\S+?))'?(?:\s|$)", told)
    assert found is not None, told
    changed = Scene.from_tables(scene.to_dict(), "line.toml", [found[1]])
    assert told_of(changed) == []
    if scene.threading is None:
        run = Run(changed)
        assert list(run)
        assert run.outcome.done


def test_a_threaded_shell_that_nothing_holds_across_is_centred() -> None:
    """No side force holds it, and it stays where it is drawn; it was warned of, 5 µm aside."""
    steady = {"name": "run", "steady": True, "strip": {"speed": 1.0}}
    scene = Scene.model_validate(THREADED | NOT_CENTRED | {"stages": [steady]})
    assert told_of(scene) == []
    assert "the middle of the entry is (edges.entry.centred)" in explain(scene)
    run = Run(scene)
    *_, last = run
    assert run.outcome.done
    assert abs(last.state.edge_force("entry")[1]) < 1e-6 * 1e4
    assert abs(last.state.rollers["r1"].offset) < 1e-9


def test_the_entry_over_a_roller_with_a_hollow_is_centred() -> None:
    """A spreader drives strip off; its entry was left to it, and it ended 1.3 mm aside."""
    hollow = {"rollers": [{**THREADED["rollers"][0], "crown": [0.0, 1e-4]}]}
    scene = Scene.model_validate(THREADED | NOT_CENTRED | hollow)
    assert Assembly(scene).scene.edges["entry"].centred
    scene = Scene.model_validate(THREADED | LOOSE | hollow)
    assert "No edge is held in y: friction alone keeps the strip" in explain(scene)


@pytest.mark.parametrize(
    "others",
    [
        LOOSE,
        {"edges": {**NOT_CENTRED["edges"], "exit": {"fixed": ["y"]}}},
        {"edges": {**NOT_CENTRED["edges"], "exit": {"centred": True}}},
        {"rollers": [{**THREADED["rollers"][0], "crown": [0.0, -1e-3]}]},
        {
            "rollers": [
                {**THREADED["rollers"][0], "sides": {"taper": 1e-3, "flat": 0.4, "rounding": 0.05}}
            ]
        },
        {"strip": {**THREADED["strip"], "cells": [16, 3]}},
        {"strip": {**THREADED["strip"], "kinematics": "section"}},
    ],
)
def test_nothing_else_is_centred_by_default(others: dict[str, Any]) -> None:
    """Where it is held, may be guided, has no node in its middle, or does not move across."""
    given = Scene.model_validate(THREADED | NOT_CENTRED | others)
    assert Assembly(given).scene.edges == given.edges


@pytest.mark.parametrize(
    "path",
    [p if p.stem != "misaligned" else pytest.param(p, marks=pytest.mark.slow) for p in EXAMPLES],
    ids=lambda path: path.stem,
)
def test_examples_raise_no_false_alarm(path: Path) -> None:
    """The lines of the field are in ``test_forewarnings.py``."""
    assert told_of(Scene.load(path)) == []


def test_softest_motions_are_the_least_eigenvalues() -> None:
    """Of K x = μ M x, those of scipy, where M does not count some unknowns."""
    rng = np.random.default_rng(5)
    half = rng.normal(size=(12, 12))
    stiffness, metric = half @ half.T + np.eye(12), np.arange(12.0) % 3.0
    counted, rest = metric > 0.0, metric == 0.0
    across = stiffness[np.ix_(counted, rest)]
    condensed = stiffness[np.ix_(counted, counted)] - across @ np.linalg.solve(
        stiffness[np.ix_(rest, rest)], across.T
    )
    expected = eigh(condensed, np.diag(metric[counted]), eigvals_only=True)
    (least, motion), *_ = softest_motions(DenseSolver().factorise(stiffness), metric)
    assert least == pytest.approx(expected[0], rel=1e-2)
    assert stiffness @ motion == pytest.approx(least * metric * motion, abs=0.1 * least)


def test_a_run_begins_with_it_and_a_stop_repeats_it(tmp_path: Path) -> None:
    tables = FLAT | NOT_CENTRED
    tables["strip"] = {**FLAT["strip"], "cells": [4, 1]}
    run = Run(Scene.model_validate(tables), tmp_path / "results")
    assert list(run) or not run.outcome.done
    assert run.warnings == run.forewarnings()
    assert any("nothing holds the strip in y" in told for told in run.warnings)
    scene = tmp_path / "loose.toml"
    scene.write_text(
        "strip = { length = 4.0, width = 1.0, thickness = 1e-3, cells = [4, 1] }\n"
        'material = { young = 2e11, poisson = 0.3 }\nedges.entry.fixed = ["x", "z"]\n'
        '[[stages]]\nname = "pull"\nduration = 1.0\nexit.force = [1e4, 0.0, 0.0]\n',
        encoding="utf-8",
    )
    given = ["run", str(scene), "-o", str(tmp_path / "again"), "--no-report"]
    said = CliRunner().invoke(main, given).stderr
    assert said.startswith("Warning: in stage pull nothing holds the strip in y. Try --set edges.")


def test_a_sentence_begins_with_a_capital_letter_or_a_key_as_it_is_typed() -> None:
    assert as_sentence("the strip sags. Try") == "The strip sags. Try"
    assert as_sentence("stages.run.rollers.r1.torque pushes") == (
        "stages.run.rollers.r1.torque pushes"
    )
    assert as_sentence("done.") == "Done."
