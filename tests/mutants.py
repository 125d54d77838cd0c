"""Deliberate errors in reported numbers, one at a time, and whether the tests notice them.

    python tests/mutants.py [--only NAME] [-n 2]

Every mutant is a piece of source text, found by searching all of the package, and what it is
replaced by.  The work tree is left alone: each worker has a copy of the source and of the tests,
in which it makes one error, runs the tests of the part that it is in, then all of
``tests/reported`` (and files that a mutant names), slow ones last, and mends it again.  The exit
status is 0 if at least 95 per cent are noticed.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.pool import ThreadPool
from pathlib import Path
from queue import Queue
from time import monotonic

TOP = Path(__file__).parents[1]
COPIED = ("src", "tests", "examples", "meshes", "pyproject.toml", "README.md")
NEEDED = 0.95
PATIENCE = 3.0
"""Time for the tests of a mutant, over that of all tests without one."""


@dataclass(frozen=True)
class Mutant:
    """One deliberate error.

    Parameters
    ----------
    name : str
    old, new : str
        Source text that occurs once in the package, and what takes its place.
    part : str
        Which ``test_reported_PART.py`` is asked first.
    more : str
        Name of a test file outside ``tests/reported`` that is asked too, wherever it is.
    """

    name: str
    old: str
    new: str
    part: str
    more: str = ""


STATE = (
    Mutant(
        "moments of clamps on both sides of the strip alike",
        "sense * own[dofs].sum()",
        "own[dofs].sum()",
        "summary",
        "test_clamps.py",
    ),
    Mutant(
        "a pressed roller is drawn where it has not shifted",
        "centre if pressed is None else centre + pressed.shift(roller, self.full)",
        "centre",
        "summary",
        "test_press.py",
    ),
    Mutant(
        "sensitivity to the force of a roller of the other sign",
        "zip(effect.names, -np.eye(len(effect.names)), strict=True)",
        "zip(effect.names, np.eye(len(effect.names)), strict=True)",
        "sensitivities",
        "test_press.py",
    ),
    Mutant(
        "what presses on a drum counts for its wrap",
        "nipped = drawn & (self.opposed > self.contact.signorini.faint)",
        "nipped = drawn & (self.opposed < 0.0)",
        "rollers",
        "test_press.py",
    ),
    Mutant(
        "clamps that turn",
        "held[strip.edge_unknowns(name, (), [2], ())] = True",
        "pass",
        "summary",
        "test_clamps.py",
    ),
    Mutant(
        "short arcs leave fibres as slack as long ones",
        "-np.expm1(-2.1 * arc",
        "-np.expm1(-21.0 * arc",
        "summary",
        "test_forewarnings.py",
    ),
    Mutant(
        "runs take strip up between two held ends",
        "if not set(ENDS) <= held]",
        "]",
        "summary",
        "test_labels.py",
    ),
    Mutant(
        "labels of warm strip drift",
        "np.asarray(before / after - 1.0)",
        "0.0 * np.asarray(before / after - 1.0)",
        "summary",
        "test_labels.py",
    ),
    Mutant(
        "labels of stretched strip drift",
        "runs * more / loads.stiffness",
        "0.0 * runs * more / loads.stiffness",
        "summary",
        "test_labels.py",
    ),
    Mutant(
        "runs of stiff strip hang like strings",
        "lost += 0.75 * layer",
        "lost += 0.0 * layer",
        "summary",
        "test_labels.py",
    ),
    Mutant(
        "a fed line walks off where nothing rubs",
        "if not (self.assembly.scene.strip.feed and held and edge == name):",
        "if not (self.fed(stage) and held and edge == name):",
        "summary",
        "test_labels.py",
    ),
    Mutant(
        "readings of strip that is only laid",
        "return None if laid else self.state",
        "return self.state",
        "summary",
        "test_diagnosis.py",
    ),
    Mutant(
        "runs give off what they take up",
        "taken = float(",
        "taken = -float(",
        "summary",
        "test_dancer.py",
    ),
    Mutant(
        "material passes labels as if runs took nothing up",
        '(speed + self.controls["strip.drift"])',
        "(speed)",
        "fields",
        "test_dancer.py",
    ),
    Mutant(
        "tension of strip that runs hold is that along labels",
        "tangents[:, 0] /= growth",
        "tangents[:, 0] /= 1.0",
        "profile",
        "test_dancer.py",
    ),
    Mutant(
        "arc length along labels",
        '"arc_length": state.unstressed_length(self.reference[0])',
        '"arc_length": self.reference[0] - self.reference[0].min()',
        "profile",
        "test_dancer.py",
    ),
    Mutant(
        "the tension of an end is along its curl",
        "return self.stress(tangents) * (sine * sine * -2.0 + 1.0) + aside",
        "return self.stress(tangents)",
        "rollers",
        "test_natural_shapes.py",
    ),
    Mutant(
        "tension of an edge is its force",
        "(name) @ outward) / edge.length",
        "(name) @ outward)",
        "rollers",
    ),
    Mutant(
        "force of an edge without its load",
        "strip.kinematics.embed(values) + given",
        "strip.kinematics.embed(values)",
        "rollers",
    ),
    Mutant(
        "following tension has the other sense",
        "given - strip.kinematics.embed(stress[:, 0]",
        "given + strip.kinematics.embed(stress[:, 0]",
        "rollers",
    ),
    Mutant(
        "nothing holds a plate in its plane",
        'if name == "entry" and 0 not in',
        'if name == "" and 0 not in',
        "rollers",
    ),
    Mutant(
        "weight behind a roller for that before it",
        "return self.weight_of(self.unstressed_length(x))",
        "return self.weight_of(np.ptp(self.plan.model.strip.span) - self.unstressed_length(x))",
        "rollers",
    ),
    Mutant(
        "errors of states in time are those by their paths alone",
        "memory.errors.after[:2].sum(axis=0)",
        "memory.errors.after[1]",
        "errors",
    ),
    Mutant(
        "errors of states are five times as large",
        'found["membrane_force"] = float(',
        'found["membrane_force"] = 5.0 * float(',
        "errors",
    ),
    Mutant(
        "state inside a step is that of another instant",
        "trial = self.trial(memory, time, order)",
        "trial = self.trial(memory, 0.9 * time + 0.1 * memory.times[0], order)",
        "events",
    ),
    Mutant(
        "velocity inside a step is that before",
        "return trial.u, trial.v",
        "return trial.u, memory.v",
        "fields",
    ),
)

READINGS = (
    Mutant(
        "normal force 10 per cent off",
        "self.normal_force = float(",
        "self.normal_force = 1.1 * float(",
        "rollers",
    ),
    Mutant(
        "a torque of the nominal radius",
        "float(self.friction_forces @ self.arm)",
        "float(self.friction_forces.sum()) * self.roller.radius",
        "rollers",
    ),
    Mutant(
        "the torque is the drag",
        "float(self.friction_forces @ self.arm)",
        "float(self.friction_forces.sum())",
        "rollers",
    ),
    Mutant(
        "the surface stands",
        'return float(self.controls[f"rollers.{name}.surface_speed"]), 0.0',
        "return 0.0, 0.0",
        "rollers",
    ),
    Mutant(
        "bearings drive",
        "float(drives.drag(speeds)[number])",
        "-float(drives.drag(speeds)[number])",
        "rollers",
        "test_turning_rollers.py",
    ),
    Mutant(
        "travel of a free surface is its speed",
        "0.5 * h * float(begin[place] + self.velocity[place])",
        "float(self.velocity[place])",
        "rollers",
        "test_turning_rollers.py",
    ),
    Mutant(
        "where the strip passes is turned", '"above" if z > 0.0', '"above" if z < 0.0', "explain"
    ),
    Mutant(
        "drag has the other sign",
        "float(self.friction_forces.sum())",
        "-float(self.friction_forces.sum())",
        "rollers",
    ),
    Mutant(
        "cone violation is always 0",
        "max(0.0, float(state.cone_share.max()) - 1.0)",
        "0.0",
        "rollers",
    ),
    Mutant(
        "wrap 1 per cent off",
        "wrap = float(np.ptp(ends))",
        "wrap = 1.01 * float(np.ptp(ends))",
        "rollers",
    ),
    Mutant(
        "tension before a roller is a force",
        "tension_in=tensions[0]",
        "tension_in=tensions[0] * state.width",
        "rollers",
    ),
    Mutant(
        "tension behind a roller is that before",
        "tension_out=tensions[1]",
        "tension_out=tensions[0]",
        "rollers",
    ),
    Mutant(
        "tension ratio upside down",
        "return self.tension_in / self.tension_out",
        "return self.tension_out / self.tension_in",
        "rollers",
    ),
    Mutant(
        "largest slip also out of contact",
        "float(speeds[self.touching].max",
        "float(speeds.max",
        "rollers",
    ),
    Mutant("creep has the other sign", "creep_speed=-float(", "creep_speed=float(", "rollers"),
    Mutant(
        "touching is a fifth of the mean", "TOUCHING_SHARE = 0.1", "TOUCHING_SHARE = 0.2", "rollers"
    ),
)

REGULARISATION = (
    Mutant(
        "creep of what slips",
        "slip[touching & (traction < STICKING_SHARE * cone)].max",
        "slip[touching].max",
        "rollers",
    ),
    Mutant(
        "penetration is the mean",
        "np.abs(state.gap[touching]).max()",
        "np.abs(state.gap[touching]).mean()",
        "rollers",
    ),
    Mutant(
        "creep is a strain",
        "creep * stay / arc * stiffness / tension",
        "creep * stay / arc",
        "rollers",
    ),
    Mutant(
        "excess of the cone over the width forgotten",
        "excess[touching].sum()) / (tension * state.width)",
        "excess[touching].sum()) / tension",
        "rollers",
    ),
    Mutant(
        "uneven gaps not beside the strain",
        "/ radius / (tension / stiffness)",
        "/ radius",
        "rollers",
    ),
    Mutant(
        "total without the cone",
        "self.by_creep + self.by_cone + self.by_penetration",
        "self.by_creep + self.by_penetration",
        "rollers",
    ),
    Mutant("what sticks is less", "STICKING_SHARE = 0.95", "STICKING_SHARE = 0.5", "rollers"),
    Mutant(
        "strip stays as long as the roller turns",
        "abs(speed - reading.creep_speed)",
        "abs(speed)",
        "rollers",
    ),
    Mutant(
        "sharpened by half as much", "else value * factor", "else value * factor * 2.0", "summary"
    ),
)

FIELDS = (
    Mutant("von Mises adds the product", "- sx * sy + sy**2", "+ sx * sy + sy**2", "fields"),
    Mutant("von Mises with less shear", "3.0 * sxy**2", "sxy**2", "fields"),
    Mutant("stress of the lower side", "t + 6.0 * moments", "t - 6.0 * moments", "fields"),
    Mutant(
        "mean curvature times 1.3",
        "0.5 * (curvature[0] + curvature[1])",
        "0.65 * (curvature[0] + curvature[1])",
        "fields",
    ),
    Mutant("twisting moment", "[0.0, 0.0, 1.0 - nu]]", "[0.0, 0.0, 1.0 + nu]]", "fields"),
    Mutant(
        "shear force for the one across",
        "found[1], found[2] = tensor[1, 1], tensor[0, 1]",
        "found[1], found[2] = tensor[0, 1], tensor[1, 1]",
        "fields",
    ),
    Mutant(
        "slip of the farthest roller",
        "nearest = f.gap <= gap[chosen]",
        "nearest = f.gap > gap[chosen]",
        "fields",
    ),
    Mutant(
        "gap of the farthest roller",
        "gaps[far] = np.minimum(gaps[far], part.restricted(far)",
        "gaps[far] = np.maximum(-gaps[far], part.restricted(far)",
        "fields",
    ),
    Mutant(
        "pressure between contact points, not around points of output",
        '("normal_pressure", pressure, around)',
        '("normal_pressure", pressure, between)',
        "fields",
    ),
    Mutant("gaps around points", '("gap", gap, between)', '("gap", gap, around)', "fields"),
    Mutant(
        "velocity is the displacement",
        "self.interpolate(state.material_velocity)",
        "self.interpolate(state.full)",
        "fields",
    ),
    Mutant(
        "a section is one metre wide",
        "(across / 3.0 - 0.5) * strip.width",
        "across / 3.0 - 0.5",
        "fields",
    ),
    Mutant(
        "moments of the imperfection",
        "bending = curvature - self._geometry(sheet.imperfection)[2]",
        "bending = curvature",
        "fields",
    ),
    Mutant(
        "membrane forces are not averaged at nodes",
        "np.asarray(means[:, places] @ to_points.T)",
        "np.asarray(ends @ to_points.T)",
        "fields",
    ),
    Mutant(
        "moments of hinges go beyond what is found there",
        "means = np.clip(means, low.T, high.T)",
        "means = np.clip(means, low.T - 200.0, high.T + 200.0)",
        "fields",
    ),
    Mutant(
        "a plate has no tension",
        "np.multiply.outer([pull, 0.0, 0.0]",
        "np.multiply.outer([0.0, 0.0, 0.0]",
        "fields",
    ),
)

FILES = (
    Mutant(
        "two nodes of a cell exchanged",
        "3, 15, 12, 1, 2, 7, 11",
        "3, 15, 12, 2, 1, 7, 11",
        "fields",
    ),
    Mutant(
        "plain cells crossed",
        "grid[1:, 1:], grid[1:, :-1]",
        "grid[1:, :-1], grid[1:, 1:]",
        "fields",
    ),
    Mutant(
        "rollers turn backwards",
        "painted[:, None, None] + angle",
        "painted[:, None, None] - angle",
        "rollers",
    ),
    Mutant(
        "angle of a roller is its travel",
        "self.turned[roller.name] / roller.radius",
        "self.turned[roller.name]",
        "rollers",
    ),
    Mutant("travel by the last speed", "- 0.5 * gained)", "- 0.0 * gained)", "rollers"),
    Mutant(
        "profiles are not drawn",
        "roller.radius_at(rings), roller.slope_at(rings)",
        "roller.radius + 0.0 * rings, roller.slope_at(rings)",
        "rollers",
    ),
    Mutant(
        "rollers drawn longer",
        "roller_surface(roller, 1.2 * width, angle)",
        "roller_surface(roller, 1.5 * width, angle)",
        "rollers",
    ),
    Mutant(
        "rollers drawn off their axes",
        'edge")[:, None]\n    distance',
        'edge")[:, None] * 1.1\n    distance',
        "rollers",
    ),
    Mutant("times of states in other units", "{entry.time!r}", "{1.1 * entry.time!r}", "rollers"),
)

ENDS = (
    Mutant("wrap from point to point", "parabola_roots(gap)", "parabola_roots(gap + 1e9)",
           "profile"),
    Mutant("a parabola through two points", "4 * s * (1 - s), s * (2 * s - 1)",
           "2 * s * (1 - s), s * (2 * s - 1)", "profile"),
    Mutant("capacity by the contact's angle", "angles[np.abs(angles - wrap).argmin()]",
           "wrap", "profile"),
    Mutant("capacity without a bound", "min(np.hypot(used, sideways), 1.0)",
           "np.hypot(used, sideways)",
           "profile"),
    Mutant("line load without its moment", "held**2 - 2.0 * pressure", "held**2 - pressure",
           "profile"),
    Mutant("line loads exchanged", "line_load_in=loads[0]", "line_load_in=loads[1]", "profile",
           "test_roller_tensions.py"),
    Mutant("friction leaves the tension alone", "borne = force + lost",
           "borne = force + 0.0 * lost", "profile"),
    Mutant("largest error is the least", "return max((abs(there", "return min((abs(there",
           "errors"),
    Mutant("error in time is that of paths", '("time", "path", "reg',
           '("path", "time", "reg', "errors"),
    Mutant("forces of laws that stay", "effect.sharper(by) for", "effect.sharper(0.0 * by) for",
           "errors"),
    Mutant("laws err in the last step only", "right[1:] += added", "right[1:2] += added[:1]",
           "errors"),
)  # fmt: skip

PROFILE = (
    Mutant("tension between files and ends", "membrane[0] * stretch + bent / stretch",
           "membrane[0] + bent / stretch", "fields"),
    Mutant("bent strip's tension is its membrane's", "stretch + bent / stretch", "stretch",
           "fields"),
    Mutant("least squares without areas", "np.sqrt(basis.W)", "np.ones_like(basis.W)", "fields"),
    Mutant("all that touches slips", "self.cone_share >= STICKING_SHARE, 2.0, 1.0",
           "self.cone_share >= 0.0, 2.0, 1.0", "fields"),
    Mutant("cells seen from below", "= first[0] * second[1] <", "= first[0] * second[1] >",
           "fields"),
    Mutant("components without names", "f' ComponentName{number}=", "f' Component{number}=",
           "fields"),
    Mutant("slip runs the other way", "slip[near] += (contact.slip", "slip[near] -= (contact.slip",
           "profile"),
    Mutant("curvature across for along", "self.fields.curvature(state)[:, 0]",
           "self.fields.curvature(state)[:, 1]", "profile"),
    Mutant("moment has the other sign", '"moment": fields["bending_moment"][:, 0]',
           '"moment": -fields["bending_moment"][:, 0]', "profile"),
    Mutant("means without areas", "weights = self.areas if weights is None",
           "weights = np.ones_like(self.areas) if weights is None", "profile"),
    Mutant("one line load at both ends", "for x, load in zip(contact.arc, ends, strict=True):",
           "for x, load in zip(contact.arc[:1] * 2, ends, strict=True):", "profile"),
    Mutant("share of the cone by points", '"cone_share": self._mean(shares, cone * self.areas)',
           '"cone_share": self._mean(shares, touching * self.areas)', "profile"),
    Mutant("states twice as often", "DEFAULT_STATES = 100", "DEFAULT_STATES = 200", "profile"),
    Mutant("the end of a stage is not written", "step.state.control > 1.0 - 1e-9",
           "step.state.control > 2.0", "profile"),
    Mutant("the beginning is a step's end", "a = 0.0 if begins else", "a = None if begins else",
           "profile"),
)  # fmt: skip

HISTORY = (
    Mutant(
        "both tensions are the entry's",
        'values |= {f"{name}_tension": state.tension(name)',
        'values |= {f"{name}_tension": state.tension("entry")',
        "rollers",
    ),
    Mutant(
        "range from the beginning of the stage",
        "abs(control - float(step.branch.control[0]))",
        "abs(control)",
        "summary",
    ),
    Mutant(
        "range of a step in time is its end",
        "covered = step.end - step.start",
        "covered = step.end",
        "summary",
    ),
    Mutant(
        "numbers with six digits",
        ".writerows(rows)",
        '.writerows([f"{x:.6g}" if isinstance(x, float) else x for x in r] for r in rows)',
        "summary",
    ),
    Mutant(
        "residual is nought",
        "state, order, covered, step.imbalance, step.memory",
        "state, order, covered, 0.0, step.memory",
        "summary",
    ),
)

SUMMARY = (
    Mutant(
        "tangents of stages are steps",
        'entry["tangents"] += self.cost.expansions - expansions',
        'entry["tangents"] += self.steps - steps',
        "summary",
    ),
    Mutant(
        "seconds of stages twice",
        'entry["seconds"] += self.counted[0] - begin',
        'entry["seconds"] += 3.0 * (self.counted[0] - begin)',
        "summary",
    ),
    Mutant(
        "message has another time",
        'f"Done: {self.end_time:g} s in',
        'f"Done: {self.scene.course[-1].duration:g} s in',
        "summary",
    ),
    Mutant("fraction of steps", "return self.time / self.end_time", "return 1.0", "summary"),
    Mutant(
        "mass of fresh strip per width",
        "density, strip.thickness * strip.width",
        "density, strip.thickness",
        "summary",
    ),
    Mutant(
        "passed by the speeds at the ends of steps",
        "self.conveyed + 0.5 * covered * ",
        "self.conveyed + covered * ",
        "summary",
    ),
    Mutant("time left is the whole time", "spent * (1 - done) / done", "spent / done", "summary"),
    Mutant(
        "tensions of a sweep twice",
        "values[key] for key in",
        "2.0 * values[key] for key in",
        "sweep",
    ),
    Mutant(
        "errors of a study without the largest",
        "max(abs(own[name] - truth.values[kind][name])",
        "min(abs(own[name] - truth.values[kind][name])",
        "accuracy",
    ),
    Mutant(
        "places of a study across alone",
        "np.linalg.norm(self.places - truth.places, axis=0)",
        "np.abs(self.places - truth.places)[0]",
        "accuracy",
    ),
    Mutant(
        "seconds of a study with the estimates",
        '"wall_seconds"] - self.summary["seconds"].get("errors", 0.0)',
        '"wall_seconds"]',
        "accuracy",
    ),
    Mutant(
        "tenth of an error at the first mesh's cost",
        'm["seconds"] / usual["seconds"]',
        'm["seconds"] / m["seconds"]',
        "accuracy",
    ),
)

EVENTS = (
    Mutant(
        "dates on another clock",
        "self.plan.duration * float(value_at(stretch.control, a))",
        "self.plan.duration * float(value_at(stretch.control, 0.9 * a))",
        "events",
    ),
    Mutant(
        "contact at another pressure",
        "max(TOUCHING_SHARE * tension / r.radius, law.faint)",
        "max(TOUCHING_SHARE * tension * r.radius, law.faint)",
        "events",
    ),
    Mutant(
        "dates of slip in whole steps",
        "if not whole or flickers or length <= self.tolerance * plan.duration:",
        "if not whole or length <= 1e9 * plan.duration:",
        "events",
    ),
    Mutant("stick for slip", '("slip", "stick"), (', '("stick", "slip"), (', "events"),
    Mutant(
        "slip of an event squared",
        "max(float(value_at(squared[:, column], a)), 0.0) ** 0.5",
        "max(float(value_at(squared[:, column], a)), 0.0)",
        "events",
    ),
    Mutant(
        "corner of the law elsewhere", "share + speed - 1.0", "share + 0.5 * speed - 1.0", "events"
    ),
    Mutant(
        "gap of an event above its level",
        "float(value_at(gap[:, column], a))",
        "float(value_at(gap[:, column], a)) * 1.001",
        "events",
    ),
    Mutant("another number of a point", "self.contact.sampling.chosen[pair]", "column", "events"),
    Mutant(
        "first contact of a roller is not told",
        "if touches != touched:",
        "if touched and not touches:",
        "events",
    ),
)

ESTIMATES = (
    Mutant(
        "wraps in radians",
        "{np.degrees(turn):.4g}°, {sides[0]}",
        "{turn:.4g}°, {sides[0]}",
        "explain",
    ),
    Mutant("points of an effect", "str(effect.points)", "str(effect.points + 1)", "explain"),
    Mutant(
        "memory of fewer orders",
        "self.points * (order + 1) * 8",
        "self.points * order * 8",
        "explain",
    ),
    Mutant(
        "memory of a matrix in other units",
        "return effect.block.nbytes",
        "return 8.0 * effect.block.nbytes",
        "explain",
    ),
    Mutant(
        "end of a stage is its duration",
        "for time in (plan.start, plan.start + plan.duration)",
        "for time in (plan.start, plan.duration)",
        "explain",
    ),
    Mutant(
        "free unknowns",
        "str(len(plan.supports.free))",
        "str(len(plan.supports.free) + 1)",
        "explain",
    ),
    Mutant(
        "radius below the strip's sides",
        "roller.radius_at(y - place)",
        "roller.radius_at(y)",
        "explain",
    ),
    Mutant(
        "points of a section",
        "2 * lines, 4 * (lines - 1), 2 * lines - 1",
        "2 * lines, 4 * (lines - 1), 2 * lines",
        "explain",
    ),
    Mutant(
        "factorisations are dearer",
        "(2e-6 + 3e-8 * self.band)",
        "(2e-6 + 3e-7 * self.band)",
        "explain",
    ),
    Mutant(
        "error of a plate twice",
        "an error of {50.0 * slope**2:.2g} %",
        "an error of {100.0 * slope**2:.2g} %",
        "explain",
    ),
    Mutant("sag of a string twice", "2.0 * tension / span", "1.0 * tension / span", "explain"),
    Mutant(
        "elements of a whole layer",
        "Try {finer_mesh(scene, LAYER_SHARE * layer)}",
        "Try {finer_mesh(scene, layer)}",
        "explain",
    ),
    Mutant(
        "creep without friction",
        "return f * working_strain(scene) * line_speed(scene)",
        "return working_strain(scene) * line_speed(scene)",
        "explain",
        "test_defaults.py",
    ),
    Mutant(
        "all of the wrap of a roller that idles holds",
        "sum(preview.turn(roller) for roller in assembly.driven)",
        "sum(preview.turn(roller) for roller in assembly.rollers)",
        "explain",
        "test_forewarnings.py",
    ),
    Mutant(
        "bending stress of a beam",
        "m.young * strain / (1.0 - m.poisson**2)",
        "m.young * strain",
        "explain",
    ),
    Mutant(
        "weight of a metre",
        "weight, bent = load * span, bending",
        "weight, bent = load, bending",
        "explain",
    ),
    Mutant(
        "onset of contact twice",
        "0.5 * apart) ** 2 / (2.0 * radius)",
        "0.5 * apart) ** 2 / radius",
        "explain",
    ),
    Mutant(
        "scale of forces without the width",
        "Scales(self.strip.length, force * self.strip.width,",
        "Scales(self.strip.length, force,",
        "explain",
    ),
    Mutant(
        "boundary layer of a beam",
        "np.sqrt(bending_stiffness(scene) / tension)",
        "np.sqrt(0.91 * bending_stiffness(scene) / tension)",
        "explain",
    ),
)

BUDGET = (
    Mutant(
        "the path is off by nothing",
        "= found, found.full - state.full",
        "= found, 0.0 * found.full",
        "errors",
    ),
    Mutant(
        "errors in time fade at once",
        "after = np.array([self.solver.factors.solve(each) for each in right])",
        "after = 0.01 * np.array([self.solver.factors.solve(each) for each in right])",
        "errors",
    ),
    Mutant("local errors are not carried", "        before[0] += local\n", "", "errors"),
    Mutant(
        "a finer mesh has a finer contact law",
        "return self.coarse.signorini",
        "return replace(self.coarse.signorini, width=0.25 * self.coarse.signorini.width)",
        "errors",
    ),
    Mutant(
        "a released edge forgets what the mesh made of its force",
        "for name in released if name in self.loads}",
        "for name in () if name in self.loads}",
        "errors",
    ),
    Mutant(
        "errors of tensions are differences with their sign",
        "max((abs(there[key] - here[key]) for key in here), default=0.0)",
        "max((here[key] - there[key] for key in here), default=0.0)",
        "errors",
    ),
    Mutant(
        "laws of a stationary state by the other side",
        "moved[0, free] = factors.solve(change)",
        "moved[0, free] = -factors.solve(change)",
        "errors",
    ),
)

WRINKLES = (
    Mutant("half of what a span bears", "float(2.0 * q", "float(1.0 * q", "summary"),
    Mutant(
        "onsets on half the length move the other way",
        "share = (1.0 - self.level / factor)",
        "share = (self.level / factor - 1.0)",
        "summary",
        "test_wrinkle_onsets.py",
    ),
    Mutant("wrinkles that are told late", "NEAR_BUCKLING = 0.5", "NEAR_BUCKLING = 2.1", "summary"),
    Mutant("parabolas count as wrinkles", "SMOOTH_DEGREE = 2", "SMOOTH_DEGREE = 1", "summary"),
    Mutant(
        "waves told at a fifth",
        "WAVE_HEIGHT = 0.5",
        "WAVE_HEIGHT = 0.2",
        "summary",
        "test_waves.py",
    ),
    Mutant(
        "friction along the axis is not part of what is used",
        "np.hypot(used, sideways)",
        "used",
        "profile",
        "test_examples.py",
    ),
    Mutant(
        "strip without stress is longer in Green's strain",
        "return elongation + elongation * elongation * 0.5",
        "return elongation",
        "summary",
        "test_natural_shapes.py",
    ),
    Mutant(
        "modes where K + G is indefinite by a method that takes it for a norm",
        "if symmetric and not factors.negatives:",
        "if symmetric:",
        "summary",
        "test_buckling.py",
    ),
    Mutant(
        "contact of uneven strip as soft as the mesh allows",
        "any(map(varies_across, scene.rollers)) or any(s.varying_across for s in scene.shapes)",
        "any(map(varies_across, scene.rollers))",
        "explain",
        "test_contact_law.py",
    ),
    Mutant("spans that reach the rollers", "FREE_DISTANCE = 4.0", "FREE_DISTANCE = 1.0", "summary"),
    Mutant("compression by its mean", "float(pressure.max())", "float(pressure.mean())", "summary"),
    Mutant(
        "share of the width",
        "np.average(compressed[beside], weights=weights[beside])",
        "np.average(compressed, weights=weights)",
        "summary",
    ),
)

ADVICE = (
    Mutant("bounds trebled", "solver.{key}={2 * most}", "solver.{key}={3 * most}", "advice"),
    Mutant(
        "elements of a layer",
        "finer_mesh(failure.scene, LAYER_SHARE * layer)",
        "finer_mesh(failure.scene, layer)",
        "advice",
        "test_diagnosis.py",
    ),
    Mutant("tolerance of the last digit", "{reachable:.0e}", "{0.01 * reachable:.0e}", "advice"),
    Mutant(
        "pressed by the double",
        "{-least[worst]:.3g} N/m, and buckles",
        "{-2.0 * least[worst]:.3g} N/m, and buckles",
        "advice",
    ),
    Mutant(
        "states between are interpolated",
        "direct=plan.steady and not between",
        "direct=plan.steady",
        "profile",
        "test_operating_map.py",
    ),
    Mutant(
        "forces of yielded strip by its strain",
        "elastic + flow.added_forces(self.full, self.controls)",
        "elastic",
        "plasticity",
    ),
    Mutant(
        "time of a stop",
        "at t = {failure.state.time:.6g} s",
        "at t = {failure.plan.start:.6g} s",
        "advice",
    ),
    Mutant(
        "rollers squeeze by their sum",
        "Nip(a, b, apart - a.radius - b.radius)",
        "Nip(a, b, apart - a.radius)",
        "advice",
        "test_diagnosis.py",
    ),
    Mutant(
        "both sides of a nip give way to all of its squeeze",
        "curvature * x[near] ** 2 - 0.5 * squeeze",
        "curvature * x[near] ** 2 - squeeze",
        "advice",
        "test_nip.py",
    ),
    Mutant(
        "friction too steep by its width",
        "TURNING_SPEEDS * seen / corner",
        "TURNING_SPEEDS * seen",
        "advice",
        "test_diagnosis.py",
    ),
    Mutant(
        "onset that the mesh is far from resolving",
        "contact.onset={onset:.1g}",
        "contact.onset={contact.onset:.1g}",
        "advice",
        "test_advice.py",
    ),
)

YIELD = (
    Mutant("curl the other way", "np.asarray(self.curvature - elastic",
           "np.asarray(self.curvature + elastic", "plasticity"),
    Mutant("plastic strain as if it were stress", "np.linalg.inv(VON_MISES[len(self.strain)])",
           "VON_MISES[len(self.strain)]", "plasticity"),
    Mutant("what flows throughout is elastic", "begun = np.minimum((high",
           "begun = np.maximum((high", "plasticity"),
    Mutant("ends that sway leave nothing behind", "taken += sign * self.state.along_end",
           "taken += 0.0 * self.state.along_end", "summary", "test_dancer.py"),
    Mutant("flow level by the layers that hardly flow", "* (self.stress * rates).sum(axis=0)",
           "", "plasticity"),
    Mutant("the rate of flow by the stress alone", "slope = self.flow.exponent * np.log(",
           "slope = np.log(", "plasticity"),
    Mutant("errors of curls that are not told", 'found["curl"] = largest(',
           'found["curl"] = 0.0 * largest(', "plasticity"),
    Mutant("power of half of the stress", '"l,klp->p", weights, work)',
           '"l,klp->p", 0.5 * weights, work)', "plasticity"),
    Mutant("power of the middle as that of its fibres", "(1.0 / self.effect.contracting - 1.0)",
           "(1.0 - self.effect.contracting) * 0.0", "plasticity"),
)  # fmt: skip

MUTANTS = (
    *STATE, *READINGS, *ENDS, *REGULARISATION, *FIELDS, *PROFILE, *FILES, *HISTORY, *SUMMARY,
    *EVENTS, *ESTIMATES, *BUDGET,
    *WRINKLES, *ADVICE, *YIELD,
)  # fmt: skip


def sources(top: Path) -> Iterator[Path]:
    """List the package's modules."""
    return (top / "src" / "anmstrip").rglob("*.py")


def places_of(mutant: Mutant, top: Path = TOP) -> list[Path]:
    """List the modules that contain a mutant's text, once for every time."""
    found = ((path, path.read_text(encoding="utf-8").count(mutant.old)) for path in sources(top))
    return [path for path, count in found for _ in range(count)]


def misplaced(top: Path = TOP) -> list[str]:
    """Say which mutants are not found any more, or in several places."""
    told = []
    for mutant in MUTANTS:
        places = places_of(mutant, top)
        if len(places) != 1:
            where = ", ".join(str(p.relative_to(top)) for p in places) or "not found"
            told.append(f"{mutant.name}: {mutant.old!r}: {where}")
    return told


def noticed(mutant: Mutant, top: Path, patience: float) -> str:
    """Make an error in a copy, run the tests and mend it; return the test that notices it.

    Empty if none does.
    """
    (path,) = places_of(mutant, top)
    sound = path.read_text(encoding="utf-8")
    path.write_text(sound.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        part = top / "tests" / "reported" / f"test_reported_{mutant.part}.py"
        more = sorted((top / "tests").rglob(mutant.more)) if mutant.more else []
        for files in ([part], more, [part.parent]):
            if files and (test := failing(files, top, patience)):
                return test
        return failing([part, *more], top, patience, "slow")
    finally:
        path.write_text(sound, encoding="utf-8")


def failing(
    files: list[Path], top: Path, patience: float | None = None, marked: str = "not slow"
) -> str:
    """Run test files of a copy; return the first test that fails, empty if all pass."""
    given = {"PYTHONPATH": str(top / "src"), "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--tb=no"]
    try:
        ended = subprocess.run(
            [*command, "-m", marked, *map(str, files)],
            cwd=top, env={**os.environ, **given}, capture_output=True, text=True,
            timeout=patience, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "time is up"
    if ended.returncode in (0, 5):  # passed, or no test is marked so
        return ""
    found = re.search(r"^(?:FAILED|ERROR) \S*?([\w.]+::\S+)", ended.stdout, re.MULTILINE)
    if ended.returncode != 1 or found is None:
        raise RuntimeError(f"pytest ended with {ended.returncode}:\n{ended.stdout[-2000:]}")
    return found[1]


def copied(directory: Path) -> Path:
    """Copy what the tests need."""
    directory.mkdir()
    for name in COPIED:
        source = TOP / name
        if source.is_dir():
            shutil.copytree(source, directory / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, directory / name)
    return directory


def main() -> int:
    """Try all mutants and print what has noticed them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--only", metavar="NAME", help="mutants whose name contains this")
    parser.add_argument("-n", type=int, default=2, metavar="WORKERS", help="at once (default: 2)")
    options = parser.parse_args()
    if told := misplaced():
        print("Not exactly once in the package:", *told, sep="\n  ")
        return 2
    chosen = [m for m in MUTANTS if options.only is None or options.only in m.name]
    with tempfile.TemporaryDirectory() as scratch:
        free: Queue[Path] = Queue()
        for number in range(options.n):
            free.put(copied(Path(scratch) / f"copy{number}"))

        with ThreadPool(options.n) as pool:
            copies, begun = list(free.queue), monotonic()  # also compiles what is compiled
            told = pool.map(lambda top: failing([top / "tests" / "reported"], top), copies)
        if any(told):
            print("The tests fail without any error:", *filter(None, told))
            return 2

        patience = PATIENCE * (monotonic() - begun)

        def tried(mutant: Mutant) -> str:
            top = free.get()
            try:
                return noticed(mutant, top, patience)
            finally:
                free.put(top)

        survivors = []
        with ThreadPool(options.n) as pool:
            for mutant, test in zip(chosen, pool.imap(tried, chosen), strict=True):
                print(f"{mutant.name:45} {'noticed' if test else 'SURVIVES':9} {test}", flush=True)
                survivors += [] if test else [mutant.name]
    share = 1.0 - len(survivors) / max(len(chosen), 1)
    print(f"\n{len(chosen) - len(survivors)} of {len(chosen)} noticed, {100.0 * share:.1f} %.")
    return 0 if share >= NEEDED else 1


if __name__ == "__main__":
    sys.exit(main())
