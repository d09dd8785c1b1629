"""First returns to a section: a system that stops at the crossing, and the integration up to it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._compiled.codegen.kernel import over_states
from .._lib.arrays import Bools, Floats, Ints
from .coordinates import Coordinate
from .integration import Flow
from .orbit_batch import Orbits, Status
from .system import ForcedSystem
from .tangent import tangent_by_lanes

_LAST = 1e-9  # fraction of a stretch before its end in which an arrival is left to the next one
_AT_REST = 1e-13  # largest move in a stretch, relative to 1 or to the point, of an orbit that rests
EXTRA = 4  # states besides those of the system: time under way, side of the section, its value, way since the crossing


def gated_system(system: ForcedSystem, place: int) -> ForcedSystem:
    """Return the system whose state stays constant once it has crossed the section.

    Further states are the time under way, the sign of the side on which it moves, the value on the section, and the
    way since the crossing.  This leads the switching function on, more slowly than the motion has come: without it
    there would be no direction beyond the section, and rounding would tell whether an orbit slides along it, or comes
    back to it without end.
    """
    turn = system.axes[place].period
    rhs, switches = _gated_functions(system.rhs, system.dimension, place, turn)
    taken = {c.name for c in system.axes}
    names = [n if n not in taken else f"section {n}" for n in ("time under way", "side", "value", "way since")]
    guards = _of_first(tuple(system.ends.values()), system.dimension)
    ends = dict(zip(system.ends, guards, strict=True))
    # The sign of the side differs after a full rotation: the angle of the section is kept unwrapped here.
    axes = [Coordinate(c.name) if j == place else c for j, c in enumerate(system.axes)]
    return ForcedSystem(rhs, system.params, system.length, (*axes, *names), system.name, switches, ends=ends)


@functools.lru_cache(maxsize=256)
def _of_first(guards: tuple[Callable[..., Any], ...], dimension: int) -> tuple[Callable[..., Any], ...]:
    """Return guards that read the first states; the same ones every time."""
    return tuple(functools.partial(lambda g, t, x, p: g(t, x[:dimension], p), guard) for guard in guards)


@functools.lru_cache(maxsize=256)
def _gated_functions(
    rhs: Callable[..., Any], dimension: int, place: int, turn: float | None
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return right-hand side and switches with a gate at the section; the same ones every time."""

    def moving(t: float, x: Sequence[float], p: Any, s: Sequence[float]) -> Sequence[float]:
        gate, rates = 0.5 * (1.0 + x[dimension + 1] * s[0]), rhs(t, x[:dimension], p)
        square = rates[place] * rates[place]
        on = 0.5 * square / (1.0 + square)  # at most a quarter of the speed
        return (*[gate * rate for rate in rates], gate, 0.0, 0.0, (1.0 - gate) * on)

    def switching(t: float, x: Sequence[float], p: Any) -> Sequence[float]:
        beyond, on = x[place] - x[dimension + 2], x[dimension + 1] * x[dimension + 3]
        return ((beyond if turn is None else turn / np.pi * sin(np.pi / turn * beyond)) - on,)

    return moving, switching


@dataclass(frozen=True, eq=False)
class Trip:
    """Takes points on the section to where they come back."""

    system: ForcedSystem
    place: int
    value: float
    direction: int
    longest: float
    stretch: float
    motion: Flow

    def __call__(self, points: Floats) -> tuple[Floats, Floats, NDArray[np.uint8], Floats | None]:
        """Return images (n, d - 1) with angles unwrapped, times, status, and derivatives where these are carried."""
        n, d = len(points), self.system.dimension
        size = d + EXTRA
        states = np.zeros((n, size))
        others = [j for j in range(d) if j != self.place]
        states[:, others] = points
        times, status = np.zeros(n), np.zeros(n, np.uint8)
        carries = self.motion.largest.size > size
        total = np.broadcast_to(np.eye(size), (n, size, size)).copy() if carries else None
        resting = self._begin(states)
        status[resting] = Status.NO_RETURN
        pending = np.flatnonzero(~resting)
        while len(pending):
            states[pending, d] = states[pending, d + 3] = 0.0
            if total is not None:
                total[pending, d + 3] = 0.0
            moved = self._move(states[pending], status, pending, total)
            states[pending] = moved
            alive = status[pending] < Status.ESCAPED
            pending, moved = pending[alive], moved[alive]
            times[pending] += moved[:, d]
            stopped = moved[:, d] < self.stretch * (1.0 - _LAST)
            across = self._across(moved)
            wanted = (self.direction == 0) | (across == self.direction)
            lost = ~(stopped & wanted) & (times[pending] >= self.longest * (1.0 - _LAST))
            lost |= stopped & (times[pending] == 0.0)
            status[pending[lost]] = Status.NO_RETURN
            onwards = stopped & ~wanted & ~lost
            passed = pending[onwards]
            again = states[passed]
            self._put(again, across[onwards])
            states[passed] = again
            pending = pending[~lost & ~(stopped & wanted)]
        ended = status >= Status.ESCAPED
        late = times > self.longest
        status[late & ~ended] = Status.NO_RETURN
        ended |= late
        images = states[:, others]
        images[ended], times[ended] = np.nan, np.nan
        return images, times, status, None if total is None else total[:, others][:, :, others]

    def _begin(self, states: Floats) -> Bools:
        """Put states on the section, on the side to which they go; tell which of them rest there."""
        system, d = self.system, self.system.dimension
        states[:, self.place] = self.value
        with np.errstate(all="ignore"):
            rates = over_states(system.rhs, 0.0, states[:, :d], system.params)
        self._put(states, np.where(rates[:, self.place] < 0.0, -1.0, 1.0))
        moves = np.abs(rates) * self.stretch
        return np.asarray((moves <= _AT_REST * np.maximum(1.0, np.abs(states[:, :d]))).all(axis=1))

    def _put(self, states: Floats, side: Floats) -> None:
        """Put states exactly on the section, on one of its sides."""
        d = self.system.dimension
        states[:, self.place] = states[:, d + 2] = self.value
        states[:, d + 1] = side

    def _across(self, states: Floats) -> Floats:
        """Return the direction in which states cross the section at which they have stopped.

        They come back from the side on which they were, except after a full rotation of an angle.
        """
        d, turn = self.system.dimension, self.system.axes[self.place].period
        round_ = np.inf if turn is None else 0.5 * turn
        back = np.abs(states[:, self.place] - states[:, d + 2]) < round_
        return np.where(back, -states[:, d + 1], states[:, d + 1])

    def _move(self, states: Floats, status: NDArray[np.uint8], rows: Ints, total: Floats | None) -> Floats:
        """Return states after a stretch, or where they have come to the section; collect status and derivatives."""
        if total is None:
            orbits = Orbits.starting(states)
            self.motion(orbits)
            status[rows] = np.maximum(status[rows], orbits.status)
            return orbits.points
        images, matrices = tangent_by_lanes(self.motion, states, states.shape[1])
        status[rows[~np.isfinite(images).all(axis=1)]] = Status.DIVERGED
        total[rows] = matrices @ total[rows]
        return images
