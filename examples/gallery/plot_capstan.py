"""
Tension over a roller
=====================

The strip is held while the roller turns: in slip the tension falls by e^(f θ) along the arc.
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import Scene

coarse = ['strip.kinematics="section"', "strip.refined=0.02"]
*_, last = Scene.load("../capstan.toml", coarse).run()
state = last.state
s, tension, pressure = (state.along(name) for name in ("arc_length", "tension", "pressure"))
touching = pressure > 0.1 * pressure.max()
begin = s[touching][0]
capstan = tension[touching][0] * np.exp(-0.2986 * (s[touching] - begin) / 0.5)

figure, axes = plt.subplots()
axes.plot(s, tension / 1e3, label="computed")
axes.plot(s[touching], capstan / 1e3, "--", label="capstan formula")
axes.set(xlabel="arc length (m)", ylabel="tension (kN/m)")
axes.legend()
