"""
A heavy strip between two rollers
=================================

Ten metres of free strip hang in a catenary.
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import Scene

run = Scene.load("../heavy.toml").run()
*_, last = run
x, z = (last.state.along(name) for name in "xz")
between = (x > 0.5) & (x < 9.5)
a = 28.671  # m, horizontal tension over weight
catenary = a * (np.cosh((x[between] - 5.0) / a) - 1.0) - 0.420

figure, axes = plt.subplots()
axes.plot(x, z, label="computed")
axes.plot(x[between], catenary, "--", label="catenary")
axes.set(xlabel="x (m)", ylabel="z (m)", xlim=(-0.5, 10.5), ylim=(-0.6, 0.2))
axes.legend()
