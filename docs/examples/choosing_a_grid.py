"""
Choosing grid and order
=======================

The error of an interpolated map falls with the number of cells as the power of its order plus one, until it reaches
the tolerance of the exact map.
"""

import matplotlib.pyplot as plt

from cellmap import CellGrid, interpolated_map, stroboscopic_map
from systems import duffing_oscillator

strobe = stroboscopic_map(duffing_oscillator(), rtol=1e-11, atol=1e-11)
cells = [24, 48, 96, 192]
for order in (1, 3, 5):
    errors = []
    for n in cells:
        grid = CellGrid(lower=(-2.5, -3), upper=(2.5, 3), shape=(n, n))
        errors.append(interpolated_map(strobe, grid, order=order, tolerance=1e6).error().percentile_99)
    print(f"order {order}: doubling 96 cells divides the error by {errors[-2] / errors[-1]:.0f}")
    plt.loglog(cells, errors, "o-", label=f"order {order}")

plt.gca().set(xlabel="cells along each axis", ylabel="error of one period (99 %)", title="Interpolated maps")
plt.legend()
# sphinx_gallery_alt = "Error of one period against cells on logarithmic axes: straight lines of slopes -2, -4 and -6"
