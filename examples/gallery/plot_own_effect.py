"""
An effect of one's own
======================

A bed that stiffens, resisting by k w + c w³: the force to lift an edge.
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import ContactOperator, LawEffect, Run, Scene


class StiffeningBed(LawEffect):
    """A bed under a section that resists by k w + c w³ per area (Pa)."""

    name = "bed"

    def __init__(self, strip, k, c):
        self.operator, self.k, self.c = ContactOperator(strip), k, c

    def law(self, x, v, controls):
        return np.stack([0.0 * x[1], x[1] * self.k + x[1] * x[1] * x[1] * self.c])


strip = {"length": 4.0, "width": 1.0, "thickness": 5e-3, "cells": [40, 1]}
scene = Scene(
    strip={**strip, "kinematics": "section"},
    material={"young": 2e11, "poisson": 0.3},
    edges={"exit": {"fixed": ["x"]}, "entry": {"fixed": ["z"]}},
    stages=[{"duration": 0.1, "entry": {"move": [0.0, 0.0, 5e-4 * k]}} for k in range(1, 11)],
    solver={"tolerance": 1e-6},
)
figure, axes = plt.subplots()
for c in (0.0, 1e9, 4e9):
    steps = [*Run(scene, effects=[lambda strip, c=c: StiffeningBed(strip, k=2e4, c=c)])]
    lift = [0.0, *(5.0 * step.time for step in steps)]
    force = [0.0, *(step.state.edge_force("entry")[2] for step in steps)]
    axes.plot(lift, force, ".-", label=f"c = {c:g} Pa/m³")
axes.set(xlabel="lift of the edge (mm)", ylabel="force (N)")
axes.legend()
