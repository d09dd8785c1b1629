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
from .basins import find_basins as find_basins
from .bifurcation_curve import BifurcationCurve as BifurcationCurve
from .bifurcation_curve import continue_bifurcation as continue_bifurcation
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
from .pointmap import Iterate as Iterate
from .pointmap import PointMap as PointMap
from .pointmap import Status as Status
from .pointmap import ToleranceWarning as ToleranceWarning
from .rebuild import rebuild_map as rebuild_map
from .rebuild import recompute_basins as recompute_basins
from .search import find_attractors as find_attractors
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
    from .plot import animate as animate
    from .plot import plot_basin_continuation as plot_basin_continuation
    from .plot import plot_basins as plot_basins
    from .plot import plot_bifurcation_diagram as plot_bifurcation_diagram
    from .plot import plot_branches as plot_branches
    from .plot import plot_phase_portrait as plot_phase_portrait
    from .plot import plot_stability_map as plot_stability_map
    from .plot import plot_time_series as plot_time_series
    from .store import StoreError as StoreError
    from .store import load_basins as load_basins
    from .store import save_basins as save_basins

__version__ = "0.1.0"

_LATE = {
    **dict.fromkeys(
        (
            "plot_basins",
            "plot_basin_continuation",
            "plot_bifurcation_diagram",
            "plot_branches",
            "plot_stability_map",
            "plot_time_series",
            "plot_phase_portrait",
            "animate",
        ),
        "plot",
    ),
    **dict.fromkeys(("load_basins", "save_basins", "StoreError"), "store"),
}
"""Names whose modules load matplotlib or h5py, and load only when they are used."""

__all__ = [  # noqa: RUF022 (in the order of use)
    "ForcedSystem",
    "Coordinate",
    "angle",
    "CellGrid",
    "stroboscopic_map",
    "discrete_map",
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
    "Basins",
    "bifurcation_diagram",
    "BifurcationDiagram",
    "continue_basins",
    "BasinContinuation",
    "ContinuationInterrupt",
    "plot_basins",
    "plot_bifurcation_diagram",
    "plot_basin_continuation",
    "plot_branches",
    "plot_stability_map",
    "plot_time_series",
    "plot_phase_portrait",
    "animate",
    "save_basins",
    "load_basins",
    "StoreError",
    "rebuild_map",
    "recompute_basins",
    "set_threads",
    "thread_count",
]


def __getattr__(name: str) -> Any:
    if name in _LATE:
        return getattr(import_module(f".{_LATE[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
