"""Pictures, with matplotlib."""

from .animation import animate as animate
from .basins import plot_basins as plot_basins
from .bifurcations import plot_branches as plot_branches
from .bifurcations import plot_stability_map as plot_stability_map
from .boundary_measures import plot_basin_entropy as plot_basin_entropy
from .boundary_measures import plot_uncertainty_exponent as plot_uncertainty_exponent
from .boundary_measures import plot_wada as plot_wada
from .boundary_objects import plot_boundary_distance as plot_boundary_distance
from .boundary_objects import plot_chaotic_saddle as plot_chaotic_saddle
from .boundary_objects import plot_edge_orbit as plot_edge_orbit
from .boundary_objects import plot_manifolds as plot_manifolds
from .diagram import plot_bifurcation_diagram as plot_bifurcation_diagram
from .dimensions import plot_generalized_dimensions as plot_generalized_dimensions
from .dimensions import plot_kaplan_yorke as plot_kaplan_yorke
from .fields import plot_chaos_test as plot_chaos_test
from .fields import plot_exponent_field as plot_exponent_field
from .fields import plot_lyapunov_spectrum as plot_lyapunov_spectrum
from .fits import plot_fit as plot_fit
from .global_continuation import plot_basin_continuation as plot_basin_continuation
from .motion import plot_phase_portrait as plot_phase_portrait
from .motion import plot_time_series as plot_time_series
from .resilience import plot_ball as plot_ball
from .resilience import plot_basin_stability as plot_basin_stability
from .resilience import plot_fatal_shock as plot_fatal_shock
from .resilience import plot_settling_times as plot_settling_times
from .resilience import plot_tipping as plot_tipping
