"""
How a line works
================

Each step of a steady stage is a stationary state: the tension between two drives.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

scene = Scene(
    strip={"width": 1.0, "thickness": 5e-4, "kinematics": "section"},
    material={"young": 2e11, "poisson": 0.3},
    contact={},
    friction={"coefficient": 0.3, "speed": 1e-5},
    threading={"tension": 1e4, "entry": [0.0, 0.0, 0.0], "exit": [4.0, 0.0, 0.0]},
    rollers=[
        {"name": "a", "radius": 0.3, "centre": [1.0, 0.0, -0.8], "wrap": "under"},
        {"name": "b", "radius": 0.3, "centre": [3.0, 0.0, 0.8], "wrap": "over"},
    ],
    edges={"entry": {"fixed": ["x", "z"]}},
    stages=[
        {
            "name": "start",
            "steady": True,
            "entry": {"tension": 1e4},
            "rollers": {"a": {"surface_speed": 2.0}, "b": {"surface_speed": 2.0}},
        },
        {"name": "faster", "steady": True, "rollers": {"b": {"surface_speed": 2.0004}}},
    ],
    solver={"tolerance": 1e-4},
)
speeds, tensions = [], []
for step in scene.run():
    if step.stage == "faster":
        rollers = step.state.rollers
        speeds.append(rollers["b"].surface_speed - 2.0)
        tensions.append(rollers["a"].tension_out)

figure, axes = plt.subplots()
axes.plot([1e3 * v for v in speeds], [t / 1e3 for t in tensions], ".-")
axes.set(xlabel="lead of the second drive (mm/s)", ylabel="tension between (kN/m)")
