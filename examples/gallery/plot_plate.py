"""
A plate that sags and is lifted
===============================

Small deflections: a plate sags under its weight, then a roller lifts it.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

run = Scene.load("../small_deflection.toml").run()
figure, axes = plt.subplots()
for name, state in {step.stage: step.state for step in run}.items():
    axes.plot(state.along("x"), 1e3 * state.along("z"), label=name)
axes.set(xlabel="x (m)", ylabel="z (mm)")
axes.legend()
