"""The search for all markers in one frame after another: candidates, what they cost, and what was seen.

Places in the image are complex numbers here, column + 1j row.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import hypot, inf, log, nan, pi, remainder

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ..arrays import Floats
from .blobs import Blob, Box, find_blobs, smeared_area
from .film import Film
from .pixel_noise import PixelNoise
from .tracks import MarkerStatus, Rail, Rod

_NEVER = 1e6

Choice = list[int]  # number of the blob for each marker, -1 for none
Conflict = Callable[[Choice], tuple[int, int] | None]
_WHOLE = (0.9, 1.15)  # area over the expected one, of a marker that is seen whole and alone
_BACK = (1, 6, 25)  # sights of a marker, counted back, among which a bright object that stands is looked for
_RIVAL = 0.2  # difference of costs below which two markers may be mistaken for each other
_SHORT = 3  # frames over which a velocity is still taken


def match(costs: Floats, conflict: Conflict) -> Choice:
    """Return the matching of least cost in which no two markers are in conflict.

    Parameters
    ----------
    costs : ndarray, shape (markers, blobs)
        Cost of each pair, below 1; infinite where it is out of the question.  A marker without a blob costs 1.
    conflict : callable
        Two markers of a matching whose blobs do not go together, or None.

    Returns
    -------
    list of int
        Blob of each marker, -1 for none.

    Examples
    --------
    >>> match(np.array([[0.1, 0.3], [0.2, np.inf]]), lambda choice: None)
    [1, 0]
    """
    best, least = [-1] * len(costs), float(len(costs))
    waiting = [np.where(np.isfinite(costs), costs, _NEVER)]
    while waiting:
        table = waiting.pop()
        choice, cost = _assigned(table)
        if cost >= least:
            continue
        pair = conflict(choice)
        if pair is None:
            best, least = choice, cost
            continue
        for marker in pair:
            without = table.copy()
            without[marker, choice[marker]] = _NEVER
            waiting.append(without)
    return best


def _assigned(table: Floats) -> tuple[Choice, float]:
    markers, blobs = table.shape
    alone = np.full((markers, markers), _NEVER)
    np.fill_diagonal(alone, 1.0)
    whole = np.hstack([table, alone])
    rows, columns = linear_sum_assignment(whole)
    return [int(c) if c < blobs else -1 for c in columns], float(whole[rows, columns].sum())


@dataclass(frozen=True)
class Setup:
    """What does not change while markers are followed.

    Parameters
    ----------
    threshold : float
        Grey value above which pixels belong to markers.
    window : float
        How far from its foreseen place a marker may be (pixels).
    interval : float
        Usual time between two frames (s).
    noise : PixelNoise
        Noise of the pixels.
    weighted : bool
        Whether pixels are weighted by their grey values.
    """

    threshold: float
    window: float
    interval: float
    noise: PixelNoise
    weighted: bool

    def blobs(self, image: NDArray[np.generic], box: Box | None, areas: tuple[float, float]) -> list[Blob]:
        """Return the blobs in a box of an image with areas in a range."""
        return [] if box is None else find_blobs(image, box, self.threshold, areas, self.noise, self.weighted)


@dataclass
class Marker:
    """A marker, what holds it, and what is remembered of it from frame to frame.

    Parameters
    ----------
    number : int
        Its number.
    radius : float
        Radius of its blob at rest (pixels).
    place, time : complex, float
        Where it was last, or must have been, and when (s).
    sighted, seen : complex, float
        Where it was last seen whole, and when (s).
    rod, rail : Rod, Rail or None
        What holds it.
    velocity : complex or None
        Velocity (pixels/s); None until it has been seen twice in short order.
    angle, sighted_angle : float or None
        Direction from its pivot (rad, from the right, rows down) at `time`, and when it was last seen whole.
    turning : float or None
        Its rate (rad/s).
    steps : int
        Frames since it was last seen whole.
    foreseen, reach : complex, float
        Where it should be in the frame at hand, and how far around that it is looked for.
    sightings : list of int
        Frames in which it was seen whole.
    """

    number: int
    radius: float
    place: complex
    time: float
    sighted: complex
    seen: float
    rod: Rod | None = None
    rail: Rail | None = None
    velocity: complex | None = None
    angle: float | None = None
    sighted_angle: float | None = None
    turning: float | None = None
    steps: int = 0
    foreseen: complex = 0j
    reach: float = 0.0
    sightings: list[int] = field(default_factory=list)

    def ahead(self, time: float, pivot: complex | None) -> complex:
        """Return the place at a time: straight on, or on along the circle about the pivot."""
        passed = time - self.time
        if pivot is not None and self.rod is not None and self.angle is not None:
            return pivot + rect(self.rod.length, self.angle + (self.turning or 0.0) * passed)
        return self.place + (self.velocity or 0j) * passed

    def saw(self, place: complex, time: float, pivot: complex | None) -> None:
        """Remember that the marker was seen whole."""
        passed = time - self.seen
        angle = None if pivot is None else phase(place - pivot)
        self.velocity = self.turning = None
        if self.steps <= _SHORT and passed > 0.0:
            self.velocity = (place - self.sighted) / passed
            if angle is not None and self.sighted_angle is not None:
                self.turning = remainder(angle - self.sighted_angle, 2.0 * pi) / passed
        self.place = self.sighted = place
        self.time = self.seen = time
        self.angle = self.sighted_angle = angle
        self.steps = 0

    def glimpsed(self, place: complex, time: float, pivot: complex | None) -> None:
        """Remember about where it must have been, without a new velocity."""
        self.place, self.time = place, time
        if pivot is not None:
            self.angle = phase(place - pivot)

    def travel(self, place: complex, time: float, exposure: float) -> float:
        """Return how far it moves in an exposure, by its mean speed since it was last seen whole (pixels)."""
        return exposure * abs(place - self.sighted) / (time - self.seen) if time > self.seen else 0.0

    def misfit(self, place: complex, pivot: complex) -> float:
        """Return by how much its distance from a pivot differs from the length of its rod; 0 without a rod."""
        return 0.0 if self.rod is None else self.rod.misfit((place.real, place.imag), (pivot.real, pivot.imag))


@dataclass(frozen=True)
class Sight:
    """What was found of a marker in a frame."""

    status: MarkerStatus
    blob: Blob | None = None
    ratio: float = nan


@dataclass
class Search:
    """The state of a search: what does not change, the markers, and where each was seen in which frame."""

    film: Film
    setup: Setup
    tolerance: float
    markers: list[Marker]
    seen: dict[int, dict[int, complex]] = field(default_factory=dict)

    def look(self, frame: int) -> list[Sight]:
        """Look for all markers in a frame, and remember what was found."""
        time, image, (height, width) = float(self.film.times[frame]), self.film.frames[frame], self.film.shape
        for marker in self.markers:
            wider = max(1.0, (time - marker.time) / self.setup.interval) * (1.0 if marker.velocity is not None else 2.0)
            marker.reach = min(self.setup.window * wider, hypot(height, width))
            pivot = self._pivot(marker)
            place = marker.ahead(time, pivot)
            if marker.steps and pivot is None:  # free and lost, it is sought in the whole image
                place = complex(min(max(place.real, 0.0), width - 1.0), min(max(place.imag, 0.0), height - 1.0))
            marker.foreseen = place
        blobs = self._blobs(image)
        costs, ratios = np.ones((2, len(self.markers), len(blobs)))
        for k, marker in enumerate(self.markers):
            for j, blob in enumerate(blobs):
                travel = marker.travel(blob.centre, time, self.film.exposure)
                ratios[k, j] = blob.area / smeared_area(marker.radius, travel)
                costs[k, j] = self._cost(marker, blob, ratios[k, j])
        choice = self._sure(match(costs, lambda chosen: self._conflict(chosen, blobs)), costs)
        sights = [
            self._judge(marker, blobs[number], float(ratios[marker.number, number]), time)
            if number >= 0
            else Sight(MarkerStatus.LOST)
            for marker, number in zip(self.markers, choice, strict=True)
        ]
        self._divide(sights, choice, blobs)
        self._remember(sights, time, frame)
        return sights

    def _pivot(self, marker: Marker) -> complex | None:
        """Return the place of a marker's pivot; None without a rod, and where the pivot is a marker not seen."""
        if marker.rod is None:
            return None
        if isinstance(marker.rod.pivot, tuple):
            return complex(*marker.rod.pivot)
        base = self.markers[marker.rod.pivot]
        return base.foreseen if base.steps == 0 else None

    def _blobs(self, image: NDArray[np.generic]) -> list[Blob]:
        boxes = []
        for marker in self.markers:
            pivot, circle = self._pivot(marker), None
            if marker.rod is not None and pivot is not None:
                base = marker.rod.pivot
                loose = self.markers[base].reach if isinstance(base, int) else marker.rod.travel
                circle = pivot, marker.rod.length + self.tolerance + loose
            boxes.append(box_around(marker.foreseen, marker.reach, 2.0 * marker.radius + 5.0, self.film.shape, circle))
        radii = [marker.radius for marker in self.markers]
        counts = 0.3 * min(radii) ** 2, 30.0 * max(radii) ** 2
        return [blob for box in _joined(boxes) for blob in self.setup.blobs(image, box, counts)]

    def _cost(self, marker: Marker, blob: Blob, ratio: float) -> float:
        """Return the cost of taking a blob for a marker, below 1; infinite where it cannot be."""
        if blob.cut or not 0.2 < ratio < 4.0:
            return inf
        whole = _is_whole(blob, ratio)
        slack = self.tolerance + (0.0 if whole else marker.radius)
        if marker.rail is not None and abs(blob.column - marker.rail.column) > slack:
            return inf
        distance = abs(blob.centre - marker.foreseen)
        if marker.rod is not None and isinstance(marker.rod.pivot, int):
            base = self.markers[marker.rod.pivot]
            if marker.steps > 0 and marker.misfit(blob.centre, base.foreseen) > slack + base.reach:
                return inf
        elif marker.rod is not None and isinstance(marker.rod.pivot, tuple):
            pivot = complex(*marker.rod.pivot)
            if marker.misfit(blob.centre, pivot) > slack:
                return inf
            if marker.angle is not None:
                turned = phase((blob.centre - pivot) * (marker.foreseen - pivot).conjugate())
                distance = min(distance, marker.rod.length * abs(turned))
        if distance > marker.reach or (not whole and distance > 2.0 * marker.radius):
            return inf
        foreseen = marker.steps == 0 and distance <= marker.radius
        if not foreseen and self._stood(marker, blob):
            return inf
        unlike = 0.25 * min(1.0, abs(log(ratio)) / log(2.0))
        return 0.5 * (distance / marker.reach) ** 2 + unlike + (0.0 if foreseen else 0.2)

    def _stood(self, marker: Marker, blob: Blob) -> bool:
        """Return whether a blob stood at its place while the marker was seen whole elsewhere: no marker then."""
        box = box_around(blob.centre, blob.radius, blob.radius + 4.0, self.film.shape)
        # A rod may have passed before it in one frame, hardly in all.
        frames = marker.sightings
        for frame in {frames[max(len(frames) - back, 0)] for back in _BACK} if frames else set():
            if any(abs(blob.centre - place) < self.markers[k].radius for k, place in self.seen[frame].items()):
                continue
            before = self.setup.blobs(self.film.frames[frame], box, (0.5 * blob.area, 2.0 * blob.area))
            if any(abs(old.centre - blob.centre) < 0.5 * blob.radius for old in before):
                return True
        return False

    def _conflict(self, choice: Choice, blobs: list[Blob]) -> tuple[int, int] | None:
        for k, marker in enumerate(self.markers):
            pivot = None if marker.rod is None else marker.rod.pivot
            if not isinstance(pivot, int) or choice[k] < 0 or choice[pivot] < 0:
                continue
            pair = [(self.markers[n], blobs[choice[n]]) for n in (k, pivot)]
            slack = sum(0.0 if _is_whole(b, b.area / (pi * m.radius**2)) else m.radius for m, b in pair)
            if marker.misfit(pair[0][1].centre, pair[1][1].centre) > self.tolerance + slack:
                return k, pivot
        return None

    def _sure(self, choice: Choice, costs: Floats) -> Choice:
        """Leave out blobs found again that may as well be another marker that is lost."""
        lost = [marker.number for marker in self.markers if marker.steps > 0 and choice[marker.number] < 0]
        sure = list(choice)
        for k, number in enumerate(choice):
            if number >= 0 and self.markers[k].steps > 0:
                rival = min((costs[other, number] for other in lost), default=inf)
                sure[k] = -1 if rival < costs[k, number] + _RIVAL else number
        return sure

    def _judge(self, marker: Marker, blob: Blob, ratio: float, time: float) -> Sight:
        smear = min(marker.travel(blob.centre, time, self.film.exposure) / (2.0 * marker.radius), 1.0)
        if blob.clipped or ratio < _WHOLE[0] - 0.2 * smear:
            return Sight(MarkerStatus.PARTIAL, blob, ratio)
        return Sight(MarkerStatus.MERGED if ratio > _WHOLE[1] + 0.3 * smear else MarkerStatus.SEEN, blob, ratio)

    def _divide(self, sights: list[Sight], choice: Choice, blobs: list[Blob]) -> None:
        """Flag blobs in which two markers are foreseen: which one is in front is not known."""
        for k, marker in enumerate(self.markers):
            if choice[k] >= 0 or (marker.steps > 0 and marker.time == marker.seen):
                continue
            for other, number in enumerate(choice):
                if number >= 0 and abs(blobs[number].centre - marker.foreseen) < blobs[number].radius:
                    sights[k] = sights[other] = Sight(MarkerStatus.MERGED, blobs[number], sights[other].ratio)

    def _remember(self, sights: list[Sight], time: float, frame: int) -> None:
        for marker, sight in zip(self.markers, sights, strict=True):
            pivot, blob = self._pivot(marker), sight.blob
            if blob is not None and sight.status == MarkerStatus.SEEN:
                marker.foreseen = blob.centre
                marker.saw(blob.centre, time, pivot)
                marker.sightings.append(frame)
                self.seen.setdefault(frame, {})[marker.number] = blob.centre
                continue
            if blob is not None:
                if sight.status == MarkerStatus.PARTIAL or abs(blob.centre - marker.foreseen) > blob.radius:
                    marker.foreseen = blob.centre
                marker.glimpsed(marker.foreseen, time, pivot)
            marker.steps += 1


def _is_whole(blob: Blob, ratio: float) -> bool:
    return _WHOLE[0] < ratio < _WHOLE[1] and not blob.clipped


def box_around(
    place: complex, reach: float, margin: float, shape: tuple[int, int], circle: tuple[complex, float] | None = None
) -> Box | None:
    """Return the part of the image within `reach` of a place, and of a circle's surroundings; None for none.

    The margin holds blobs whole whose centres are within.
    """
    both = 1.0 + 1.0j
    low, high = place - reach * both, place + reach * both
    if circle is not None:
        least, most = circle[0] - circle[1] * both, circle[0] + circle[1] * both
        low = complex(max(low.real, least.real), max(low.imag, least.imag))
        high = complex(min(high.real, most.real), min(high.imag, most.imag))
    top, left = max(int(low.imag - margin), 0), max(int(low.real - margin), 0)
    bottom, right = min(int(high.imag + margin) + 2, shape[0]), min(int(high.real + margin) + 2, shape[1])
    return (top, bottom, left, right) if bottom > top and right > left else None


def _joined(boxes: Sequence[Box | None]) -> list[Box]:
    """Return boxes of which none overlap, around those that do."""
    kept: list[Box] = []
    for box in boxes:
        now = box
        while now is not None:
            a, b, c, d = now
            group = [k for k in kept if k[0] < b and a < k[1] and k[2] < d and c < k[3]]
            kept = [k for k in kept if k not in group]
            if not group:
                kept.append(now)
                break
            tops, bottoms, lefts, rights = zip(now, *group, strict=True)
            now = min(tops), max(bottoms), min(lefts), max(rights)
    return kept
