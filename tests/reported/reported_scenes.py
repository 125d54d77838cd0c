"""The scenes whose reported numbers are checked: small, with one thing each to be seen."""

STRIP = """
[strip]
kinematics = "section"
length = 4.0
width = 0.8
thickness = 1.0e-3
cells = [16, 2]
refined = 0.1

[material]
young = 2.0e11
poisson = 0.3
"""

PULL_AND_WRAP = """
[[rollers]]
name = "r1"
radius = 0.5
centre = [0.0, 0.0, -0.501]

[edges.entry]
fixed = ["x", "z"]

[[stages]]
name = "pull"
duration = 2.0
friction = false
exit.force = [1.0e4, 0.0, 0.0]

[[stages]]
name = "wrap"
duration = 0.5
friction = false
entry.move = [0.0, 0.0, -0.45]
exit.force = [1.0e4, 0.0, -5773.5]
"""

TURNING = (
    STRIP
    + """
[contact]
pressure = 2.0e4
onset = 1.0e-4

[friction]
law = "norton-hoff"
coefficient = 0.3
exponent = 0.05
omega = 0.1
speed = 0.1
"""
    + PULL_AND_WRAP
    + """
[[stages]]
name = "turn"
duration = 0.4
rollers.r1.surface_speed = 1.0
rollers.r1.move = [0.01, 0.0, 0.02]

[solver]
tolerance = 1.0e-4

[output]
events = true
"""
)
"""A held section; the roller turns under it and slips, and moves at the same time."""

SHELL = """
[strip]
width = 0.6
thickness = 1.0e-3
cells = [12, 2]
refined = 0.12
feed = false

[material]
young = 2.0e11
poisson = 0.3
density = 7850.0

[contact]
pressure = 2.0e4
onset = 2.0e-4

[friction]
law = "norton-hoff"
coefficient = 0.3
exponent = 0.1
speed = 1.0e-3

[threading]
tension = 1.0e4
entry = [-1.5, 0.0, -0.8]
exit = [2.5, 0.0, 0.5]

[[rollers]]
name = "front"
radius = 0.5
centre = [0.0, 0.1, -0.5]
axis = [0.006, 2.0, 0.004]
crown = [1.0e-5, -2.0e-4]
wrap = "over"

[[rollers]]
name = "back"
radius = 0.4
centre = [1.3, 0.0, -1.2]
friction = 0.2
wrap = "under"

[edges.entry]
fixed = ["x", "z"]
centred = true

[[stages]]
name = "load"
duration = 1.0
friction = false
gravity = [0.0, 0.0, -9.81]

[[stages]]
name = "turn"
duration = 0.1
rollers.front.surface_speed = 0.002
rollers.back.surface_speed = 0.0004

[solver]
tolerance = 1.0e-3
"""
"""A shell around a crowned roller out of line and another; parts of it stick, others slip."""

THIN = (
    SHELL.split('[[stages]]\nname = "turn"', maxsplit=1)[0].replace("1.0e-3", "2.0e-4", 1)
    + """
[solver]
tolerance = 1.0e-3
"""
).replace("crown = [1.0e-5, -2.0e-4]", "crown = [0.0, -3.0e-3]")
"""The same strip a fifth as thick over a crown 15 times as high: it is compressed across."""

QUARTIC = """
[strip]
width = 1.0
thickness = 2.0e-4
cells = [6, 2]
refined = 0.1
feed = false

[material]
young = 2.0e11
poisson = 0.3

[contact]
stiffness = 1.0e9
eta = 10.0
delta = 1.0e-3

[threading]
tension = 2.2e4
entry = [-0.8318, 0.0, -0.0712]
exit = [0.8318, 0.0, -0.0712]

[[rollers]]
name = "r1"
radius = 0.4
centre = [0.0, 0.0, -0.4]
crown = [0.0, 0.0, 0.0, -0.0128]
wrap = "over"

[edges.entry]
fixed = ["x", "z"]
centred = true

[[stages]]
name = "lie"
friction = false
"""
"""A shell with two elements across over a roller that is ground by 0.8 mm at its edges, as y⁴."""

PLATE = """
[strip]
kinematics = "plate"
length = 2.0
width = 0.4
thickness = 1.0e-3
cells = [8, 2]
refined = 0.05

[material]
young = 2.0e11
poisson = 0.3

[contact]
stiffness = 1.0e9
eta = 10.0
delta = 1.0e-3

[[rollers]]
name = "r1"
radius = 0.5
centre = [0.0, 0.0, -0.501]

[edges.entry]
fixed = ["z"]

[edges.exit]
fixed = ["z"]

[[stages]]
name = "pull"
duration = 1.0
exit.force = [1.0e4, 0.0, 0.0]

[[stages]]
name = "press"
duration = 1.0
rollers.r1.move = [0.0, 0.0, 0.011]

[solver]
tolerance = 1.0e-6
"""
"""A plate lifted by a roller with a penalty."""

LIFTED = """
[strip]
kinematics = "section"
length = 2.0
width = 1.0
thickness = 1.0e-3
cells = [8, 2]
refined = 0.05

[material]
young = 2.0e11
poisson = 0.3

[contact]
stiffness = 1.0e10
eta = 10.0
delta = 1.0e-3

[[rollers]]
name = "r"
radius = 0.5
centre = [0.0, 0.0, -0.52]

[edges.entry]
fixed = ["x", "z"]

[edges.exit]
fixed = ["z"]

[[stages]]
name = "pull"
duration = 1.0
exit.force = [1.0e4, 0.0, 0.0]

[[stages]]
name = "up"
duration = 1.0
rollers.r.move = [0.0, 0.0, 0.1]

[[stages]]
name = "down"
duration = 1.0
rollers.r.move = [0.0, 0.0, 0.0]

[output]
events = true
times = [0.25, 1.1, 1.2, 1.5, 2.0, 2.75]

[solver]
tolerance = 1.0e-6
"""
"""A roller rises by 100 mm under a strip that lies 20 mm above it, and sinks back."""

FED = """
[strip]
kinematics = "section"
length = 1.5
width = 0.4
thickness = 1.0e-3
cells = [15, 2]
refined = 0.1
feed = true

[material]
young = 2.0e11
poisson = 0.3
density = 7850.0

[contact]
stiffness = 1.0e9
eta = 100.0
delta = 1.0e-2

[friction]
coefficient = 0.3
speed = 1.0e-3

[threading]
tension = 1.0e4
entry = [-0.7, 0.0, -0.4]

[[rollers]]
name = "r1"
radius = 0.3
centre = [0.0, 0.0, -0.3]
wrap = "over"

[edges.entry]
fixed = ["x", "z"]

[[stages]]
name = "hold"
duration = 0.1
entry.release = true

[[stages]]
name = "start"
duration = 0.1
rollers.r1.surface_speed = 2.0

[[stages]]
name = "convey"
duration = 0.03

[solver]
tolerance = 1.0e-3
"""
"""A strip that a roller conveys; a fresh one follows through labels that stay."""

PRESSED = """
[strip]
length = 1.0
width = 0.4
thickness = 1.0e-3
cells = [8, 4]
imperfection = { mode = 1, amplitude = 1.0e-4 }

[material]
young = 2.0e11
poisson = 0.0

[edges.entry]
fixed = ["x", "z"]
centred = true

[edges.exit]
fixed = ["z"]
centred = true

[[stages]]
name = "press"
duration = 1.0
exit.force = [-100.0, 0.0, 0.0]
"""
"""A shell that is bent along by its first mode, and pressed by 61 % of Euler's force."""

INFLATED = """
[strip]
kinematics = "section"
length = 2.0
width = 0.5
thickness = 1.0e-3
cells = [40, 2]
bending = false

[material]
young = 2.0e11
poisson = 0.3

[edges.entry]
fixed = ["x", "z"]

[edges.exit]
fixed = ["z"]

[[stages]]
name = "pull"
duration = 1.0
exit.force = [1.0e4, 0.0, 0.0]

[[stages]]
name = "follow"
duration = 1.0
exit.force = [0.0, 0.0, 0.0]
exit.tension = 1.0e4

[[stages]]
name = "inflate"
duration = 1.0
pressure = 8.0e3

[solver]
tolerance = 1.0e-4
"""
"""A strip under a tension that follows it, blown to an arc of radius T/p."""


IDLER = """
[strip]
kinematics = "section"
width = 1.0
thickness = 1.0e-3

[material]
young = 2.1e11
poisson = 0.3

[contact]

[friction]
coefficient = 0.3

[threading]
tension = 1.0e4
entry = [-2.0, 0.0, 0.4]
exit = [4.0, 0.0, 0.0]

[[rollers]]
name = "driven"
radius = 0.4
centre = [0.0, 0.0, 0.0]
wrap = "over"

[[rollers]]
name = "idle"
radius = 0.4
centre = [2.0, 0.0, 0.0]
wrap = "under"
drive = "idle"
bearing = 10.0

[edges.entry]
fixed = ["x", "z"]

[[stages]]
name = "run"
steady = true
entry.tension = 9.5e3
rollers.driven.surface_speed = 2.0

[solver]
tolerance = 1.0e-4
"""
"""Friction stands between given tensions, a driven roller and one that bearings brake."""
