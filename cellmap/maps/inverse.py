"""Inverse maps: backward integration of a flow, and Newton's method along a curve for other maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Bools, Floats
from .._lib.checks import shown
from .._lib.signatures import checked
from .coordinates import turns_of, wrap
from .parameters_as_states import with_states
from .point_map import PointMap, follow
from .specification import MapSpec
from .stroboscopic import MAX_STEPS, Stroboscopic, check_tolerances, with_further
from .system import ForcedSystem
from .tangent import tangent

_ITERATIONS = 40
_CONVERGED = 1e-11
_ROUNDING = 1e-13  # rounding of an image, relative to its size
_FARTHEST = 0.5  # largest distance from the foreseen place, in steps that lead there
_MOST = 64  # points of a curve whose preimages are sought together
_HALVINGS = 7
_RESTARTS = 100  # behind gaps of one curve
_LOOP = 64  # points on a circle, from whose derivatives the turns of its image are known


@checked
def inverse_stroboscopic_map(
    system: ForcedSystem,
    phase: float = 0.0,
    rtol: float = 1e-12,
    atol: ArrayLike | Mapping[str, float] = 1e-12,
) -> PointMap:
    """Return the inverse stroboscopic map: from a state to the state one period earlier, by backward integration.

    Parameters
    ----------
    system : ForcedSystem
        A system without switches, so that its solutions are unique backwards in time.
    phase : float, optional
        Phase of the forcing at the section, as in :func:`stroboscopic_map`.
    rtol, atol
        Tolerances of one period, as for :func:`stroboscopic_map`.

    Returns
    -------
    PointMap
        The inverse of ``stroboscopic_map(system, phase)``; its angles rotate in the opposite direction.  With damping
        it expands phase-space volume, so that errors grow.

    Raises
    ------
    TypeError, ValueError
        For something that is not a system, or a system with switches.

    Examples
    --------
    >>> from cellmap import ForcedSystem, stroboscopic_map
    >>> decay = ForcedSystem(lambda t, x, p: (-x[0],), {}, 1.0, ("x",))
    >>> inverse_stroboscopic_map(decay)(stroboscopic_map(decay, rtol=1e-13, atol=1e-13)([0.5])).round(12)
    array([0.5])
    """
    return Inverse(system, phase, rtol, atol).build()


@dataclass(frozen=True, eq=False)
class Inverse(MapSpec[PointMap]):
    """Specification of an inverse stroboscopic map; see :func:`inverse_stroboscopic_map`."""

    kind = "inverse"
    system: ForcedSystem
    phase: float
    rtol: float
    atol: Any
    """A number, or a tuple of one for each coordinate."""

    def __post_init__(self) -> None:
        if not isinstance(self.system, ForcedSystem):
            raise TypeError(f"system={shown(self.system)}: give a ForcedSystem")
        if self.system.functions[1:] != (None, None):
            raise ValueError(
                f"system={self.system!r} has switches or impacts: its solutions are not unique backwards in time"
            )
        check_tolerances(self)

    def make(self) -> PointMap:
        """Return the map, without its specification."""
        forward = self.system.rhs

        def backward(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
            return tuple(-v for v in forward(-t, x, p))

        turned = replace(self.system, rhs=backward, name=f"{self.system.name}, backwards", outputs={})
        return Stroboscopic(turned, -self.phase, self.rtol, self.atol, "auto", MAX_STEPS).make()

    def swept(self, names: tuple[str, ...]) -> Inverse | None:
        """Return the specification with some parameters appended to the state, where the formulas are known."""
        further = with_states(self.system, names)
        return None if further is None else replace(self, system=further, atol=with_further(self.atol, len(names)))


def extra_turns(point_map: PointMap, about: Floats) -> Floats:
    """Return the matrix (d, d) of the full rotations that an image gains, beyond those of its point.

    It is 0 for the map of a flow, and for any other that can be drawn together to one that leaves all points where they
    are.  Of the cat map it is not: its image of a circle winds round the torus in another way.
    """
    exact = point_map.without_table
    turn = turns_of(exact.coordinates)[1]
    circles = np.flatnonzero(turn > 0.0)
    extra = np.zeros((len(turn), len(turn)))
    if exact.is_flow:
        return extra
    for j in circles:
        loop = np.tile(about, (_LOOP, 1))
        loop[:, j] += turn[j] * np.arange(_LOOP) / _LOOP
        # The mean of a periodic derivative is the increment of its integral over one period.
        gained = tangent(exact, loop)[1][:, circles, j].mean(axis=0) * turn[j] / turn[circles]
        whole = np.round(gained)
        if np.isfinite(gained).all() and np.abs(gained - whole).max() < 0.1:
            extra[circles, j] = (whole - (circles == j)) * turn[circles] / turn[j]
    return extra


@dataclass(frozen=True, eq=False)
class LiftedMap:
    """One step of a map on the plane that covers its circles: angles are unwrapped, and neighbours stay neighbours.

    ``mapping``: the map; ``extra``: see :func:`extra_turns`.
    """

    mapping: PointMap
    extra: Floats

    @property
    def exact(self) -> PointMap:
        """The exact map."""
        return self.mapping.without_table

    def __call__(self, points: Floats) -> Floats:
        """Return the images of points (n, d), NaN of those that are not finite."""
        images = np.full(points.shape, np.nan)
        rows = np.flatnonzero(np.isfinite(points).all(axis=1))
        if len(rows):
            wrapped = wrap(points[rows], self.mapping.coordinates)
            images[rows] = self._turned(points[rows], wrapped) + follow(self.mapping, wrapped, 1).unwrapped
        return images

    def tangent(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the images of points (n, d) and the derivatives there."""
        wrapped = wrap(points, self.exact.coordinates)
        images, matrices = tangent(self.exact, wrapped)
        return self._turned(points, wrapped) + images, matrices

    def _turned(self, points: Floats, wrapped: Floats) -> Floats:
        """Return the turns of images that come from the turns of points."""
        rotations = points - wrapped
        return np.asarray(rotations + rotations @ self.extra.T)


def preimages(step: LiftedMap, targets: Floats, guesses: Floats) -> tuple[Floats, Floats, Bools]:
    """Solve P(x) = target, with unwrapped angles, by a damped Newton method.

    Returns preimages (n, d), the derivatives there (n, d, d), and which of them converged.
    """
    points, base = np.array(guesses, dtype=float), np.array(guesses, dtype=float)
    n, d = points.shape
    steps_to, matrices = np.zeros((n, d)), np.full((n, d, d), np.nan)
    settled = np.zeros(n, bool)
    turn = turns_of(step.exact.coordinates)[1]
    active = np.flatnonzero(np.isfinite(points).all(axis=1) & np.isfinite(targets).all(axis=1))
    last, fraction = np.full((n, d), np.inf), np.ones(n)
    for _ in range(_ITERATIONS):
        if not len(active):
            break
        images, derivative = step.tangent(points[active])
        rest = images - targets[active]
        scale = np.abs(targets[active]) + np.abs(base[active]) + np.where(turn > 0, turn, 1.0)
        with np.errstate(invalid="ignore", over="ignore"):
            size, before = (np.abs(r / scale).max(axis=1) for r in (rest, last[active]))
            regular = np.isfinite(size) & np.isfinite(derivative).all(axis=(1, 2))
        regular[regular] = np.abs(np.linalg.det(derivative[regular])) > 1e-300
        # A step that does not bring the image nearer is halved; below rounding it need not.
        better = regular & ((size < before) | (size < _ROUNDING))
        good, bad = active[better], active[~better]
        base[good], last[good], matrices[good] = points[good], rest[better], derivative[better]
        steps_to[good] = np.linalg.solve(derivative[better], -rest[better][..., None])[..., 0]
        fraction[good], fraction[bad] = np.minimum(2.0 * fraction[good], 1.0), 0.5 * fraction[bad]
        points[active] = base[active] + fraction[active, None] * steps_to[active]
        done = better & (np.abs(steps_to[active]) <= _CONVERGED * scale).all(axis=1)
        settled[active[done]] = True
        active = active[~done & (fraction[active] > 0.5**_HALVINGS) & np.isfinite(last[active]).all(axis=1)]
    return points, matrices, settled


def preimages_along(step: LiftedMap, targets: Floats, first: Floats, known: tuple[Floats, Floats]) -> Floats:
    """Return preimages (n, d) of the points of a curve that form a curve themselves, given a guess for the first.

    Of several preimages it takes the one that the derivative foresees from the neighbour before.  Behind a gap, rows of
    NaN or a place where that fails, it restarts from the nearest of some known pairs of points and preimages.
    """
    found = np.full(targets.shape, np.nan)
    usable: Bools = np.logical_and.reduce(np.isfinite(targets), axis=1)
    rows = np.flatnonzero(usable)
    guess, row = first, int(rows[0]) if len(rows) else len(targets)
    for _ in range(_RESTARTS):
        while row < len(targets) and not usable[row]:
            row += 1
        if row == len(targets):
            break
        if row > rows[0]:
            apart = np.linalg.norm(known[0] - targets[row], axis=1)
            guess = known[1][int(np.argmin(apart))]
        stop = row + int(np.argmin(np.append(usable[row:], False)))
        count = _follow(step, targets[row:stop], guess, found[row:stop])
        row += max(count, 1)
    return found


def _follow(step: LiftedMap, targets: Floats, first: Floats, found: Floats) -> int:
    """Fill in preimages of the points of a curve as far as they are found; return how many."""
    points, matrices, settled = preimages(step, targets[:1], first[None])
    if not settled[0]:
        return 0
    found[0], matrix = points[0], matrices[0]
    k, batch = 0, 1
    while k + 1 < len(targets):
        ahead = np.arange(k + 1, min(k + 1 + batch, len(targets)))
        taken, last = _advance(step, targets[k], found[k], matrix, targets[ahead])
        count = len(taken)
        if count == 0 and len(ahead) > 1:
            batch = 1
        elif count == 0:
            bridged = _bridge(step, targets[k], found[k], matrix, targets[k + 1])
            if bridged is None:
                break
            found[k + 1], matrix = bridged
            k += 1
        else:
            found[ahead[:count]], matrix = taken, last
            k += count
            batch = min(2 * batch, _MOST) if count == len(ahead) else max(1, count)
    return k + 1


def _advance(step: LiftedMap, at: Floats, place: Floats, matrix: Floats, targets: Floats) -> tuple[Floats, Floats]:
    """Return preimages of the first targets, as many as come out where the derivative foresees them."""
    foreseen = np.linalg.solve(matrix, (targets - at).T).T
    points, matrices, settled = preimages(step, targets, place + foreseen)
    off = np.linalg.norm(points - place - foreseen, axis=1)
    good = settled & (off <= _FARTHEST * np.linalg.norm(foreseen, axis=1) + 1e-13)
    count = len(good) if good.all() else int(np.argmin(good))
    return points[:count], matrices[count - 1] if count else matrix


def _bridge(step: LiftedMap, at: Floats, place: Floats, matrix: Floats, target: Floats) -> tuple[Floats, Floats] | None:
    """Reach the preimage of the next target by shorter steps along the segment between the two."""
    done, fraction = 0.0, 0.5
    now = at
    while done < 1.0:
        if fraction < 0.5**_HALVINGS:
            return None
        ahead = at + min(done + fraction, 1.0) * (target - at)
        taken, last = _advance(step, now, place, matrix, ahead[None])
        if len(taken):
            now, place, matrix, done = ahead, taken[0], last, min(done + fraction, 1.0)
            fraction *= 2.0
        else:
            fraction *= 0.5
    return place, matrix
