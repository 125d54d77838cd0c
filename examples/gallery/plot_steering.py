"""
A roller out of line
====================

A strip walks towards the side on which the roller turns away: Shelton's problem.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

coarse = ["solver.tolerance=1e-4"]
*_, last = Scene.load("../steering.toml", coarse).run()

figure, axes = plt.subplots()
axes.plot(last.state.along("x"), 1e3 * last.state.along("y"))
axes.set(xlabel="x (m)", ylabel="y of the middle (mm)")
