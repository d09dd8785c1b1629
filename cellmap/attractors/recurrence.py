"""Quasi-periodic attractors in many dimensions, by recurrence: time averages of orbits and of others beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from ..maps.compiled_advance import recorded
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.side_by_side import advance_on_threads
from ..orbits.attractor import Attractor, Kind, Neighbourhood
from ..orbits.invariant_circle import bump, circle_through, closed_after, signals_of
from .lyapunov_regions import Afford, always
from .settling import Catalogue

_ORBITS = 64  # followed in one look
_PERIODS = 512  # that are recorded
_AT_ONCE = 64  # periods between looks whether the end was asked for
_REGULAR = 1e-3  # difference of the averages of both halves, in units of an orbit's size, of one that is regular
_SMALL = 0.01  # least size of an orbit, in units of the region
_SAME = 0.02  # difference of averages of orbits on one attractor, in these units
_WIDTHS = (0.02, 0.0025, 0.0003)  # of regions where an attractor has none, in units of the region, one after the other
_MOST_PIECES = 8  # of an attractor, which the map permutes,
_SECTORS = 12  # of an angle that makes full rotations
_SPREAD = 0.5  # length of the mean of points on the unit circle below which they are spread all over it
_TIGHT = 1.2  # and how much larger they may be than those of other numbers of pieces
_LOOSE = 1.1  # factor by which a region is larger than the points seen
_BESIDE = 16  # orbits that begin in a region
_AVERAGED, _RETURNING = 256, 256  # periods over which their averages are taken, twice, and those between
_CLOSER = 0.5  # factor by which averages have to come closer meanwhile where an attractor attracts slowly
_RECENT = 64  # last points of an orbit, any of which may be in a region
_FRAME = 4  # directions in which growth is seen
_APART = 1e-5  # distance of orbits beside one another, in units of the region
_GROWING = 256  # periods of growth
_ZERO = 0.01  # largest size of an exponent that may be zero
_KEPT = 512  # points of an attractor


@dataclass(frozen=True, eq=False)
class _Averages:
    """Time averages (n, k) of orbits, by the weights of Das and others (2017), the error of each, and sizes (n, k)."""

    values: Floats
    errors: Floats
    sizes: Floats

    @classmethod
    def of(cls, history: Floats, point_map: PointMap, extent: Floats) -> _Averages:
        """Average the coordinates of orbits (periods, n, d), and their squares about the mean."""
        turn = turns_of(point_map.coordinates)[1]
        unit = np.where(turn > 0, 1.0, extent)
        periods, d = len(history), history.shape[-1]
        signals = signals_of(history.reshape(-1, d), point_map.coordinates).reshape(history.shape) / unit
        signals = np.concatenate([signals.real, signals.imag[..., turn > 0]], axis=-1)
        sizes = np.maximum(np.ptp(signals, axis=0), _SMALL)
        centred = (signals - signals.mean(axis=0)) / sizes
        half = periods // 2
        early, late = (
            np.concatenate([np.tensordot(bump(half), part, 1), np.tensordot(bump(half), part**2, 1)], axis=-1)
            for part in (centred[:half], centred[half : 2 * half])
        )
        mean = signals.mean(axis=0) / sizes
        whole = np.tensordot(bump(periods), centred, 1) + mean
        return cls(whole * sizes, np.abs(early - late), sizes)

    @property
    def regular(self) -> Bools:
        """Which orbits are regular: the averages of both halves are the same."""
        return np.asarray((self.errors <= _REGULAR).all(axis=1))

    def apart(self, other: _Averages, k: int) -> Floats:
        """Return the differences (n,) of the averages of other orbits from those of orbit k."""
        return np.asarray((np.abs(other.values - self.values[k]) / self.sizes[k]).max(axis=1))


def recurrent_attractors(
    exact: PointMap,
    states: Floats,
    extent: Floats,
    age: int,
    known: Sequence[Attractor],
    afford: Afford = always,
) -> tuple[list[Attractor], list[tuple[Floats, int]]]:
    """Return the quasi-periodic attractors on which orbits of some age are, and cycles that they are on instead.

    Up to 64 orbits are followed for as long again, and for 512 periods more.  One whose time averages over both halves
    of these are the same is regular, and quasi-periodic where its largest Lyapunov exponent is zero within 0.01 and one
    of the next ones is negative, as seen from orbits beside it (Benettin, Galgani, Strelcyn 1976).  Its region are
    ellipsoids of its pieces, or of sectors of an angle that makes full rotations.  Sixteen orbits that begin at the
    surface of the region must have the same averages in the end, or come closer to them; else it becomes narrower.

    The region is not a trapping region: nothing verifies that no orbit leaves it, and its `contraction` is 1.  All this
    takes some ten thousand images for each attractor, in any number of dimensions.
    """
    rows = np.unique(np.linspace(0, len(states) - 1, _ORBITS).round().astype(int))
    if not afford(len(rows) * (age + _PERIODS)):
        return [], []
    orbits = Orbits.starting(states[rows])
    _move(exact, orbits, age)
    outside = orbits.alive.copy()
    outside[outside] = Catalogue.of(known, exact).owners_of(orbits.points[outside]) < 0
    orbits = orbits[np.flatnonzero(outside)]
    if not len(orbits):
        return [], []
    history, rotations = _history(exact, orbits, _PERIODS)
    alive = orbits.alive
    history, rotations = history[:, alive], rotations[:, alive]
    averages = _Averages.of(history, exact, extent)
    found, cycles = list[Attractor](), list[tuple[Floats, int]]()
    for k in np.flatnonzero(averages.regular):
        path = history[:, k]
        period = closed_after(path, exact, extent)
        if period:
            cycles.append((path[-1], period))
        elif not (Catalogue.of(found, exact).owners_of(path[-_RECENT:]) >= 0).any():
            attractor = _attractor(exact, path, rotations[:, k], averages, int(k), extent, afford)
            found += [] if attractor is None else [attractor]
    return found, cycles


def _attractor(
    exact: PointMap, path: Floats, rotations: Ints, averages: _Averages, k: int, extent: Floats, afford: Afford
) -> Attractor | None:
    """Return the attractor of a regular orbit (periods, d), None where it is none that orbits beside it come to."""
    if not afford((_FRAME + 1) * _GROWING):
        return None
    exponents = _exponents(exact, path[-1], extent)
    if not (abs(exponents[0]) <= _ZERO and exponents[-1] < -_ZERO):
        return None
    turning = np.abs(np.ptp(rotations, axis=0)) > 0
    pieces = _pieces(exact, path, turning, extent)
    hulls = (_hull(exact, path, pieces, extent, width) for width in _WIDTHS)
    beside = _BESIDE * (2 * _AVERAGED + _RETURNING)
    region = next((hull for hull in hulls if afford(beside) and _all_return(exact, hull, averages, k, extent)), None)
    if region is None:
        return None
    still = (0,) * exact.dimension
    kept = path[-_KEPT:]
    none = np.empty(0, complex)
    circle = circle_through(exact, path, rotations)
    return Attractor(
        Kind.QUASIPERIODIC, 0, kept, still, none, exponents[:1], exact.coordinates, neighbourhood=region, circle=circle
    )


def _pieces(exact: PointMap, path: Floats, turning: Bools, extent: Floats) -> list[Ints]:
    """Return rows of the parts of an attractor that get an ellipsoid each.

    They are sectors of an angle that makes full rotations, the one that leaves the least spread, or pieces that the map
    permutes.
    """
    lower, turn = turns_of(exact.coordinates)
    candidates = [[np.arange(k, len(path), number) for k in range(number)] for number in range(1, _MOST_PIECES + 1)]
    if turning.any():
        sector = np.floor((path - lower) / np.where(turn > 0, turn, 1.0) * _SECTORS)
        candidates = [[np.flatnonzero(s == k) for k in np.unique(s)] for s in sector.T[turning]]
    spread = [
        sum(len(rows) * float((_about_mean(exact, path[rows])[1] / extent).var(axis=0).sum()) for rows in parts)
        for parts in candidates
    ]
    return candidates[int(np.argmax(np.array(spread) <= _TIGHT * min(spread)))]


def _about_mean(exact: PointMap, points: Floats) -> tuple[Floats, Floats]:
    """Return the mean of points, that on the circle for angles, and the points as seen from there."""
    turn = turns_of(exact.coordinates)[1]
    mean = signals_of(points, exact.coordinates).mean(axis=0)
    centre = np.where(turn > 0, np.angle(mean) * turn / (2 * np.pi), mean.real)
    return wrap(centre, exact.coordinates), difference(points, centre, exact.coordinates)


def _hull(exact: PointMap, path: Floats, pieces: Sequence[Ints], extent: Floats, width: float) -> Neighbourhood:
    """Return ellipsoids that hold the pieces of an orbit, across angles all over which a piece is spread."""
    turn = turns_of(exact.coordinates)[1]
    centres, metrics = [], []
    for rows in pieces:
        centre, shift = _about_mean(exact, path[rows])
        kept = ~((turn > 0) & (np.abs(signals_of(path[rows], exact.coordinates).mean(axis=0)) < _SPREAD))
        shift, unit = shift[:, kept] / extent[kept], extent[kept]
        form = np.linalg.inv(shift.T @ shift / len(shift) + width**2 * np.eye(len(unit)))
        size = _LOOSE * max(1.0, float(np.sqrt(np.einsum("ni,ij,nj->n", shift, form, shift).max())))
        metric = np.zeros((len(turn), len(turn)))
        metric[np.ix_(kept, kept)] = 0.5 * (form + form.T) / size**2 / np.outer(unit, unit)
        centres.append(centre)
        metrics.append(metric)
    return Neighbourhood(np.array(centres), np.array(metrics), 1.0)


def _all_return(exact: PointMap, region: Neighbourhood, averages: _Averages, k: int, extent: Floats) -> bool:
    """Tell whether orbits that begin at the surface of a region come to the averages of orbit k, or closer to them."""
    rng, begin = np.random.default_rng(0), []
    for number, (centre, metric) in enumerate(zip(region.centres, region.metrics, strict=True)):
        values, axes = np.linalg.eigh(metric * np.outer(extent, extent))
        across = values > 1e-12 * values.max()
        sphere = rng.standard_normal((len(range(number, _BESIDE, len(region.centres))), len(values)))
        sphere /= np.linalg.norm(sphere[:, across], axis=1, keepdims=True)
        # Along angles that turn orbits begin anywhere.
        lengths = np.where(across, 1.0 / np.sqrt(np.where(across, values, 1.0)), 1.0)
        begin.append(centre + (sphere * lengths) @ axes.T * extent)
    orbits = Orbits.starting(wrap(np.concatenate(begin), exact.coordinates))
    early, _ = _history(exact, orbits, _AVERAGED)
    _move(exact, orbits, _RETURNING)
    late, _ = _history(exact, orbits, _AVERAGED)
    if not orbits.alive.all():
        return False
    before, after = (averages.apart(_Averages.of(h, exact, extent), k) for h in (early, late))
    return bool((after <= np.maximum(_SAME, _CLOSER * before)).all())


def _exponents(exact: PointMap, state: Floats, extent: Floats) -> Floats:
    """Return the largest Lyapunov exponents per step, from orbits that begin beside that of a state."""
    d = exact.dimension
    number = min(_FRAME, d)
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((d, number)))[0]
    here, growth = state.copy(), np.zeros(number)
    for step in range(_GROWING):
        if step % _AT_ONCE == 0:
            check_stop()
        orbits = Orbits.starting(
            wrap(np.concatenate([here[None], here + _APART * frame.T * extent]), exact.coordinates)
        )
        exact.advance(orbits, 1)
        if not orbits.alive.all():
            return np.full(number, np.nan)
        here = orbits.points[0].copy()
        moved = difference(orbits.points[1:], here, exact.coordinates) / extent / _APART
        frame, upper = np.linalg.qr(moved.T)
        with np.errstate(divide="ignore"):
            growth += np.log(np.abs(np.diagonal(upper))) if step >= _GROWING // 8 else 0.0
    return np.asarray(growth / (_GROWING - _GROWING // 8))


def _move(exact: PointMap, orbits: Orbits, periods: int) -> None:
    """Move orbits on."""
    for begin in range(0, periods, _AT_ONCE):
        check_stop()
        advance_on_threads(exact.advance, orbits, min(_AT_ONCE, periods - begin))


def _history(exact: PointMap, orbits: Orbits, periods: int) -> tuple[Floats, Ints]:
    """Move orbits on; return where they have been (periods, n, d), and their full rotations."""
    parts = [(points.copy(), rotations.copy()) for points, rotations, _ in recorded(exact.advance, orbits, periods)]
    return np.concatenate([p for p, _ in parts]), np.concatenate([r for _, r in parts])
