"""Trapping regions from Lyapunov functions: quadratic forms that fall along orbits, and a bound of the remainder."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..._lib.arrays import Floats
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Neighbourhood
from ...orbits.ellipsoids import directions, displaced, lyapunov_forms, products

Afford = Callable[[int], bool]
"""Tells whether some images of the map can be afforded, which are taken then."""


_SAFETY = 2.0  # times the nonlinear remainder that is seen has to fit into the contraction margin
_WORST = 8  # directions whose sums and differences are looked at as well
_CONTRACTING, _MOST = 0.9, 64  # largest factor of as many steps as are taken together, at most
_ATTEMPTS = 16  # radii that are tried
_GUESSED = 0.5  # part of the margin on directions that are not known to be the worst ones
_USUAL = 2  # times as many images as a whole surface takes
_RANDOM = 16  # directions at random, at most
_WATCHED = 32  # directions in which a radius is sought, before it is tested in all of them
_RETURNING = 64  # periods after which orbits have to come back into a region that is not verified, at least,
_RETURNED = (0.1, 0.01, 1e-3, 1e-4, 1e-5)  # radii of such a region,
_BEGINNING = 16  # and orbits that begin on its surface around each point
_LINEAR = 1e-4  # radius on which nothing is looked at
_SMALLEST = 1e-10  # radius, in units of the limits
_ROUNDED = 1e-4  # radius below which a remainder that rises is rounding; above it is that of orbits that go elsewhere
_LARGE = 0.25  # part of the margin from which smaller surfaces are looked at
_INSIDE = 4  # of them at most, each half as wide


def always(images: int) -> bool:
    """Return that any number of images can be afforded."""
    return True


def lyapunov_neighbourhood(
    exact: PointMap, attractor: Attractor, steps: Floats, limit: Floats, afford: Afford = always
) -> Neighbourhood | None:
    """Return ellipsoids around the points of a periodic attractor, each of which some steps take into the next one.

    ``steps`` (period, d, d) are the derivatives of the map at its points, ``limit`` (d,) the largest half-widths.  The
    forms are solutions of the discrete Lyapunov equation along the orbit, in O(period d^3), so that the linear steps
    shorten lengths by a known factor.  The nonlinear remainder is seen in some directions: those in which an ellipsoid
    is widest along each coordinate, its axes, some at random, and sums and differences of those that are worst.
    Twice the largest one has to fit into the contraction margin, on the surface and, in the 32 directions that are the
    worst ones there, on smaller ones, down to where it is small against the margin.  A radius is foreseen from the
    remainder of the one before, and sought in 32 directions, so that all this takes some two images for each direction.

    Where none is found, as where the largest multiplier is too close to 1, or where one cannot `afford` the images, the
    ellipsoids are those from whose surfaces orbits are seen to come back, or small ones where one cannot afford to see
    that either, and their `contraction` is 1.  None where orbits from the smallest leave.

    References
    ----------
    Khalil, *Nonlinear Systems* (2002), 8.2 (regions of attraction by quadratic forms).
    """
    number, factor = _together(attractor)
    scaled = products(steps * limit / limit[:, None], number)
    rate = float((0.5 * (1.0 + factor)) ** (1.0 / attractor.period))
    surfaces = _Surfaces(exact, attractor.points, scaled, number, rate, limit)
    if not afford(_USUAL * number * surfaces.offsets[..., 0].size):
        return surfaces.recurrent(afford)
    radius, before, wanted = 1.0, np.inf, _GUESSED
    for _ in range(_ATTEMPTS):
        part = surfaces.part_of_margin(radius)
        if part <= wanted:
            part, wanted = surfaces.part_of_margin(radius, whole=True), 1.0
        if part <= 1.0 and wanted == 1.0:
            within = _smallest_failing(surfaces, radius, part)
            if not within:
                return surfaces.neighbourhood(radius, part)
            radius = within
        elif before < part < np.inf and radius < _ROUNDED:
            break
        radius *= float(np.clip(0.8 * wanted / part, 1.0 / 16.0, 0.5))
        before = part
        if radius < _SMALLEST:
            break
    return surfaces.recurrent(afford)


def _together(attractor: Attractor) -> tuple[int, float]:
    """Return how many steps are taken together, and by which factor as many rounds along the attractor contract.

    Slow directions contract in many steps, by a margin that the remainder of all of them fits into.
    """
    period, largest = attractor.period, float(np.abs(attractor.multipliers[0]))
    rounds = np.ceil(np.log(_CONTRACTING) / np.log(largest)) if largest > _CONTRACTING else 1.0
    number = 1 + period * int(np.ceil((min(rounds, float(_MOST)) - 1.0) / period))
    number = number if number * period <= _MOST else 1
    return number, largest**number


def _smallest_failing(surfaces: _Surfaces, radius: float, part: float) -> float:
    """Return the radius of a surface within one that passes on which the remainder does not fit; 0 for none."""
    for _ in range(_INSIDE):
        if part <= _LARGE:
            break
        radius *= 0.5
        part = surfaces.part_of_margin(radius)
        if part > 1.0:
            return radius
    return 0.0


class _Surfaces:
    """Surfaces of ellipsoids around the points of an attractor, in units of the limits."""

    def __init__(self, exact: PointMap, points: Floats, steps: Floats, number: int, rate: float, limit: Floats) -> None:
        forms = lyapunov_forms(steps, rate)
        self.exact, self.points, self.steps, self.forms, self.limit = exact, points, steps, forms, limit
        self.number = number
        self.later = np.roll(forms, -1, axis=0)
        values, axes = np.linalg.eigh(forms)
        roots = axes / np.sqrt(values)[:, None, :]  # unit sphere -> unit ellipsoid
        taken = self.steps @ roots
        growth = np.linalg.eigvalsh(taken.transpose(0, 2, 1) @ self.later @ taken)[:, -1]
        self.linear = np.sqrt(np.maximum(growth, 0.0))
        self.margin = 0.5 * (1.0 + rate) - self.linear
        d = points.shape[1]
        more = directions(d, 2 * d, min(d, _RANDOM))
        random = np.broadcast_to(more, (len(points), *more.shape)).transpose(0, 2, 1)
        # The point of an ellipsoid that is farthest along a coordinate.
        inverse = roots @ roots.transpose(0, 2, 1)
        farthest = inverse / np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))[:, None, :]
        half = np.concatenate([roots, farthest, roots @ random], axis=-1).transpose(0, 2, 1)
        self.offsets = np.concatenate([half, -half], axis=1)
        number = self.offsets.shape[1]
        some = np.linspace(0, number - 1, min(_WATCHED, number)).astype(int)
        self.watched = self.offsets[:, some]

    def part_of_margin(self, radius: float, whole: bool = False) -> float:
        """Return the nonlinear remainder on surfaces of a radius, times what makes it safe, in contraction margins.

        It is inf where a point has no image.  Unless the `whole` surface is looked at, it is seen in those directions
        alone that were the worst ones on the last that was.
        """
        offsets = self.offsets if whole else self.watched
        rest = self._remainders(offsets, radius)
        if not whole:
            return float((_SAFETY * rest.max(axis=1) / self.margin).max())
        worst = np.argsort(-rest, axis=1)[:, :_WATCHED]
        self.watched = np.take_along_axis(offsets, worst[..., None], axis=1)
        chosen = np.take_along_axis(offsets, worst[:, :_WORST, None], axis=1)
        first, second = np.triu_indices(chosen.shape[1], 1)
        sums = np.concatenate([chosen[:, first] + chosen[:, second], chosen[:, first] - chosen[:, second]], axis=1)
        lengths = self._norm(sums, self.forms)[..., None]
        more = self._remainders(np.where(lengths > 1e-6, sums / np.maximum(lengths, 1e-6), chosen[:, :1]), radius)
        return float((_SAFETY * np.maximum(rest.max(axis=1), more.max(axis=1)) / self.margin).max())

    def _remainders(self, offsets: Floats, radius: float) -> Floats:
        """Return the lengths (period, n) of what images differ by from those of the linear map, in radii."""
        shifts = radius * offsets
        periods = np.full(len(self.points), self.number)
        ends = np.roll(self.points, -1, axis=0)
        after, alive = displaced(self.exact, self.points, shifts * self.limit, periods, ends)
        rest = after / self.limit - np.einsum("pij,pnj->pni", self.steps, shifts)
        sizes = self._norm(rest, self.later) / radius
        return np.where(alive & np.isfinite(sizes), sizes, np.inf)

    def recurrent(self, afford: Afford) -> Neighbourhood | None:
        """Return ellipsoids into which orbits come back from the farthest points along some coordinates.

        Where one cannot `afford` to see that, they are small enough for the linear map.
        """
        n, d = self.points.shape
        farthest = self.offsets[:, np.linspace(d, 2 * d - 1, min(_BEGINNING, d)).astype(int)]
        periods = np.full(n, -(-_RETURNING // n) * n)
        for radius in _RETURNED:
            if not afford(int(periods.sum()) * farthest.shape[1]):
                radius = _LINEAR
                return Neighbourhood(self.points, self.forms / radius**2 / np.outer(self.limit, self.limit), 1.0)
            shifts = radius * farthest * self.limit
            after, alive = displaced(self.exact, self.points, shifts, periods)
            if alive.all() and (self._norm(after / self.limit, self.forms) <= radius).all():
                return Neighbourhood(self.points, self.forms / radius**2 / np.outer(self.limit, self.limit), 1.0)
        return None

    @staticmethod
    def _norm(vectors: Floats, forms: Floats) -> Floats:
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray(np.sqrt(np.maximum(np.einsum("pni,pni->pn", vectors @ forms, vectors), 0.0)))

    def neighbourhood(self, radius: float, part: float) -> Neighbourhood:
        """Return the region of a radius."""
        factors = self.linear + part / _SAFETY * self.margin
        metrics = self.forms / radius**2 / np.outer(self.limit, self.limit)
        return Neighbourhood(self.points, metrics, float(np.prod(factors) ** (1.0 / self.number)))
