"""Reports: their numbers are those of the files, and a browser draws all of them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from anmstrip.cli import main
from anmstrip.driver.sweep import Sweep
from anmstrip.errors import InputError
from anmstrip.pictures.report import MAX_TIMES, PLOT_DIGITS, html_tables, write_report
from anmstrip.results.files import read_history
from anmstrip.results.vtk import read_surface
from browser import shown

SCENE = Path(__file__).parents[2] / "examples" / "capstan.toml"
COARSE = ("strip.refined=0.1", "solver.tolerance=1e-3", 'title="A strip & <a roller>"')


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Directory of a run that ended with its report, and what it printed."""
    folder = tmp_path_factory.mktemp("report") / "run"
    settings = [part for text in COARSE for part in ("--set", text)]
    done = CliRunner().invoke(main, ["run", str(SCENE), "-o", str(folder), "--quiet", *settings])
    assert done.exit_code == 0, done.output
    return folder, done.output


def data_of(folder: Path) -> dict[str, Any]:
    text = (folder / "report.html").read_text("utf-8")
    (found,) = re.findall(r'id="data">(.*?)</script>', text, re.DOTALL)
    data: dict[str, Any] = json.loads(found)
    return data


def close(found: list[float | None], expected: Any) -> bool:
    """Whether numbers are the same to the digits of a report, and are missing together."""
    values = np.array([np.nan if v is None else v for v in found])
    return bool(
        np.allclose(values, expected, rtol=10.0 ** (1 - PLOT_DIGITS), atol=0.0, equal_nan=True)
    )


def test_plots_are_those_of_the_files(finished: tuple[Path, str]) -> None:
    folder, printed = finished
    assert f"Report in {folder / 'report.html'}." in printed
    data, profile = data_of(folder), read_history(folder / "profile.csv")
    times = np.asarray(profile["time"])
    assert 2 < len(data["along"]) <= MAX_TIMES
    for one in data["along"]:
        rows = np.isclose(times, one["time"], rtol=1e-4, atol=0.0)
        first = np.flatnonzero(rows)[0]
        rows &= times == times[first]
        for name, values in one["columns"].items():
            assert close(values, np.asarray(profile[name])[rows]), name
    history = read_history(folder / "history.csv")
    assert set(data["over"]) == set(history) - {"stage"}
    for name, values in data["over"].items():
        assert close(values, history[name]), name


def test_space_is_that_of_the_last_state(finished: tuple[Path, str]) -> None:
    folder, _ = finished
    space = data_of(folder)["space"]
    surface = read_surface(sorted(folder.glob("strip_*.vtu"))[-1])
    points = np.transpose([space[axis] for axis in "xyz"])
    assert np.abs(points - surface.points).max() < 1e-4
    triangles = np.transpose([space[axis] for axis in "ijk"])
    sides = points[triangles[:, 1:]] - points[triangles[:, :1]]
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum()
    assert area == pytest.approx(4.0, rel=1e-3)  # of a strip of 4 m by 1 m
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    pairs, shared = np.unique(pairs, axis=0, return_counts=True)
    rim = pairs[shared == 1]  # sides that belong to one triangle alone
    around = np.linalg.norm(np.diff(points[rim], axis=1), axis=2).sum()
    assert around == pytest.approx(10.0, rel=1e-3)
    assert close(space["fields"]["normal_pressure"]["values"], surface.fields["normal_pressure"])
    slip = np.linalg.norm(surface.fields["slip_velocity"], axis=1)
    assert close(space["fields"]["slip_velocity"]["values"], slip)
    assert len(space["rollers"]["tones"]) == len(space["rollers"]["i"])


def test_bends_of_strip_that_yields_have_their_table() -> None:
    """Of rollers that bend it; a section has no crossbow."""
    bend = {
        "curvature": -6.2, "moment": -75.0, "plastic_share": 0.523, "curl_on_roller": -2.1,
        "crossbow_on_roller": None, "curl": 0.3, "crossbow": None,
        "elongation": 2.75e-4, "yield_power": 149.5,
    }  # fmt: skip
    rollers, bends = html_tables(
        {"rollers": {"u1": {"wrap": 0.1, "bend": bend}, "l3": {"bend": None}}}
    )
    assert "<td>l3</td>" in rollers and "<td>l3</td>" not in bends
    cells = ["u1", "-6.2", "-75", "52.3", "-2.1", "–", "0.3", "–", "0.000275", "149.5"]
    assert "".join(f"<td>{cell}</td>" for cell in cells) in bends
    assert "<th>crossbow behind (1/m)</th>" in bends


def test_tables_are_those_of_the_summary(finished: tuple[Path, str]) -> None:
    folder, _ = finished
    summary = json.loads((folder / "summary.json").read_text("utf-8"))
    page = (folder / "report.html").read_text("utf-8")
    assert "<h1>A strip &amp; &lt;a roller&gt;</h1>" in page
    roller = summary["rollers"]["r1"]
    shown = (np.degrees(roller["wrap"]), *(roller[k] for k in ("tension_in", "tension_out")))
    cells = "".join(f"<td>{value:.6g}</td>" for value in shown)
    assert f"<td>r1</td>{cells}" in page
    assert f"<td>{100.0 * roller['capacity_used']:.6g}</td>" in page
    assert summary["message"] in page
    for warning in summary["warnings"]:
        assert warning.replace("<", "&lt;") in page
    assert (folder / "report.html").stat().st_size <= 8e6
    assert not re.findall(r'(?:src|href)="(?!data:)', page.partition("<script>")[0])


FLAT = """
[strip]
length = 1.0
width = 1.0
thickness = 1.0e-3
cells = [4, 1]
kinematics = "section"
[material]
young = 2.0e11
poisson = 0.3
[edges.entry]
fixed = ["x", "z"]
[edges.exit]
fixed = ["z"]
[[stages]]
duration = 1.0
exit.force = [1.0e3, 0.0, 0.0]
"""
"""A scene of some milliseconds."""


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory of a sweep along three lengths and two materials, with reports of two scenes."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "flat.toml").write_text(FLAT)
    varied = "strip.length=1:3:3", "material.young=1e11,2e11"
    sweep = Sweep(folder / "flat.toml", varied, directory=folder / "out")
    for _ in sweep.run():
        pass
    sweep.draw()
    for row in sweep.rows[:2]:
        write_report(folder / "out" / row["directory"])
    done = CliRunner().invoke(main, ["report", str(folder / "out")])
    assert done.output.strip() == str(folder / "out" / "report.html")
    return folder / "out"


def test_report_of_a_sweep_is_that_of_its_table(swept: Path) -> None:
    study, rows = data_of(swept)["study"], read_history(swept / "sweep.csv")
    assert study["over"][:2] == ["strip.length", "material.young"]
    assert study["found"][0] == "entry_tension"
    assert close(study["columns"]["strip.length"], [1.0, 1.0, 2.0, 2.0, 3.0, 3.0])
    for name in ("entry_tension", "tangents", "wall_seconds"):
        assert close(study["columns"][name], rows[name]), name
    assert study["groups"] == 3 * ["100000000000.0", "200000000000.0"]
    page = (swept / "report.html").read_text("utf-8").partition("<script>")[0]
    assert "<p>6 of 6 scenes done.</p>" in page
    assert page.count('src="data:image/png;base64,') == 1
    links = re.findall(r'<a href="([^"]*)"', page)
    assert len(links) == 2
    assert all((swept / link).is_file() for link in links)


def test_report_of_a_study_of_which_nothing_has_ended(tmp_path: Path) -> None:
    (tmp_path / "accuracy.csv").write_text("along,value,tolerance,seconds\nmesh,0.5,,\n")
    write_report(tmp_path)
    study = data_of(tmp_path)["study"]
    assert (study["over"], study["found"]) == (["along", "value"], [])


@pytest.mark.slow
def test_a_browser_draws_a_study(swept: Path, tmp_path: Path) -> None:
    page = shown((swept / "report.html").as_uri(), tmp_path)
    assert 'data-drawn="yes"' in page  # the script came to its end
    (lines,) = re.findall(r'<div id="curves" class="plot.*?</section>', page, re.DOTALL)
    assert lines.count('class="trace scatter') == 2
    assert page.count('hidden=""') == 4  # nothing of a run


@pytest.mark.slow
def test_a_browser_draws_everything_of_a_run(finished: tuple[Path, str], tmp_path: Path) -> None:
    page = shown((finished[0] / "report.html").as_uri(), tmp_path)
    assert 'data-drawn="yes"' in page  # the script came to its end
    for plot in ("along", "over"):
        (lines,) = re.findall(rf'<div id="{plot}" class="plot.*?<h2>', page, re.DOTALL)
        assert 'class="js-line"' in lines
        assert len(re.findall(r'class="point"', lines)) > 10
    assert re.search(r'<div id="space".*?<canvas', page, re.DOTALL)
    assert page.count("<option") > 20


def test_a_run_that_goes_on_has_a_report_and_one_without_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="history"):
        write_report(tmp_path)
    (tmp_path / "history.csv").write_text("stage,time,entry_tension\nturn,1.0,2.5\n")
    assert write_report(tmp_path).is_file()
    data = data_of(tmp_path)
    assert data["over"] == {"time": [1.0], "entry_tension": [2.5]}
    assert data["space"] is None
    assert not data["along"]


def test_the_report_can_be_left_out(tmp_path: Path) -> None:
    scene = tmp_path / "flat.toml"
    scene.write_text(FLAT)
    out = str(tmp_path / "out")
    done = CliRunner().invoke(main, ["run", str(scene), "-o", out, "--quiet", "--no-report"])
    assert done.exit_code == 0, done.output
    assert not (tmp_path / "out" / "report.html").exists()
    done = CliRunner().invoke(main, ["report", out])
    assert done.output.strip() == str(tmp_path / "out" / "report.html")
