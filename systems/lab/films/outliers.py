"""What a whole track tells: repeated frames, areas that stand out, objects at rest, and how much places scatter."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..time_series import noise_level
from .tracks import MarkerStatus, Tracks

_NEIGHBOURS = (11, 13)  # in differences of places
_FEWEST = 40  # places; the scatter of as many is known to 15 % or so
_LEVEL = 0.85  # of the scatter among fewer neighbours: what falls farther with more of them is motion, not noise
# How much an area may differ from the usual one, at least and in standard deviations: anywhere, and beside flags.
_STANDS_OUT = (0.04, 4.5)
_DOUBTFUL = (0.02, 2.5)
_REPEATED = 5.0  # standard errors that markers move before and after a frame in which nothing does
_STILL = 0.25  # pixels within which a thing stands
_LONGER = 3.0  # times as long as the marker ever stood before
_MISSED = 20.0  # pixels, and
_MISSED_RADII = 4.0  # radii, that it would usually have moved meanwhile: six times what it does at a turning point


def flag_areas(tracks: Tracks) -> None:
    """Flag sights whose areas stand out among those of the marker, and less sure ones next to flagged frames."""
    for column, area in zip(tracks.status.T, tracks.areas.T, strict=True):
        seen = column == MarkerStatus.SEEN
        if not seen.any():
            continue
        away = area - np.median(area[seen])
        spread = 1.4826 * float(np.median(np.abs(away[seen])))
        limit, near = (max(least, times * spread) for least, times in (_STANDS_OUT, _DOUBTFUL))
        column[seen & (away < -limit)] = MarkerStatus.PARTIAL
        column[seen & (away > limit)] = MarkerStatus.MERGED
        frames = np.flatnonzero(column != MarkerStatus.NO_FRAME)
        for order in (frames, frames[::-1]):
            flagged = False
            for k in order:
                if flagged and column[k] == MarkerStatus.SEEN and abs(away[k]) > near:
                    column[k] = MarkerStatus.PARTIAL if away[k] < 0.0 else MarkerStatus.MERGED
                flagged = bool(column[k] != MarkerStatus.SEEN)


def flag_repeats(tracks: Tracks) -> None:
    """Flag frames that repeat the one before to the last bit, in the middle of a motion, as missing.

    Recorders put them in the place of frames that they lost.  Where markers stand, a repeated frame tells the truth.
    """
    centroids, errors, areas = tracks.centroids, tracks.errors, tracks.areas
    known = np.isfinite(areas)
    frames = np.flatnonzero(known.any(axis=1))
    if frames.size < 3:
        return
    seen = np.nan_to_num(np.concatenate([centroids, areas[..., None]], axis=2))[frames]
    same = (known[frames][1:] == known[frames][:-1]).all(axis=1) & (seen[1:] == seen[:-1]).all(axis=(1, 2))
    moved = np.abs(np.diff(centroids[frames], axis=0))
    noise = np.nanmedian(errors, axis=0) if np.isfinite(errors).any() else np.zeros(errors.shape[1:])
    moving = np.any(np.nan_to_num(moved) > _REPEATED * np.nan_to_num(noise), axis=(1, 2))
    repeated = np.zeros(len(frames), bool)
    for first, past in np.flatnonzero(np.diff(same, prepend=False, append=False)).reshape(-1, 2).tolist():
        repeated[first + 1 : past + 1] = first > 0 and past < len(same) and moving[first - 1] and moving[past]
    tracks.status[frames[repeated]] = MarkerStatus.NO_FRAME


def flag_standing(tracks: Tracks, radii: list[float]) -> None:
    """Flag what was found again after a loss and stands, where the marker never stood so long before, as lost."""
    for marker, radius in enumerate(radii):
        column = tracks.status[:, marker]
        frames = np.flatnonzero(column == MarkerStatus.SEEN)
        places, moments, spread = tracks.centroids[frames, marker], tracks.times[frames], tracks.errors[frames, marker]
        noise = float(np.median(spread[np.isfinite(spread)])) if np.isfinite(spread).any() else 0.0
        still = max(_STILL, 4.0 * noise)
        absent = np.cumsum(column == MarkerStatus.LOST)[frames]
        first = np.flatnonzero(np.diff(absent, prepend=-1))
        longest, passed, path = 0.0, 0.0, 0.0
        for k, (begin, end) in enumerate(pairwise([*first.tolist(), len(frames)])):
            stood = _standing(places[begin:end], still)
            lasted = moments[begin:end][stood - 1] - moments[begin:end]
            missed = path / passed * float(lasted[0]) if passed > 0.0 else 0.0
            if k and lasted[0] > _LONGER * longest and missed > max(_MISSED, _MISSED_RADII * radius):
                column[frames[begin : begin + stood[0]]] = MarkerStatus.LOST
                continue
            longest = max(longest, float(lasted.max()))
            passed += float(moments[end - 1] - moments[begin])
            path += float(np.linalg.norm(np.diff(places[begin:end], axis=0), axis=1).sum())


def _standing(places: Floats, still: float) -> NDArray[np.intp]:
    """Return for each place the number of the first one later that is elsewhere, or how many there are."""
    ends, end = np.zeros(len(places), np.intp), 0
    for k, place in enumerate(places):
        end = max(end, k + 1)
        while end < len(places) and float(np.abs(places[end] - place).max()) <= still:
            end += 1
        ends[k] = end
    return ends


def widen_errors(times: Floats, positions: Floats, errors: Floats) -> None:
    """Widen the errors of each marker, across and down, where its places scatter by more, by as much in every frame.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times (s).
    positions, errors : ndarray, shape (n, markers, 2)
        Places and their standard errors (pixels), which are changed in place; NaN in gaps.
    """
    for marker in range(positions.shape[1]):
        for axis in range(2):
            spread = errors[:, marker, axis]
            expected = float(np.sqrt(np.nanmean(spread**2))) if np.isfinite(spread).any() else 0.0
            if expected > 0.0:
                more = max(0.0, _scatter(times, positions[:, marker, axis]) ** 2 - expected**2)
                spread[:] = np.sqrt(spread**2 + more)


def _scatter(times: Floats, places: Floats) -> float:
    """Return the standard deviation of noise on a smooth motion; 0 where too few frames show the motion itself.

    The more neighbours a difference has, the less of the motion it holds: by the square of the sine of half the angle
    that the fastest part of it turns between two frames, for every two neighbours.  Noise stays the same.
    """
    if np.count_nonzero(np.isfinite(places)) < _FEWEST:
        return 0.0
    with_few, with_more = (noise_level(times, places, count) for count in _NEIGHBOURS)
    return with_more if with_more >= _LEVEL * with_few else 0.0
