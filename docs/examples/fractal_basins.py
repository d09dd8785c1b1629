"""
Fractal basins and the manifolds of saddles
===========================================

The pendulum on a vertically driven pivot at 10 mm: hanging, inverted, swinging and rotating motions coexist. The
unstable manifolds of the saddles between hanging and inverted lead from their common boundary to the attractors.
"""

from math import pi

from cellmap import CellGrid, find_basins, find_periodic_orbits, interpolated_map, plot, stroboscopic_map
from cellmap.analysis.boundary import saddle_manifold
from systems import driven_pendulum

strobe = stroboscopic_map(driven_pendulum(amplitude=0.010))
window = CellGrid(lower=(-pi, -290), upper=(pi, 290), shape=(400, 300))
basins = find_basins(interpolated_map(strobe, window), window)
saddles = [o for o in find_periodic_orbits(strobe, window) if o.kind == "saddle" and abs(o.points[0, 1]) < 50]
unstable = [saddle_manifold(strobe, saddle, "unstable", window, length=12) for saddle in saddles]
plot.manifolds(unstable, basins=basins, width=0.7)
print(f"{len(saddles)} saddles with multipliers {saddles[0].multipliers.real.round(3)}")
# sphinx_gallery_alt = "Fractal basins over angle and angular velocity, with the winding unstable manifolds of two saddles"
