"""
Three laws of contact
=====================

Pressure against the gap, for the default law and two penalty laws, which differ only far outside.
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import GradedSignorini, RepulsiveSignorini, Signorini

gap = np.linspace(-2e-4, 6e-4, 400)
laws = {
    "p₀ exp(−h/w)": GradedSignorini(2e4, 1e-4),
    "R (R/K + h) = η δ": RepulsiveSignorini(1e8, 100.0, 1e-3),
    "R (R/K + h) = η (δ − h)": Signorini(1e8, 100.0, 1e-3),
}

figure, axes = plt.subplots()
for (name, law), style in zip(laws.items(), ("-", "-", "--"), strict=True):
    axes.plot(1e3 * gap, law(gap) / 1e3, style, label=name)
axes.set(xlabel="gap (mm)", ylabel="pressure (kPa)", ylim=(0.0, 60.0))
axes.legend()
