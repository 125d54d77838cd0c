"""Profiles along the strip, line loads and shares of friction, against the states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import reported_scenes as scenes
from reported_files import Results, Surface, explained, ran, rows_of
from reported_rollers import Look
from reported_states import looks_at
from scipy.optimize import brentq

from anmstrip import Scene
from anmstrip.mechanics.contact import Contact
from anmstrip.results.rollers import ContactState

E, NU = 2.0e11, 0.3
D = E * 1e-9 / 12.0 / (1.0 - NU**2)
HALVES = np.array([0.0, 0.5, 1.0])


@pytest.fixture(params=["turning", "shell"])
def results(request: pytest.FixtureRequest) -> Results:
    found: Results = request.getfixturevalue(request.param)
    return found


def profiles(results: Results) -> dict[float, dict[str, np.ndarray]]:
    """Columns of ``profile.csv`` at every written time; NaN where empty."""
    found: dict[float, dict[str, list[float]]] = {}
    for row in rows_of(results.directory / "profile.csv"):
        table = found.setdefault(float(row["time"]), {name: [] for name in row})
        for name, value in row.items():
            table[name].append(float(value) if value else np.nan)
    return {t: {n: np.array(v) for n, v in table.items()} for t, table in found.items()}


class Stations:
    """Means over the lines of contact points across, of values (patch, 3, 3) by contact point."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        flat = np.round(surface.at_contact(surface.reference)[..., :2], 8).reshape(-1, 2)
        _, self.point = np.unique(flat, axis=0, return_inverse=True)
        self.count = np.bincount(self.point)
        self.areas = np.bincount(self.point, surface.areas.ravel())
        first = np.unique(self.point, return_index=True)[1]
        self.x, self.station = np.unique(flat[first, 0], return_inverse=True)

    def points(self, values: np.ndarray) -> np.ndarray:
        """Return the mean over the patches that share a point."""
        return np.bincount(self.point, values.ravel()) / self.count

    def mean(self, values: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the mean over each line by area; NaN where all weights are 0."""
        w = self.areas * (1.0 if weights is None else self.points(weights))
        with np.errstate(invalid="ignore"):
            total = np.bincount(self.station, w * self.points(values))
            return np.asarray(total / np.bincount(self.station, w))


def same(found: np.ndarray, expected: np.ndarray, share: float = 1e-6) -> None:
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    bound = share * np.nanmax(np.abs(expected))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=bound)


def test_a_profile_is_written_with_every_state(results: Results) -> None:
    assert list(profiles(results)) == [time for time, _ in results.states]


def test_profiles_are_means_over_the_width(results: Results) -> None:
    """Positions, pressure, tension, curvature and moment of the last state."""
    surface, (*_, table) = results.last, profiles(results).values()
    stations, t = Stations(surface), 1e-3
    for k, name in enumerate("xyz"):
        place = surface.at_contact(surface.positions)[..., k]
        np.testing.assert_allclose(table[name], stations.mean(place), atol=1e-9)
    np.testing.assert_allclose(table["arc_length"], stations.x - stations.x[0], atol=1e-7)
    pressure = sum(look.pressure for look in looks_at(results, surface).values())
    same(table["pressure"], stations.mean(np.asarray(pressure)))
    xx = surface.at_contact(surface.patch("membrane_force")[..., 0])
    slope = np.linalg.norm(surface.derivative_at(HALVES, surface.positions, 1), axis=-1)
    along, across, twist = np.moveaxis(surface.curvature_at(HALVES), -1, 0)
    across = 0.0 * across if results.name == "turning" else across
    stiffness = E * t**3 / 12.0 / (1.0 - NU**2)
    bent = stiffness * ((along + NU * across) * along + (1.0 - NU) * twist**2)
    tension = stations.points(xx * slope + bent / slope)
    mean = stations.mean(xx * slope + bent / slope)
    for name, choose in (("tension_min", np.min), ("tension_max", np.max)):
        lines = [choose(tension[stations.station == k]) for k in range(len(stations.x))]
        beside = np.array(lines) - mean
        np.testing.assert_allclose(table[name] - table["tension"], beside, atol=1e-4 * mean.max())
    same(table["curvature"], stations.mean(along))
    same(table["moment"], stations.mean(stiffness * (along + NU * across)))


def test_tension_is_in_equilibrium_with_what_rollers_and_weight_do(results: Results) -> None:
    """Amid elements, by statics from that of the first one, in which strip hardly bends."""
    surface, (*_, table) = results.last, profiles(results).values()
    stations, widths = Stations(surface), surface.sizes[1]
    given = sum(
        look.pressure[..., None] * look.normal + look.traction
        for look in looks_at(results, surface).values()
    )
    forces = np.asarray(given) * surface.areas[..., None]
    if results.name == "shell":
        forces[..., 2] -= 9.81 * 7850.0 * 1e-3 * surface.areas
    x = surface.reference[:, 0, 0, 0]
    order = np.unique(np.round(x, 8), return_inverse=True)[1].ravel()
    bins = np.zeros((order.max() + 1, 3))
    np.add.at(bins, order, forces.sum(axis=(1, 2)))
    own = np.zeros_like(bins)
    np.add.at(own, order, (forces * np.array([1.0, 0.5, 0.0])[:, None]).sum(axis=(1, 2)))
    before = bins.cumsum(axis=0) - bins + own
    slope = surface.derivative_at(HALVES, surface.positions, 1)
    along = np.stack([stations.mean(slope[..., k]) for k in range(3)], axis=-1)[1::2]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    found = table["tension"][1::2] * np.bincount(order, widths)[0]
    whole = found[0] * along[0] + before[0] - before
    same(found, np.sum(whole * along, axis=-1), 1e-4)
    assert np.ptp(found) > 0.05 * found.max()  # friction


def test_slip_and_share_of_the_cone_are_those_in_contact(results: Results) -> None:
    """Slip along the tangent towards the exit; friction of a line over what f bears there."""
    surface, (*_, table) = results.last, profiles(results).values()
    stations = Stations(surface)
    tangent = surface.derivative_at(HALVES, surface.positions, 1)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    slip, touching, rub, cone = (np.zeros(tangent.shape[:-1]) for _ in range(4))
    for look in looks_at(results, surface).values():
        slip += np.sum(look.slip * tangent, axis=-1) * look.touching
        rub += np.linalg.norm(look.traction, axis=-1) * look.touching
        cone += look.shape.friction * look.pressure * look.touching
        touching += look.touching
    # the shell's direction along is taken across its normal and y, which leans by 1e-2
    same(table["slip"], stations.mean(slip, touching), 1e-4)
    shares = np.where(cone > 0.0, rub / np.where(cone > 0.0, cone, 1.0), 0.0)
    same(table["cone_share"], stations.mean(shares, cone), 1e-5)


def lift_off(look: Look, tensions: tuple[float, float], sense: float) -> float:
    """Place of an end: a load there, with N/r behind it, balances what presses near it.

    The forces within 2 √(D/T) of the end and N/r from the load on have the same sum and moment;
    N is T less D/(2 r²) and what friction takes up to every place.
    """
    tension, radius = tensions[:: int(sense)][0], look.shape.radius
    width = look.surface.width
    x = sense * look.surface.at_contact(look.surface.reference)[..., 0]
    ends = sorted(sense * v for v in look.arc)
    point = min(ends[0] + 2.0 * np.sqrt(D / tension), 0.5 * sum(ends))
    share = look.surface.areas / width
    tangent = look.surface.derivative_at(HALVES, look.surface.positions, 1)
    tangent *= sense / np.linalg.norm(tangent, axis=-1, keepdims=True)
    rubbed = np.sum(look.traction * tangent, axis=-1) * share
    _, number = np.unique(np.round(x, 9), return_inverse=True)
    whole = np.bincount(number.ravel(), rubbed.ravel())
    taken = (np.cumsum(whole) - 0.5 * whole)[number].reshape(x.shape)
    pressure = look.pressure + taken / radius
    before = up_to(x, pressure * share, point)
    kappa = (tension - 0.5 * D / radius**2) / radius
    moment = (pressure * share * np.maximum(point - x, 0.0)).sum()

    def left(u: float) -> float:
        return float((before - kappa * u) * u + 0.5 * kappa * u**2 - moment)

    return sense * (point - float(brentq(left, 0.0, before / kappa)))


def up_to(x: np.ndarray, values: np.ndarray, point: float) -> float:
    """Sum of values up to a point, each counted half at its own place and linear in between."""
    places, number = np.unique(np.round(x, 9), return_inverse=True)
    whole = np.bincount(number.ravel(), values.ravel())
    return float(np.interp(point, places, np.cumsum(whole) - 0.5 * whole))


def test_wraps_are_in_equilibrium_with_the_pressure(results: Results) -> None:
    """Elements of 2.8 √(D/T) do not resolve the line loads there."""
    surface, rollers = results.last, results.summary["rollers"]
    *_, table = profiles(results).values()
    for name, look in looks_at(results, surface).items():
        values = rollers[name]
        tensions = values["tension_in"], values["tension_out"]
        angles = [look.angle_at(lift_off(look, tensions, sense)) for sense in (1.0, -1.0)]
        assert values["wrap"] == pytest.approx(np.ptp(angles), abs=2e-4)
        assert values["line_load_in"] is values["line_load_out"] is None
    assert np.isnan(table["line_load"]).all()


WRAPPED = """
[strip]
kinematics = "section"
width = 0.5
thickness = 1.0e-3
cells = [16, 2]
refined = {refined}

[material]
young = 2.0e11
poisson = 0.3

[contact]

[threading]
tension = 1.0e4
entry = [-2.0, 0.0, -1.0]
exit = [2.0, 0.0, -1.0]

[[rollers]]
radius = 0.5
centre = [0.0, 0.0, -0.5]
wrap = "over"

[edges.entry]
fixed = ["x", "z"]

[[stages]]
duration = 1.0
friction = false
"""


@pytest.fixture(scope="module", params=[0.02, 0.01, 0.005])
def wrapped(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A strip at rest on a roller, on meshes of 1/2 to 1/8 of √(D/T) = 43 mm."""
    text = WRAPPED.format(refined=request.param)
    return ran(text, tmp_path_factory.mktemp("wrapped"), options=("--quiet",))


def test_line_loads_are_those_of_the_theory_on_every_mesh(wrapped: Results) -> None:
    """√(D T)/r, whatever the peak of the pressure: 2, 3 and 4.5 times T/r."""
    (values,) = wrapped.summary["rollers"].values()
    loads = values["line_load_in"], values["line_load_out"]
    assert loads == pytest.approx([np.sqrt(D * 1e4) / 0.5] * 2, rel=0.02)
    *_, table = profiles(wrapped).values()
    assert table["line_load"][np.isfinite(table["line_load"])].tolist() == list(loads)
    (row,) = [line.split() for line in wrapped.printed.splitlines() if line.startswith("r1 ")]
    assert row[-2:] == [f"{load:.3g}" for load in loads]


STIFF = """
[strip]
kinematics = "section"
width = 1.0
thickness = 3.0e-3

[material]
young = 2.0e11
poisson = 0.3

[contact]

[threading]
tension = 6.0e3
entry = {entry}
exit = {exit}

[[rollers]]
radius = 0.3
centre = [0.0, 0.0, 0.0]
wrap = "over"

[edges.entry]
fixed = ["x", "z"]

[edges.exit]
fixed = ["x", "z"]

[[stages]]
"""


@pytest.mark.parametrize(("x", "z"), [(2.3, -4.0), (1.7, -4.0)])
def test_line_loads_of_stiff_strip_are_those_of_the_elastica(
    x: float, z: float, tmp_path: Path
) -> None:
    """Its √(D/T) is the radius of the roller, its turn of 120° to 134° leaves 6° to 20° of contact.

    Of an elastica that nothing touches T cos θ + D κ²/2 is T: where it leaves the circle with the
    curvature 1/r it is at θ to where its ends pull it, and presses by T sin θ.
    """
    results = ran(STIFF.format(entry=[-x, 0, z], exit=[x, 0, z]), tmp_path, options=("--quiet",))
    (values,) = results.summary["rollers"].values()
    before, behind = (np.array(results.summary["edges"][n]["force"]) for n in ("entry", "exit"))
    pull = np.linalg.norm(before)
    theta = np.arccos(1.0 - 0.5 * 27.0 * D / 0.3**2 / pull)
    loads = values["line_load_in"], values["line_load_out"]
    assert loads == pytest.approx([pull * np.sin(theta)] * 2, rel=0.015)
    turn = np.arccos(-before @ behind / pull / np.linalg.norm(behind))
    assert values["wrap"] == pytest.approx(turn - 2.0 * theta, abs=0.1)


SLIPPING = """
[strip]
kinematics = "section"
width = 1.0
thickness = 1.0e-4

[material]
young = 2.0e11
poisson = 0.3

[friction]
coefficient = 1.8

[threading]
tension = 1.0e3
entry = [-0.6, 0.0, -0.8]
exit = [0.6, 0.0, -0.8]

[[rollers]]
radius = 0.3
centre = [0.0, 0.0, 0.0]
wrap = "over"

[edges.entry]
fixed = ["x", "z"]

[[stages]]
name = "turn"
duration = 1.0
rollers.r1.surface_speed = 0.01
"""


def test_wraps_are_those_of_the_theory_on_every_mesh(wrapped: Results) -> None:
    """The angle between both ends less √(D/T)/r at each, where the bent strip lifts off.

    To 0.1°, where the gap is that of a tenth of the pressure 2 to 5° farther out.
    """
    (values,) = wrapped.summary["rollers"].values()
    before, behind = (np.array(wrapped.summary["edges"][n]["force"]) for n in ("entry", "exit"))
    turn = np.arccos(-before @ behind / np.linalg.norm(before) / np.linalg.norm(behind))
    expected = turn - 2.0 * np.sqrt(D / 1e4) / 0.5
    assert values["wrap"] == pytest.approx(expected, abs=np.radians(0.1))
    assert wrapped.history["r1_wrap"][-1] == values["wrap"]


def test_a_wrap_on_which_friction_halves_the_tension_again_and_again_is_whole(
    tmp_path: Path,
) -> None:
    """Held strip on a roller that slips, f = 1.8: pressure falls by 80 times over 141°.

    A point is in contact by the pressure around it: by the mean over the roller the wrap ended
    where a tenth of the tension was left, and so did the tension behind the roller.
    """
    results = ran(SLIPPING, tmp_path, options=("--quiet",))
    (values,) = results.summary["rollers"].values()
    # between the tangents from the ends to the circle
    angle = 2.0 * (np.pi - np.arctan2(0.6, 0.8) - np.arccos(0.3))
    assert values["wrap"] == pytest.approx(angle, rel=0.02)
    assert values["tension_out"] == pytest.approx(1e3, rel=1e-4)
    assert values["tension_in"] > 50.0 * values["tension_out"]


@pytest.mark.parametrize(
    "settings",
    [
        ["threading.entry=[-2, 0, -0.1]", "threading.exit=[2, 0, -0.1]"],  # 5.8° < 2 √(D/T)/r
        ["strip.thickness=4e-5"],  # √(D/T) = 0.3 mm
    ],
    ids=["along a line", "thin"],
)
def test_there_are_no_line_loads_along_a_line_or_within_an_element(
    tmp_path: Path, settings: list[str]
) -> None:
    text = WRAPPED.format(refined=0.01)
    results = ran(text, tmp_path, *settings, options=("--quiet",))
    (values,) = results.summary["rollers"].values()
    assert (values["line_load_in"], values["line_load_out"]) == (None, None)
    *_, table = profiles(results).values()
    assert np.isnan(table["line_load"]).all()
    (row,) = [line.split() for line in results.printed.splitlines() if line.startswith("r1 ")]
    assert row[-2:] == ["–", "–"]
    if len(settings) == 2:
        assert values["wrap"] < np.radians(0.5)


def test_tension_does_not_swing_over_a_roller(wrapped: Results) -> None:
    """Without friction it is T less M κ/2, while what the strains make within elements swings."""
    surface = wrapped.last
    # on the roller M κ/2 = D/(2 r²) = 37 N/m; a mesh of half of √(D/T) adds 2 % where it lifts off
    size = surface.sizes[0].min()
    assert np.abs(surface.fields["tension"] / 1e4 - 1.0).max() < (0.04 if size > 0.015 else 0.02)
    raw = E * 1e-3 * surface.strain[..., 0]
    swings = {0.02: 5.0, 0.01: 2.0}.get(round(float(size), 2 if size > 0.006 else 3), 1.0)
    assert np.ptp(raw) > swings * np.ptp(surface.fields["tension"])


def test_tension_on_a_roller_is_the_pressure_times_its_radius(wrapped: Results) -> None:
    """T − D/(2 r²) in the middle half of the wrap, as beside it T less M κ/2: M κ was left out."""
    *_, table = profiles(wrapped).values()
    (values,) = wrapped.summary["rollers"].values()
    x = table["arc_length"] - 0.5 * np.ptp(table["arc_length"])
    inside = np.abs(x) < 0.25 * 0.5 * values["wrap"]
    expected = 1e4 - 0.5 * D / 0.5**2
    assert inside.sum() > 10
    assert table["tension"][inside] == pytest.approx(expected, abs=5.0)
    assert 0.5 * table["pressure"][inside].mean() == pytest.approx(expected, abs=6.0)
    if wrapped.last.sizes[0].min() < 0.006:
        kept = table["tension"] + 0.5 * table["moment"] * table["curvature"]
        assert kept == pytest.approx(1e4, rel=1e-3)


def test_capacity_used_is_that_of_eulers_formula(turning: Results, shell: Results) -> None:
    """|ln(T1/T2)| over f times the angle between the forces before and behind, at most 1."""
    for results in (turning, shell):
        before = np.array(results.summary["edges"]["entry"]["force"])
        for name, look in looks_at(results, results.last).items():
            values = results.summary["rollers"][name]
            after = before + look.resultant
            if results.name == "turning":
                unit = before / np.linalg.norm(before), after / np.linalg.norm(after)
                angle = np.arccos(unit[0] @ unit[1])
                ratio = np.log(values["tension_in"] / values["tension_out"])
                expected = min(abs(ratio) / (look.shape.friction * angle), 1.0)
                assert values["capacity_used"] == pytest.approx(expected, rel=1e-3)
            before = after
    front, back = (shell.summary["rollers"][name] for name in ("front", "back"))
    assert front["capacity_used"] == 1.0
    ratio = np.log(back["tension_out"] / back["tension_in"])
    # the weight of the strip between the rollers and on them turns the forces by some 1e-3
    turned = turn_of_back(shell)
    assert back["capacity_used"] == pytest.approx(ratio / (0.2 * turned), rel=5e-3)


def turn_of_back(shell: Results) -> float:
    """Angle between the strip's directions in the middle of the span before, and at the exit."""
    surface, looks = shell.last, looks_at(shell, shell.last)
    middle = 0.5 * (looks["front"].arc[1] + looks["back"].arc[0])
    x, slopes = surface.reference[..., 0], surface.tangents[0]
    before = slopes[np.abs(x - middle) < 0.1].mean(axis=0)
    unit = before / np.linalg.norm(before)
    return float(np.arccos(unit @ surface.edge("exit")))


def test_friction_in_a_stage_without_it_has_no_share(plate: Results) -> None:
    (values,) = plate.summary["rollers"].values()
    assert (values["capacity_used"], values["torque"]) == (None, 0.0)


# where contact begins and ends ---------------------------------------------------------------


def flat_contact(contact: Contact, depth: float) -> ContactState:
    """Points of a flat strip beside a roller of 0.5 m whose top is so deep in it."""
    n = len(contact.operator.chosen)
    full = np.zeros(2 * contact.operator.matrix.shape[1])
    x, controls = (
        contact.operator.apply(full),
        {"rollers.r.centre": np.array([0.0, 0.0, depth - 0.5])},
    )
    place = contact.seen(x, controls)
    pressure = np.maximum(contact.pressure(place), 0.0)
    still, normal = np.zeros((3, n)), contact.normal(place)
    arm, (near,) = np.full(n, 0.5), contact.elements_near(full, controls)
    return ContactState(
        contact, place.gap, normal, pressure, still, still, None, arm, 0.0, 0.0, near
    )


def test_wrap_and_arc_are_those_of_geometry_between_points_too(tmp_path: Path) -> None:
    """A flat strip lies in a roller over 2 arccos((r − d)/(r + h)), where h is the least gap.

    The roller comes up in steps of 2 µm through several points, which stand 25 mm apart: the wrap
    begins at 0 and grows without jumps, in steps of an eighth of what a point is wide at most.
    """
    path = tmp_path / "scene.toml"
    path.write_text(scenes.LIFTED)
    assembly = Scene.load(path).run().assembly
    assert assembly.contact is not None
    contact = assembly.contact.by_roller["r"]
    wraps = []
    for depth in np.arange(-1e-3, 5e-3, 2e-6):
        state = flat_contact(contact, depth)
        h = float(contact.signorini.gap(state.least[state.gap.argmin()] + contact.least))
        cosine = (0.5 - depth) / (0.5 + h)
        expected = 2.0 * np.arccos(cosine) if cosine < 1.0 else 0.0
        wraps.append(float(np.ptp(state.ends[0])) if state.ends.size else 0.0)
        assert wraps[-1] == pytest.approx(expected, abs=2e-4)
        if expected > 0.0:
            half = np.sqrt((0.5 + h) ** 2 - (0.5 - depth) ** 2)
            assert state.arc == (pytest.approx(-half, abs=1e-4), pytest.approx(half, abs=1e-4))
    assert wraps[0] == 0.0
    assert 0.0 < np.abs(np.diff(wraps)).max() < 0.025 / 0.5 / 8.0 + 2e-4


def test_the_end_of_a_run_is_a_table_by_roller(shell: Results, tmp_path: Path) -> None:
    """Within 100 columns, all numbers of the summary to their digits; warnings as of explain."""
    lines = shell.printed.splitlines()[1:-1]  # without the message and the directory
    assert max(map(len, lines)) <= 100
    for name, r in shell.summary["rollers"].items():
        (row,) = [line.split() for line in lines if line.startswith(f"{name} ")]
        keys = ("tension_in", "tension_out", "normal_force", "torque")
        whole = [".0f" if 1e3 <= abs(r[key]) < 1e7 else ".4g" for key in keys]
        four = [f"{np.degrees(r['wrap']):.4g}"]
        four += [format(r[key], form) for key, form in zip(keys, whole, strict=True)]
        used = f"{100.0 * r['capacity_used']:.3g}", "%"
        # of elements of 0.12 m there are no line loads
        arc = "–" if r["slip_arc"] is None else f"{np.degrees(r['slip_arc']):.3g}"
        aside = f"{round(1e3 * r['offset'], 3) + 0.0:.3f}"
        read = f"{r['max_slip']:.3g}", arc, *used, "–", "–", aside
        assert row == [name, *four, *read]
    told = " ".join(shell.printed.split())
    edges = shell.summary["edges"]
    for name in ("entry", "exit"):
        assert f"{edges[name]['tension']:.6g} N/m at the {name}" in told
    before = " ".join(explained(scenes.SHELL, tmp_path).split())
    told = " ".join(f"{shell.progress} {told}".split())  # what is told before as well
    warnings = [f"Warning: {line}" for line in shell.summary["warnings"]]
    assert all(line in text for line in warnings for text in (told, before))
    assert len(warnings) == told.count("Warning: ") == before.count("Warning: ") >= 2


# which states are written --------------------------------------------------------------------


def test_about_a_hundred_states_are_written_by_default(tmp_path: Path) -> None:
    """The beginning, the first step in every hundredth of the time, and the ends of the stages."""
    results = ran(scenes.TURNING, tmp_path, "solver.time_step=2.2e-3", options=("--quiet",))
    times = results.history["time"]
    assert len(times) > 120
    ends = [max(times[np.array(results.history["stage"]) == s]) for s in ("pull", "wrap", "turn")]
    firsts = [times[times >= k * 2.9 / 100.0 - 1e-12].min() for k in range(1, 101)]
    written = [time for time, _ in results.states]
    assert written == pytest.approx(sorted({0.0, *ends, *firsts}))
    start = results.surfaces[0]
    assert not start.fields["displacement"].any()


def test_the_first_state_of_a_threaded_strip_is_that_around_its_rollers(shell: Results) -> None:
    """At t = 0 it lies where its path begins: under tension, on both rollers."""
    time, surface = shell.states[0][0], shell.surfaces[0]
    assert time == 0.0
    looks = looks_at(shell, surface)
    assert all(np.abs(look.gap).min() < 5e-3 for look in looks.values())
