"""
A levelling machine
===================

Seven rollers bend the strip to and fro: its curvature along the way.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

coarse = ["stages.drag.duration=0.02", "strip.refined=0.01", "solver.tolerance=1e-3"]
*_, last = Scene.load("../levelling.toml", coarse).run()

figure, axes = plt.subplots()
axes.plot(last.state.along("x"), last.state.along("curvature"))
axes.set(xlabel="x (m)", ylabel="curvature (1/m)")
