"""
Finite-time Lyapunov exponents
==============================

Ridges of the forward exponent are stable manifolds: initial conditions on both sides of a ridge separate.
"""

from cellmap import CellGrid, plot, stroboscopic_map
from cellmap.orbits import finite_time_exponents
from systems import two_well_duffing

strobe = stroboscopic_map(two_well_duffing())
window = CellGrid(lower=(-2, -1.5), upper=(2, 1.5), shape=(160, 120))
field = finite_time_exponents(strobe, window, periods=3)
print(f"exponents from {field.forward.min():.1f} to {field.forward.max():.1f} per period")
plot.exponent_field(field)
# sphinx_gallery_alt = "Finite-time exponents over the plane, with bright ridges along the stable manifold of the saddle"
