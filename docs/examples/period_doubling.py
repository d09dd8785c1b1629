"""
Period doubling and chaos
=========================

Every value of the parameter is one orbit; the lower panel has its largest Lyapunov exponent.
"""

import numpy as np

from cellmap import bifurcation_diagram, periodic_orbit, plot
from cellmap.bifurcations import period_doubling_cascade
from systems import logistic_map

mu = np.linspace(2.8, 4.0, 601)
diagram = bifurcation_diagram(logistic_map(), "mu", mu, initial_conditions=[0.3], follow="none")
plot.bifurcation_diagram(diagram)
start = logistic_map(2.8)
route = period_doubling_cascade(start, periodic_orbit(start, [0.6]), "mu", 3.6, doublings=5)
print("ratios", route.ratios.round(3), "accumulation", round(route.accumulation, 6))
# sphinx_gallery_alt = "Bifurcation diagram of the logistic map, with the largest Lyapunov exponent below"
