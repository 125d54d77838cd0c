"""What a scene refuses: every case is the good scene with one thing broken."""

from __future__ import annotations

import json
import re
import time
import tomllib
from pathlib import Path

import pytest

from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.fem.geometry import KINEMATICS
from anmstrip.scene.checks import DISPLACEMENTS
from anmstrip.scene.hints import FOREIGN_KEYS
from anmstrip.simulation.problem import Assembly

GOOD = Path(__file__).with_name("capstan.toml").read_text(encoding="utf-8")
MESHED = GOOD.replace("length = 4.0\nwidth = 1.0\n", "").replace(
    "cells = [16, 2]\nrefined = 0.025\n", 'mesh = "strip.msh"\n'
)
SECOND = '[[rollers]]\nname = "r2"\nradius = 0.5\naxis = [0.0, -2.0, 0.0]\n'
RELEASED = "= 0.6\nentry.release = true\n"

WRONG = [  # what is replaced, by what, key that is named, words that must be there
    # a single value
    ("thickness = 1.0e-3", "thickness = -1.0e-3", "strip.thickness", "above 0 (m)"),
    ("thickness = 1.0e-3", "thickness = -0.8e-3", "strip.thickness", "thickness = 0.0008"),
    ("thickness = 1.0e-3", 'thickness = "0.8 mm"', "strip.thickness", "thickness = 0.0008"),
    ("thickness = 1.0e-3", 'thickness = "thin"', "strip.thickness", "thickness = 1.0e-3"),
    ("thickness = 1.0e-3", "thickness = 0", "strip.thickness", "thickness = 1.0e-3"),
    ("thickness = 1.0e-3", 'thickness = "1 mm"', "strip.thickness", "above 0 (m)"),
    ("thickness = 1.0e-3", "thickness = true", "strip.thickness", "above 0 (m)"),
    ("thickness = 1.0e-3", "thickness = nan", "strip.thickness", "above 0 (m)"),
    ("thickness = 1.0e-3", "thickness = inf", "strip.thickness", "above 0 (m)"),
    ("thickness = 1.0e-3", "thickness = 1979-05-27", "strip.thickness", "above 0 (m)"),
    ("thickness = 1.0e-3\n", "", "strip.thickness", "nothing"),
    ("length = 4.0\n", "", "strip.length", "length = 4.0"),
    ("cells = [16, 2]", "cells = [16.0, 2]", "strip.cells", "integers"),
    ("cells = [16, 2]", "cells = [16, 0]", "strip.cells", "cells = [16, 2]"),
    ("cells = [16, 2]", "cells = 16", "strip.cells", "two integers"),
    ("refined = 0.025", "refined = 0.0", "strip.refined", "above 0 (m)"),
    ("refined = 0.025", 'refined = "fine"', "strip.refined", '"auto"'),
    ("refined = 0.025", "refined = true", "strip.refined", "above 0 (m)"),
    ("order = 20", "mesh_tolerance = 0.5", "solver.mesh_tolerance", "1e-9 to 0.1"),
    ("order = 20", 'method = "secant"', "solver.method", '"newton"'),
    ("refined = 0.025", "finer = 100.0", "strip.finer", "0.05 to 64"),
    ("refined = 0.025", 'kinematics = "Shell"', "strip.kinematics", 'kinematics = "shell"'),
    ("refined = 0.025", 'kinematics = "beam"', "strip.kinematics", 'kinematics = "section"'),
    ("refined = 0.025", 'kinematics = "2D"', "strip.kinematics", 'kinematics = "section"'),
    ("refined = 0.025", 'kinematics = "plane"', "strip.kinematics", 'kinematics = "section"'),
    ("refined = 0.025", 'bending = "stiff"', "strip.bending", "kirchhoff-love"),
    ("refined = 0.025", "bending = 1", "strip.bending", "true, false"),
    ("= 0.6", '= 0.6\nexit.moment = "no"', "stages.turn.exit.moment", "number"),
    ("= 0.6", "= 0.6\nexit.moment = 1e5", "stages.turn.exit.moment", "strain its faces by"),
    ("refined = 0.025", "refined = 0.025\ncoil_set = 1e3", "strip.coil_set", "a strain of 50 %"),
    ("= 0.6", "= 0.6\nexit.release = true", "stages.turn.exit.release", "[edges.exit]"),
    ("refined = 0.025", 'kinematics = "plate"', "strip.kinematics", "nothing rubs"),
    ("refined = 0.025", 'kinematics = "solid"', "strip.kinematics", '"shell"'),
    ("refined = 0.025", 'mesh = "strip.msh"', "strip.mesh", "a file that exists"),
    ("refined = 0.025", 'mesh = "strip.msh"', "strip.length", "take one out"),
    ("poisson = 0.3", "poisson = 0.5", "material.poisson", "below 0.5"),
    ("s = 1.0e-3", "s = 1e-3\nflatness.table = 3", "strip.flatness.table", "table = [[-0.5"),
    ("poisson = 0.3", "poisson = -1", "material.poisson", "above -1"),
    ("coefficient = 0.3", "coefficient = -0.1", "friction.coefficient", "at least 0"),
    ("coefficient = 0.3", "coefficient = nan", "friction.coefficient", "nan"),
    ("exponent = 0.05", "exponent = 0.0", "friction.exponent", "at most 1"),
    ("exponent = 0.05", "exponent = 1.1", "friction.exponent", "at most 1"),
    ("omega = 0.1", "omega = 0", "friction.omega", "above 0"),
    ("radius = 0.5", "radius = 0.5\nfriction = -0.1", "rollers.r1.friction", "at least 0"),
    ('law = "norton-hoff"\n', "", "friction.law", "a law beside exponent"),
    ('law = "norton-hoff"', 'law = "coulomb"', "friction.law", '"tanh"'),
    ("radius = 0.5", f"radius = 0x{'f' * 5000}", "rollers.r1.radius", "digits"),
    ("radius = 0.5", f"radius = [0x{'f' * 5000}]", "rollers.r1.radius", "digits"),
    ("cells = [16, 2]", f"cells = [0x{'f' * 5000}, 2]", "strip.cells", "digits"),
    ("radius = 0.5", "radius = -0.5", "rollers.r1.radius", "above 0 (m)"),
    ("radius = 0.5", "diameter = 0.8", "rollers.r1.diameter", "radius = 0.4"),
    ("centre = [0.0, 0.0, -0.501]", "centre = [-0.501]", "rollers.r1.centre", "three"),
    ("centre = [0.0, 0.0, -0.501]", "centre = [0.1, -0.501]", "rollers.r1.centre",
     "centre = [0.1, 0.0, -0.501]"),
    ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 1.0]", "rollers.r1.axis", "axis = [0.0, 1.0, 0.0]"),
    ("[0.0, 0.0, -0.45]", "[0.0, -0.45]", "stages.wrap.entry.move", "move = [0.0, 0.0, -0.45]"),
    ("centre = [0.0, 0.0, -0.501]", 'centre = [0.0, 0.0, "b"]', "rollers.r1.centre", '"b"'),
    ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 0.0]", "rollers.r1.axis", "not all 0"),
    ("radius = 0.5", 'radius = 0.5\ndrive = "idle"', "stages.turn.rollers.r1.surface_speed",
     'drive = "speed", or no surface_speed'),
    ("radius = 0.5", 'radius = 0.5\ndrive = "driven"', "rollers.r1.drive", 'drive = "speed"'),
    ('name = "r1"', 'name = "roller 1"', "rollers.roller 1.name", "letters"),
    ('name = "turn"', 'name = "turn again"', "stages.turn again.name", 'name = "turn_again"'),
    ('fixed = ["x", "z"]', 'fixed = ["x", "w"]', "edges.entry.fixed", '"w"'),
    ('fixed = ["x", "z"]', 'fixed = ["x", "x"]', "edges.entry.fixed", 'fixed = ["x"]'),
    ("centred = true", "centred = 1", "edges.entry.centred", "true or false"),
    ("duration = 0.6", 'duration = "5 s"', "stages.turn.duration", "a number, without quotes"),
    ("duration = 0.6", 'duration = "5 s"', "stages.turn.duration", "duration = 5.0"),
    ("= 0.6", "= 0.6\nexit.tension = -9.0e3", "stages.turn.exit.tension", "of at least 0 (N/m)"),
    ("= 0.6", "= 0.6\nexit.tension = -9.0e3", "stages.turn.exit.tension", "tension = 9000.0"),
    ("duration = 0.6", "duration = 0.0", "stages.turn.duration", "above 0 (s)"),
    ("order = 20", "order = 61", "solver.order", "from 2 to 60"),
    ("order = 20", 'order = "12"', "solver.order", "order = 12"),
    ("order = 20", "order = 20.0", "solver.order", "integer"),
    ("order = 20", "time_order = 6", "solver.time_order", "from 1 to 5"),
    ("order = 20", "max_steps = 0", "solver.max_steps", "above 0"),
    ("tolerance = 1.0e-6", "tolerance = 0.5", "solver.tolerance", "1e-12 to 0.1"),
    ("every = 1", "every = 0", "output.every", "above 0"),
    ("every = 1", "times = [1.0, 0.5]", "output.times", "[0.5, 1.0]"),
    ("every = 1", "times = [-1.0, 0.5]", "output.times", "increasing"),
    ("every = 1", "times = []", "output.times", "at least one"),
    ("every = 1", "times = [0.5, 99.0, 100.0]", "output.times", "times = [0.5]"),
    ("every = 1", "times = [99.0]", "output.times", "the end of the run at 2.6 (s)"),
    ("every = 1", "every = 1\ntimes = [0.5]", "output.every", "not both"),
    ("[edges.entry]", "[[edges.entry]]", "edges.entry", "a table for each"),
    ("[[rollers]]", "[rollers]", "rollers", "[[rollers]]"),
    # natural shapes: heat, flatness, camber, coil set
    ("refined = 0.025", 'temperature = "hot"', "strip.temperature", "a number or a table (K)"),
    ("refined = 0.025", "temperature = { table = [[0.0, 1.0]] }", "strip.temperature.table",
     "at least two pairs"),
    ("refined = 0.025", "flatness = { table = [[0.1, 1.0], [-0.1, 2.0]] }",
     "strip.flatness.table", "increasing"),
    ("refined = 0.025", "flatness = { table = [[-500, 1.0], [500, 2.0]] }",
     "strip.flatness.table", "η = y / width from -0.5"),
    ("refined = 0.025", "flatness = { across = [1.0], along = [[2.0, 1.0], [1.0, 0.0]] }",
     "strip.flatness.along", "increasing"),
    ("refined = 0.025", "flatness = { across = [1.0], along = [[0, 1.0], [400, 0.0]] }",
     "strip.flatness.along", "length 4 (m)"),
    ("refined = 0.025", "flatness = { along = [[0.0, 1.0], [1.0, 0.0]] }",
     "strip.flatness.across", "either across, a polynomial, or table"),
    ("refined = 0.025", "temperature = 50.0", "material.expansion",
     "since strip.temperature is given"),
    ("poisson = 0.3", "poisson = 0.3\nexpansion = 12.0", "material.expansion", "0 to 1e-3 (1/K)"),
    ("refined = 0.025", "flatness = 1.0e6", "strip.flatness", "at most 5e+03 (I-units of 1e-5)"),
    ("refined = 0.025", "camber = 1.0", "strip.camber", "at most 0.1 (1/m)"),
    ("refined = 0.025", "bending = false\ncoil_set = 0.1", "strip.coil_set", "no moments"),
    ("refined = 0.025", "feed = true\nflatness = { across = [1], along = [[0, 1], [1, 0]] }",
     "strip.flatness.along", "a fed strip is the same all along"),
    ("= 0.6", "= 0.6\nstrip.camber = true", "stages.turn.strip.camber", "a number (1/m)"),
    ("= 0.6", "= 0.6\nstrip.heat = 50.0", "stages.turn.strip.heat", "a known key"),
    # unknown keys
    ("thickness = 1.0e-3", "thicknes = 1.0e-3", "strip.thicknes", "thickness (the nearest"),
    ("[material]", "[materials]", "materials", "material (the nearest"),
    ("duration = 0.6", "duraton = 0.6", "stages.turn.duraton", "duration (the nearest"),
    ("rollers.r1.surface", "rolers.r1.surface", "stages.turn.rolers", "rollers (the nearest"),
    ("r1.surface_speed", "r1.speed", "stages.turn.rollers.r1.speed", "surface_speed"),
    ("entry.move", "entry.mov", "stages.wrap.entry.mov", "move (the nearest"),
    ("entry.move", "entri.move", "stages.wrap.entri", "entry (the nearest"),
    ("[edges.entry]", "[edges.entree]", "edges.entree", "entry (the nearest"),
    # between fields
    ("eta = 10.0", "eta = 1.0e7", "contact.eta", "below stiffness × delta = 1e+07 (Pa)"),
    ("eta = 10.0\n", "", "contact.eta", "stiffness, eta and delta together, or none of them"),
    ("eta = 10.0", "eta = 10.0\nonset = 1e-4", "contact.onset", "which are another law"),
    ("rollers.r1.surface_speed", "rollers.r2.surface_speed", "stages.turn.rollers.r2", "r1"),
    ('name = "turn"', 'name = "wrap"', "stages.wrap.name", 'name = "wrap_2"'),
    ("duration = 0.6", "duration = 0.6\ngravity = [0, 0, -9]", "material.density", "turn"),
    ("[0.0, 0.0, -0.45]", "[0.0, 0.1, -0.45]", "stages.wrap.entry.move", '["x", "y", "z"]'),
    ("entry.move", "exit.velocity", "stages.wrap.exit.velocity", "[edges.exit]"),
    ("= 0.6", "= 0.6\nexit.speed = 1.0", "stages.turn.exit.speed", "[edges.exit]"),
    ("= 0.6", f"{RELEASED}entry.speed = 1.0", "stages.turn.entry.speed", "not held"),
    ("= 0.6", "= 0.6\nleft.speed = 1.0", "stages.turn.left.speed", "entry.speed = 1.0"),
    ("-0.45]", "0]\nentry.speed = 1.0", "stages.wrap.entry.speed", "not both"),
    ("-0.45]", "0]\nentry.velocity = [1, 0, 0]", "stages.wrap.entry.velocity", "not both"),
    ("= 0.6", "= 0.6\nentry.force = [1, 0, 0]", "stages.turn.entry.force", "held"),
    ("= 0.6", f"{RELEASED}entry.move = [0, 0, 1]", "stages.turn.entry.move", "released"),
    ("= 0.6", "= 0.6\nentry.tension = 1e4", "stages.turn.entry.tension", "entry.release = true"),
    ("[edges.entry]", f"{SECOND}centre = [0, 0, -1.5]\n[edges.entry]", "rollers.r2.centre",
     "at least 1 m, the sum of both radii, between the axes of r1 and r2"),
    ("[edges.entry]", f"{SECOND}centre = [0, 0, -1.5]\n[edges.entry]", "rollers.r2.centre",
     "centre = [0, 0, -1.511], or smaller radii"),
    ("[edges.entry]", f"{SECOND}centre = [0.1, -1.6, 0]\n[edges.entry]", "rollers.r2.centre",
     "centre = [0.1, 0, -1.6], or smaller radii"),
    ("[edges.entry]", f"{SECOND.replace('0.5', '500')}centre = [0, 0, -1.6]\n[edges.entry]",
     "rollers.r2.radius", "was it meant in mm?"),
    ("[edges.entry]", f"{SECOND.replace('0.5', '5e5')}centre = [0, 0, -1.6]\n[edges.entry]",
     "rollers.r2.radius", "radius = 0.5"),
    ("[edges.entry]", f"{SECOND}centre = [0, 9, -0.501]\n[edges.entry]", "rollers.r2.centre",
     "centre = [0, 9, 0.509]"),
]  # fmt: skip

THREADED = (
    GOOD.replace("length = 4.0\n", "")
    .replace('name = "r1"', 'name = "r1"\nwrap = "over"')
    .replace("[contact]", "[threading]\ntension = 1.0e4\nentry = [-2, 0, -1]\n"
             "exit = [2, 0, -1]\n\n[contact]", 1)
)  # fmt: skip

WRONG_THREADED = [
    ("[threading]\ntension = 1.0e4\nentry = [-2, 0, -1]\nexit = [2, 0, -1]\n", "",
     "rollers.r1.wrap", "[threading]"),
    ('wrap = "over"\n', "", "threading", 'wrap = "over"'),
    ('wrap = "over"', 'wrap = "above"', "rollers.r1.wrap", '"under"'),
    ("tension = 1.0e4", "tension = 0.0", "threading.tension", "above 0 (N/m)"),
    ("tension = 1.0e4\n", "", "threading.tension", "nothing"),
    ("entry = [-2, 0, -1]\n", "", "threading.entry", "strip.length is not given either"),
    ("thickness = 1.0e-3", "thickness = 1.0e-3\nlength = 4.0", "strip.length", "threading.exit"),
    ("entry = [-2, 0, -1]", "entry = [-2, -1]", "threading.entry", "three"),
    ("entry = [-2, 0, -1]", "entry = [-3, -1]", "threading.entry", "entry = [-3, 0.0, -1]"),
    ("axis = [0.0, 1.0, 0.0]", "axis = [1.0, 0.0, 0.0]", "rollers.r1.axis", "nearly along y"),
    ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.1, 1.0]", "rollers.r1.axis", "nearly along y"),
    ('fixed = ["x", "z"]', 'fixed = ["z"]', "edges.entry.fixed", "thread against"),
    ('name = "turn"', 'name = "threading"', "stages.threading.name", "another name"),
    ("radius = 0.5", "radius = 0.5\ncrown = [-2.0]", "rollers.r1.crown", "all across"),
    ("radius = 0.5", "radius = 0.5\ncrown = [0.0, -2.1]", "rollers.r1.crown", "falls to"),
    ("radius = 0.5", 'radius = 0.5\ncrown = ["a"]', "rollers.r1.crown", "numbers"),
    ("radius = 0.5", "radius = 0.5\ntaper = -1.1", "rollers.r1.taper", "falls to -0.05"),
    ("radius = 0.5", "radius = 0.5\ntaper = [1e-3]", "rollers.r1.taper", "taper = 1.0e-3"),
    ("radius = 0.5", "radius = 0.5\nsides = { taper = 2.0, flat = 0.1, rounding = 0.01 }",
     "rollers.r1.sides", "sides = { taper = 0.0005, flat"),
    ("radius = 0.5", "radius = 0.5\nsides = { taper = 1e-3, flat = 0.1 }",
     "rollers.r1.sides.rounding", "rounding = 0.05"),
    ("= 0.6", "= 0.6\nexit.force = [9, 0, 0]\nexit.tension = 9.0", "stages.turn.exit.tension",
     "not both"),
    ("duration = 0.6", "duration = 0.6\nleft.tension = 1.0", "stages.turn.left.tension", "ends"),
    ("entry = [-2, 0, -1]", "entry = [-2, 0.1, -1]", "threading.entry", "entry = [-2, 0.0, -1]"),
    ("exit = [2, 0, -1]", "exit = [2, 1, -1]", "threading.exit", "in the plane y = 0"),
    ("tension = 1.0e4", "tension = 1.01e7", "threading.tension", "at most 1e+07"),
    ("tension = 1.0e4", "tension = 2.0e7", "threading.tension", "by 10 %"),
    ("young = 2.0e11", "young = 2.0e5", "material.young", "young = 2e+11"),
    ("young = 2.0e11", "young = 200", "material.young", "was it meant in GPa?"),
    ("tension = 1.0e4", "tension = 2.0e7", "threading.tension", "tension = 2e+04"),
]  # fmt: skip

WRONG_SECTION = [
    ("refined = 0.025", "camber = 1e-3", "strip.camber", "no width"),
    ("refined = 0.025", "flatness = { across = [0.0, 1.0] }", "strip.flatness", "no width"),
    (
        "refined = 0.025",
        "flatness = { across = [0, 1], along = [[0, 0], [1, 1], [2, 0]] }",
        "strip.flatness",
        "no width",
    ),
    (
        "= 0.6",
        "= 0.6\nstrip.flatness = { table = [[0, 0], [0.001, 1], [0.002, 0]] }",
        "stages.turn.strip.flatness",
        "no width",
    ),
    ("= 0.6", "= 0.6\nstrip.crossbow = 0.1", "stages.turn.strip.crossbow", "no width"),
    ("radius = 0.5", "radius = 0.5\ncrown = [0.0, -1e-3]", "rollers.r1.crown", "no width"),
    ("radius = 0.5", "radius = 0.5\ntaper = 1e-3", "rollers.r1.taper", "no width"),
    (
        "radius = 0.5",
        "radius = 0.5\nsides = { taper = 1e-3, flat = 0, rounding = 0.1 }",
        "rollers.r1.sides",
        "no width",
    ),
    ("axis = [0.0, 1.0, 0.0]", "axis = [0.001, 1.0, 0.0]", "rollers.r1.axis", "no width"),
    (
        "axis = [0.0, 1.0, 0.0]",
        "axis = [0.0, 1.0, 0.01]",
        "rollers.r1.axis",
        'kinematics = "shell"',
    ),
    ("axis = [0.0, 1.0, 0.0]", "axis = [1.0, 0.0, 0.0]", "rollers.r1.axis", "no width"),
    ("[edges.entry]", '[edges.left]\nfixed = ["z"]\n[edges.entry]', "edges.left", "no sides"),
    ("= 0.6", "= 0.6\nright.force = [0, 0, 1]", "stages.turn.right", 'kinematics = "shell"'),
    ("= 0.6", "= 0.6\nentri.force = [0, 0, 1]", "stages.turn.entri", "entry (the nearest"),
    ("[0.0, 0.0, -0.45]", "[0.0, 0.1, -0.45]", "stages.wrap.entry.move", "[0.0, 0.0, -0.45], or"),
    ("= 0.6", "= 0.6\nentry.velocity = [0, 1, 0]", "stages.turn.entry.velocity", "0 along y"),
    ("= 0.6", "= 0.6\nexit.force = [9, 1, 0]", "stages.turn.exit.force", "[9.0, 0.0, 0.0], or"),
    ("= 0.6", "= 0.6\ngravity = [0, -9.81, 0]", "stages.turn.gravity", "0 along y"),
    ("= 0.6", "= 0.6\ngravity = [0, -9.81, 0]", "stages.turn.gravity", "= [0.0, 0.0, -9.81], or"),
    ("= 0.6", "= 0.6\nrollers.r1.move = [0, 1, 0]", "stages.turn.rollers.r1.move", "0 along y"),
]

_FRICTION, _ROLLERS = GOOD.index("[friction]"), GOOD.index("[[rollers]]")
PLATE = (
    (GOOD[:_FRICTION] + GOOD[_ROLLERS:])
    .replace("friction = false\n", "")
    .replace("refined = 0.025", 'refined = 0.025\nkinematics = "plate"')
)

WRONG_PLATE = [
    ("refined = 0.025", "coil_set = 0.1", "strip.coil_set", "stressed as exit.force says"),
    ("= 0.6", "= 0.6\nstrip.flatness = 9.0", "stages.turn.strip.flatness", '"section"'),
    ("[contact]", "[friction]\ncoefficient = 0.3\nspeed = 1\n[contact]", "strip.kinematics",
     "nothing rubs"),
    ("[contact]", "[threading]\ntension = 1e4\n[contact]", "strip.kinematics", "nearly flat"),
    ("refined = 0.025", "feed = true", "strip.feed", "feed = false"),
    ("= 0.6", "= 0.6\nexit.tension = 1e4", "stages.turn.exit.tension",
     "exit.force = [10000, 0.0, 0.0]"),
    ("= 0.6", "= 0.6\nentry.tension = 1e4", "stages.turn.entry.tension", "the x of exit.force"),
    ("[0.0, 0.0, -0.45]", "[0.5, 0.0, -0.45]", "stages.wrap.entry.move", "only moves up and down"),
    ("= 0.6", "= 0.6\nentry.velocity = [1, 0, 0]", "stages.turn.entry.velocity", '"section"'),
    ("= 0.6", "= 0.6\nentry.speed = 1.0", "stages.turn.entry.speed", '"section"'),
    ("= 0.6", "= 0.6\nexit.force = [1e4, 1, 0]", "stages.turn.exit.force",
     "exit.force = [10000.0, 0.0, 0.0]"),
    ("= 0.6", "= 0.6\nexit.moment = 1.0", "stages.turn.exit.moment", '"section"'),
    ("= 0.6", "= 0.6\nleft.force = [0, 1, 0]", "stages.turn.left.force", "0 along y"),
    ("= 0.6", "= 0.6\ngravity = [1, 1, -9]", "stages.turn.gravity", "0 along x and y"),
]  # fmt: skip


def mistakes_of(directory: Path, text: str) -> dict[str, str]:
    """Return the mistakes found in a scene, as they are told, by key."""
    path = write(directory, text)
    with pytest.raises(InputError) as caught:
        Assembly(Scene.load(path)).strip  # noqa: B018
    assert all(mistake.file == str(path) for mistake in caught.value.mistakes)
    return {mistake.key: str(mistake) for mistake in caught.value.mistakes}


def write(directory: Path, text: str) -> Path:
    """Return the file of a scene."""
    path = directory / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_stage_that_is_wrong_in_itself_hides_no_mistake_between_tables(tmp_path: Path) -> None:
    turned = 'name = "one"\nduration = 1.0\ngravity = -9.81\nrollers.{}.speed = 2.0\n'
    text = GOOD.replace('"r1"', '"Main"')
    text = text[: text.index("[[stages]]")] + "[[stages]]\n" + turned.format("main")
    found = mistakes_of(tmp_path, text)
    assert "Main (the nearest known one)" in found["stages.one.rollers.main"]
    assert "since stage one has gravity" in found["material.density"]
    assert {"stages.one.rollers.main.speed", "stages.one.gravity"} < found.keys()
    odd = text.replace("rollers.main.speed = 2.0", "rollers = 2.0")
    assert mistakes_of(tmp_path, odd).keys() == found.keys() - {
        "stages.one.rollers.main", "stages.one.rollers.main.speed"
    } | {"stages.one.rollers"}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "key", "words"), WRONG)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, key: str, words: str) -> None:
    assert old in GOOD
    mistakes = mistakes_of(tmp_path, GOOD.replace(old, new, 1))
    assert words in mistakes[key]


@pytest.mark.parametrize(("old", "new", "key", "words"), WRONG_THREADED)
def test_what_is_wrong_with_threading(
    tmp_path: Path, old: str, new: str, key: str, words: str
) -> None:
    assert old in THREADED
    mistakes = mistakes_of(tmp_path, THREADED.replace(old, new, 1))
    assert words in mistakes[key]


def test_ends_that_are_proposed_can_be_typed(tmp_path: Path) -> None:
    bare = re.sub("(entry|exit) = .*\n", "", THREADED)
    found = mistakes_of(tmp_path, bare)
    assert found.keys() == {"threading.entry", "threading.exit"}
    ends = "\n".join(words.partition("type:")[2].strip() for words in found.values())
    path = write(tmp_path, bare.replace("[threading]", f"[threading]\n{ends}"))
    assert Assembly(Scene.load(path)).strip.length > 4.0


@pytest.mark.parametrize(("old", "new", "key", "words"), WRONG_SECTION)
def test_what_a_section_cannot_see(
    tmp_path: Path, old: str, new: str, key: str, words: str
) -> None:
    text = THREADED.replace("refined = 0.025", 'refined = 0.025\nkinematics = "section"')
    assert old in text
    assert words in mistakes_of(tmp_path, text.replace(old, new, 1))[key]


@pytest.mark.parametrize(("old", "new", "key", "words"), WRONG_PLATE)
def test_what_a_plate_cannot_see(tmp_path: Path, old: str, new: str, key: str, words: str) -> None:
    assert old in PLATE
    assert words in mistakes_of(tmp_path, PLATE.replace(old, new, 1))[key]


def test_what_is_harmless_on_a_plate(tmp_path: Path) -> None:
    """Components that it does not have may be held: the same tables serve all levels."""
    path = tmp_path / "scene.toml"
    path.write_text(PLATE.replace('["x", "z"]', '["x", "y", "z"]'), encoding="utf-8")
    assert Scene.load(path).strip.kinematics == "plate"


def test_levels_are_those_of_mechanics() -> None:
    seen = {name: tuple("xyz".index(c) for c in seen) for name, seen in DISPLACEMENTS.items()}
    assert seen == {name: level.components for name, level in KINEMATICS.items()}


def test_a_key_is_told_once(tmp_path: Path) -> None:
    """A moved side of a section is told as what it lacks, not as a free component."""
    text = THREADED.replace("refined = 0.025", 'refined = 0.025\nkinematics = "section"')
    path = tmp_path / "scene.toml"
    path.write_text(text.replace("[0.0, 0.0, -0.45]", "[0.0, 0.1, -0.45]"), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        Scene.load(path)
    assert [mistake.key for mistake in caught.value.mistakes] == ["stages.wrap.entry.move"]


@pytest.mark.parametrize(
    "second",
    [
        "axis = [0, 1, 0]\ncentre = [0, 0, -1.501]",  # they touch
        "axis = [1, 0, 0]\ncentre = [0, 0, -1.001]",  # across each other
        "axis = [0, 1, 0.01]\ncentre = [0, 0, 1]",
    ],
)
def test_rollers_that_stand_clear(tmp_path: Path, second: str) -> None:
    path = tmp_path / "scene.toml"
    roller = f'[[rollers]]\nname = "r2"\nradius = 0.5\n{second}\n'
    path.write_text(GOOD + roller, encoding="utf-8")
    assert len(Scene.load(path).rollers) == 2


def test_tension_on_an_edge_held_in_part(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    text = GOOD.replace('fixed = ["x", "z"]', 'fixed = ["z"]')
    path.write_text(text.replace("= 0.6", "= 0.6\nentry.tension = 1e4"), encoding="utf-8")
    assert Scene.load(path).stages[-1].edges["entry"].tension == 1e4


def test_threaded_scene_is_right(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    text = THREADED.replace("radius = 0.5", "radius = 0.5\ncrown = [0.0, -1.9]")
    path.write_text(text, encoding="utf-8")
    scene = Scene.load(path)
    assert [stage.name for stage in scene.course][:2] == ["threading", "tension"]
    assert not scene.course[0].friction
    assert (scene.strip.length, scene.rollers[0].wrap) == (None, "over")


def test_a_single_mistake_is_reported_alone(tmp_path: Path) -> None:
    assert list(mistakes_of(tmp_path, GOOD.replace("radius = 0.5", "radius = 0"))) == [
        "rollers.r1.radius"
    ]


def test_a_duration_may_be_left_out_where_nothing_depends_on_time(tmp_path: Path) -> None:
    """In a scene without [friction], or a stage without it; not where an end moves."""
    bare = GOOD[:_FRICTION] + GOOD[_ROLLERS:].replace("friction = false\n", "")
    timeless = bare.replace("\nduration = 0.6\n", "\n")
    without = GOOD.replace("\nduration = 0.6\n", "\nfriction = false\n")
    for text in (timeless, without):
        (tmp_path / "scene.toml").write_text(text)
        assert Scene.load(tmp_path / "scene.toml").stages[-1].duration == 1.0
    moving = bare.replace("\nduration = 0.6\n", "\nentry.speed = 1.0\n")
    (told,) = mistakes_of(tmp_path, moving).values()
    assert "without friction, yield and ends that move" in str(told)


def test_the_only_stage_is_wrong(tmp_path: Path) -> None:
    """The mistake inside is told, and not that there is no stage."""
    text = GOOD[: GOOD.index("[[stages]]")] + "[[stages]]\nduraton = 1.0\nduration = 1.0\n"
    assert list(mistakes_of(tmp_path, text)) == ["stages.stage1.duraton"]


def test_all_mistakes_are_named_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("thickness = 1.0e-3", "thickness = -1")
    text = text.replace("eta = 10.0", "eta = 1e9").replace("poisson", "poison")
    text = text.replace("rollers.r1.surface_speed", "rollers.r2.surface_speed")
    assert set(mistakes_of(tmp_path, text)) == {
        "strip.thickness",
        "contact.eta",
        "material.poison",
        "stages.turn.rollers.r2",
    }


def test_duplicate_rollers_are_named(tmp_path: Path) -> None:
    second = '[[rollers]]\nname = "r1"\nradius = 1.0\ncentre = [1, 0, 1]\naxis = [0, 1, 0]\n'
    speed = '[[stages]]\nname = "more"\nduration = 1.0\nrollers.r2.surface_speed = 1.0\n'
    assert list(mistakes_of(tmp_path, GOOD + second + speed)) == ["rollers.r1.name"]


def test_unknown_rollers_are_named_beside_rollers_that_are_wrong(tmp_path: Path) -> None:
    speed = '[[stages]]\nname = "more"\nduration = 1.0\nrollers.q.surface_speed = 1.0\n'
    text = GOOD.replace("radius = 0.5", "radius = -0.5") + speed
    assert list(mistakes_of(tmp_path, text)) == ["rollers.r1.radius", "stages.more.rollers.q"]


@pytest.mark.parametrize(
    ("table", "typed"),
    [("[[rollers]]", "[[rolls]]"), ("[friction]", "[frictions]"), ("[threading]", "[thread]")],
)
def test_a_misspelt_table_is_one_mistake(tmp_path: Path, table: str, typed: str) -> None:
    steady = "duration = 0.6\nsteady = true\nstrip.speed = 1.0"
    text = THREADED.replace("duration = 0.6", steady).replace(table, typed)
    assert list(mistakes_of(tmp_path, text)) == [typed.strip("[]")]


def test_friction_of_a_roller_without_a_law(tmp_path: Path) -> None:
    begin, end = GOOD.index("[friction]"), GOOD.index("[[rollers]]")
    text = (GOOD[:begin] + GOOD[end:]).replace("radius = 0.5", "radius = 0.5\nfriction = 0.2")
    found = mistakes_of(tmp_path, text)
    assert set(found) == {"rollers.r1.friction"}
    assert "coefficient = 0.2" in found["rollers.r1.friction"]


def test_friction_asked_for_without_a_law(tmp_path: Path) -> None:
    begin, end = GOOD.index("[friction]"), GOOD.index("[[rollers]]")
    text = GOOD[:begin] + GOOD[end:].replace("duration = 0.6", "duration = 0.6\nfriction = true")
    assert set(mistakes_of(tmp_path, text)) == {"stages.turn.friction"}


def test_no_stages(tmp_path: Path) -> None:
    text = GOOD[: GOOD.index("[[stages]]")]
    assert "[[stages]]" in mistakes_of(tmp_path, text)["stages"]
    text = "stages = []\n" + text
    assert "[[stages]]" in mistakes_of(tmp_path, text)["stages"]


def test_mesh_brings_its_own_edges(tmp_path: Path) -> None:
    (tmp_path / "strip.msh").write_text("", encoding="utf-8")
    path = tmp_path / "scene.toml"
    path.write_text(MESHED.replace("entry", "mouth"), encoding="utf-8")
    scene = Scene.load(path)
    assert scene.strip.mesh == tmp_path / "strip.msh"
    assert set(scene.edges) == {"mouth"}


@pytest.mark.parametrize("name", ["none.msh", "", "..", "a" * 300, "a\\u0000b"])
def test_mesh_that_is_no_file(tmp_path: Path, name: str) -> None:
    assert set(mistakes_of(tmp_path, MESHED.replace("strip.msh", name))) == {"strip.mesh"}


@pytest.mark.parametrize(
    "released",
    [
        "duration = 0.6\nentry.force = [1, 0, 0]\nentry.release = true",
        '[[stages]]\nname = "go"\nentry.release = true\nduration = 1',
    ],
)
def test_released_edge_takes_a_force(tmp_path: Path, released: str) -> None:
    later = '\n[[stages]]\nname = "free"\nduration = 1.0\nentry.force = [1, 0, 0]\n'
    end = GOOD.index("[solver]")
    stages = GOOD[:end].replace("duration = 0.6", "duration = 0.6\n", 1)
    if released.startswith("duration"):
        stages = stages.replace("duration = 0.6", released)
    else:
        stages += released
    path = tmp_path / "scene.toml"
    path.write_text(stages + later, encoding="utf-8")
    assert Scene.load(path).stages[-1].edges["entry"].force == (1.0, 0.0, 0.0)


def test_a_released_edge_is_not_held_again(tmp_path: Path) -> None:
    later = '\n[[stages]]\nname = "free"\nduration = 1.0\nentry.force = [1, 0, 0]\n'
    text = GOOD.replace("duration = 0.6", f"duration = 0.6\nentry.release = true\n{later}", 1)
    free = Scene.load(write(tmp_path, text))
    assert Scene.model_validate(free.to_dict()).to_dict() == free.to_dict()
    found = mistakes_of(tmp_path, text.replace(later, f"{later}entry.release = false\n"))
    (told,) = found.values()
    assert "stages.free.entry.release" in found
    assert "given:    false" in told
    assert "stage turn lets this edge go" in told
    assert "type:     nothing; take it out here" in told


def test_zeros_are_no_motion_and_no_force(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    zeros = "duration = 0.6\nentry.force = [0, 1, 0]\nexit.move = [0, 0, 0]"
    path.write_text(GOOD.replace("duration = 0.6", zeros), encoding="utf-8")
    assert Scene.load(path).stages[-1].edges["exit"].move == (0.0, 0.0, 0.0)


def test_moment_needs_bending(tmp_path: Path) -> None:
    text = GOOD.replace("refined = 0.025", "bending = false")
    found = mistakes_of(tmp_path, text.replace("= 0.6", "= 0.6\nexit.moment = 1.0", 1))
    assert "bending = true" in found["stages.turn.exit.moment"]


def test_ten_thousand_rollers_are_read_and_told_apart() -> None:
    """Each is compared with all before it; the time of 240 s that this took must not come back."""
    tables = tomllib.loads(GOOD)
    roller = {**tables["rollers"][0], "radius": 0.1}
    many = [{**roller, "name": f"r{k}", "centre": [0.3 * k, 0.0, -0.101]} for k in range(1, 5001)]
    begin = time.process_time()
    assert len(Scene.model_validate({**tables, "rollers": many}).rollers) == 5000
    many[4000]["centre"] = [0.3 * 7 + 0.05, 0.0, -0.101]
    with pytest.raises(InputError) as caught:
        Scene.from_tables({**tables, "rollers": many}, "many.toml")
    assert time.process_time() - begin < 30.0
    (mistake,) = caught.value.mistakes
    assert mistake.key == "rollers.r4001.centre"
    assert "between the axes of r7 and r4001" in mistake.expected


def test_thousands_of_mistakes_are_counted_rather_than_printed() -> None:
    tables = tomllib.loads(GOOD)
    stages = [{"name": f"s{k}", "duration": -1.0, "rolers": 1} for k in range(5000)]
    with pytest.raises(InputError) as caught:
        Scene.from_tables({**tables, "stages": stages}, "many.toml")
    assert len(caught.value.mistakes) == 10_000
    assert len(str(caught.value)) < 50_000
    assert str(caught.value).endswith("and 9900 more mistakes")


def test_what_would_steer_a_terminal_is_told_in_escapes() -> None:
    evil = "\x1b[2J\x9b31m\r\x07\u202e"
    tables = tomllib.loads(GOOD.replace('"r1"', json.dumps(evil)))
    with pytest.raises(InputError) as caught:
        Scene.from_tables({**tables, evil: 1}, evil, [f"strip.width='{evil}'", evil])
    text = str(caught.value)
    assert "\\x1b[2J" in text
    assert all(c.isprintable() or c == "\n" for c in text)


@pytest.mark.parametrize("typed", ["poisson = 0,3", "poisson = 0, 3  # of steel"])
def test_a_decimal_comma_is_told(tmp_path: Path, typed: str) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace("poisson = 0.3", typed), encoding="utf-8")
    with pytest.raises(InputError, match="numbers have a decimal point, not a comma") as refused:
        Scene.load(path)
    (mistake,) = refused.value.mistakes
    assert mistake.hint == "poisson = 0.3"
    path.write_text(GOOD, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        Scene.load(path, ["material.poisson=0,3"])
    assert refused.value.mistakes[0].hint == "--set material.poisson=0.3"
    path.write_text(GOOD.replace("cells = [16, 2]", "cells = [16, 2"), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        Scene.load(path)
    assert "comma" not in refused.value.mistakes[0].expected


@pytest.mark.parametrize("key", FOREIGN_KEYS)
def test_what_rollers_have_in_other_programs_is_explained(key: str) -> None:
    with pytest.raises(InputError) as found:
        Scene.from_tables(tomllib.loads(f"{GOOD}\n[[rollers]]\n{key} = 1.0\n"), "line.toml")
    (mistake,) = [each for each in found.value.mistakes if each.key.endswith(key)]
    assert mistake.hint == FOREIGN_KEYS[key]


@pytest.mark.parametrize(
    ("old", "new", "key", "hint"),
    [
        ("young = ", "E = ", "material.E", "young = "),
        ("young = ", "youngs_modulus = ", "material.youngs_modulus", "young = "),
        ("young = ", "sigma_y = 3e8\nyoung = ", "material.sigma_y", "yield_stress = 3e+08"),
        ("every = 1", "frequency = 5", "output.frequency", "every = 5"),
        ("every = 1", "interval = 0.1", "output.interval", "times = "),
        ("poisson = ", "nu = ", "material.nu", "poisson = "),
        ("radius = 0.5", "diameter = 0.8", "rollers.r1.diameter", "radius = 0.4"),
        ("radius = 0.5", "radius = 0.5\nmu = 0.2", "rollers.r1.mu", "friction = 0.2"),
        ("young = ", "yield = 3e8\nyoung = ", "material.yield", "yield_stress = 3e+08"),
        ("width = ", "self_weight = true\nwidth = ", "strip.self_weight", "[[stages]] gravity = "),
        ("thickness = ", "gauge = ", "strip.gauge", "thickness = "),
        ("title = ", "units = {length = 'mm'}\ntitle = ", "units", "nothing: all numbers"),
        ("every = 1", 'every = 1\nformat = "vtk"', "output.format", "nothing: tables are CSV"),
        ("= 0.6", "= 0.6\nramp = true", "stages.turn.ramp", "nothing: what a stage gives changes"),
        ("= 0.6", "= 0.6\nexit.force = 1e4", "stages.turn.exit.force", "force = [10000, 0.0, "),
        ("= 0.6", "= 0.6\nentry.force = 10", "stages.turn.entry.force", "force = [-10, 0.0, "),
        ("[edges", "[rollers.x]\nradius = 1\n[edges", "rollers.r1.x", "[[rollers]] and below it"),
        ("radius = 0.5", "radius = 0.5\ncrown = 1e-3", "rollers.r1.crown", "crown = [0.0, -0.004]"),
        ("= 0.6", '= 0.6\ntype = "steady"', "stages.turn.type", "[[stages]] steady = true"),
        ("title = ", "entry = {tension = 5e3}\ntitle = ", "entry", "[[stages]] entry.tension"),
        ("width = ", "mesh_size = 0.01\nwidth = ", "strip.mesh_size", "refined = 0.01"),
        ("= 0.6", "= 0.6\nexit_tension = 5e3", "stages.turn.exit_tension", "exit.tension = 5000"),
    ],
)
def test_a_key_of_another_name_is_one_mistake(old: str, new: str, key: str, hint: str) -> None:
    """What is missing is told by what is there instead, once."""
    assert old in GOOD
    with pytest.raises(InputError) as found:
        Scene.from_tables(tomllib.loads(GOOD.replace(old, new, 1)), "line.toml")
    (mistake,) = found.value.mistakes
    assert (mistake.key, mistake.hint[: len(hint)]) == (key, hint)


def test_a_name_that_is_too_long_is_told_to_be_so() -> None:
    """Its letters were found fault with."""
    name = "a-long_name" * 9
    with pytest.raises(InputError) as found:
        Scene.from_tables(tomllib.loads(GOOD.replace('"r1"', f'"{name}"')), "line.toml")
    (mistake,) = [each for each in found.value.mistakes if each.key.endswith(".name")]
    assert "at most 64 letters" in mistake.expected
    assert mistake.hint == f'name = "{name[:64]}"'


@pytest.mark.parametrize(
    ("typed", "hint"),
    [
        ("rpm = 60.0", "angular_speed = 6.28319"),
        ("omega = 2.0", "angular_speed = 2"),
        ("force = [0.0, 0.0, -1.0]", "the tension that it makes: a weight G"),
        ("axis = [0.1, 1.0, 0.0]", "axis in [[rollers]], for the whole run"),
    ],
)
def test_what_stages_do_not_change_of_a_roller(typed: str, hint: str) -> None:
    stage = f'[[stages]]\nname = "more"\nduration = 1.0\nrollers.r1.{typed}\n'
    with pytest.raises(InputError) as found:
        Scene.from_tables(tomllib.loads(f"{GOOD}\n{stage}"), "line.toml")
    (mistake,) = found.value.mistakes
    assert mistake.hint.startswith(hint)


@pytest.mark.parametrize(
    ("word", "meant"), [("bottom", "under"), ("below", "under"), ("Top", "over")]
)
def test_sides_in_other_words(word: str, meant: str) -> None:
    tables = tomllib.loads(GOOD)
    tables["rollers"][0]["wrap"] = word
    with pytest.raises(InputError) as found:
        Scene.from_tables(tables, "line.toml")
    assert [m.hint for m in found.value.mistakes if m.key.endswith("wrap")] == [f'wrap = "{meant}"']


def test_no_stage_of_flat_strip_has_the_name_of_the_threading() -> None:
    """It was taken for one, with a traceback."""
    tables = {
        "strip": {"length": 1.0, "width": 0.1, "thickness": 1e-3},
        "material": {"young": 2e11, "poisson": 0.3},
        "edges": {"entry": {"fixed": ["x", "y", "z"]}},
        "stages": [{"name": "threading", "exit": {"force": [1e3, 0.0, 0.0]}}],
    }
    with pytest.raises(InputError) as found:
        Scene.from_tables(tables, "flat.toml")
    assert [mistake.key for mistake in found.value.mistakes] == ["stages.threading.name"]


def test_a_speed_of_a_roller_is_that_of_its_surface() -> None:
    tables = tomllib.loads(f'{GOOD}\n[[rollers]]\nname = "r1"\nradius = 0.1\ncentre = [0, 0, -1]\n')
    tables["stages"][0]["rollers"] = {"r1": {"speed": 2.0}}
    with pytest.raises(InputError) as found:
        Scene.from_tables(tables, "line.toml")
    assert "surface_speed = 2" in [mistake.hint for mistake in found.value.mistakes]


@pytest.mark.parametrize("table", ["friction", "contact", "material.plasticity"])
def test_parameters_go_with_a_law_of_ones_own(table: str, tmp_path: Path) -> None:
    """They were read and left."""
    path = tmp_path / "line.toml"
    path.write_text(GOOD, encoding="utf-8")
    more = ["friction.coefficient=0.2", "material.yield_stress=3e8"]
    with pytest.raises(InputError) as found:
        Scene.load(path, [*more, f"{table}.parameters={{a=1.0}}"])
    assert "none without a law" in str(found.value) and f"{table}.parameters" in str(found.value)
