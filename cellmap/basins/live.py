"""Basin images of a family of maps, drawn again and again while parameters, phase and window change."""

from __future__ import annotations

import functools
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.checks import finite_number, parameter_values, whole_number
from .._lib.signatures import checked
from .._lib.stopping import Stop, Stopped
from ..attractors.continued import continue_attractors
from ..attractors.labels import LABEL_NAMES
from ..attractors.matching import persistent_labels, thinned
from ..attractors.search import find_attractors, longest_period, region_extent
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..maps.stroboscopic import carried
from ..orbits.attractor import Attractor
from .initial_conditions import Starts
from .refining import BasinFrame, refinement

_KEPT = 16  # maps that are kept with their attractors
_REMEMBERED = 1024  # points that are kept of an attractor that may come back
_SEEDS = 4  # points of an attractor that was lost from which it is sought


@dataclass(frozen=True, eq=False)
class LiveFrame(BasinFrame):
    """A basin image that is being refined, of one of a family of maps.

    Parameters
    ----------
    identities : tuple of int
        Identity of each attractor of `basins`: the number that it has kept since it was found first.
    attractors : mapping of int to Attractor
        All attractors that are known at these parameters, by identity, also those without an initial condition.
    born : tuple of int
        Identities of attractors that were not there in the complete frame before.
    gone : tuple of int
        Identities of attractors that were there, and are no more; known when the frame is complete.
    phase : float or None
        Phase of the forcing, None for the family's own.
    """

    identities: tuple[int, ...] = ()
    attractors: Mapping[int, Attractor] = field(default_factory=dict)
    born: tuple[int, ...] = ()
    gone: tuple[int, ...] = ()
    phase: float | None = None

    @property
    def identity_image(self) -> NDArray[np.int16]:
        """The image with identities in the place of labels."""
        numbers = np.array([*sorted(LABEL_NAMES), *self.identities], np.int16)
        return np.asarray(numbers[self.image - min(LABEL_NAMES)])


@dataclass(eq=False)
class _Place:
    """A map of the family, and its attractors with their identities as far as they are known.

    ``before``: attractors of the map before, by identity, at the phase of this one.
    """

    point_map: PointMap
    phase: float | None
    before: Mapping[int, Attractor]
    attractors: list[Attractor] = field(default_factory=list)
    identities: list[int] = field(default_factory=list)

    def known(self) -> dict[int, Attractor]:
        """Return the attractors by identity."""
        return dict(zip(self.identities, self.attractors, strict=True))

    def identity_of(self, attractor: Attractor) -> int | None:
        """Return the identity of an attractor, None if it has none."""
        return next((k for k, a in zip(self.identities, self.attractors, strict=True) if a is attractor), None)


class LiveFrames(Iterator[LiveFrame]):
    """Iterator over the frames of a request; see :meth:`LiveBasins.frames`."""

    def __init__(self, frames: Iterator[LiveFrame], stop: Stop) -> None:
        self._frames, self._stop = frames, stop

    def __next__(self) -> LiveFrame:
        return next(self._frames)

    def cancel(self) -> None:
        """End the iteration soon, from any thread."""
        self._stop.request()


class LiveBasins:
    """Basin images of a family of maps at changing parameters, phases and windows, for interactive programs.

    Attractors are followed from one request to the next, and keep their identity as long as they exist, and when they
    come back.  Maps that were asked for before are kept.  All methods may be called from several threads at once; a new
    request cancels the one before.

    Parameters
    ----------
    point_map : PointMap
        A map of the family: exact, interpolated or discrete.  An interpolated map is computed again on the same grid
        for other parameters.
    initial_conditions : CellGrid or array_like, shape (..., dimension)
        Initial conditions of requests that name no others.
    max_periods, max_period : int, optional
        As in :func:`find_basins`.
    threshold : float, optional
        Largest distance between attractors that count as the same one, as in :func:`continue_basins`.
    stride : int, optional
        Stride of the first frame, as in :func:`refine_basins`.

    Examples
    --------
    >>> from math import tanh
    >>> from cellmap import CellGrid, discrete_map
    >>> wells = discrete_map(lambda x, p: (tanh(p.a * x[0]),), {"a": 0.5}, ("x",), "wells")
    >>> live = LiveBasins(wells, CellGrid((-1,), (1,), (100,)))
    >>> live.image().basins
    Basins(wells, 100 initial conditions: fixed point (0) 100 %)
    >>> frame = live.image({"a": 1.5})
    >>> frame.identities, frame.born, frame.gone
    ((1, 2), (1, 2), (0,))
    >>> live.image({"a": 1.6}).identities
    (1, 2)
    """

    @checked
    def __init__(
        self,
        point_map: PointMap,
        initial_conditions: CellGrid | ArrayLike,
        max_periods: int = 2000,
        max_period: int = 32,
        threshold: float = 0.1,
        stride: int = 8,
    ) -> None:
        self._base, self._places = point_map, Starts.of(initial_conditions, point_map)
        self._limits = whole_number("max_periods", max_periods, at_least=1), longest_period(max_period)
        self._threshold, self._stride = finite_number("threshold", threshold, above=0.0), stride
        grid = self._places.grid
        corners = (
            np.array([grid.lower, grid.upper]) if grid is not None else self._places.points(slice(0, len(self._places)))
        )
        self._extent = region_extent(point_map, corners)
        self._making, self._guard = threading.Lock(), threading.RLock()
        self._newest = Stop()
        self._known: OrderedDict[Any, _Place] = OrderedDict()
        self._memory: dict[int, Attractor] = {}
        self._last: _Place | None = None  # made last
        self._reported: tuple[int, ...] = ()  # identities in the last complete frame

    def cancel(self) -> None:
        """End the present request soon, from any thread."""
        with self._guard:
            self._newest.request()

    def frames(
        self,
        params: Mapping[str, float] | None = None,
        *,
        phase: float | None = None,
        initial_conditions: CellGrid | ArrayLike | None = None,
        near: ArrayLike | None = None,
        interval: float | None = None,
        max_seconds: float | None = None,
    ) -> LiveFrames:
        """Return an iterator over images from coarse to fine, and cancel the request before.

        Parameters
        ----------
        params : mapping of str to float, optional
            Parameters with other values than those of the family's map.
        phase : float, optional
            Phase of the forcing at the section of a stroboscopic map, as a fraction of the period.
        initial_conditions : CellGrid or array_like, optional
            Another window.
        near, interval : optional
            As in :func:`refine_basins`.
        max_seconds : float, optional
            Time from this call on after which the iteration ends, with a frame of what is known by then.

        Returns
        -------
        LiveFrames
            Iterator over :class:`LiveFrame`.  The last frame is complete, with the labels of :func:`find_basins` for
            the attractors that were followed, unless the request is cancelled or its time is over.

        Raises
        ------
        TypeError, ValueError
            For arguments out of range.
        """
        changed = {} if params is None else parameter_values(params)
        if unknown := changed.keys() - self._base.params.keys():
            raise ValueError(f"params has no {sorted(unknown)}: this map has {sorted(self._base.params)}")
        phase = None if phase is None else finite_number("phase", phase)
        limit = None if max_seconds is None else finite_number("max_seconds", max_seconds, above=0.0)
        places = self._places if initial_conditions is None else Starts.of(initial_conditions, self._base)
        stop = Stop(limit)
        with self._guard:
            self._newest.request()
            self._newest = stop

        def made() -> Iterator[LiveFrame]:
            try:
                place = self._place(changed, phase, stop)
            except Stopped:
                if not stop.timed_out:
                    return
                place = _Place(self._base, phase, {})
            known = tuple(place.attractors)
            for frame in refinement(place.point_map, places, self._limits, known, self._stride, near, interval, stop):
                yield self._identified(frame, place)

        return LiveFrames(made(), stop)

    def image(self, params: Mapping[str, float] | None = None, **request: Any) -> LiveFrame | None:
        """Return the last of the :meth:`frames` of a request; None where it was cancelled before the first."""
        frame = None
        for frame in self.frames(params, **request):  # noqa: B007
            pass
        return frame

    def _place(self, changed: Mapping[str, float], phase: float | None, stop: Stop) -> _Place:
        """Return a map with the attractors that can be followed to it from the map before."""
        key = (tuple(sorted({**self._base.params, **changed}.items())), phase)
        with self._making:
            stop.check()
            place = self._known.pop(key, None)
            if place is None:
                spec = self._base.specified.with_params({**self._base.params, **changed}) if changed else None
                if phase is not None:
                    spec = (self._base.specified if spec is None else spec).with_phase(phase)
                point_map = self._base if spec is None else spec.build()
                stop.check()
                place = self._followed(point_map, phase)
            self._known[key] = self._last = place
            while len(self._known) > _KEPT:
                self._known.popitem(last=False)
            return place

    def _followed(self, point_map: PointMap, phase: float | None) -> _Place:
        """Return a map with the attractors that are found from where they were."""
        before = {} if self._last is None else self._last.known()
        if self._last is not None and phase != self._last.phase:
            with self._guard:
                carry = functools.partial(_carried, self._last.point_map, phase=phase or 0.0)
                self._memory = {k: carry(a) for k, a in self._memory.items()}
            before = {k: carry(a) for k, a in before.items()}
        found = continue_attractors(point_map, tuple(before.values()), self._extent) if before else ()
        regular = [a for a in before.values() if a.neighbourhood is not None or a.circle is not None]
        if len(found) < len(regular):
            seeds = np.concatenate([thinned(a.points, _SEEDS) for a in regular])
            found = find_attractors(point_map, seeds, *self._limits, attractors=found)
        place = _Place(point_map, phase, before)
        self._identify(place, found)
        return place

    def _identify(self, place: _Place, found: Sequence[Attractor]) -> None:
        """Give the attractors of a map that have none their identities."""
        with self._guard:
            fresh = [a for a in found if place.identity_of(a) is None]
            if not fresh:
                return
            taken = place.identities
            labels = persistent_labels(fresh, place.before, self._memory, self._extent, self._threshold, taken)
            for attractor, label in zip(fresh, labels, strict=True):
                place.attractors.append(attractor)
                place.identities.append(label)
                self._memory[label] = replace(attractor, points=thinned(attractor.points, _REMEMBERED), cover=None)

    def _identified(self, frame: BasinFrame, place: _Place) -> LiveFrame:
        """Return a frame with the identities of its attractors, and the news since the last complete frame."""
        with self._guard:
            self._identify(place, frame.basins.attractors)
            here = place.known()
            born = tuple(k for k in here if k not in self._reported)
            gone = tuple(k for k in self._reported if k not in here) if frame.complete else ()
            if frame.complete:
                self._reported = tuple(here)
        numbers = tuple(place.identities[place.attractors.index(a)] for a in frame.basins.attractors)
        return LiveFrame(
            frame.basins, frame.stride, frame.complete, frame.strides, numbers, here, born, gone, place.phase
        )


def _carried(point_map: PointMap, attractor: Attractor, phase: float) -> Attractor:
    """Return an attractor where the flow takes it until another phase of the forcing."""
    return replace(attractor, points=carried(point_map, attractor.points, phase), cover=None)
