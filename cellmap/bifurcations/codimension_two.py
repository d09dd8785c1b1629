"""Bifurcations of codimension two on curves of bifurcations."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._lib.computed import computed_once
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar
from ..maps.coordinates import wrap
from ..maps.multilinear import MultilinearForms, multilinear_forms
from ..orbits.arclength import ContinuationStep, SolutionPoint
from ..orbits.multipliers import multipliers_of, pair_on_circle, pairs_beside_one
from .born_curves import NewCurve, born_curves
from .centre_manifold import coefficient
from .codimension_two_forms import CodimensionTwoForm, form_of_two
from .kinds import BifurcationKind, CodimensionTwoKind
from .normal_forms import Reduction
from .singular_orbits import SingularOrbits

_AT_PLACE = 1e-8  # part of its value at a neighbour that a test function may have where it vanishes
_SMALL = 1e-3  # the same after a zero has been located
_SINGULAR = 1e-10  # determinant of I - M, below which a multiplier is 1
_REAL = 1e-6  # imaginary part of multipliers that are taken for real
_RESONANT = 1e-3  # distance of the cube of a multiplier from 1 at which terms that cancel leave rounding alone
_ROUNDING = 1e-8  # of test functions, relative to their terms
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

    kind: CodimensionTwoKind
    parameters: tuple[str, str]
    values: NDArray[np.float64]
    point: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    place: int
    _problem: SingularOrbits = field(repr=False)
    _unknowns: NDArray[np.float64] = field(repr=False)

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
        where = ", ".join(f"{n}={v:.10g}" for n, v in zip(self.parameters, self.values.tolist(), strict=True))
        return f"CodimensionTwo({self.kind} at {where})"


def points_on(
    problem: SingularOrbits, names: tuple[str, str], places: Sequence[SolutionPoint], progress: bool = False
) -> tuple[tuple[CodimensionTwo, ...], frozenset[CodimensionTwoKind]]:
    """Return the points of codimension two on a curve through places, in its order.

    Also those kinds whose condition holds along the whole curve, of which there are no points.
    """
    tests = _Tests(problem)
    unknowns = np.array([p.unknowns for p in places])
    matrices, forms = problem.matrices(unknowns), tests.forms(unknowns)
    frames = [tests.frame(matrix) for matrix in matrices]
    own = [tests.values(matrix, forms.at(0, k), frames[k]) for k, matrix in enumerate(matrices)]
    everywhere = _vanishing(own)
    found: dict[tuple[int, float, CodimensionTwoKind], SolutionPoint] = {}
    known: dict[CodimensionTwoKind, int] = {}
    with progress_bar(len(places), "points of codimension two" if progress else None) as tick:
        for j, end in enumerate(places):
            check_stop()
            here = own[j].keys() - everywhere
            # Where a test function is not known, the next place where it is has the last one as its neighbour.
            for k in {known[kind] for kind in here & known.keys()}:
                begin, frame, after = places[k], frames[k], tests.values(matrices[j], forms.at(0, j), frames[k])
                part = ContinuationStep(problem, begin, end, float(begin.tangent @ (end.unknowns - begin.unknowns)))
                for kind in (kind for kind in here & known.keys() & after.keys() if known[kind] == k):
                    values = own[k][kind].value, after[kind].value
                    size = max(map(abs, values))
                    at_begin, at_end = (abs(value) <= _AT_PLACE * size for value in values)
                    if at_begin or at_end:
                        found[j if at_end else k, 0.0, kind] = end if at_end else begin
                    elif values[0] * values[1] < 0.0:
                        place = part.located(functools.partial(tests.at, frame=frame, kind=kind))
                        # A test function changes its sign at a pole as well.
                        if place is not None and abs(tests.at(place, frame, kind)) < _SMALL * size:
                            found[k, abs(part.along(place.unknowns)), kind] = place
            known |= dict.fromkeys(here, j)
            tick(1)
    last = len(places) - 2
    points = (
        _point(problem, names, min(k, last), kind, place)
        for (k, _, kind), place in sorted(found.items(), key=lambda f: f[0])
        if tests.confirms(kind, place)
    )
    return tuple(points), everywhere


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
    d, state = orbits.dimension, at.unknowns * orbits.scale
    return CodimensionTwo(
        kind=kind,
        parameters=names,
        values=state[d:],
        point=wrap(state[:d], orbits.point_map.coordinates),
        multipliers=multipliers_of(problem.matrix(at)),
        place=place,
        _problem=problem,
        _unknowns=at.unknowns,
    )


class _TestValue(NamedTuple):
    """Value of a test function, and the size of what is rounding in it."""

    value: float
    rounding: float = _ROUNDING


@dataclass(frozen=True, eq=False)
class _Tests:
    """Test functions of the points of codimension two on a curve; each vanishes at one kind of them.

    For a real multiplier eigenvectors are normalised by a `frame`, those of a point nearby, so that all is smooth.
    """

    problem: SingularOrbits

    @property
    def _critical(self) -> float:
        return -1.0 if self.problem.kind is _FLIP else 1.0

    def frame(self, matrix: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the right and the left unit eigenvector of the critical multiplier."""
        left, _, right = np.linalg.svd(matrix - self._critical * np.eye(len(matrix)))
        return right[-1], left[:, -1]

    def forms(self, unknowns: NDArray[np.float64]) -> MultilinearForms:
        """Return the derivatives of the map at unknowns (n, d + 2)."""
        orbits = self.problem.orbits
        return multilinear_forms(
            orbits.swept, unknowns * orbits.scale, orbits.period, orbits.scale[: orbits.dimension], once=True
        )

    def at(
        self,
        place: SolutionPoint,
        frame: tuple[NDArray[np.float64], NDArray[np.float64]],
        kind: CodimensionTwoKind,
    ) -> float:
        """Return a test function at a place, NaN where it is not known."""
        tensors = self.forms(place.unknowns[None]).at(0, 0) if kind in _DEGENERATE.values() else None
        found = self.values(self.problem.matrix(place), tensors, frame).get(kind)
        return np.nan if found is None else found.value

    def values(
        self,
        matrix: NDArray[np.float64],
        at: tuple[NDArray[np.float64], ...] | None,
        frame: tuple[NDArray[np.float64], NDArray[np.float64]],
    ) -> dict[CodimensionTwoKind, _TestValue]:
        """Return the test functions at a place that are known; without derivatives of the map, those of multipliers."""
        kind = self.problem.kind
        if not np.isfinite(matrix).all():
            return {}
        if kind is _TORUS:
            return self._of_pairs(matrix, at)
        unit = np.eye(len(matrix))
        shifted = matrix - self._critical * unit
        bordered = np.block([[shifted, frame[1][:, None]], [frame[0][None], np.zeros((1, 1))]])
        try:
            inverse = np.linalg.inv(bordered)
        except np.linalg.LinAlgError:
            return {}
        q, p = inverse[:-1, -1], inverse[-1, :-1]
        others = _without(multipliers_of(matrix), self._critical)
        found = {} if len(others) < 2 else {_with_pair(kind): _TestValue(float(pairs_beside_one(others)))}
        if kind is not _PITCH:
            found[_TWICE[self._critical]] = _TestValue(float(p @ q))
            found[CodimensionTwoKind.FOLD_FLIP] = _TestValue(float(np.linalg.det(matrix + self._critical * unit)))
        factor = _without_pole(matrix) if kind is _FLIP else 1.0
        if at is not None and abs(factor) > _SINGULAR:
            reduced = factor * coefficient(kind, self._critical, at, q, p).real
            size = float(np.abs(at[1]).max()) if kind is _FOLD else _cubic_size(at)
            found[_DEGENERATE[kind]] = _TestValue(reduced, _ROUNDING * size)
        return found

    def _of_pairs(
        self, matrix: NDArray[np.float64], forms: tuple[NDArray[np.float64], ...] | None
    ) -> dict[CodimensionTwoKind, _TestValue]:
        cosine, multipliers = cosine_of_pair(matrix), multipliers_of(matrix)
        found = {kind: _TestValue(cosine - value) for kind, value in _COSINES.items()}
        pair = list(pair_on_circle(multipliers))
        others = np.delete(multipliers, pair)
        if len(others):
            found[CodimensionTwoKind.FOLD_NEIMARK_SACKER] = _TestValue(float(np.prod(others - 1.0).real))
            found[CodimensionTwoKind.FLIP_NEIMARK_SACKER] = _TestValue(float(np.prod(others + 1.0).real))
        if forms is None:
            return found
        reduced = Reduction.of(self.problem.kind, forms, self.problem.orbits.scale[: len(matrix)])
        factor = _without_pole(matrix)
        # At a 1:3 resonance the coefficient is a quotient of numbers that vanish.
        resonant = abs(multipliers[pair[0]] ** 3 - 1.0) < _RESONANT
        if reduced is not None and np.isfinite(reduced.coefficient) and abs(factor) > _SINGULAR and not resonant:
            right, left = (float(np.linalg.norm(v)) for v in (reduced.right, reduced.left))
            terms = abs(factor) * left * right**3 * _cubic_size(forms)
            found[_DEGENERATE[_TORUS]] = _TestValue(reduced.coefficient.real * factor, _ROUNDING * terms)
        return found

    def confirms(self, kind: CodimensionTwoKind, place: SolutionPoint) -> bool:
        """Return whether the pair of multipliers that a kind asks for is complex."""
        multipliers = multipliers_of(self.problem.matrix(place))
        if kind in _TWICE.values() or (self.problem.kind is not _TORUS and kind not in _PAIRS):
            return True
        pair = multipliers if self.problem.kind is _TORUS else _without(multipliers, self._critical)
        return bool(abs(pair[pair_on_circle(pair)[0]].imag) > _REAL)


def cosine_of_pair(matrix: NDArray[np.float64]) -> float:
    """Return half the sum of the two multipliers whose product is nearest to 1."""
    multipliers = multipliers_of(matrix)
    return float(multipliers[list(pair_on_circle(multipliers))].sum().real / 2.0)


def _cubic_size(forms: tuple[NDArray[np.float64], ...]) -> float:
    """Return the size of the terms of a cubic coefficient, for vectors of length 1."""
    return float(np.abs(forms[1]).max() ** 2 + np.abs(forms[2]).max())


def _without_pole(matrix: NDArray[np.float64]) -> float:
    """Return det(I - M), by which coefficients with the inverse of I - M stay finite where a multiplier is 1."""
    return float(np.linalg.det(np.eye(len(matrix)) - matrix))


def _without(multipliers: NDArray[np.complex128], critical: float) -> NDArray[np.complex128]:
    return np.delete(multipliers, np.argmin(np.abs(multipliers - critical)))


def _with_pair(kind: BifurcationKind) -> CodimensionTwoKind:
    return CodimensionTwoKind.FLIP_NEIMARK_SACKER if kind is _FLIP else CodimensionTwoKind.FOLD_NEIMARK_SACKER
