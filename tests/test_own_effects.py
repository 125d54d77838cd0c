"""A user's own effect and own laws: how they are written, and that they do what they say."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from anmstrip import ContactOperator, Effect, InputError, LawEffect, Run, Scene, Strip
from anmstrip.cli import main

LENGTH, WIDTH, THICKNESS, YOUNG, POISSON = 4.0, 1.0, 5e-3, 2e11, 0.3
BENDING = YOUNG * THICKNESS**3 / (12.0 * (1.0 - POISSON**2))


class Foundation(LawEffect):
    """An elastic foundation under the strip: the pressure −k w (Winkler 1867)."""

    name = "foundation"

    def __init__(self, strip: Strip, stiffness: float) -> None:
        self.operator = ContactOperator(strip)  # values at points, with areas as weights
        self.stiffness = stiffness  # k, Pa/m

    def law(self, x: Any, v: Any, controls: Any) -> Any:
        """Residual per area: k times the displacement along z."""
        return np.stack([0.0 * x[0], x[1]]) * self.stiffness


def test_strip_on_an_elastic_foundation() -> None:
    """A beam on a foundation, lifted at its end: w(0) = 2 F λ/k with λ⁴ = k/(4 D) (Hetényi)."""
    k, lifted = 2e4, 1e-3
    scene = Scene(
        strip={
            "length": LENGTH,
            "width": WIDTH,
            "thickness": THICKNESS,
            "cells": [80, 1],
            "kinematics": "section",
        },
        material={"young": YOUNG, "poisson": POISSON},
        edges={"exit": {"fixed": ["x"]}, "entry": {"fixed": ["z"]}},
        stages=[{"duration": 1.0, "entry": {"move": [0.0, 0.0, lifted]}}],
        solver={"tolerance": 1e-8},
    )
    run = Run(scene, effects=[lambda strip: Foundation(strip, k)])
    *_, last = run
    assert run.outcome.done
    wave = (k / (4.0 * BENDING)) ** 0.25
    force = last.state.edge_force("entry")[2] / WIDTH
    assert force == pytest.approx(k * lifted / (2.0 * wave), rel=1e-3)
    assert run.effects["foundation"]["points"] == 161


def named(name: str | None) -> Any:
    """Return what makes an effect with a name, or something else than an effect."""
    effect = type("Named", (Foundation,), {"name": name})
    return lambda strip: effect(strip, 1.0) if name else None


class Nameless(LawEffect):
    """Without a name, which was an AttributeError."""

    def __init__(self, strip: Strip) -> None:
        self.operator = ContactOperator(strip)


class Lawless(Effect):
    """Without a law, of which no series follows; that was an AssertionError."""

    name, points = "lawless", 0


@pytest.mark.parametrize(
    "effects",
    [
        [named("drives")],
        [named("bath"), named("bath")],
        [named(None)],
        [Nameless],
        [lambda strip: Lawless()],
    ],
)
def test_an_effect_has_a_law_and_a_name_of_its_own(effects: list[Any]) -> None:
    """A state asks for effects by name: one named drives was taken for the rollers' own."""
    scene = Scene(
        strip={"length": LENGTH, "width": WIDTH, "thickness": THICKNESS, "kinematics": "section"},
        material={"young": YOUNG, "poisson": POISSON},
        edges={"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
        stages=[{"duration": 1.0, "exit": {"force": [1e3, 0.0, 0.0]}}],
    )
    with pytest.raises(InputError, match=r"LawEffect with a name that no other effect has"):
        list(Run(scene, effects=effects))


class Attraction(LawEffect):
    """An electrode above the strip: p = b D g/L⁴ over (1 − w/g)², with b as the exit is pushed."""

    name = "attraction"

    def __init__(self, strip: Strip) -> None:
        self.operator = ContactOperator(strip)

    def law(self, x: Any, v: Any, controls: Any) -> Any:
        pull = controls["exit.force"][0] * (100.0 * 2e11 * 1e-9 / 12.0 * 1e-2)
        return np.stack([0.0 * x[0], (1.0 - x[1] * 100.0) ** -2 * pull])


def test_strip_is_drawn_to_an_electrode_from_a_limit_point_on() -> None:
    """At b = 70.1 between jaws (Tilmans & Legtenberg 1994); only the stop after it was told."""
    jaws = {"clamped": True, "fixed": ["x", "z"]}
    scene = Scene(
        strip={"kinematics": "section", "length": 1.0, "width": 0.1, "thickness": 1e-3},
        material={"young": 2e11, "poisson": 0.0},
        edges={"entry": jaws, "exit": jaws | {"fixed": ["z"]}},
        stages=[{"name": "charge", "exit": {"force": [-1.0, 0.0, 0.0]}}],
    )
    run = scene.run(effects=[Attraction])
    for _ in run:
        pass
    found = re.search(
        r"the path turned back at a limit point at t = (\S+) s with exit.force of (\S+);",
        run.message,
    )
    assert found, run.message
    assert float(found[1]) == pytest.approx(0.701, abs=2e-3) == float(found[2])


STRIBECK = """
from dataclasses import dataclass
from typing import Any

import numpy as np

from anmstrip import FrictionLaw


@dataclass(frozen=True)
class Stribeck(FrictionLaw):
    '''R_T = −f R_N (1 − d (1 − exp(−|v|²/v_s²))) v/√(v² + V_c²): friction falls with speed.'''

    coefficient: Any
    speed: float  # V_c, m/s
    dip: float  # d, by how much friction falls
    stribeck_speed: float  # v_s, m/s

    def __call__(self, normal: Any, slip: Any) -> Any:
        square = np.einsum("i...,i...->...", slip, slip)
        fall = 1.0 - self.dip * (1.0 - np.exp(square * (-1.0 / self.stribeck_speed**2)))
        strength = normal * fall / np.sqrt(square + self.speed**2)
        return slip * strength * (-self.coefficient)
"""

CAPSTAN = """
[strip]
kinematics = "section"
width = 1.0
thickness = 1.0e-3
cells = [40, 2]
refined = 0.05
[material]
young = 2.0e11
poisson = 0.3
[contact]
[friction]
law = "{law}"
coefficient = 0.3
speed = 1.0e-2
parameters = {parameters}
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
duration = 0.5
rollers.r1.surface_speed = 1.0
[solver]
tolerance = 1.0e-4
"""


def written(directory: Path, law: str, parameters: str) -> Path:
    """Return a scene with the law in a module beside it."""
    (directory / "stribeck_law.py").write_text(STRIBECK, encoding="utf-8")
    path = directory / "scene.toml"
    text = CAPSTAN.replace("{law}", law).replace("{parameters}", parameters)
    path.write_text(text, encoding="utf-8")
    return path


def test_stribeck_law_from_a_module(tmp_path: Path) -> None:
    """In full slip at 1 m/s the coefficient is f (1 − d), and the tensions are a capstan's."""
    path = written(tmp_path, "stribeck_law:Stribeck", "{ dip = 0.4, stribeck_speed = 0.1 }")
    result = CliRunner().invoke(main, ["run", str(path), "-o", str(tmp_path / "out"), "--quiet"])
    assert result.exit_code == 0, result.output
    roller = json.loads((tmp_path / "out" / "summary.json").read_text())["rollers"]["r1"]
    friction = 0.3 * 0.6
    correction = (1.0 + friction**2) * BENDING_1MM / (2.0 * 0.5**2)
    expected = friction * TURN - correction * (
        1.0 / roller["tension_out"] - 1.0 / roller["tension_in"]
    )
    assert np.log(roller["tension_in"] / roller["tension_out"]) == pytest.approx(expected, rel=3e-3)


BENDING_1MM = YOUNG * 1e-3**3 / (12.0 * (1.0 - POISSON**2))
DISTANCE = np.hypot(2.0, 0.5)
TURN = 2.0 * (np.arcsin(0.5 / DISTANCE) + np.arctan2(0.5, 2.0))
"""Wrap of a taut string from (−2, −1) over the circle of 0.5 m about (0, −0.5) to (2, −1)."""


class Air(LawEffect):
    """Air that resists motion: residual c v per area."""

    name = "air"
    rate_dependent = True

    def __init__(self, strip: Strip, c: float) -> None:
        self.operator, self.c = ContactOperator(strip), c  # c in Pa s/m

    def law(self, x: Any, v: Any, controls: Any) -> Any:
        return v * self.c


DRAWN: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 5e-4},
    "material": {"young": 2.1e11, "poisson": 0.3},
    "friction": {"coefficient": 0.3},
    "threading": {"tension": 1e4, "entry": [-2.0, 0.0, -0.2], "exit": [2.0, 0.0, -0.2]},
    "rollers": [{"name": "a", "radius": 0.4, "centre": [0, 0, -0.4], "wrap": "over",
                 "drive": "idle"}],
    "edges": {"entry": {"fixed": ["x", "z"]}},
}  # fmt: skip


@pytest.mark.parametrize(
    ("stage", "fed", "words"),
    [
        ({"duration": 1.0, "entry": {"speed": 0.5}}, True, "those of labels that stay while fed"),
        ({"duration": 1.0, "entry": {"speed": 0.5}}, False, ""),
        ({"steady": True, "strip": {"speed": 0.5}}, True, "is left out of stage stage1"),
    ],
)
def test_an_effect_that_has_no_velocity_of_the_strip_is_told_of(
    stage: dict[str, Any], fed: bool, words: str
) -> None:
    """Air of 1000 Pa s/m at 0.5 m/s on 4 m takes 2 kN/m, of fed strip nothing, and said nothing."""
    scene = Scene.from_tables(
        {**DRAWN, "strip": {**DRAWN["strip"], "feed": fed}, "stages": [stage]}, "drawn.toml"
    )
    run = Run(scene, effects=[lambda strip: Air(strip, 1000.0)])
    assert [words in line for line in run.forewarnings() if "effect air" in line] == [True] * bool(
        words
    )
    if not words:
        *_, last = run
        force = np.linalg.norm(last.state.edge_force("entry"))
        assert force == pytest.approx(1e4 - 1000.0 * 0.5 * 4.0, rel=5e-3)


PICKY = """from anmstrip import FrictionLaw
def check():
    raise ValueError("too low")
class Picky(FrictionLaw):
    def __init__(self):
        check()
    def __call__(self, normal, slip):
        return slip * normal
"""


@pytest.mark.parametrize(
    ("law", "parameters", "key", "words"),
    [
        ("no_such_module:Law", "{}", "friction.law", "No module named 'no_such_module')"),
        ("leaves_python:Law", "{}", "friction.law", "a module and a class in it"),
        (
            "divides:Law",
            "{}",
            "friction.law",
            "(ZeroDivisionError: division by zero, line 2 of divides.py)",
        ),
        ("misspelt:Law", "{}", "friction.law", "misspelt.py, line 2"),
        (
            "picky_law:Picky",
            "{}",
            "friction.parameters",
            "(ValueError: too low, line 3 of picky_law.py)",
        ),
        ("stribeck_law:Missing", "{}", "friction.law", "Missing"),
        ("stribeck_law:np", "{}", "friction.law", "a subclass of anmstrip.FrictionLaw"),
        ("stribeck_law:Stribeck", "{ drop = 1.0 }", "friction.parameters", "drop"),
        ("tan", "{}", "friction.law", '"module:Class"'),
    ],
)
def test_law_that_cannot_be_used(
    tmp_path: Path, law: str, parameters: str, key: str, words: str
) -> None:
    path = written(tmp_path, law, parameters)
    (tmp_path / "leaves_python.py").write_text("raise SystemExit", encoding="utf-8")
    (tmp_path / "divides.py").write_text("one = 1\none / 0\n", encoding="utf-8")
    (tmp_path / "misspelt.py").write_text("one = 1\nclass 3:\n", encoding="utf-8")
    (tmp_path / "picky_law.py").write_text(PICKY, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        Run(Scene.load(path)).assembly.friction  # noqa: B018
    told = {mistake.key: str(mistake) for mistake in caught.value.mistakes}
    assert words in told[key]


LAWS = """
from dataclasses import dataclass
import numpy as np
from anmstrip import ContactLaw, FlowLaw, FrictionLaw

@dataclass(frozen=True)
class Scalar(FrictionLaw):
    coefficient: float
    speed: float
    def __call__(self, normal, slip):
        return slip * float(normal)

@dataclass(frozen=True)
class Along(FrictionLaw):
    coefficient: float
    speed: float
    def __call__(self, normal, slip):
        square = np.einsum("i...,i...->...", slip, slip)
        return slip * (normal / np.sqrt(square + self.speed**2)) * self.coefficient

@dataclass(frozen=True)
class Mean(FrictionLaw):
    coefficient: float
    speed: float
    def __call__(self, normal, slip):
        return -self.coefficient * normal

@dataclass(frozen=True)
class Corner(FrictionLaw):
    coefficient: float
    speed: float
    def __call__(self, normal, slip):
        return -self.coefficient * normal * np.sign(slip)

class NeverFaint(ContactLaw):
    width = 1e-4
    def __call__(self, gap):
        return np.exp(gap * -1e4)

class Pulling(ContactLaw):
    width, faint = 1e-4, 1.0
    def __call__(self, gap):
        return np.exp(gap * 1e4)

class Flat(ContactLaw):
    width, faint = 1e-4, 1.0
    def __call__(self, gap):
        return gap * 0.0 + 1e4

@dataclass(frozen=True)
class Fixed(FrictionLaw):
    coefficient: float
    speed: float
    def __call__(self, normal, slip):
        return slip * normal * (-0.2 / self.speed)

class Plain(FrictionLaw):
    def __init__(self, coefficient, speed):
        self.coefficient, self.speed = coefficient, speed
    def __call__(self, normal, slip):
        return slip * normal * -self.coefficient

class Nothing(FlowLaw):
    def resistance(self, p):
        return None

@dataclass(frozen=True)
class Hiding(FrictionLaw):
    coefficient: float
    speed: float
    share: float = 0.5
    def __call__(self, normal, slip):
        return -slip * (normal * self.share)

class Twice(FlowLaw):
    def resistance(self, p):
        return np.stack([p, p])

class Negative(FlowLaw):
    def resistance(self, p):
        return p * 0.0 - 1e8

class Rough(FlowLaw):
    def resistance(self, p):
        return np.abs(p) + 1e8
"""


@pytest.mark.parametrize(
    ("table", "name", "words"),
    [
        ("friction", "Scalar", "a law that works on arrays (TypeError: only"),
        ("friction", "Along", "friction against the slip"),
        ("friction", "Corner", "a law that works on arrays (TypeError: np.sign has no series"),
        ("contact", "NeverFaint", "has no attribute 'faint'"),
        ("friction", "Mean", "it returned (4,)"),
        ("friction", "Corner", "line 33 of wrong_laws.py"),
        ("friction", "Fixed", "proportional to coefficient"),
        ("friction", "Plain", "a frozen dataclass"),
        ("friction", "Hiding", "other names than share"),
        ("contact", "Pulling", "a pressure that falls with the gap"),
        ("contact", "Flat", "a pressure that falls with the gap"),
        ("material.plasticity", "Nothing", "it returned ()"),
        ("material.plasticity", "Twice", "it returned (2, 4, 3)"),
        ("material.plasticity", "Negative", "of a resistance above 0"),
        ("material.plasticity", "Rough", "np.absolute has no series"),
    ],
)
def test_law_that_breaks_its_rules_is_refused(
    tmp_path: Path, table: str, name: str, words: str
) -> None:
    """One evaluation shows it; friction along the slip was run to its end."""
    (tmp_path / "wrong_laws.py").write_text(LAWS, encoding="utf-8")
    path = written(tmp_path, "stribeck_law:Stribeck", "{ dip = 0.4, stribeck_speed = 0.1 }")
    law = [f'{table}.law="wrong_laws:{name}"', f"{table}.parameters={{}}"]
    if table == "material.plasticity":
        law = ["material.yield_stress=3e8", 'strip.kinematics="section"', *law]
    attributes = {"contact": "signorini", "material.plasticity": "flow"}
    with pytest.raises(InputError) as caught:
        getattr(Run(Scene.load(path, law)).assembly, attributes.get(table, table))
    assert words in str(caught.value)


FLOW = {"reference_rate": 3e-3, "layers": 5, "law": "my_laws:Voce"}
STRETCH = 3.0 * 3e8 / YOUNG


def pulled(parameters: dict[str, float]) -> dict[str, Any]:
    """Return the tables of a shell, free across, that is stretched within a second."""
    flow = {**FLOW, "parameters": parameters}
    return {
        "strip": {"length": 0.1, "width": 0.04, "thickness": 1e-3, "cells": [2, 2]},
        "material": {"young": YOUNG, "poisson": POISSON, "yield_stress": 3e8, "plasticity": flow},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["x", "z"]}},
        "stages": [{"duration": 1.0, "exit": {"move": [0.1 * STRETCH, 0.0, 0.0]}}],
        "solver": {"tolerance": 1e-3},
    }


def test_yield_law_of_the_documentation(tmp_path: Path) -> None:
    """Voce's hardening in tension, against E ε' = σ' + E ε₀ (σ/R)ⁿ of one fibre."""
    page = Path(__file__).parents[1] / "docs" / "plasticity.md"
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    code = next(block for block in blocks if "Voce" in block)
    assert len(code[code.index("@dataclass") : code.index("law =")].strip().splitlines()) <= 15
    (tmp_path / "my_laws.py").write_text(code, encoding="utf-8")
    tables = pulled({"gain": 0.5, "path": 1e-3})
    *_, last = Scene.from_tables(tables, tmp_path / "scene.toml").run()

    def rate(t: float, state: Any) -> list[float]:
        stress, path = state
        s = stress / (3e8 * (1.5 - 0.5 * np.exp(-path / 1e-3)))
        stretch = 1.0 + STRETCH * t
        return [YOUNG * (stretch * STRETCH - 3e-3 * s**51), 3e-3 * s**52]

    exact = solve_ivp(rate, (0.0, 1.0), [0.0, 0.0], "LSODA", rtol=1e-8, atol=1e-9)
    stress = exact.y[0, -1]
    assert stress > 1.4 * 3e8
    assert last.state.tension("exit") == pytest.approx(stress * 1e-3 * (1.0 + STRETCH), rel=1e-3)
    with pytest.raises(InputError, match=r"material\.plasticity\.parameters"):
        list(Scene.from_tables(pulled({"gains": 0.5}), tmp_path / "scene.toml").run())


BATHED: dict[str, Any] = {
    "strip": {"kinematics": "section", "length": 2.0, "width": 1.0, "thickness": 1e-3,
              "cells": [8, 1]},
    "material": {"young": 2e11, "poisson": 0.3},
    "edges": {"exit": {"fixed": ["x", "z"]}, "entry": {"fixed": ["z"]}},
    "stages": [{"name": "drawn", "duration": 1.0, "exit": {"velocity": [0.5, 0.0, 0.0]}}],
}  # fmt: skip


@pytest.mark.parametrize(
    ("law", "rates", "words"),
    [
        (
            lambda _, x, v, controls: v[0] * 1.0,
            True,
            "forces of shape (2, 17), and it returned (17,)",
        ),
        (lambda _, x, v, controls: np.stack([v[0]] * 3), True, "it returned (3, 17)"),
        (lambda _, x, v, controls: None, True, "it returned ()"),
        (lambda _, x, v, controls: np.abs(v), True, "np.absolute has no series"),
        (lambda _, x, v, controls: v * controls["nope"], True, "KeyError: 'nope', line"),
        (lambda _, x, v, controls: v * 1.0, False, "v is None without rate_dependent = True"),
        (lambda _, x, v, controls: v * np.nan, True, "finite forces"),
    ],
)
def test_an_effect_whose_law_is_wrong_is_named(law: Any, rates: bool, words: str) -> None:
    made = type("Wrong", (Air,), {"law": law, "rate_dependent": rates})
    with pytest.raises(InputError) as caught:
        list(Run(Scene.from_tables(BATHED, "bath.toml"), effects=[lambda strip: made(strip, 1.0)]))
    assert words in str(caught.value) and '"air"' in str(caught.value)


def test_effects_are_functions_in_a_list() -> None:
    scene = Scene.from_tables(BATHED, "bath.toml")
    with pytest.raises(TypeError, match="a list of functions of the strip"):
        Run(scene, effects=lambda strip: Air(strip, 1.0))
    with pytest.raises(InputError, match="functions of the strip"):
        list(Run(scene, effects=[3]))
