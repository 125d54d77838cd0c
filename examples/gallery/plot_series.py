"""
Series of a plain function
==========================

Taylor coefficients of numpy expressions: the error falls with the order inside the radius.
"""

import matplotlib.pyplot as plt
import numpy as np

from anmstrip import taylor_series

a = np.linspace(0.0, 1.0, 200)
figure, axes = plt.subplots()
for order in (4, 8, 16, 32):
    c = taylor_series(lambda x: np.sqrt(x) * np.tanh(x), [1.0, 1.0] + [0.0] * (order - 1))
    error = np.abs(np.polyval(c[::-1], a) - np.sqrt(1.0 + a) * np.tanh(1.0 + a))
    axes.semilogy(a, error + 1e-17, label=f"order {order}")
axes.set(xlabel="a", ylabel="error of √x tanh x at x = 1 + a", ylim=(1e-17, 1.0))
axes.legend()
