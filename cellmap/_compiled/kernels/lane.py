"""One lane of a flow with switches and impacts, what belongs to its system, and what decides about its mode."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..loops import inlined, loop
from .blocks import LANES
from .calls import array_at, call_surfaces

SIGN, COUNTS, STRIKES, ENDS, RESTS, SOLID = range(6)
"""What a switch does: it has a sign, or a whole number; impacts or the end of orbits are at it; after impacts a
state may rest, and behind some none may begin."""

CONTEXT = 13
"""Numbers that a system is described with, before those of each surface: the first thirteen of :class:`System`."""

COUNT, WATCHED = 6, 11
"""Places in the context of the number of surfaces, and of the address of what is kept of grazing (0 for nothing)."""


class System(NamedTuple):
    """A system as its context describes it.

    Parameters
    ----------
    free, general, begin, surfaces : int
        Addresses of generated functions: steps of lanes that do not slide (0 where `general` does for all), of any
        lanes; the modes in which a block begins; what decides about them.
    size, dimension, switches, order : int
        Numbers of state variables with those of tangent vectors, of coordinates, of surfaces, and the order of series.
    projects, coupled : int
        Whether lanes that slide are brought back at the end, and whether surfaces depend on the sides of others.
    impacts, watched : int
        Addresses of the function of impacts and of what :mod:`.grazing` keeps of each orbit, or 0.
    moving : int
        Number of coordinates without the last ones that nothing changes, as parameters among the state: a state that is
        put on a surface keeps these.
    kinds : ndarray of int64, shape (switches,)
        What each switch does.
    bound : ndarray of int64, shape (switches * switches,)
        Surface by surface, the sign with which each switch leaves it together with the state that leaves a rest there,
        0 where a rest leaves the switch alone.
    p : ndarray
        Parameters.
    """

    free: int
    general: int
    begin: int
    surfaces: int
    size: int
    dimension: int
    switches: int
    order: int
    projects: int
    coupled: int
    impacts: int
    watched: int
    moving: int
    kinds: NDArray[np.int64]
    bound: NDArray[np.int64]
    p: NDArray[np.float64]


class Lane(NamedTuple):
    """State and mode of a lane: tangent vectors are behind the state, and errors are those of the state.

    ``fresh[e]`` is the order of the zero that event e has at the beginning of the step because the mode began there;
    its last entry counts events without progress.
    """

    state: NDArray[np.float64]
    errors: NDArray[np.float64]
    signs: NDArray[np.float64]
    slides: NDArray[np.float64]
    fresh: NDArray[np.float64]


class Surfaces(NamedTuple):
    """Switching functions at a state with their normals, and jumps of the right-hand side at each.

    The flow is the right-hand side itself, where nothing slides, of systems with several switches.

    Rates are those with all switches at 0, and gains what each switch at 1 adds to them.
    """

    values: NDArray[np.float64]
    rates: NDArray[np.float64]
    gains: NDArray[np.float64]
    jumps: NDArray[np.float64]
    normals: NDArray[np.float64]
    flow: NDArray[np.float64]


class Event(NamedTuple):
    """Which surfaces are hit, and those on which a lane is; signs of switches before and after, and values before.

    ``series`` has room for the coefficients of one event.
    """

    hits: NDArray[np.float64]
    on_surface: NDArray[np.float64]
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    values: NDArray[np.float64]
    series: NDArray[np.float64]


class Jumps(NamedTuple):
    """States and deviations after impacts, all surfaces one behind the other.

    These are state and deviation after an impact, and at rest.
    """

    landed: NDArray[np.float64]
    turned: NDArray[np.float64]
    stuck: NDArray[np.float64]
    held: NDArray[np.float64]


@inlined
def system_of(context, p, single):
    """Return the system of a context; with `single`, one whose loops over surfaces vanish."""
    free, general, begin, surfaces, size, dimension, several, order, projects, depends, impacts, watched, moving = (
        array_at(context, CONTEXT)
    )
    count, coupled = 1 if single else several, 0 if single else depends
    described = array_at(context, CONTEXT + count + count * count)
    return System(
        free,
        general,
        begin,
        surfaces,
        size,
        dimension,
        count,
        order,
        projects,
        coupled,
        impacts,
        watched,
        moving,
        described[CONTEXT : CONTEXT + count],
        described[CONTEXT + count :],
        p,
    )


@inlined
def look(system, t, lane, surfaces):
    """Evaluate the functions that decide about the mode of a lane."""
    call_surfaces(system.surfaces, t, lane.state, system.p, lane.signs, surfaces)


@loop
def load(lanes, i, lane):
    """Copy a lane to arrays of its own; return its time."""
    size, count = lane.state.size, lane.signs.size
    for j in range(size):
        lane.state[j] = lanes[j * LANES + i]
        lane.errors[j] = lanes[(size + 1 + 2 * count + j) * LANES + i]
    for e in range(count):
        lane.signs[e] = lanes[(size + 1 + e) * LANES + i]
        lane.slides[e] = lanes[(size + 1 + count + e) * LANES + i]
    for e in range(count + 1):
        lane.fresh[e] = lanes[(2 * size + 1 + 2 * count + e) * LANES + i]
    return lanes[size * LANES + i]


@loop
def store(lanes, i, t, lane):
    """Copy the arrays of a lane back."""
    size, count = lane.state.size, lane.signs.size
    for j in range(size):
        lanes[j * LANES + i] = lane.state[j]
        lanes[(size + 1 + 2 * count + j) * LANES + i] = lane.errors[j]
    lanes[size * LANES + i] = t
    for e in range(count):
        lanes[(size + 1 + e) * LANES + i] = lane.signs[e]
        lanes[(size + 1 + count + e) * LANES + i] = lane.slides[e]
    for e in range(count + 1):
        lanes[(2 * size + 1 + 2 * count + e) * LANES + i] = lane.fresh[e]


@inlined
def blame(lane, part):
    """Add a part of its size to the errors of a state: more than a tolerance allows."""
    for j in range(lane.state.size):
        lane.errors[j] += part * (1.0 + abs(lane.state[j]))
