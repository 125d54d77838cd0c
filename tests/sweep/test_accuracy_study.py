"""Studies of what accuracy costs: what can be varied, interruptions, and Newton's method beside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from anmstrip.cli import main
from anmstrip.driver import accuracy as module
from anmstrip.driver import sweep as sweeps
from anmstrip.driver.accuracy import Accuracy, list_trials
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.simulation.problem import Assembly

EXAMPLES = Path(__file__).parents[2] / "examples"
SECTION = 'strip.kinematics="section"'
TINY = [SECTION, "strip.finer=0.3", "solver.tolerance=1e-3"]


def tiny(*settings: str) -> Scene:
    """A strip pressed on a roller, about a quarter of a second."""
    return Scene.load(EXAMPLES / "press.toml", [*TINY, *settings])


def typed(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["accuracy", *map(str, arguments)])


def axes(scene: Scene) -> dict[str, list[float | str]]:
    """Values that a scene is compared for, by what is varied."""
    found: dict[str, list[float | str]] = {}
    for trial in list_trials(Run(scene).assembly, scene):
        found.setdefault(trial.along, []).append(trial.value)
    return found


def test_what_applies_to_a_scene_is_varied() -> None:
    found = axes(tiny())
    assert found["tolerance"] == found["newton"] == [1e-2, 1e-3, 1e-4, 1e-5]
    assert found["mesh"] == [0.25, 0.5, 1.0, 2.0]
    assert found["kinematics"] == ["section"]  # beside the shell
    assert "speed" not in found  # nothing rubs
    shell = axes(Scene.load(EXAMPLES / "capstan_mesh.toml"))
    assert not {"mesh", "speed", "kinematics"} & set(shell)  # a file; Norton and Hoff; a file
    smooth = axes(Scene.load(EXAMPLES / "capstan.toml", ['friction.law="algebraic"']))
    assert smooth["speed"] == pytest.approx([10.0, 1.0, 0.1])
    assert smooth["mesh"] == [0.5, 1.0]


@pytest.mark.slow
def test_the_largest_run_is_told_beside_the_scene(tmp_path: Path) -> None:
    """By the unknowns of both strips; those of layers of the scene were counted as well."""
    scene = Scene.load(EXAMPLES / "leveller.toml")
    study = Accuracy(scene, ["mesh"], directory=tmp_path)
    largest = max(float(variant.values["unknowns"]) for variant in study.variants)
    times = largest / Run(scene).assembly.strip.unknowns
    assert times > 1.5 and f"the largest has {times:.2g} times" in study.plan


def test_a_section_that_is_loose_as_a_shell_is_not_run_as_one() -> None:
    loose = Scene.load(EXAMPLES / "heavy.toml", ["edges.entry.centred=false"])
    assert "kinematics" not in axes(loose)


@pytest.mark.parametrize(
    ("along", "words"), [("speed", 'law = "algebraic"'), ("width", "--along tolerance")]
)
def test_what_does_not_apply_is_refused(tmp_path: Path, along: str, words: str) -> None:
    with pytest.raises(InputError) as told:
        Accuracy(tiny(), [along], directory=tmp_path / "out")
    assert words in str(told.value)
    assert "what this scene can be varied along: tolerance, newton, order, mesh" in str(told.value)
    assert not (tmp_path / "out").exists()


def test_an_interrupted_study_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Finished rows are kept, and are not run again; the truth is known first."""
    monkeypatch.setattr(module, "COMPARED_TOLERANCES", (1e-2, 1e-3))
    study = Accuracy(tiny(), ["tolerance"], directory=tmp_path)
    assert "3 runs along tolerance, 3 of them still to do" in study.plan
    steps = study.run()
    next(steps), next(steps)
    steps.close()
    known = [row for row in study.results() if "true_tension" in row]
    assert [row["value"] for row in known] == [1e-2]
    assert "No advice" in study.advice()
    again = Accuracy(tiny(), ["tolerance"], directory=tmp_path)
    assert "1 of them still to do" in again.plan
    assert [ended.row["directory"] for ended in again.run()] == ["as_given"]
    assert len([row for row in again.results() if "true_tension" in row]) == 2
    assert ", errors of the mesh left out; " in again.advice()


def test_a_looser_tolerance_is_not_proposed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though its error is smaller, as that of a short stage may happen to be."""
    study = Accuracy(tiny(), ["tolerance"], directory=tmp_path)
    given = {"along": "tolerance", "element": 0.1, "seconds": 1.0, "tangents": 10}
    errors = {1e-2: 1e-3, study.scene.solver.tolerance: 1.0, 1e-6: 1e-2}
    rows = [{**given, "value": value, "true_tension": error} for value, error in errors.items()]
    monkeypatch.setattr(study, "results", lambda: iter(rows))
    assert "a tenth of that, by a tolerance of 1e-06" in study.advice()


@pytest.mark.parametrize("tension", [5.0, 2e4])
def test_errors_are_shares_of_the_largest_tension(
    tension: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where jaws pull more than the scene says; Newton's method may come to another state."""
    study = Accuracy(tiny(), ["tolerance", "newton"], directory=tmp_path)
    own, scale = study.scene.solver.tolerance, study.assembly.scales.tension
    values = {"tension": {"entry": -tension, "exit": 0.5 * tension}, "force": {}}
    monkeypatch.setattr(study, "final", lambda _: module.Final(values, np.zeros((3, 1)), {}))
    given = {"element": 0.1, "seconds": 1.0, "tangents": 10, "value": own}
    rows = [
        {**given, "along": "tolerance", "true_tension": 10.0},
        {**given, "along": "newton", "true_tension": 0.2 * study.tension},
    ]
    monkeypatch.setattr(study, "results", lambda: iter(rows))
    assert study.tension == max(tension, scale)
    assert f"gives tensions to {1000.0 / study.tension:.2g} %" in study.advice()
    assert "Newton's method comes to another state" in study.advice()
    rows[1]["true_tension"] = 0.05 * study.tension
    assert "Newton's method takes 1 times" in study.advice()


def test_scenes_that_stop_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "COMPARED_TOLERANCES", (1e-3,))
    study = Accuracy(tiny("solver.max_tangents=3"), ["tolerance"], directory=tmp_path)
    assert len(list(study.run())) == 2
    assert {row["status"] for row in study.results()} == {"too_many_tangents"}
    assert "No advice" in study.report()
    assert study.draw().stat().st_size > 5000


def test_the_command_without_dask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without dask the scenes run in the process itself; Newton's method has the same equations."""
    monkeypatch.setattr("anmstrip.cli.find_spec", lambda _: None)
    monkeypatch.setattr(module, "COMPARED_TOLERANCES", (1e-3,))
    options = ("--set", SECTION, "--set", "strip.finer=0.3", "--set", "solver.tolerance=1e-3")
    done = typed(
        EXAMPLES / "press.toml", "-o", tmp_path, *options,
        "--along", "tolerance", "--along", "newton", "--quiet",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "3 runs along tolerance, newton, 3 of them still to do" in done.output
    assert "Newton's method takes" in done.output
    assert (tmp_path / "accuracy.png").stat().st_size > 5000
    rows = {row["along"]: row for row in Accuracy(
        Scene.load(EXAMPLES / "press.toml", [*TINY]), ["tolerance", "newton"], directory=tmp_path
    ).results()}  # fmt: skip
    assert rows["newton"]["true_tension"] < 1e-3 * 1.2e4
    assert rows["newton"]["tangents"] > 2 * rows["tolerance"]["tangents"]


def test_workers_of_dask_do_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="dask is not installed")
    monkeypatch.setattr(module, "COMPARED_TOLERANCES", (1e-3,))
    study = Accuracy(tiny(), ["tolerance"], directory=tmp_path)
    with sweeps.local_workers(1) as client:
        assert len(list(study.run(client))) == 2
    assert all("true_tension" in row for row in study.results())


def test_levels_that_a_scene_cannot_have_are_left_out() -> None:
    """An endless strip is a section; its other comparisons are there."""
    scene = Scene.load(Path(__file__).parents[2] / "examples" / "belt.toml")
    along = {trial.along for trial in list_trials(Assembly(scene), scene)}
    assert "kinematics" not in along
    assert {"tolerance", "mesh", "speed"} <= along
