"""Basin images of a family of maps, drawn again and again while parameters, phase and window change."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.checks import finite_number, parameter_values, whole_number
from .._lib.records import Keyed
from .._lib.signatures import checked
from .._lib.stopping import Stop, Stopped
from ..attractors.regions.extents import region_extent
from ..attractors.search import MAX_PERIODS, affordable_period
from ..attractors.settling.labels import LABEL_NAMES, Label
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .family import Family, Member
from .initial_conditions import InitialConditions
from .refining import BasinFrame, refinement

_PREVIEWED = 2  # strides that are drawn before anything is verified, all where a table's error is known
_SOON = 2**16  # initial conditions of a preview that takes a hundredth of a second: more would delay the verified image
_NOTHING = 2**62  # stride of an image in which nothing is labelled


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
    preview : bool
        Whether trapping regions are those of the parameters before, around the orbits of these ones, and the table is
        not examined yet, or combined from tables at other values of the one parameter that is being changed.  The
        frames that follow rest on what is verified, and on a table of their own.
    """

    identities: tuple[int, ...] = ()
    attractors: Mapping[int, Attractor] = field(default_factory=dict)
    born: tuple[int, ...] = ()
    gone: tuple[int, ...] = ()
    phase: float | None = None
    preview: bool = False

    @property
    def identity_image(self) -> NDArray[np.int16]:
        """The image with identities in the place of labels."""
        return self._identities_of(self.image)

    @property
    def identity_samples(self) -> NDArray[np.int16]:
        """Identities on the coarse grid alone, on which every initial condition has its label."""
        labels = self.basins.labels
        return self._identities_of(labels[(slice(None, None, self.stride),) * labels.ndim])

    @property
    def settled(self) -> bool:
        """Whether every initial condition has the label that it will have in the complete frame."""
        waiting = (self.basins.labels == Label.UNDECIDED) | (self.basins.labels == Label.UNLABELLED)
        return self.complete or (self.stride == 1 and not self.preview and not waiting.any())

    def _identities_of(self, labels: NDArray[np.int16]) -> NDArray[np.int16]:
        numbers = np.array([*sorted(LABEL_NAMES), *self.identities], np.int16)
        return np.asarray(numbers[labels - min(LABEL_NAMES)])


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
        for other parameters.  While one parameter is changed again and again, its previews come from tables over this
        parameter, and go down to every initial condition of images of up to 65,536.
    initial_conditions : CellGrid or array_like, shape (..., dimension)
        Initial conditions of requests that name no others.
    max_periods, longest_period : int, optional
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
        max_periods: int = MAX_PERIODS,
        longest_period: int = 32,
        threshold: float = 0.1,
        stride: int = 8,
    ) -> None:
        self._base, self._places = point_map, InitialConditions.of(initial_conditions, point_map)
        self._stride = stride
        self._limits = whole_number("max_periods", max_periods, at_least=1), affordable_period(longest_period)
        near = finite_number("threshold", threshold, above=0.0)
        self._family = Family(point_map, self._limits, region_extent(point_map, self._places.region), near)
        self._guard = threading.Lock()
        self._newest = Stop()
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
        places = self._places if initial_conditions is None else InitialConditions.of(initial_conditions, self._base)
        stop = Stop(limit)
        with self._guard:
            self._newest.request()
            self._newest = stop

        def frames_of(place: Member) -> Iterator[LiveFrame]:
            known, first = tuple(place.attractors), self._previewed(place, places) if place.draft else 1
            for frame in refinement(
                place.point_map, places, self._limits, known, self._stride, near, interval, stop, first
            ):
                yield self._identified(frame, place)

        def made() -> Iterator[LiveFrame]:
            finest = _NOTHING
            try:
                place = self._family.member(changed, phase, stop)
                if place.draft:
                    for frame in frames_of(place):
                        finest = frame.stride
                        yield frame
                        if finest <= max(1, self._stride >> (self._previewed(place, places) - 1)):
                            break
                    place = self._family.verified(place, stop)
            except Stopped:
                if finest < _NOTHING or not stop.timed_out:
                    return
                place = Member(self._base, phase, {})
            for frame in frames_of(place):
                if frame.stride <= finest or frame.complete:
                    yield frame

        return LiveFrames(made(), stop)

    def image(self, params: Mapping[str, float] | None = None, **request: Any) -> LiveFrame | None:
        """Return the last of the :meth:`frames` of a request; None where it was cancelled before the first."""
        frame = None
        for frame in self.frames(params, **request):  # noqa: B007
            pass
        return frame

    def _previewed(self, place: Member, places: InitialConditions) -> int:
        """Return how many strides of an image are drawn before anything is verified."""
        every = place.combined and len(places) <= _SOON
        return self._stride.bit_length() if every else _PREVIEWED

    def _identified(self, frame: BasinFrame, place: Member) -> LiveFrame:
        """Return a frame with the identities of its attractors, and the news since the last complete frame."""
        self._family.identify(place, frame.basins.attractors)
        with self._guard:
            here = place.known()
            born = tuple(k for k in here if k not in self._reported)
            gone = tuple(k for k in self._reported if k not in here) if frame.complete else ()
            if frame.complete:
                self._reported = tuple(here)
        identities = map(place.identity_of, frame.basins.attractors)
        numbers = tuple(k for k in identities if k is not None)  # all have one
        return LiveFrame(
            frame.basins,
            frame.stride,
            frame.complete,
            frame.strides,
            numbers,
            Keyed(here, "attractors", lambda: {k: a.name for k, a in here.items()}),
            born,
            gone,
            place.phase,
            place.draft,
        )
