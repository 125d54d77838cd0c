"""
Where a driven strip slips
==========================

A steady stage: behind the arc of adhesion the strip creeps, and its tension falls.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

scene = Scene(
    strip={"width": 1.0, "thickness": 1e-3, "kinematics": "section"},
    material={"young": 2e11, "poisson": 0.3},
    contact={},
    friction={"coefficient": 0.3, "speed": 1e-6},
    threading={"tension": 1e4, "entry": [-1.5, 0.0, -0.5], "exit": [1.5, 0.0, -0.5]},
    rollers=[{"radius": 0.5, "centre": [0.0, 0.0, -0.5], "wrap": "over"}],
    edges={"entry": {"fixed": ["x", "z"]}},
    stages=[
        {"steady": True, "entry": {"tension": 1.2e4}, "rollers": {"r1": {"surface_speed": 1.0}}}
    ],
    solver={"tolerance": 1e-4},
)
*_, last = scene.run()
state = last.state
figure, (upper, lower) = plt.subplots(2, 1, sharex=True, layout="constrained")
upper.plot(state.along("arc_length"), state.along("tension") / 1e3)
upper.set(ylabel="tension (kN/m)")
lower.plot(state.along("arc_length"), 1e6 * state.along("slip"))
lower.set(xlabel="arc length (m)", ylabel="slip (µm/s)")
