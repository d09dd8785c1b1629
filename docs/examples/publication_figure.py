"""
A figure for a publication
==========================

Plots draw on axes of yours, and colours of single labels can be chosen. Vector formats keep text as text; the basins are
an image inside.
"""

from math import pi

import matplotlib.pyplot as plt

from cellmap import CellGrid, find_basins, interpolated_map, plot, stroboscopic_map
from systems import driven_pendulum

plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "svg.fonttype": "none"})
window = CellGrid(lower=(-pi, -100), upper=(pi, 100), shape=(300, 300))
fig, axes = plt.subplots(1, 2, figsize=(5.5, 2.6), sharey=True, layout="constrained")
for ax, amplitude, letter in zip(axes, (0.003, 0.004), "ab", strict=True):
    strobe = stroboscopic_map(driven_pendulum(amplitude=amplitude))
    basins = find_basins(interpolated_map(strobe, window), window)
    plot.basins(basins, ax=ax, colours={0: "#4c72b0", 1: "#dddddd"}, legend=False)
    ax.set(title=f"({letter}) amplitude {1e3 * amplitude:.0f} mm", xlabel=r"$\theta$ (rad)", ylabel="")

axes[0].set_ylabel(r"$\dot\theta$ (rad/s)")
# sphinx_gallery_alt = "Two panels of basins side by side, the basin of the inverted state in grey"
