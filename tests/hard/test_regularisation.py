"""What regularised laws cost in truth: reported, an estimate of the error, and sharpened away."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene, SharpenedRun
from anmstrip.errors import InputError
from anmstrip.results.rollers import Regularisation
from hard_strips import LAY, PULL, end_of, ran, tables_of, turning


def capstan(**law: Any) -> dict[str, Any]:
    tables = tables_of(PULL, LAY, turning(duration=0.4), refined=0.1)
    tables["friction"] |= law
    tables["solver"]["tolerance"] = 1e-3
    return tables


def ratio_of(run: Run) -> float:
    ratio = end_of(run).rollers["r1"].tension_ratio
    assert ratio is not None
    return ratio


def test_friction_beyond_the_cone_is_the_error_of_the_tension() -> None:
    """Norton and Hoff's law at a hundred times V_c, beside V_c, where it is f."""
    exact, _ = ran(capstan(speed=1.0, omega=1e-3))
    beyond, _ = ran(capstan(speed=1e-2, omega=1e-3))
    cost = end_of(beyond).regularisation["r1"]
    error = 1.0 - ratio_of(exact) / ratio_of(beyond)
    assert end_of(exact).regularisation["r1"].by_cone < 1e-4
    assert cost.by_cone == pytest.approx(error, rel=0.15)
    assert error > 0.05


@pytest.mark.slow
def test_creep_is_the_tension_that_goes() -> None:
    """A standing roller holds a twentieth of the tension, which creeps away where ω is large."""

    def held(omega: float, duration: float) -> Run:
        less = {"exit": {"force": [0.95e4, 0.0, -0.95 * 5773.5]}}
        stages = (PULL, LAY, {"name": "less", "duration": 0.1, **less})
        tables = tables_of(*stages, {"name": "hold", "duration": duration}, refined=0.1)
        tables["friction"] |= {"exponent": 0.1, "omega": omega, "speed": 1e-4}
        run, _ = ran(tables)
        assert run.outcome.done, run.message
        return run

    sharp, blunt = held(1e-6, 10.0), held(1e-1, 10.0)
    lost = ratio_of(sharp) / ratio_of(blunt) - 1.0
    assert end_of(sharp).regularisation["r1"].effect < 0.01
    assert lost > 0.01
    assert end_of(blunt).regularisation["r1"].by_creep > 0.2 * lost


def test_penetration_is_that_of_the_law() -> None:
    run, _ = ran(capstan())
    state = end_of(run)
    cost, contact = state.regularisation["r1"], state.contacts["r1"]
    deepest = float(-contact.gap.min())
    assert cost.penetration == pytest.approx(deepest)
    assert cost.by_penetration == pytest.approx(deepest / 0.5)


def crowned(contact: dict[str, float], crown: float = -2e-4) -> tuple[Any, Regularisation]:
    """Mean pressure inside the arc on every line along a crowned roller, and what contact costs."""
    example = Path(__file__).parents[2] / "examples" / "crowned.toml"
    tables = Scene.load(example).to_dict() | {"contact": contact}
    tables["strip"] |= {"cells": [12, 4], "refined": 0.04}
    tables["rollers"][0]["crown"] = [0.0, crown]
    run = Scene.model_validate(tables).run()
    assert list(run)
    assert run.outcome.done
    state = end_of(run).contacts["r1"]
    x, y = state.contact.operator.reference[:2].round(6)
    inside = np.abs(x - x[state.touching].mean()) < 0.2  # it lifts off at 0.3 m
    lines = [inside & (y == line) for line in np.unique(y)]
    means = [np.average(state.pressure[line], weights=state.area[line]) for line in lines]
    return np.array(means), end_of(run).regularisation["r1"]


def test_gaps_over_a_crown_stretch_fibres() -> None:
    """Soft contact moves pressure between lines: by the gap over r T/(E t), not over r alone."""
    soft = {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3}
    (pressed, cost), (sharp, little) = crowned(soft), crowned({})
    error = np.abs(1.0 - pressed / sharp).max()
    assert error > 0.1
    assert cost.penetration / 0.5 < 2e-3 * error
    assert cost.by_penetration == pytest.approx(error, rel=0.5)
    assert little.by_penetration < 0.01
    assert crowned(soft, 0.0)[1].by_penetration < 0.4 * cost.by_penetration


def test_summary(tmp_path: Path) -> None:
    """Every run with friction says so, for each roller, also where nothing touches."""
    tables = tables_of(PULL, turning(duration=0.01))
    tables["rollers"][0]["centre"] = [0.0, 0.0, -2.0]
    run = Run(Scene.model_validate(tables), tmp_path)
    assert list(run)
    roller = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["rollers"]["r1"]
    effect = {"creep": 0.0, "cone": 0.0, "penetration": 0.0, "total": 0.0}
    assert roller["regularisation_effect"] == effect
    assert (roller["sticking_creep"], roller["penetration"]) == (0.0, 0.0)


@pytest.mark.slow
def test_laws_are_sharpened_until_it_is_not_seen(tmp_path: Path) -> None:
    """Ten times V_c: 3 % too much tension at first, the tolerance of 0.1 % at last."""
    exact, _ = ran(capstan(speed=1.0, omega=1e-3))
    blunt, _ = ran(capstan(speed=0.1))
    run = Scene.model_validate(capstan(speed=0.1, regularisation="auto")).run(tmp_path)
    assert isinstance(run, SharpenedRun)
    assert list(run)
    assert run.outcome.done
    assert run.effect <= 1e-3 < run.passes[0]["effect"]
    assert len(run.passes) == 2
    assert abs(ratio_of(blunt) / ratio_of(exact) - 1.0) > 0.02
    assert ratio_of(run) == pytest.approx(ratio_of(exact), rel=1e-3)
    assert "below the tolerance of 0.001, with q = " in run.message
    assert run.passes[-1]["stiffness"] == run.passes[0]["stiffness"]  # little enough by itself
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["message"] == run.message
    assert [done["tangents"] for done in summary["sharpened"]] == [
        p["tangents"] for p in run.passes
    ]
    assert summary["input"]["friction"]["exponent"] < 0.05


@pytest.mark.slow
def test_laws_are_sharpened_until_the_error_budget_does_not_see_them() -> None:
    """Strip that is pulled harder over a standing roll, and slips over nearly all of it.

    Nothing creeps that sticks, which alone was looked at: V_c counts where slip comes to rest.
    """
    tables = {
        "strip": {"kinematics": "section", "width": 1.2, "thickness": 0.5e-3},
        "material": {"young": 2.1e11, "poisson": 0.3},
        "threading": {"tension": 1e4, "entry": [-2.0, 0.0, 0.35], "exit": [0.35, 0.0, -2.5]},
        "rollers": [{"name": "r1", "radius": 0.35, "centre": [0.0, 0.0, 0.0], "wrap": "over"}],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [{"name": "step", "duration": 0.2, "exit": {"tension": 1.6e4}},
                   {"name": "wait", "duration": 0.3}],
    }  # fmt: skip
    entries = []
    # The laws differ by 36 N/m: the first two are solved to 1.6 N/m, a tenth of the third.
    for tolerance, friction in (
        (1e-4, {"speed": 3e-9}),
        (1e-4, {}),
        (1e-3, {"regularisation": "auto"}),
    ):
        laws = {"friction": {"coefficient": 0.2} | friction, "solver": {"tolerance": tolerance}}
        run = Scene.model_validate(tables | laws).run()
        entries.append([step.state.tension("entry") for step in run][-1])
    assert isinstance(run, SharpenedRun)
    exact, plain, sharp = entries
    told = run.errors()["regularisation"]
    assert told is not None
    assert run.effect == run.passes[-1]["effect"] == pytest.approx(told["tension"] / 1.6e4)
    assert run.effect <= 1e-3 < run.passes[0]["effect"]
    assert f"by about {run.effect:.2g}, below the tolerance" in run.message
    assert told["tension"] == pytest.approx(sharp - exact, rel=0.1)  # V_c is 26 times smaller
    assert plain - exact > 2.0 * (sharp - exact)


def test_laws_that_are_not_sharp_enough_are_told_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("anmstrip.driver.scene.MAX_RUNS", 1)
    run = Scene.model_validate(capstan(speed=0.1, regularisation="auto")).run()
    assert list(run)
    assert "above the tolerance" in run.message
    assert run.message.endswith("after 1 run(s): there are no more.")


def test_sharpening_is_not_resumed() -> None:
    with pytest.raises(InputError, match="without --resume"):
        Scene.model_validate(capstan(regularisation="auto")).run("nowhere", resume=True)


@pytest.mark.slow
def test_the_onset_of_contact_is_narrowed_until_it_is_not_seen() -> None:
    tables = capstan(speed=1.0, omega=1e-3, regularisation="auto")
    tables["contact"] = {"onset": 8e-3}
    run = Scene.model_validate(tables).run()
    assert isinstance(run, SharpenedRun)
    assert list(run)
    assert run.effect <= 1e-3 < run.passes[0]["effect"]
    assert run.passes[-1]["onset"] < 0.5 * 8e-3
    assert "an onset of" in run.message


def test_laws_whose_sharpening_changes_nothing_more_are_sharp_enough() -> None:
    """What is estimated of a line that is right to 0.01 N/m stays at 4 N/m; the fifth run stopped.

    Results are those of the last run that came to its end.
    """
    tables = {
        "strip": {"kinematics": "section", "width": 1.2, "thickness": 5e-4},
        "material": {"young": 2e11, "poisson": 0.3},
        "friction": {"coefficient": 0.2, "speed": 1e-5, "regularisation": "auto"},
        "threading": {"tension": 1e4, "entry": [0.0, 0.0, 0.0], "exit": [6.0, 0.0, 0.0]},
        "rollers": [
            {"name": "in", "radius": 0.3, "centre": [1.0, 0.0, -1.0], "wrap": "under"},
            {"name": "idler", "radius": 0.3, "centre": [3.0, 0.0, 0.5], "wrap": "over",
             "drive": "idle", "bearing": 20.0},
            {"name": "out", "radius": 0.3, "centre": [5.0, 0.0, -1.0], "wrap": "under"},
        ],
        "stages": [{"name": "run", "steady": True, "entry": {"tension": 1e4},
                    "rollers": {"in": {"surface_speed": 2.0}, "out": {"surface_speed": 2.0001}}}],
        "solver": {"tolerance": 1e-4},
    }  # fmt: skip
    run = Scene.from_tables(tables, "line.toml").run()
    for _ in run:
        pass
    assert isinstance(run, SharpenedRun)
    assert run.outcome.done and "sharper ones change that no more" in run.message
    effects = [each["effect"] for each in run.passes]
    assert len(effects) < 5 and effects[-1] > 0.5 * effects[-2] and effects[0] > 1e-2
