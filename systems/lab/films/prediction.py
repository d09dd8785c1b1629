"""Where a marker will be: its memory, its next place, and how far around it to look."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, remainder, sin

from .blobs import Blob, Box
from .tracks import Rod

Place = tuple[float, float]

_SHORT = 3  # frames over which a velocity is still taken


@dataclass
class Memory:
    """What is remembered of a marker from frame to frame.

    Parameters
    ----------
    radius : float
        Radius of its blob at rest (pixels).
    place, time : tuple of float, float
        Where it was last, or must have been, and when (s).
    sighted : tuple of float
        Where it was last seen whole.
    seen : float
        When that was (s).
    velocity : tuple of float or None
        Velocity (pixels/s); None until it has been seen twice in short order.
    angle, sighted_angle : float or None
        Direction from its pivot (rad, from the right, rows down) at `time`, and when it was last seen whole.
    turning : float or None
        Its rate (rad/s).
    steps : int
        Frames since it was last seen whole.
    """

    radius: float
    place: Place
    time: float
    sighted: Place
    seen: float
    velocity: Place | None = None
    angle: float | None = None
    sighted_angle: float | None = None
    turning: float | None = None
    steps: int = 0

    def ahead(self, time: float, pivot: Place | None, rod: Rod | None) -> Place:
        """Return the place at a time: straight on, or on along the circle about the pivot."""
        passed = time - self.time
        if pivot is not None and rod is not None and self.angle is not None:
            angle = self.angle + (self.turning or 0.0) * passed
            return pivot[0] + rod.length * cos(angle), pivot[1] + rod.length * sin(angle)
        across, down = self.velocity or (0.0, 0.0)
        return self.place[0] + across * passed, self.place[1] + down * passed

    def saw(self, place: Place, time: float, pivot: Place | None) -> None:
        """Remember that the marker was seen whole."""
        passed = time - self.seen
        angle = None if pivot is None else atan2(place[1] - pivot[1], place[0] - pivot[0])
        self.velocity, self.turning = None, None
        if self.steps <= _SHORT and passed > 0.0:
            self.velocity = (place[0] - self.sighted[0]) / passed, (place[1] - self.sighted[1]) / passed
            if angle is not None and self.sighted_angle is not None:
                self.turning = remainder(angle - self.sighted_angle, 2.0 * pi) / passed
        self.place = self.sighted = place
        self.time = self.seen = time
        self.angle = self.sighted_angle = angle
        self.steps = 0

    def glimpsed(self, place: Place, time: float, pivot: Place | None) -> None:
        """Remember about where it must have been, without a new velocity."""
        self.place, self.time = place, time
        if pivot is not None:
            self.angle = atan2(place[1] - pivot[1], place[0] - pivot[0])

    def reach(self, window: float, time: float, interval: float) -> float:
        """Return how far from its foreseen place to look: more where the velocity is not known, and after a gap."""
        return window * max(1.0, (time - self.time) / interval) * (1.0 if self.velocity is not None else 2.0)

    def speed(self, place: Place, time: float) -> float:
        """Return the mean speed since it was last seen whole (pixels/s), for a place at a time."""
        passed = time - self.seen
        return hypot(place[0] - self.sighted[0], place[1] - self.sighted[1]) / passed if passed > 0.0 else 0.0


def box_around(
    place: Place, reach: float, margin: float, shape: tuple[int, int], circle: tuple[Place, float] | None
) -> Box | None:
    """Return the part of the image within `reach` of a place, and of a circle's surroundings; None for none.

    The margin holds blobs whole whose centres are within.
    """
    low = [place[0] - reach, place[1] - reach]
    high = [place[0] + reach, place[1] + reach]
    if circle is not None:
        (column, row), radius = circle
        low = [max(low[0], column - radius), max(low[1], row - radius)]
        high = [min(high[0], column + radius), min(high[1], row + radius)]
    left, top = (max(int(v - margin), 0) for v in low)
    right, bottom = (min(int(v + margin) + 2, n) for v, n in zip(high, (shape[1], shape[0]), strict=True))
    return (top, bottom, left, right) if bottom > top and right > left else None


def joined(boxes: list[Box]) -> list[Box]:
    """Return boxes of which none overlap, around those that do."""
    kept: list[Box] = []
    for box in boxes:
        now = box
        while True:
            touching = [b for b in kept if b[0] < now[1] and now[0] < b[1] and b[2] < now[3] and now[2] < b[3]]
            if not touching:
                break
            kept = [b for b in kept if b not in touching]
            group = [now, *touching]
            now = min(b[0] for b in group), max(b[1] for b in group), min(b[2] for b in group), max(b[3] for b in group)
        kept.append(now)
    return kept


def apart(blob: Blob, place: Place) -> float:
    """Return the distance of a blob's centre from a place (pixels)."""
    return hypot(blob.column - place[0], blob.row - place[1])
