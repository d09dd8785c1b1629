"""The way to a picture that reaches a wanted accuracy in the least time, from small measurements."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any

from .basin_finding import find_basins
from .basins import Basins
from .checks import finite_number, in_bytes, one_of, whole_number
from .cost_model import SAFETY, Measurements, Option, choose, options_of
from .grid import CellGrid
from .interpolated import interpolated_map
from .pointmap import PointMap
from .probing import Job, exact_maps, measure, percentile_error, places_in
from .system import ForcedSystem
from .threads import progress_bar

_DECADES = range(-3, 4)


class AccuracyWarning(UserWarning):
    """No way to a picture is expected to be as accurate as wanted."""


@dataclass(frozen=True)
class Step:
    """What an accuracy costs.

    Parameters
    ----------
    accuracy : float
        Largest error of a period.
    option : Option
        The fastest way that meets it, or the most accurate one.
    met : bool
        Whether it is expected to.
    """

    accuracy: float
    option: Option
    met: bool

    @property
    def seconds(self) -> float:
        """Seconds from nothing to the picture."""
        return self.option.seconds


@dataclass(frozen=True)
class Outcome:
    """What became of a plan.

    Parameters
    ----------
    predicted_seconds, seconds : float
        Time that was expected, and time that was taken.
    predicted_error, error : float
        Error that was expected, and error that is measured, as :attr:`Option.error`.
    accuracy : float
        Error that was wanted.
    """

    predicted_seconds: float
    seconds: float
    predicted_error: float
    error: float
    accuracy: float

    @property
    def time_ratio(self) -> float:
        """Time that was expected for each second that was taken."""
        return self.predicted_seconds / self.seconds

    @property
    def met(self) -> bool:
        """Whether the measured error is within the wanted one."""
        return self.error <= self.accuracy

    def __str__(self) -> str:
        return (
            f"predicted {self.predicted_seconds:.3g} s, took {self.seconds:.3g} s (ratio {self.time_ratio:.2f}); "
            f"predicted error {self.predicted_error:.1e}, measured {self.error:.1e}, wanted {self.accuracy:.1e}"
        )


@dataclass(frozen=True, eq=False)
class Plan:
    """How to make a picture: see :func:`plan`.

    Parameters
    ----------
    accuracy : float
        Largest error of a period that is wanted, at 99 % of the places.
    chosen : Option
        The fastest way that is expected to meet it; where none is, the most accurate one.
    met : bool
        Whether it is expected to.
    options : tuple of Option
        All that is worth while: by method, and by order of the tables, from fast and rough to slow and accurate.
    steps : tuple of Step
        What accuracies cost from a thousandth to a thousand times the wanted one.
    measurements : Measurements
        What the plan rests on.
    job : object
        The maps and the picture.
    """

    accuracy: float
    chosen: Option
    met: bool
    options: tuple[Option, ...]
    steps: tuple[Step, ...]
    measurements: Measurements
    job: Job = field(repr=False)

    @property
    def seconds(self) -> float:
        """Seconds that the picture is expected to take."""
        return self.chosen.seconds

    @property
    def memory(self) -> int:
        """Bytes that it is expected to need."""
        return self.chosen.memory

    def __repr__(self) -> str:
        return f"Plan({self.chosen}: error {self.chosen.error:.1e}, {self.seconds:.2g} s, {in_bytes(self.memory)})"

    def __str__(self) -> str:
        rows = [("accuracy", "seconds", "error", "memory", "by")]
        rows += [
            (
                f"{step.accuracy:.1e}",
                f"{step.seconds:.3g}",
                f"{step.option.error:.1e}",
                in_bytes(step.option.memory),
                str(step.option)
                + ("" if step.met else " (does not reach it)")
                + (" <- wanted" if step.accuracy == self.accuracy else ""),
            )
            for step in self.steps
        ]
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        lines = ["  ".join([*(row[k].rjust(widths[k]) for k in range(4)), row[4]]) for row in rows]
        closed = [f"{o}: {o.obstacle}" for o in self.options if o.obstacle]
        m = self.measurements
        window = ", ".join(f"[{a:.4g}, {b:.4g}]" for a, b in zip(m.window.lower, m.window.upper, strict=True))
        head = f"{m.starts:,} starts of {m.periods:.3g} periods; tables on {window}, {100 * m.outside:.2g} % outside"
        return "\n".join([head, *lines, *closed[:3]])

    def at(self, accuracy: float) -> Plan:
        """Return the plan for another accuracy, from the same measurements.

        Parameters
        ----------
        accuracy : float
            Largest error of a period, above 0.

        Returns
        -------
        Plan
            The plan; without a warning where it is not met.
        """
        return _planned(self.job, self.measurements, finite_number("accuracy", accuracy, above=0.0))

    def map(self, progress: bool = False) -> PointMap:
        """Return the map that was chosen.

        Parameters
        ----------
        progress : bool, optional
            Show a bar on a terminal for work of more than two seconds.

        Returns
        -------
        PointMap
            An exact map, or a table.
        """
        option = self.chosen
        exact = self.job.sources[option.method, option.tolerance]
        if option.order is None or option.shape is None:
            return exact
        window = self.measurements.window
        nodes = CellGrid(window.lower, window.upper, option.shape)
        return interpolated_map(exact, nodes, option.order, self.job.outside, progress=progress)

    def basins(self, progress: bool = False, **settings: Any) -> Basins:
        """Find the basins of the picture by the map that was chosen.

        Parameters
        ----------
        progress : bool, optional
            Show a bar on a terminal for work of more than two seconds.
        **settings : object
            Further arguments of :func:`find_basins`.

        Returns
        -------
        Basins
            The picture.
        """
        return find_basins(self.map(progress), self.job.grid, progress=progress, **settings)

    def outcome(self, result: Basins | PointMap, seconds: float | None = None, seed: int = 1) -> Outcome:
        """Compare what was expected with what came of it.

        Parameters
        ----------
        result : Basins or PointMap
            What :meth:`basins` or :meth:`map` has returned.
        seconds : float, optional
            Time that it took; by default what the result says of its cost: for basins with their table, for a map that
            of the table alone.
        seed : int, optional
            Seed of the places at which the error is measured; not those of the probes.

        Returns
        -------
        Outcome
            Seconds and errors, with their ratios.

        Raises
        ------
        TypeError, ValueError
            For something else, or basins without their map.
        """
        if not isinstance(result, Basins | PointMap):
            raise TypeError(f"result={result!r}: give the Basins or the PointMap that came of the plan")
        point_map = result.point_map if isinstance(result, Basins) else result
        if point_map is None:
            raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
        expected = self.seconds if isinstance(result, Basins) or seconds is not None else self.chosen.tabulation
        if seconds is None:
            seconds = point_map.cost.seconds + (result.cost.seconds if isinstance(result, Basins) else 0.0)
        places = places_in(self.measurements.window, seed)
        return Outcome(
            predicted_seconds=expected,
            seconds=max(seconds, 1e-9),
            predicted_error=self.chosen.error,
            error=percentile_error(point_map, self.job.reference, places),
            accuracy=self.accuracy,
        )


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
    if not isinstance(system, ForcedSystem | PointMap):
        raise TypeError(f"system={system!r}: give a ForcedSystem or an exact PointMap")
    if isinstance(system, PointMap) and system.table is not None:
        raise TypeError(f"system={system!r} is a table already: give the exact map that it was made from")
    if not isinstance(grid, CellGrid):
        raise TypeError(f"grid={grid!r}: give a CellGrid")
    if window is not None and not isinstance(window, CellGrid):
        raise TypeError(f"window={window!r}: give a CellGrid")
    accuracy = finite_number("accuracy", accuracy, above=0.0)
    periods = None if periods is None else whole_number("periods", periods, at_least=1)
    one_of("outside", outside, ("escape", "integrate"))
    seed = whole_number("seed", seed)
    coordinates = system.coordinates if isinstance(system, PointMap) else system.axes
    grid = grid.on(coordinates)
    if window is not None:
        window = window.on(coordinates)
    sources, reference = exact_maps(system, phase)
    job = Job(sources, reference, grid, periods, outside, seed)
    with progress_bar(len(sources) + 5, f"planning {reference.name}" if progress else None) as tick:
        measured = measure(job, window, lambda _: tick(1))
    planned = _planned(job, measured, accuracy)
    if not planned.met:
        warnings.warn(
            f"accuracy={accuracy:g} is not expected to be reached: the most accurate way, {planned.chosen}, has an "
            f"error of about {planned.chosen.error:.1e} and has to stay {SAFETY:g} times below; ask for less",
            AccuracyWarning,
            stacklevel=2,
        )
    return planned


def _planned(job: Job, measured: Measurements, accuracy: float) -> Plan:
    options = options_of(measured)
    chosen, met = choose(options, accuracy)
    steps = []
    for k in reversed(_DECADES):
        option, reached = choose(options, accuracy * 10.0**k)
        steps.append(Step(accuracy * 10.0**k, option, reached))
    return Plan(accuracy, chosen, met, options, tuple(steps), measured, job)
