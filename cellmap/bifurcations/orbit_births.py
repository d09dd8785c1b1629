"""Orbits that are born at points of codimension two, their bifurcations nearby, and the curves of these."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .._lib.arrays import Complexes, Floats
from ..orbits.arclength import SolutionPoint, continuation_steps, corrected
from ..orbits.multipliers import multipliers_of, pair_on_circle, pairs_beside_one
from ..orbits.orbit_equations import OrbitProblem
from .codimension_two_forms import CodimensionTwoForm
from .kinds import BifurcationKind, CodimensionTwoKind
from .singular_orbits import SingularOrbits

_DISTANCES = 0.06, 0.03, 0.015, 0.0075  # distances of new orbits from the old one, in natural sizes
_PASSED = 0.1  # distance from the old orbit up to which a curve is followed to the birth
_NEAR = 5.0  # distance of new orbits from their birth, at most, in their distances from the old orbit
_ARRIVED = 1e-3  # relative distance from the old orbit of orbits that are the old one
_PHASES = 0.0, 0.4, 0.8, 1.2  # phases at which an orbit at a distance is looked for, below a quarter of the circle
_STEPS_AHEAD, _STEPS_AROUND = 24, 200  # steps along orbits of one distance, each a quarter of it or less
_COMPLEX = 1e-6  # imaginary part of multipliers

_FOLD, _TORUS = BifurcationKind.FOLD, BifurcationKind.NEIMARK_SACKER


@dataclass(frozen=True)
class NewCurve:
    """Curve of bifurcations that leaves a point of codimension two.

    Parameters
    ----------
    kind : BifurcationKind
        Kind of the bifurcations.
    times : int
        Period of the orbits over that of the orbit at the point.
    number : int
        Counts curves that are alike, from 0 on.
    """

    kind: BifurcationKind
    times: int = 1
    number: int = 0

    def __repr__(self) -> str:
        return f"NewCurve({self.kind}, period times {self.times}{f', number {self.number}' if self.number else ''})"


def born_curves(kind: CodimensionTwoKind, form: CodimensionTwoForm | None) -> tuple[NewCurve, ...]:
    """Return the curves of bifurcations of the orbits that are born at a point with a normal form.

    They follow from the flow that approximates an iterate of the normal form: at a 1:2 resonance its equilibria are
    foci for c < 0, at a fold-flip for b e > 0.  At a 1:4 resonance equilibria z' = 0 of z' = eps z + a z abs(z)^2 +
    conj(z)^3 have a zero eigenvalue for abs(a) > 1, and imaginary ones for abs(Im a) sqrt(1 - (Re a)^2) > 1 + (Re a)^2.
    At a 1:3 resonance they are saddles, without bifurcations.  Nothing is said of degenerate points.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), sections 9.5 and 9.6; Kuznetsov, Meijer, van Veen,
    International Journal of Bifurcation and Chaos 14 (2004) 2253, for the fold-flip bifurcation.
    """
    found = {} if form is None or form.degenerate else form.coefficients
    match kind:
        case CodimensionTwoKind.GENERALISED_FLIP:
            return (NewCurve(_FOLD, 2),)
        case CodimensionTwoKind.DEGENERATE_PITCHFORK:
            return (NewCurve(_FOLD, 1),)
        case CodimensionTwoKind.FLIP_NEIMARK_SACKER:
            return (NewCurve(_TORUS, 2),)
        case CodimensionTwoKind.RESONANCE_1_2 if found and found["c"].real < 0.0:
            return (NewCurve(_TORUS, 2),)
        case CodimensionTwoKind.FOLD_FLIP if found and (found["b"] * found["e"]).real > 0.0:
            return (NewCurve(_TORUS, 2),)
        case CodimensionTwoKind.RESONANCE_1_4 if found and abs(found["a"]) > 1.0:
            real, imaginary = abs(found["a"].real), abs(found["a"].imag)
            folds = NewCurve(_FOLD, 4), NewCurve(_FOLD, 4, 1)
            focus = real < 1.0 and imaginary * (1.0 - real**2) ** 0.5 > 1.0 + real**2
            return (*folds, NewCurve(_TORUS, 4)) if focus else folds
    return ()


@dataclass(frozen=True, eq=False)
class OrbitBirth:
    """Point at which orbits are born from an old one that is `origin` (d + 2,), along a critical eigenvector.

    New orbits return to the other side of the old one in half their period, `half`; without it, as at a pitchfork, the
    old orbit stays at its place.  Their distance from the old one is w, complex for a complex multiplier.
    """

    name: str
    orbits: OrbitProblem
    half: OrbitProblem | None
    origin: Floats
    right: Complexes
    left: Complexes
    along: Floats

    @classmethod
    def at(cls, name: str, old: SingularOrbits, origin: Floats, times: int) -> OrbitBirth | None:
        """Return the birth of orbits of some times the period of an orbit on a curve; None where it is not found."""
        matrix, d = old.orbits.factors(old.orbits(origin)[1])[0], old.orbits.dimension
        critical = {1: 1.0, 2: -1.0, 4: 1j}[times]
        left, _, right = np.linalg.svd(matrix - critical * np.eye(d))
        q, p = right[-1].conj(), left[:, -1].conj() if times == 4 else right[-1]
        place = corrected(old, origin, np.linalg.svd(old(origin)[1])[2][-1])
        if place is None:
            return None
        half = None if times == 1 else replace(old.orbits, period=times // 2 * old.orbits.period)
        return cls(
            name=name,
            orbits=replace(old.orbits, period=times * old.orbits.period),
            half=half,
            origin=origin,
            right=q,
            left=p / (p @ q),
            along=place.tangent,
        )

    def distance(self, unknowns: Floats) -> tuple[complex, Complexes]:
        """Return the distance w of a new orbit from the old one, and its derivatives (d + 2,)."""
        if self.half is None:
            d = len(self.left)
            return complex(self.left @ (unknowns[:d] - self.origin[:d])), np.append(self.left, [0.0, 0.0])
        moved, slopes = self.half(unknowns)
        return complex(-0.5 * self.left @ moved), -0.5 * self.left @ slopes

    def end(self, first: SolutionPoint, second: SolutionPoint) -> str:
        """Return why a curve ends on a step on which new orbits shrink to an old one; empty where they do not.

        It is "refused" where they may have shrunk, and grown on the other side, on a step too long to tell.
        """
        one, two = self.distance(first.unknowns)[0], self.distance(second.unknowns)[0]
        shrinks, near = (one * two.conjugate()).real < _ARRIVED * abs(one) ** 2, max(abs(one), abs(two)) < _PASSED
        if not (shrinks and near) and abs(two) > _ARRIVED:
            return "refused" if shrinks else ""
        away = min(float(np.linalg.norm(place.unknowns - self.origin)) for place in (first, second))
        return self.name if away < _PASSED else "met orbits of the shorter period"

    def bifurcations(self, problem: SingularOrbits, count: int) -> list[SolutionPoint]:
        """Return at least some number of bifurcations of new orbits near the old one, of the kind of a problem.

        The nearest comes first; there are none where fewer are found.  The tangents of their curves lead away from the
        old orbit.
        """
        for distance in _DISTANCES:
            found = list[SolutionPoint]()
            for near in self._crossings(problem.kind, distance):
                unknowns, (w, change) = near.unknowns, self.distance(near.unknowns)
                direction = np.linalg.svd(problem(unknowns)[1])[2][-1]
                away = float(np.sign((w.conjugate() * change).real @ direction))
                place = corrected(problem, unknowns, away * direction)
                if place is not None and self._is_near(place, distance):
                    found.append(place)
            if len(found) >= count:
                return sorted(found, key=lambda place: float(np.linalg.norm((place.unknowns - self.origin)[-2:])))
        return []

    def _is_near(self, place: SolutionPoint, distance: float) -> bool:
        """Return whether an orbit has about a distance from the old one, and is near where it was born."""
        from_birth = float(np.linalg.norm(place.unknowns - self.origin))
        return 0.5 * distance < abs(self.distance(place.unknowns)[0]) < 2.0 * distance and from_birth < _NEAR * distance

    def _crossings(self, kind: BifurcationKind, distance: float) -> Iterator[SolutionPoint]:
        """Yield the orbits at a distance from the old one at which a test function changes its sign."""
        problem = _OrbitsAtDistance(self, distance)
        start = next(filter(None, (self._orbit(problem, phase) for phase in _PHASES)), None)
        if start is None:
            return

        def test(place: SolutionPoint) -> float:
            matrix = self._matrix(place)
            if kind is BifurcationKind.FOLD:
                return float(np.linalg.det(matrix - np.eye(len(matrix))))
            return float(pairs_beside_one(multipliers_of(matrix)))

        most = _STEPS_AROUND if self.is_complex else _STEPS_AHEAD
        still = np.zeros(len(self.origin), bool)
        for sign in (1.0,) if self.is_complex else (1.0, -1.0):
            begin = replace(start, tangent=sign * start.tangent)
            steps = continuation_steps(problem, begin, 0.25 * distance, still)
            for _, step in zip(range(most), steps, strict=False):
                if test(step.begin) * test(step.end) < 0.0:
                    place = step.located(test)
                    if place is not None and self._has(kind, place):
                        yield place
                if self.is_complex and self._turned(start, step.end):
                    break

    def _orbit(self, problem: _OrbitsAtDistance, phase: float) -> SolutionPoint | None:
        """Return an orbit at a distance from the old one, with about a phase if the distance is complex."""
        d = len(self.left)
        right, along = self.right, self.along
        if self.is_complex:
            right = 2.0 * np.exp(1j * phase) * right
            along = np.append((1j * right).real, [0.0, 0.0])
        guess = self.origin + np.append(problem.distance * right.real, np.zeros(len(self.origin) - d))
        return corrected(problem, guess, along / np.linalg.norm(along))

    @property
    def is_complex(self) -> bool:
        """Whether the critical multiplier is complex."""
        return bool(np.abs(self.right.imag).max() > 0.0)

    def _matrix(self, place: SolutionPoint) -> Floats:
        d = len(self.left)
        return place.derivatives[:d, :d] + np.eye(d)

    def _has(self, kind: BifurcationKind, place: SolutionPoint) -> bool:
        """Return whether the multipliers whose product is 1 are complex where they should be."""
        found = multipliers_of(self._matrix(place))
        return kind is BifurcationKind.FOLD or bool(abs(found[pair_on_circle(found)[0]].imag) > _COMPLEX)

    def _turned(self, start: SolutionPoint, place: SolutionPoint) -> bool:
        """Return whether a place is beyond the first image of the orbit at the start."""
        first, last = self.distance(start.unknowns)[0], self.distance(place.unknowns)[0]
        return bool(abs(np.angle(last / first)) > 0.5 * np.pi)


@dataclass(frozen=True, eq=False)
class _OrbitsAtDistance:
    """Equations of new orbits at a distance from the old one, in state variables and two parameters."""

    birth: OrbitBirth
    distance: float

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals (d + 1,) and their derivatives (d + 1, d + 2) at unknowns (d + 2,)."""
        residual, slopes = self.birth.orbits(unknowns)
        w, change = self.birth.distance(unknowns)
        square = 0.5 * (abs(w) ** 2 / self.distance - self.distance)
        return np.append(residual, square), np.vstack([slopes, (w.conjugate() * change).real / self.distance])
