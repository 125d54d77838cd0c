"""
A crowned roller
================

The middle of the strip carries more than the edges.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

coarse = ["strip.cells=[24, 4]"]
*_, last = Scene.load("../crowned.toml", coarse).run()
low, mean, high = (last.state.along(n) / 1e3 for n in ("tension_min", "tension", "tension_max"))

figure, axes = plt.subplots()
axes.fill_between(last.state.along("x"), low, high, alpha=0.3, label="over the width")
axes.plot(last.state.along("x"), mean, label="mean")
axes.set(xlabel="x (m)", ylabel="tension (kN/m)")
axes.legend()
