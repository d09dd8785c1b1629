"""Bifurcations of codimension two on curves of bifurcations."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import ClassVar, NamedTuple

import numpy as np

from .._lib.arrays import Complexes, Floats
from .._lib.computed import computed_once
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar, slices
from ..maps.coordinates import wrap
from ..maps.multilinear import MultilinearForms
from ..orbits.arclength import ContinuationStep, SolutionPoint
from ..orbits.multipliers import factors_beside, multipliers_along, pair_on_circle, products_of_pairs
from ..orbits.orbit_equations import OrbitProblem
from ..orbits.orbit_kinds import PeriodicOrbit
from .codimension_two_forms import CodimensionTwoForm, form_of_two
from .homological import Centre, cycle_matrix
from .intervals import place_of
from .kinds import BifurcationKind, CodimensionTwoKind
from .normal_forms import Tensors, coefficient, forms_along, reduction
from .orbit_births import NewCurve, born_curves
from .singular_orbits import SingularOrbits

_CONVERGED = 1e-12  # last step of Newton's method
_CLOSE = 0.1  # distance, scaled, of a point from where it is expected
_DISPLACED = 1e-5  # displacement in scaled unknowns by which test functions are differentiated
_ITERATIONS = 10
_TOGETHER = 64  # places at which derivatives are integrated side by side
_SINGULAR = 1e-10  # determinant of I - M, below which a multiplier is 1
_REAL = 1e-6  # imaginary part of multipliers that are taken for real
_RESONANT = 1e-3  # distance of the cube of a multiplier from 1 at which terms that cancel leave rounding alone
_ROUNDING = 1e-8  # rounding of test functions, relative to their terms
_FEW = 4  # places that are too few to conclude that a test function vanishes along a curve

_FOLD, _FLIP = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
_PITCH, _TORUS = BifurcationKind.PITCHFORK, BifurcationKind.NEIMARK_SACKER
_CURVES = {
    CodimensionTwoKind.RESONANCE_1_1: {_FOLD, _TORUS},
    CodimensionTwoKind.RESONANCE_1_2: {_FLIP, _TORUS},
    CodimensionTwoKind.FOLD_FLIP: {_FOLD, _FLIP},
    CodimensionTwoKind.FOLD_NEIMARK_SACKER: {_FOLD, _TORUS},
    CodimensionTwoKind.FLIP_NEIMARK_SACKER: {_FLIP, _TORUS},
}
"""Curves of bifurcations of the same orbits through points of codimension two."""

_DEGENERATE = {
    _FOLD: CodimensionTwoKind.CUSP,
    _FLIP: CodimensionTwoKind.GENERALISED_FLIP,
    _PITCH: CodimensionTwoKind.DEGENERATE_PITCHFORK,
    _TORUS: CodimensionTwoKind.CHENCINER,
}
"""Points at which the coefficient of a normal form vanishes."""

_TWICE = {1.0: CodimensionTwoKind.RESONANCE_1_1, -1.0: CodimensionTwoKind.RESONANCE_1_2}
"""Points at which a real multiplier is a double one."""

_COSINES = {
    CodimensionTwoKind.RESONANCE_1_1: 1.0,
    CodimensionTwoKind.RESONANCE_1_2: -1.0,
    CodimensionTwoKind.RESONANCE_1_3: -0.5,
    CodimensionTwoKind.RESONANCE_1_4: 0.0,
}
"""Cosines of the angles of multipliers at strong resonances."""

_PAIRS = {CodimensionTwoKind.FOLD_NEIMARK_SACKER, CodimensionTwoKind.FLIP_NEIMARK_SACKER}


@dataclass(frozen=True, eq=False)
class CodimensionTwo:
    """Bifurcation of codimension two, a point of a curve of bifurcations.

    Parameters
    ----------
    kind : CodimensionTwoKind
        Kind of the bifurcation.
    parameters : tuple of str
        Names of the parameters.
    values : ndarray, shape (2,)
        Parameter values, in their units.
    point : ndarray, shape (dimension,)
        First point of the orbit, angles within their period.
    multipliers : ndarray of complex, shape (dimension,)
        Multipliers at the point.
    place : int
        The point lies between the points `place` and ``place + 1`` of the curve.
    """

    _made_by: ClassVar = "continue_bifurcation, among the points codimension_two() of a BifurcationCurve"
    kind: CodimensionTwoKind
    parameters: tuple[str, str]
    values: Floats
    point: Floats
    multipliers: Complexes
    place: int
    _problem: SingularOrbits = field(repr=False)
    _unknowns: Floats = field(repr=False)

    @property
    def params(self) -> Mapping[str, float]:
        """All parameters at the point, in their units."""
        return self._problem.orbits.map_at(self._unknowns).params

    @property
    def orbit(self) -> PeriodicOrbit:
        """The orbit, with all parameters in its `params`."""
        return self._problem.orbits.orbit_at(self._unknowns)

    @computed_once
    def normal_form(self) -> CodimensionTwoForm | None:
        """Normal form; computed when it is first asked for, None where the multipliers do not allow it."""
        return form_of_two(self._problem.orbits, self._unknowns, self.kind)

    @computed_once
    def new_curves(self) -> tuple[NewCurve, ...]:
        """Other curves of bifurcations of periodic orbits through the point, for :func:`switch_curve`.

        Curves of orbits of the same period come first, and then those of the orbits that are born at the point, which
        for some kinds depend on the normal form.
        """
        others = _CURVES.get(self.kind, set()) - {self._problem.kind}
        return *(NewCurve(kind) for kind in others), *born_curves(self.kind, self.normal_form)

    def __repr__(self) -> str:
        return f"CodimensionTwo({self.kind} at {place_of(self.parameters, self.values)})"


def points_on(
    problem: SingularOrbits, names: tuple[str, str], places: Sequence[SolutionPoint], progress: bool = False
) -> tuple[tuple[CodimensionTwo, ...], frozenset[CodimensionTwoKind]]:
    """Return the points of codimension two on a curve through places, in its order.

    Also those kinds whose condition holds along the whole curve, of which there are no points.
    """
    tests, unknowns = _Tests(problem), np.array([p.unknowns for p in places])
    own, frames = list[dict[CodimensionTwoKind, _TestValue]](), list[Frame]()
    with progress_bar(len(places), "points of codimension two" if progress else None) as tick:
        for some in slices(len(places), _TOGETHER):
            check_stop()
            factors, forms = tests.factors(unknowns[some]), tests.forms(unknowns[some])
            for k, along in enumerate(factors):
                frames.append(tests.frame(along, frames[-1] if frames else None))
                own.append(tests.values(along, forms.at(0, k), frames[-1]))
            tick(len(factors))
    everywhere = _vanishing(own)
    found: dict[tuple[int, float, CodimensionTwoKind], SolutionPoint] = {}
    for kind in sorted({kind for there in own for kind in there} - everywhere):
        # Where a test function is not known, the next place where it is has the last one as its neighbour.
        line = [k for k, there in enumerate(own) if kind in there]
        lengths = np.linalg.norm(np.diff(unknowns[line], axis=0), axis=1)
        values = np.array([own[k][kind].value for k in line])
        for i, (k, j) in enumerate(pairwise(line)):
            check_stop()
            test = functools.partial(tests.at, frame=frames[k], kind=kind)
            step, ends = _step(problem, places[k], places[j]), (values[i], values[i + 1])
            pieces = [(step, ends)]
            dip = _dip(lengths[max(i - 1, 0) : i + 2], values[max(i - 1, 0) : i + 3], min(i, 1))
            middle = None if dip is None else step.at(dip * step.length)
            if middle is not None and (value := test(middle)) * ends[0] < 0.0:
                halves = _step(problem, places[k], middle), _step(problem, middle, places[j])
                pieces = list(zip(halves, pairwise((ends[0], value, ends[1])), strict=True))
            for piece, two in pieces:
                double = kind is CodimensionTwoKind.DOUBLE_NEIMARK_SACKER
                place = piece.zero(test, two, functools.partial(tests.double, piece, two) if double else None)
                if place is places[j]:
                    found[j, 0.0, kind] = place
                elif place is not None:
                    found[k, abs(step.along(place.unknowns)), kind] = place
    last = len(places) - 2
    points = (
        _point(problem, names, min(k, last), kind, place)
        for (k, _, kind), place in sorted(found.items(), key=lambda f: f[0])
        if tests.confirms(kind, place)
    )
    return tuple(points), everywhere


def _step(problem: SingularOrbits, begin: SolutionPoint, end: SolutionPoint) -> ContinuationStep:
    return ContinuationStep(problem, begin, end, float(begin.tangent @ (end.unknowns - begin.unknowns)))


def _dip(lengths: Floats, values: Floats, number: int) -> float | None:
    """Return which part of one of two or three steps leads to where a test function may be zero on both sides; or None.

    That is where the parabola through three of its values is nearest to zero, at less than half of them.
    """
    for k in range(len(lengths) - 1):
        (a, b), (before, here, after) = lengths[k : k + 2], values[k : k + 3]
        bend = ((after - here) / b - (here - before) / a) / (a + b)
        slope = (here - before) / a + bend * a
        if not bend * here > 0.0:
            continue
        along = -slope / (2.0 * bend)
        nearest = here + 0.5 * slope * along
        inside = 0.0 < along < b if number == k + 1 else -a < along < 0.0
        if k <= number <= k + 1 and inside and min(before * here, here * after) > 0.0 and nearest / here < 0.5:
            return float(along / b if number == k + 1 else 1.0 + along / a)
    return None


def _vanishing(values: Sequence[dict[CodimensionTwoKind, _TestValue]]) -> frozenset[CodimensionTwoKind]:
    """Return the kinds whose test functions are of the size of rounding at most places of a curve."""
    kinds = {kind for there in values for kind in there}
    small = {
        kind: [abs(there[kind].value) <= there[kind].rounding for there in values if kind in there] for kind in kinds
    }
    return frozenset(kind for kind, there in small.items() if len(there) > _FEW and 2 * sum(there) > len(there))


def _point(
    problem: SingularOrbits, names: tuple[str, str], place: int, kind: CodimensionTwoKind, at: SolutionPoint
) -> CodimensionTwo:
    orbits = problem.orbits
    d, state = orbits.dimension, orbits.once(at.unknowns * orbits.scale)
    return CodimensionTwo(
        kind=kind,
        parameters=names,
        values=state[d:],
        point=wrap(state[:d], orbits.point_map.coordinates),
        multipliers=multipliers_along(orbits.factors(orbits(at.unknowns)[1])),
        place=place,
        _problem=problem,
        _unknowns=at.unknowns,
    )


class _TestValue(NamedTuple):
    """Value of a test function, and the size of what is rounding in it."""

    value: float
    rounding: float = _ROUNDING


Frame = tuple[Floats, Floats]


@dataclass(frozen=True, eq=False)
class _Tests:
    """Test functions of the points of codimension two on a curve; each vanishes at one kind of them.

    They are functions of the derivatives along the orbit, from each of its nodes to the next one.  For a real
    multiplier eigenvectors are normalised by a `frame`, those of a point nearby, so that all is smooth.
    """

    problem: SingularOrbits

    @property
    def _critical(self) -> float:
        return -1.0 if self.problem.kind is _FLIP else 1.0

    def factors(self, unknowns: Floats) -> Floats:
        """Return the derivatives (..., n, d, d) from each node to the next one at unknowns (..., n d + m)."""
        return self.problem.orbits.factors(self.problem.orbits(unknowns)[1])

    def frame(self, factors: Floats, beside: Frame | None) -> Frame:
        """Return the right and the left unit eigenvector of the critical multiplier, along the nodes (n d,).

        They point along those beside them.
        """
        left, _, right = np.linalg.svd(cycle_matrix(factors, self._critical))
        found = right[-1], left[:, -1]
        signs = [1.0, 1.0] if beside is None else [np.copysign(1.0, a @ b) for a, b in zip(found, beside, strict=True)]
        return signs[0] * found[0], signs[1] * found[1]

    def forms(self, unknowns: Floats) -> MultilinearForms:
        """Return the derivatives of the map that a coefficient asks for, at unknowns (k, n d + m)."""
        orbits, order = self.problem.orbits, 2 if self.problem.kind is _FOLD else 3
        return forms_along(orbits, orbits.cycle(unknowns), order, once=True)

    def at(self, place: SolutionPoint, frame: Frame, kind: CodimensionTwoKind) -> float:
        """Return a test function at a place, NaN where it is not known."""
        return float(self.beside(place.unknowns[None], kind, frame)[0])

    def beside(self, unknowns: Floats, kind: CodimensionTwoKind, frame: Frame | None = None) -> Floats:
        """Return a test function (k,) at unknowns (k, n d + m), with the frame of the first; NaN where not known."""
        factors = self.factors(unknowns)
        forms = self.forms(unknowns) if kind in _DEGENERATE.values() else None
        frame = self.frame(factors[0], None) if frame is None else frame
        found = (
            self.values(f, None if forms is None else forms.at(0, k), frame).get(kind) for k, f in enumerate(factors)
        )
        return np.array([np.nan if value is None else value.value for value in found])

    def values(self, factors: Floats, tensors: Tensors | None, frame: Frame) -> dict[CodimensionTwoKind, _TestValue]:
        """Return the test functions at a place that are known; without derivatives of the map, those of multipliers."""
        if not np.isfinite(factors).all():
            return {}
        multipliers, kind = multipliers_along(factors), self.problem.kind
        if kind is _TORUS:
            return self._of_pairs(multipliers, tensors)
        n, d = factors.shape[:2]
        bordered = np.block([[cycle_matrix(factors, self._critical), frame[1][:, None]], [frame[0], np.zeros(1)]])
        try:
            inverse = np.linalg.inv(bordered)
        except np.linalg.LinAlgError:
            return {}
        q, p = inverse[:-1, -1].reshape(n, d), inverse[-1, -d - 1 : -1]
        others, across = _without(multipliers, self._critical), float(p @ q[0])
        found = {} if len(others) < 2 else {_with_pair(kind): _TestValue(_passes(products_of_pairs(others), 1.0))}
        if kind is not _PITCH:
            found[_TWICE[self._critical]] = _TestValue(across)
            found[CodimensionTwoKind.FOLD_FLIP] = _TestValue(_passes(multipliers, -self._critical))
        # The inverse of I - M has a pole where a further multiplier is 1.
        factor = _passes(multipliers, 1.0) if kind is _FLIP else 1.0
        if tensors is not None and abs(factor) > _SINGULAR and across:
            centre = Centre.real(q, p / across, self._critical)
            reduced = factor * across * coefficient(kind, tensors, centre).real
            size = float(np.abs(tensors[1]).max()) if kind is _FOLD else _cubic_size(tensors)
            found[_DEGENERATE[kind]] = _TestValue(reduced, _ROUNDING * size)
        return found

    def _of_pairs(self, multipliers: Complexes, tensors: Tensors | None) -> dict[CodimensionTwoKind, _TestValue]:
        pair = list(pair_on_circle(multipliers))
        cosine = cosine_of_pair(multipliers)
        found = {kind: _TestValue(cosine - value) for kind, value in _COSINES.items()}
        others = np.delete(multipliers, pair)
        if len(others):
            found[CodimensionTwoKind.FOLD_NEIMARK_SACKER] = _TestValue(_passes(others, 1.0))
            found[CodimensionTwoKind.FLIP_NEIMARK_SACKER] = _TestValue(_passes(others, -1.0))
        if len(others) > 1:
            found[CodimensionTwoKind.DOUBLE_NEIMARK_SACKER] = _TestValue(_passes(products_of_pairs(others), 1.0))
        if tensors is None:
            return found
        reduced = reduction(self.problem.kind, tensors, self.problem.orbits.scale[: tensors[0].shape[-1]])
        factor = _passes(multipliers, 1.0)
        # At a 1:3 resonance the coefficient is a quotient of numbers that vanish.
        resonant = abs(multipliers[pair[0]] ** 3 - 1.0) < _RESONANT
        if reduced is not None and np.isfinite(reduced.coefficient) and abs(factor) > _SINGULAR and not resonant:
            right, left = (float(np.linalg.norm(v)) for v in (reduced.right, reduced.left))
            terms = abs(factor) * left * right**3 * _cubic_size(tensors)
            found[_DEGENERATE[_TORUS]] = _TestValue(reduced.coefficient.real * factor, _ROUNDING * terms)
        return found

    def double(self, part: ContinuationStep, values: tuple[float, float]) -> SolutionPoint | None:
        """Return where two pairs of multipliers are on the unit circle, by Newton's method; None where not close by.

        Two curves intersect there, and the equations of neither of them are regular.
        """
        guess = part.interpolated(values[0] / (values[0] - values[1]))
        problem, here = CodimensionTwoOrbits(self.problem, CodimensionTwoKind.DOUBLE_NEIMARK_SACKER), guess.unknowns
        for _ in range(_ITERATIONS):
            sides, matrix = problem(here)
            if not np.isfinite(matrix).all():
                return None
            change = np.linalg.lstsq(matrix, sides, rcond=None)[0]
            here = here - change
            if np.linalg.norm(change) < _CONVERGED:
                return replace(guess, unknowns=here) if np.linalg.norm(here - guess.unknowns) < _CLOSE else None
        return None

    def confirms(self, kind: CodimensionTwoKind, place: SolutionPoint) -> bool:
        """Return whether the pairs of multipliers that a kind asks for are complex."""
        torus = self.problem.kind is _TORUS
        if kind in _TWICE.values() or not (torus or kind in _PAIRS):
            return True
        multipliers = multipliers_along(self.factors(place.unknowns))
        pair = multipliers if torus else _without(multipliers, self._critical)
        first = list(pair_on_circle(pair))
        if kind is CodimensionTwoKind.DOUBLE_NEIMARK_SACKER:
            others = np.delete(pair, first)
            if abs(others[pair_on_circle(others)[0]].imag) <= _REAL:
                return False
        return bool(abs(pair[first[0]].imag) > _REAL)


@dataclass(frozen=True, eq=False)
class CodimensionTwoOrbits:
    """Equations of an orbit with a bifurcation of codimension two, for unknowns (x_1, ..., x_n, q).

    They are those of the curve of bifurcations with the test function of the kind; of a double Neimark-Sacker
    bifurcation, where two such curves intersect, those of the orbit with the growth of both pairs.  Test functions have
    the frame of the place itself, and gradients of length 1 by differences along the solutions of the other equations.
    """

    bifurcation: SingularOrbits
    kind: CodimensionTwoKind

    @property
    def orbits(self) -> OrbitProblem:
        """Equations of the orbits."""
        return self.bifurcation.orbits

    @property
    def tests(self) -> _Tests:
        """The test functions."""
        return _Tests(self.bifurcation)

    def multipliers(self, place: SolutionPoint) -> Complexes:
        """Return the multipliers, by decreasing modulus."""
        return self.bifurcation.multipliers(place)

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals (n d + 2,) and their derivatives (n d + 2, n d + m) at unknowns (n d + m,)."""
        double, count = self.kind is CodimensionTwoKind.DOUBLE_NEIMARK_SACKER, len(unknowns)
        residual, slopes = (self.orbits if double else self.bifurcation)(unknowns)
        if np.isfinite(slopes).all():
            along = np.linalg.svd(slopes)[2][len(slopes) :]
            k = len(along)
            around = unknowns + _DISPLACED * np.concatenate([np.zeros((1, count)), along, -along])
            found = (
                np.array([_growth_of_pairs(factors) for factors in self.tests.factors(around)])
                if double
                else self.tests.beside(around, self.kind)[:, None]
            )
            changes = (found[1 : k + 1] - found[k + 1 :]).T / (2.0 * _DISPLACED) @ along
            sizes = np.linalg.norm(changes, axis=1)
            if (sizes > 0.0).all():
                return np.append(residual, found[0] / sizes), np.vstack([slopes, changes / sizes[:, None]])
        rows = self.orbits.states + 2
        return np.full(rows, np.nan), np.full((rows, count), np.nan)


def cosine_of_pair(multipliers: Complexes) -> float:
    """Return half the sum of the two multipliers whose product is nearest to 1."""
    return float(multipliers[list(pair_on_circle(multipliers))].sum().real / 2.0)


def _growth_of_pairs(factors: Floats) -> Floats:
    """Return the logarithms of the moduli of the two complex pairs next to the unit circle, by their angles."""
    multipliers = multipliers_along(factors) if np.isfinite(factors).all() else np.empty(0, complex)
    upper = multipliers[multipliers.imag > 0.0]
    growth = np.log(np.abs(upper))
    two = np.argsort(np.abs(growth))[:2]
    return growth[two[np.argsort(np.angle(upper[two]))]] if len(two) == 2 else np.full(2, np.nan)


def _cubic_size(forms: Tensors) -> float:
    """Return the size of the terms of a cubic coefficient, for vectors of length 1."""
    return float(np.abs(forms[1]).max() ** 2 + np.abs(forms[2]).max())


def _passes(values: Complexes, one: float) -> float:
    """Return a function that changes its sign where one of some numbers passes 1 or -1."""
    return float(np.prod(factors_beside(values, one)).real)


def _without(multipliers: Complexes, critical: float) -> Complexes:
    return np.delete(multipliers, np.argmin(np.abs(multipliers - critical)))


def _with_pair(kind: BifurcationKind) -> CodimensionTwoKind:
    return CodimensionTwoKind.FLIP_NEIMARK_SACKER if kind is _FLIP else CodimensionTwoKind.FOLD_NEIMARK_SACKER
