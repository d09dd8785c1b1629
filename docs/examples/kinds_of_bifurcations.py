"""
Kinds of bifurcations
=====================

Each kind in the simplest map that has it, with stable parts solid.
"""

import matplotlib.pyplot as plt

from cellmap import continue_orbit, discrete_map, periodic_orbit, plot
from cellmap.bifurcations import switch_branch

simplest = {
    "fold": lambda x, p: (x[0] + p.q - x[0] ** 2,),
    "transcritical": lambda x, p: (x[0] + p.q * x[0] - x[0] ** 2,),
    "pitchfork": lambda x, p: (x[0] + p.q * x[0] - x[0] ** 3,),
    "period doubling": lambda x, p: (-(1 + p.q) * x[0] + x[0] ** 3,),
}
figure, axes = plt.subplots(1, 5, figsize=(13, 2.8), layout="constrained")
for ax, (kind, function) in zip(axes, simplest.items(), strict=False):
    fold = kind == "fold"
    one = discrete_map(function, {"q": 0.25 if fold else -0.25}, ("x",), name=kind)
    whole = continue_orbit(one, periodic_orbit(one, [0.5 if fold else 0.0]), "q", -0.3, 0.3)
    places = [] if fold else [(point, side) for point in whole.bifurcations for side in (1, -1)]
    further = [switch_branch(whole, point, -0.3, 0.3, side=side) for point, side in places]
    plot.branches([whole, *further], ax=ax, colour="C0", legend=False)
    ax.set_title(kind, fontsize="medium")

spiral = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[1]), x[0]), {"r": 2.1}, ("x", "y"), name="delayed logistic")
circle = spiral.orbit([0.6, 0.6], 3000).points[1000:]
axes[4].plot(*circle.T, ".", markersize=1.0)
axes[4].plot(*periodic_orbit(spiral, [0.52, 0.52]).points.T, "o", markerfacecolor="white", color="C0")
axes[4].set(xlabel="x", ylabel="y")
axes[4].set_title("Neimark-Sacker", fontsize="medium")
# sphinx_gallery_alt = "Fold, transcritical, pitchfork and period doubling against a parameter, and an invariant circle around a focus"
