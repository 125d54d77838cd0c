"""
Tensions over time
==================

The columns of ``history.csv`` are ``run.history``.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

coarse = ['strip.kinematics="section"', "strip.refined=0.02"]
run = Scene.load("../capstan.toml", coarse).run()
for _ in run:
    pass

figure, axes = plt.subplots()
for edge in ("entry", "exit"):
    axes.plot(run.history["time"], run.history[f"{edge}_tension"] / 1e3, ".-", label=edge)
axes.set(xlabel="time (s)", ylabel="tension (kN/m)")
axes.legend()
