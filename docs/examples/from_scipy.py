"""
Coming from SciPy: the same orbit by solve_ivp
==============================================

``system.fun`` is the right-hand side in the form that SciPy takes, so that any orbit can be checked independently.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

from cellmap import stroboscopic_map
from systems import duffing_oscillator

system = duffing_oscillator()
strobe = stroboscopic_map(system)
ours = strobe.orbit([0.5, 0.0], 30).points
times = np.arange(31) * system.length
theirs = solve_ivp(system.fun, (0, times[-1]), (0.5, 0.0), "DOP853", t_eval=times, rtol=1e-12, atol=1e-12).y.T
print("largest difference below 1e-8:", bool(np.abs(ours - theirs).max() < 1e-8))
plt.plot(*ours.T, "o", label="cellmap")
plt.plot(*theirs.T, "k+", label="SciPy")
plt.gca().set(xlabel="x", ylabel="v", title="30 periods on the Poincaré section")
plt.legend()
# sphinx_gallery_alt = "Section points of an orbit by cellmap and by SciPy, which coincide, spiralling into a fixed point"
