"""The interface of Python: columns, short representations, input errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import anmstrip
from anmstrip import InputError, Scene
from anmstrip.cli import main
from anmstrip.continuation.path import Outcome
from anmstrip.driver.recorder import history_row
from anmstrip.results.files import read_history

TABLES: dict[str, Any] = {
    "strip": {"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 2]},
    "material": {"young": 2e11, "poisson": 0.3},
    "edges": {
        "entry": {"fixed": ["x", "z"], "centred": True},
        "exit": {"fixed": ["z"], "centred": True},
    },
    "stages": [{"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}],
    "solver": {"tolerance": 1e-6},
}


def test_columns_along_a_stretched_strip_and_over_time() -> None:
    run = Scene(**TABLES).run()
    *_, step = run
    s = step.state.along("arc_length")
    assert np.allclose(s, np.linspace(0.0, 4.0, len(s)))
    assert np.allclose(step.state.along("tension"), 1e4, rtol=1e-6)
    assert np.isnan(step.state.along("slip")).all()  # nothing touches
    with pytest.raises(KeyError, match="tension"):
        step.state.along("tensoin")
    assert run.history["exit_tension"][-1] == pytest.approx(1e4, rel=1e-6)
    assert run.history["stage"] == ["stage1"] * step.step
    for thing in (run, step, step.state, run.scene):
        assert len(repr(thing)) < 100, repr(thing)


def test_an_unknown_name_is_answered_with_the_nearest(tmp_path: Path) -> None:
    scene = Scene.load(Path(__file__).parents[2] / "examples/capstan.toml")
    run = scene.run(tmp_path)
    state = next(iter(run)).state
    tables = state.rollers, state.contacts, state.regularisation
    for ask in (state.tension, state.edge_force, state.pull_direction):
        with pytest.raises(KeyError, match="no 'exti' here: exit"):
            ask("exti")
    for table in tables:
        with pytest.raises(KeyError, match="no 'r9' here: one of: r1"):
            table["r9"]
    with pytest.raises(KeyError, match="no 'tensions' here: tension"):
        state.along("tensions")
    with pytest.raises(KeyError, match="no 'r1_darg' here: r1_drag"):
        run.history["r1_darg"]


def test_a_state_is_told_within_its_step_only() -> None:
    *_, step = Scene(**TABLES).run()
    assert step.state.at(0.5, None).time == 0.5
    for outside in (-0.1, 1.5):
        with pytest.raises(ValueError, match="is not from 0 to 1 s"):
            step.state.at(outside, None)


def test_one_setting_need_not_stand_in_a_list() -> None:
    """Letter by letter it made 25 mistakes."""
    path = Path(__file__).parents[2] / "examples/capstan.toml"
    scene = Scene.load(path, "friction.coefficient=0.25")
    assert scene == Scene.load(path, ["friction.coefficient=0.25"])


def test_a_written_run_has_the_columns_of_its_files(tmp_path: Path) -> None:
    released = {"duration": 1.0, "exit": {"force": [5e3, 0.0, 0.0]}}
    tables = {**TABLES, "stages": [*TABLES["stages"], released]}
    run = Scene(**tables).run(tmp_path)
    *_, step = run
    profile = read_history(tmp_path / "profile.csv")
    last = np.asarray(profile["time"]) == step.time
    for name, values in step.state.profile.items():
        assert np.array_equal(np.asarray(profile[name])[last], values, equal_nan=True), name
    unwritten = Scene(**tables).run()
    *_, _ = unwritten
    assert run.history["stage"] == unwritten.history["stage"]
    for name in ("time", "tangents", "entry_tension", "residual"):
        assert np.array_equal(run.history[name], unwritten.history[name]), name


def test_rows_of_a_run_without_files_are_read_when_they_are_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Or when too many states wait: here each of them at once."""
    asked: list[object] = []

    def counted(*given: Any) -> dict[str, Any]:
        asked.append(given)
        return history_row(*given)

    monkeypatch.setattr("anmstrip.driver.run.history_row", counted)
    histories = []
    for unread in (1_000_000, 0):
        monkeypatch.setattr("anmstrip.driver.run.MAX_WAITING_UNKNOWNS", unread)
        asked.clear()
        run = Scene(**TABLES).run()
        *_, step = run
        assert len(asked) == (0 if unread else step.step)
        histories.append(run.history)
        assert len(asked) == len(run.history["time"]) == step.step
    assert histories[0].keys() == histories[1].keys()
    for name, column in histories[0].items():
        if name != "stage":
            np.testing.assert_allclose(column, histories[1][name], rtol=1e-12, atol=1e-9)


def test_a_run_that_is_left_has_not_ended() -> None:
    run = Scene(**TABLES).run()
    for _ in run:
        break
    assert (run.outcome, run.message) == (Outcome.NOT_ENDED, "The run has not ended.")


def test_mistakes_from_python_are_those_of_a_file() -> None:
    strip = {"lenght": 4.0, "width": 1.0, "thickness": -1.0}
    with pytest.raises(InputError) as caught:
        Scene(**{**TABLES, "strip": strip})
    told = str(caught.value)
    assert {m.key for m in caught.value.mistakes} >= {"strip.thickness", "strip.lenght"}
    assert "length (the nearest known one)" in told
    assert "pydantic" not in told


def test_mistakes_between_tables_are_told_beside_those_within(tmp_path: Path) -> None:
    """What pydantic hides: a roller that no stage knows, beside a wrong table."""
    stages = [{"duration": 1.0, "rollers": {"r9": {"surface_speed": 1.0}}}]
    tables = {**TABLES, "stages": stages, "material": {"young": -1.0, "poisson": 0.3}}
    with pytest.raises(InputError) as caught:
        Scene(**tables)
    keys = " ".join(m.key for m in caught.value.mistakes)
    assert "material.young" in keys
    assert "r9" in keys


def test_the_package_has_a_version_and_types() -> None:
    assert anmstrip.__version__.count(".") == 2
    assert (Path(anmstrip.__file__).parent / "py.typed").is_file()


def test_tables_may_come_from_generators() -> None:
    """They ended in a TypeError of the program itself."""
    stages = (dict(stage) for stage in TABLES["stages"])
    cells = {**TABLES["strip"], "cells": map(int, "84")}
    made = Scene(**{**TABLES, "strip": cells, "stages": stages, "rollers": {}.values()})
    assert made == Scene(**{**TABLES, "strip": {**TABLES["strip"], "cells": [8, 4]}})


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda path: Scene.load(path, [3]), InputError, "KEY=VALUE"),
        (lambda path: Scene.load(path, 3), TypeError, "a list of texts; given overrides=3"),
        (lambda path: Scene.load(None), TypeError, "a path, .* given path=None"),
        (lambda path: Scene.from_tables(3, path), TypeError, "a dict; given tables=3"),
        (lambda path: Scene.load(path).map(3), InputError, "KEY=first:last"),
        (lambda path: Scene.load(path).run(3), TypeError, "a path, .* given directory=3"),
        (lambda path: Scene(**{**TABLES, "stages": [{3: 4}]}), InputError, "a known key"),
        (lambda path: Scene(**{**TABLES, "rollers": {1, 2}}), InputError, "a list of tables"),
        (
            lambda path: anmstrip.accuracy(Scene.load(path), 3, directory="results"),
            TypeError,
            "a list of texts; given along=3",
        ),
    ],
)
def test_values_of_a_wrong_type_are_told(call: Any, kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=words):
        call(Path(__file__).parents[2] / "examples/bridle_map.toml")


@pytest.mark.parametrize("begin", ["run", "map"])
def test_results_that_cannot_be_written_are_wrong_input(begin: str, tmp_path: Path) -> None:
    """A map was followed to its end before, and either ended in an OSError."""
    scene = Scene.load(Path(__file__).parents[2] / "examples/bridle_map.toml")
    taken = tmp_path / "taken"
    taken.write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="a directory that can be made and written") as caught:
        if begin == "run":
            scene.run(taken / "results")
        else:
            scene.map("rollers.lower.surface_speed=0.99996:1.00004", directory=taken)
    assert caught.value.mistakes[0].file.startswith(str(taken))


def test_a_path_in_the_place_of_a_scene_is_told_how_to_be_loaded() -> None:
    with pytest.raises(TypeError, match=r"as Scene.load\('line.toml'\) returns"):
        anmstrip.Run("line.toml")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"as Scene.load\('line.toml'\) returns"):
        anmstrip.accuracy("line.toml", directory="results")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("ways", "told"),
    [
        ({"resume": True}, "the directory of the run"),
        ({"effects": [lambda: None]}, "functions of the strip"),
        ({"effects": [3]}, "functions of the strip"),
    ],
)
def test_runs_that_cannot_be_made_are_input_errors(ways: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        list(Scene(**TABLES).run(**ways))


@pytest.mark.parametrize(
    "line",
    [
        ["run", "{}", "-o", ""],
        ["explain", "{}", "--picture", ""],
        ["sweep", "{}", "--vary", "strip.width=1:1:3"],
    ],
)
def test_options_without_a_meaning_are_wrong_input(line: list[str]) -> None:
    scene = str(Path(__file__).parents[2] / "examples" / "capstan.toml")
    found = CliRunner().invoke(main, [part.format(scene) for part in line])
    assert found.exit_code == 2, found.output
    assert "expected" in found.output
