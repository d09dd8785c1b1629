"""
Getting started
===============

From an equation of motion to a measured fractal dimension of a basin boundary, in a quarter of an hour. Every figure and
every printed line on this page was computed when the page was built.

Install the library with ``pip install .`` in a checkout. The first map of each new right-hand side is compiled, which
takes about a second; the result is kept on disk.

In a notebook each figure appears beneath its block. At Python's prompt and in a script, ``plt.show()`` after a block opens
it in a window; where there is none, ``plt.savefig("figure.png")`` writes it to a file.
"""

# %%
# The equation
# ------------
#
# The Duffing oscillator is a mass on a spring that stiffens as it is stretched, under viscous damping and a harmonic
# force:
#
# .. math:: \ddot q + \delta \dot q + \alpha q + \beta q^3 = \gamma \cos \omega t .
#
# Write it as a plain Python function of time, state and parameters that returns the derivative of each state variable.
# The values of the parameters and the period of the forcing complete the system.

from math import cos, pi

import matplotlib.pyplot as plt
import numpy as np

from cellmap import ForcedSystem


def duffing(t, x, p):
    q, v = x
    return v, -p.delta * v - p.alpha * q - p.beta * q**3 + p.gamma * cos(p.omega * t)


parameters = {"delta": 0.1, "alpha": 1.0, "beta": 1.0, "gamma": 0.3, "omega": 1.4}
spring = ForcedSystem(duffing, parameters, period=lambda p: 2 * pi / p.omega, coordinates=("q", "v"))
print(spring)

# %%
# One orbit and its Poincaré section
# ----------------------------------
#
# :func:`~cellmap.trajectory` integrates the motion. The state at the beginning of each forcing period is a point of the
# Poincaré section; ``motion.strobe`` has these points, and the plots mark them.

from cellmap import plot, trajectory

motion = trajectory(spring, [0.5, 0.0], periods=40, samples_per_period=50)
plot.time_series(motion, names=["q"])
# sphinx_gallery_alt = "Displacement against time: a beat that decays to a periodic oscillation; points mark each period"

# %%
# The transient decays, and the points of the section converge to a single point: a periodic orbit with the period of the
# forcing is a fixed point of the map from one section point to the next. That map is called the stroboscopic map, or
# Poincaré map.

from cellmap import stroboscopic_map

strobe = stroboscopic_map(spring)
print(strobe([0.5, 0.0]))  # after one period
print(strobe.iterate([0.5, 0.0], 200).points)  # after 200 periods

# %%
# Two initial conditions, two attractors
# --------------------------------------
#
# A second orbit begins at :math:`q = -1`. Both orbits are drawn over the last 5 of 100 periods.

both = trajectory(spring, [[0.5, 0.0], [-1.0, 0.0]], periods=100, samples_per_period=50)
fig, ax = plt.subplots(figsize=(5.5, 4.5), layout="constrained")
for k, name in enumerate(["from q = 0.5", "from q = -1"]):
    q, v = both.states[-250:, k].T
    ax.plot(q, v, label=name)
    ax.plot(*both.strobe[-1, k], "ko")

ax.set(xlabel="q", ylabel="v", title="Two limit cycles")
ax.legend()
print(both.strobe[-1].round(4))
# sphinx_gallery_alt = "Velocity against displacement: a small and a large closed curve, each with one point of the section"

# %%
# Whether the spring oscillates with a small or a large amplitude depends on its initial condition alone: bistability.
#
# Basins of attraction
# --------------------
#
# The *basin of attraction* of an attractor is the set of initial conditions whose orbits converge to it. A
# :class:`~cellmap.CellGrid` covers a window with 300 × 300 cells, and the centre of each cell is an initial condition.
# Instead of integrating 90,000 orbits, compute one period from each node of a grid once, interpolate, and iterate the
# interpolated map: this is *interpolated cell mapping* (Tongue and Gu 1988).

from cellmap import CellGrid, find_basins, interpolated_map

window = CellGrid(lower=(-2.5, -3.0), upper=(2.5, 3.0), shape=(300, 300))
icm = interpolated_map(strobe, window)
basins = find_basins(icm, window)
for attractor in basins.attractors:
    print(attractor)

plot.basins(basins)
# sphinx_gallery_alt = "Basins of the two limit cycles: that of the small one is a tongue that spirals round the other"

# %%
# The number of attractors need not be known beforehand. The multipliers of both are inside the unit circle: both are stable.
#
# How sure can we be?
# -------------------
#
# :meth:`~cellmap.Basins.verify` repeats random initial conditions by exact integration. It prints how many labels
# differ, with a 95 % confidence interval of the fraction.

print(f"largest error of one interpolated period: {icm.error().largest:.0e}")
check = basins.verify(1000)
print(f"{check.wrong} of {check.compared} labels differ; the fraction is at most {check.high:.4f}")

# %%
# A parameter: hysteresis
# -----------------------
#
# A slow sweep of the frequency, upwards and downwards, shows the jumps that an experiment shows. Between them
# both oscillations are stable.

from cellmap import bifurcation_diagram

omega = np.linspace(1.2, 1.9, 71)
sweep = bifurcation_diagram(strobe, "omega", omega, initial_conditions=[0.0, 0.0], transient=300, periods=64)
plot.bifurcation_diagram(sweep, coordinate="q", size=4)
up, down = sweep.points[:, :, -1]
bistable = omega[np.abs(up - down).max(axis=-1) > 1e-3]
print(f"two attractors from omega = {bistable[0]:.2f} to {bistable[-1]:.2f}")
# sphinx_gallery_alt = "Displacement against frequency: the upward and the downward sweep jump at different frequencies"

# %%
# How likely is each of them? :func:`~cellmap.basins.continue_basins` finds the attractors and the fraction of
# initial conditions that converge to each, for every value of the parameter.

from cellmap.basins import continue_basins

coarse = CellGrid(window.lower, window.upper, (30, 30))
fractions = continue_basins(strobe, "omega", np.linspace(1.2, 1.9, 15), coarse)
plot.basin_continuation(fractions)
print(fractions)
# sphinx_gallery_alt = "Basin fractions against frequency: the large oscillation loses its basin gradually to the small one"

# %%
# The large oscillation loses its basin long before it disappears, at the upper fold.
#
# The boundary is a stable manifold
# ---------------------------------
#
# Between two attractors there is a saddle: a periodic orbit that is unstable in one direction. The orbits that converge
# to it form its stable manifold, and this curve is the basin boundary. :func:`~cellmap.find_periodic_orbits` finds
# all fixed points of the map in the window, stable or not; :func:`~cellmap.analysis.boundary.saddle_manifold` grows the
# curve.

from cellmap import find_periodic_orbits
from cellmap.analysis.boundary import saddle_manifold

orbits = find_periodic_orbits(strobe, window)
for orbit in orbits:
    print(orbit)

saddle = next(orbit for orbit in orbits if orbit.kind == "saddle")
boundary = saddle_manifold(strobe, saddle, "stable", window, length=30)
plot.manifolds(boundary, basins=basins)
# sphinx_gallery_alt = "The basins, with the saddle and its stable manifold, which runs exactly along their boundary"
# sphinx_gallery_thumbnail_number = 6

# %%
# A fractal boundary
# ------------------
#
# With :math:`\alpha < 0` the spring has two wells. No new compilation is needed: ``with_params`` changes the values.

double_well = spring.with_params(alpha=-1.0, delta=0.15, gamma=0.2, omega=1.0)
square = CellGrid((-2.2, -2.2), (2.2, 2.2), (250, 250))
mixed = find_basins(interpolated_map(stroboscopic_map(double_well), square), square)
plot.basins(mixed)
# sphinx_gallery_alt = "Basins of the two wells, interwoven in fine filaments over most of the window"

# %%
# The boundary is fractal. If an initial condition is known to within :math:`\varepsilon`, its outcome is
# uncertain with a probability :math:`f(\varepsilon) \propto \varepsilon^a`, where :math:`a` is the *uncertainty exponent*
# (Grebogi, McDonald, Ott and Yorke 1983), and the dimension of the boundary is :math:`2 - a`.

from cellmap.analysis.fractal import uncertainty_exponent

uncertainty = uncertainty_exponent(mixed, max_pairs=200_000)
plot.uncertainty_exponent(uncertainty)
print(f"exponent {uncertainty.exponent:.2f}, dimension of the boundary {uncertainty.boundary_dimension:.2f}")
# sphinx_gallery_alt = "Fraction of uncertain pairs against their distance on logarithmic axes: a straight line of small slope"

# %%
# A hundred times better knowledge of the initial condition leaves two thirds of the uncertainty. On such a
# boundary single labels depend on the last digits, whatever the method, and basin fractions are what can be quoted:

check = mixed.verify(1000)
print(f"labels that differ: {100 * check.fraction:.0f} %")
for label, fraction in mixed.fractions.items():
    print(f"{mixed.label_name(label)}: {fraction.fraction:.3f} +- {fraction.standard_error:.3f}")

# %%
# Save and cite
# -------------
#
# Basins with their attractors, the map and its parameters go into one HDF5 file, from which they are loaded as they were.

from tempfile import TemporaryDirectory

from cellmap import load_basins, save_basins

with TemporaryDirectory() as folder:
    path = save_basins(basins, f"{folder}/duffing.h5")
    print(load_basins(path))

# %%
# If cellmap helps your research, please cite it: ``CITATION.cff`` in the repository has the entry.
#
# Where to go next
# ----------------
#
# - :doc:`/own-system`, a lesson, and :doc:`/how-to`, what to call for which task.
# - :doc:`/symptoms`: what to do when a result looks wrong.
# - :doc:`/concepts`: the ideas behind the words; :doc:`/which-function`: one table of what there is.
