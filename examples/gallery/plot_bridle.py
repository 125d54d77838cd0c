"""
A bridle
========

Two driven rollers raise the tension; each slips over its whole arc.
"""

import matplotlib.pyplot as plt

from anmstrip import Scene

coarse = ["strip.refined=0.05", 'strip.kinematics="section"', "solver.tolerance=1e-3"]
*_, last = Scene.load("../bridle.toml", coarse).run()

figure, (shape, along) = plt.subplots(2, 1, height_ratios=(2, 1), layout="constrained")
shape.plot(last.state.along("x"), last.state.along("z"))
shape.set(xlabel="x (m)", ylabel="z (m)", aspect="equal")
along.plot(last.state.along("arc_length"), last.state.along("tension") / 1e3)
along.set(xlabel="arc length (m)", ylabel="tension (kN/m)")
