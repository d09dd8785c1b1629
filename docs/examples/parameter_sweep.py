"""
Basin fractions against a parameter
===================================

Attractors appear, disappear and exchange their basins as the amplitude of a driven pivot grows.
"""

from math import pi

import numpy as np

from cellmap import CellGrid, plot, stroboscopic_map
from cellmap.basins import continue_basins
from systems import driven_pendulum

amplitude = np.linspace(1.5e-3, 4e-3, 26)
window = CellGrid(lower=(-pi, -500), upper=(pi, 500), shape=(25, 25))
sweep = continue_basins(stroboscopic_map(driven_pendulum()), "amplitude", amplitude, window)
for label in sweep.labels:
    there = sweep.values[sweep.present[:, sweep.labels.index(label)]]
    print(f"{sweep.label_name(label)}: {1e3 * there.min():.1f} to {1e3 * there.max():.1f} mm")

plot.basin_continuation(sweep)
# sphinx_gallery_alt = "Stacked basin fractions against amplitude: rotations appear, then the inverted state"
