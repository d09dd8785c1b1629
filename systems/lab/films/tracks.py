"""Tracks of markers through a film, what was seen of them frame by frame, and what rods and rails add to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from math import hypot

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cellmap.utils import finite_number, whole_number

from ..arrays import Floats


class MarkerStatus(IntEnum):
    """What is known of a marker in a frame."""

    SEEN = 0
    """Seen whole."""
    CONSTRAINED = 1
    """Not seen; its place follows from rods and rails."""
    PARTIAL = 2
    """Seen in part: its blob is too small, or touches the border of the image."""
    MERGED = 3
    """In one blob with something else."""
    LOST = 4
    """Not found, or something that stands was found in its place."""
    NO_FRAME = 5
    """The frame is missing, or repeats the one before in the middle of a motion."""


@dataclass(frozen=True)
class Rod:
    """A rod that holds a marker at a known distance from its pivot.

    Parameters
    ----------
    marker : int
        Number of the marker at its end.
    pivot : int or tuple of float
        Number of the marker at its pivot, or the pixel (column, row) of a pivot without one.
    length : float
        Length (pixels), above 0.
    travel : float, optional
        How far a pivot without a marker moves up and down from its pixel (pixels).
    """

    marker: int
    pivot: int | tuple[float, float]
    length: float
    travel: float = 0.0

    def __post_init__(self) -> None:
        whole_number("marker", self.marker)
        finite_number("length", self.length, above=0.0)
        finite_number("travel", self.travel, at_least=0.0)
        if isinstance(self.pivot, tuple):
            if len(self.pivot) != 2:
                raise ValueError(f"pivot={self.pivot!r}: give the pixel (column, row), or the number of a marker")
            for k in range(2):
                finite_number(f"pivot[{k}]", self.pivot[k])
        elif whole_number("pivot", self.pivot) >= self.marker:
            raise ValueError(f"pivot={self.pivot}: count markers from the pivot outwards, below marker={self.marker}")

    def misfit(self, place: tuple[float, float], pivot: tuple[float, float]) -> float:
        """Return by how much the distance between marker and pivot, wherever it may be, differs from the length."""
        across, below = place[0] - pivot[0], place[1] - pivot[1]
        farthest = hypot(across, abs(below) + self.travel)
        nearest = hypot(across, max(abs(below) - self.travel, 0.0))
        return max(nearest - self.length, self.length - farthest, 0.0)


@dataclass(frozen=True)
class Rail:
    """A marker that moves only vertically.

    Parameters
    ----------
    marker : int
        Its number.
    column : float
        Its column (pixels).
    """

    marker: int
    column: float

    def __post_init__(self) -> None:
        whole_number("marker", self.marker)
        finite_number("column", self.column)


@dataclass(frozen=True)
class Gap:
    """Frames in a row in which a marker's place is not known.

    Parameters
    ----------
    marker : int
        Its number.
    first, last : int
        First and last of the frames.
    seconds : float
        Time from the last known place to the next; infinite where there is none.
    """

    marker: int
    first: int
    last: int
    seconds: float


@dataclass(frozen=True, eq=False)
class Tracks:
    """Places of markers in a film.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times of the frames (s).
    positions : ndarray, shape (n, markers, 2)
        Pixels (column, row), NaN unless the status is SEEN or CONSTRAINED.
    errors : ndarray, shape (n, markers, 2)
        Their standard errors (pixels): from the noise of the pixels, and from where a disc's edge, sharp or soft, falls
        on them.  For each marker, across and down, they are widened to the scatter of 40 places or more about a smooth
        motion, which is larger for squares along the pixels or compressed frames; not where frames follow each other so
        slowly that they do not show the motion, nor where what moves slowly stays long on the same pixels.  Light that
        changes evenly across a marker is reckoned with: one that is a tenth or three tenths brighter on one side than
        in its middle is found to 0.01 pixels at a radius of 5.  What is left stays the same from frame to frame and is
        not in the errors: about 0.1 pixels where a shadow's edge lies on a marker, where its radius of 3 is spread by
        1.2, and where slopes are hardly beyond the noise, 0.2 where it is brighter by a fifth on one side and moves by
        its radius during an exposure or is saturated.  NaN for plain centroids.
    status : ndarray of uint8, shape (n, markers)
        A :class:`MarkerStatus` each.
    centroids : ndarray, shape (n, markers, 2)
        Centroids of what was seen, of PARTIAL and MERGED blobs too, which are not the centres of the markers.
    areas : ndarray, shape (n, markers)
        Areas of these blobs, over those that the markers should have; NaN where none was seen.
    threshold : float
        Grey value above which markers were looked for.
    """

    times: Floats
    positions: Floats
    errors: Floats
    status: NDArray[np.uint8]
    centroids: Floats
    areas: Floats
    threshold: float

    def __repr__(self) -> str:
        seen = (self.status == MarkerStatus.SEEN).sum(axis=0)
        fractions = ", ".join(f"{count:,}" for count in seen)
        return f"Tracks({len(self.times):,} frames, {self.status.shape[1]} markers seen whole in {fractions} of them)"

    @property
    def gaps(self) -> list[Gap]:
        """Frames in which places are not known, marker by marker."""
        known = self.status <= MarkerStatus.CONSTRAINED
        found = []
        for marker in range(known.shape[1]):
            edges = np.flatnonzero(np.diff(np.concatenate([[True], known[:, marker], [True]]).astype(np.int8)))
            for first, past in edges.reshape(-1, 2):
                whole = first > 0 and past < len(self.times)
                seconds = float(self.times[past] - self.times[first - 1]) if whole else np.inf
                found.append(Gap(marker, int(first), int(past) - 1, seconds))
        return found


def pivot_on_rail(ends: ArrayLike, length: float, column: float, near: float) -> tuple[Floats, Floats]:
    """Return the pivot that moves only vertically, from the other end of its rod.

    Two points of the column are at this distance from each end.  From frame to frame the point nearest to the one
    before is taken.  Where the rod lies so flat that the two are within a tenth of its length they are ambiguous;
    over each run of frames between such ones, and between gaps, the points that stay nearest to the row `near`
    are taken, if the others go at least twice as far from it.

    Parameters
    ----------
    ends : array_like, shape (n, 2)
        Pixels (column, row) of the rod's end; NaN where it is not known.
    length : float
        Length of the rod (pixels).
    column : float
        Column in which the pivot moves.
    near : float
        Row near which it is.

    Returns
    -------
    pivots : ndarray, shape (n, 2)
        Pixels of the pivot; NaN where the end is not known, is farther than `length` from the column, the rod lies
        too flat, or for so short a time otherwise that the two points cannot be distinguished.
    slopes : ndarray, shape (n,)
        Change of the pivot's row for each pixel by which the end moves to the right, by which errors grow.

    Examples
    --------
    >>> pivots, slopes = pivot_on_rail([[130.0, 140.0], [128.0, 141.0]], length=50.0, column=100.0, near=100.0)
    >>> pivots[0]
    array([100., 100.])
    >>> slopes[:1]
    array([0.75])
    """
    places = np.asarray(ends, np.float64)
    if places.ndim != 2 or places.shape[1] != 2:
        raise ValueError(f"ends have the shape {places.shape}: give pixels, as (n, 2)")
    length = finite_number("length", length, above=0.0)
    column, near = finite_number("column", column), finite_number("near", near)
    pivots, slopes = np.full(places.shape, np.nan), np.full(len(places), np.nan)
    across, rows = places[:, 0] - column, places[:, 1]
    squares = length**2 - across**2
    known = np.isfinite(rows) & (squares >= (0.05 * length) ** 2)
    up = np.sqrt(np.where(known, squares, 0.0))
    edges = np.flatnonzero(np.diff(known, prepend=False, append=False))
    for first, past in edges.reshape(-1, 2).tolist():
        signs, row = np.ones(past - first), near
        for k in range(first, past):
            above = abs(rows[k] - up[k] - row) <= abs(rows[k] + up[k] - row)
            signs[k - first] = 1.0 if above else -1.0
            row = rows[k] - signs[k - first] * up[k]
        part = slice(first, past)
        far, other = (float(np.abs(rows[part] - s * up[part] - near).max()) for s in (signs, -signs))
        if min(far, other) > 0.5 * max(far, other):
            continue
        signs *= 1.0 if far < other else -1.0
        pivots[part, 0], pivots[part, 1] = column, rows[part] - signs * up[part]
        slopes[part] = signs * across[part] / up[part]
    return pivots, slopes


def place_hidden(tracks: Tracks, rods: Sequence[Rod], rails: Sequence[Rail], near: float) -> Tracks:
    """Fill in hidden pivots that move only vertically, from the ends of their rods (status CONSTRAINED).

    Parameters
    ----------
    tracks : Tracks
        Tracks with gaps.
    rods : sequence of Rod
        Rods; those whose pivot is a marker on a rail are used.
    rails : sequence of Rail
        Markers that move only vertically.
    near : float
        Row near which the pivot is, for the choice between the two solutions.

    Returns
    -------
    Tracks
        Tracks in which such markers have places wherever an end was seen, with standard errors from that of the end.
        Frames where the solution is not sure stay as they were.

    References
    ----------
    The scheme is that of the report, section IV C.
    """
    positions, errors, status = tracks.positions.copy(), tracks.errors.copy(), tracks.status.copy()
    for rail in rails:
        for rod in (rod for rod in rods if rod.pivot == rail.marker):
            places, slopes = pivot_on_rail(positions[:, rod.marker], rod.length, rail.column, near)
            known = np.isfinite(slopes) & (tracks.status[:, rod.marker] == MarkerStatus.SEEN)
            hidden = known & np.isin(status[:, rail.marker], (2, 3, 4))
            across, down = tracks.errors[hidden, rod.marker].T
            positions[hidden, rail.marker] = places[hidden]
            errors[hidden, rail.marker, 0] = 0.0
            errors[hidden, rail.marker, 1] = np.hypot(down, slopes[hidden] * across)
            status[hidden, rail.marker] = MarkerStatus.CONSTRAINED
    return replace(tracks, positions=positions, errors=errors, status=status)
