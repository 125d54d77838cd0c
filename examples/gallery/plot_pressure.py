"""
Pressure on a roller
====================

Within the arc the pressure is (T − D/2r²)/r; where the strip lifts off it peaks.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

coarse = ['strip.kinematics="section"', "strip.refined=0.01"]
run = Scene.load("../press.toml", coarse).run()
*_, last = run
state, radius = last.state, run.scene.rollers[0].radius
bending = run.assembly.strip.bending_stiffness
expected = (state.tension("exit") - bending / (2.0 * radius**2)) / radius

figure, axes = plt.subplots()
axes.plot(state.along("arc_length"), state.along("pressure") / 1e3)
axes.axhline(expected / 1e3, linestyle="--", color="grey")
axes.set(xlabel="arc length (m)", ylabel="pressure (kPa)")
