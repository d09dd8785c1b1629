"""Basin images from coarse to fine."""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Floats
from .._lib.checks import finite_number, one_point, whole_number
from .._lib.computed import computed_once
from .._lib.signatures import checked
from .._lib.stopping import Stop
from ..attractors.given import check_attractors
from ..attractors.search import affordable_period
from ..attractors.settling.labels import LABEL_NAMES, Label
from ..maps.coordinates import difference
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, sort_key
from .finding import largest_number_of_periods
from .initial_conditions import InitialConditions
from .record import Basins
from .run import Run, label_store, new_numbers
from .strides import strided_tiles
from .sweeps import Progress


@dataclass(frozen=True, eq=False)
class BasinFrame:
    """A basin image that is being refined.

    Parameters
    ----------
    basins : Basins
        Labels as far as they are known, with -5 (unlabelled) for initial conditions that have not been reached, and -3
        (undecided) for those that have not settled so far; all attractors that are known.  In the last frame the basins
        are those that :func:`find_basins` returns.
    stride : int
        Every initial condition has a label whose place along each axis is one of the coarse grid of this stride.
    complete : bool
        Whether this is the last frame of an iteration that was not ended before.
    strides : tuple of int
        Strides from the first frame to the last.
    """

    basins: Basins
    stride: int
    complete: bool
    strides: tuple[int, ...]

    @computed_once
    def image(self) -> NDArray[np.int16]:
        """Labels in which each place without a label of its own takes that of the coarse block in which it lies."""
        labels = self.basins.labels
        if self.complete:
            return labels
        filled = np.full(labels.shape, Label.UNLABELLED, np.int16)
        for stride in (s for s in self.strides if 2 * s > self.stride or s == self.strides[0]):
            known = labels[tuple(slice(None, None, stride) for _ in labels.shape)]
            nearest = [
                np.minimum((np.arange(n) + stride // 2) // stride, m - 1)
                for n, m in zip(labels.shape, known.shape, strict=True)
            ]
            spread = known[np.ix_(*nearest)]
            filled = np.where(spread == Label.UNLABELLED, filled, spread)
        return filled


class _Strides:
    """How fine an image has become, from the tiles that are done."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._pass: Progress | None = None
        self._left: list[int] = []  # tiles of each stride that are to do in the present sweep
        self._ends = np.cumsum([len(group) for group in run.order]).tolist()

    def after(self, number: int) -> int:
        """Return the finest stride that is complete after a tile, twice the first one where none is."""
        groups, now = self._run.order, self._run.now
        if now is not self._pass:
            self._pass = now
            # Passes over what is left begin when every initial condition has been reached.
            self._left = [0 if now is None or now.tiles is None else len(group) for group in groups]
        if any(self._left):
            self._left[bisect_right(self._ends, number)] -= 1
        finished = next((k for k, left in enumerate(self._left) if left), len(groups))
        return 2 ** (len(groups) - finished)


class Refinement(Iterator[BasinFrame]):
    """Iterator over the frames of a basin image that is refined; see :func:`refine_basins`."""

    def __init__(self, run: Run, frames: Iterator[BasinFrame]) -> None:
        self._run, self._frames = run, frames

    def __next__(self) -> BasinFrame:
        return next(self._frames)

    def cancel(self) -> None:
        """End the iteration soon, from any thread; tiles that are under way are given up."""
        self._run.stop.request()


@dataclass(frozen=True, eq=False)
class _Frames:
    """What frames are made from.  An iterator over them refers to this alone, so that it ends when it is dropped."""

    run: Run
    known: tuple[Attractor, ...]
    settings: Mapping[str, Any]
    interval: float

    @property
    def strides(self) -> tuple[int, ...]:
        """Strides from the first frame to the last."""
        return tuple(2**k for k in reversed(range(len(self.run.order))))

    def made(self) -> Iterator[BasinFrame]:
        """Yield the frames."""
        run, began = self.run, time.perf_counter()
        done, stride, before = _Strides(run), 2 * self.strides[0], began
        try:
            for number in run.tiles(self.known):
                finer, late = done.after(number), time.perf_counter() - before > self.interval
                if (finer < stride or late) and not run.stop.requested:
                    stride = min(stride, finer)
                    yield self.frame(stride, time.perf_counter() - began)
                    before = time.perf_counter()
            if run.complete:
                yield BasinFrame(run.result(self.settings, time.perf_counter() - began), 1, True, self.strides)
            elif run.stop.timed_out:
                yield self.frame(stride, time.perf_counter() - began)
        finally:
            run.stop.request()

    def frame(self, stride: int, seconds: float) -> BasinFrame:
        """Return a frame of what is known now."""
        run = self.run
        attractors = self.known if run.now is None else run.now.attractors
        order = sorted(range(len(attractors)), key=lambda k: sort_key(attractors[k]))
        labels = run.store.labels.copy()
        if order != sorted(order):
            labels = new_numbers(order, np.arange(len(attractors)))[labels - min(LABEL_NAMES)]
        basins = replace(
            run.described(self.settings, seconds),
            labels=labels.reshape(run.store.shape),
            attractors=tuple(attractors[k] for k in order),
            settling_time=run.store.times.reshape(run.store.shape).copy(),
        )
        return BasinFrame(basins, stride, False, self.strides)


@checked
def refine_basins(
    point_map: PointMap,
    initial_conditions: CellGrid | ArrayLike,
    max_periods: int | None = None,
    longest_period: int = 32,
    attractors: Sequence[Attractor] = (),
    stride: int = 8,
    near: ArrayLike | None = None,
    interval: float | None = None,
    max_seconds: float | None = None,
) -> Refinement:
    """Find the basins of a map as :func:`find_basins` does, and return an iterator over images from coarse to fine.

    The first frame has labels of every eighth initial condition along each axis, the next ones of every fourth, second,
    and of all; each initial condition is labelled once, unless attractors are found later that may attract it too.
    Then initial conditions follow that take long, and the last frame, which has the bits of the result of
    :func:`find_basins`.  Nothing is computed before the first frame is asked for, and nothing more once the iterator is
    cancelled or dropped.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map.
    initial_conditions : CellGrid or array_like, shape (..., dimension)
        Grid of cells whose centres are the initial conditions, or the initial conditions themselves, in an array whose
        leading axes are those of the image.
    max_periods, longest_period : int, optional
        As in :func:`find_basins`.
    attractors : sequence of Attractor, optional
        Attractors that are known already, with their trapping regions.  With them the first frame does not wait for the
        search for further ones.
    stride : int, optional
        Distance between the initial conditions of the first frame, along each axis, a power of two.
    near : array_like, shape (dimension,), optional
        Point of phase space: tiles near it come first.  By default the middle of the image.
    interval : float, optional
        Seconds after which a further frame is yielded, though its stride is not complete.
    max_seconds : float, optional
        Time after which the iteration ends, with a frame of what is known by then.

    Returns
    -------
    Refinement
        Iterator over :class:`BasinFrame`.  Its method ``cancel`` ends the iteration from any thread.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.
    MemoryError
        If the labels do not fit into memory.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> newton = discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]),), {}, ("x",))
    >>> *_, last = refine_basins(newton, CellGrid((-3,), (3,), (100,)))
    >>> last.stride, last.complete, last.basins.fractions[0].fraction
    (1, True, 0.5)
    """
    limit = None if max_seconds is None else finite_number("max_seconds", max_seconds, above=0.0)
    check_attractors(attractors, point_map, "attractors")
    limits = largest_number_of_periods(max_periods), affordable_period(longest_period)
    places = InitialConditions.of(initial_conditions, point_map)
    return refinement(point_map, places, limits, attractors, stride, near, interval, Stop(limit))


def refinement(
    point_map: PointMap,
    places: InitialConditions,
    limits: tuple[int | None, int],
    attractors: Sequence[Attractor],
    stride: int,
    near: ArrayLike | None,
    interval: float | None,
    stop: Stop,
    first: int = 1,
) -> Refinement:
    """Return what :func:`refine_basins` does.

    ``limits``: as of :func:`find_basins`; ``stop``: a request to end; ``first``: strides that are labelled by known
    attractors before the search for others.
    """
    stride = whole_number("stride", stride, at_least=1, at_most=2**16)
    if stride & (stride - 1):
        raise ValueError(f"stride={stride}: give a power of two")
    often = inf if interval is None else finite_number("interval", interval, at_least=0.0)
    middle = None if near is None else _place(one_point("near", near, point_map.dimension), places, point_map)
    order = strided_tiles(places.shape, stride, middle)
    settings = {"max_periods": limits[0], "longest_period": limits[1], "map": dict(point_map.recipe)}
    store = label_store(point_map, places, settings, copies=3)  # a frame has labels and times of its own
    run = Run(point_map, places, store, *limits, stop=Stop(parent=stop), order=order, first=first)
    return Refinement(run, _Frames(run, tuple(attractors), settings, often).made())


def _place(near: Floats, places: InitialConditions, point_map: PointMap) -> tuple[int, ...]:
    """Return the place in the image that is nearest to a point."""
    rows = slice(0, len(places))
    if places.grid is not None:
        axes = [places.grid.axis(j) for j in range(places.grid.dimension)]
        shifts = [
            np.abs(difference(axis, x, (c,))) if c.period else np.abs(axis - x)
            for axis, x, c in zip(axes, near, point_map.coordinates, strict=True)
        ]
        return tuple(int(np.argmin(shift)) for shift in shifts)
    points = places.points(rows)
    extent = np.ptp(points, axis=0)
    apart = difference(points, near, point_map.coordinates) / np.where(extent > 0.0, extent, 1.0)
    nearest = int(np.argmin((apart**2).sum(axis=-1)))
    return tuple(int(i) for i in np.unravel_index(nearest, places.shape))
