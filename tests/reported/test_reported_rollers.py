"""Forces, wraps, slips and tensions of every step, against the files of its state and statics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import reported_scenes as scenes
from reported_files import Results, Surface, ran
from reported_rollers import Look
from reported_states import looks_at

from anmstrip import Scene

G, D = 9.81, 2.0e11 * 1e-9 / 12.0 / (1.0 - 0.3**2)

LEFT = 1e-3
"""Imbalance that a tolerance of 1e-3 leaves, as a share of the largest edge force."""


def applied(results: Results, time: float) -> np.ndarray:
    """Force on the exit (N): the dead load of the stages."""
    if results.name == "turning":
        pulled = 1.0e4 * np.clip(time / 2.0, 0.0, 1.0)
        return 0.8 * np.array([pulled, 0.0, -5773.5 * np.clip((time - 2.0) / 0.5, 0.0, 1.0)])
    if results.name == "plate":
        return 0.4 * np.array([1.0e4 * min(time, 1.0), 0.0, 0.0])
    slope = leaving()
    return 0.6 * 1.0e4 * slope


def leaving() -> np.ndarray:
    """Direction in which the threaded strip leaves the second roller for the exit.

    The mid-surface runs at the radius, under the roller: with d from its centre to the exit and
    l² = d² − r², the direction is d turned by the angle whose sine is r/d.
    """
    d = np.array([2.5 - 1.3, 0.5 + 1.2])
    turn = np.arcsin(0.4 / np.hypot(*d))
    angle = np.arctan2(d[1], d[0]) + turn
    return np.array([np.cos(angle), 0.0, np.sin(angle)])


def weight(results: Results, surface: Surface, until: float = np.inf) -> np.ndarray:
    """Weight of the strip up to a place on it (N)."""
    if results.name != "shell":
        return np.zeros(3)
    share = np.clip(surface.time - 1.0, 0.0, 1.0)
    start = surface.reference[..., 0].min()
    length = min(until - start, surface.length)
    return np.array([0.0, 0.0, -G * share * 7850.0 * 1e-3 * surface.width * length])


def every_state(results: Results) -> list[tuple[int, Surface, dict[str, Look]]]:
    """Rows of the history with their states and rollers, a dozen of them."""
    surfaces = results.surfaces[1:]
    count = len(surfaces)
    rows = sorted({*range(0, count, max(1, count // 12)), count - 1, count - 2})
    return [(k, s, looks_at(results, s)) for k, s in enumerate(surfaces) if k in rows]


@pytest.fixture(params=["turning", "shell", "plate"])
def results(request: pytest.FixtureRequest) -> Results:
    found: Results = request.getfixturevalue(request.param)
    return found


def test_every_step_has_a_row_and_a_state(results: Results) -> None:
    """The beginning has a state alone."""
    start, *times = [time for time, _ in results.states]
    assert start == 0.0
    np.testing.assert_array_equal(results.history["time"], times)
    np.testing.assert_array_equal(results.history["step"], np.arange(1, len(times) + 1))


def test_rows_of_rollers_are_those_of_the_states(results: Results) -> None:
    """Sums by Simpson's rule over the file's patches; to round-off of the gaps over the onset.

    The wrap is that of the summary, which has a test of its own.
    """
    for name, reading in told(results)[0].items():
        assert results.history[f"{name}_wrap"][-1] == reading["wrap"]
    for row, _, looks in every_state(results):
        for name, look in looks.items():
            row_told = {key: results.history[f"{name}_{key}"][row] for key in COLUMNS}
            assert row_told["normal_force"] == pytest.approx(look.normal_force, rel=1e-6, abs=1e-9)
            assert row_told["drag"] == pytest.approx(look.drag, rel=1e-5, abs=1e-6)
            assert row_told["torque"] == pytest.approx(look.torque, rel=1e-5, abs=1e-6)
            assert row_told["surface_speed"] == pytest.approx(look.speed, rel=1e-12, abs=1e-15)
            largest = look.speeds.max(initial=0.0)
            assert row_told["max_slip"] == pytest.approx(largest, rel=1e-7, abs=1e-12)


COLUMNS = ("normal_force", "drag", "wrap", "max_slip", "surface_speed", "torque")


def test_columns_are_those_of_the_rollers(results: Results) -> None:
    wanted = [f"{name}_{key}" for name in looks_at(results, results.last) for key in COLUMNS]
    own = ["stage", "time", "step", "tangents", "order", "range", "residual"]
    assert list(results.history) == [*own, "entry_tension", "exit_tension", *wanted]


def test_tensions_of_the_ends_are_those_of_equilibrium(results: Results) -> None:
    """What the rollers, the load at the exit and the weight do, the entry holds.

    Along the strip's own direction at the end.  A step leaves a residual below the tolerance.
    """
    for row, surface, looks in every_state(results):
        outside = applied(results, surface.time) + weight(results, surface)
        held = -outside - sum(look.resultant for look in looks.values())
        expected = -held @ surface.edge("entry") / surface.width
        share = 2e-5 if results.name == "turning" else LEFT
        found = results.history["entry_tension"][row]
        assert found == pytest.approx(expected, rel=share, abs=share * 1e4)
        given = applied(results, surface.time)
        if results.name == "plate":
            given = given + lever(looks["r1"])
        expected = given @ surface.edge("exit") / surface.width
        assert results.history["exit_tension"][row] == pytest.approx(expected, rel=2e-5, abs=1.0)


def lever(look: Look) -> np.ndarray:
    """What holds the exit of a lifted plate: the roller's pressure times its distance, over L."""
    x = look.surface.at_contact(look.surface.reference)[..., 0]
    moment = look.surface.integral(look.pressure * look.normal[..., 2] * (x - x.min()))
    return np.array([0.0, 0.0, -moment / look.surface.length])


def test_both_ends_of_a_plate_hold_it_down(plate: Results) -> None:
    """By the lever rule, with vertical forces alone; the plate bends by the membrane's pull too."""
    (look,) = looks_at(plate, plate.last).values()
    exit_force, total = lever(look), look.resultant[2]
    edges = plate.summary["edges"]
    assert edges["exit"]["force"][2] == pytest.approx(exit_force[2], rel=1e-4)
    assert edges["entry"]["force"][2] == pytest.approx(-total - exit_force[2], rel=1e-4)
    assert total > 50.0


def test_the_membrane_carries_the_tensions(turning: Results, shell: Results) -> None:
    """Mean of N over the lines of points next to an end, of a strip that is straight there."""
    for results, share in ((turning, 2e-3), (shell, 5e-3)):
        surface = results.last
        x = surface.reference[..., 0]
        for place, name in ((x.min(), "entry"), (x.max(), "exit")):
            near = np.abs(x - place) < 0.2
            forces = surface.patch("membrane_force")[near][:, 0]
            told = results.summary["edges"][name]["tension"]
            assert forces.mean() == pytest.approx(told, rel=share)


def test_a_tension_that_follows_is_told(tmp_path: Path) -> None:
    """Of an arc of radius T/p over the chord c: T along it, p c/2 down at each of its ends."""
    results = ran(scenes.INFLATED, tmp_path, options=("--quiet",))
    edges, surface = results.summary["edges"], results.last
    chord = np.ptp(surface.points[:, 0])
    for name, outward in (("entry", -1.0), ("exit", 1.0)):
        assert edges[name]["tension"] == pytest.approx(1.0e4, rel=2e-3)
        x, _, z = edges[name]["force"]
        assert np.hypot(x, z) == pytest.approx(0.5 * 1.0e4, rel=1e-3)
        assert z == pytest.approx(-0.5 * 8.0e3 * chord * 0.5, rel=1e-3)
        assert np.sign(x) == outward
    radius = 1.0e4 / 8.0e3
    top = surface.points[:, 2].max()
    assert top == pytest.approx(radius - np.sqrt(radius**2 - 0.25 * chord**2), rel=1e-3)
    assert edges["exit"]["tension"] == results.history["exit_tension"][-1]


# the summary -----------------------------------------------------------------------------------


def told(results: Results) -> tuple[dict[str, Any], dict[str, Look]]:
    return results.summary["rollers"], looks_at(results, results.last)


def test_the_summary_tells_of_the_last_state(results: Results) -> None:
    rollers, _ = told(results)
    for name, values in rollers.items():
        for key in COLUMNS:
            assert values[key] == results.history[f"{name}_{key}"][-1]
    for edge in ("entry", "exit"):
        tension = results.summary["edges"][edge]["tension"]
        assert tension == results.history[f"{edge}_tension"][-1]


def test_edge_forces_are_those_of_equilibrium(results: Results) -> None:
    surface, (_, looks) = results.last, told(results)
    edges = results.summary["edges"]
    largest = np.linalg.norm(applied(results, surface.time))
    given = applied(results, surface.time)
    np.testing.assert_allclose(edges["exit"]["force"][:2], given[:2], atol=1e-3 * largest)
    total = np.array(edges["entry"]["force"]) + edges["exit"]["force"]
    total += sum(look.resultant for look in looks.values()) + weight(results, surface)
    assert np.abs(total).max() < LEFT * largest
    if results.name != "plate":  # whose exit is held in z
        assert edges["exit"]["force"][2] == pytest.approx(given[2], rel=1e-4)
    tangents = {"entry": -surface.edge("entry"), "exit": surface.edge("exit")}
    for edge, outward in tangents.items():
        along = np.array(edges[edge]["force"]) @ outward / surface.width
        assert edges[edge]["tension"] == pytest.approx(along, rel=1e-9)


def direction(surface: Surface, x: float) -> np.ndarray:
    """Unit vector along the strip at a reference x, mean over the lines of nodes across."""
    corners = np.ix_(range(len(surface.reference)), (0, 3), (0, 3))
    lines, number = np.unique(np.round(surface.reference[corners][..., 0], 8), return_inverse=True)
    slopes = surface.tangents[0][corners].reshape(-1, 3).T
    count = np.bincount(number.ravel())
    means = (np.bincount(number.ravel(), part) / count for part in slopes)
    found = np.array([np.interp(x, lines, mean) for mean in means])
    return np.asarray(found / np.linalg.norm(found))


def test_tensions_beside_the_rollers_are_those_of_equilibrium(results: Results) -> None:
    """From the entry on: its force, what the rollers before do, and the weight up to the arc.

    Of that the part along the strip 4 √(D/T) away, at most half of the way to the next arc.
    """
    surface, (rollers, looks) = results.last, told(results)
    force = np.array(results.summary["edges"]["entry"]["force"])
    x = surface.reference[..., 0]
    arcs = {name: look.arc for name, look in looks.items() if look.touching.any()}
    stops = [x.min(), *(end for arc in arcs.values() for end in arc), x.max()]
    for number, (name, look) in enumerate(looks.items()):
        if name not in arcs:
            keys = "tension_in", "tension_out", "tension_ratio"
            assert [rollers[name][key] for key in keys] == [None] * 3
            continue
        expected = []
        for side, end in enumerate(look.arc):
            pull = force + side * look.resultant + weight(results, surface, end)
            layer = np.sqrt(D * surface.width / np.linalg.norm(pull))
            away = stops[2 * (number + side) : 2 * (number + side) + 2]
            place = end + (2 * side - 1) * min(4.0 * layer, 0.5 * (away[1] - away[0]))
            expected.append(-pull @ direction(surface, place) / surface.width)
        force = force + look.resultant
        assert rollers[name]["tension_in"] == pytest.approx(expected[0], rel=1e-6)
        assert rollers[name]["tension_out"] == pytest.approx(expected[1], rel=1e-6)
        ratio = expected[0] / expected[1]
        assert rollers[name]["tension_ratio"] == pytest.approx(ratio, rel=2e-6)


def test_moments_about_the_axis_balance(turning: Results) -> None:
    """(T_in − T_out) W acts at the radius, and so does the drag, a gap of 1e-4 m apart.

    What the bent strip carries on at both ends of the arc is the same.
    """
    (values,) = told(turning)[0].values()
    difference = 0.8 * (values["tension_in"] - values["tension_out"])
    assert difference == pytest.approx(values["drag"], rel=3e-3)


def test_the_tension_ratio_is_that_of_the_capstan(turning: Results) -> None:
    """e^(f' θ) with f' = f s(v) at the speed of slip and θ between the straight parts.

    The bending stiffness takes D/(2 r² T) of the wrap's effect, and the roller moves sideways;
    both are below 0.2 per cent.
    """
    (values,), surface = told(turning)[0].values(), turning.last
    law = looks_at(turning, surface)["r1"].shape.law
    ends = [surface.edge(name) for name in ("entry", "exit")]
    angle = np.arccos(ends[0] @ ends[1])
    expected = np.exp(0.3 * law.share(np.array(values["creep_speed"])) * angle)
    assert values["tension_ratio"] == pytest.approx(expected, rel=3e-3)


def test_creep_is_the_slip_along_the_turning(turning: Results, shell: Results) -> None:
    for results in (turning, shell):
        rollers, looks = told(results)
        for name, look in looks.items():
            found = rollers[name]["creep_speed"]
            assert found == pytest.approx(look.creep_speed, rel=1e-6)
    assert abs(rollers["back"]["creep_speed"]) < abs(rollers["front"]["creep_speed"])


def test_what_is_beyond_the_cone_is_told(turning: Results, shell: Results) -> None:
    """Norton and Hoff's law at ten times V_c is 12 per cent beyond f; what sticks is within."""
    for results in (turning, shell):
        rollers, looks = told(results)
        for name, look in looks.items():
            expected = max(0.0, look.shares.max() - 1.0)
            assert rollers[name]["cone_violation"] == pytest.approx(expected, rel=1e-6)
    assert turning.summary["rollers"]["r1"]["cone_violation"] > 0.1
    assert rollers["front"]["cone_violation"] > 0.01
    assert rollers["back"]["cone_violation"] == 0.0


# what regularisation costs ------------------------------------------------------------------------


def test_what_sticks_creeps_at_most_so_fast(shell: Results, turning: Results) -> None:
    """Largest slip of the points whose friction is below 95 per cent of the cone."""
    for results in (shell, turning):
        rollers, looks = told(results)
        for name, look in looks.items():
            expected = look.speeds[look.shares < 0.95].max(initial=0.0)
            assert rollers[name]["sticking_creep"] == pytest.approx(expected, rel=1e-6)
    assert shell.summary["rollers"]["back"]["sticking_creep"] > 1e-5


def test_penetration_is_the_largest_distance_in_contact(results: Results) -> None:
    rollers, looks = told(results)
    for name, look in looks.items():
        expected = np.abs(look.gap[look.touching]).max(initial=0.0)
        assert rollers[name]["penetration"] == pytest.approx(expected, abs=1e-11)


def test_creep_stretches_what_stays_on_the_roller(shell: Results) -> None:
    """Creep over the arc is a rate of strain; while a point stays it adds up, beside T/(E t)."""
    rollers, looks = told(shell)
    for name, look in looks.items():
        values = rollers[name]
        effect = values["regularisation_effect"]
        arc = values["wrap"] * look.shape.radius
        carried = abs(look.speed - values["creep_speed"])
        stay = min(arc / carried, shell.last.time)
        tension = max(values["tension_in"], values["tension_out"])
        expected = values["sticking_creep"] * stay / arc * 2.0e11 * 1e-3 / tension
        assert effect["creep"] == pytest.approx(expected, rel=1e-9)
    assert effect["creep"] > 1.0


def test_what_is_carried_stays_for_its_way_over_the_roller(fed: Results) -> None:
    """At the strip's speed, which is the surface's of 2 m/s less the creep, not since 1.2 s."""
    (values,) = fed.summary["rollers"].values()
    stay = values["wrap"] * 0.3 / (2.0 - values["creep_speed"])
    assert stay < 0.1
    tension = max(values["tension_in"], values["tension_out"])
    strain = values["sticking_creep"] * stay / (values["wrap"] * 0.3)
    expected = strain / (tension / (2.0e11 * 1e-3))
    assert values["regularisation_effect"]["creep"] == pytest.approx(expected, rel=1e-9)


def test_friction_beyond_the_cone_is_a_share_of_the_tension(
    turning: Results, shell: Results
) -> None:
    for results in (turning, shell):
        rollers, looks = told(results)
        for name, look in looks.items():
            values = rollers[name]
            size = np.linalg.norm(look.traction, axis=-1)
            beyond = np.maximum(size - look.shape.friction * look.pressure, 0.0) * look.touching
            tension = max(values["tension_in"], values["tension_out"])
            expected = look.surface.integral(beyond) / tension / look.surface.width
            found = values["regularisation_effect"]["cone"]
            assert found == pytest.approx(expected, rel=1e-5, abs=1e-12)
    assert turning.summary["rollers"]["r1"]["regularisation_effect"]["cone"] > 0.01


def test_penetration_goes_with_the_radius_and_between_fibres(results: Results) -> None:
    """h/r, and the fibre whose mean gap is farthest from the others': its way over r T/(E t)."""
    rollers, looks = told(results)
    for name, look in looks.items():
        values = rollers[name]
        tension = max(values["tension_in"], values["tension_out"])
        fibres = fibre_gaps(look)
        apart = np.abs(fibres - fibres.mean()).max()
        uneven = 0.0 if results.name == "turning" else apart / (tension / (2.0e11 * 1e-3))
        expected = (values["penetration"] + uneven) / look.shape.radius
        found = values["regularisation_effect"]["penetration"]
        assert found == pytest.approx(expected, rel=1e-5)


def fibre_gaps(look: Look) -> np.ndarray:
    """Mean gap of the points that touch, for every line of points along the strip."""
    places = look.surface.at_contact(look.surface.reference)[look.touching]
    gaps, found = look.gap[look.touching], {}
    for (x, y, _), gap in zip(np.round(places, 9), gaps, strict=True):
        found.setdefault(y, {})[x] = gap  # points that patches share count once
    return np.array([np.mean(list(fibre.values())) for fibre in found.values()])


def test_effects_add_up(results: Results) -> None:
    for values in results.summary["rollers"].values():
        effect = values["regularisation_effect"]
        parts = effect["creep"] + effect["cone"] + effect["penetration"]
        assert effect["total"] == pytest.approx(parts, rel=1e-12)


# rollers as they are drawn ------------------------------------------------------------------------


def surface_travel(results: Results, name: str, time: float) -> float:
    """Integral of the surface's speed, which grows linearly in its stage (m)."""
    if results.name == "turning":
        since = max(time - 2.5, 0.0)
        return 0.5 * since**2 * 1.0 / 0.4
    since = max(time - 2.0, 0.0)
    return 0.5 * since**2 * {"front": 0.002, "back": 0.0004}[name] / 0.1


@pytest.mark.parametrize("run", ["turning", "shell", "plate", "lifted"])
def test_rollers_are_drawn_where_they_are(run: str, request: pytest.FixtureRequest) -> None:
    """Points of the mantle stand at R(s) from the axis, in the middle of their circle."""
    results: Results = request.getfixturevalue(run)
    assert [time for time, _ in results.drawn] == [time for time, _ in results.states]
    for (_, mesh), surface in zip(results.drawn[::5], results.surfaces[::5], strict=True):
        looks = looks_at(results, surface)
        assert set(mesh.point_data["roller"]) == set(range(len(looks)))
        for number, look in enumerate(looks.values()):
            points = mesh.points[mesh.point_data["roller"] == number]
            away = points - np.array(look.shape.centre) - look.move
            s = away @ look.axis
            distance = np.linalg.norm(away - s[:, None] * look.axis, axis=1)
            mantle = distance > 1e-9
            radius = np.polynomial.Polynomial([look.shape.radius, *look.shape.crown])(s)
            np.testing.assert_allclose(distance[mantle], radius[mantle], rtol=1e-12)
            assert (s.min(), s.max()) == pytest.approx(
                (-0.6 * surface.width, 0.6 * surface.width), rel=1e-9
            )


def test_rollers_have_turned_by_the_travel_of_their_surface(
    turning: Results, shell: Results
) -> None:
    """The painted line of angle zero has left the top by travel over radius, in its sense."""
    for results in (turning, shell):
        names = list(looks_at(results, results.last))
        for (time, mesh), surface in zip(results.drawn, results.surfaces, strict=True):
            for number, name in enumerate(names):
                look = looks_at(results, surface)[name]
                mark = mesh.point_data["surface_angle"] == 0.0
                points = mesh.points[mark & (mesh.point_data["roller"] == number)]
                away = points - np.array(look.shape.centre) - look.move
                radial = away - (away @ look.axis)[:, None] * look.axis
                e = radial[np.linalg.norm(radial, axis=1) > 1e-9][0]
                top = np.array([0.0, 0.0, 1.0])
                top -= (top @ look.axis) * look.axis
                angle = np.arctan2(np.cross(top, e) @ look.axis, top @ e)
                travel = surface_travel(results, name, time)
                expected = look.shape.sense * travel / look.shape.radius
                assert angle == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_offsets_are_those_of_the_strip_where_it_runs_on(turning: Results, shell: Results) -> None:
    """Mean displacement along y over the line of nodes across, linear between the lines."""
    assert told(turning)[0]["r1"]["offset"] is None
    rollers, looks = told(shell)
    surface = shell.last
    corners = np.ix_(range(len(surface.reference)), (0, 3), (0, 3))
    flat = np.round(surface.reference[corners][..., :2], 8).reshape(-1, 2)
    nodes, first = np.unique(flat, axis=0, return_index=True)
    moved = surface.patch("displacement")[corners][..., 1].ravel()[first]
    lines, number = np.unique(nodes[:, 0], return_inverse=True)
    means = np.bincount(number, moved) / np.bincount(number)
    for name, look in looks.items():
        expected = np.interp(look.arc[0], lines, means)
        assert rollers[name]["offset"] == pytest.approx(expected, abs=1e-7)  # look.arc is sampled
    assert abs(rollers["back"]["offset"]) > 1e-5


@pytest.mark.parametrize("steady", [False, True])
def test_wrap_of_a_helix_is_what_its_tensions_say(tmp_path: Path, steady: bool) -> None:
    """Tape 0.2 mm thick goes around most of a roller and crosses itself.

    The wrap is that of the string less the lengths √(D/T) over which line loads at both ends turn
    the tape; it slips all along it where the entry is held, so that ln(T1/T2) = f θ.
    """
    text = f"""
        strip = {{ kinematics = "section", width = 0.02, thickness = 2.0e-4 }}
        material = {{ young = 1.2e11, poisson = 0.34 }}
        friction = {{ coefficient = 0.2 }}
        threading = {{ tension = 2.0e3, entry = [-0.5, 0.0, 0.0], exit = [0.35, 0.0, 0.5] }}
        edges.entry.fixed = ["x", "z"]
        rollers = [{{ radius = 0.06, centre = [0.0, 0.0, -0.06], wrap = "over", crossing = true }}]
        [[stages]]
        {"steady = true" if steady else "duration = 1.0"}
        {"entry.tension = 3.0e3" if steady else ""}
        rollers.r1.surface_speed = 0.1
    """
    found = ran(text, tmp_path)
    reading = found.summary["rollers"]["r1"]
    tensions = reading["tension_in"], reading["tension_out"]
    d = 1.2e11 * 8e-12 / 12.0 / (1.0 - 0.34**2)
    string = np.radians(307.2)
    expected = string - sum(np.sqrt(d / tension) for tension in tensions) / 0.06
    assert reading["wrap"] == pytest.approx(expected, abs=0.01)
    if not steady:
        assert reading["slip_arc"] == pytest.approx(reading["wrap"], rel=0.01)
        assert np.log(tensions[0] / tensions[1]) == pytest.approx(0.2 * string, rel=0.01)
    else:
        assert 0.0 < reading["slip_arc"] < 0.7 * reading["wrap"]
    assert not any("travels back" in words for words in found.summary["warnings"])


def test_line_loads_of_a_stiff_plate_are_those_of_the_elastica() -> None:
    """2.5 mm at the entry of a pickling line: 0, then none was told where it runs on the billy."""
    places = {"deflector": 0.0, "brake": 1.5, "billy": 3.0, "snub": 4.5, "puller": 6.0}
    rollers: list[dict[str, Any]] = []
    for name, x in places.items():
        above = name in ("deflector", "billy")
        rollers.append({"name": name, "radius": 0.3 if above else 0.4, "drive": "idle"})
        low = name in ("brake", "snub")
        rollers[-1] |= {"centre": [x, 0.0, -1.5 * low], "wrap": "under" if low else "over"}
        rollers[-1] |= {"bearing": 15.0} if above or name == "snub" else {}
    rollers[1]["drive"], rollers[-1]["drive"] = "torque", "speed"
    tables = {
        "strip": {"kinematics": "section", "width": 1.25, "thickness": 2.5e-3},
        "material": {"young": 2.06e11, "poisson": 0.3, "density": 7850.0},
        "contact": {},
        "friction": {"coefficient": 0.25},
        "threading": {"tension": 1.2e4, "entry": [-3.0, 0.0, 0.3], "exit": [6.4, 0.0, -3.0]},
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "rollers": rollers,
        "stages": [{
            "name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81],
            "entry": {"tension": 1.2e4}, "exit": {"tension": 1.3e4},
            "rollers": {"brake": {"torque": -3000.0}, "puller": {"surface_speed": 1.5}},
        }],
    }  # fmt: skip
    *_, last = Scene.from_tables(tables, "pickling.toml").run()
    bending = 2.06e11 * 2.5e-3**3 / 12.0 / 0.91
    for table in rollers:
        reading, half = last.state.rollers[table["name"]], 0.5 * bending / table["radius"] ** 2
        assert reading.tension_in is not None and reading.tension_out is not None
        tensions = np.array([reading.tension_in, reading.tension_out])
        expected = tensions * np.sin(np.arccos(1.0 - half / tensions))
        found = [reading.line_load_in, reading.line_load_out]
        assert found == pytest.approx(expected, rel=0.03)
