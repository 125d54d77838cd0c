"""
A strip under pressure
======================

Held at both ends and pressed from below, a section becomes an arc.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

scene = Scene(
    strip={
        "length": 2.0,
        "width": 1.0,
        "thickness": 1e-3,
        "cells": [40, 1],
        "kinematics": "section",
    },
    material={"young": 2e11, "poisson": 0.3},
    edges={"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
    stages=[
        {"name": "pull", "duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}},
        {"name": "press", "duration": 1.0, "pressure": 4e3},
    ],
    solver={"tolerance": 1e-4},
)
figure, axes = plt.subplots(figsize=(6.4, 2.4), layout="constrained")
for name, state in {step.stage: step.state for step in scene.run()}.items():
    axes.plot(state.along("x"), state.along("z"), label=name)
axes.set(xlabel="x (m)", ylabel="z (m)", ylim=(-0.02, 0.25), aspect="equal")
axes.legend(loc="lower center", ncols=2)
