"""
The inverted pendulum
=====================

A pendulum whose pivot is shaken vertically can stand upside down. This tutorial builds it from parts, finds where the
inverted state is stable, draws the basins of figure 19 of :doc:`the report </the-report>` on which this project is based,
and ends with the flipping modes of a double pendulum.
"""

# %%
# A scene
# -------
#
# The package ``systems`` composes pendulums: a body, and what acts on it. Numbers are in SI units, and angles are
# measured from the downward vertical.

from math import pi

import matplotlib.pyplot as plt
import numpy as np

from cellmap import plot, trajectory
from systems import Chain, Gravity, Pendulum, VerticalDrive, ViscousDamping, scene

rod = Pendulum(length=0.0272)
drive = VerticalDrive(amplitude=0.003, frequency=50.0)
pendulum = scene(rod, Gravity(9.8), drive, ViscousDamping(10.0), name="driven pendulum")
print(pendulum)

motion = trajectory(pendulum, [[0.9 * pi, 0.0], [0.5 * pi, 0.0]], periods=60, samples_per_period=40)
plt.figure(figsize=(6.4, 3), layout="constrained")
plt.plot(motion.times, motion.states[:, :, 0] / pi, label=[r"from $0.9\,\pi$", r"from $0.5\,\pi$"])
plt.gca().set(xlabel="t (s)", ylabel=r"$\theta/\pi$", title="Two releases from rest")
plt.legend()
# sphinx_gallery_alt = "Angle against time: one orbit settles upside down, the other hangs down"

# %%
# Released 18 degrees from the upright position, the rod settles upside down. From the horizontal it falls. The small
# ripple has the frequency of the drive.
#
# Where is the inverted state stable?
# -----------------------------------
#
# The inverted state is an equilibrium at all parameters. Its Floquet multipliers decide its stability:

from cellmap import stability_map, stroboscopic_map
from cellmap.bifurcations import floquet_multipliers

for amplitude in (0.002, 0.003):
    found = floquet_multipliers(pendulum.with_params(amplitude=amplitude), [pi, 0.0])
    print(f"{1e3 * amplitude:.0f} mm:", np.round(found.multipliers, 4))

# %%
# At 2 mm one multiplier is larger than 1; at 3 mm both are inside the unit circle. A map over frequency and
# amplitude shows the whole region, and its lower boundary agrees with Kapitza's law for a fast drive, :math:`A\,\omega =
# \sqrt{2 g \ell}`.

frequency = ("frequency", np.linspace(20, 80, 61))
amplitude = ("amplitude", np.linspace(0.5e-3, 14e-3, 61))
ax = plot.stability_map(stability_map(pendulum, [pi, 0.0], frequency, amplitude))
ax.set(xlabel="frequency (Hz)", ylabel="amplitude (m)")
f = np.linspace(20, 80, 100)
ax.plot(f, np.sqrt(2 * 9.8 * 0.0272) / (2 * pi * f), "k:")
ax.annotate("Kapitza's law", (50, 0.0025), (55, 0.005), arrowprops={"arrowstyle": "-"})
# sphinx_gallery_alt = "Region of frequency and amplitude in which the inverted state is stable, with Kapitza's law as a dotted line"

# %%
# The exact boundaries at 50 Hz are bifurcations of the inverted state:

from cellmap import continue_orbit, periodic_orbit

strobe = stroboscopic_map(pendulum)
upright = continue_orbit(strobe, periodic_orbit(strobe, [pi, 0.0]), "amplitude", 1e-3, 14e-3)
for bifurcation in upright.bifurcations:
    print(f"{bifurcation.kind.value} at {1e3 * bifurcation.value:.6f} mm")

# %%
# Basins: figure 19
# -----------------
#
# Which initial conditions lead to the inverted state? Four amplitudes, each over the whole circle and angular velocities
# within 100 rad/s:

from cellmap import CellGrid, find_basins, interpolated_map

window = CellGrid(lower=(-pi, -100), upper=(pi, 100), shape=(200, 200))
nodes = CellGrid(lower=(-pi, -200), upper=(pi, 200), shape=(200, 200))
fig, axes = plt.subplots(1, 4, figsize=(11, 3), sharey=True, layout="constrained")
for ax, millimetres in zip(axes, (2, 3, 4, 10), strict=True):
    exact = stroboscopic_map(pendulum.with_params(amplitude=1e-3 * millimetres))
    basins = find_basins(interpolated_map(exact, nodes), window)
    plot.basins(basins, ax=ax, legend=False)
    ax.set_title(f"{millimetres} mm")
    ax.label_outer()
    inverted = [k for k, a in enumerate(basins.attractors) if a.period == 1 and abs(a.points[0, 0]) > 3]
    cells = sum(int((basins.labels == k).sum()) for k in inverted)
    print(f"{millimetres} mm: {len(basins.attractors)} attractors, {cells} of 40,000 cells lead to the inverted state")
# sphinx_gallery_alt = "Basins at 2, 3, 4 and 10 mm: one colour, a smooth inverted basin that grows, and a fractal mixture"
# sphinx_gallery_thumbnail_number = 3

# %%
# The number 7,104 at 3 mm is that of an independent program. At 10 mm a swing of four periods coexists with
# both equilibria, and the boundaries are fractal.
#
# Flipping modes of a double pendulum
# -----------------------------------
#
# Two links have four equilibria: each link can hang or stand. With one link up and one down the report calls
# the modes *flipping*. A fast drive can stabilise all four.

links = Chain(lengths=(0.032, 0.032), masses=(1.0, 0.25))
double = scene(links, Gravity(9.8), VerticalDrive(0.006, 50.0), ViscousDamping(10.0), name="double pendulum")
for state in ([0, 0, 0, 0], [0, pi, 0, 0], [pi, 0, 0, 0], [pi, pi, 0, 0]):
    largest = np.abs(floquet_multipliers(double, state).multipliers).max()
    print(f"outer link {'up' if state[1] else 'down'}, inner link {'up' if state[0] else 'down'}: {largest:.4f}")

at_rest = CellGrid(lower=(-pi, -pi, -1, -1), upper=(pi, pi, 1, 1), shape=(25, 25, 1, 1))
flipping = find_basins(stroboscopic_map(double), at_rest)
plot.basins(flipping)
# sphinx_gallery_alt = "Basins of the four equilibria of the double pendulum over both angles, released at rest"

# %%
# All largest multipliers are below 1: both flipping modes are stable.
#
# Where to go next
# ----------------
#
# - :doc:`/scenes`: springs, dry friction, other drives, chains of any length.
# - :doc:`/bifurcations`: branches of rotations and swings, period-doubling cascades.
# - :doc:`/laboratory`: the parameters of a real rod from a film.
# - :doc:`/gallery`: the studies that reproduce the figures of the report.
