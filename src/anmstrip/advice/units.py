"""Values that no line has in the unit of their key, and the scene as it was presumably meant.

A value that is in doubt is no measure of others: these are judged in the scene as it was meant.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from anmstrip.advice.preview import Preview
from anmstrip.errors import InputError
from anmstrip.scene.checks import meant_modulus
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import ENDS
from anmstrip.simulation.defaults import has_default_slip_speed, largest_force, typed_tensions
from anmstrip.simulation.meshing import MAX_LYING_TURN
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.threading import LARGEST_RADIUS

LARGEST_IN_LINES = {"m": LARGEST_RADIUS, "m/s": 100.0, "m/s²": 5e3, "t/m³": 25.0}
"""Widths, radii, speeds, gravity and density in a line beyond which another unit was meant; the
earth's gravity is 9810 mm/s²."""

MAX_LINE_STRESS = 500.0
"""Stress (MPa) by which no line pulls: a larger number is a tension in N/m."""

LARGEST_MOVE = 10.0
"""Way that no roller and no end is moved, in lengths of the strip."""

LONGEST_RUN = 500.0
"""Length (m) that no run of strip has between two rollers: those of towers have 70 m."""

MIN_THICKNESS = 4e-3
"""Thickness (m) up to which none can have been typed in mm: there is no strip below 4 µm."""

MIN_FLATNESS = 0.01
"""Flatness (I-units) of which no line has less."""

MAX_FRICTION = 1.5
"""Friction coefficient that no roller exceeds: dry rubber has about 1."""

LOOP_HEIGHT = 2.0
"""Height of strip (m) whose weight pulls at any strip, be it in a free loop."""

SPECIFIC_STIFFNESS = 2.6e7
"""Young's modulus over density (m²/s²) of steel, aluminium and titanium alike; others have less."""

EARTH_GRAVITY = 9.81
"""Acceleration of gravity (m/s²)."""

MAX_TENSION_STRAIN = 5e-3
"""Strain by tension that no strip in millimetres has: it is that of a tension in N/m."""

SOFT_MODULUS = 1e4
"""Modulus (MPa) up to which strip is rubber or a plastic."""

MAX_SOFT_STRAIN = 0.1
"""Strain by tension that such strip may have."""

MIN_RUBBER_POISSON = 0.4
"""Poisson's ratio from which on strip is rubber rather than a metal."""

MILLIMETRE_RANGES = {"young": (1.0, 1e6), "thickness": (1e-3, 300.0), "width": (0.3, 2e4)}
"""Least and largest modulus (MPa), thickness and width (mm) of strip."""

WIDEST_IN_METRES = 3.0
"""Width up to which strip may as well be in metres, and its tension has to tell."""

MIN_TENSION_STRAIN = 1e-6
"""Strain by tension that all strip of a line in millimetres has."""

MIN_RADIUS = 1.0
"""Radius (mm) of which no roller has less."""

MIN_GRAVITY = 100.0
"""Acceleration from which on gravity may be in mm/s²."""

MAX_DENSITY = 1e-7
"""Density (t/mm³) that nothing has more of."""


class Doubt(NamedTuple):
    """A value that is likely to be in another unit."""

    key: str
    value: float
    why: str  # what it is, and why it cannot be meant so
    meant: str  # the unit that was meant
    typed: str  # what to set, as ``--set`` takes it


def doubt(key: str, value: float, unit: str, meant: str, better: float) -> Doubt:
    """Return the doubt about a value that no line has, with what it is in the unit of its key."""
    why = f"in {unit}, in which no line has such a value"
    return Doubt(key, value, why, meant, f"{key}={better:.6g}")


def other_units(preview: Preview) -> Iterator[str]:
    """Values that no line has, but in millimetres, megapascals or metres per minute."""
    if mesh_in_millimetres(preview):
        strip = preview.assembly.strip
        yield (
            f"the mesh of strip.mesh is {strip.length:.4g} m long and {strip.width:.4g} m wide; "
            "was it drawn in mm? Multiply its coordinates by 0.001"
        )
    for each in doubts(preview):
        yield (
            f"{each.key} = {each.value:g} is {each.why}; was it meant in {each.meant}? "
            f"Try --set {shlex.quote(each.typed)}"
        )


def mesh_in_millimetres(preview: Preview) -> bool:
    """Return whether a mesh is wider than any strip, beside a modulus in pascals."""
    scene, width = preview.assembly.scene, preview.assembly.strip.width
    in_pascals = scene.material.young > MILLIMETRE_RANGES["young"][1]
    return scene.strip.mesh is not None and in_pascals and width > LARGEST_IN_LINES["m"]


def all_in_other_units(preview: Preview) -> Iterator[str]:
    """A scene whose values fit together in units of which labels do not know."""
    scene = preview.assembly.scene
    if in_millimetres(scene):
        units, results = "N, mm, MPa and s, with t/mm³ and mm/s²", "N/mm and torques in N mm"
    elif in_kilonewtons(scene):
        units, results = "kN, m, kN/m² and s, with t/m³", "kN/m and torques in kN m"
    else:
        return
    yield (
        f"the values of this scene fit together in {units}. Results are in these units too, "
        f"whatever units labels and messages name: tensions in {results}, for instance."
    )


def as_meant(preview: Preview) -> Preview | None:
    """Return the preview of the scene as it was presumably meant.

    That is the given one where nothing is in doubt, and none where that scene cannot be.
    """
    assembly = preview.assembly
    found = list(doubts(preview))
    if mesh_in_millimetres(preview):
        return None
    if not found:
        return preview
    try:
        scene = scene_as_meant(assembly.scene, found)
        other = Preview.of(Assembly(scene, assembly.imperfection, assembly.added))
    except InputError:
        return None
    count = len(preview.plans)
    return Preview(other.assembly, other.plans[:count], other.strings[:count])


def doubts(preview: Preview) -> Iterator[Doubt]:
    """Yield all values in doubt; loads by a strip that is none."""
    scene = preview.assembly.scene
    if in_millimetres(scene):
        yield from doubtful_weight(scene)
        return
    if in_kilonewtons(scene):
        density = scene.material.density or 0.0
        if density > LARGEST_IN_LINES["t/m³"]:
            why = "in t/m³ here, since the other values are in kN, m and kN/m²"
            typed = f"material.density={1e-3 * density:.6g}"
            yield Doubt("material.density", density, why, "kg/m³", typed)
        return
    found = [*doubtful_strip(preview), *doubtful_friction(scene), *doubtful_speeds(scene)]
    found += [*doubtful_moves(preview), *doubtful_places(scene)]
    yield from found
    why = "in m/s², in which no line has such a value"
    yield from doubtful_gravity(scene, (LARGEST_IN_LINES["m/s²"], np.inf), why, "mm/s²", 1e-3)
    with suppress(InputError):  # nothing is known of tensions where that scene cannot be
        yield from doubtful_tensions(scene_as_meant(scene, found))
    yield from doubtful_flatness(scene)


def scene_as_meant(scene: SceneSpec, found: Sequence[Doubt]) -> SceneSpec:
    """Return a scene with what was meant instead of what is in doubt.

    A speed of friction that follows from values of the scene is found anew.

    Raises
    ------
    InputError
        That scene cannot be.
    """
    if not found:
        return scene
    tables: dict[str, Any] = scene.model_dump(mode="json", exclude_unset=True)
    for stage in tables["stages"]:
        stage.update(stage.pop("edges", {}))
    if has_default_slip_speed(scene):
        tables["friction"].pop("speed", None)
    typed = [each.typed for each in found]
    return SceneSpec.from_tables(tables, scene.source or "scene", typed)


def in_millimetres(scene: SceneSpec) -> bool:
    """Return whether sizes, modulus and tension fit together in N, mm and MPa, and not in SI."""
    strip, young = scene.strip, scene.material.young
    width, strain = strip.width or 0.0, largest_force(scene) / (young * strip.thickness)
    given = {"young": young, "thickness": strip.thickness, "width": width}
    ranges = ((value, *MILLIMETRE_RANGES[key]) for key, value in given.items())
    sized = all(least <= value <= most for value, least, most in ranges)
    sized = sized and all(roller.radius >= MIN_RADIUS for roller in scene.rollers)
    needed = 0.0 if width > WIDEST_IN_METRES else MIN_TENSION_STRAIN
    most = MAX_SOFT_STRAIN if young <= SOFT_MODULUS else MAX_TENSION_STRAIN
    return sized and needed <= strain <= most


def in_kilonewtons(scene: SceneSpec) -> bool:
    """Return whether modulus and tension of rubber fit together in kN and m, and no Pa fit it."""
    strip, m = scene.strip, scene.material
    strain = largest_force(scene) / (m.young * strip.thickness)
    largest = max([strip.width or 0.0, *(roller.radius for roller in scene.rollers)])
    sized = largest <= LARGEST_IN_LINES["m"] and not in_millimetres(scene)
    rubber = m.poisson >= MIN_RUBBER_POISSON and meant_modulus(m.young) is not None
    return sized and rubber and MIN_TENSION_STRAIN <= strain <= MAX_SOFT_STRAIN


def in_megapascals(scene: SceneSpec, stress: float) -> float:
    """Return a stress in MPa, from the units of the scene."""
    return stress if in_millimetres(scene) else (1e-3 if in_kilonewtons(scene) else 1e-6) * stress


def told_stress(scene: SceneSpec, stress: float) -> str:
    """Say a stress in MPa: soft strip may yield below one."""
    told = in_megapascals(scene, stress)
    return f"{told:.0f} MPa" if told >= 10.0 else f"{told:.2g} MPa"


def doubtful_weight(scene: SceneSpec) -> Iterator[Doubt]:
    """Yield a density and a gravity in SI units beside millimetres and megapascals."""
    density = scene.material.density
    why = "in {} here, since the other values are in N, mm and MPa"
    if density is not None and density > MAX_DENSITY:
        unit, share = ("kg/m³", 1e-12) if density > 100.0 else ("g/cm³", 1e-9)
        typed = f"material.density={share * density:.6g}"
        yield Doubt("material.density", density, why.format("t/mm³"), unit, typed)
    yield from doubtful_gravity(scene, (0.0, MIN_GRAVITY), why.format("mm/s²"), "m/s²", 1e3)


def doubtful_gravity(
    scene: SceneSpec, between: tuple[float, float], why: str, meant: str, factor: float
) -> Iterator[Doubt]:
    """Yield the gravity of stages between two values, which was meant in another unit."""
    for stage in scene.stages:
        size = float(np.linalg.norm(stage.gravity or 0.0))
        if stage.gravity is not None and between[0] < size < between[1]:
            key = f"stages.{stage.name}.gravity"
            better = typed_vector(factor * np.array(stage.gravity))
            yield Doubt(key, size, why, meant, f"{key}={better}")


def typed_vector(components: Iterable[float], form: str = "g") -> str:
    """Return numbers as they are typed in a list, each in a format."""
    return f"[{', '.join(format(float(component), form) for component in components)}]"


def doubtful_moves(preview: Preview) -> Iterator[Doubt]:
    """Yield moves of rollers and ends by many times the length of the strip."""
    length = preview.assembly.strip.length
    for stage in preview.assembly.scene.stages:
        moves = {f"rollers.{name}": control.move for name, control in stage.rollers.items()}
        moves |= {name: control.move for name, control in stage.edges.items()}
        for name, move in moves.items():
            size = float(np.linalg.norm(move or 0.0))
            if move is not None and size > LARGEST_MOVE * length:
                key = f"stages.{stage.name}.{name}.move"
                why = f"in m, with a strip of {length:.3g} m"
                yield Doubt(key, size, why, "mm", f"{key}={typed_vector(1e-3 * np.array(move))}")


def doubtful_places(scene: SceneSpec) -> Iterator[Doubt]:
    """Yield places of a line that are far from all others, but among them in millimetres."""
    if scene.threading is None:
        return
    given = {f"rollers.{r.name}.centre": r.centre for r in scene.rollers if r.wrap is not None}
    given |= {f"threading.{name}": getattr(scene.threading, name) for name in ENDS}
    places = {key: np.array(place) for key, place in given.items() if place is not None}
    for key, place in places.items():
        others = [other for name, other in places.items() if name != key]
        far, near = (
            min((float(np.linalg.norm(share * place - other)) for other in others), default=0.0)
            for share in (1.0, 1e-3)
        )
        if near < LONGEST_RUN < far:
            why = f"in m, and {far:.3g} m from all other places of the line"
            typed = f"{key}={typed_vector(1e-3 * place)}"
            yield Doubt(key, float(np.linalg.norm(place)), why, "mm", typed)


def doubtful_strip(preview: Preview) -> Iterator[Doubt]:
    """Yield sizes of strip and rollers, and a material, that no line has.

    What nothing pulls around rollers, or hardly turns on them, may be thick plate that lies there.
    """
    scene, rollers = preview.assembly.scene, preview.assembly.rollers
    t, m = scene.strip.thickness, scene.material
    bent = [roller.radius for roller in rollers if preview.turn(roller) > MAX_LYING_TURN]
    least = min(bent, default=np.inf) if largest_force(scene) else np.inf
    if t > max(min(0.1 * least, 0.1), MIN_THICKNESS):
        yield doubt("strip.thickness", t, "m", "mm", 1e-3 * t)
    sizes = {f"rollers.{roller.name}.radius": roller.radius for roller in scene.rollers}
    for key, size in {"strip.width": scene.strip.width or 0.0, **sizes}.items():
        if size > LARGEST_IN_LINES["m"]:
            yield doubt(key, size, "m", "mm", 1e-3 * size)
    if (meant_as := meant_modulus(m.young)) is not None:
        yield doubt("material.young", m.young, "Pa", *meant_as)
    if m.yield_stress is not None and m.yield_stress < 1e4:
        yield doubt("material.yield_stress", m.yield_stress, "Pa", "MPa", 1e6 * m.yield_stress)
    if m.density is not None and m.density < 100.0:
        meant, factor = ("t/mm³", 1e12) if m.density <= MAX_DENSITY else ("g/cm³", 1e3)
        yield doubt("material.density", m.density, "kg/m³", meant, factor * m.density)


def doubtful_friction(scene: SceneSpec) -> Iterator[Doubt]:
    """Yield friction coefficients beyond those of any roller."""
    given = {f"rollers.{roller.name}.friction": roller.friction for roller in scene.rollers}
    if scene.friction is not None:
        given = {"friction.coefficient": scene.friction.coefficient, **given}
    why = f"a ratio of forces, which exceeds {MAX_FRICTION:g} on no roller"
    for key, value in given.items():
        if value is not None and value > MAX_FRICTION:
            yield Doubt(key, value, why, "per cent", f"{key}={0.01 * value:.6g}")


def doubtful_speeds(scene: SceneSpec) -> Iterator[Doubt]:
    """Yield speeds of strip and of rollers that no line has."""
    most = LARGEST_IN_LINES["m/s"]
    for stage in scene.stages:
        speeds = {"strip.speed": stage.strip.speed}
        speeds |= {f"{name}.speed": edge.speed for name, edge in stage.edges.items()}
        speeds |= {f"rollers.{n}.surface_speed": c.surface_speed for n, c in stage.rollers.items()}
        for key, speed in speeds.items():
            if speed is not None and abs(speed) > most:
                unit, share = ("m/min", 60.0) if abs(speed) <= 60.0 * most else ("mm/s", 1e3)
                yield doubt(f"stages.{stage.name}.{key}", speed, "m/s", unit, speed / share)


def doubtful_tensions(scene: SceneSpec) -> Iterator[Doubt]:
    """Yield tensions below those of strip that hangs in a loop by its own weight."""
    t, m = scene.strip.thickness, scene.material
    least = EARTH_GRAVITY * LOOP_HEIGHT * t * (m.density or m.young / SPECIFIC_STIFFNESS)
    bound = min(least, MAX_LINE_STRESS)
    threaded = np.inf if scene.threading is None else scene.threading.tension
    # A stage that pulls by less than 1 leaves strip slack, unless threading is in doubt too.
    slack = 0.0 if threaded < bound else 1.0
    why = f"in N/m, and {LOOP_HEIGHT:g} m of the strip weigh {least:.3g} N/m"
    for key, tension in typed_tensions(scene).items():
        if slack <= tension < bound:
            yield Doubt(key, tension, why, "MPa", f"{key}={1e6 * t * tension:.3g}")


def doubtful_flatness(scene: SceneSpec) -> Iterator[Doubt]:
    """Yield flatness so small that it may be a strain."""
    uneven = {"strip.flatness": scene.strip.flatness}
    uneven |= {f"stages.{s.name}.strip.flatness": s.strip.flatness for s in scene.stages}
    for key, field in uneven.items():
        most = 0.0 if field is None else float(np.abs(field.samples).max())
        if field is not None and 0.0 < most < MIN_FLATNESS:
            if field.across:
                typed = f"across={typed_vector(1e5 * np.array(field.across))}"
            else:
                typed = f"table=[{', '.join(f'[{eta:g}, {1e5 * c:g}]' for eta, c in field.table)}]"
            why = "in I-units, in which no line has such a value"
            yield Doubt(key, most, why, "strains", f"{key}.{typed}")
