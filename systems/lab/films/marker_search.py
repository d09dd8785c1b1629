"""The search for all markers in one frame after another: candidates, what they cost, and what was seen."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, hypot, log, pi, remainder

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from .assignment import Choice, match
from .blobs import Blob, find_blobs, smeared_area
from .film import Film
from .first_frame import Setup
from .prediction import Memory, Place, apart, box_around, joined
from .tracks import MarkerStatus, Rail, Rod

_WHOLE = (0.9, 1.15)  # area over the expected one, of a marker that is seen whole and alone
_BACK = (1, 6, 25)  # sights of a marker, counted back, among which a bright object that stands is looked for
_RIVAL = 0.2  # difference of costs below which two markers may be mistaken for each other


@dataclass(frozen=True)
class Sight:
    """What was found of a marker in a frame."""

    status: MarkerStatus
    blob: Blob | None = None
    ratio: float = float("nan")


@dataclass
class Search:
    """The state of a search: what does not change, what is remembered of each marker, and where it was seen when."""

    film: Film
    setup: Setup
    rods: dict[int, Rod]
    rails: dict[int, Rail]
    tolerance: float
    memories: list[Memory]
    seen: dict[int, dict[int, Place]] = field(default_factory=dict)
    sighted: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))

    def look(self, frame: int) -> list[Sight]:
        """Look for all markers in a frame, and remember what was found."""
        time, image = float(self.film.times[frame]), self.film.frames[frame]
        diagonal = hypot(*self.film.shape)
        places: list[Place] = []
        reaches: list[float] = []
        for marker, memory in enumerate(self.memories):
            reach = memory.reach(self.setup.window, time, self.setup.interval)
            reaches.append(min(reach, diagonal))
            places.append(self._foreseen(marker, time, self._pivot(marker, places)))
        blobs = self._blobs(image, places, reaches)
        costs = np.full((len(places), len(blobs)), np.inf)
        ratios = np.ones_like(costs)
        for marker, memory in enumerate(self.memories):
            for j, blob in enumerate(blobs):
                travel = self.film.exposure * memory.speed((blob.column, blob.row), time)
                ratios[marker, j] = blob.area / smeared_area(memory.radius, travel)
                costs[marker, j] = self._cost(marker, blob, ratios[marker, j], places, reaches)
        choice = match(costs, lambda chosen: self._conflict(chosen, blobs))
        choice = self._sure(choice, costs)
        sights = [self._judge(m, choice[m], blobs, ratios, time) for m in range(len(places))]
        self._divide(sights, choice, blobs, places)
        self._remember(sights, places, time, frame)
        return sights

    def _foreseen(self, marker: int, time: float, pivot: Place | None) -> Place:
        """Return the expected place of a marker; one that is free and lost is sought in the whole image."""
        memory = self.memories[marker]
        place = memory.ahead(time, pivot, self.rods.get(marker))
        if memory.steps == 0 or pivot is not None:
            return place
        height, width = self.film.shape
        return min(max(place[0], 0.0), width - 1.0), min(max(place[1], 0.0), height - 1.0)

    def _pivot(self, marker: int, places: Sequence[Place]) -> Place | None:
        """Return the place of a marker's pivot; None without a rod, and where the pivot is a marker not seen."""
        rod = self.rods.get(marker)
        if rod is None:
            return None
        if isinstance(rod.pivot, int):
            return places[rod.pivot] if self.memories[rod.pivot].steps == 0 else None
        return rod.pivot

    def _blobs(self, image: NDArray[np.generic], places: list[Place], reaches: list[float]) -> list[Blob]:
        boxes = []
        for marker, (place, reach) in enumerate(zip(places, reaches, strict=True)):
            rod, radius = self.rods.get(marker), self.memories[marker].radius
            pivot = self._pivot(marker, places)
            circle = None
            if rod is not None and pivot is not None:
                loose = reaches[rod.pivot] if isinstance(rod.pivot, int) else rod.travel
                circle = pivot, rod.length + self.tolerance + loose
            box = box_around(place, reach, 2.0 * radius + 5.0, self.film.shape, circle)
            if box is not None:
                boxes.append(box)
        radii = [memory.radius for memory in self.memories]
        counts = 0.3 * min(radii) ** 2, 30.0 * max(radii) ** 2
        setup = self.setup
        return [
            blob
            for box in joined(boxes)
            for blob in find_blobs(image, box, setup.threshold, counts, setup.noise, setup.weighted)
        ]

    def _cost(self, marker: int, blob: Blob, ratio: float, places: list[Place], reaches: list[float]) -> float:
        """Return the cost of taking a blob for a marker, below 1; infinite where it cannot be."""
        memory, rod, rail = self.memories[marker], self.rods.get(marker), self.rails.get(marker)
        place, reach, centre = places[marker], reaches[marker], (blob.column, blob.row)
        if blob.cut or not 0.2 < ratio < 4.0:
            return np.inf
        whole = _WHOLE[0] < ratio < _WHOLE[1] and not blob.clipped
        slack = self.tolerance + (0.0 if whole else memory.radius)
        if rail is not None and abs(blob.column - rail.column) > slack:
            return np.inf
        distance = apart(blob, place)
        if rod is not None and isinstance(rod.pivot, int):
            if memory.steps > 0 and rod.misfit(centre, places[rod.pivot]) > slack + reaches[rod.pivot]:
                return np.inf
        elif rod is not None and isinstance(rod.pivot, tuple):
            pivot = rod.pivot
            if rod.misfit(centre, pivot) > slack:
                return np.inf
            if memory.angle is not None:
                turned = atan2(centre[1] - pivot[1], centre[0] - pivot[0]) - atan2(
                    place[1] - pivot[1], place[0] - pivot[0]
                )
                distance = min(distance, rod.length * abs(remainder(turned, 2.0 * pi)))
        if distance > reach:
            return np.inf
        if not whole and distance > 2.0 * memory.radius:
            return np.inf
        foreseen = memory.steps == 0 and distance <= memory.radius
        if not foreseen and self._stood(marker, blob):
            return np.inf
        found_again = 0.0 if foreseen else 0.2
        return 0.5 * (distance / reach) ** 2 + 0.25 * min(1.0, abs(log(ratio)) / log(2.0)) + found_again

    def _stood(self, marker: int, blob: Blob) -> bool:
        """Return whether a blob stood at its place while the marker was seen whole elsewhere: no marker then."""
        box = box_around((blob.column, blob.row), blob.radius, blob.radius + 4.0, self.film.shape, None)
        if box is None:
            return False
        setup, counts = self.setup, (0.5 * blob.area, 2.0 * blob.area)
        # A rod may have passed before it in one frame, hardly in all.
        frames = self.sighted[marker]
        for frame in {frames[max(len(frames) - back, 0)] for back in _BACK} if frames else set():
            places = self.seen[frame]
            if any(apart(blob, place) < self.memories[which].radius for which, place in places.items()):
                continue
            before = find_blobs(self.film.frames[frame], box, setup.threshold, counts, setup.noise, setup.weighted)
            if any(apart(old, (blob.column, blob.row)) < 0.5 * blob.radius for old in before):
                return True
        return False

    def _conflict(self, choice: Choice, blobs: list[Blob]) -> tuple[int, int] | None:
        for marker, rod in self.rods.items():
            if not isinstance(rod.pivot, int) or choice[marker] < 0 or choice[rod.pivot] < 0:
                continue
            end, pivot = blobs[choice[marker]], blobs[choice[rod.pivot]]
            slack = self.tolerance
            for which, blob in ((marker, end), (rod.pivot, pivot)):
                ratio = blob.area / (pi * self.memories[which].radius ** 2)
                slack += 0.0 if _WHOLE[0] < ratio < _WHOLE[1] and not blob.clipped else self.memories[which].radius
            if rod.misfit((end.column, end.row), (pivot.column, pivot.row)) > slack:
                return marker, rod.pivot
        return None

    def _sure(self, choice: Choice, costs: Floats) -> Choice:
        """Leave out blobs found again that may as well be another marker that is lost."""
        lost = [marker for marker, memory in enumerate(self.memories) if memory.steps > 0 and choice[marker] < 0]
        sure = list(choice)
        for marker, number in enumerate(choice):
            if number >= 0 and self.memories[marker].steps > 0:
                rival = min((costs[other, number] for other in lost), default=np.inf)
                if rival < costs[marker, number] + _RIVAL:
                    sure[marker] = -1
        return sure

    def _judge(self, marker: int, number: int, blobs: list[Blob], ratios: Floats, time: float) -> Sight:
        if number < 0:
            return Sight(MarkerStatus.LOST)
        blob, ratio, memory = blobs[number], float(ratios[marker, number]), self.memories[marker]
        smear = self.film.exposure * memory.speed((blob.column, blob.row), time) / (2.0 * memory.radius)
        if blob.clipped or ratio < _WHOLE[0] - 0.2 * min(smear, 1.0):
            return Sight(MarkerStatus.PARTIAL, blob, ratio)
        if ratio > _WHOLE[1] + 0.3 * min(smear, 1.0):
            return Sight(MarkerStatus.MERGED, blob, ratio)
        return Sight(MarkerStatus.SEEN, blob, ratio)

    def _divide(self, sights: list[Sight], choice: Choice, blobs: list[Blob], places: list[Place]) -> None:
        """Flag blobs in which two markers are foreseen: which one is in front is not known."""
        for marker, memory in enumerate(self.memories):
            if choice[marker] >= 0 or (memory.steps > 0 and memory.time == memory.seen):
                continue
            for other, number in enumerate(choice):
                if number >= 0 and apart(blobs[number], places[marker]) < blobs[number].radius:
                    both = Sight(MarkerStatus.MERGED, blobs[number], sights[other].ratio)
                    sights[marker] = sights[other] = both

    def _remember(self, sights: list[Sight], places: list[Place], time: float, frame: int) -> None:
        now: list[Place] = []
        for marker, (memory, sight) in enumerate(zip(self.memories, sights, strict=True)):
            place, pivot = places[marker], self._pivot(marker, now)
            if sight.blob is None:
                memory.steps += 1
            else:
                centre = sight.blob.column, sight.blob.row
                if sight.status == MarkerStatus.SEEN:
                    place = centre
                    memory.saw(place, time, pivot)
                    self.sighted[marker].append(frame)
                    self.seen.setdefault(frame, {})[marker] = place
                else:
                    if sight.status == MarkerStatus.PARTIAL or apart(sight.blob, place) > sight.blob.radius:
                        place = centre
                    memory.glimpsed(place, time, pivot)
                    memory.steps += 1
            now.append(place)
