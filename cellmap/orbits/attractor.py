"""Attractors of point maps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isclose, pi
from typing import Any, ClassVar

import numpy as np

from .._lib.arrays import Bools, Complexes, Floats, Ints
from .._lib.computed import computed_once
from .._lib.records import ShownAsHtml
from ..maps.coordinates import Coordinate, shortest, turns_of, wrap
from ..maps.grazing import GRAZING
from .invariant_circle import InvariantCircle
from .invariant_torus import InvariantTorus


class Kind(StrEnum):
    """Kinds of attractors of a point map."""

    FIXED_POINT = "fixed point"
    PERIODIC = "periodic"
    ROTATING = "rotating"
    """Rotating (running) solution: periodic up to full rotations of an angle, which increases or decreases for ever."""
    EQUILIBRIA = "equilibria"
    """Sticking set, a continuum of equilibria: dry friction keeps the state at each of its points."""
    CONTINUUM = "continuum of cycles"
    """Segment of cycles with a multiplier 1, such as one for each place at which friction holds a part of a system."""
    QUASIPERIODIC = "quasi-periodic"
    """Invariant circle or torus on which no orbit ever closes, such as a limit cycle seen by a time-T map."""
    CHAOTIC = "chaotic"


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Trapping region: ellipsoids around a periodic attractor's points, or along a limit cycle; orbits there converge.

    In more than four dimensions there are some that are not verified, also for quasi-periodic attractors.

    Parameters
    ----------
    centres : ndarray, shape (period, dimension)
        Points of the attractor; for a limit cycle or a quasi-periodic one centres of parts, shape (parts, dimension).
    metrics : ndarray, shape (period, dimension, dimension)
        The ellipsoid of point c is ``(x - c) @ metric @ (x - c) <= 1``.
    contraction : float
        Largest measured factor by which one period of the attractor reduces the distance in that metric, or the mean
        factor of two periods if a multiplier is near -1; below 1.  It is 1 where nothing verifies that orbits stay, but
        some are seen to come back.
    """

    centres: Floats
    metrics: Floats
    contraction: float


@dataclass(frozen=True, eq=False)
class Cover:
    """Boxes that a chaotic attractor visits, or that contain a sticking set or lie in the tube around invariant curves.

    Parameters
    ----------
    lower, widths : ndarray, shape (dimension,)
        Corner of the first box and sides of a box.
    boxes : ndarray of int, shape (number, dimension)
        Whole-number places of the boxes, sorted.
    certain : ndarray of bool, shape (number,), or None
        For equilibria, the boxes that hold nothing else, or only orbits that approach them; in the others an orbit
        belongs to the set if it rests.  All boxes of the tube around invariant curves, in which orbits approach them.
    residence : int or None
        For a chaotic attractor, consecutive periods among the boxes after which an orbit counts as converged, where a
        sample of orbits has shown how long others stay; 64 by default.
    trapped : ndarray of bool, shape (number,), or None
        For a chaotic attractor, the boxes in a neighbourhood of it that no orbit leaves, as images of small cells show:
        an orbit in one of these has converged.
    """

    lower: Floats
    widths: Floats
    boxes: Ints
    certain: Bools | None = None
    residence: int | None = None
    trapped: Bools | None = None

    @computed_once
    def corners(self) -> Ints:
        """Least and largest place of the boxes along each axis, shape (2, dimension)."""
        return np.stack([self.boxes.min(axis=0), self.boxes.max(axis=0)])


@dataclass(frozen=True, eq=False)
class InvariantSubspace:
    """Subspace that the map carries into itself, and that attracts on average where an attractor is in it.

    Parameters
    ----------
    normals : ndarray, shape (codimension, dimension)
        The points x of the subspace have ``normals @ x == offsets``, in reduced echelon form.
    offsets : ndarray, shape (codimension,)
        Right-hand sides.
    sizes : ndarray, shape (codimension,)
        Size of the region along the leading coordinate of each normal, the unit of distances.
    depth : float
        Distance from the subspace within which an orbit counts as converged: one in a thousand comes out again.
        Infinite for one of a family of parallel subspaces, each of which holds a chaotic set.
    exponent : float
        Largest normal Lyapunov exponent per step of the map: the mean growth of displacements from the subspace.
    """

    normals: Floats
    offsets: Floats
    sizes: Floats
    depth: float = 0.0
    exponent: float = 0.0

    @property
    def is_neutral(self) -> bool:
        """Whether this is one of a family of parallel subspaces with chaotic sets in them."""
        return self.depth == inf

    @computed_once
    def pivots(self) -> Ints:
        """Coordinates along which each normal is 1 and the others are 0."""
        leading = (self.normals == 1.0) & ((self.normals != 0.0).sum(axis=0) == 1)
        return np.array([np.flatnonzero(row)[-1] for row in leading])

    def _beyond(self, points: Floats, coordinates: Sequence[Coordinate]) -> Floats:
        turn = turns_of(coordinates)[1]
        whole = self.normals == np.round(self.normals)
        around = (whole & ((turn > 0.0) | (self.normals == 0.0))).all(axis=1)
        return shortest(points @ self.normals.T - self.offsets, np.where(around, turn[self.pivots], 0.0))

    def distances(self, points: Floats, coordinates: Sequence[Coordinate]) -> Floats:
        """Return how far (...) points (..., dimension) are from the subspace, the largest leading coordinate of it."""
        return np.asarray(np.abs(self._beyond(points, coordinates) / self.sizes).max(axis=-1))

    def is_parallel(self, other: InvariantSubspace) -> bool:
        """Tell whether another subspace has the same normals."""
        return np.array_equal(self.normals, other.normals)

    def projected(self, points: Floats, coordinates: Sequence[Coordinate]) -> Floats:
        """Return points (..., dimension) moved into the subspace along the leading coordinates."""
        moved = points.copy()
        moved[..., self.pivots] -= self._beyond(points, coordinates)
        return wrap(moved, coordinates)

    def normal_part(self, matrices: Floats) -> Floats:
        """Return by how much displacements from the subspace grow, of derivatives (..., dimension, dimension)."""
        return np.asarray((self.normals / self.sizes[:, None]) @ matrices[..., self.pivots] * self.sizes)


PARTS: Mapping[str, tuple[Any, Mapping[str, str]]] = {
    "neighbourhood": (Neighbourhood, {"centres": "period d", "metrics": "period d d", "contraction": ""}),
    "cover": (
        Cover,
        {"lower": "d", "widths": "d", "boxes": "boxes d", "residence": ""}
        | dict.fromkeys(("certain", "trapped"), "boxes"),
    ),
    "subspace": (
        InvariantSubspace,
        {"normals": "codimension d", **dict.fromkeys(("offsets", "sizes"), "codimension")}
        | dict.fromkeys(("depth", "exponent"), ""),
    ),
    "circle": (
        InvariantCircle,
        {
            **dict.fromkeys(("frequency", "frequency_error", "invariance_error", "cycle_period"), ""),
            **dict.fromkeys(("rotation_numbers", "rotation_errors"), "d"),
            "coefficients": "curves d harmonics",
        },
    ),
    "torus": (
        InvariantTorus,
        {
            **dict.fromkeys(("frequencies", "frequency_errors"), "two"),
            **dict.fromkeys(("rotation_numbers", "rotation_errors"), "d"),
            "coefficients": "d harmonics harmonics",
            "invariance_error": "",
        },
    ),
}
"""Records of an attractor, its trapping region and its invariant curves, with the dimensions of their arrays."""


@dataclass(frozen=True, eq=False)
class Attractor(ShownAsHtml):
    """An attractor of a point map.

    Parameters
    ----------
    kind : Kind
        Fixed point, periodic, rotating, equilibria (a sticking set), quasi-periodic or chaotic.
    period : int
        Period in steps of the map; 0 for a quasi-periodic or chaotic attractor.
    points : ndarray, shape (period, dimension)
        Its points in the order of the orbit, angles wrapped; for a chaotic attractor a sample of an orbit, for a
        sticking set a sample of its equilibria, for invariant curves points in their order along each.
    rotations : tuple of int
        Full rotations of each coordinate in one period of the attractor; 0 for coordinates that are not angles.
    multipliers : ndarray of complex, shape (dimension,)
        Floquet multipliers, the eigenvalues of the monodromy matrix, the largest first: of a limit cycle over its own
        period, one of them 1; empty for another quasi-periodic or a chaotic attractor.
    exponents : ndarray, shape (dimension,) or (1,)
        Lyapunov exponents per step of the map.
    neighbourhood : Neighbourhood or None
        Trapping region around a periodic attractor or along a limit cycle, and in more than four dimensions around a
        quasi-periodic one.
    cover : Cover or None
        Boxes that contain a chaotic attractor or a sticking set, or verified boxes around invariant curves.
    coordinates : tuple of Coordinate
        Names and units.
    circle : InvariantCircle or None
        Curves of a quasi-periodic attractor, with its rotation number and, for a limit cycle, its period in time.
    torus : InvariantTorus or None
        Torus of a quasi-periodic attractor with two frequencies.
    resolution : ndarray, shape (dimension,), or None
        Of a chaotic attractor, distance along each coordinate below which it is not distinguished from another one
        that is that near throughout: that of its sampled points.  Where attractors merely come close to each other,
        orbits distinguish them at any distance.
    grazing_distance : float
        Of a periodic attractor, how near it comes to grazing a surface of impacts or of a discontinuity, see
        :func:`cellmap.maps.grazing_distance`.
    symmetry : ndarray, shape (k, dimension), or None
        Directions along which all states may be shifted without a change of their motion, as where all angles turn
        together.  The attractor is then that of all shifts of its points, one of which is the one given, with a zero
        at one coordinate for each direction; period, rotations and kind are those of what is left without the shifts,
        and there are k multipliers and exponents less.
    subspace : InvariantSubspace or None
        Of a chaotic attractor in the sense of Milnor (1985), the invariant subspace that holds it and attracts on
        average.  Arbitrarily near to it there are orbits that go away; where they come to another attractor, its basin
        is riddled.  Of a continuum of chaotic sets one of the parallel subspaces.
    """

    _made_by: ClassVar = "find_attractors"
    kind: Kind
    period: int
    points: Floats
    rotations: tuple[int, ...]
    multipliers: Complexes
    exponents: Floats
    coordinates: tuple[Coordinate, ...]
    neighbourhood: Neighbourhood | None = None
    cover: Cover | None = None
    circle: InvariantCircle | None = None
    torus: InvariantTorus | None = None
    grazing_distance: float = inf
    resolution: Floats | None = None
    symmetry: Floats | None = None
    subspace: InvariantSubspace | None = None

    @property
    def grazes(self) -> bool:
        """Whether a periodic attractor touches a surface to a part of 1e-6, so that its multipliers mean nothing."""
        return self.grazing_distance <= GRAZING

    @property
    def verified(self) -> bool:
        """Whether no orbit leaves its trapping region: ellipsoids, or boxes all of which are certain."""
        return (self.neighbourhood is not None and self.neighbourhood.contraction < 1.0) or (
            self.cover is not None and self.cover.certain is not None and bool(self.cover.certain.all())
        )

    @property
    def rotation_number(self) -> tuple[float, ...]:
        """Rotation number: full rotations of each coordinate per step of the map; NaN for angles if chaotic."""
        curve = self.circle or self.torus
        if curve is not None:
            return tuple(curve.rotation_numbers.tolist())
        if not self.period:
            return tuple(np.nan if c.is_angle else 0.0 for c in self.coordinates)
        return tuple(t / self.period for t in self.rotations)

    @property
    def name(self) -> str:
        """Short description, such as ``"rotating, period 1, winding number +1"``."""
        if self.kind is Kind.CHAOTIC:
            return "continuum of chaotic sets" if self.subspace is not None and self.subspace.is_neutral else "chaotic"
        if self.kind is Kind.FIXED_POINT:
            return f"fixed point ({_place(self.points[0], self.coordinates)})"
        if self.kind is Kind.EQUILIBRIA:
            return f"equilibria around ({_place(self.points[len(self.points) // 2], self.coordinates)})"
        if self.kind is Kind.CONTINUUM:
            cycles = "fixed points" if self.period == 1 else f"cycles of period {self.period}"
            return f"continuum of {cycles} around ({_place(self.points[len(self.points) // 2], self.coordinates)})"
        if self.circle is not None:
            if np.isfinite(self.circle.cycle_period):
                return f"limit cycle, period {self.circle.cycle_period:.6g} in time"
            curves = len(self.circle.coefficients)
            return f"quasi-periodic, rotation number {self.circle.frequency:.6g}" + f", {curves} curves" * (curves > 1)
        if self.kind is Kind.QUASIPERIODIC and self.torus is None:
            return "quasi-periodic"
        if self.torus is not None:
            return "quasi-periodic, rotation vector ({:.6g}, {:.6g})".format(*self.torus.frequencies)
        text = f"{self.kind}, period {self.period}"
        for t in self.rotations:
            if t:
                text += f", winding number {t:+d}"
        return text

    def __repr__(self) -> str:
        if self.kind is Kind.CHAOTIC:
            return f"Attractor({self.name}, largest exponent {self.exponents[0]:.4g})"
        if self.kind is Kind.QUASIPERIODIC:
            return (
                f"Attractor({self.name}, largest exponent {self.exponents[0]:.2g}, {self.exponents[-1]:.4g} the least)"
            )
        place, grazes = ", ".join(f"{v:.6g}" for v in self.points[0]), ", grazes" if self.grazes else ""
        return f"Attractor({self.name} at ({place}), |multiplier| {np.abs(self.multipliers[0]):.4g}{grazes})"


def aperiodic(
    kind: Kind, points: Floats, exponents: Floats, coordinates: tuple[Coordinate, ...], **more: Any
) -> Attractor:
    """Return an attractor that has no period and no multipliers."""
    return Attractor(kind, 0, points, (0,) * len(coordinates), np.empty(0, complex), exponents, coordinates, **more)


def distinct_names(attractors: Sequence[Attractor]) -> tuple[str, ...]:
    """Return the names of attractors; equal names are distinguished by a point."""
    names = [a.name for a in attractors]
    for digits in range(3, 18):
        repeated = {name for name, times in Counter(names).items() if times > 1}
        for k, a in enumerate(attractors):
            if names[k] in repeated:
                place = _place(a.points[0], a.coordinates, digits)
                names[k] = f"{a.kind} ({place})" if a.kind is Kind.FIXED_POINT else f"{a.name}, through ({place})"
    return tuple(names)


def _place(point: Floats, coordinates: Sequence[Coordinate], digits: int = 3) -> str:
    """Write a point with its angles in multiples of pi where they are whole ones; the branch cut has one name only."""
    texts = []
    for v, c in zip(point.tolist(), coordinates, strict=True):
        if c.period is not None and c.lower is not None:
            rounds = (v - c.lower) / c.period
            if abs(rounds - round(rounds)) < 1e-6:
                v = min(c.lower + c.period, c.lower, key=abs)
            half_periods = round(2.0 * v / c.period)
            if isclose(c.period, 2 * pi) and half_periods and abs(v - half_periods * pi) < 1e-6:
                texts.append({1: "π", -1: "-π"}.get(half_periods, f"{half_periods}π"))
                continue
        texts.append(f"{v:.{digits}g}" if abs(v) >= 1e-9 or digits > 3 else "0")
    return ", ".join(texts)


def sort_key(attractor: Attractor) -> tuple[Any, ...]:
    """Key of the order of attractors: simple ones first, mirror images side by side."""
    point = attractor.points[0]
    rounded = np.round(point, 6) + 0.0
    return (
        list(Kind).index(attractor.kind),
        attractor.period,
        sum(map(abs, attractor.rotations)),
        round(float(np.linalg.norm(point)), 6),
        tuple(-t for t in attractor.rotations),
        tuple(-rounded),
    )
