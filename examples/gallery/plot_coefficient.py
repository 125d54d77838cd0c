"""
Tension ratio against friction
==============================

One scene for several coefficients, beside e^(f θ).
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import Scene

coarse = ['strip.kinematics="section"', "strip.refined=0.05"]
found = []
for f in (0.1, 0.2, 0.3):
    *_, last = Scene.load("../capstan.toml", [*coarse, f"friction.coefficient={f}"]).run()
    roller = last.state.rollers["r1"]
    found.append((f, roller.tension_ratio, roller.wrap))
f, ratio, wrap = np.transpose(found)

figure, axes = plt.subplots()
axes.plot(f, ratio, "o", label="computed")
axes.plot(f, np.exp(f * (wrap + 0.15)), "--", label="e^(f θ), θ with 2 √(D/T)/r of the bent ends")
axes.set(xlabel="friction coefficient", ylabel="tension ratio")
axes.legend()
