"""
A mass lowered onto a moving plane
==================================

Section 3.2 of the 2010 paper.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt

from anmstrip.paper.cases import run_case

report = run_case("moving-plane", order=19, tolerance=1e-4, directory=Path(mkdtemp()))
time, ux, uy = report.rows[:, :3].T

figure, axes = plt.subplots()
axes.plot(time, ux, label="u_x")
axes.plot(time, uy, label="u_y")
axes.set(xlabel="time (s)", ylabel="displacement (m)", title=f"{report.steps} steps of order 19")
axes.legend()
