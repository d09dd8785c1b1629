"""
A slice through four dimensions
===============================

A grid with one cell along an axis is a slice. This one holds both angular velocities of a driven double pendulum at
zero. The drive stabilises all four equilibria.
"""

from math import pi

from cellmap import CellGrid, find_basins, plot, stroboscopic_map
from systems import Chain, Gravity, VerticalDrive, ViscousDamping, scene

links = Chain(lengths=(0.032, 0.032), masses=(1.0, 0.25))
double = scene(
    links,
    Gravity(9.8),
    VerticalDrive(amplitude=0.006, frequency=50.0),
    ViscousDamping(10.0),
    name="driven double pendulum",
)
at_rest = CellGrid(lower=(-pi, -pi, -1, -1), upper=(pi, pi, 1, 1), shape=(30, 30, 1, 1))
basins = find_basins(stroboscopic_map(double), at_rest)
print(basins)
plot.basins(basins)
# sphinx_gallery_alt = "Basins of the four equilibria over the two angles, an island around each on a mixed background"
