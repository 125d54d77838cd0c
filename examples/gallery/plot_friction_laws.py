"""
Three laws of friction
======================

Traction over f R_N against slip over V_c.
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import Algebraic, NortonHoff, Tanh

slip = np.linspace(-4.0, 4.0, 400)
laws = {
    "algebraic": Algebraic(1.0, 1.0),
    "Norton–Hoff, q = 0.05": NortonHoff(1.0, 0.05, 0.1, 1.0),
    "tanh": Tanh(1.0, 0.1, 1.0),
}

figure, axes = plt.subplots()
for name, law in laws.items():
    axes.plot(slip, -law(np.ones_like(slip), slip[None])[0], label=name)
axes.set(xlabel="slip / V_c", ylabel="|traction| / f R_N, with the sign of slip")
axes.legend()
