"""Directions: mirrored and turned lines, signs of speeds, and what is said of them."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from threaded import ended, roller, scene_of, values

from anmstrip.cli import main
from anmstrip.driver.explain import draw_line, explain
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.mechanics.roller import Roller
from anmstrip.pictures import curves
from anmstrip.simulation.problem import Assembly

LINE: dict[str, Any] = {
    "strip": {"refined": 0.02},
    "contact": {"stiffness": 1e9, "eta": 100.0, "delta": 1e-2},
    "friction": {"law": "tanh", "coefficient": 0.2, "speed": 1e-2},
    "threading": {"tension": 1e4, "entry": (-0.8, 0.0, 0.3), "exit": (1.4, 0.0, -0.1)},
    "rollers": [
        roller("a", 0.0, -0.1, 0.2, "over"),
        roller("b", 0.6, 0.1, 0.2, "under"),
        {"name": "c", "radius": 0.1, "centre": (1.1, 0.0, -0.4)},
    ],
    "stages": [
        {"name": "hold", "duration": 0.1},
        {"name": "turn", "duration": 0.1, "rollers": {"b": {"surface_speed": 0.05}},
         "entry": {"release": True}},
    ],
    "solver": {"tolerance": 1e-4},
}  # fmt: skip
"""A roller that stands, one that drives, and one that the strip has yet to come to."""


def seen(mirror: tuple[int, int], swapped: bool) -> dict[str, Any]:
    """The same line with x and z multiplied by signs, and the sides of wraps swapped."""
    line = deepcopy(LINE)

    def turned(place: Any) -> tuple[float, float, float]:
        return mirror[0] * place[0], place[1], mirror[1] * place[2]

    ends = ("entry", "exit")
    line["threading"] |= {end: turned(line["threading"][end]) for end in ends}
    for table in line["rollers"]:
        table["centre"] = turned(table["centre"])
        if swapped and "wrap" in table:
            table["wrap"] = {"over": "right", "under": "left"}[table["wrap"]]
    return line


@pytest.mark.parametrize(("mirror", "swapped"), [((1, -1), True), ((-1, -1), False)])
def test_a_mirrored_line_gives_mirrored_results(mirror: tuple[int, int], swapped: bool) -> None:
    """Upside down with the sides swapped, and turned half round: entry at the right."""
    (run, state), (other, image) = (
        ended(scene_of(tables)) for tables in (seen((1, 1), False), seen(mirror, swapped))
    )
    assert run.cost.expansions == other.cost.expansions
    here, there = (np.sort(a.assembly.strip.mesh.p[0]) for a in (run, other))
    np.testing.assert_allclose(here, there, rtol=0.0, atol=1e-12)
    signs = np.array([[mirror[0]], [1.0], [mirror[1]]])
    assert np.abs(values(run, state) - signs * values(other, image)).max() < 1e-9
    for name, reading in state.rollers.items():
        for part in ("normal_force", "drag", "wrap", "creep_speed", "tension_in", "max_slip"):
            one, two = getattr(reading, part), getattr(image.rollers[name], part)
            assert one == two or one == pytest.approx(two, rel=1e-7, abs=1e-7), (name, part)
    assert state.rollers["b"].drag > 100.0  # N: it pulls the strip on, over the roller that stands
    assert state.rollers["a"].drag < -100.0


def test_the_mesh_is_fine_where_strip_comes_to_lie_on_any_roller() -> None:
    """Carried by b: at 0.05 m/s after 0.1 s, 2.5 mm, over a and c as well."""
    moving = deepcopy(LINE)
    moving["strip"]["feed"] = False
    still = deepcopy(moving)
    still["stages"][1]["rollers"]["b"]["surface_speed"] = 0.0
    rest, moved = (_zones(Assembly(scene_of(tables))) for tables in (still, moving))
    for (lo, hi), (low, high) in zip(rest, moved, strict=True):
        assert lo - low == pytest.approx(0.0025, abs=1e-12)
        assert high == pytest.approx(hi, abs=1e-12)


def _zones(assembly: Assembly) -> list[tuple[float, float]]:
    return assembly.layout.fine_zones(assembly.rollers)


def test_positive_speeds_carry_the_strip_on() -> None:
    """Also rollers that the strip only comes near, whatever the direction of their axes."""
    line = deepcopy(LINE)
    line["rollers"][0]["axis"] = (0.0, -2.0, 0.0)
    for a in Assembly(scene_of(line)).rollers:
        top = a.sense * np.cross(a.unit_axis, [0.0, 0.0, 1.0])
        assert top[0] == pytest.approx(-1.0 if a.name == "b" else 1.0)


@pytest.mark.parametrize("axis", [1.0, -1.0])
def test_angular_speed_is_right_handed_about_the_axis(axis: float) -> None:
    """A point on top moves with ω × r, whichever way the strip goes."""
    line = deepcopy(LINE)
    line["rollers"][1]["axis"] = (0.0, axis, 0.0)
    line["stages"][1]["rollers"]["b"] = {"angular_speed": 0.25}
    _, state = ended(scene_of(line))
    assert state.controls["rollers.b.surface_speed"] == pytest.approx(-axis * 0.25 * 0.2)
    assert np.sign(state.rollers["b"].creep_speed) == -axis


def test_explain_says_sides_and_directions() -> None:
    text = explain(scene_of(seen((-1, -1), False)))
    rows = {r.split()[0]: r for r in text.partition("\nRollers")[2].splitlines()[1:6] if r}
    assert "below      clockwise" in rows["a"]  # over, but the strip travels to the left
    assert "above  anticlockwise" in rows["b"]
    assert rows["a"].endswith("over")
    assert "–" in rows["c"]


@pytest.mark.parametrize("driven", [{"angular_speed": 0.25}, {"surface_speed": -0.05}])
def test_explain_says_how_speeds_of_stages_turn_rollers(driven: dict[str, float]) -> None:
    """B is passed below, and a speed about its axis drives the strip back, over an idler a."""
    line = deepcopy(LINE)
    line["rollers"][0]["drive"] = "idle"
    line["stages"][1]["rollers"]["b"] = driven
    text = explain(scene_of(line))
    rows = {r.split()[0]: r.split() for r in text.partition("\nRollers")[2].splitlines()[1:6] if r}
    assert "clockwise" in rows["b"]
    assert "anticlockwise," in rows["a"]


def test_the_line_is_drawn_as_it_is_threaded(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Strip from entry to exit, wraps on the rollers, and arrows in the senses of their speeds."""

    drawn: list[Any] = []
    draw_layout = curves.draw_layout
    monkeypatch.setattr(curves, "draw_layout", lambda *given: drawn.append(given))
    scene = scene_of(seen((-1, -1), False))
    draw_line(scene, tmp_path / "line.svg")
    (given,) = drawn
    _, _, line, wheels, backwards = given
    assert not backwards
    np.testing.assert_allclose(line[:, [0, -1]].T, [[0.8, -0.3], [-1.4, 0.1]], atol=1e-12)
    for wheel, table in zip(wheels, scene.rollers, strict=True):
        assert wheel.clockwise == (table.name != "b")
        away = np.linalg.norm(wheel.arc - wheel.centre[:, None], axis=0)
        # pressed in by the contact's penalty
        np.testing.assert_allclose(away, table.radius, rtol=2e-3)
        assert bool(wheel.arc.size) == (table.wrap is not None)
    draw_layout(*given)
    text = (tmp_path / "line.svg").read_text(encoding="utf8")
    assert text.count("<!-- entry -->") == 1
    assert f"<!-- {wheels[0].caption.split()[0]} -->" in text


@pytest.mark.parametrize("speed", [0.05, -0.05])
def test_arrows_go_the_way_the_strip_travels(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, speed: float
) -> None:
    """From entry to exit, or back where rollers drive it back: their arrows do the same."""
    drawn: list[Any] = []
    monkeypatch.setattr(curves, "draw_travel", lambda axes, line: drawn.append(line))
    line = deepcopy(LINE)
    line["stages"][1]["rollers"]["b"] = {"surface_speed": speed}
    draw_line(scene_of(line), tmp_path / "line.svg")
    ((x, _),) = drawn
    assert np.sign(x[-1] - x[0]) == np.sign(speed)


def test_a_picture_that_is_not_drawn_to_its_end_replaces_none(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    picture = tmp_path / "line.PNG"
    draw_line(scene_of(seen((-1, -1), False)), picture)
    before = picture.read_bytes()
    assert before.startswith(b"\x89PNG")

    def killed(self: object, path: Path, **how: object) -> None:
        Path(path).write_bytes(before[:99])
        raise KeyboardInterrupt

    monkeypatch.setattr(curves.Figure, "savefig", killed)
    with pytest.raises(KeyboardInterrupt):
        draw_line(scene_of(seen((-1, -1), False)), picture)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]


def test_a_long_line_is_drawn_around_its_rollers(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Of 570 m around forty rollers chords cut them through."""
    drawn: list[Any] = []
    monkeypatch.setattr(curves, "draw_layout", lambda *given: drawn.append(given))
    examples = Path(__file__).parents[2] / "examples"
    draw_line(Scene.load(examples / "line.toml"), tmp_path / "line.png")
    ((*_, line, wheels, _),) = drawn
    middles = 0.5 * (line[:, 1:] + line[:, :-1])
    for wheel in wheels:
        assert np.linalg.norm(middles - wheel.centre[:, None], axis=0).min() > 0.99 * wheel.radius


def test_a_picture_of_no_known_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="ends in"):
        draw_line(scene_of(LINE), tmp_path / "line.txt")


def test_members_keep_their_senses() -> None:
    from anmstrip.mechanics.roller import combine

    one, two = (Roller(n, 0.5, (0.0, 0.0, 0.0), sense=s) for n, s in (("a", 1.0), ("b", -1.0)))
    np.testing.assert_array_equal(combine([one, two], np.array([0, 1, 1])).sense, [1.0, -1.0, -1.0])


def test_a_picture_goes_into_a_directory_that_is_there(tmp_path: Path) -> None:
    """Directories were made without a word."""
    picture = tmp_path / "nowhere" / "line.png"
    with pytest.raises(InputError, match="nowhere does not") as caught:
        draw_line(scene_of(LINE), picture)
    assert caught.value.mistakes[0].hint.startswith("--picture line.png, or mkdir -p ")
    scene = Path(__file__).parents[2] / "examples" / "line.toml"
    found = CliRunner().invoke(main, ["explain", str(scene), "--picture", str(picture)])
    assert found.exit_code == 2, found.output
    assert not picture.parent.exists()
