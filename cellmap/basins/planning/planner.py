"""The way to a picture that reaches a wanted accuracy in the least time, from small measurements."""

from __future__ import annotations

from ..._lib.checks import finite_number, one_of, warn_caller, whole_number
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
    """No way to a picture is expected to be as accurate as wanted."""


@checked
def plan(
    system: ForcedSystem | PointMap,
    grid: CellGrid,
    accuracy: float = 1e-6,
    periods: int | None = None,
    phase: float = 0.0,
    window: CellGrid | None = None,
    outside: str = "integrate",
    seed: int = 0,
    progress: bool = False,
) -> Plan:
    """Choose how to make a picture: method, tolerance, and order and size of a table, or none.

    Small probes are measured on this machine, with the threads in use: errors and times of the integration methods at
    some tolerances, errors of small tables of each order, and the time in which small pictures are labelled.  From
    these, errors and times of all larger tables follow, and the fastest way that is accurate enough is chosen.

    Parameters
    ----------
    system : ForcedSystem or PointMap
        The system; or an exact map of it, which is then used as it is.
    grid : CellGrid
        Cells of the picture, whose centres are the starts.
    accuracy : float, optional
        Largest error of one period that is wanted at 99 % of the places of the window of the tables: the largest
        component of the difference to the true image, in the units of the coordinates, as
        :attr:`MapError.percentile_99`.
    periods : int, optional
        Periods that each start is iterated; by default as many as it takes until :func:`find_basins` has labelled it.
    phase : float, optional
        Where in the forcing period the section lies, in turns; see :func:`stroboscopic_map`.
    window : CellGrid, optional
        Window of the tables; its shape gives the proportion of the numbers of cells along the axes.  By default the
        window of the picture, widened at each end beyond which more than one point in 500 of its orbits lies, by at
        most its width.
    outside : {"integrate", "escape"}, optional
        What becomes of orbits that leave the table; see :func:`interpolated_map`.
    seed : int, optional
        Seed of the random places at which errors are measured.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Plan
        The way that was chosen, all others, and what each step up or down in accuracy would cost.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, a map that is a table already, or a grid that does not fit the coordinates.
    MemoryError
        Where no way fits into memory.

    Warns
    -----
    AccuracyWarning
        Where no way is expected to reach the accuracy.

    Notes
    -----
    The probes take some seconds, and as much again for each kernel that has to be compiled for the first time; they pay
    for pictures that take longer, and for many of one kind.  Times hold for a machine that is as busy then as now.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> def newton(x, p):
    ...     return x[0] / 2 + 1 / (2 * x[0]),
    >>> picture = CellGrid((1,), (3,), (100,))
    >>> planned = plan(discrete_map(newton, {}, ("x",)), picture, accuracy=1e-3)
    >>> planned.met, bool(planned.chosen.error <= 1e-3)
    (True, True)
    >>> planned.basins().fractions[0].share
    1.0
    """
    if isinstance(system, PointMap) and system.table is not None:
        raise TypeError(f"system={system!r} is a table already: give the exact map that it was made from")
    if window is not None and not isinstance(window, CellGrid):
        raise TypeError(f"window={window!r}: give a CellGrid")
    accuracy = finite_number("accuracy", accuracy, above=0.0)
    periods = None if periods is None else whole_number("periods", periods, at_least=1)
    one_of("outside", outside, ("escape", "integrate"))
    seed = whole_number("seed", seed)
    coordinates = system.coordinates if isinstance(system, PointMap) else system.axes
    grid = grid.on(coordinates)
    if window is not None:
        window = window.on(coordinates, "window")
    sources, reference = exact_maps(system, phase)
    job = Job(sources, reference, grid, periods, outside, seed)
    with progress_bar(len(sources) + 5, f"planning {reference.name}" if progress else None) as tick:
        measured = measure(job, window, lambda _: tick(1))
    found = planned(job, measured, accuracy)
    if not found.met:
        warn_caller(
            f"accuracy={accuracy:g} is not expected to be reached: the most accurate way, {found.chosen}, has an "
            f"error of about {found.chosen.error:.1e} and has to stay {SAFETY:g} times below; ask for less",
            AccuracyWarning,
        )
    return found
