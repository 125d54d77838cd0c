"""
A furnace of forty rollers
==========================

The stationary state: 37 idle rollers take what their bearings need, three drives give it.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

*_, last = Scene.load("../line.toml", ["solver.tolerance=1e-4"]).run()

figure, axes = plt.subplots()
axes.plot(last.state.along("arc_length"), last.state.along("tension") / 1e3)
axes.set(xlabel="arc length (m)", ylabel="tension (kN/m)")
