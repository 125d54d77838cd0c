"""The table of an accuracy study, against runs of the same scenes by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from reported_files import rows_of
from scipy.interpolate import CubicHermiteSpline

from anmstrip import Scene, accuracy

PRESS = Path(__file__).parents[2] / "examples" / "press.toml"
COARSE = ['strip.kinematics="section"', "strip.finer=0.3", "solver.tolerance=1e-3"]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return a study of tolerances and meshes that has run."""
    out = tmp_path_factory.mktemp("study")
    return accuracy(Scene.load(PRESS, COARSE), ["tolerance", "mesh"], directory=out)


def final(*settings):
    """Run a scene and return its last state."""
    *_, step = Scene.load(PRESS, [*COARSE, *settings]).run()
    return step.state


def read(state):
    """Return tensions and forces as one reads them off by hand."""
    roller = state.rollers["r1"]
    tensions = state.tension("entry"), state.tension("exit"), roller.tension_in, roller.tension_out
    return np.array(tensions), np.array([roller.normal_force, roller.drag])


def places(state, x):
    """Return x and z displacements at places of the flat strip, from nodal values and slopes."""
    strip = state.plan.model.strip
    nodal = state.full[: strip.unknowns].reshape(-1, 2)
    values, slopes = (nodal[strip.basis.nodal_dofs[k]] for k in (0, 1))
    order = np.argsort(strip.mesh.p[0])
    return CubicHermiteSpline(strip.mesh.p[0, order], values[order], slopes[order])(x)


@pytest.mark.parametrize(
    ("along", "value", "own", "truth"),
    [
        ("tolerance", "0.01", ["solver.tolerance=1e-2"], ["solver.tolerance=1e-6"]),
        (
            "mesh",
            "0.5",
            ["solver.tolerance=1e-6", "strip.finer=0.15"],
            ["solver.tolerance=1e-6", "strip.finer=1.2"],
        ),
    ],
)
def test_true_errors_are_differences_of_two_runs(study, along, value, own, truth):
    rows = rows_of(study.table)
    (row,) = (row for row in rows if (row["along"], row["value"]) == (along, value))
    here, there = final(*own), final(*truth)
    for name, a, b in zip(("tension", "force"), read(here), read(there), strict=True):
        assert float(row[f"true_{name}"]) == pytest.approx(np.abs(a - b).max(), rel=1e-6)
    x = study.assembly.strip.mesh.p[0]
    away = np.linalg.norm(places(here, x) - places(there, x), axis=1).max()
    assert float(row["true_position"]) == pytest.approx(away, rel=1e-6)
    sizes = np.diff(np.sort(here.plan.model.strip.mesh.p[0]))
    assert float(row["element"]) == pytest.approx(sizes.min())
    assert int(row["unknowns"]) == here.plan.model.strip.unknowns


def test_costs_and_estimates_are_those_of_the_summaries(study):
    parts = {"tolerance": ("path", "time"), "mesh": ("mesh", "regularisation")}
    for row in rows_of(study.table):
        text = (study.directory / row["directory"] / "summary.json").read_text("utf-8")
        summary = json.loads(text)
        assert int(row["tangents"]) == summary["tangents"]
        spent = summary["wall_seconds"] - summary["seconds"]["errors"]
        assert float(row["seconds"]) == pytest.approx(spent)
        found = [summary["errors"][name] for name in parts[row["along"]]]
        for kind in ("tension", "force", "position"):
            told = sum(part[kind] for part in found if part is not None)
            assert float(row[f"estimated_{kind}"]) == pytest.approx(told, abs=1e-300)


def test_the_advice_is_that_of_the_rows(study):
    rows = rows_of(study.table)
    error = {(r["along"], float(r["value"])): float(r["true_tension"]) for r in rows}
    tension = 1e4 * float(np.hypot(1.0, 0.57735))
    share = 100.0 * (error["tolerance", 1e-3] + error["mesh", 1.0]) / tension
    advice = study.advice()
    assert advice.startswith("A tolerance of 0.001 on 0.083 m gives tensions to ")
    assert float(advice.partition("tensions to ")[2].split()[0]) == pytest.approx(share, rel=0.05)
    spent = {(r["along"], float(r["value"])): float(r["seconds"]) for r in rows}
    own = spent["tolerance", 1e-3], spent["mesh", 1.0]
    costs = [
        spent["tolerance", t] / own[0] * spent["mesh", m] / own[1]
        for t in (1e-3, 1e-4, 1e-5)
        for m in (0.25, 0.5, 1.0, 2.0)
        if error["tolerance", t] + error["mesh", m] <= 1e-3 * share * tension
    ]
    assert float(advice.partition("costs about ")[2].split()[0]) == pytest.approx(
        min(costs), rel=0.05
    )
