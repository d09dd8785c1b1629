"""Choice of the fastest method that reaches a wanted accuracy, from small measurements."""

from __future__ import annotations

from ..._lib.checks import finite_number, one_of, warn_caller, whole_number
from ..._lib.randomness import Rng, random_seed
from ..._lib.signatures import checked
from ..._lib.threads import progress_bar
from ...maps.grid import CellGrid
from ...maps.point_map import PointMap
from ...maps.system import ForcedSystem
from .job import Job, exact_maps
from .options import SAFETY
from .plans import Plan, planned
from .probing import measure


class AccuracyWarning(UserWarning):
    """No method is expected to reach the accuracy wanted."""


@checked
def plan(
    system: ForcedSystem | PointMap,
    grid: CellGrid,
    accuracy: float = 1e-6,
    periods: int | None = None,
    phase: float = 0.0,
    region: CellGrid | None = None,
    outside: str = "integrate",
    *,
    rng: Rng = 0,
    progress: bool = False,
) -> Plan:
    """Choose a method for computing basins: integration method, tolerance, and an interpolated map or none.

    Small measurements are made on this machine, with the threads in use: errors and times of the integration methods at
    some tolerances, errors of coarse interpolation grids of each order, and the time for labelling few initial
    conditions.  Errors and times of all finer grids are extrapolated from these, and the fastest method that is
    accurate enough is chosen.

    Parameters
    ----------
    system : ForcedSystem or PointMap
        The system; or an exact map of it, which is then used as it is.
    grid : CellGrid
        Grid of cells whose centres are the initial conditions.
    accuracy : float, optional
        Largest error of one period that is allowed at 99 % of the points in the window of interpolation: the largest
        component of the difference to the true image, in the units of the coordinates, as
        ``MapError.percentile_99``.
    periods : int, optional
        Periods for which each initial condition is iterated; by default until :func:`find_basins` has labelled it.
    phase : float, optional
        Phase of the forcing at the section, as a fraction of the period; see :func:`stroboscopic_map`.
    region : CellGrid, optional
        Window of interpolation; its shape gives the proportion of the numbers of cells along the axes.  By default the
        window of `grid`, widened at each end beyond which more than one point in 500 of the orbits lies, by at most its
        width.
    outside : {"integrate", "escape"}, optional
        Treatment of orbits that leave the window; see :func:`interpolated_map`.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the random points at which errors are measured.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Plan
        The chosen method, all others, and the cost of higher and lower accuracies.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, an interpolated map, or a grid that does not fit the coordinates.
    MemoryError
        If no method fits into memory.

    Warns
    -----
    AccuracyWarning
        If no method is expected to reach the accuracy.

    Notes
    -----
    The measurements take some seconds, and as much again for each kernel that has to be compiled for the first time;
    they are worthwhile for basins that take longer to compute, and for many similar ones.  Predicted times assume the
    same load of the machine as during the measurements.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> def newton(x, p):
    ...     return x[0] / 2 + 1 / (2 * x[0]),
    >>> picture = CellGrid((1,), (3,), (100,))
    >>> planned = plan(discrete_map(newton, {}, ("x",)), picture, accuracy=1e-3)
    >>> planned.met, bool(planned.chosen.error <= 1e-3)
    (True, True)
    >>> planned.basins().fractions[0].fraction
    1.0
    """
    if isinstance(system, PointMap) and system.table is not None:
        raise TypeError(f"system={system!r} is an interpolated map: give the exact map behind it")
    if region is not None and not isinstance(region, CellGrid):
        raise TypeError(f"region={region!r}: give a CellGrid")
    accuracy = finite_number("accuracy", accuracy, above=0.0)
    periods = None if periods is None else whole_number("periods", periods, at_least=1)
    one_of("outside", outside, ("escape", "integrate"))
    seed = random_seed(rng)
    coordinates = system.coordinates if isinstance(system, PointMap) else system.axes
    grid = grid.on(coordinates)
    if region is not None:
        region = region.on(coordinates, "region")
    sources, reference = exact_maps(system, phase)
    job = Job(sources, reference, grid, periods, outside, seed)
    with progress_bar(len(sources) + 5, f"planning {reference.name}" if progress else None) as tick:
        measured = measure(job, region, lambda _: tick(1))
    found = planned(job, measured, accuracy)
    if not found.met:
        warn_caller(
            f"accuracy={accuracy:g} is not expected to be reached: the most accurate method, {found.chosen}, has an "
            f"error of about {found.chosen.error:.1e} and has to stay {SAFETY:g} times below; ask for less",
            AccuracyWarning,
        )
    return found
