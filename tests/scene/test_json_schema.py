"""The JSON schema of scene files, by a validator that knows nothing of this program."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from anmstrip.cli import main

ROOT = Path(__file__).parent.parent.parent
SCENES = sorted([*(ROOT / "examples").glob("*.toml"), *(ROOT / "tests" / "field").glob("*.toml")])


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    printed = CliRunner().invoke(main, ["schema"])
    schema = json.loads(printed.output)
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def test_every_scene_of_the_repository_is_accepted(validator: Draft202012Validator) -> None:
    assert len(SCENES) > 40
    for path in SCENES:
        assert not [*validator.iter_errors(tomllib.loads(path.read_text("utf-8")))], path.name


@pytest.mark.parametrize(
    ("table", "change", "told"),
    [
        ("strip", {"lenght": 1.0}, "lenght"),
        ("strip", {"thickness": -1.0}, "-1.0"),
        ("material", {"poisson": 0.5}, "0.5"),
        ("stages", [{"name": "a", "duration": -1.0}], "-1.0"),
        ("stages", [{"duration": 1.0, "exit": {"forse": [1.0, 0.0, 0.0]}}], "forse"),
        ("rollers", [{"centre": [0.0, 0.0, 0.0]}], "radius"),
    ],
)
def test_mistakes_are_found(
    validator: Draft202012Validator, table: str, change: Any, told: str
) -> None:
    scene = tomllib.loads((ROOT / "examples" / "capstan.toml").read_text("utf-8"))
    assert validator.is_valid(scene)
    scene[table] = {**scene[table], **change} if isinstance(change, dict) else change
    assert told in " ".join(error.message for error in validator.iter_errors(scene))
