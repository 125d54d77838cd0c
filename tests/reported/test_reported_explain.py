"""What is said of a scene before it runs, against counts, geometry and formulas by hand."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import reported_scenes as scenes
from reported_files import explained

E, NU, T = 2.0e11, 0.3, 1.0e-3
D = E * T**3 / 12.0 / (1.0 - NU**2)
SLANTED = float(np.hypot(1.0e4, 5773.5))
ENTRY = np.array([-2.0, -0.45])


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Of the scenes that are run."""
    names = ("TURNING", "SHELL", "PLATE", "LIFTED")
    where = tmp_path_factory.mktemp("explained")
    return {name: explained(getattr(scenes, name), where) for name in names}


def row(text: str, name: str, after: str = "") -> list[str]:
    """Cells of the row of a table, behind a title."""
    _, _, rest = text.partition(after)
    line = next(line for line in rest.splitlines() if re.match(rf"{name}(,|\s)", line))
    return re.split(r"\s{2,}", line.strip())


def whole(text: str) -> str:
    """The text without the breaks of its lines."""
    return " ".join(text.split())


def turned_on_top(radius: float, centre: np.ndarray, before: np.ndarray, angle: float) -> float:
    """Wrap (rad) from the tangent that a point has to the top of a circle to a direction."""
    away = centre - before
    rise = np.arctan2(away[1], away[0]) + np.arcsin(radius / np.hypot(*away))
    return float(rise - angle)


WRAP = turned_on_top(0.5, np.array([0.01, -0.481]), ENTRY, -float(np.arctan2(5773.5, 1.0e4)))
"""Of the roller where it is at the end."""

BEFORE = turned_on_top(0.5, np.array([0.0, -0.501]), ENTRY, -float(np.arctan2(5773.5, 1.0e4)))
"""Of the roller where it is before it turns, when the strip is as steep as it gets."""


def test_the_strip_and_its_elements(said: dict[str, str]) -> None:
    """Elements of at most 0.1 m within a quarter of the circumference, else of a sixteenth."""
    quarter = 0.5 * np.pi * 0.5
    fine, coarse = np.ceil(2.0 * quarter / 0.1), np.ceil((2.0 - quarter) / 0.25)
    small, large = 2.0 * quarter / fine, (2.0 - quarter) / coarse
    elements = int(fine + 2 * coarse)
    assert (
        f"Strip 4 m × 0.8 m × 0.001 m, {elements} elements {small:.3g} to {large:.3g} m long, "
        f"{4 * (elements + 1)} unknowns, kinematics section, flat from x = -2 m (entry) to 2 m "
        "(exit)."
    ) in " ".join(said["TURNING"].split())


def test_a_threaded_strip_is_as_long_as_its_way(said: dict[str, str]) -> None:
    """Tangents and arcs between the points (x, z) of entry and exit; they are of mid-surfaces.

    The section of an axis that is not along y is an ellipse, longer by 1e-5.
    """
    length, turns = threaded()
    found = re.match(r"Strip (\S+) m × 0.6 m × 0.001 m", said["SHELL"].splitlines()[1])
    assert found is not None
    assert float(found[1]) == pytest.approx(length, rel=2e-4)
    for name, turn in turns.items():
        wrap = row(said["SHELL"], name, "\nRollers")[-1]
        assert float(wrap.split("°")[0]) == pytest.approx(np.degrees(turn), abs=0.05)
    assert row(said["SHELL"], "front", "\nRollers")[-1].endswith("over")
    assert row(said["SHELL"], "back", "\nRollers")[-1].endswith("under")


def threaded() -> tuple[float, dict[str, float]]:
    """Length (m) and wraps (rad) of the shell's way: over one circle and under the other.

    The crowned roller has its radius at the middle of the strip, 0.1 m from its own middle; its
    axis goes through the plane of the middle 0.3 mm ahead.
    """
    s = -0.1
    radius = 0.5 + 1.0e-5 * s - 2.0e-4 * s**2
    a = np.array([s * 0.003, -0.5 + s * 0.002])
    b, entry, end = np.array([1.3, -1.2]), np.array([-1.5, -0.8]), np.array([2.5, 0.5])

    def heading(way: np.ndarray) -> float:
        return float(np.arctan2(way[1], way[0]))

    first = heading(a - entry) + np.arcsin(radius / np.hypot(*(a - entry)))
    middle = heading(b - a) - np.arcsin((radius + 0.4) / np.hypot(*(b - a)))
    last = heading(end - b) + np.arcsin(0.4 / np.hypot(*(end - b)))
    turns = {"front": first - middle, "back": last - middle}
    straight = [
        np.sqrt(np.sum((a - entry) ** 2) - radius**2),
        np.sqrt(np.sum((b - a) ** 2) - (radius + 0.4) ** 2),
        np.sqrt(np.sum((end - b) ** 2) - 0.4**2),
    ]
    return float(sum(straight) + radius * turns["front"] + 0.4 * turns["back"]), turns


def test_wraps_are_those_of_tangents(said: dict[str, str]) -> None:
    assert row(said["TURNING"], "r1", "\nRollers")[1:] == [
        "0.5", "0, 0, -0.501", "0, 1, 0", "above", "clockwise",
        f"0.001 m, {np.degrees(WRAP):.4g}°, over",
    ]  # fmt: skip
    # lifted 80 mm above the line between both ends, on which its top is an arc of 0.5 m
    half = np.arctan2(0.08 - 0.5, 1.0) + np.arcsin(0.5 / np.hypot(1.0, 0.42))
    gap, wrap, side = row(said["LIFTED"], "r", "\nRollers")[-1].split(", ")
    assert (gap, side) == ("0.02 m", "over")
    assert float(wrap.rstrip("°")) == pytest.approx(np.degrees(2.0 * half), rel=1e-3)


def test_radii_at_the_sides_of_a_profile(said: dict[str, str]) -> None:
    """r + c₁ s + c₂ s² at 0.3 m on both sides, 0.1 m from the middle of the roller."""
    cells = " ".join(said["SHELL"].partition("\nRollers")[2].split("back")[0].split())
    left, right = (0.5 + 1.0e-5 * s - 2.0e-4 * s**2 for s in (-0.4, 0.2))
    assert f"0.5; {left:g} at y =" in cells
    assert f"-0.3 m, {right:g} at y = 0.3 m" in cells  # on the next line, after the other cells
    assert "0.003, 1, 0.002" in cells


def test_effects_have_the_points_of_their_rules(said: dict[str, str]) -> None:
    table = {name: row(said["TURNING"], name, "\nEffects") for name in ("membrane", "contact")}
    assert table["membrane"][1:3] == ["104", "108"]
    assert table["contact"][1:3] == ["53", "0"]
    assert row(said["TURNING"], "friction", "\nEffects")[-1] == "turn"
    assert row(said["TURNING"], "membrane", "\nEffects")[-1] == "pull, wrap, turn"
    assert row(said["SHELL"], "weight", "\nEffects")[-1] == "load, turn"


def test_memory_is_that_of_the_series(tmp_path: Path) -> None:
    """Coefficients of so many orders at so many points, in doubles.

    Proportional to both.  The products of the shell's membrane need the lower orders of six
    derivatives and of three membrane forces at each point.
    """
    settings = [f"solver.order={order}" for order in (19, 39)]
    texts = [explained(scenes.SHELL, tmp_path, setting) for setting in settings]
    for name in ("membrane", "contact", "friction"):
        small, large = (float(row(text, name, "\nEffects")[3]) for text in texts)
        assert large == pytest.approx(2.0 * small, abs=0.011)
    small = float(row(texts[0], "membrane", "\nEffects")[3])
    assert small == pytest.approx(9 * 960 * 20 * 8 / 2.0**20, abs=0.006)
    doubled = scenes.SHELL.replace("cells = [12, 2]", "cells = [12, 4]")
    wide = float(row(explained(doubled, tmp_path, settings[0]), "membrane", "\nEffects")[3])
    assert wide == pytest.approx(2.0 * small, abs=0.011)


def test_bending_takes_the_memory_of_its_matrix(tmp_path: Path) -> None:
    """Doubles for each pair of nodes of an element and their four functions, of one component."""
    text = explained(scenes.SHELL, tmp_path)
    x, y = 30, 2
    near = 3 * (x + 1) - 2, 3 * (y + 1) - 2
    entries = near[0] * near[1] * 16
    found = float(row(text, "bending", "\nEffects")[3])
    assert found == pytest.approx(entries * 8 / 2.0**20, abs=0.006)


def test_stages_have_their_times_and_free_unknowns(said: dict[str, str]) -> None:
    """Held: x and z of the section's first node; z alone of three nodes and slopes of a plate."""
    stages = [row(said["TURNING"], name, "\nStages")[1:4] for name in ("pull", "wrap", "turn")]
    assert stages == [["0", "2", "106"], ["2", "2.5", "106"], ["2.5", "2.9", "106"]]
    assert row(said["SHELL"], "turn", "\nStages")[1:3] == ["2", "2.1"]
    nodes = 3 * (explained_elements(said["PLATE"]) // 2 + 1)
    held = 2 * 2 * 3  # values and slopes along both edges, of three nodes
    assert row(said["PLATE"], "press", "\nStages")[1:4] == ["1", "2", str(4 * nodes - held)]


def explained_elements(text: str) -> int:
    found = re.search(r"(\d+) elements", text)
    assert found is not None
    return int(found[1])


# levels and what they cost ----------------------------------------------------------------------


def counts(level: str, along: int, across: int, rollers: bool, rubs: bool) -> tuple[int, ...]:
    """Unknowns, points, series at them, and half bandwidth of a level on lines of elements."""
    components = {"section": 2, "plate": 1, "shell": 3}[level]
    if level == "section":
        scalars, quadrature, touched, directions = 2 * (along + 1), 4 * along, 2 * along + 1, 1
    else:
        scalars, quadrature = 4 * (along + 1) * (across + 1), 16 * along * across
        touched, directions = (2 * along + 1) * (2 * across + 1), 2
        touched = 4 * along * across if level_own(level, rollers) else touched
    touched *= 2 if rubs and level != "plate" else 1
    values = components * (directions * quadrature + touched)
    band = int(components * (scalars / (along + 1) + 8))
    return components * scalars, quadrature + touched, values, band


def level_own(level: str, own: bool) -> bool:
    """Whether the touched points are told of the scene's own mesh, four to an element."""
    return own and level != "section"


def seconds(found: tuple[int, ...], order: int) -> float:
    """Calls, series, factorisation and back-substitutions, by their measured shares."""
    unknowns, _, values, band = found
    series = (8e-7 + 3.5e-8 * order + 1e-9 * order**2) * values
    linear = (2e-6 + 3e-8 * band) * unknowns + (1e-7 + 1e-9 * band) * unknowns * order
    return 3e-3 + 2e-4 * order + series + linear


@pytest.mark.parametrize(
    ("scene", "own", "along", "rubs", "tolerance"),
    [("TURNING", "section", 26, True, 1e-4), ("SHELL", "shell", 30, True, 1e-3)],
)
def test_levels_are_counted(
    said: dict[str, str], scene: str, own: str, along: int, rubs: bool, tolerance: float
) -> None:
    """Counts of all three levels on the same lines of nodes, and the ratio of their costs."""
    text = said[scene]
    level = {n: counts(n, along, 2, own == "shell", rubs) for n in ("section", "plate", "shell")}
    orders = range(6, 41)
    order = min(orders, key=lambda n: seconds(level[own], n) * tolerance ** (-1.0 / (n + 1)))
    assert f"order {order}, the cheapest" in whole(text)
    for name, found in level.items():
        cells = row(text, name, "\nKinematics")
        ratio = seconds(found, order) / seconds(level[own], order)
        assert cells[1:4] == [str(found[0]), str(found[1]), f"× {ratio:.2g}"]


def test_what_a_plate_would_miss(said: dict[str, str]) -> None:
    """Slopes of the way, its wraps, and half the square of the slope."""
    error = 50.0 * np.radians(30.0) ** 2
    assert (
        f"slopes reach 30°, wrapping r1 by {np.degrees(BEFORE):.3g}°: the error, slope²/2, would "
        f"be {error:.0f} % (bound 5°)"
    ) in whole(said["TURNING"])
    lift = 0.3 * T / (2.0 * np.sqrt(3.0 * 0.91))  # of edges (Ashwell), over a quarter of a wave
    width = 0.5 * np.pi * np.sqrt(0.5 * T) / (3.0 * 0.91) ** 0.25
    curled = f"(curled up by {lift:.2g} m over {width:.2g} m, pulled by {2e11 * T * lift / 0.5:.2g}"
    assert curled in whole(said["TURNING"])
    length, turns = threaded()
    assert length > 0.0
    assert f"wrapping front by {np.degrees(turns['front']):.2f}"[:-1] in whole(said["SHELL"])


def test_sagging_slopes(tmp_path: Path) -> None:
    """Pressure and weight over 2 T/L of a string and 6 D/L³ of a beam, which carry it together.

    A crown, though far below, makes the plate the cheapest level that sees all.
    """
    text = scenes.PLATE.replace("poisson = 0.3", "poisson = 0.3\ndensity = 7850.0")
    text = text.replace("-0.501]", "-0.9]\ncrown = [0.0, -1.0e-4]")
    text = text.replace(
        "rollers.r1.move = [0.0, 0.0, 0.011]", "pressure = 200.0\ngravity = [0.0, 0.0, -9.81]"
    )
    load = 200.0 + 7850.0 * T * 9.81
    slope = np.arctan(load / (2.0 * 1.0e4 / 2.0 + 6.0 * D / 8.0))
    told = whole(explained(text, tmp_path))
    assert f"slopes of {np.degrees(slope):.2g}° make an error of {50.0 * slope**2:.2g} %" in told


# contact, scales and warnings -------------------------------------------------------------------


def test_contact_and_scales(said: dict[str, str]) -> None:
    """Length of the strip, largest edge force times the width, and largest edge force."""
    assert "at 2e+04 Pa, setting in over 0.0001 m." in said["TURNING"]
    assert (
        f"relative to 4 m (positions), {0.8 * SLANTED:g} N (imbalance) and {SLANTED:g} N/m "
        "(membrane forces); tolerance 0.0001, order"
    ) in whole(said["TURNING"])
    width = 2.0 * np.sqrt(10.0 * 1e-3 / 1e9)
    assert f"K = 1e+09 Pa/m, setting in over {width:.3g} m." in said["PLATE"]


def test_contact_as_the_mesh_resolves(tmp_path: Path) -> None:
    """Pressure T/r; the gap of a straight strip half a spacing of points beyond the lift-off."""
    text = scenes.TURNING.replace("pressure = 2.0e4\nonset = 1.0e-4", "")
    told = explained(text, tmp_path)
    h = 0.5 * np.pi / np.ceil(0.5 * np.pi / 0.1)
    onset = (0.25 * h) ** 2 / (2.0 * 0.5)
    assert f"at {SLANTED / 0.5:.3g} Pa, setting in over {onset:.3g} m, as the mesh resolves" in told


def test_a_profile_narrows_the_onset(tmp_path: Path) -> None:
    """0.01 T r/(E t) of a shell over a crown, with the geometric mean of the radii."""
    text = scenes.SHELL.replace("pressure = 2.0e4\nonset = 2.0e-4", "")
    radius = np.sqrt(0.5 * 0.4)
    onset = 0.01 * 1.0e4 / (E * T) * radius
    told = whole(explained(text, tmp_path))
    assert f"at {1.0e4 / radius:.3g} Pa, setting in over {onset:.3g} m, as" in told


def test_long_elements_are_warned_of(said: dict[str, str]) -> None:
    layer = np.sqrt(D / SLANTED)
    h = 0.5 * np.pi / np.ceil(0.5 * np.pi / 0.1)
    assert (
        f"Warning: elements over r1 are {h:.3g} m long, more than a quarter of the boundary layer "
        f"of {layer:.3g} m; the run estimates what that costs. "
        f"Try --set strip.refined={0.25 * layer:.3g}"
    ) in whole(said["TURNING"])


def test_long_elements_of_a_string_are_not_warned_of(tmp_path: Path) -> None:
    """Strip that does not bend has no boundary layer: it was called 0 m."""
    told = whole(explained(scenes.TURNING, tmp_path, "strip.bending=false"))
    assert "the boundary layer" not in told


def test_a_fast_reference_speed_is_warned_of(tmp_path: Path) -> None:
    """The entry is held, so that the roller slips with all of its speed of 1 m/s."""
    told = whole(explained(scenes.TURNING, tmp_path, "friction.speed=11.0"))
    assert (
        "Warning: friction.speed V_c = 11 m/s is far above the speed at which the strip slips, "
        "about 1 m/s (elastic creep, unless an edge is held): rollers will slip visibly. "
        "Try --set friction.speed=1"
    ) in told
    assert "is far above" not in whole(explained(scenes.TURNING, tmp_path, "friction.speed=9.0"))


def test_yield_is_warned_of(tmp_path: Path) -> None:
    """E t/(2 r (1 − ν²)) at the surface of a bent sheet."""
    told = whole(explained(scenes.TURNING, tmp_path, "material.yield_stress=2.0e8"))
    stress = E * T / (2.0 * 0.5 * (1.0 - NU**2)) / 1e6
    assert f"bending over r1 gives {stress:.0f} MPa at the surface, above the yield" in told
    told = whole(explained(scenes.TURNING, tmp_path, "material.yield_stress=2.5e8"))
    assert "MPa" not in told


def test_elements_that_cannot_bend_are_warned_of(tmp_path: Path) -> None:
    """Longer than half the radius, while the strip turns by more than half a radian."""
    told = whole(explained(scenes.TURNING, tmp_path, "strip.refined=0.3", "strip.cells=[8, 2]"))
    h = 0.5 * np.pi / np.ceil(0.5 * np.pi / 0.3)
    assert (
        f"roller r1 turns the strip by {np.degrees(WRAP):.0f}°, and elements of {h:.2g} m cannot "
        f"follow its radius of 0.5 m. Try --set strip.refined={0.25 * 0.5:.1g}"
    ) in told


def test_soft_contact_is_warned_of(tmp_path: Path) -> None:
    """The gap at which the penalty gives T/r, and a stiffness for a hundredth of the radius."""
    text = scenes.TURNING.replace(
        "pressure = 2.0e4\nonset = 1.0e-4", "stiffness = 2.0e5\neta = 10.0\ndelta = 1.0e-3"
    )
    pressure = SLANTED / 0.5
    depth = pressure / 2.0e5 - 10.0 * 1.0e-3 / pressure
    assert (
        f"pressed by T/r = {pressure:.2g} Pa the strip sinks {depth:.2g} m into roller r1, of "
        f"radius 0.5 m. Try --set contact.stiffness={pressure / 0.005:.1g}"
    ) in whole(explained(text, tmp_path))


def test_a_wide_onset_is_warned_of(tmp_path: Path) -> None:
    """p0 exp(−h/w) = T/r at a depth of w log(T/r p0), to be a hundredth of the radius; or w."""
    settings = ("contact.pressure=1.0", "contact.onset=0.04")
    pressure = SLANTED / 0.5
    depth = 0.04 * np.log(pressure)
    told = whole(explained(scenes.TURNING, tmp_path, *settings))
    assert f"sinks {depth:.2g} m into roller r1" in told
    assert f"Try --set contact.onset={0.04 * 0.005 / depth:.1g}" in told
    told = whole(explained(scenes.TURNING, tmp_path, "contact.onset=0.06"))
    assert "contact sets in 0.06 m away from roller r1, of radius 0.5 m." in told
    assert "Try --set contact.onset=0.005" in told


def test_a_heavy_strip_is_warned_of(tmp_path: Path) -> None:
    """ρ t L g of a span beside the largest tension."""
    text = scenes.LIFTED.replace("poisson = 0.3", "poisson = 0.3\ndensity = 7850.0")
    text = text.replace('name = "up"', 'name = "up"\ngravity = [0.0, 0.0, -1962.0]')
    weight = 1962.0 * 7850.0 * T * 1.5  # of half the strip, before or behind the roller
    told = whole(explained(text, tmp_path, "strip.length=3.0"))
    assert (
        f"in stage up a span of the strip weighs {weight:.2g} N/m, {weight / 1e4:.2g} times its"
        in told
    )


def test_a_strip_without_tension_is_warned_of(tmp_path: Path) -> None:
    """A tenth of the force that held it is proposed, in its direction."""
    text = scenes.TURNING.replace('name = "turn"', 'name = "turn"\nexit.force = [0.0, 0.0, 0.0]')
    told = whole(explained(text, tmp_path))
    assert "--set 'stages.turn.exit.force=[1e+03, 0, -5.8e+02]'" in told
