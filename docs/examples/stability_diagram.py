"""
Stability of the inverted pendulum
==================================

Floquet multipliers of an equilibrium over two parameters: the inverted state is stable between two curves.
"""

from math import pi

import numpy as np

from cellmap import plot, stability_map
from systems import driven_pendulum

frequency = ("frequency", np.linspace(20, 80, 61))
amplitude = ("amplitude", np.linspace(0.5e-3, 14e-3, 61))
inverted = stability_map(driven_pendulum(), [pi, 0.0], frequency, amplitude)
print(inverted.curves)
plot.stability_map(inverted)
# sphinx_gallery_alt = "Frequency and amplitude plane with the region in which the inverted pendulum is stable"
