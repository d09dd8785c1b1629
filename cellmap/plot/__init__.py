"""Pictures, with matplotlib."""

from .animation import animate as animate
from .basins import plot_basins as plot_basins
from .bifurcations import plot_branches as plot_branches
from .bifurcations import plot_stability_map as plot_stability_map
from .diagram import plot_bifurcation_diagram as plot_bifurcation_diagram
from .global_continuation import plot_basin_continuation as plot_basin_continuation
from .motion import plot_phase_portrait as plot_phase_portrait
from .motion import plot_time_series as plot_time_series
