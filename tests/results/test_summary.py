"""A summary is JSON for any reader."""

import json
from pathlib import Path

import numpy as np
import pytest

from anmstrip.results.files import write_summary


def refuse(constant):
    raise AssertionError(f"{constant} is not JSON")


def test_numbers_of_every_kind_become_plain_ones(tmp_path):
    summary = {
        "status": "done",
        "steps": np.int64(12),
        "seconds": np.float64(0.1) + 0.2,
        "contact": np.bool_(True),
        "centre": np.array([[0.0, 1.5], [np.nan, -np.inf]]),
        "ratio": float("inf"),
        "rollers": {"r1": {"drag": (1, None)}},
        "scene": Path("scenes") / "capstan.toml",
        3: "µ",
    }
    write_summary(tmp_path / "summary.json", summary)
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    assert json.loads(text, parse_constant=refuse) == {
        "status": "done",
        "steps": 12,
        "seconds": 0.1 + 0.2,
        "contact": True,
        "centre": [[0.0, 1.5], [None, None]],
        "ratio": None,
        "rollers": {"r1": {"drag": [1, None]}},
        "scene": "scenes/capstan.toml",
        "3": "µ",
    }


def test_what_is_not_json_leaves_the_old_summary(tmp_path):
    path = tmp_path / "summary.json"
    write_summary(path, {"steps": 1})
    with pytest.raises(TypeError):
        write_summary(path, {"steps": 2, "law": object()})
    assert json.loads(path.read_text()) == {"steps": 1}
