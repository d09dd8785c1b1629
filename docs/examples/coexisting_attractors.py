"""
Coexisting attractors
=====================

How many attractors does a system have? Twenty random initial conditions find those with large basins; a grid of
initial conditions finds small ones too and gives their basins.
"""

import numpy as np

from cellmap import CellGrid, find_attractors, find_basins, interpolated_map, plot, stroboscopic_map
from systems import duffing_oscillator

strobe = stroboscopic_map(duffing_oscillator(damping=0.08, linear=0.0, cubic=1.0, forcing=0.2, frequency=1.0))
rng = np.random.default_rng(1)
found = find_attractors(strobe, rng.uniform(-1, 1, (20, 2)))
print(f"random initial conditions: {len(found)} attractors")

window = CellGrid(lower=(-1, -1), upper=(1, 1), shape=(300, 300))
basins = find_basins(interpolated_map(strobe, window), window)
print(f"grid: {len(basins.attractors)} attractors")
for label, fraction in basins.fractions.items():
    print(f"{basins.label_name(label)}: {100 * fraction.fraction:.1f} %")

plot.basins(basins)
# sphinx_gallery_alt = "Basins of the coexisting attractors of a weakly damped hardening oscillator, in spiral bands"
