"""Atlases of attractors over two parameters, as records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Floats, Ints
from .._lib.checks import whole_number
from .._lib.computed import computed_once
from .._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Layout
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate
from .atlas_families import AtlasKind
from .bifurcation_curve import BifurcationCurve


@dataclass(frozen=True, eq=False)
class AttractorFamily:
    """Attractors of neighbouring parameter points that continue each other.

    Parameters
    ----------
    kind : AtlasKind
        Kind of the attractors.
    period : int
        Period in steps of the map; 0 without one.
    rotations : tuple of int
        Full rotations of each coordinate in one period.
    size : int
        Number of parameter points at which there is one of them.
    """

    kind: AtlasKind
    period: int
    rotations: tuple[int, ...]
    size: int

    @property
    def name(self) -> str:
        """Short description, such as ``"period 2"`` or ``"rotating, period 1, winding number +1"``."""
        if not self.period:
            return self.kind.name.lower().replace("quasi", "quasi-")
        text = f"rotating, period {self.period}" if self.kind is AtlasKind.ROTATING else f"period {self.period}"
        return text + "".join(f", winding number {t:+d}" for t in self.rotations if t)

    def __repr__(self) -> str:
        return f"AttractorFamily({self.name}, at {self.size} parameter points)"


@dataclass(frozen=True, eq=False)
class AttractorAtlas(ConvertsToXarray, ConvertsToDataFrame):
    """Attractors and fractions of initial conditions over two parameters.

    The grid has the shape (ny, nx); attractors are the n rows of a table.

    Parameters
    ----------
    system : str
        Name of the system.
    parameters : tuple of str
        Names of the parameters along x and y.
    x, y : ndarray, shapes (nx,) and (ny,)
        Their values, increasing.
    rows, columns : ndarray of int, shape (n,)
        Place of each attractor: its parameters are ``x[columns]`` and ``y[rows]``.
    kind : ndarray of int, shape (n,)
        An :class:`AtlasKind`.
    period : ndarray of int, shape (n,)
        Period in steps of the map; 0 for quasi-periodic and chaotic ones.
    rotations : ndarray of int, shape (n, dimension)
        Full rotations of each coordinate in one period.
    points : ndarray, shape (n, dimension)
        A point of each attractor.
    modulus : ndarray, shape (n,)
        Largest modulus of the multipliers; for the others the factor exp(largest Lyapunov exponent) per step.
    counts : ndarray of int, shape (n,)
        Initial conditions whose orbits converge to it; 0 for one that was found from a neighbouring parameter point.
    family : ndarray of int, shape (n,)
        Place of its family in `families`.
    families : tuple of AttractorFamily
        Families of attractors, that at most parameter points first.
    escaped, undecided : ndarray of int, shape (ny, nx)
        Orbits that terminated, and orbits that neither converged nor are chaotic or quasi-periodic.
    curves : tuple of BifurcationCurve
        Bifurcation curves through the borders of families.
    explained : float
        Fraction of the borders of families of periodic orbits that lie on these curves, within 1.5 cells; NaN where
        there are no borders.  A border is where an attractor of a family at 4 parameter points or more has no
        continuation at a neighbouring point.  Other borders are those of basins too small to be hit, of crises, or of
        families that were not followed.
    coordinates : tuple of Coordinate
        State variables.
    params : mapping of str to float
        The other parameters.
    settings : mapping
        Arguments of :func:`attractor_atlas`.
    parameter_units : mapping of str to str
        Units of parameters, as far as the system declares them.
    """

    _layout: ClassVar = Layout(
        "Attractors of {0.system}",
        {
            "x": Array("{x}", "{0.parameters[0]}", "{x}"),
            "y": Array("{y}", "{0.parameters[1]}", "{y}"),
            "_family_names": Array("family", name="family"),
        },
        {
            "number": Array("{y} {x}", "attractors found", unit="1"),
            "_fractions": Array("family {y} {x}", "fraction of the initial conditions", "fractions", "1"),
            "escaped": Array("{y} {x}", "orbits that terminated"),
            "undecided": Array("{y} {x}", "orbits that neither converged nor are chaotic"),
        },
    )

    system: str
    parameters: tuple[str, str]
    x: Floats
    y: Floats
    rows: Ints
    columns: Ints
    kind: NDArray[np.int8]
    period: Ints
    rotations: Ints
    points: Floats
    modulus: Floats
    counts: Ints
    family: Ints
    families: tuple[AttractorFamily, ...]
    escaped: Ints
    undecided: Ints
    curves: tuple[BifurcationCurve, ...]
    explained: float
    coordinates: tuple[Coordinate, ...]
    params: Mapping[str, float]
    settings: Mapping[str, Any]
    parameter_units: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        plane = f"{self.parameters[0]} x {self.parameters[1]}: {self.x.size} x {self.y.size}"
        most = int(self.number.max(initial=0))
        return (
            f"AttractorAtlas({self.system}, {plane}, {len(self.families)} families, at most {most} attractors coexist, "
            f"{len(self.curves)} curves)"
        )

    @property
    def number(self) -> Ints:
        """Number of attractors found at each parameter point, shape (ny, nx)."""
        found = np.zeros(self.escaped.shape, np.int64)
        np.add.at(found, (self.rows, self.columns), 1)
        return found

    @property
    def _family_names(self) -> tuple[str, ...]:
        """Names of the families."""
        return tuple(family.name for family in self.families)

    @property
    def _fractions(self) -> Floats:
        """Fraction of initial conditions that converge to each family, shape (families, ny, nx)."""
        parts = [self.fraction(k) for k in range(len(self.families))]
        return np.array(parts).reshape(len(parts), self.y.size, self.x.size)

    @checked
    def fraction(self, family: int) -> Floats:
        """Return the fraction of initial conditions that converge to a family, shape (ny, nx).

        Parameters
        ----------
        family : int
            Number of the family.
        """
        mine = self.family == whole_number("family", family, at_most=max(len(self.families) - 1, 0))
        found = np.zeros(self.escaped.shape)
        np.add.at(found, (self.rows[mine], self.columns[mine]), self.counts[mine])
        return found / self.settings["initial_conditions"]

    @computed_once
    def classes(self) -> tuple[Ints, tuple[str, ...]]:
        """What coexists: a number for each parameter point (ny, nx), and the name of each, the most frequent first.

        A name such as ``"1 + 1 rotating + 2"`` gives the periods; mirror images have equal ones.
        """
        texts = [self._symbol(k) for k in range(len(self.kind))]
        order = np.lexsort((np.array(texts, object).astype(str), self.period, self.kind))
        symbols: list[list[str]] = [[] for _ in range(self.escaped.size)]
        for k, place in zip(order.tolist(), (self.rows * self.x.size + self.columns)[order].tolist(), strict=True):
            symbols[place].append(texts[k])
        names, number = np.unique([" + ".join(s) or "none" for s in symbols], return_inverse=True)
        rank = np.argsort(-np.bincount(number.ravel()), kind="stable")
        place = np.empty(len(rank), np.int64)
        place[rank] = np.arange(len(rank))
        return place[number.ravel()].reshape(self.escaped.shape), tuple(names[rank].tolist())

    def _symbol(self, k: int) -> str:
        kind, period = AtlasKind(int(self.kind[k])), int(self.period[k])
        if not period:
            return kind.name.lower().replace("quasi", "quasi-")
        return f"{period} rotating" if kind is AtlasKind.ROTATING else str(period)
