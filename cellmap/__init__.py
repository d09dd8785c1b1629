"""Global analysis of periodically forced dynamical systems by cell mapping.

A plain right-hand side becomes a :class:`ForcedSystem`, that a stroboscopic :class:`PointMap`, that an interpolated
cell map; attractors and basins are found on any of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .attractor import Attractor as Attractor
from .attractor import Kind as Kind
from .basin_continuation import BasinContinuation as BasinContinuation
from .basin_continuation import ContinuationInterrupt as ContinuationInterrupt
from .basins import Basins as Basins
from .basin_finding import find_basins as find_basins
from .bifurcation_curve import BifurcationCurve as BifurcationCurve
from .bifurcation_curve import continue_bifurcation as continue_bifurcation
from .certificate import Certificate as Certificate
from .certificate import Evidence as Evidence
from .certification import certify as certify
from .cells import CellChain as CellChain
from .cells import CellClass as CellClass
from .cells import generalized_cell_mapping as generalized_cell_mapping
from .cells import CellMapping as CellMapping
from .cells import simple_cell_mapping as simple_cell_mapping
from .crossings import Crossing as Crossing
from .curves import BoundaryCurve as BoundaryCurve
from .cascade import Cascade as Cascade
from .cascade import period_doubling_cascade as period_doubling_cascade
from .branch import Bifurcation as Bifurcation
from .branch import BifurcationKind as BifurcationKind
from .branch import Branch as Branch
from .continuation import continue_orbit as continue_orbit
from .continuation import switch_branch as switch_branch
from .coordinates import Coordinate as Coordinate
from .coordinates import angle as angle
from .diagram import BifurcationDiagram as BifurcationDiagram
from .diagram import bifurcation_diagram as bifurcation_diagram
from .discrete import discrete_map as discrete_map
from .floquet import FloquetResult as FloquetResult
from .floquet import floquet_multipliers as floquet_multipliers
from .global_continuation import continue_basins as continue_basins
from .grid import CellGrid as CellGrid
from .interpolated import interpolated_map as interpolated_map
from .jacobian import jacobian as jacobian
from .orbit import OrbitKind as OrbitKind
from .orbit import PeriodicOrbit as PeriodicOrbit
from .orbit import jury_margins as jury_margins
from .periodic_search import find_periodic_orbits as find_periodic_orbits
from .periodic_search import periodic_orbit as periodic_orbit
from .planning import AccuracyWarning as AccuracyWarning
from .planning import Option as Option
from .planning import Outcome as Outcome
from .planning import Plan as Plan
from .planning import plan as plan
from .pointmap import Iterate as Iterate
from .pointmap import PointMap as PointMap
from .orbit_batch import Status as Status
from .pointmap import ToleranceWarning as ToleranceWarning
from .rebuild import rebuild_map as rebuild_map
from .rebuild import recompute_basins as recompute_basins
from .search import find_attractors as find_attractors
from .section import Returns as Returns
from .section import SectionMap as SectionMap
from .section import flow_map as flow_map
from .section import section_map as section_map
from .stability import Boundary as Boundary
from .stability import CriticalValue as CriticalValue
from .stability import StabilityMap as StabilityMap
from .stability import critical_values as critical_values
from .stability import stability_map as stability_map
from .stroboscopic import stroboscopic_map as stroboscopic_map
from .sweep import swept_map as swept_map
from .system import ForcedSystem as ForcedSystem
from .threads import set_threads as set_threads
from .threads import thread_count as thread_count
from .trajectory import Trajectory as Trajectory
from .trajectory import trajectory as trajectory

if TYPE_CHECKING:
    from .analysis import Ball as Ball
    from .analysis import BasinEntropy as BasinEntropy
    from .analysis import BasinStability as BasinStability
    from .analysis import BoundaryDistance as BoundaryDistance
    from .analysis import BoxCount as BoxCount
    from .analysis import ChaosTest as ChaosTest
    from .analysis import ChaoticSaddle as ChaoticSaddle
    from .analysis import CorrelationSum as CorrelationSum
    from .analysis import EdgeOrbit as EdgeOrbit
    from .analysis import EscapeRate as EscapeRate
    from .analysis import ExponentField as ExponentField
    from .analysis import FatalShock as FatalShock
    from .analysis import Fit as Fit
    from .analysis import FractalTest as FractalTest
    from .analysis import GeneralizedDimensions as GeneralizedDimensions
    from .analysis import KaplanYorke as KaplanYorke
    from .analysis import LyapunovSpectrum as LyapunovSpectrum
    from .analysis import Manifold as Manifold
    from .analysis import ManifoldBranch as ManifoldBranch
    from .analysis import MergingTest as MergingTest
    from .analysis import SettlingStatistics as SettlingStatistics
    from .analysis import SettlingTimes as SettlingTimes
    from .analysis import Share as Share
    from .analysis import TippingProbabilities as TippingProbabilities
    from .analysis import UncertaintyExponent as UncertaintyExponent
    from .analysis import WadaGrid as WadaGrid
    from .analysis import alignment_test as alignment_test
    from .analysis import basin_entropy as basin_entropy
    from .analysis import basin_stability as basin_stability
    from .analysis import binomial_interval as binomial_interval
    from .analysis import boundary_dimension as boundary_dimension
    from .analysis import boundary_distance as boundary_distance
    from .analysis import box_dimension as box_dimension
    from .analysis import chaotic_saddle as chaotic_saddle
    from .analysis import correlation_dimension as correlation_dimension
    from .analysis import edge_orbit as edge_orbit
    from .analysis import escape_rate as escape_rate
    from .analysis import exponent_test as exponent_test
    from .analysis import finite_time_exponents as finite_time_exponents
    from .analysis import fit_line as fit_line
    from .analysis import fractal_boundary_test as fractal_boundary_test
    from .analysis import generalized_dimensions as generalized_dimensions
    from .analysis import image_uncertainty_exponent as image_uncertainty_exponent
    from .analysis import inverse_stroboscopic_map as inverse_stroboscopic_map
    from .analysis import kaplan_yorke_dimension as kaplan_yorke_dimension
    from .analysis import largest_ball as largest_ball
    from .analysis import local_integrity as local_integrity
    from .analysis import CovariantVectors as CovariantVectors
    from .analysis import covariant_vectors as covariant_vectors
    from .analysis import lyapunov_spectrum as lyapunov_spectrum
    from .analysis import minimal_fatal_shock as minimal_fatal_shock
    from .analysis import saddle_manifold as saddle_manifold
    from .analysis import settling_statistics as settling_statistics
    from .analysis import smooth_boundary_entropy as smooth_boundary_entropy
    from .analysis import tipping_probabilities as tipping_probabilities
    from .analysis import uncertainty_exponent as uncertainty_exponent
    from .analysis import wada_grid as wada_grid
    from .analysis import wada_merging as wada_merging
    from .analysis import zero_one_test as zero_one_test
    from .analysis import zero_one_test_of_series as zero_one_test_of_series
    from .plot import animate as animate
    from .plot import plot_basin_continuation as plot_basin_continuation
    from .plot import plot_basins as plot_basins
    from .plot import plot_certificate as plot_certificate
    from .plot import plot_plan as plot_plan
    from .plot import plot_basin_stability as plot_basin_stability
    from .plot import plot_settling_times as plot_settling_times
    from .plot import plot_fatal_shock as plot_fatal_shock
    from .plot import plot_ball as plot_ball
    from .plot import plot_tipping as plot_tipping
    from .plot import plot_edge_orbit as plot_edge_orbit
    from .plot import plot_manifolds as plot_manifolds
    from .plot import plot_boundary_distance as plot_boundary_distance
    from .plot import plot_chaotic_saddle as plot_chaotic_saddle
    from .plot import plot_bifurcation_diagram as plot_bifurcation_diagram
    from .plot import plot_branches as plot_branches
    from .plot import plot_chaos_test as plot_chaos_test
    from .plot import plot_exponent_field as plot_exponent_field
    from .plot import plot_covariant_vectors as plot_covariant_vectors
    from .plot import plot_lyapunov_spectrum as plot_lyapunov_spectrum
    from .plot import plot_fit as plot_fit
    from .plot import plot_uncertainty_exponent as plot_uncertainty_exponent
    from .plot import plot_basin_entropy as plot_basin_entropy
    from .plot import plot_wada as plot_wada
    from .plot import plot_generalized_dimensions as plot_generalized_dimensions
    from .plot import plot_kaplan_yorke as plot_kaplan_yorke
    from .plot import plot_phase_portrait as plot_phase_portrait
    from .plot import plot_stability_map as plot_stability_map
    from .plot import plot_time_series as plot_time_series
    from .plot import plot_boxes as plot_boxes
    from .plot import plot_eigenvalues as plot_eigenvalues
    from .plot import plot_eigenvector as plot_eigenvector
    from .plot import plot_morse_graph as plot_morse_graph
    from .sets import BoxSet as BoxSet
    from .sets import box_ftle as box_ftle
    from .sets import SubdivisionSearch as SubdivisionSearch
    from .sets import find_attractors_by_subdivision as find_attractors_by_subdivision
    from .sets import box_image as box_image
    from .sets import box_transitions as box_transitions
    from .sets import chain_recurrent_set as chain_recurrent_set
    from .sets import maximal_invariant_set as maximal_invariant_set
    from .sets import relative_attractor as relative_attractor
    from .sets import stable_set as stable_set
    from .sets import unstable_set as unstable_set
    from .sets import MorseGraph as MorseGraph
    from .sets import morse_graph as morse_graph
    from .sets import AlmostInvariant as AlmostInvariant
    from .sets import Cycle as Cycle
    from .sets import TransferOperator as TransferOperator
    from .sets import transfer_operator as transfer_operator
    from .plot import plot_cell_mapping as plot_cell_mapping
    from .plot import plot_absorption as plot_absorption
    from .plot import plot_invariant_measure as plot_invariant_measure
    from .store import StoreError as StoreError
    from .store import load_basins as load_basins
    from .store import save_basins as save_basins

__version__ = "0.1.0"

_STORED = ("load_basins", "save_basins", "StoreError")
_OF_SETS = (
    "BoxSet",
    "box_image",
    "box_transitions",
    "relative_attractor",
    "maximal_invariant_set",
    "chain_recurrent_set",
    "morse_graph",
    "MorseGraph",
    "unstable_set",
    "stable_set",
    "transfer_operator",
    "TransferOperator",
    "Cycle",
    "AlmostInvariant",
    "box_ftle",
    "find_attractors_by_subdivision",
    "SubdivisionSearch",
)

__all__ = [  # noqa: RUF022 (in the order of use)
    "ForcedSystem",
    "Coordinate",
    "angle",
    "CellGrid",
    "stroboscopic_map",
    "discrete_map",
    "flow_map",
    "section_map",
    "SectionMap",
    "Returns",
    "interpolated_map",
    "PointMap",
    "Iterate",
    "Status",
    "ToleranceWarning",
    "trajectory",
    "Trajectory",
    "jacobian",
    "swept_map",
    "floquet_multipliers",
    "FloquetResult",
    "critical_values",
    "CriticalValue",
    "Crossing",
    "stability_map",
    "StabilityMap",
    "Boundary",
    "BoundaryCurve",
    "periodic_orbit",
    "find_periodic_orbits",
    "PeriodicOrbit",
    "OrbitKind",
    "jury_margins",
    "continue_orbit",
    "Branch",
    "Bifurcation",
    "BifurcationKind",
    "switch_branch",
    "continue_bifurcation",
    "BifurcationCurve",
    "period_doubling_cascade",
    "Cascade",
    "find_attractors",
    "Attractor",
    "Kind",
    "find_basins",
    "certify",
    "Certificate",
    "Evidence",
    "Basins",
    "plan",
    "Plan",
    "Option",
    "Outcome",
    "AccuracyWarning",
    "simple_cell_mapping",
    "CellMapping",
    "generalized_cell_mapping",
    "CellChain",
    "CellClass",
    "bifurcation_diagram",
    "BifurcationDiagram",
    "continue_basins",
    "BasinContinuation",
    "ContinuationInterrupt",
    "covariant_vectors",
    "CovariantVectors",
    "lyapunov_spectrum",
    "LyapunovSpectrum",
    "finite_time_exponents",
    "ExponentField",
    "exponent_test",
    "zero_one_test",
    "alignment_test",
    "zero_one_test_of_series",
    "ChaosTest",
    "basin_stability",
    "BasinStability",
    "Share",
    "binomial_interval",
    "settling_statistics",
    "SettlingStatistics",
    "SettlingTimes",
    "minimal_fatal_shock",
    "FatalShock",
    "local_integrity",
    "largest_ball",
    "Ball",
    "tipping_probabilities",
    "TippingProbabilities",
    "edge_orbit",
    "EdgeOrbit",
    "saddle_manifold",
    "Manifold",
    "ManifoldBranch",
    "inverse_stroboscopic_map",
    "boundary_distance",
    "BoundaryDistance",
    "chaotic_saddle",
    "ChaoticSaddle",
    "escape_rate",
    "EscapeRate",
    "BoxSet",
    "box_image",
    "box_transitions",
    "relative_attractor",
    "maximal_invariant_set",
    "chain_recurrent_set",
    "morse_graph",
    "MorseGraph",
    "unstable_set",
    "stable_set",
    "transfer_operator",
    "TransferOperator",
    "Cycle",
    "AlmostInvariant",
    "box_ftle",
    "find_attractors_by_subdivision",
    "SubdivisionSearch",
    "boundary_dimension",
    "box_dimension",
    "BoxCount",
    "generalized_dimensions",
    "GeneralizedDimensions",
    "correlation_dimension",
    "CorrelationSum",
    "kaplan_yorke_dimension",
    "KaplanYorke",
    "fit_line",
    "Fit",
    "plot_basins",
    "plot_certificate",
    "plot_plan",
    "plot_bifurcation_diagram",
    "plot_basin_continuation",
    "plot_generalized_dimensions",
    "plot_kaplan_yorke",
    "uncertainty_exponent",
    "image_uncertainty_exponent",
    "UncertaintyExponent",
    "basin_entropy",
    "BasinEntropy",
    "fractal_boundary_test",
    "FractalTest",
    "smooth_boundary_entropy",
    "wada_merging",
    "MergingTest",
    "wada_grid",
    "WadaGrid",
    "plot_uncertainty_exponent",
    "plot_basin_entropy",
    "plot_wada",
    "plot_fit",
    "plot_branches",
    "plot_stability_map",
    "plot_time_series",
    "plot_basin_stability",
    "plot_settling_times",
    "plot_fatal_shock",
    "plot_ball",
    "plot_tipping",
    "plot_edge_orbit",
    "plot_manifolds",
    "plot_boundary_distance",
    "plot_chaotic_saddle",
    "plot_phase_portrait",
    "plot_covariant_vectors",
    "plot_lyapunov_spectrum",
    "plot_exponent_field",
    "plot_chaos_test",
    "plot_cell_mapping",
    "plot_absorption",
    "plot_invariant_measure",
    "animate",
    "plot_boxes",
    "plot_morse_graph",
    "plot_eigenvalues",
    "plot_eigenvector",
    "save_basins",
    "load_basins",
    "StoreError",
    "rebuild_map",
    "recompute_basins",
    "set_threads",
    "thread_count",
]


def __getattr__(name: str) -> Any:
    """Load names whose modules need matplotlib, h5py or much of SciPy when they are used."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    drawn = name.startswith("plot_") or name == "animate"
    home = "plot" if drawn else "store" if name in _STORED else "sets" if name in _OF_SETS else "analysis"
    return getattr(import_module(f".{home}", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
