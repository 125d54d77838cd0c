"""The macro for ParaView, run by ParaView itself on what a run has written."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from anmstrip import Scene
from anmstrip.results.vtk import read_collection, read_surface

ROOT = Path(__file__).parents[2]

MACRO = """
import json
exec(open("docs/paraview_macro.py").read())
from paraview.simple import GetDisplayProperties, GetSources, servermanager
told, sources = {}, {name: source for (name, _), source in GetSources().items()}
computed = sources.pop("rollers as computed")
for name, source in sources.items():
    display = GetDisplayProperties(source, view)
    field = display.ColorArrayName[1]
    lowest, highest = source.PointData[field].GetRange()
    times = (computed if name.startswith("rollers") else source).TimestepValues
    told[name] = [display.Visibility, field, lowest, highest, list(times)]
rollers = [servermanager.Fetch(s) for s in (computed, sources["rollers by surface_angle"])]
points = [[s.GetPoint(k) for k in range(s.GetNumberOfPoints())] for s in rollers]
print("TOLD", json.dumps([view.ViewTime, told, *points]))
"""
"""Runs the macro and tells what ParaView then shows."""

SERVER = ("xvfb-run", "-a", "-s", "-noreset -screen 0 1400x900x24")
"""A display for a ParaView that needs one; ``-noreset`` as it connects more than once."""


@pytest.mark.slow
def test_macro_opens_a_run_in_paraview(tmp_path: Path) -> None:
    if not (shutil.which("pvbatch") and shutil.which("xvfb-run")):
        pytest.skip("needs pvbatch of ParaView, and xvfb-run")
    coarse = ['strip.kinematics="section"', "strip.refined=0.1"]
    for _ in Scene.load(ROOT / "examples" / "capstan.toml", coarse).run(tmp_path / "run"):
        pass
    (tmp_path / "macro.py").write_text(MACRO, encoding="utf-8")
    done = subprocess.run(
        [*SERVER, "pvbatch", str(tmp_path / "macro.py")],
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
        cwd=ROOT,
        env=os.environ | {"ANMSTRIP_RUN": str(tmp_path / "run"), "ANMSTRIP_SCREENSHOT": "1"},
    )
    assert "ERR|" not in done.stderr
    time, told, full, inset = json.loads(done.stdout.partition("TOLD ")[2])
    entries = read_collection(tmp_path / "run" / "strip.pvd")
    assert time == pytest.approx(entries[-1].time)
    moved, size = np.subtract(inset, full), np.linalg.norm(np.ptp(full, axis=0))
    normal = read_surface(tmp_path / "run" / entries[-1].file.replace("strip", "rollers")).fields
    assert np.allclose(moved, -5e-4 * size * normal["normal"], rtol=1e-3, atol=1e-6)
    surface = read_surface(tmp_path / "run" / entries[-1].file)
    names = ("strip by tension", "strip by contact_status", "rollers by surface_angle")
    assert set(told) == set(names)
    for name, shown in zip(names, (1, 0, 1), strict=True):
        visible, field, lowest, highest, times = told[name]
        assert (visible, field) == (shown, name.split()[-1])
        assert np.allclose(times, [entry.time for entry in entries])
        if field in surface.fields:
            values = surface.fields[field]
            assert (lowest, highest) == pytest.approx((values.min(), values.max()), rel=1e-5)
    picture = imread(tmp_path / "run" / "paraview.png")
    assert picture.shape[:2] == (800, 1400)
    background = np.abs(picture - picture[0, 0]).max(axis=2) < 0.02
    assert 0.1 < 1.0 - background.mean() < 0.9  # of the view is strip, rollers and colour bar
