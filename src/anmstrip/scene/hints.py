"""What was presumably meant by a value that a scene cannot have."""

from __future__ import annotations

import math
import re
import tomllib
import unicodedata
from collections.abc import Iterable
from contextlib import suppress
from difflib import get_close_matches
from typing import Annotated, Any, TypeGuard, get_args

from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

UNIT_FACTORS = {
    "m": {
        **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "inch": 0.0254, "ft": 0.3048},
        **{"mil": 2.54e-5, **dict.fromkeys(("µm", "μm", "um", "micron", "microns"), 1e-6)},
    },
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    "Pa": {
        **{"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": 6894.757, "ksi": 6.894757e6},
        **dict.fromkeys(("N/mm²", "N/mm2"), 1e6),
    },
    "N/m": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3, "N/cm": 1e2, "lbf/in": 175.127, "pli": 175.127},
    "N": {"N": 1.0, "kN": 1e3, "daN": 10.0, "kgf": 9.80665, "lbf": 4.448222},
    "m/s": {
        **{"m/s": 1.0, "mm/s": 1e-3, "km/h": 1.0 / 3.6},
        **dict.fromkeys(("m/min", "mpm"), 1.0 / 60.0),
        **dict.fromkeys(("ft/min", "fpm"), 0.00508),
    },
    "rad/s": {
        "rad/s": 1.0,
        **dict.fromkeys(("rpm", "1/min"), math.pi / 30.0),
        "deg/s": math.pi / 180.0,
    },
    "N m": {"Nm": 1.0, "kNm": 1e3, "Nmm": 1e-3, "Ncm": 1e-2},
    "kg/m³": {**dict.fromkeys(("kg/m³", "kg/m3"), 1.0), **dict.fromkeys(("g/cm³", "g/cm3"), 1e3)},
    "1": {"%": 1e-2},
}
"""Units by the one of a key, with what they are of it."""

ALL_UNITS = {name: factor for units in UNIT_FACTORS.values() for name, factor in units.items()}
"""The same of all of them together."""

SYNONYMS = {
    "beam": "section", "2d": "section", "plane": "section", "3d": "shell",
    **dict.fromkeys(("top", "above", "up", "clockwise", "cw"), "over"),
    **dict.fromkeys(("bottom", "below", "down"), "under"),
    **dict.fromkeys(("ccw", "anticlockwise", "counterclockwise"), "under"),
    **dict.fromkeys(("driven", "motor", "powered"), "speed"),
    **dict.fromkeys(("free", "undriven"), "idle"),
}  # fmt: skip
"""Words of other programs for one of ours."""

OTHER_NAMES = {
    "diameter": ("radius", 0.5),
    "e": ("young", 1.0),
    **dict.fromkeys(
        ("youngs_modulus", "young_modulus", "elastic_modulus", "modulus"), ("young", 1.0)
    ),
    **dict.fromkeys(("sigma_y", "sigma_yield", "yield"), ("yield_stress", 1.0)),
    "nu": ("poisson", 1.0),
    "rho": ("density", 1.0),
    "alpha": ("expansion", 1.0),
    **dict.fromkeys(
        ("mu", "friction_coefficient", "dynamic", "kinetic"), ("coefficient friction", 1.0)
    ),
    **dict.fromkeys(("brake", "drag", "drag_torque", "friction_torque"), ("bearing", 1.0)),
    **dict.fromkeys(("time", "end_time", "t_end"), ("duration", 1.0)),
    "dt": ("time_step", 1.0),
    "gauge": ("thickness", 1.0),
    **dict.fromkeys(("mesh_size", "element_size"), ("refined", 1.0)),
    "tol": ("tolerance", 1.0),
    "rpm": ("angular_speed", math.pi / 30.0),
    "omega": ("angular_speed", 1.0),
    "penalty": ("stiffness", 1.0),
    "speed": ("surface_speed", 1.0),
    **dict.fromkeys(("frequency", "interval"), ("every", 1.0)),
}
"""Names of other programs for keys of ours, and what their value is of theirs."""

PARTS_OF_STAGES = ("strip", "entry", "exit", "left", "right")
"""What has controls in a stage, behind a dot."""

NO_CONTROLS = {
    "axis": "axis in [[rollers]], for the whole run: no stage turns it",
    "radius": "radius in [[rollers]], for the whole run: no stage changes it",
    "centre": "move = [0.0, 0.0, 0.1], from where the roller is drawn",
    "acceleration": "surface_speed, to which it changes evenly over the duration of the stage",
    "force": "the tension that it makes: a weight G on a half turn of strip of width b is "
    "EDGE.tension = G/2b; or press = 1000.0 (N), of a roller that presses strip on another one",
}
"""What a stage does not change of a roller, and what to type instead."""

KEYS_ANYWHERE = {
    **dict.fromkeys(
        ("weight", "self_weight"), "[[stages]] gravity = [0.0, 0.0, -9.81], with material.density"
    ),
    "steps": "nothing: errors choose the steps; solver.time_step fixes those",
    "line_speed": "[[stages]] strip.speed, of a steady one, or rollers.NAME.surface_speed",
    **dict.fromkeys(
        ("type", "kind", "analysis"),
        "[[stages]] steady = true, of stationary states; stages without it go through time",
    ),
    "ramp": "nothing: what a stage gives changes evenly over its duration",
    "hardening": "isotropic_hardening, or kinematic_hardening (Pa)",
    **dict.fromkeys(
        ("static", "static_coefficient"), "coefficient: it is the same at rest and in motion"
    ),
    "units": "nothing: all numbers are in SI units, lengths in m, stresses in Pa",
    "format": "nothing: tables are CSV, fields VTK files",
}
"""Names of other programs, in any table, and what to type instead."""

KEYS_OF_ENDS = {
    end: f"[[stages]] {end}.tension = 5000.0 (N/m), or {end}.speed, of what pulls there; "
    f"and [edges.{end}], how it is held"
    for end in ("entry", "exit")
}
"""Tables of ends outside the stages, and what to type instead."""

FOREIGN_KEYS = {
    **dict.fromkeys(
        ("inertia", "J", "moment_of_inertia"),
        'not modelled; an idler that gains the speed v in t seconds has drive = "torque" '
        "and torque = -J v/(r t) in that stage",
    ),
    **dict.fromkeys("xyz", "centre = [0.0, 0.0, -0.5], of x, y and z"),
    **dict.fromkeys(
        ("driven", "motor"), 'drive = "speed", or drive = "idle" where strip alone turns the roller'
    ),
    "mass": "not modelled: states are quasi-static, and rollers do not bend",
    **dict.fromkeys(
        ("spring", "weight"),
        "not modelled: type the tension that it makes, EDGE.tension in a stage",
    ),
    "eccentricity": "not modelled; its effect is that of moves, rollers.NAME.move of a stage",
    "bow": "not modelled: axes are straight; the shapes that there are: crown, taper, sides",
    **dict.fromkeys(
        ("yaw", "skew", "angle", "misalignment"), "axis = [-0.001, 1.0, 0.0], for 1 mrad about z"
    ),
    "tilt": "axis = [0.0, 1.0, 0.001], for an end at +y that is higher by 1 mrad",
    "type": 'drive = "speed", "torque" or "idle"',
    "temperature": "temperatures are those of the strip, strip.temperature",
    "speed": "the speed of its surface in a stage, rollers.NAME.surface_speed = 1.0",
    "rpm": "the speed of turning in a stage, rollers.NAME.angular_speed = 6.28 (rad/s) for 60 rpm",
    **dict.fromkeys(
        ("force", "load", "nip_force", "line_load", "pressure"),
        "press = 1000.0 (N), of a roller that presses strip on another one",
    ),
}
"""Keys of rollers in other programs, and what to type instead."""

QUANTITY = re.compile(
    r"\s*([-+]?(?:\d+(?:\.|,(?!\d{3}(?!\d)))?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?:\s+|(?![\d.,]))(.*)"
)
"""A number, with a unit or without; a comma before three digits may stand between thousands."""

BETTER_LINES = (
    (r"(=\s*[-+]?\d+),\s*(\d)", r"\1.\2"),
    (r"(=\s*[-+]?)(\.\d)", r"\g<1>0\2"),
    (r"(=\s*[-+]?\d+)\.(?!\d)", r"\1.0"),
    (r"[;,]$", ""),
    (r"^([\w.]+)\s*:\s*", r"\1 = "),
    (r"\s*=\s*([A-Za-z][^\"=]*)$", r' = "\1"'),
    (r"\s*=\s*([-+]?\d[\d.eE+-]*\s*[^\d\s.,/*\[\]\"]\S*)$", r' = "\1"'),
)
"""What other files have instead of TOML, and what to type: a decimal comma behind a key, which is
not in a list, numbers that begin or end with a point, other signs, and text without quotes."""


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a value is a number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def number_in(text: str, meaning: str) -> float | None:
    """Return the number in a text, in the unit that ends the meaning of its key; None without one.

    Examples
    --------
    >>> number_in("5 s", "(s)"), number_in("0,5 mm", "above 0 (m)"), number_in("5 d", "(s)")
    (5.0, 0.0005, None)
    """
    found = QUANTITY.fullmatch(text)
    unit = meaning.rpartition("(")[2].removesuffix(")")
    factors = {**UNIT_FACTORS.get(unit, {unit: 1.0}), "": 1.0}
    factor = factors.get(found[2].strip().replace(" ", "")) if found else None
    if found is None or factor is None:
        return None
    return float(f"{float(found[1].replace(',', '.')) * factor:.12g}")


def number_besides(text: str, meaning: str) -> str | None:
    """Return the number in a text that has another unit than its key, to be typed in this one.

    Examples
    --------
    >>> number_besides("100 N", "above 0 (N/m)"), number_besides("fast", "(m/s)")
    ('100.0, if that is in N/m', None)
    >>> number_besides("30 MPa", "(N/m)")
    '3e+07 t, with the thickness t (m) of the strip'
    """
    found = QUANTITY.fullmatch(text)
    unit = meaning.rpartition("(")[2].removesuffix(")")
    if unit == "N/m" and (stress := number_in(text, "(Pa)")) is not None:
        return f"{stress:.6g} t, with the thickness t (m) of the strip"
    return f"{float(found[1].replace(',', '.'))!r}, if that is in {unit}" if found else None


def word_like(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that was meant: the same in any case, a synonym, or the nearest one.

    Examples
    --------
    >>> [word_like(word, ["shell", "section"]) for word in ("Section", "beam", "sectoin", "x")]
    ['section', 'section', 'section', None]
    """
    small = {name.lower(): name for name in known}
    word = SYNONYMS.get(word.lower(), word.lower())
    matches = get_close_matches(word, small, n=1, cutoff=0.6)
    return small[matches[0]] if matches else None


def key_like(key: str, value: object, known: Iterable[str]) -> str | None:
    """Return what to type for a key that has another name here; None if it is none of them.

    Examples
    --------
    >>> key_like("rpm", 60, ["angular_speed"]), key_like("nu", 0.3, ["young"])
    ('angular_speed = 6.28319', None)
    >>> key_like("exit_tension", 5e3, ["exit", "gravity"])
    'exit.tension = 5000'
    >>> key_like("thickness_mm", 0.7, ["thickness"]), key_like("diameter", "610 mm", ["radius"])
    ('thickness = 0.0007', 'radius = 0.305')
    >>> key_like("tension_min", 5e3, ["tension"])
    """
    if isinstance(value, list | dict):
        return collection_like(key, value) if "centre" in known else None
    part, _, control = key.partition("_")
    base, _, unit = key.rpartition("_")
    if isinstance(value, str):
        found = (number_in(value, f"({each})") for each in UNIT_FACTORS)
        value = next((each for each in found if each is not None), value)
    if not is_number(value):
        return None
    if control and part in PARTS_OF_STAGES and part in known:
        return f"{part}.{control} = {value:.6g}"
    scale = None if unit in ("in", "min") else ALL_UNITS.get(unit)  # a place, or the least
    if scale and (base in known or base.lower() in OTHER_NAMES):
        key, value = base, float(scale * value)
    names, share = OTHER_NAMES.get(key.lower(), ("", 1.0))
    name = next((name for name in (*names.split(), key) if name in known), None)
    if name is None:
        return None
    if name == "every" and not isinstance(value, int):
        return "times = [0.5, 1.0]; or every = 10, of the steps"
    return f"{name} = {share * value:.6g}"


def collection_like(key: str, value: list[object] | dict[str, object]) -> str | None:
    """Return what to type for a list or a table in one of rollers; None if it is not known.

    Examples
    --------
    >>> collection_like("position", [0.0, 0.0, -0.5])
    'centre = [0.0, 0.0, -0.5]'
    """
    if isinstance(value, dict):
        return f'[[rollers]] and below it name = "{key}" and its keys, in place of [rollers.{key}]'
    return f"centre = {value}" if key.lower() in ("position", "location") else None


def key_elsewhere(key: str, known: Iterable[str]) -> str | None:
    """Return what to type instead of a key that a roller, its stages or the strip never have.

    Examples
    --------
    >>> key_elsewhere("tilt", ["radius", "axis"])
    'axis = [0.0, 1.0, 0.001], for an end at +y that is higher by 1 mrad'
    """
    tables = (
        (NO_CONTROLS, "surface_speed"),
        (FOREIGN_KEYS, "radius"),
        (KEYS_OF_ENDS, "stages"),
        (KEYS_ANYWHERE, None),
    )
    return next((t[key] for t, of in tables if key in t and (of is None or of in known)), None)


def name_like(text: str) -> str:
    """Return a text as a name of letters, digits, - and _, or nothing if none are in it.

    Examples
    --------
    >>> name_like("run again"), name_like("Öl 2!"), name_like("?")
    ('run_again', 'Ol_2', '')
    """
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9_-]+", "_", plain).strip("_")[:64]


def as_toml(line: str) -> str | None:
    """Return a line as TOML has it, as with a decimal point for a comma; None if it is not known.

    Examples
    --------
    >>> as_toml("poisson = 0,3  # of steel"), as_toml("cells = [16, 2]")
    ('poisson = 0.3', None)
    >>> as_toml("width = .5"), as_toml("kinematics: section;")
    ('width = 0.5', 'kinematics = "section"')
    """
    typed = better = line.partition("#")[0].strip()
    for pattern, replacement in BETTER_LINES:
        better = re.sub(pattern, replacement, better)
        with suppress(tomllib.TOMLDecodeError):
            tomllib.loads(better)
            return better if better != typed else None
    return None


def expected_number(kind: str, value: object) -> str:
    """Return that a number is expected where pydantic finds text instead of one."""
    wanted = kind in ("float_type", "int_type") and isinstance(value, str)
    return "a number, without quotes and unit: " if wanted else ""


def likely_value(kind: str, value: Any, meaning: str, field: FieldInfo) -> str | None:
    """Return what was presumably meant by a wrong value, in TOML; None if nothing is likely.

    Parameters
    ----------
    kind : str
        Type of error of pydantic.
    value : object
    meaning : str
        That of the key, with its unit in brackets at the end.
    field : FieldInfo
    """
    better: float | str | list[object] | None = None
    if kind in ("float_type", "int_type") and isinstance(value, str):
        better = number_in(value, meaning)
        if better is None:
            return number_besides(value, meaning)
    elif kind in ("greater_than", "greater_than_equal") and value < 0:
        better = -value
    elif kind == "literal_error" and isinstance(value, str):
        kinds = (field.annotation, *get_args(field.annotation))
        better = word_like(value, [w for k in kinds for w in get_args(k) if isinstance(w, str)])
    elif kind == "missing" and isinstance(value, list | tuple) and not meaning.endswith("(1)"):
        # a place or a force in the plane of the line, without its y; a direction is neither
        better = [value[0], 0.0, value[1]] if len(value) == 2 else None
    if kind == "int_type" and isinstance(better, float) and better.is_integer():
        better = int(better)
    if better is None or not field_accepts(field, better):
        return None
    return f'"{better}"' if isinstance(better, str) else repr(better)


def field_accepts(field: FieldInfo, value: object) -> bool:
    """Return whether a field may have a value."""
    kind: Any = Annotated[field.annotation, field]
    try:
        TypeAdapter(kind).validate_python(value)
    except ValidationError:
        return False
    return True
