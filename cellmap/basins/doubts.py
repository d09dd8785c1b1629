"""Warnings of basins in which many initial conditions have no attractor: how many, the likely cause, and a remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import pi

import numpy as np

from .._lib.arrays import Floats, evenly
from .._lib.checks import warn_caller
from ..attractors.kinds.creeping import creeping, orders_of
from ..attractors.kinds.transients import REMEDIES, Reason
from ..attractors.kinds.transients import UnsettledWarning as UnsettledWarning
from ..attractors.regions.extents import region_extent
from ..attractors.search import find_attractors
from ..attractors.settling.labels import LABEL_NAMES, Label
from ..attractors.settling.settle import Catalogue, settle
from ..attractors.translates import warning_of_translates
from ..maps.coordinates import difference
from ..maps.orbit_batch import Orbits
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
_GROWTH = 1.5  # factor between the sizes in successive spans of time, each twice as long, by which an orbit grows
_STILL, _STEADILY = 1.1, 1.04  # factors by which it grows in a quarter of the time after these spans, and an eighth
_FAR, _EVER = 100.0, 3  # sizes of the region that growing orbits reach, and spans of time in a row that they grow
_AFFORDED = 2e4  # evaluations that orbits take in their first periods, up to which attractors are searched for
_ATTRACTED = 200  # periods, or fewer where basins have fewer, in which an orbit that was tried comes to an attractor
_LOOKED_ON = 256  # periods after which the place where an orbit would rest has come to an attractor
_TIME = 0.01370521  # in periods, at which no forcing jumps


def warn_of_doubts(basins: Basins, release: Callable[[], None]) -> None:
    """Warn of each label without attractor that more than 5 % of the initial conditions carry, and of attractors.

    ``release`` gives back memory while labels are read, see :func:`fractions_of`.
    """
    fractions = fractions_of(basins.labels, len(basins.attractors), release)
    if doubtful := _not_verified(basins, {k: f.fraction for k, f in fractions.items()}):
        warn_caller(doubtful)
    if basins.point_map is not None and (repeated := warning_of_translates(basins.attractors, basins.point_map)):
        warn_caller(repeated)
    for message in _doubts(basins, {k: f.fraction for k, f in fractions.items() if k < 0 and f.fraction > _MANY}):
        warn_caller(message, UnsettledWarning)


def _doubts(basins: Basins, parts: Mapping[int, float]) -> Iterator[str]:
    turning, unbounded = _turning(basins), ""
    for label in (Label.UNDECIDED, Label.OUT_OF_STEPS, Label.DIVERGED):
        # A turning angle grows as well; and there are systems with a basin of infinity, of which nobody need be told.
        if label not in parts or turning or (label == Label.DIVERGED and basins.attractors):
            continue
        if basins.point_map is not None and (
            unbounded := _growing(basins, basins.point_map.without_table, _some(basins, label))
        ):
            yield f"{parts[label]:.1%} of the initial conditions are {LABEL_NAMES[label]}: {unbounded}"
            parts = {k: part for k, part in parts.items() if k != label}
    if Label.UNDECIDED in parts and basins.undecided:
        cause, count = max(basins.undecided.items(), key=lambda item: item[1])
        examined, remedy = sum(basins.undecided.values()), REMEDIES[Reason(cause)]
        ways = {Reason.CREEPING: _creep, Reason.FADING: _fade, Reason.RESONANT: _drift}
        measured = ways.get(Reason(cause), lambda _: "")(basins)
        yield (
            f"{parts[Label.UNDECIDED]:.1%} of the initial conditions are undecided: {count} of {examined} examined: "
            f"{cause}{measured}; {remedy.format(basins.settings['max_periods'])}{turning}"
        )
    if Label.ESCAPED in parts:
        yield (
            f"{parts[Label.ESCAPED]:.1%} of the initial conditions escaped from the window of the interpolated map: "
            f"give it a larger grid, or outside='integrate'{turning}"
        )
    if Label.OUT_OF_STEPS in parts:
        what = _remedy(basins, Label.OUT_OF_STEPS)[1] + cycles_of(basins.point_map)
        yield f"{parts[Label.OUT_OF_STEPS]:.1%} of the initial conditions are out of steps: {what}"
    if Label.DIVERGED in parts:
        helps, what = _remedy(basins, Label.DIVERGED)
        if helps:
            yield f"{parts[Label.DIVERGED]:.1%} of the initial conditions seem to diverge: {what}"


def _not_verified(basins: Basins, parts: Mapping[int, float]) -> str:
    """Tell how many attractors have a region that nothing verifies, and how many initial conditions come to them."""
    rows = [k for k, a in enumerate(basins.attractors) if a.neighbourhood is not None and not a.verified]
    if not rows:
        return ""
    return (
        f"{len(rows)} of {len(basins.attractors)} attractors are not verified, and "
        f"{sum(parts[k] for k in rows):.1%} of the initial conditions come to them: they are found by recurrence, as "
        "orbits beside them are seen to come back; see Attractor.verified, and compare with verify(search=True)"
    )


def cycles_of(point_map: PointMap | None) -> str:
    """Tell of a forcing with many cycles in a period."""
    spec = None if point_map is None else point_map.without_table.spec
    return spec.system.cycles if isinstance(spec, Stroboscopic) else ""


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
    return f", by about {moves:.1g} in a period{_fade(basins)}{where}"


def _fade(basins: Basins) -> str:
    """Tell how fast some of the undecided orbits approach a cycle: like 1/n to some power after n periods."""
    if basins.point_map is None:
        return ""
    orbits, extent = _undecided(basins, basins.point_map)
    orders = orders_of(basins.point_map.without_table, orbits.points[orbits.alive], extent)
    return f", like n^-{np.nanmedian(orders):.2g}" if np.isfinite(orders).any() else ""


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


def _undecided(basins: Basins, point_map: PointMap) -> tuple[Orbits, Floats]:
    """Return where some of the undecided orbits end, and the size of the region."""
    undecided = np.flatnonzero(basins.labels.ravel() == Label.UNDECIDED)
    places = InitialConditions(basins.grid, basins.initial_conditions)
    region = _region(basins)
    orbits = Orbits.starting(places.wrapped(undecided[evenly(len(undecided), _TRIED)], point_map))
    point_map.advance(orbits, basins.settings["max_periods"])
    return orbits, region_extent(point_map, region)


def _beside(place: Floats, attractors: Sequence[Attractor], extent: Floats) -> int:
    """Return the number of the attractor that a place is beside, -1 for none."""
    apart = [np.abs(difference(a.points, place, a.coordinates) / extent).max(axis=1).min() for a in attractors]
    return int(np.argmin(apart)) if apart and min(apart) <= _NEAR else -1


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

    More steps are tried, and the method for stiff systems, over the first periods, in which most orbits end; where that
    helps, it is seen whether orbits come to an attractor then.
    """
    point_map = basins.point_map
    spec = None if point_map is None else point_map.without_table.spec
    if not isinstance(spec, Stroboscopic):
        return False, "allow more with max_steps"
    points = _some(basins, label)
    enough = replace(spec, max_steps=max(spec.max_steps, MAX_STEPS))
    others = {f"max_steps={enough.max_steps}": enough} if enough.max_steps > spec.max_steps else {}
    if spec.is_explicit:
        others["method='Rosenbrock'"] = replace(enough, method="Rosenbrock")
    for changed, other in others.items():
        try:
            tried = other.build()
            ends = _ends(tried, points)
        except (TypeError, ValueError):
            continue
        helped = np.count_nonzero(ends.alive)
        if 2 * helped > len(points):
            if unbounded := _growing(basins, tried, points):
                return False, unbounded
            reach = f"{helped} of {len(points)} tried reach the end of their periods with {changed}"
            if ends.work.evaluations > _AFFORDED:
                return True, f"{reach}; whether they come to an attractor was not tried"
            periods = min(basins.settings["max_periods"], _ATTRACTED)
            number = _attracted(tried, points, periods)
            return True, f"{reach}, and {number or 'none'} of them an attractor within {periods}"
    return (
        False,
        f"allow more than max_steps={spec.max_steps}, or loosen rtol and atol, unless they blow up in finite time",
    )


def _region(basins: Basins) -> Floats:
    """Return points that show how large the region of the initial conditions is."""
    if basins.grid is not None:
        return np.array([basins.grid.lower, basins.grid.upper])
    places = InitialConditions(None, basins.initial_conditions)
    return places.points(evenly(len(places), _SAMPLE))


def _some(basins: Basins, label: Label) -> Floats:
    """Return a few of the initial conditions with a label."""
    rows = np.flatnonzero(basins.labels.ravel() == label)
    return InitialConditions(basins.grid, basins.initial_conditions).points(rows[evenly(len(rows), _TRIED)])


def _attracted(point_map: PointMap, points: Floats, periods: int) -> int:
    """Return how many of some orbits come to an attractor within some periods."""
    found = Catalogue.of(find_attractors(point_map, points, periods), point_map)
    return int(np.count_nonzero(settle(point_map, Orbits.starting(points.copy()), found, periods).labels >= 0))


def _growing(basins: Basins, point_map: PointMap, points: Floats) -> str:
    """Say which coordinates grow without end along some orbits, "" where most of the orbits do not.

    The largest values in spans of time, each twice as long as the one before, grow from one to the next, also those of
    orbits that end; and they are far beyond the region of the initial conditions at last.
    """
    region = _region(basins)
    scale = np.maximum(np.abs(region).max(axis=0), region_extent(point_map, region))
    scale = np.where([c.period is not None for c in point_map.coordinates], 1e300, scale)
    orbits, done, most = Orbits.starting(points.copy()), 0, basins.settings["max_periods"]
    peaks = np.full((_EVER + 1, *points.shape), np.inf)
    peaks[-1] = np.abs(points) / scale

    def largest(periods: int) -> Floats:
        peak = np.zeros_like(points)
        for _ in range(periods):
            point_map.advance(orbits, 1)
            peak = np.fmax(peak, np.abs(orbits.points) / scale)
        return peak

    while done + max(done, 1) <= most and orbits.alive.any():
        peak = largest(max(done, 1))
        done += max(done, 1)
        later = orbits.alive | (peak >= _GROWTH * peaks[-1]).any(axis=1)
        peaks[:, later] = np.concatenate([peaks[1:, later], peak[None, later]])
    grows = (peaks[1:] >= _GROWTH * peaks[:-1]).all(axis=0) & (peaks[-1] >= _FAR)
    grows &= ~orbits.alive[:, None] | (largest(done // 4) >= _STILL * peaks[-1])
    before = largest(done // 8)
    grows &= ~orbits.alive[:, None] | (largest(done // 8) >= _STEADILY * before)
    number = np.count_nonzero(grows.any(axis=1))
    if 2 * number <= len(points):
        return ""
    where = np.flatnonzero(2 * np.count_nonzero(grows, axis=0) > len(points))
    names = " and ".join(point_map.coordinates[j].name for j in where) or "some coordinate"
    size = (peaks[-1] * scale)[grows].max()
    return (
        f"nothing bounds the orbits: {number} of {len(points)} tried grow ever farther in {names}, to {size:.1g} "
        f"within {done} periods; check the signs of damping and of restoring forces, or add damping"
    )


def _ends(point_map: PointMap, points: Floats) -> Orbits:
    """Follow some orbits for a few periods."""
    orbits = Orbits.starting(points.copy())
    point_map.advance(orbits, _PERIODS)
    return orbits
