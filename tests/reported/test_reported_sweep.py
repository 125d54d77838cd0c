"""The table of a sweep, against the files of its scenes and statics."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import reported_scenes as scenes
from reported_files import rows_of, typed_apart

pytest.importorskip("distributed", reason="dask is not installed")


@pytest.mark.slow
def test_rows_are_what_the_scenes_left(tmp_path: Path) -> None:
    """Twice the width carries twice the force under the same tension; a scene is done or not."""
    scene = tmp_path / "plate.toml"
    scene.write_text(scenes.PLATE, encoding="utf-8")
    out = tmp_path / "out"
    ended = typed_apart(
        "sweep", scene, "-o", out, "--vary", "strip.width=0.4,0.8", "--workers", 1,
        "--set", "output.every=1000", "--set", "solver.tolerance=1e-4",
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    assert "2 of 2 scenes done." in ended.stdout
    rows = rows_of(out / "sweep.csv")
    assert [row["strip.width"] for row in rows] == ["0.4", "0.8"]
    for row in rows:
        summary = json.loads((out / row["directory"] / "summary.json").read_text("utf-8"))
        assert float(row["strip.width"]) == summary["input"]["strip"]["width"]
        for key in ("status", "message"):
            assert row[key] == summary[key]
        for key in ("steps", "tangents", "wall_seconds"):
            assert float(row[key]) == summary[key]
        for edge in ("entry", "exit"):
            assert float(row[f"{edge}_tension"]) == summary["edges"][edge]["tension"]
            assert float(row[f"{edge}_tension"]) == pytest.approx(1.0e4, rel=1e-3)
        for key, value in summary["rollers"]["r1"].items():
            if key != "regularisation_effect":
                found = row[f"r1_{key}"]  # empty of what there is not: no friction, no share of it
                assert (float(found) if found else None) == value
        for key, value in summary["rollers"]["r1"]["regularisation_effect"].items():
            assert float(row[f"r1_regularisation_effect_{key}"]) == value
        line = f"{row['directory']} done in {float(row['wall_seconds']):.1f} s"
        assert line in ended.stderr
    forces = [float(row["r1_normal_force"]) for row in rows]
    # a plate of twice the width bends across a little otherwise
    assert forces[1] == pytest.approx(2.0 * forces[0], rel=0.02)
    assert "1 of 2 scenes, " in ended.stderr
    assert "2 of 2 scenes, " in ended.stderr
