"""Plans: the fastest method that reaches a wanted accuracy, and comparison with the outcome."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..._lib.checks import finite_number, in_bytes, one_of, warn_caller, whole_number
from ..._lib.randomness import Rng, random_seed
from ..._lib.signatures import checked
from ..._lib.threads import progress_bar
from ...maps.grid import CellGrid
from ...maps.interpolation.interpolated import interpolated_map
from ...maps.point_map import PointMap
from ...maps.system import ForcedSystem
from ..finding import find_basins
from ..record import Basins
from .predictions import SAFETY, Measurements, Option, choose, options_of
from .probes import Job, exact_maps, measure, percentile_error, places_in

_DECADES = range(-3, 4)


@dataclass(frozen=True)
class Step:
    """Cost of one accuracy: the cheapest method that reaches it.

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
        """Seconds for the basin image, computing the interpolation grid included."""
        return self.option.seconds


@dataclass(frozen=True)
class Outcome:
    """Comparison of a plan's predictions with its result.

    Parameters
    ----------
    predicted_seconds, seconds : float
        Predicted and measured time.
    predicted_error, error : float
        Predicted and measured error, as ``error`` of :class:`Option`.
    accuracy : float
        Accuracy wanted.
    """

    predicted_seconds: float
    seconds: float
    predicted_error: float
    error: float
    accuracy: float

    @property
    def time_ratio(self) -> float:
        """Ratio of the predicted to the measured time."""
        return self.predicted_seconds / self.seconds

    @property
    def met(self) -> bool:
        """Whether the measured error is at most the accuracy wanted."""
        return self.error <= self.accuracy

    def __str__(self) -> str:
        return (
            f"predicted {self.predicted_seconds:.3g} s, took {self.seconds:.3g} s (ratio {self.time_ratio:.2f}); "
            f"predicted error {self.predicted_error:.1e}, measured {self.error:.1e}, wanted {self.accuracy:.1e}"
        )


@dataclass(frozen=True, eq=False)
class Plan:
    """Choice of a method for computing basins: see :func:`plan`.

    Parameters
    ----------
    accuracy : float
        Largest error of a period that is allowed, at 99 % of the points.
    chosen : Option
        The fastest method that is expected to meet the accuracy; if there is none, the most accurate one.
    met : bool
        Whether the chosen method is expected to meet the accuracy.
    options : tuple of Option
        All Pareto-optimal methods: by integration method, and by order of interpolation, from fast to accurate.
    steps : tuple of Step
        Cost of accuracies from a thousandth to a thousand times the accuracy wanted.
    measurements : Measurements
        Measurements behind the plan.
    job : object
        The maps and the grid of initial conditions.
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
        """Predicted time in seconds."""
        return self.chosen.seconds

    @property
    def memory(self) -> int:
        """Predicted memory in bytes."""
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
        head = (
            f"{m.initial_conditions:,} initial conditions of {m.periods:.3g} periods; interpolation on {window}, "
            f"{100 * m.outside:.2g} % outside"
        )
        return "\n".join([head, *lines, *closed[:3]])

    @checked
    def at(self, accuracy: float) -> Plan:
        """Return the plan for another accuracy, from the same measurements.

        Parameters
        ----------
        accuracy : float
            Largest error of a period, above 0.

        Returns
        -------
        Plan
            The plan, without a warning if the accuracy is not met.
        """
        return planned(self.job, self.measurements, finite_number("accuracy", accuracy, above=0.0))

    @checked
    def map(self, progress: bool = False) -> PointMap:
        """Return the chosen map.

        Parameters
        ----------
        progress : bool, optional
            Show a bar on a terminal for work of more than two seconds.

        Returns
        -------
        PointMap
            An exact or an interpolated map.
        """
        option = self.chosen
        exact = self.job.sources[option.method, option.tolerance]
        if option.order is None or option.shape is None:
            return exact
        window = self.measurements.window
        nodes = CellGrid(window.lower, window.upper, option.shape)
        return interpolated_map(exact, nodes, option.order, self.job.outside, progress=progress)

    @checked
    def basins(self, progress: bool = False, **settings: Any) -> Basins:
        """Find the basins with the chosen map.

        Parameters
        ----------
        progress : bool, optional
            Show a bar on a terminal for work of more than two seconds.
        **settings : object
            Further arguments of :func:`find_basins`.

        Returns
        -------
        Basins
            Basins of the planned grid of initial conditions.
        """
        return find_basins(self.map(progress), self.job.grid, progress=progress, **settings)

    @checked
    def outcome(self, result: Basins | PointMap, seconds: float | None = None, *, rng: Rng = 1) -> Outcome:
        """Compare the predicted with the measured time and error.

        Parameters
        ----------
        result : Basins or PointMap
            Result of :meth:`basins` or :meth:`map`.
        seconds : float, optional
            Measured time; by default the cost recorded in the result, which for basins includes their interpolated map.
        rng : int, numpy.random.Generator or None, optional
            Seed or generator of the points at which the error is measured: not those of the plan's measurements.

        Returns
        -------
        Outcome
            Predicted and measured time and error.

        Raises
        ------
        TypeError, ValueError
            For a result of another type, or basins without their map.
        """
        point_map = result.point_map if isinstance(result, Basins) else result
        if point_map is None:
            raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
        expected = self.seconds if isinstance(result, Basins) or seconds is not None else self.chosen.tabulation
        if seconds is None:
            seconds = point_map.cost.seconds + (result.cost.seconds if isinstance(result, Basins) else 0.0)
        places = places_in(self.measurements.window, random_seed(rng))
        return Outcome(
            predicted_seconds=expected,
            seconds=max(seconds, 1e-9),
            predicted_error=self.chosen.error,
            error=percentile_error(point_map, self.job.reference, places),
            accuracy=self.accuracy,
        )


def planned(job: Job, measured: Measurements, accuracy: float) -> Plan:
    """Return the plan for an accuracy, from measurements."""
    options = options_of(measured)
    chosen, met = choose(options, accuracy)
    steps = []
    for k in reversed(_DECADES):
        option, reached = choose(options, accuracy * 10.0**k)
        steps.append(Step(accuracy * 10.0**k, option, reached))
    return Plan(accuracy, chosen, met, options, tuple(steps), measured, job)


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
