"""Onsets of wrinkles on rate-free paths, of strip that stands and of strip that is conveyed."""

from __future__ import annotations

import csv
import json
import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from threaded import ended

from anmstrip.continuation.bifurcations import Kind, watch_singular_points
from anmstrip.continuation.follow import Settings, follow
from anmstrip.driver import budget
from anmstrip.driver.run import Run, onset_words
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium, StageProblem
from anmstrip.linalg.solvers import Bordered, Remembering, SparseSolver
from anmstrip.results import wrinkles
from anmstrip.results.state import State
from anmstrip.results.wrinkles import (
    ONSET_FACTOR,
    ONSET_TOLERANCE,
    TRACKED_MODES,
    Wrinkling,
    buckling,
)
from claims import Claim

EXAMPLES = Path(__file__).parents[2] / "examples"
LENGTH, YOUNG, THICKNESS, OVER = 1.0, 2e11, 1e-3, 1.3
EULER = np.pi**2 * YOUNG * THICKNESS**3 / 12.0 / LENGTH**2
"""Of the strip as a beam, N/m; ν is 0."""


def pressed(**tables: Any) -> Scene:
    """A flat strip between two edges that are held in z, pressed along beyond Euler's force."""
    return Scene.model_validate(
        {
            "strip": {"length": LENGTH, "width": 0.4, "thickness": THICKNESS, "cells": [8, 2]},
            "material": {"young": YOUNG, "poisson": 0.0},
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True},
                      "exit": {"fixed": ["z"], "centred": True}},
            "stages": [{"name": "press", "duration": 1.0,
                        "exit": {"force": [-OVER * EULER, 0.0, 0.0]}}],
            "solver": {"tolerance": 1e-6},
            **tables,
        }
    )  # fmt: skip


def test_column_is_told_where_euler_says(tmp_path: Path) -> None:
    """About to buckle at 1/1.01 of Euler's force, a bifurcation at the force itself."""
    run = pressed(output={"events": True}).run(tmp_path)
    list(run)
    found = {told["kind"]: told for told in run.wrinkles}
    assert list(found) == ["wrinkles", "bifurcation"]
    for kind, share in (("wrinkles", 1.0 / ONSET_FACTOR), ("bifurcation", 1.0)):
        assert found[kind]["exit_tension"] == pytest.approx(-share * EULER, rel=1e-3)
        assert found[kind]["time"] == pytest.approx(share / OVER, rel=1e-3)
        assert found[kind]["x"] == pytest.approx(0.0, abs=1e-9)
    assert "about to wrinkle" in run.message
    assert "more" not in run.message
    several = onset_words([*run.wrinkles[:1], *run.wrinkles[:1], {"time": 0.75}])
    first = onset_words(run.wrinkles[:1])
    assert several == f"{first[:-1]}; 2 more up to t = 0.75 s, in summary.json."
    assert onset_words([]) == ""
    assert "latent flatness" not in first
    uneven = onset_words([{**run.wrinkles[0], "latent_flatness": 10.84}])
    assert "N/m, latent flatness 10.8 I-units) the strip is about to wrinkle" in uneven
    assert "unstable" in run.message
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["wrinkles"] == run.wrinkles
    with (tmp_path / "events.csv").open() as table:
        rows = [(row["kind"], float(row["time"])) for row in csv.DictReader(table)]
    assert rows == [(told["kind"], told["time"]) for told in run.wrinkles]


def test_factors_find_the_bifurcation_that_inertia_finds() -> None:
    run, state = ended(pressed())
    plan, solver = state.plan, Remembering(SparseSolver())
    equations = Equilibrium(plan.model, plan.supports, plan.controls)
    settings = Settings(order=15)
    start = np.zeros(len(plan.supports.free))
    steps = follow(equations, start, solver=solver, settings=settings)
    points = [
        point
        for _, here in watch_singular_points(equations, steps, solver, settings)
        for point in here
    ]
    assert [point.kind for point in points] == [Kind.BIFURCATION]
    assert run.wrinkles[1]["time"] == pytest.approx(points[0].control, abs=2.0 * ONSET_TOLERANCE)


def test_a_strip_that_is_pulled_is_not_looked_at() -> None:
    pulled = pressed(stages=[{"name": "pull", "duration": 1.0, "exit": {"force": [1e3, 0.0, 0.0]}}])
    run, _ = ended(pulled)
    assert run.wrinkles == []
    assert "wrinkles" not in run.cost.seconds


def test_a_strip_that_does_not_bend_is_not_looked_at() -> None:
    """Any compression wrinkles it, at no wavelength; it still runs, slightly pulled."""
    pulled = {"name": "pull", "duration": 1.0, "exit": {"force": [1e3, 0.0, 0.0]}}
    strip = {**pressed().to_dict()["strip"], "bending": False}
    run = pressed(strip=strip, stages=[pulled]).run()
    assert list(run)[-1].state.plan.name == "pull" and run.onsets is None
    assert run.outcome.done and pressed().run().onsets is not None


def test_onsets_outlive_an_interruption(tmp_path: Path) -> None:
    whole, _ = ended(pressed())
    stages = [*pressed().to_dict()["stages"], {"name": "rest", "duration": 1.0}]
    scene = pressed(stages=stages)
    steps = iter(scene.run(tmp_path))
    first = next(steps)
    while first.stage != "rest":
        first = next(steps)
    steps.close()
    resumed = scene.run(tmp_path, resume=True)
    for _ in resumed:
        pass
    assert [told["time"] for told in resumed.wrinkles] == [t["time"] for t in whole.wrinkles]


def crowned(conveyed: bool) -> Scene:
    """The crowned roller of the example without friction, down to 16.5 kN/m."""
    functions = runpy.run_path(str(EXAMPLES / "conveyed_wrinkles.py"))
    tables = functions["crowned"](8e-4, 0.0, ((6, 12), 0.02)).to_dict()
    tables["stages"][-1]["exit"]["tension"] = 1.65e4
    if not conveyed:
        tables["stages"] = [{"name": "ease", "duration": 1.0, "friction": False,
                             "exit": {"tension": 1.65e4}}]  # fmt: skip
    return Scene.model_validate(tables)


def sign(state: State) -> float:
    """Sign of the tangent's determinant, from factors of the whole matrix without a border."""
    plan = state.plan
    equations = Equilibrium(plan.model, plan.supports, plan.controls)
    matrix = equations.recurrence(state.full[plan.supports.free], state.control, 1).tangent()
    factors = splu(matrix.assembled() if isinstance(matrix, Bordered) else matrix)
    orders = [csr_matrix((np.ones(len(p)), (np.arange(len(p)), p))) for p in
              (factors.perm_r, factors.perm_c)]  # fmt: skip
    cycles = sum(connected_components(order, connection="strong")[0] for order in orders)
    return float((-1.0) ** cycles * np.prod(np.sign(factors.U.diagonal())))


@pytest.mark.slow
def test_strip_wrinkles_as_it_is_conveyed_where_it_does_as_it_stands(claim: Claim) -> None:
    """Nothing rubs; and the determinant of the stationary path changes its sign there."""
    tensions, ends = [], []
    for run in (crowned(True).run(), crowned(False).run()):
        *_, last = run
        found = [told for told in run.wrinkles if told["kind"] == "bifurcation"]
        tensions.append([told["exit_tension"] for told in found])
        ends.append((last.state, found[0]["time"]))
    moving, standing = tensions
    assert len(moving) == len(standing)
    claim("tension at the onset of conveyed strip without friction (N/m)",
          moving[0], standing[0], 1e-4, "the same strip as it stands")  # fmt: skip
    end, time = ends[0]
    assert sign(end.at(time - 2e-3, None)) == -sign(end.at(time + 2e-3, None))


@pytest.mark.slow
def test_limits_of_conveyed_strip_over_crown_and_misalignment(claim: Claim) -> None:
    """Friction raises the one, and makes the other, which grows like θ^(4/3); coarse meshes.

    What a roller out of line shears the strip by, N_xy ∝ θ, presses it by N_xy²/T, and strip bears
    ∝ √T.
    """
    functions = runpy.run_path(str(EXAMPLES / "conveyed_wrinkles.py"))
    coarse, cases = functions["COARSE"], {}
    for name, value, friction in (("crowned", 6e-4, 0.3), ("skewed", 5e-4, 0.3),
                                  ("skewed", 1e-3, 0.3), ("skewed", 1e-3, 0.0)):  # fmt: skip
        found = functions["limit"](functions[name](value, friction, coarse))
        smooth = (name, friction) == ("skewed", 0.0)
        assert found["wrinkles"] == ("smooth down to" if smooth else "below")
        cases[name, value, friction] = found
    gripped = cases["crowned", 6e-4, 0.3]["tension"]
    claim("tension at the onset of conveyed strip, crown of 0.6 mm, f = 0.3 (N/m)", gripped,
          15057.0, 0.025, "8 × 16 elements")  # fmt: skip
    assert gripped > 1.4 * 9604.0  # without friction
    half, whole = (cases["skewed", yaw, 0.3]["tension"] for yaw in (5e-4, 1e-3))
    claim("the same 1 mrad out of line (N/m)", whole, 35061.0, 0.015, "8 × 16 elements")
    assert np.log2(whole / half) == pytest.approx(4.0 / 3.0, abs=0.08)
    rests = cases["skewed", 1e-3, 0.0]
    assert abs(rests["offset"]) < 1e-6
    assert abs(cases["skewed", 1e-3, 0.3]["offset"]) > 1e-4
    assert rests["compression"] < 0.01 * rests["bearable"]


@pytest.mark.slow
def test_long_span_does_not_wrinkle_by_what_a_coarse_mesh_makes_up_beside_rollers() -> None:
    """30 m of strip that sags between straight rollers, with four elements across.

    They make up 25 N/m on 0.1 m beside both; compressed all along the span bears 17.5 N/m.
    """
    rollers = [{"name": name, "radius": 0.3, "centre": [x, 0.0, -0.3], "wrap": "over"}
               for name, x in (("a", -15.0), ("b", 15.0))]  # fmt: skip
    tables = {
        "strip": {"width": 1.0, "thickness": 0.5e-3, "cells": [20, 4]},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "threading": {"tension": 3000.0, "entry": [-16.0, 0.0, 0.0], "exit": [16.0, 0.0, 0.0]},
        "rollers": rollers,
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [{"name": "weight", "friction": False, "gravity": [0.0, 0.0, -9.81]}],
        "solver": {"tolerance": 1e-2},
    }
    wrinkling = Wrinkling(ended(Scene.model_validate(tables))[1])
    _, span, _ = wrinkling.spans
    assert span.compression > span.bearable > 10.0 * span.mean
    assert wrinkling.warnings == []


@pytest.mark.parametrize(
    ("tension", "least", "most"), [(1.6e4, 0.8, 1.0), (1.64e4, 1.0, 1.2), (1.8e4, 2.0, 3.0)]
)
def test_what_a_compressed_strip_bears_by_its_modes_is_told(
    tmp_path: Path, tension: float, least: float, most: float
) -> None:
    """Long edges of 30 I-units wave at 16.25 kN/m; short waves there need much more than long ones.

    The estimate for waves as long as the span, 10 N/m, is 300 times too low.
    """
    run = long_edges(tmp_path, tension=tension)
    (told,) = [line for line in run.warnings if line.startswith("the strip is compressed")]
    times = re.search(r"Its modes on this mesh bear (\S+) times this compression", told)
    assert times is not None, told
    assert least < float(times[1]) < most


def test_modes_of_strip_that_runs_in_time_are_those_at_rest(tmp_path: Path) -> None:
    """Long edges of 30 I-units over a driven and an idle roller, which have unknowns of their own.

    Hardly anything rubs, so that the modes are those of the frictionless strip.
    """
    rollers = [
        {"name": name, "radius": 0.3, "centre": [x, 0.0, -0.3], "wrap": "over", "drive": drive}
        for x, name, drive in [(0.0, "r1", "idle"), (2.0, "r2", "speed")]
    ]
    start = {"name": "start", "duration": 0.1, "entry": {"speed": 0.1},
             "rollers": {"r2": {"surface_speed": 0.1}}}  # fmt: skip
    lowest = []
    for stage in ({"name": "rest", "friction": False}, start):
        tables = {
            "strip": {"width": 1.0, "thickness": 5e-4, "cells": [12, 4], "refined": 0.1,
                      "flatness": {"across": [0.0, 0.0, 120.0]}},
            "material": {"young": 2e11, "poisson": 0.3},
            "contact": {},
            "friction": {"coefficient": 0.01},
            "threading": {"tension": 1.6e4, "entry": [-1.0, 0.0, -0.5], "exit": [3.0, 0.0, -0.5]},
            "rollers": rollers,
            "stages": [stage],
            "solver": {"tolerance": 1e-2},
        }  # fmt: skip
        run = Run(Scene.model_validate(tables), tmp_path / stage["name"])
        *_, step = run
        factors, modes = buckling(step.state, 2)
        assert modes.shape == (len(step.state.plan.supports.free), 2)
        assert any("bear" in line for line in run.warnings)
        lowest.append(float(factors[0]))
    at_rest, running = lowest
    assert running == pytest.approx(at_rest, rel=0.02)


def long_edges(directory: Path | None, finer: float = 1.0, tension: float = 1.6e4) -> Run:
    """A run of a strip with edges 30 I-units longer that is eased until they wave."""
    pull = {"name": "pull", "friction": False, "exit": {"tension": 3e4}}
    tables = {
        "strip": {"width": 1.0, "thickness": 5e-4, "length": 4.0, "finer": finer,
                  "flatness": {"across": [0.0, 0.0, 120.0]}},
        "material": {"young": 2e11, "poisson": 0.3},
        "edges": {"entry": {"fixed": ["x", "y", "z"]}, "exit": {"fixed": ["y", "z"]}},
        "stages": [pull, {**pull, "name": "ease", "exit": {"tension": tension}}],
    }  # fmt: skip
    run = Run(Scene.model_validate(tables), directory)
    for _ in run:
        pass
    return run


def counts_of_modes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many modes are looked for, state by state."""
    counts, find = list[int](), wrinkles.buckling

    def counted(state: State, count: int, *more: Any) -> Any:
        counts.append(count)
        return find(state, count, *more)

    monkeypatch.setattr(wrinkles, "buckling", counted)
    return counts


def test_eight_onsets_are_dated_by_the_modes_of_a_dozen_states(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of one step, by those of its two ends and of two states nearby; it took 22 states.

    All are as near to 1.01 or 1 as the tolerance of the control lets them be.
    """
    found, during = list[wrinkles.Onset](), wrinkles.WrinkleWatch.during

    def kept(watch: wrinkles.WrinkleWatch, state: State) -> list[wrinkles.Onset]:
        found.extend(onsets := during(watch, state))
        return onsets

    monkeypatch.setattr(wrinkles.WrinkleWatch, "during", kept)
    counts = counts_of_modes(monkeypatch)
    long_edges(None)
    assert len(found) == 8 and counts.count(TRACKED_MODES) <= 12
    first, behind = (next(o for o in found if o.kind == k) for k in ("wrinkles", "bifurcation"))
    rate = (ONSET_FACTOR - 1.0) / (behind.state.control - first.state.control)
    for onset in found:
        assert (onset.beside is not None) == (onset in (first, behind))
        factors, _ = buckling(onset.state, TRACKED_MODES)
        assert np.abs(factors - onset.level).min() < 0.5 * ONSET_TOLERANCE * rate


def test_onset_is_dated_without_known_modes_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where these lead astray."""
    monkeypatch.setattr(wrinkles, "MAX_GALERKIN", 0)
    run, _ = ended(pressed())
    found = [told["time"] for told in run.wrinkles]
    assert found == pytest.approx([1.0 / ONSET_FACTOR / OVER, 1.0 / OVER], rel=1e-3)


def test_strip_far_from_wrinkles_is_looked_at_by_its_lowest_mode(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its edges bear two to three times what presses them."""
    counts = counts_of_modes(monkeypatch)
    run = long_edges(None, tension=1.8e4)
    assert set(counts) == {1} and run.onsets is not None
    assert run.onsets.lowest == pytest.approx(buckling(run.state, 1)[0][0], rel=1e-2)


@pytest.mark.slow
def test_onset_on_elements_of_half_the_length_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a run finds it there; and its being missed on twice the length, with what to type.

    The strip is balanced there once for both kinds of onset, and at the end of the two stages.
    """
    balanced, balance = list[float](), budget.balance_state

    def counted(plan: StageProblem, state: State, *more: Any, **given: Any) -> State | None:
        if plan.model.strip is not state.plan.model.strip:
            balanced.append(state.time)
        return balance(plan, state, *more, **given)

    monkeypatch.setattr(budget, "balance_state", counted)
    given = long_edges(tmp_path / "given")
    first = given.wrinkles[0]["time"]
    assert [time for time in balanced if time not in (1.0, 2.0)] == [pytest.approx(first)]
    finer = long_edges(None, 2.0)
    for kind in ("wrinkles", "bifurcation"):
        here, there = (
            next(told for told in run.wrinkles if told["kind"] == kind) for run in (given, finer)
        )
        moved = there["exit_tension"] - here["exit_tension"]
        told = here["on_halves"]["exit_tension"] - here["exit_tension"]
        assert moved / 1.5 < told < 1.5 * moved
        later = here["on_halves"]["time"] - here["time"]
        assert told == pytest.approx(-1.4e4 * later, rel=1e-3)  # it is eased evenly
    assert f"exit tension {here['on_halves']['exit_tension']:.5g} N/m; 3 more" in given.message
    assert [told for told in given.wrinkles if told.get("on_halves")] == [
        next(told for told in given.wrinkles if told["kind"] == kind)
        for kind in ("wrinkles", "bifurcation")
    ]
    coarse = long_edges(tmp_path / "coarse", 0.5)
    assert not coarse.wrinkles and not coarse.fine_enough
    (told,) = [words for words in coarse.warnings if "has begun to wrinkle" in words]
    assert told.endswith("Try --set strip.finer=1")
    assert not any("has begun to wrinkle" in words for words in given.warnings)


def clamped(directory: Path, finer: float) -> Run:
    """A run of a sheet of plastic that is stretched by a tenth between clamps."""
    held = {"fixed": ["x", "y", "z"]}
    tables = {
        "strip": {"length": 0.25, "width": 0.1, "thickness": 1e-4, "finer": finer},
        "material": {"young": 1e9, "poisson": 0.49},
        "edges": {"entry": held, "exit": held},
        "stages": [{"name": "stretch", "exit": {"move": [0.025, 0.0, 0.0]}}],
    }
    run = Run(Scene.model_validate(tables), directory)
    for _ in run:
        pass
    return run


def test_sheet_that_wrinkles_on_no_coarse_mesh_is_told_of(tmp_path: Path) -> None:
    """Four elements are no wave across; what compresses the middle is told, and what to type.

    At the corners, where clamps and edges meet, compression is larger than in the middle.
    """
    run = clamped(tmp_path, 1.0)
    assert not run.wrinkles
    assert any("by a rule of thumb it wrinkles above" in words for words in run.warnings)
    (told,) = [words for words in run.warnings if words.startswith("waves between")]
    assert told.startswith("waves between the entry and the exit would be 0.018 m long across")
    assert told.endswith("Try --set strip.finer=3")


@pytest.mark.slow
def test_wrinkles_of_a_span_that_was_not_the_most_compressed_are_found(tmp_path: Path) -> None:
    """Foil sheared by an idler that is out of line waves once its tension has been eased.

    Where the modes are looked at first another span is compressed most, and stays as it is.  What
    the spans bear is told of each by its own mode.
    """
    idler = {"drive": "idle", "axis": [-4e-4, 1.0, 0.0]}
    pull = {"steady": True, "entry": {"tension": 1.5e4}, "exit": {"tension": 1.5e4}}
    ease = {"steady": True, "entry": {"tension": 2e3}, "exit": {"tension": 2e3}}
    tables = {
        "strip": {"width": 0.5, "thickness": 1e-4, "finer": 0.75},
        "material": {"young": 2e11, "poisson": 0.3},
        "friction": {"coefficient": 0.4},
        "threading": {"tension": 1.5e4, "entry": [-0.5, 0.0, -0.5], "exit": [1.0, 0.0, -0.6]},
        "rollers": [
            {"name": "r1", "radius": 0.1, "centre": [0.0, 0.0, 0.0], "wrap": "over"},
            {"name": "r2", "radius": 0.1, "centre": [0.5, 0.0, 0.0], "wrap": "over", **idler},
        ],
        "stages": [
            {"name": "run", **pull, "rollers": {"r1": {"surface_speed": 1.0}}},
            {"name": "ease", **ease},
        ],
    }
    run = Run(Scene.model_validate(tables), tmp_path)
    for _ in run:
        pass
    assert run.outcome.done and run.wrinkles
    assert 2.5e3 < run.wrinkles[0]["exit_tension"] < 5e3
    told = [words for words in run.warnings if words.startswith("the strip is compressed")]
    borne = re.findall(r"bear (\S+) times this compression", " ".join(told))
    assert len(set(borne)) > 1 and all(1.0 < float(times) < 1.5 for times in borne)


@pytest.mark.slow
def test_onset_that_elements_of_half_the_length_put_elsewhere_is_told(tmp_path: Path) -> None:
    """At 4.3 % where 2.98 % is right; by the rate there, half the length comes too low."""
    run = clamped(tmp_path, 1.5)
    first = run.wrinkles[0]
    here, there = first["time"], first["on_halves"]["time"]
    assert abs(there - 0.298) < 0.6 * abs(here - 0.298)
    (told,) = [words for words in run.warnings if "too coarse for it" in words]
    assert f"t = {here:.4g} s begins at {there:.4g} s on" in told
    (typed,) = [words for words in run.warnings if "strip.finer" in words]  # once for all
    assert typed.endswith("Try --set strip.finer=3")


@pytest.mark.slow
def test_onset_of_a_stretched_sheet_on_the_mesh_that_is_proposed(tmp_path: Path) -> None:
    """At 2.98 % with a third more elements, 2.95 % here; as a section it is not proposed."""
    run = clamped(tmp_path, 3.0)
    assert 0.1 * run.wrinkles[0]["time"] == pytest.approx(0.0298, rel=0.02)
    assert not any(words.startswith("waves between") for words in run.warnings)
    assert not any("nothing varies across" in words for words in run.forewarnings())
