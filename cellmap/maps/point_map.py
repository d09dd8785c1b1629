"""Point maps: the one type for stroboscopic, Poincaré, interpolated and discrete maps (Hsu 1980)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._compiled.kernels.blocks import wrap_rows
from .._lib.arrays import Floats, Ints
from .._lib.checks import changed_parameters, claim_memory, parameters_in_words, warn_caller, whole_number
from .._lib.randomness import Rng, random_numbers
from .._lib.records import ShownAsHtml
from .._lib.signatures import checked
from .._lib.threads import progress_bar, run_over, slices
from .._lib.tiles import check_client, completed
from .cell_table import CellTable, MapError
from .compiled_advance import recorded
from .coordinates import Coordinate, difference, state_points, turns_of
from .orbit_batch import CHUNK, Cost, Orbits, Status
from .side_by_side import parts_of
from .specification import MapSpec


class ToleranceWarning(UserWarning):
    """Some orbits did not meet the tolerance of the integrator."""


@dataclass(frozen=True, eq=False)
class Iterate:
    """Images of points after some periods.

    Parameters
    ----------
    points : ndarray, shape (..., dimension)
        Images, angles wrapped; NaN where `status` is ESCAPED or a later one.
    rotations : ndarray of int, shape (..., dimension)
        Full rotations of each angle; ``points + rotations * period`` is the unwrapped image.
    status : ndarray of uint8, shape (...)
        A :class:`Status` for each orbit.
    coordinates : tuple of Coordinate
        Names and units of the last axis.
    """

    points: Floats
    rotations: Ints
    status: NDArray[np.uint8]
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        status = np.minimum(self.status, Status.ENDED)
        parts = [f"{np.count_nonzero(status == s)} {s.name.lower()}" for s in Status if (status == s).any()]
        return f"Iterate({', '.join(parts)})"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Floats:
        return np.array(self.points, dtype=dtype) if copy or dtype is not None else self.points

    @property
    def unwrapped(self) -> Floats:
        """Unwrapped images, full rotations included, shape (..., dimension)."""
        return self.points + self.rotations * turns_of(self.coordinates)[1]


@dataclass(frozen=True, eq=False)
class PointMap(ShownAsHtml):
    """A map of phase space to itself: stroboscopic, Poincaré, interpolated or discrete.

    Construct it with :func:`stroboscopic_map`, :func:`section_map`, :func:`interpolated_map` or :func:`discrete_map`.

    Parameters
    ----------
    name : str
        Name of the system.
    coordinates : tuple of Coordinate
        State variables.
    params : mapping of str to float
        Parameters of the system.
    advance : callable
        ``advance(orbits, periods)`` iterates a batch of at most CHUNK :class:`Orbits` in place; safe to call from
        several threads at once.  A kind of map of your own is a :class:`MapSpec`.
    period : float
        Time of one step; 1 for a discrete map.
    tolerance : tuple of float
        Relative and absolute error of one step of an exact map.
    exact : PointMap or None
        The exact map behind an interpolated map.
    table : CellTable or None
        Interpolation grid and coefficients of an interpolated map.
    tangent : callable or None
        ``tangent(points)`` returns unwrapped images (..., d) and derivative matrices (..., d, d) of one step.
    coarse_tangent : callable or None
        The same to the tolerance of the map, where `tangent` is finer and takes longer.
    stretch : callable or None
        ``stretch(orbits, frames, periods)`` iterates in place a batch of orbits and orthonormal frames (n, d, d) of
        tangent vectors, the columns; returns the logarithms (n, d) of the growth factors.  Without it `tangent` is
        used.
    cost : Cost
        Cost of constructing the map.
    max_step : int
        Number of periods that `advance` takes in one step where it can; 1 for all but interpolated maps.
    escapes : bool
        Whether orbits that leave the window of the table end there.
    is_flow : bool
        Whether the map follows the solutions of a differential equation, which cannot wind angles round each other.
    no_image : Status
        Status of an orbit where the map has no image: DIVERGED, or NO_RETURN for a Poincaré map.
    ends : tuple of str
        Names of the ends of orbits, in the order of their statuses from ENDED on.
    unknown_formulas : str
        Reason why the formulas of the right-hand side are not known, so that it is compiled as it is; empty if they are
        known, or not needed.

    Attributes
    ----------
    spec : MapSpec or None
        What the map is built from.  With it the map can be built again with other parameters, in other processes and
        from files; a map that was constructed or changed by hand has none.
    """

    _made_by: ClassVar = "stroboscopic_map or discrete_map"
    name: str
    coordinates: tuple[Coordinate, ...]
    params: Mapping[str, float]
    advance: Callable[[Orbits, int], None] = field(repr=False)
    period: float = 1.0
    tolerance: tuple[float, float] = (4e-16, 0.0)
    exact: PointMap | None = None
    table: CellTable | None = None
    tangent: Callable[[Floats], tuple[Floats, Floats]] | None = None
    coarse_tangent: Callable[[Floats], tuple[Floats, Floats]] | None = field(default=None, repr=False)
    stretch: Callable[[Orbits, Floats, int], Floats] | None = field(default=None, repr=False)
    cost: Cost = Cost()
    max_step: int = 1
    escapes: bool = False
    is_flow: bool = False
    no_image: Status = Status.DIVERGED
    ends: tuple[str, ...] = ()
    unknown_formulas: str = ""
    spec: MapSpec[PointMap] | None = field(default=None, init=False, repr=False)

    def __repr__(self) -> str:
        values = parameters_in_words(self.params)
        unknown = f"; formulas unknown, {self.unknown_formulas}" if self.unknown_formulas else ""
        return f"PointMap({self.recipe['kind']} of {self.name}: {values}{unknown})"

    @property
    def parameter_units(self) -> Mapping[str, str]:
        """Units of parameters by name, as far as the system of the map declares them."""
        system = getattr(self.without_table.spec, "system", None)
        return {} if system is None else dict(system.parameter_units)

    def __reduce__(self) -> tuple[Callable[[], PointMap], tuple[()]]:
        if self.spec is None:
            raise TypeError(
                f"{self!r} cannot be pickled for use in other processes: it was constructed or changed by hand; build "
                "it from a MapSpec"
            )
        return self.spec.build, ()

    @property
    def recipe(self) -> dict[str, Any]:
        """Plain values for a file, from which :func:`rebuild_map` builds the map again, given its system."""
        found = {"kind": "map"} if self.spec is None else self.spec.recipe
        return found | ({"end_names": list(self.ends)} if self.ends else {})

    @property
    def without_table(self) -> PointMap:
        """The exact map behind an interpolated map; an exact map itself."""
        return self.exact or self

    @property
    def dimension(self) -> int:
        """Number of state variables."""
        return len(self.coordinates)

    def with_params(self, values: Mapping[str, ArrayLike] | None = None, /, **changes: ArrayLike) -> PointMap:
        """Return the map with some parameters changed; an interpolated map is computed again.

        Parameters
        ----------
        values : mapping of str to float or array_like, optional
            New values by the names of parameters, ``with_params({"gamma": 0.3})``.
        **changes : float or array_like
            The same as keywords, which come after those of `values`.

        Raises
        ------
        ValueError
            For a name that the map does not have, or a map that was built without parameter dependence.
        """
        entries = changed_parameters(self.params, values, changes, "map")
        return self.specified.with_params({**self.params, **entries}).build()

    @property
    def specified(self) -> MapSpec[PointMap]:
        """The specification of a map that has one."""
        if self.spec is None:
            raise ValueError(
                f"{self!r} was built without parameter dependence: construct it with stroboscopic_map or discrete_map, "
                "or build it from a MapSpec"
            )
        return self.spec

    def __call__(self, points: ArrayLike) -> Floats:
        """Return the images of points after one period, shape (..., dimension); NaN where there is none."""
        images = follow(self, points, 1)
        warn_of_tolerance(images.status, self)
        return images.points

    @checked
    def iterate(self, points: ArrayLike, periods: int, progress: bool = False, client: Any = None) -> Iterate:
        """Return the images of points after a number of periods.

        Parameters
        ----------
        points : array_like, shape (..., dimension)
            Initial conditions; angles need not be wrapped.
        periods : int
            Steps of the map.
        progress : bool, optional
            Show a bar on a terminal for work of more than two seconds.
        client : distributed.Client, optional
            Dask cluster that iterates the points; by default the threads of this process do.

        Returns
        -------
        Iterate
            Images with full rotations and status.

        Warns
        -----
        ToleranceWarning
            If the integrator missed its tolerance; the images concerned have the status INACCURATE.
        """
        images = follow(self, points, periods, progress, client)
        warn_of_tolerance(images.status, self)
        warn_of_small_states(self)
        return images

    @checked
    def orbit(self, points: ArrayLike, periods: int, progress: bool = False) -> Iterate:
        """Return the orbits of points: all their images, with the number of the period on the first axis.

        Parameters
        ----------
        points : array_like, shape (..., dimension)
            Initial conditions.
        periods : int
            Steps of the map.
        progress : bool, optional
            Show a bar on a terminal for work of more than two seconds.

        Returns
        -------
        Iterate
            Arrays with a leading axis of length ``periods + 1``.
        """
        images = history(self, points, periods, progress)
        warn_of_tolerance(images.status[-1], self)
        warn_of_small_states(self)
        return images

    @checked
    def error(self, n_samples: int = 10_000, *, rng: Rng = 0) -> MapError:
        """Measure the error of one period of an interpolated map against the exact map.

        Points in fallback cells are counted and left out: there both maps are the same.

        Parameters
        ----------
        n_samples : int, optional
            Number of random points in the window of the interpolated map.
        rng : int, numpy.random.Generator or None, optional
            Seed or generator of the random points: with a seed, the default included, each call draws the same.

        Returns
        -------
        MapError
            Median, 99th percentile and maximum.

        Raises
        ------
        ValueError
            For an exact map.
        """
        if self.exact is None or self.table is None:
            raise ValueError(f"{self!r} is exact; only an interpolated map has an error to measure")
        n_samples = whole_number("n_samples", n_samples, at_least=1)
        grid = self.table.grid
        places = random_numbers(rng).uniform(grid.lower, grid.upper, (n_samples, self.dimension))
        exact = self.table.fallback.ravel()[grid.locate(places)]
        fallback, places = int(exact.sum()), places[~exact]
        shift = difference(self.iterate(places, 1).points, self.exact.iterate(places, 1).points, self.coordinates)
        errors = np.abs(shift).max(axis=-1)
        errors = errors[np.isfinite(errors)]
        if not errors.size:
            return MapError(np.nan, np.nan, np.nan, 0, fallback)
        median, high, largest = (float(q) for q in np.quantile(errors, (0.5, 0.99, 1.0)))
        return MapError(median, high, largest, errors.size, fallback)


def follow(point_map: PointMap, points: ArrayLike, periods: int, progress: bool = False, client: Any = None) -> Iterate:
    """Iterate points as :meth:`PointMap.iterate` does, without a warning of missed tolerances."""
    initial_conditions = state_points("points", points, point_map.coordinates)
    periods = whole_number("periods", periods)
    check_client(client)
    claim_memory(
        f"iterating {initial_conditions.size:,} numbers",
        3 * initial_conditions.nbytes,
        "iterate fewer points at a time",
    )
    orbits = Orbits.starting(initial_conditions.reshape(-1, point_map.dimension))
    orbits.wrap(*turns_of(point_map.coordinates))
    orbits.rotations[:] = 0
    label = f"{periods} periods of {point_map.name}" if progress else None
    parts = parts_of(orbits.points.shape, periods) if client is None else slices(len(orbits), CHUNK)
    work = _Advanced(point_map, periods, in_place=client is None)
    for number, images in completed(range(len(parts)), lambda k: orbits[parts[k]], work, client, label):
        if client is not None:
            orbits[parts[number]] = images
    shape = initial_conditions.shape
    return Iterate(
        initial_conditions, orbits.rotations.reshape(shape), orbits.status.reshape(shape[:-1]), point_map.coordinates
    )


@dataclass(frozen=True, eq=False)
class _Advanced:
    """Work of a tile: orbits moved on by some periods, `in_place` where they need not be kept for another worker."""

    point_map: PointMap
    periods: int
    in_place: bool

    def __call__(self, orbits: Orbits) -> Orbits:
        images = orbits if self.in_place else Orbits.joined([orbits])
        self.point_map.advance(images, self.periods)
        return images


def history(point_map: PointMap, points: ArrayLike, periods: int, progress: bool = False) -> Iterate:
    """Return all images of points, as :meth:`PointMap.orbit` does, without a warning."""
    initial_conditions = state_points("points", points, point_map.coordinates)
    periods = whole_number("periods", periods)
    needed = (periods + 1) * 2 * initial_conditions.nbytes
    claim_memory(
        f"orbits of {initial_conditions.size // point_map.dimension:,} points over {periods:,} periods",
        needed,
        "record less",
    )
    history = np.empty((periods + 1, initial_conditions.size // point_map.dimension, point_map.dimension))
    rotations = np.zeros(history.shape, np.int64)
    status = np.zeros(history.shape[:2], np.uint8)
    history[0] = initial_conditions.reshape(-1, point_map.dimension)
    lower, turn = turns_of(point_map.coordinates)
    wrap_rows(history[0], rotations[0], lower, turn)
    rotations[0] = 0
    label = f"orbits of {point_map.name}" if progress else None
    parts = parts_of(history.shape[1:], periods)
    with progress_bar(periods * len(parts), label) as tick:

        def follow_part(part: slice) -> None:
            orbits, done = Orbits(history[0, part].copy(), rotations[0, part].copy(), status[0, part].copy()), 1
            for places, turned, ended in recorded(point_map.advance, orbits, periods):
                now = slice(done, done + len(places))
                history[now, part], rotations[now, part], status[now, part] = places, turned, ended
                done += len(places)
                tick(len(places))

        run_over(parts, follow_part)
    shape = (periods + 1, *initial_conditions.shape)
    return Iterate(history.reshape(shape), rotations.reshape(shape), status.reshape(shape[:-1]), point_map.coordinates)


def warn_of_tolerance(status: NDArray[np.uint8], point_map: PointMap) -> None:
    """Warn where orbits of a map are INACCURATE or OUT_OF_STEPS, and say what helps."""
    name, unknown = point_map.name, point_map.unknown_formulas
    if missed := np.count_nonzero(status == Status.INACCURATE):
        remedy = remedy_for_missed(bool((status == Status.DIVERGED).any()), point_map)
        warn_caller(
            f"{missed} of {status.size} orbits of {name} did not meet the tolerance; their status says so: "
            + (f"branches are not located, for {unknown}" if unknown else remedy),
            ToleranceWarning,
        )
    if lost := np.count_nonzero(status == Status.OUT_OF_STEPS):
        warn_caller(
            f"{lost} of {status.size} orbits of {name} are out of steps, not at the end of a period or without a "
            f"correct digit: allow more with max_steps{_remedy_for_stiff(point_map)}",
            ToleranceWarning,
        )


def remedy_for_missed(diverge: bool, point_map: PointMap | None = None) -> str:
    """Say what helps where tolerances are missed; others of these orbits `diverge`, or none does."""
    if diverge:
        return (
            "others diverge, and near a singularity of the right-hand side no tolerance helps; end orbits before it, "
            "by ends={...} there"
        )
    return f"loosen rtol and atol, or allow more steps with max_steps{_remedy_for_stiff(point_map)}"


def _remedy_for_stiff(point_map: PointMap | None) -> str:
    """Name the method for stiff systems, where a map might take it and does not."""
    spec = None if point_map is None else point_map.without_table.spec
    return ", or give method='Rosenbrock' if the system is stiff" if spec is not None and spec.is_explicit else ""


def warn_of_small_states(point_map: PointMap) -> None:
    """Warn of coordinates that fell below their absolute tolerance and grew again: by how much is not known."""
    take_lost = getattr(point_map.advance, "take_lost", None)
    axes = getattr(point_map.advance, "axes", point_map.coordinates)  # of a section's system
    if take_lost and (lost := [axes[j].name for j in take_lost()]):
        warn_caller(
            f"{', '.join(lost)} of {point_map.name} fell below its atol for some time and grew again: what became of "
            f"it is not known. Give a smaller atol for this coordinate, atol={{{lost[0]!r}: ...}}, "
            "below its smallest values times rtol, or make its logarithm the coordinate"
            + getattr(point_map.advance, "hint", ""),
            ToleranceWarning,
        )
