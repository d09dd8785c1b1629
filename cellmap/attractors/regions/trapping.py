"""Verified trapping regions of attractors."""

from __future__ import annotations

import functools

import numpy as np

from ..._lib.arrays import Bools, Complexes, Floats
from ..._lib.threads import slices
from ...maps.coordinates import turns_of
from ...maps.point_map import PointMap
from ...maps.tangent import tangent
from ...orbits.attractor import Attractor, Neighbourhood
from ...orbits.ellipsoids import directions, displaced, eigenvector_metrics, summed_metric
from .lyapunov_regions import Afford, always, lyapunov_neighbourhood
from .tube import SAMPLED

_DIRECTIONS = 96  # on a circle
_FINE = {1: 1.01, 2: 1.0 + 2 * np.pi / _DIRECTIONS}  # from one shell to the next; else 1.25
_FARTHEST_IN = 10.0  # factor by which the smallest of shells that were verified for a similar map is smaller
_AHEAD = 8  # shells to which radii are chosen at once,
_STRETCHES = {1: 32}  # as many times this number in one dimension, where each has two points only
_GROWN = 2  # points of an attractor whose ellipsoids grow as far as they can; the others only begin
_ALL_BUT_LINEAR = 0.5  # largest nonlinear remainder, with errors, of a first surface, in contraction margins
_STRAIGHT = 0.1  # the same from which a step as long as the next is safe
_COARSE = (2.0, 4.0)  # factors between small surfaces, as the nonlinear remainder allows,
_SMALL = 0.01  # up to this part of the largest one
_COARSE_AHEAD = 7  # of these surfaces that are tested together,
_TOGETHER = 1024  # points of surfaces at most: more are worth it only if all of these pass
_ATTEMPTS = 16  # smaller radii at which the map may be all but linear, and
_ABOVE = 5  # octaves above the resolved one
_WIDE_MARGIN = 0.25  # contraction margin from which it may be rounding that hides what the map does around a point
_FLIPPING = -0.9  # multiplier below which two periods of the attractor are taken together
_NARROWEST = 1e-6  # smallest region in which ellipsoids are sought, relative to abs(point)
_FARTHEST = 1e4  # largest half-width of an ellipsoid, relative to 1 + abs(point)


def trapping_neighbourhood(
    point_map: PointMap, attractor: Attractor, extent: Floats, afford: Afford = always
) -> Neighbourhood | None:
    """Return ellipsoids around a periodic attractor in which every orbit is verified to approach it.

    The linear map contracts in the metric by a known factor c < 1.  From a small ellipsoid on which the exact map is
    seen to be nearly linear, the ellipsoids grow in steps of some percent as long as the exact map shortens the
    distance to the attractor, by a factor of at most (1 + c)/2 in one period of the attractor, everywhere on their
    surfaces.  As this distance falls from period to period, the ellipsoid contains no other attractor.  (Close to a
    flip, two periods count as one.)

    An orbit visits all points of the attractor, so that wide ellipsoids around a few are as good as around all: only
    those grow that promise to be widest along the direction of slowest approach.  No half-width is larger than a
    quarter of the extent of the region, unless the attractor lies more than a million times as far away from the
    origin.  Where rounding hides what the map does in the neighbourhood of a point, as it may on a long superstable
    cycle, the ellipsoid is one that the map is seen to take into that of a later point.

    In more than four dimensions regions come from Lyapunov functions and few images, of which there are as many as one
    can `afford`, see :func:`lyapunov_neighbourhood`.

    None where even the smallest ellipsoid fails around every point, as it does where the largest multiplier is too
    close to 1.
    """
    exact = point_map.without_table
    limit, rounds = _limit(exact, attractor, extent), _rounds(attractor)
    periods = rounds * attractor.period
    contraction = 0.5 * (1.0 + float(np.abs(attractor.multipliers[0])) ** rounds)
    steps = tangent(exact, attractor.points, coarse=exact.dimension > SAMPLED)[1]
    if exact.dimension > SAMPLED:
        return lyapunov_neighbourhood(exact, attractor, steps, limit, afford)
    slow = _slowest(steps)
    begun, hidden, preferred = dict[int, _Shells](), dict[int, _Shells](), 0
    for k, centre in enumerate(attractor.points):
        matrix = np.linalg.matrix_power(_product(np.roll(steps, -k, axis=0)), rounds)
        scaled = _metrics(matrix * limit / limit[:, None], contraction)
        choice = [_Shells(exact, centre, periods, matrix, metric, contraction, limit) for metric in scaled]
        if k == 0:
            preferred = int(np.argmax([c.begin() / max(c.length(slow[0]), 1e-300) for c in choice]))
        # What suits one point suits the others, for the most part.
        choice = choice[preferred:] + choice[:preferred]
        shells = next((c for c in choice if c.radius > 0.0 or c.begin() > 0.0), None)
        if shells is not None:
            begun[k] = shells
        elif choice[0].margin < _WIDE_MARGIN:
            return None
        else:
            hidden[k] = choice[0]
    # On a superstable cycle no direction is left to compare.
    widths = {k: shells.promised / max(shells.length(slow[k]), 1e-300) for k, shells in begun.items()}
    for k in sorted(begun, key=lambda k: -widths[k])[:_GROWN]:
        begun[k].grow()
    for k, shells in hidden.items():
        later = next((j for j in range(1, attractor.period) if (k + j) % attractor.period in begun), 0)
        if not later or not shells.shrink_into(begun[(k + later) % attractor.period], later):
            return None
    every = [(begun | hidden)[k] for k in range(attractor.period)]
    metrics = np.array([shells.metric / shells.radius**2 for shells in every])
    return Neighbourhood(attractor.points, metrics, max(shells.worst for shells in every) ** (1.0 / rounds))


def still_trapping(
    point_map: PointMap, attractor: Attractor, extent: Floats, before: Neighbourhood
) -> Neighbourhood | None:
    """Return ellipsoids like those that an attractor had at another value of a parameter, once they are verified.

    Surfaces are tested as in :func:`trapping_neighbourhood`, from the first on which the map is nearly linear; where
    the steps between them are wider, factors on consecutive surfaces count with half of their difference.  None where
    the ellipsoids would have to be much smaller than they were, or differ in more than size.
    """
    if len(before.centres) != len(attractor.points) or point_map.dimension > SAMPLED:
        return None
    exact, rounds = point_map.without_table, _rounds(attractor)
    limit, d = _limit(exact, attractor, extent), exact.dimension
    radii, fine = _around(_FINE.get(d, 1.25), d)
    contraction = 0.5 * (1.0 + float(np.abs(attractor.multipliers[0])) ** rounds)
    steps, metrics, worst = tangent(exact, attractor.points)[1], list[Floats](), 0.0
    for k, (centre, metric) in enumerate(zip(attractor.points, before.metrics, strict=True)):
        matrix = np.linalg.matrix_power(_product(np.roll(steps, -k, axis=0)), rounds)
        scaled = metric * np.outer(limit, limit)
        shells = _Shells(exact, centre, rounds * attractor.period, matrix, scaled, contraction, limit)
        factors, remainders = shells.factors(radii[: fine + 3])
        if len(factors) < len(radii) and not (remainders <= _ALL_BUT_LINEAR * shells.margin).any():
            further = shells.factors(radii[fine + 3 :])
            factors, remainders = np.append(factors, further[0]), np.append(remainders, further[1])
        begun = int(np.argmax(remainders <= _ALL_BUT_LINEAR * shells.margin))
        bounds = np.maximum(factors, np.append(factors[1:], 0.0))
        bounds[fine:-1] += 0.5 * np.abs(np.diff(factors[fine:]))
        # Inside of one that is taken all have to pass as far as the one on which the map is nearly linear.
        bounds[begun], bounds[begun + 1 :] = factors[begun], 0.0
        bounds = np.maximum.accumulate(bounds[::-1])[::-1]
        good = (bounds[: fine + 1] <= shells.allowed) & (radii[: fine + 1] <= (1.0 + 1e-9) * shells.largest)
        if not good.any() or not remainders[begun] <= _ALL_BUT_LINEAR * shells.margin:
            return None
        taken = int(np.argmax(good))
        metrics.append(metric / radii[taken] ** 2)
        worst = max(worst, shells.linear, float(bounds[taken]))
    return Neighbourhood(attractor.points, np.array(metrics), worst ** (1.0 / rounds))


def _around(fine: float, dimension: int) -> tuple[Floats, int]:
    """Return radii of surfaces from above 1 to a tenth, and how many of them are fine steps apart."""
    if dimension == 1:
        radii = fine ** -np.arange(-1.0, np.log(_FARTHEST_IN) / np.log(fine))
        return radii, len(radii) - 1
    near, wider = fine ** -np.arange(-1.0, 4.0), fine**4
    return np.append(near, near[-1] * wider ** -np.arange(1.0, np.log(_FARTHEST_IN) / np.log(wider))), len(near) - 1


def _limit(exact: PointMap, attractor: Attractor, extent: Floats) -> Floats:
    """Return the largest half-widths of ellipsoids."""
    turn = turns_of(exact.coordinates)[1]
    # Rounding far away from the origin would hide all that happens in a tiny region.
    extent = extent * max(1.0, float((_NARROWEST * np.abs(attractor.points) / extent).max()))
    reach = _FARTHEST * (1.0 + np.abs(attractor.points).max(axis=0))
    return np.minimum(np.where(turn > 0, np.minimum(extent, turn), extent) / 4.0, reach)


def _rounds(attractor: Attractor) -> int:
    """Return the periods of the attractor after which distances are compared.

    Close to a flip, x -> -x + a x^2 + ..., the quadratic terms of two consecutive periods cancel, so that two periods
    contract on a far larger neighbourhood than one.
    """
    slowest = attractor.multipliers[0]
    return 1 + int(slowest.imag == 0.0 and slowest.real < _FLIPPING)


class _Shells:
    """Surfaces around one point of an attractor, from small to large."""

    def __init__(
        self,
        exact: PointMap,
        centre: Floats,
        period: int,
        matrix: Floats,
        metric: Floats,
        contraction: float,
        limit: Floats,
    ) -> None:
        self.exact, self.centre, self.period, self.matrix = exact, centre, period, matrix
        # In units of the limits all coordinates are of one size.
        self.metric = metric / np.outer(limit, limit)
        root = np.linalg.cholesky(self.metric)
        inverse_root = np.linalg.inv(root).T  # unit sphere -> unit ellipsoid
        sphere = directions(exact.dimension, _DIRECTIONS, 128 * exact.dimension)
        self.offsets = sphere @ inverse_root.T
        self.linear = float(np.linalg.norm(root.T @ matrix @ inverse_root, 2))
        self.together = max(1, _TOGETHER // len(self.offsets))
        self.fine = _FINE.get(exact.dimension, 1.25)
        self.allowed = 0.5 * (1.0 + contraction)
        self.margin = self.allowed - self.linear
        rtol, atol = exact.tolerance
        noise = 2.0 * period * (atol + rtol * (np.abs(centre) + limit * 1e-3))
        self.resolved = float(np.sqrt(noise @ np.abs(self.metric) @ noise)) / max(0.5 * self.margin, 1e-300)
        self.largest = float((limit / np.sqrt((inverse_root**2).sum(axis=-1))).min())
        self.radius = self.promised = 0.0
        self.seen: dict[float, tuple[float, float]] = {}
        self.worst = self.linear

    def length(self, vector: Complexes) -> float:
        """Return the length of a vector in the metric."""
        return float(np.sqrt(np.real(vector.conj() @ self.metric @ vector)))

    def begin(self) -> float:
        """Find a radius at which the map is seen to be nearly linear; return the one predicted from its remainder.

        The map is nearly linear inside as well.  The image differs from that of the linear part by the nonlinear
        remainder and the error of the map together: where the sum is small, both are.  The first radius is sought near
        the one that the tolerance resolves at worst; most maps are far better than their tolerance, and near weakly
        attracting cycles the map is nonlinear before its tolerance resolves anything.  From there the radius grows as
        long as the remainder is small.
        """
        fraction = self._first() if self.margin > 0.0 else np.inf
        while fraction <= _STRAIGHT and self.radius <= _SMALL * self.largest:
            fraction = self._try(_COARSE[int(fraction * _COARSE[1] <= _STRAIGHT)] * self.radius, _COARSE_AHEAD)
        return self.promised

    def _first(self) -> float:
        """Take the first radius found at which the map is nearly linear; return the nonlinear remainder there."""
        nearest = min(max(self.resolved, 1e-12 * self.largest), self.largest)
        radius, before = nearest, np.inf
        for _ in range(_ATTEMPTS):
            fraction = self._try(radius)
            if self.radius or before < fraction < np.inf:
                break
            # The remainder, which falls with the radius, determines the next one; the relative error of the map rises.
            radius, before = radius * min(max(0.5 * _ALL_BUT_LINEAR / fraction, 1.0 / 16.0), 0.5), fraction
        for octave in range(1, _ABOVE + 1):
            if self.radius or nearest * 2.0**octave > self.largest:
                break
            fraction = self._try(nearest * 2.0**octave)
        return fraction

    def _try(self, radius: float, ahead: int = 1) -> float:
        """Take a radius if the map is nearly linear there; return the nonlinear remainder over the contraction margin.

        Further surfaces are tested together with this one, as far as they are likely to be tried next.
        """
        if radius not in self.seen:
            radii = radius * _COARSE[1] ** np.arange(float(min(ahead, self.together)))
            radii = radii[radii <= max(radius, _COARSE[1] * _SMALL * self.largest)]
            self.seen |= zip(radii.tolist(), zip(*self.factors(radii), strict=True), strict=True)
        factor, remainder = self.seen[radius]
        fraction = float(remainder) / self.margin
        if fraction <= _ALL_BUT_LINEAR and factor <= self.allowed:
            self.radius, self.worst = radius, max(self.worst, float(factor))
            self.promised = min(radius / max(fraction, 1e-300), self.largest)
        return fraction

    def grow(self) -> None:
        """Take the largest radius up to which all surfaces pass, from one that does."""
        while self.radius < self.largest:
            steps, radii = self.fine ** np.arange(1.0, _AHEAD + 1.0), [self.radius]
            for _ in range(_STRETCHES.get(self.exact.dimension, 1)):
                radii += np.minimum(radii[-1] * steps, self.largest).tolist()
            for part in slices(len(radii) - 1, self.together):
                batch = np.array(radii[1:][part])
                factors, _ = self.factors(batch)
                failed = np.flatnonzero(~(factors <= self.allowed))
                passed = int(failed[0]) if len(failed) else len(batch)
                if passed:
                    self.radius = float(batch[passed - 1])
                    self.worst = max(self.worst, float(factors[:passed].max()))
                if len(failed):
                    return

    def shrink_into(self, later: _Shells, steps: int) -> bool:
        """Take a radius at which the surface comes into the ellipsoid of a later point; tell whether there is one."""
        radii = later.radius * 0.25 ** np.arange(float(_ATTEMPTS))
        after, alive = self._displaced(radii, steps, later.centre)
        # Half of it: the points between those of the surface come into all of it.
        with np.errstate(invalid="ignore"):
            inside = ((later.norm(after) <= 0.5 * later.radius) & alive).all(axis=1)
        self.radius = float(radii[np.argmax(inside)]) if inside.any() else 0.0
        return self.radius > 0.0

    def factors(self, radii: Floats) -> tuple[Floats, Floats]:
        """Bound the factor by which distances change in one period of the attractor; also return nonlinear remainders.

        The smaller of two bounds for each surface: the factors observed, and the linear part plus the observed
        remainder, each with an allowance for directions between neighbouring ones.
        """
        after, alive = self._displaced(radii, self.period, self.centre)
        seen = self.norm(after) / radii[:, None]
        rest = self.norm(after - radii[:, None, None] * self.offsets @ self.matrix.T) / radii[:, None]
        seen, rest = np.where(alive, seen, np.inf), np.where(alive, rest, np.inf)
        with np.errstate(invalid="ignore"):
            bound = np.minimum(_between(seen).max(axis=1), self.linear + _between(rest).max(axis=1))
        return np.where(np.isnan(bound), np.inf, bound), rest.max(axis=1)

    def _displaced(self, radii: Floats, periods: int, end: Floats) -> tuple[Floats, Bools]:
        """Return displacements (n, k, d) from a point of the images of surfaces, and which images there are."""
        centres, ends = (np.tile(point, (len(radii), 1)) for point in (self.centre, end))
        return displaced(self.exact, centres, radii[:, None, None] * self.offsets, np.full(len(radii), periods), ends)

    def norm(self, vectors: Floats) -> Floats:
        """Return the lengths of vectors in the metric."""
        return np.asarray(np.sqrt(np.maximum(np.einsum("sni,ij,snj->sn", vectors, self.metric, vectors), 0.0)))


def _between(values: Floats) -> Floats:
    """Add to values on a circle of directions half of what they change to the next; others are dense enough."""
    if values.shape[1] != _DIRECTIONS:
        return values
    return np.asarray(values + 0.5 * np.abs(values - np.roll(values, 1, axis=1)))


def _metrics(matrix: Floats, contraction: float) -> list[Floats]:
    """Return metrics in which a matrix contracts: one for any matrix, and one of eigenvectors where these make one."""
    (metric,), (good,) = eigenvector_metrics(matrix[None])
    return [summed_metric(matrix, contraction), *([metric] if good else [])]


def _product(steps: Floats) -> Floats:
    """Return the derivative of the composition of steps from those of each."""
    return functools.reduce(np.matmul, steps[::-1])


def _slowest(steps: Floats) -> list[Complexes]:
    """Return the vector of slowest approach at each point of an attractor, carried along by the derivative."""
    values, vectors = np.linalg.eig(_product(steps))
    carried = [vectors[:, np.argmax(np.abs(values))].astype(complex)]
    for step in steps[:-1]:
        carried.append(step @ carried[-1])
    return carried
