"""Films of an experiment.

A place in an image is (column, row), in pixels.  Rows go down.  The centre of a pixel has whole numbers: the upper
left pixel reaches from -0.5 to 0.5 in both directions.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cellmap.utils import finite_number

from ..arrays import Bools, Floats

_DTYPES = (np.uint8, np.uint16, np.float32, np.float64)


@dataclass(frozen=True, eq=False)
class Film:
    """Grey frames with their times.

    Parameters
    ----------
    frames : ndarray, shape (n, height, width)
        Grey values: uint8, uint16, float32 or float64.  A frame of floats that holds a number that is not finite counts
        as missing.
    times : ndarray, shape (n,)
        Times of the middles of the exposures (s), strictly increasing.  They may be uneven, and frames that a camera
        has dropped may simply be absent.
    dropped : ndarray of bool, shape (n,), optional
        Frames known to be missing, whatever their grey values; by default none.
    exposure : float, optional
        Time for which each frame was exposed (s).  Markers smear while it lasts.

    Raises
    ------
    TypeError, ValueError
        For frames of another shape or kind of number, and for times that do not fit them or do not increase.

    Examples
    --------
    >>> Film(np.zeros((3, 4, 6), np.uint8), np.array([0.0, 0.1, 0.3]))
    Film(3 frames of 6 x 4 pixels, uint8, 0 to 0.3 s)
    >>> Film(np.zeros((3, 4, 6), np.uint8), np.array([0.0, 0.1, 0.1]))
    Traceback (most recent call last):
    ...
    ValueError: times[2]=0.1 follows 0.1: give times that strictly increase
    """

    frames: NDArray[Any]
    times: Floats
    dropped: Bools = field(default=None)  # type: ignore[arg-type]
    exposure: float = 0.0

    def __post_init__(self) -> None:
        frames = self.frames
        if not isinstance(frames, np.ndarray) or frames.dtype not in _DTYPES:
            kind = getattr(frames, "dtype", type(frames).__name__)
            raise TypeError(f"frames are {kind}: give an array of uint8, uint16, float32 or float64")
        if frames.ndim != 3 or not frames.size:
            raise ValueError(f"frames have the shape {frames.shape}: give grey frames, as (n, height, width)")
        times = _increasing("times", self.times, len(frames))
        dropped = np.zeros(len(frames), bool) if self.dropped is None else np.asarray(self.dropped)
        if dropped.dtype != bool or dropped.shape != (len(frames),):
            raise ValueError(
                f"dropped is {dropped.dtype} of shape {dropped.shape}: give one bool for each of the "
                f"{len(frames)} frames"
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "dropped", dropped.copy())
        object.__setattr__(self, "exposure", finite_number("exposure", self.exposure, at_least=0.0))

    def __repr__(self) -> str:
        count, height, width = self.frames.shape
        lost = f", {int(self.dropped.sum())} dropped" if self.dropped.any() else ""
        return (
            f"Film({count:,} frames of {width} x {height} pixels, {self.frames.dtype}, "
            f"{self.times[0]:g} to {self.times[-1]:g} s{lost})"
        )

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of a frame (pixels)."""
        return self.frames.shape[1], self.frames.shape[2]

    @property
    def missing(self) -> Bools:
        """Frames without an image, shape (n,): dropped ones, and those that hold numbers that are not finite."""
        if self.frames.dtype.kind != "f":
            return self.dropped.copy()
        return self.dropped | np.array([not np.isfinite(frame).all() for frame in self.frames])


def film_at_rate(
    frames: NDArray[Any], frame_rate: float, dropped: ArrayLike | None = None, exposure: float = 0.0
) -> Film:
    """Return the film of frames taken at even times, the first at 0.

    Parameters
    ----------
    frames : ndarray, shape (n, height, width)
        Grey values.
    frame_rate : float
        Frames a second, above 0.
    dropped : array_like of bool, shape (n,), optional
        Frames known to be missing.
    exposure : float, optional
        Time for which each frame was exposed (s).

    Returns
    -------
    Film
        The film.

    Raises
    ------
    TypeError, ValueError
        As for :class:`Film`.

    Examples
    --------
    >>> film_at_rate(np.zeros((11, 4, 6), np.uint8), frame_rate=200.0)
    Film(11 frames of 6 x 4 pixels, uint8, 0 to 0.05 s)
    """
    rate = finite_number("frame_rate", frame_rate, above=0.0)
    flags = None if dropped is None else np.array(dropped)
    return Film(frames, np.arange(len(frames)) / rate, flags, exposure)  # type: ignore[arg-type]


def select_frames(film: Film, chosen: ArrayLike) -> Film:
    """Return some of the frames of a film, with their times.

    Parameters
    ----------
    film : Film
        The film.
    chosen : array_like of bool, shape (n,), or of int
        Frames to keep, as flags or as rising numbers.

    Returns
    -------
    Film
        Film of these frames alone.

    Raises
    ------
    ValueError
        Where no frame is left, or numbers do not rise.

    Examples
    --------
    >>> film = film_at_rate(np.zeros((5, 4, 6), np.uint8), frame_rate=10.0)
    >>> select_frames(film, [0, 1, 4]).times
    array([0. , 0.1, 0.4])
    """
    index = np.asarray(chosen)
    return Film(film.frames[index], film.times[index], film.dropped[index], film.exposure)


def _increasing(name: str, given: ArrayLike, count: int) -> Floats:
    """Return `count` finite times that strictly increase, as a new array."""
    times = np.array(given, np.float64)
    if times.shape != (count,):
        raise ValueError(f"{name} have the shape {times.shape}: give one for each of the {count} frames")
    if not np.isfinite(times).all():
        k = int(np.flatnonzero(~np.isfinite(times))[0])
        raise ValueError(f"{name}[{k}]={times[k]}: give finite times")
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        k = int(back[0]) + 1
        raise ValueError(f"{name}[{k}]={times[k]:g} follows {times[k - 1]:g}: give times that strictly increase")
    return times
