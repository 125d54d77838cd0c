"""Counters, seconds, sentences and what is told of wrinkles and of fresh strip."""

from __future__ import annotations

import json
import re
import time
import tomllib
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import reported_scenes as scenes
from reported_files import Results, Surface, ran, typed
from reported_states import looks_at
from scipy.integrate import cumulative_trapezoid

from anmstrip import Scene

STAGES = {
    "turning": {"pull": 2.0, "wrap": 0.5, "turn": 0.4},
    "shell": {"threading": 1.0, "load": 1.0, "turn": 0.1},
    "lifted": {"pull": 1.0, "up": 1.0, "down": 1.0},
}
"""Durations (s)."""

GAUSS = np.polynomial.legendre.leggauss(4)[0] / 2.0 + 0.5
"""Places in an element where products of cubics' derivatives are integrated."""


@pytest.fixture(params=list(STAGES))
def results(request: pytest.FixtureRequest) -> Results:
    found: Results = request.getfixturevalue(request.param)
    return found


def test_counters_are_those_of_the_history(results: Results) -> None:
    summary, history = results.summary, results.history
    assert summary["status"] == "done"
    assert summary["steps"] == len(history["time"]) == history["step"][-1]
    assert summary["tangents"] == history["tangents"][-1]
    looks = summary["factorisations"] - summary["tangents"]  # at strip that is about to wrinkle
    assert looks >= 0 if results.name == "shell" else looks == 0
    assert (np.diff(history["tangents"]) >= 1).all()
    for key in ("steps", "tangents"):
        assert sum(stage[key] for stage in summary["stages"].values()) == summary[key]
    stages = history["stage"]
    for name, counts in summary["stages"].items():
        rows = [row for row, stage in enumerate(stages) if stage == name]
        assert counts["steps"] == len(rows)
        before = history["tangents"][rows[0] - 1] if rows[0] else 0
        assert counts["tangents"] == history["tangents"][rows[-1]] - before


def test_a_range_is_what_a_step_has_covered(results: Results) -> None:
    """Of the stage where nothing rubs, else of time; together they cover the stages."""
    history, durations = results.history, STAGES[results.name]
    before = 0.0
    for row, stage in enumerate(history["stage"]):
        covered = history["time"][row] - before
        before = history["time"][row]
        expected = covered if stage == "turn" else covered / durations[stage]
        assert history["range"][row] == pytest.approx(expected, rel=1e-9)
    assert before == pytest.approx(sum(durations.values()), rel=1e-12)


def test_orders_and_residuals_are_those_that_were_asked_for(results: Results) -> None:
    """A straight pull is a polynomial of few orders; elsewhere the order is the scene's."""
    history = results.history
    tolerance = results.summary["input"]["solver"]["tolerance"]
    assert ((history["residual"] > 0.0) & (history["residual"] <= tolerance)).all()
    orders = {int(order) for order in history["order"]}
    assert max(orders) == explained_order(results)


def explained_order(results: Results) -> int:
    scene = results.directory.parent / "scene.toml"
    text = " ".join(typed("explain", scene).stdout.split())
    found = re.search(r"order (\d+), the cheapest", text)
    assert found is not None
    return int(found[1])


def test_an_order_that_is_asked_for_is_taken(tmp_path: Path) -> None:
    results = ran(scenes.PLATE, tmp_path, "solver.order=9", options=("--quiet",))
    assert set(results.history["order"][1:]) == {9.0}


def test_unknowns_and_points_are_those_of_the_mesh(results: Results) -> None:
    """Four unknowns at a node for each of three components, two for each of two; points by rule.

    Membrane and bending on four points along and across, contact on three shared by neighbours,
    once for every roller.
    """
    x, y = (np.unique(np.round(results.last.reference[:, ::3, ::3, k], 9)).size - 1 for k in (0, 1))
    summary = results.summary
    points = {name: effect["points"] for name, effect in summary["effects"].items()}
    if results.name == "shell":
        assert summary["unknowns"] == 12 * (x + 1) * (y + 1)
        assert points["membrane"] == points["bending"] == 16 * x * y
        assert points["contact"] == points["friction"] == 2 * (2 * x + 1) * (2 * y + 1)
        assert points["weight"] == points["force on exit"] == 0
    else:
        assert summary["unknowns"] == 4 * (x + 1)
        assert points["membrane"] == points["bending"] == 4 * x
        assert points["contact"] == 2 * x + 1
    names = {"membrane", "bending", "contact", "force on exit"}
    names |= {"shell": {"friction", "weight"}, "turning": {"friction"}}.get(results.name, set())
    names |= {"fed": {"friction", "passage"}}.get(results.name, set())
    assert set(points) == names


def test_seconds_add_up(tmp_path: Path) -> None:
    """Of the whole as by a watch outside; parts of it are no more than it.

    Most of the time goes into stages; a machine that is busy elsewhere may add to the rest.
    """
    begun = time.perf_counter()
    results = ran(scenes.LIFTED, tmp_path, options=("--quiet",))
    outside = time.perf_counter() - begun
    summary = results.summary
    wall = summary["wall_seconds"]
    assert 0.1 * outside < wall < outside
    stages = sum(stage["seconds"] for stage in summary["stages"].values())
    assert 0.2 * wall < stages <= wall
    assert sum(summary["seconds"].values()) <= wall
    assert 0.0 < sum(effect["seconds"] for effect in summary["effects"].values()) <= wall
    assert all(effect["seconds"] > 0.0 for effect in summary["effects"].values())
    assert f"{wall:.1f} s" in summary["message"] or f"{wall + 0.05:.1f} s" in summary["message"]


def test_the_console_says_what_the_summary_does(results: Results) -> None:
    """Sum of the durations, steps, tangents, and where the files are."""
    summary, end = results.summary, sum(STAGES[results.name].values())
    told = f"Done: {end:g} s in {summary['steps']} steps, {summary['tangents']} tangents, "
    assert results.printed.startswith(told)
    assert summary["message"] == results.printed.splitlines()[0]
    last = f"Results in {results.directory}. Next: anmstrip render {results.directory}"
    assert results.printed.splitlines()[-1] == last


def test_the_input_is_the_scene_with_its_settings(tmp_path: Path) -> None:
    results = ran(
        scenes.PLATE, tmp_path, "material.young=1.0e11", "solver.tolerance=1e-3",
        options=("--quiet",),
    )  # fmt: skip
    found = results.summary["input"]
    given = tomllib.loads(scenes.PLATE)
    assert found["material"]["young"] == 1.0e11
    assert found["solver"]["tolerance"] == 1e-3
    for key, value in given["strip"].items():
        assert found["strip"][key] == value
    assert found["rollers"][0]["centre"] == given["rollers"][0]["centre"]
    for name in ("numpy", "scipy", "meshio"):
        assert results.summary["versions"][name] == version(name)


def test_the_input_has_what_the_scene_leaves_open(tmp_path: Path) -> None:
    """So that it leads to the same run where another version, or another mesh, would choose."""
    head, tail = scenes.PLATE.split("[contact]")
    text = head.replace("plate", "section") + tail[tail.index("[[rollers]]") :]
    text = text.replace("young =", "yield_stress = 5.0e8\nyoung =") + "\n[material.plasticity]\n"
    text = text.replace('["z"]', '["x", "z"]', 1)
    before = ran(text, tmp_path, options=("--quiet",)).summary
    used = before["input"]
    assembly = Scene.model_validate(tomllib.loads(text)).run().assembly
    law = assembly.signorini
    assert used["contact"]["onset"] == law.width
    assert law(np.float64(0.0)) == pytest.approx(used["contact"]["pressure"], rel=1e-12)
    assert used["solver"]["order"] == assembly.order
    assert used["material"]["plasticity"]["reference_rate"] == assembly.usual_rate
    again = Scene.model_validate(used).run(tmp_path / "again")
    assert list(again)
    assert before["status"] == "done"
    after = json.loads((tmp_path / "again" / "summary.json").read_text())
    for key in ("input", "steps", "tangents", "rollers"):
        assert after[key] == before[key]


def test_progress_tells_how_far_a_run_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A line now and then: by a clock a thousand times as fast, one for nearly every step.

    The time left is what has gone times (1 − f)/f, so that all lines tell of one total clock.
    """
    clock, begun = time.monotonic, time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: begun + 1e3 * (clock() - begun))
    results = ran(scenes.LIFTED, tmp_path)
    taken = 1e3 * (clock() - begun)
    others = "Warning: ", "estimating the errors by the mesh"
    lines = [line for line in results.progress.splitlines() if not line.startswith(others)]
    assert re.search(
        r"estimating the errors by the mesh, .* unknowns, about \d+ s\n", results.progress
    )
    assert len(lines) > 20
    rows = {f"{t:.4g}": row for row, t in enumerate(results.history["time"])}
    gone = []
    for line in lines:
        found = re.fullmatch(
            r"(\w+), t = (\S+) of (\S+) s, (\d+) tangents(?:, tension ratio (\S+))?, (\d+) s left",
            line,
        )
        assert found is not None, line
        row = rows[found[2]]
        assert found[1] == results.history["stage"][row]
        assert float(found[3]) == 3.0
        assert int(found[4]) == results.history["tangents"][row]
        assert (found[5] is None) == (results.history["r_wrap"][row] == 0.0)
        assert float(found[5] or 1.0) == pytest.approx(1.0, abs=0.02)  # nothing rubs
        fraction = results.history["time"][row] / 3.0
        if fraction < 1.0:
            left = np.array([max(float(found[6]) - 0.5, 0.0), float(found[6]) + 0.5])
            gone.append(left * fraction / (1.0 - fraction))  # between these, by rounding
    assert gone[0][1] < taken
    assert max(low for low, _ in gone) < taken
    assert all(b[1] >= a[0] for a, b in pairwise(gone))
    middle = gone[len(gone) // 2]
    assert middle[1] > 1.0


def test_steps_in_python_are_those_of_the_history(turning: Results) -> None:
    scene = Scene.load(turning.directory.parent / "scene.toml", ["output.events=false"])
    run = scene.run()
    steps = [step for step in run if step.stage != "turn" or step.time == 2.9]
    last = steps[-1]
    assert last.step == run.steps
    assert last.tangents == run.cost.expansions
    assert (last.time, last.end_time, last.fraction) == pytest.approx((2.9, 2.9, 1.0))
    assert [step.fraction for step in steps] == pytest.approx([step.time / 2.9 for step in steps])
    # polynomials and quotients follow the same path to the tolerance of 1e-4
    expected = turning.summary["rollers"]["r1"]["tension_ratio"]
    assert last.tension_ratio == pytest.approx(expected, rel=1e-3)
    assert last.state.tension("entry") / last.state.tension("exit") == pytest.approx(
        last.tension_ratio, rel=1e-3
    )


# fresh strip ------------------------------------------------------------------------------------


def test_fresh_strip_is_counted(fed: Results) -> None:
    """What passes an end by the written velocities, over the stretch; ρ t W of it is its mass."""
    feed, surfaces = fed.summary["feed"], fed.surfaces
    for name in ("entry", "exit"):
        speeds = [along(surface, name) for surface in surfaces]
        passed = np.trapezoid(speeds, [surface.time for surface in surfaces])
        assert feed["length"] == pytest.approx(passed, rel=2e-3)
    assert feed["mass"] == pytest.approx(7850.0 * 1e-3 * 0.4 * feed["length"], rel=1e-12)


def test_history_tells_how_far_fed_strip_has_gone(fed: Results) -> None:
    """Its speed is that of the written velocities at the exit; its way is their integral.

    The displacement tells it too: what is at the exit has come from so far upstream.
    """
    at = {time: row for row, time in enumerate(fed.history["time"])}
    surfaces = [surface for surface in fed.surfaces if surface.time in at]
    rows, times = [at[s.time] for s in surfaces], [surface.time for surface in surfaces]
    assert len(surfaces) > 5
    speeds = [along(surface, "exit") for surface in surfaces]
    assert np.abs(fed.history["strip_speed"][rows] - speeds).max() < 2e-3 * max(speeds)
    ways = fed.history["conveyed"][rows]
    passed = cumulative_trapezoid(speeds, times, initial=0.0)
    assert np.abs(ways - ways[0] - passed).max() < 2e-3 * ways[-1]
    assert ways[-1] == pytest.approx(fed.summary["feed"]["length"], rel=1e-12)
    first, last = (s.reference[..., 0].max() for s in (surfaces[0], surfaces[-1]))
    assert first - last == pytest.approx(ways[-1] - ways[0], abs=1e-9)


def along(surface: Surface, name: str) -> float:
    """Speed of an end along the strip, in lengths of the unstretched strip (m/s)."""
    x = surface.reference[..., 0]
    n, j, i = np.argwhere(x == (x.min() if name == "entry" else x.max()))[0]
    tangent = surface.tangents[0][n, j, i]
    velocity = surface.patch("velocity")[n, j, i]
    return float(velocity @ tangent / (tangent @ tangent))


# wrinkles ---------------------------------------------------------------------------------------


def spans_of(
    results: Results, thickness: float, tension: float
) -> list[tuple[str, str, float, float]]:
    """Stretches between the arcs, four times √(D/T) away from them."""
    d = 2.0e11 * thickness**3 / 12.0 / (1.0 - 0.3**2)
    away = 4.0 * np.sqrt(d / tension)
    looks = looks_at(results, results.last)
    arcs = [(look.arc[0] - away, look.arc[1] + away, name) for name, look in looks.items()]
    x = results.last.reference[..., 0]
    ends = [(x.min(), x.min(), "the entry"), *sorted(arcs), (x.max(), x.max(), "the exit")]
    return [(a[2], b[2], a[1], b[0]) for a, b in pairwise(ends) if a[1] < b[0]]


def principal(surface: Surface, thickness: float) -> tuple[np.ndarray, ...]:
    """Places and principal membrane forces at Gauss's points of the patches, and their areas."""
    m = np.vander(GAUSS, 4, increasing=True) @ np.linalg.inv(
        np.vander(np.linspace(0.0, 1.0, 4), increasing=True)
    )

    def at(values: np.ndarray) -> np.ndarray:
        return np.einsum("aj,bi,nji...->nab...", m, m, values)

    one, two = (at(t) for t in surface.tangents)
    xx, yy, xy = ((a * b).sum(-1) for a, b in ((one, one), (two, two), (one, two)))
    strain = np.stack([np.stack([xx - 1.0, xy], -1), np.stack([xy, yy - 1.0], -1)], -1) / 2.0
    c = 2.0e11 * thickness / (1.0 - 0.09)
    trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
    forces = np.linalg.eigvalsh(c * (0.7 * strain + 0.3 * trace * np.eye(2)))
    rule = np.polynomial.legendre.leggauss(4)[1] / 2.0
    areas = np.prod(surface.sizes, axis=0)[:, None, None] * np.outer(rule, rule)
    reference = at(surface.reference).reshape(-1, surface.reference.shape[-1])
    return reference[:, 0], reference[:, 1], forces.reshape(-1, 2), areas.ravel()


@pytest.mark.parametrize(("name", "thickness"), [("shell", 1e-3), ("thin", 2e-4)])
def test_compression_is_that_of_the_free_spans(
    name: str, thickness: float, request: pytest.FixtureRequest
) -> None:
    results: Results = request.getfixturevalue(name)
    x, _, forces, _ = principal(results.last, thickness)
    spans = spans_of(results, thickness, 1.0e4)
    assert len(spans) == 3
    inside = np.any([(a <= x) & (x <= b) for _, _, a, b in spans], axis=0)
    expected = -forces[inside, 0].min()
    assert expected > 0.0
    assert results.summary["compressive_membrane_force"] == pytest.approx(expected, rel=1e-6)


def test_compressed_spans_are_warned_of(thin: Results, shell: Results) -> None:
    """Against the least of [D (k² + q²)² + T q²]/k² over all waves k across, with q = π/L.

    It is what a span bears that is compressed all along: what counts is the line of points along
    with the largest mean.  Beside the centred node of the entry the program leaves some out.
    """
    wrinkles = "the strip is compressed"
    assert not any(line.startswith(wrinkles) for line in shell.summary["warnings"])
    surface = thin.last
    x, y, forces, areas = principal(surface, 2e-4)
    d = 2.0e11 * 8e-12 / 12.0 / 0.91
    expected = []
    for before, after, start, end in spans_of(thin, 2e-4, 1.0e4):
        inside = (start <= x) & (x <= end)
        pressure = np.maximum(-forces[:, 0], 0.0)
        lines = [inside & (np.abs(y - at) < 1e-6) for at in np.unique(np.round(y, 6))]
        means = [pressure[line] @ areas[line] / areas[line].sum() for line in lines]
        mean, line = max(means), lines[int(np.argmax(means))]
        worst = np.flatnonzero(line)[forces[line, 0].argmin()]
        q, k = np.pi / (end - start), np.geomspace(1.0, 1e4, 40_001)
        bearable = ((d * (k**2 + q**2) ** 2 + forces[worst, 1] * q**2) / k**2).min()
        beside = inside & (np.abs(x - x[worst]) <= 0.5 * surface.sizes[0].max())
        compressed = beside & (forces[:, 0] < 0.1 * forces[worst, 0])
        share = areas[compressed].sum() / areas[beside].sum()
        pressed = pressure[inside].max()
        words = (
            f"the strip is compressed by {pressed:.3g} N/m between {before} and {after}, over "
            f"{100.0 * share:.0f} % of the width; by a rule of thumb it wrinkles"
        )
        if mean > 0.5 * bearable:
            expected.append((words, pytest.approx(bearable * pressed / mean, rel=0.02)))
    assert len(expected) == 2
    lines = [line for line in thin.summary["warnings"] if line.startswith(wrinkles)]
    parts = [line.partition(" N/m. Its modes")[0].partition(" above about ") for line in lines]
    assert [(words, float(limit)) for words, _, limit in parts] == expected


@pytest.mark.parametrize(("name", "thickness"), [("shell", 1e-3), ("thin", 2e-4)])
def test_amplitude_is_the_distance_from_a_parabola(
    name: str, thickness: float, request: pytest.FixtureRequest
) -> None:
    """Of the points on every line across the free spans, along the normal of the parabola there.

    Their spacing is that of a sine whose mean square and whose slope's are those of that line,
    which is a cubic through the four points on each of its elements.

    The direction along is taken from the patches here, and from neighbouring lines in the
    summary: on a straight span both are the same to the slope of what bulges, of 1e-3.
    """
    results: Results = request.getfixturevalue(name)
    surface = results.last
    flat, points = surface.points - surface.fields["displacement"], surface.points
    along = surface.averaged(surface.tangents[0])
    largest = spacing = 0.0
    for _, _, start, end in spans_of(results, thickness, 1.0e4):
        for x in np.unique(np.round(flat[:, 0], 7)):
            line = np.abs(flat[:, 0] - x) < 1e-6
            if not start <= x <= end:
                continue
            y = flat[line, 1]
            fit = np.polyfit(y, points[line], 2)
            off = points[line] - np.vander(y, 3) @ fit
            normal = np.cross(along[line].mean(axis=0), fit[1])
            w = (off @ normal)[np.argsort(y)] / np.linalg.norm(normal)
            if np.abs(w).max() > largest:
                largest, y, squares = np.abs(w).max(), np.sort(y), np.zeros(2)
                for k in range(0, len(y) - 1, 3):
                    cubic = np.polynomial.Polynomial.fit(y[k : k + 4], w[k : k + 4], 3)
                    areas = ((p**2).integ() for p in (cubic, cubic.deriv()))
                    squares += [area(y[k + 3]) - area(y[k]) for area in areas]
                spacing = 2.0 * np.pi * np.sqrt(squares[0] / squares[1])
    assert largest > 1e-6
    assert results.summary["wrinkle_spacing"] == pytest.approx(spacing, rel=5e-3)
    assert results.summary["wrinkle_amplitude"] == pytest.approx(largest, rel=5e-3)


# laws that are sharpened ------------------------------------------------------------------------


def test_sharpened_laws_are_told_with_what_they_cost(tmp_path: Path) -> None:
    """Every run's constants, effect and tangents; the last is the run that the files are of."""
    text = scenes.TURNING.replace("duration = 0.4", "duration = 0.05")
    settings = (
        'friction.regularisation="auto"', "solver.tolerance=1e-2", "output.events=false",
        "output.every=1000",
    )  # fmt: skip
    results = ran(text, tmp_path, *settings, options=("--quiet",))
    first, *_, last = results.summary["sharpened"]
    assert {key: first[key] for key in ("exponent", "omega", "onset")} == {
        "exponent": 0.05, "omega": 0.1, "onset": 1.0e-4,
    }  # fmt: skip
    used = results.summary["input"]
    assert last["exponent"] == used["friction"]["exponent"] < first["exponent"]
    assert last["onset"] == used["contact"]["onset"]
    assert last["tangents"] == results.summary["tangents"]
    part = results.summary["errors"]["regularisation"]["tension"]
    assert last["effect"] == pytest.approx(part / np.hypot(1e4, 5773.5), rel=1e-9)
    assert first["effect"] > 1e-2 > last["effect"]
    # all of friction goes with q and ω: 0.6 of the tolerance is aimed at
    goal = 0.6 * 1e-2 / first["effect"]
    assert last["exponent"] == pytest.approx(first["exponent"] * goal, rel=1e-6)
    told = f"by about {last['effect']:.2g}, below the tolerance of 0.01, with q = "
    assert told + f"{last['exponent']:.2g}, ω = {last['omega']:.2g}" in results.printed
    assert f"after {len(results.summary['sharpened'])} run(s)" in results.printed
