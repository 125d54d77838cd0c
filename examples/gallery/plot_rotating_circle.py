"""
A mass on a turning circle
==========================

Section 3.3 of the 2010 paper: at 1.8 s friction can no longer hold the mass.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt

from anmstrip.paper.cases import run_case

report = run_case("rotating-circle", order=19, tolerance=1e-4, directory=Path(mkdtemp()))
time, ux, uy = report.rows[:, :3].T

figure, axes = plt.subplots()
axes.plot(time, ux, label="u_x")
axes.plot(time, uy, label="u_y")
axes.set(xlabel="time (s)", ylabel="displacement (m)", title=f"{report.steps} steps of order 19")
axes.legend()
