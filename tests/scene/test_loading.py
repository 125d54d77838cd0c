"""Files that are no scenes, and whatever else may be typed: always told, never raised."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.scene.schema import parse_scene

CAPSTAN = Path(__file__).with_name("capstan.toml")
GOOD = CAPSTAN.read_text(encoding="utf-8")
TABLES = tomllib.loads(GOOD)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty"),
        (b"# nothing yet\n", "the file is empty"),
        (b"title = 'caf\xe9'\n", "UTF-8"),
        (b"[strip]\nlength = 4.0 m\n", "line 2"),
        (b"[strip]\nlength = 4.0\nlength = 4.0\n", "line 3"),
        (b"title = ", "TOML"),
        (b"a = " + b"[" * 5000, "depth"),
        (b"a = 1" + b"0" * 5000, "TOML"),
    ],
)
def test_file_that_is_no_scene(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        Scene.load(path)
    assert str(path) in str(caught.value)
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["none.toml", ".", "a" * 300, "a\0b"])
def test_path_that_is_no_file(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="a file"):
        Scene.load(tmp_path / name)


def test_file_from_another_system(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert Scene.load(path).to_dict() == Scene.load(CAPSTAN).to_dict()


@pytest.mark.parametrize(
    ("setting", "path", "value"),
    [
        ("friction.coefficient=0.2", ("friction", "coefficient"), 0.2),
        ("rollers.r1.radius = 0.3", ("rollers", 0, "radius"), 0.3),
        ("stages.turn.duration=2", ("stages", 2, "duration"), 2.0),
        ("stages.turn.rollers.r1.move=[0,0,1]", ("stages", 2, "rollers", "r1", "move"), [0, 0, 1]),
        ("stages.wrap.exit.force=[1, 2, 3]", ("stages", 1, "exit", "force"), [1.0, 2.0, 3.0]),
        ("stages.turn.left.force=[1, 2, 3]", ("stages", 2, "left", "force"), [1.0, 2.0, 3.0]),
        ("strip.refined=0.05", ("strip", "refined"), 0.05),
        ('friction.law="tanh"', ("friction", "law"), "tanh"),
        ("solver.time_order=1", ("solver", "time_order"), 1),
        ("material.density=7850", ("material", "density"), 7850.0),
        ("edges.exit.fixed=['y']", ("edges", "exit", "fixed"), ["y"]),
        ('"title" = "a = b"', ("title",), "a = b"),
    ],
)  # fmt: skip
def test_override(setting: str, path: tuple[str | int, ...], value: object) -> None:
    inside = Scene.load(CAPSTAN, [setting]).to_dict()
    for part in path:
        inside = inside[part]
    assert inside == value


def test_override_reaches_unnamed_tables_by_default_name(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace('name = "turn"\n', ""), encoding="utf-8")
    assert Scene.load(path, ["stages.stage3.duration=9"]).stages[2].duration == 9.0


def test_a_stage_without_friction_may_leave_out_its_duration(tmp_path: Path) -> None:
    """It only sets a scale of time, unless a velocity says how far an edge goes."""
    (before, own, after), path = GOOD.partition("duration = 0.6\n"), tmp_path / "scene.toml"
    path.write_text(before + "friction = false\n" + after, encoding="utf-8")
    assert own and Scene.load(path).stages[-1].duration == 1.0
    path.write_text(before + "friction = false\nexit.velocity = [1.0, 0.0, 0.0]\n" + after)
    with pytest.raises(InputError, match=r"turn\.duration"):
        Scene.load(path)


@pytest.mark.parametrize(
    ("right", "wrong", "key"),
    [
        ("thickness =", "thicknes =", "strip.thicknes"),
        ("duration = 0.6\n", 'steady = "yes"\n', "stages.turn.steady"),
    ],
)
def test_one_slip_is_one_mistake(right: str, wrong: str, key: str, tmp_path: Path) -> None:
    """Nothing is missing besides what is misspelt, nor what another type would have asked for."""
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace(right, wrong), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        Scene.load(path)
    assert [mistake.key for mistake in refused.value.mistakes] == [key]


def test_last_override_wins() -> None:
    scene = Scene.load(CAPSTAN, ["strip.width=2", "strip.width=3"])
    assert scene.strip.width == 3.0


def test_override_may_mend_the_file(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace("radius = 0.5", "radius = -0.5"), encoding="utf-8")
    assert Scene.load(path, ["rollers.r1.radius=0.5"]).rollers[0].radius == 0.5


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("friction.coeficient=0.2", "coefficient (the nearest known one)"),
        ("fricton.coefficient=0.2", "friction (the nearest known one)"),
        ("rollers.r2.radius=0.3", "one of: r1"),
        ("stages.tun.duration=1", "turn (the nearest known one)"),
        ("strip.length.x=1", "a table"),
        ("rollers.r1.centre.2=1", "--set 'rollers.r1.centre=[0.0, 0.0, -0.501]'"),
        ("strip.thickness=-1", "above 0 (m)"),
        ("strip=3", "[strip]"),
        ("friction.law=tanh", """--set 'friction.law="tanh"'"""),
        ("friction.coefficient", "KEY=VALUE"),
        ("=3", "a dotted key"),
        ("strip.width=1.2 m", "without quotes and unit: width"),
        ("strip.thickness=0.8 mm", "thickness = 0.0008"),
        ("strip.width=", "width = 1.0"),
        ("stages.turn.steady=yes", "steady = true"),
        ("strip.width=1,2", "--set strip.width=1.2"),
        ("rollers.r1.centre=0,0,1", "three numbers"),
        ("strip.width=1\nstrip.length=2", "without quotes and unit: width"),
        ("strip..width=1", "a dotted key"),
        ("contact.eta=1e9", "below stiffness × delta"),
        ("rollers.r1.torque=1", "another table, [[stages]] rollers.NAME.torque"),
        ("rollers.r1.torque=1", ", as stages.turn.rollers.r1.torque"),
        ("strip.tension=1", "another table, [threading] tension or [[stages]] EDGE.tension"),
        ("strip.mode=1", "another table, [strip] imperfection.mode"),
    ],
)
def test_wrong_override_is_named(setting: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        Scene.load(CAPSTAN, [setting])
    (mistake,) = [m for m in caught.value.mistakes if words in str(m)]
    assert mistake.file == f"--set {setting}"


def test_wrong_overrides_and_file_are_named_together(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace("radius = 0.5", "radius = -0.5"), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        Scene.load(path, ["strip.width=", "strip.thickness=0"])
    assert {m.key for m in caught.value.mistakes} == {
        "strip.width",
        "strip.thickness",
        "rollers.r1.radius",
    }


def _leaves(inside: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Return the paths of all that can be broken in nested tables."""
    if isinstance(inside, dict):
        children = inside.items()
    else:
        children = enumerate(inside) if isinstance(inside, list) else ()
    return [path] * bool(path) + [p for key, v in children for p in _leaves(v, (*path, key))]


def _accepts_or_tells(load: Callable[[], Scene]) -> None:
    try:
        scene = load()
    except InputError as error:
        assert error.mistakes
        assert all(m.expected and m.hint and str(m) for m in error.mistakes)
    else:
        assert Scene.model_validate(scene.to_dict()).to_dict() == scene.to_dict()


PATHS = _leaves(TABLES)
KEYS = st.text(max_size=5) | st.sampled_from(["name", "force", "release", "fixed"])
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.datetimes()
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


def _mutated(path: tuple[str | int, ...], value: object, take_out: bool) -> dict[str, object]:
    tables = copy.deepcopy(TABLES)
    *outer, last = path
    inside = tables
    for part in outer:
        inside = inside[part]
    if take_out:
        del inside[last]
    else:
        inside[last] = value
    return tables


@settings(deadline=None, max_examples=300, suppress_health_check=[HealthCheck.too_slow])
@given(path=st.sampled_from(PATHS), value=VALUES, take_out=st.booleans())
def test_mutated_tables_are_a_scene_or_an_input_error(
    path: tuple[str | int, ...], value: object, take_out: bool
) -> None:
    _accepts_or_tells(lambda: Scene.from_tables(_mutated(path, value, take_out), CAPSTAN))


@settings(deadline=None, max_examples=200)
@given(
    at=st.integers(0, len(GOOD)),
    length=st.integers(0, 12),
    text=st.text(st.sampled_from("[]{}=.,\"'#\n01-e xyrn\0é"), max_size=4),
)
def test_mutated_text_is_a_scene_or_an_input_error(at: int, length: int, text: str) -> None:
    mutated = GOOD[:at] + text + GOOD[at + length :]
    _accepts_or_tells(lambda: Scene.from_tables(parse_scene(mutated, "scene.toml"), CAPSTAN))


@settings(deadline=None, max_examples=200)
@given(
    key=st.one_of(
        st.sampled_from([".".join(map(str, path)) for path in PATHS]), st.text(max_size=8)
    ),
    value=st.one_of(VALUES.map(str), st.text(max_size=8)),
)
def test_any_override_is_taken_or_an_input_error(key: str, value: str) -> None:
    _accepts_or_tells(lambda: Scene.load(CAPSTAN, [f"{key}={value}"]))
