"""
A strip on an elastic foundation
================================

One edge is lifted; the deflection decays as Hetényi (1946) says.
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import Scene

k, thickness, lift = 2e4, 5e-3, 1e-3
strip = {"length": 4.0, "width": 1.0, "thickness": thickness, "cells": [80, 1]}
scene = Scene(
    strip={**strip, "kinematics": "section", "foundation": k},
    material={"young": 2e11, "poisson": 0.0},
    edges={"entry": {"fixed": ["z"]}, "exit": {"fixed": ["x"]}},
    stages=[{"duration": 1.0, "entry": {"move": [0.0, 0.0, lift]}}],
    solver={"tolerance": 1e-6},
)
*_, last = scene.run()
x, z = last.state.along("arc_length"), last.state.along("z")
wave = (k / (4.0 * 2e11 * thickness**3 / 12.0)) ** 0.25

figure, axes = plt.subplots()
axes.plot(x, 1e3 * z, label="computed")
axes.plot(x, 1e3 * lift * np.exp(-wave * x) * np.cos(wave * x), "--", label="Hetényi")
axes.set(xlabel="distance from the edge (m)", ylabel="deflection (mm)")
axes.legend()
