"""
A power grid
============

Generators and consumers of a power grid turn in synchrony. A large disturbance of one of them may end that for all. This
tutorial goes from the swing equations to *single-node basin stability*: the probability that the grid returns to
synchrony after a random disturbance of one node (Menck, Heitzig, Marwan, Kurths, Nature Physics 9, 2013, 89).
"""

# %%
# The swing equations
# -------------------
#
# In the frame that rotates with the rated frequency, each machine has a phase :math:`\theta_k` and
#
# .. math:: \ddot\theta_k = P_k - \alpha\dot\theta_k + K \sum_l \sin(\theta_l - \theta_k).
#
# :func:`~systems.power_grid` has them. Here a generator, a consumer and another generator form a ring with a large grid,
# the infinite bus 0, whose phase does not change. A second consumer is connected by a single line: a *dead end*.

from math import pi

import matplotlib.pyplot as plt
import numpy as np

from cellmap import find_attractors, plot, stroboscopic_map
from systems import power_grid

grid = power_grid(
    powers=(1.0, -1.0, 1.0, -1.0),
    lines=((0, 1), (1, 2), (2, 3), (0, 3), (3, 4)),
    coupling=8.0,
    damping=0.1,
    frequency=2 * pi,
)
print(grid)

# %%
# Nothing is forced here, so that the period is merely that of sampling, 1.
#
# Linear stability
# ----------------
#
# Synchrony is a fixed point. Its Lyapunov exponents are all -damping/2: by linear stability, no node is weaker than
# another.

strobe = stroboscopic_map(grid)
synchrony = find_attractors(strobe, np.zeros((1, 8)))
print(synchrony[0].name)
print(np.round(synchrony[0].exponents, 6))

# %%
# Two disturbances
# ----------------
#
# A blow to the machine at the dead end, and one that is twice as hard. After the first, synchrony comes back. After the
# second, the machine turns at another frequency, about :math:`P/\alpha = -10`, for ever.

from cellmap import trajectory

disturbed = np.tile(synchrony[0].points[0], (2, 1))
disturbed[:, 7] = -7.0, -14.0
motion = trajectory(grid, disturbed, periods=40, samples_per_period=32)
plt.figure(figsize=(6.4, 3), layout="constrained")
plt.plot(motion.times, motion.states[:, :, 7], label=[r"$\omega_4(0) = -7$", r"$\omega_4(0) = -14$"])
plt.gca().set(xlabel="$t$", ylabel=r"$\omega_4$", title="After a blow to machine 4")
plt.legend()
# sphinx_gallery_alt = "Frequency of a machine against time: one oscillation decays to zero, the other stays near minus ten"

# %%
# Single-node basin stability
# ---------------------------
#
# For each machine, its phase and its frequency are drawn at random, and all others begin in synchrony. Only the
# attractor of interest is known, so that orbits to all others are followed for 200 periods, and are undecided then; the
# decay takes 20. They count as lost, and the upper ends of the intervals assume that they are not.

from cellmap.analysis.resilience import node_stability

nodes = {f"{k}": {f"theta_{k}": (-pi, pi), f"omega_{k}": (-15.0, 15.0)} for k in (1, 2, 3, 4)}
stability = node_stability(strobe, 0, nodes, 400, synchrony, max_periods=200)
print(stability)
ax = plot.node_stability(stability)
# sphinx_gallery_alt = "A bar for each of four machines: the probability that synchrony returns, between 0.7 and 0.8"

# %%
# With the same exponents, one disturbance in five to nearly one in three is fatal.
#
# Survivability
# -------------
#
# Protection switches a machine off whose frequency leaves its band, whether or not synchrony would return. Survivability
# is the probability that no machine does so (Hellmann et al., Scientific Reports 6, 2016, 29654): here that all stay
# within 8 after disturbances of machine 4 up to 8.

from cellmap.analysis.resilience import random_box, survivability

box = random_box(synchrony[0], nodes["4"] | {"omega_4": (-8.0, 8.0)})
band = {f"omega_{k}": (-8.0, 8.0) for k in (1, 2, 3, 4)}
survival = survivability(strobe, band, box, 400, periods=20)
print(survival)
ax = plot.survivability(survival)
# sphinx_gallery_alt = "Fraction of disturbances after which all frequencies stayed in their band, falling at first"

# %%
# More coupling
# -------------
#
# How much stronger do lines have to be? Basin stability of machine 4 over the coupling, with its standard errors:

couplings = (4.0, 8.0, 16.0, 32.0)
found = []
for coupling in couplings:
    changed = strobe.with_params(coupling=coupling)
    attractors = find_attractors(changed, np.zeros((1, 8)))
    found.append(node_stability(changed, 0, {"4": nodes["4"]}, 200, attractors, max_periods=200))

plt.figure(figsize=(5, 3), layout="constrained")
plt.errorbar(couplings, [f.fractions[0] for f in found], [f.standard_errors[0] for f in found], fmt="o-", capsize=3)
plt.gca().set(xlabel="coupling", ylabel="basin stability of machine 4", ylim=(0, 1.02))
# sphinx_gallery_alt = "Basin stability of a machine against the coupling, rising from two thirds to one"

# %%
# What cannot be concluded: fractions depend on the box from which disturbances are drawn. Other attractors than
# synchrony were not looked for; :func:`~cellmap.find_basins` of the same initial conditions, ``random_box(...)(0, 400)``,
# searches for them and tells which are verified.
