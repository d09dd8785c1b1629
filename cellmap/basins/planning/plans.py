"""Plans: methods for computing basins with their predicted cost, and comparison with the outcome."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..._lib.checks import finite_number, in_bytes
from ..._lib.randomness import Rng, random_seed
from ..._lib.signatures import checked
from ...maps.grid import CellGrid
from ...maps.interpolation.interpolated import interpolated_map
from ...maps.point_map import PointMap
from ..finding import find_basins
from ..record import Basins
from .job import Job, percentile_error, places_in
from .measurements import Measurements
from .options import Option, choose, options_of

_DECADES = range(-3, 4)


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
