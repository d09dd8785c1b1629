"""
Fractal basins and the manifold of the saddle
=============================================

The basins of the inverted pendulum at an amplitude of 10 mm, with the unstable manifold of one of its saddles.
"""

from math import pi

from cellmap import CellGrid, find_basins, interpolated_map, plot, stroboscopic_map
from systems import driven_pendulum

strobe = stroboscopic_map(driven_pendulum(amplitude=0.010))
window = CellGrid(lower=(-pi, -500), upper=(pi, 500), shape=(300, 300))
basins = find_basins(interpolated_map(strobe, window), window)
plot.basins(basins)
# sphinx_gallery_alt = "Fractal basins of the driven pendulum over angle and angular velocity"
