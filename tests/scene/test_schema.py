"""The tables of a scene: what they hold, what they say about themselves."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pydantic
import pytest
from pydantic import BaseModel, TypeAdapter

from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.scene import schema, tables
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import EDGE_NAMES, StageSpec, Table

CAPSTAN = Path(__file__).with_name("capstan.toml")
EXAMPLES = Path(__file__).parents[2] / "examples"
MODELS = [
    model
    for module in (schema, tables)
    for model in vars(module).values()
    if isinstance(model, type) and issubclass(model, Table) and model.__module__ == module.__name__
    if model is not Table
]
FIELDS = [(model, name) for model in MODELS for name in model.model_fields]


@pytest.fixture
def scene() -> Scene:
    return Scene.load(CAPSTAN)


def test_good_scene_is_read_as_written(scene: Scene) -> None:
    assert (scene.strip.length, scene.strip.cells) == (4.0, (16, 2))
    assert [roller.name for roller in scene.rollers] == ["r1"]
    assert [stage.name for stage in scene.stages] == ["tension", "wrap", "turn"]
    assert scene.stages[1].edges["entry"].move == (0.0, 0.0, -0.45)
    assert scene.stages[2].rollers["r1"].surface_speed == 1.0
    assert scene.edges["entry"].fixed == ("x", "z")
    assert (scene.friction.law, scene.solver.order, scene.output.every) == ("norton-hoff", 20, 1)
    assert (scene.source, scene.name) == (CAPSTAN, "capstan")


def test_scene_cannot_be_changed(scene: Scene) -> None:
    with pytest.raises(pydantic.ValidationError, match="frozen"):
        scene.strip.length = 5.0


@pytest.mark.parametrize("setting", ["output.times=[0.5, 1.0]", "solver.order=15"])
def test_scene_as_used_is_json_and_makes_the_same_scene(tmp_path: Path, setting: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(CAPSTAN.read_text(encoding="utf-8").replace("every = 1\n", ""), "utf-8")
    used = Scene.load(path, [setting]).to_dict()
    again = json.loads(json.dumps(used))
    assert again == used
    assert Scene.model_validate(again).to_dict() == used
    assert used["stages"][0]["exit"]["force"] == [1e4, 0.0, 0.0]


def test_scene_without_friction_says_so_as_used() -> None:
    tables = tomllib.loads(CAPSTAN.read_text(encoding="utf-8"))
    del tables["friction"]
    used = Scene.model_validate(tables).to_dict()
    assert [stage["friction"] for stage in used["stages"]] == [False, False, False]
    assert Scene.model_validate(used).to_dict() == used


def test_threaded_scene_as_used_makes_the_same_scene() -> None:
    tables = tomllib.loads((EXAMPLES / "misaligned.toml").read_text(encoding="utf-8"))
    scene = Scene.model_validate(tables)
    used = scene.to_dict()
    assert Scene.model_validate(used).to_dict() == used
    assert used["threading"]["entry"] == [-2.0, 0.0, -1.0]
    assert used["rollers"][0]["axis"] == [0.003, 1.0, 0.0]
    assert len(scene.course) == len(scene.stages) + 1
    assert [stage["name"] for stage in used["stages"]] == ["hold", "start", "run"]


def test_scene_made_in_python_is_checked_too() -> None:
    tables = tomllib.loads(CAPSTAN.read_text(encoding="utf-8"))
    tables["stages"][2]["rollers"] = {"r2": {"surface_speed": 1.0}}
    with pytest.raises(pydantic.ValidationError, match=r"stages\.turn\.rollers\.r2"):
        Scene.model_validate(tables)


@pytest.mark.parametrize(("model", "name"), FIELDS, ids=lambda it: getattr(it, "__name__", it))
def test_every_field_says_what_it_is_and_in_which_unit(model: type[BaseModel], name: str) -> None:
    description = tables.meanings(model)[name]
    assert description
    numeric = {"number", "integer", "direction", "time"}
    assert description.endswith(")") or not numeric & set(description.split())


@pytest.mark.parametrize(("model", "name"), FIELDS, ids=lambda it: getattr(it, "__name__", it))
def test_every_example_can_be_typed_as_it_stands(model: type[BaseModel], name: str) -> None:
    field = model.model_fields[name]
    (example,) = field.examples
    typed = example if model is SceneSpec and name != "title" else f"{name} = {example}"
    value = tomllib.loads(typed)[name]
    if name != "mesh":
        assert TypeAdapter(field.annotation).validate_python(_named(value)) is not None


def _named(value: object) -> object:
    tables = isinstance(value, list) and all(isinstance(table, dict) for table in value)
    return [{"name": "n", **table} for table in value] if tables else value


def test_keys_offered_in_a_stage_are_those_that_it_has() -> None:
    tables = tomllib.loads(CAPSTAN.read_text(encoding="utf-8"))
    tables["stages"][0]["xyz"] = 1.0
    with pytest.raises(InputError) as refused:
        Scene.from_tables(tables, CAPSTAN)
    (mistake,) = refused.value.mistakes
    keys = [key for key in StageSpec.model_fields if key != "edges"]
    assert mistake.key == "stages.tension.xyz"
    assert mistake.hint == f"one of: {', '.join((*keys, *EDGE_NAMES))}"


def test_unnamed_rollers_and_stages_are_numbered() -> None:
    tables = tomllib.loads(CAPSTAN.read_text(encoding="utf-8"))
    for table in (*tables["stages"], *tables["rollers"]):
        del table["name"]
    scene = Scene.model_validate(tables)
    assert [stage.name for stage in scene.stages] == ["stage1", "stage2", "stage3"]
    assert [roller.name for roller in scene.rollers] == ["r1"]
