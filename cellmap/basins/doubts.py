"""Warnings of basins in which many initial conditions have no attractor: how many, the likely cause, and a remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import warn_caller
from ..attractors.creeping import creeping
from ..attractors.labels import Label
from ..attractors.search import region_extent
from ..attractors.settling import Catalogue, settle
from ..attractors.transients import REMEDIES, Reason
from ..attractors.transients import UnsettledWarning as UnsettledWarning
from ..maps.coordinates import difference
from ..maps.orbit_batch import Orbits, Status
from ..maps.point_map import PointMap
from ..maps.stroboscopic import MAX_STEPS, Stroboscopic
from ..orbits.attractor import Attractor, distinct_names
from ..orbits.invariant_circle import drift
from .initial_conditions import InitialConditions
from .record import Basins, fractions_of

_MANY = 0.05  # fraction of the initial conditions from which there is a warning
_TRIED = 8  # orbits that are integrated again
_PERIODS = 4
_SAMPLE = 1024  # initial conditions that show the size of a region
_NEAR = 0.01  # distance from the points of an attractor, in units of the region
_LOOKED_ON = 256  # periods after which the place where an orbit would rest has come to an attractor
_TIME = 0.01370521  # in periods, at which no forcing jumps


def warn_of_doubts(basins: Basins, release: Callable[[], None]) -> None:
    """Warn of each label without attractor that more than 5 % of the initial conditions carry.

    ``release`` gives back memory while labels are read, see :func:`fractions_of`.
    """
    fractions = fractions_of(basins.labels, len(basins.attractors), release)
    for message in _doubts(basins, {k: f.fraction for k, f in fractions.items() if k < 0 and f.fraction > _MANY}):
        warn_caller(message, UnsettledWarning)


def _doubts(basins: Basins, parts: Mapping[int, float]) -> Iterator[str]:
    if Label.UNDECIDED in parts and basins.undecided:
        cause, count = max(basins.undecided.items(), key=lambda item: item[1])
        examined, remedy = sum(basins.undecided.values()), REMEDIES[Reason(cause)]
        measured = {Reason.CREEPING: _creep, Reason.RESONANT: _drift}.get(Reason(cause), lambda _: "")(basins)
        yield (
            f"{parts[Label.UNDECIDED]:.1%} of the initial conditions are undecided: {count} of {examined} examined: "
            f"{cause}{measured}; {remedy.format(basins.settings['max_periods'])}{_turning(basins)}"
        )
    if Label.ESCAPED in parts:
        yield (
            f"{parts[Label.ESCAPED]:.1%} of the initial conditions escaped from the window of the interpolated map: "
            f"give it a larger grid, or outside='integrate'{_turning(basins)}"
        )
    if Label.OUT_OF_STEPS in parts:
        what = _remedy(basins, Label.OUT_OF_STEPS)[1]
        yield f"{parts[Label.OUT_OF_STEPS]:.1%} of the initial conditions are out of steps: {what}"
    if Label.DIVERGED in parts:
        helps, what = _remedy(basins, Label.DIVERGED)
        if helps:
            yield f"{parts[Label.DIVERGED]:.1%} of the initial conditions seem to diverge: {what}"


def _creep(basins: Basins) -> str:
    """Tell how far some of the orbits that creep to rest move in a period, and where many of them would come to."""
    point_map = basins.point_map
    if point_map is None:
        return ""
    orbits, extent = _undecided(basins, point_map)
    slow = creeping(point_map, orbits.points[orbits.alive], extent)
    if not slow.found.any():
        return ""
    ends = slow.ends[slow.found]
    owners = settle(
        point_map, Orbits.starting(ends.copy()), Catalogue.of(basins.attractors, point_map), _LOOKED_ON
    ).labels
    for k in np.flatnonzero(owners < 0):
        owners[k] = _beside(ends[k], basins.attractors, extent)
    known, names = owners[owners >= 0], distinct_names(basins.attractors)
    where = f", many of them towards {names[np.bincount(known).argmax()]}" if len(known) else ""
    moves = np.median(slow.moves[slow.found])
    return f", by about {moves:.1g} in a period{where}"


def _drift(basins: Basins) -> str:
    """Tell near which resonance the first of some undecided orbits drifts, and how long it takes to come round."""
    point_map = basins.point_map
    if point_map is None:
        return ""
    orbits, extent = _undecided(basins, point_map)
    alive = np.flatnonzero(orbits.alive)
    near = drift(point_map.without_table, orbits.points[alive[0]], extent) if len(alive) else None
    if near is None:
        return ""
    q, angles = near.denominator, [x for x, c in zip(near.numbers, basins.coordinates, strict=True) if c.is_angle]
    what = ", ".join(f"{round(x * q)}/{q} ({x:.8g} full rotations a period)" for x in angles) or f"of {q} periods"
    return f", {what}; they come round on it once in about {near.round:.1g} periods"


def _undecided(basins: Basins, point_map: PointMap) -> tuple[Orbits, NDArray[np.float64]]:
    """Return where some of the undecided orbits end, and the size of the region."""
    undecided = np.flatnonzero(basins.labels.ravel() == Label.UNDECIDED)
    places, grid = InitialConditions(basins.grid, basins.initial_conditions), basins.grid
    region = places.points(_spread(len(places), _SAMPLE)) if grid is None else np.array([grid.lower, grid.upper])
    orbits = Orbits.starting(places.wrapped(undecided[_spread(len(undecided), _TRIED)], point_map))
    point_map.advance(orbits, basins.settings["max_periods"])
    return orbits, region_extent(point_map, region)


def _beside(place: NDArray[np.float64], attractors: Sequence[Attractor], extent: NDArray[np.float64]) -> int:
    """Return the number of the attractor that a place is beside, -1 for none."""
    apart = [np.abs(difference(a.points, place, a.coordinates) / extent).max(axis=1).min() for a in attractors]
    return int(np.argmin(apart)) if apart and min(apart) <= _NEAR else -1


def _spread(number: int, most: int) -> NDArray[np.int64]:
    """Return at most so many of the numbers of rows, evenly spread."""
    return np.unique(np.linspace(0, number - 1, most).round().astype(np.int64))


def _turning(basins: Basins) -> str:
    """Name state variables on which the equations have period 2 pi and that are not declared as angles."""
    spec = None if basins.point_map is None else basins.point_map.without_table.spec
    if not isinstance(spec, Stroboscopic):
        return ""
    system, found = spec.system, []
    place = [0.1 + 0.73 * j for j in range(system.dimension)]
    for j, coordinate in enumerate(system.axes):
        if coordinate.period is not None:
            continue
        try:
            here, half, turned = (
                system.derivative(_TIME * system.length, [*place[:j], place[j] + s, *place[j + 1 :]])
                for s in (0.0, pi, 2 * pi)
            )
        except (ValueError, ZeroDivisionError, OverflowError):
            continue  # outside the domain of the right-hand side, which has no angle then
        if np.allclose(here, turned, 1e-9, 1e-12) and not np.allclose(here, half, 1e-3, 1e-6):
            found.append(coordinate.name)
    if not found:
        return ""
    remedy = ", ".join(f"angle({name!r})" for name in found)
    return f". The equations are the same when {' or '.join(found)} grows by 2 pi: if orbits may turn, give {remedy}"


def _remedy(basins: Basins, label: Label) -> tuple[bool, str]:
    """Integrate a few of the initial conditions otherwise; tell whether something helps, and what to change.

    More steps are tried, and the method for stiff systems, over the first periods, in which most orbits end.
    """
    point_map = basins.point_map
    spec = None if point_map is None else point_map.without_table.spec
    if not isinstance(spec, Stroboscopic):
        return False, "allow more with max_steps"
    rows = np.flatnonzero(basins.labels.ravel() == label)
    rows = rows[_spread(len(rows), _TRIED)]
    points = InitialConditions(basins.grid, basins.initial_conditions).points(rows)
    enough = replace(spec, max_steps=max(spec.max_steps, MAX_STEPS))
    others = {f"max_steps={enough.max_steps}": enough} if enough.max_steps > spec.max_steps else {}
    if spec.system.functions[1:] == (None, None) and spec.method != "Rosenbrock":
        others["method='Rosenbrock'"] = replace(enough, method="Rosenbrock")
    for changed, other in others.items():
        try:
            status = _ends(other.build(), points)
        except (TypeError, ValueError):
            continue
        helped = np.count_nonzero(status < Status.ESCAPED)
        if 2 * helped > len(points):
            return True, f"{helped} of {len(points)} tried reach the end of their periods with {changed}"
    return (
        False,
        f"allow more than max_steps={spec.max_steps}, or loosen rtol and atol, unless they blow up in finite time",
    )


def _ends(point_map: PointMap, points: np.ndarray) -> np.ndarray:
    """Return how the orbits of some points stand after a few periods."""
    orbits = Orbits.starting(points.copy())
    point_map.advance(orbits, _PERIODS)
    return orbits.status
