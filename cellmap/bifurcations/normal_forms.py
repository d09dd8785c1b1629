"""Normal forms of bifurcations of periodic orbits, on the centre manifold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Complexes, Floats
from .._lib.checks import one_point, whole_number
from .._lib.signatures import checked
from ..maps.coordinates import state_points
from ..maps.multilinear import MultilinearForms, multilinear_forms
from ..maps.point_map import PointMap
from ..orbits.arclength import SolutionPoint
from ..orbits.multipliers import multipliers_along
from ..orbits.orbit_equations import OrbitProblem, natural_sizes
from .homological import Centre, eigenvectors, normal_form_terms
from .kinds import BifurcationKind

CERTAIN = 3.0
"""Errors that a coefficient is away from zero, from which on it counts as not zero."""

_TRIALS = 8
_SAFETY = 1.6  # factor over the standard deviation
_ROUNDING = 2e-16
_LOCATION = 5e-16  # error of the unknowns, in natural sizes
_DISPLACEMENT = 1e-6  # displacement of the unknowns, in natural sizes, by which derivatives are compared
_BESIDE = 10.0 ** np.arange(-7.0, -0.9, 0.25)  # distances, in natural sizes, at which a fold may be misplaced
_DEFICIENT = 1e-6  # singular value of the equations at a branch point

Tensors = tuple[Floats, ...]
Function = Callable[[Tensors], Any]

_LARGEST = 1e6  # derivative of a map that is known well enough
_SINGULAR = 1e-7  # product of the unit eigenvectors of a multiplier that is not simple
_FORMS = {
    BifurcationKind.FOLD: "quadratic",
    BifurcationKind.TRANSCRITICAL: "quadratic",
    BifurcationKind.PITCHFORK: "cubic",
    BifurcationKind.PERIOD_DOUBLING: "cubic",
    BifurcationKind.NEIMARK_SACKER: "cubic",
}


class Criticality(StrEnum):
    """Stability of the orbits that are born, by the coefficient of a normal form."""

    SUPERCRITICAL = "supercritical"
    """The new orbits or curves exist where the old orbit is unstable on the centre manifold, and attract on it."""
    SUBCRITICAL = "subcritical"
    """The new orbits or curves exist where the old orbit is stable on the centre manifold, and repel on it."""
    GENERIC = "generic"
    """Fold or transcritical bifurcation whose quadratic coefficient is not zero."""
    DEGENERATE = "degenerate"
    """The coefficient is zero within its error, or not defined: a bifurcation of codimension two."""


@dataclass(frozen=True, eq=False)
class NormalForm:
    """Normal form of a bifurcation of a periodic orbit, for a coordinate u (complex: w) on the centre manifold.

    Parameters
    ----------
    kind : BifurcationKind
        Kind of the bifurcation, with the normal form u -> u + a u^2 (fold, transcritical), u -> u + c u^3 (pitchfork),
        u -> -u + b u^3 (period doubling) or w -> exp(i theta) w (1 + d abs(w)^2) (Neimark-Sacker).
    coefficient : float
        The coefficient a, c, b or the real part of d.  The eigenvector has length 1 in the units of the coordinates,
        which the value depends on and its sign does not.  The sign of a follows that of the eigenvector.
    imaginary : float
        Imaginary part of d, the change of the rotation with abs(w)^2; 0 for the other kinds.
    error : float
        Estimate of the error of the coefficient, from the errors of the derivatives and of the place.
    criticality : Criticality
        "supercritical", "subcritical", "generic" or "degenerate".
    eigenvector, adjoint : ndarray, shape (dimension,)
        Eigenvectors q of the monodromy matrix and p of its transpose, with norm(q) = 1 and p . q = 1, complex for a
        Neimark-Sacker bifurcation; the largest component of q is real and positive.
    exact : bool
        Whether derivatives of the map come from its higher variational equations; else from differences of Jacobian
        matrices, with fewer digits.
    """

    kind: BifurcationKind
    coefficient: float
    imaginary: float
    error: float
    criticality: Criticality
    eigenvector: Complexes
    adjoint: Complexes
    exact: bool

    def __repr__(self) -> str:
        return f"NormalForm({self.criticality} {self.kind}, coefficient {self.coefficient:.9g} +- {self.error:.1g})"


@checked
def normal_form(point_map: PointMap, point: ArrayLike, kind: BifurcationKind, period: int = 1) -> NormalForm:
    """Return the normal form of a bifurcation of a fixed or periodic point, at the parameters of the map.

    The bifurcations that :func:`continue_orbit` returns have it as their `normal_form`.  Second and third derivatives
    of the map are integrated with the orbit (higher variational equations), or taken from differences of Jacobian
    matrices where the formulas of the right-hand side are unknown or not smooth.

    Parameters
    ----------
    point_map : PointMap
        The map, at the bifurcation; for an interpolated map, its exact map is used.
    point : array_like, shape (dimension,)
        Point of the orbit.
    kind : BifurcationKind
        Kind of the bifurcation.
    period : int, optional
        Period of the orbit, in steps of the map.

    Returns
    -------
    NormalForm
        Coefficient with its error, and criticality.

    Raises
    ------
    ValueError
        For a kind without normal form, or a Neimark-Sacker bifurcation without a complex pair of multipliers.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), section 5.4, for normal forms on the centre manifold in
    terms of multilinear forms; Kuznetsov, Meijer, SIAM Journal on Scientific Computing 26 (2005) 1932.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.0}, ("x",))
    >>> normal_form(logistic, [2 / 3], BifurcationKind.PERIOD_DOUBLING)
    NormalForm(supercritical period doubling, coefficient 9 +- ...)
    """
    if kind not in _FORMS:
        raise ValueError(f"kind={kind!r}: choose one of {', '.join(map(repr, _FORMS))}")
    found = _form(LocatedForms.at(point_map, point, period), kind)
    if found is None:
        raise ValueError(f"kind={kind!r}: the orbit has no complex pair of multipliers")
    return found


def form_at(problem: OrbitProblem, unknowns: Floats, kind: BifurcationKind) -> NormalForm | None:
    """Return the normal form at unknowns (d + m,) of an orbit problem; None for a kind that has none."""
    if kind not in _FORMS:
        return None
    located = LocatedForms.of(problem, unknowns)
    found = _form(located, kind)
    if found is None or kind is not BifurcationKind.FOLD:
        return found
    further = [LocatedForms.of(problem, beside) for beside in _as_singular(problem, unknowns, located)]
    others = [reduction(kind, some.tensors, some.sizes) for some in further]
    apart = [np.inf if other is None else abs(other.coefficient - found.coefficient) for other in others]
    error = float(np.linalg.norm([found.error, *apart]))
    return replace(found, error=error, criticality=_criticality(kind, found.coefficient, error))


def _as_singular(problem: OrbitProblem, unknowns: Floats, located: LocatedForms) -> list[Floats]:
    """Return the unknowns farthest on either side of a fold, along the branch, at which it might be as well.

    There the multiplier is 1 within the rounding and the errors of the derivatives, as on a stretch of a flat fold.
    """
    null = np.linalg.svd(problem(unknowns)[1][:, : problem.states])[2][-1]
    lengths = np.append(np.zeros(1), _BESIDE)[:, None, None] * np.array([[1.0], [-1.0]])
    places = unknowns + lengths * np.append(null, np.zeros(len(unknowns) - problem.states))
    slopes = problem(places)[1]
    off = np.array([
        min(np.abs(problem.multipliers(SolutionPoint(u, m, u)) - 1.0).min() for u, m in zip(*both, strict=True))
        for both in zip(places, slopes, strict=True)
    ])  # fmt: skip
    pair, linear = located.forms.tensors[0][:, 0], located.tensors[0]
    noise = _ROUNDING * np.abs(linear).max() + np.abs(pair[0] - pair[1]).max()
    reach = np.flatnonzero(~(off[1:] > _SAFETY * (off[0] + noise)))
    return list(places[min(2 + reach[-1], len(_BESIDE))]) if len(reach) else []


def _form(located: LocatedForms, kind: BifurcationKind) -> NormalForm | None:
    """Return the normal form, with the error that follows from those of the derivatives of the map."""
    known = float(np.abs(located.tensors[0]).max()) < _LARGEST
    found = reduction(kind, located.tensors, located.sizes) if known else None
    if found is None:
        return None

    def again(disturbed: Tensors) -> complex:
        other = reduction(kind, disturbed, located.sizes)
        return complex(np.nan) if other is None else other.coefficient

    value = found.coefficient
    error = located.error_of(value, again, found.off)
    return NormalForm(
        kind=kind,
        coefficient=value.real,
        imaginary=value.imag if kind is BifurcationKind.NEIMARK_SACKER else 0.0,
        error=error,
        criticality=_criticality(kind, value.real, error),
        eigenvector=found.right * located.sizes,
        adjoint=found.left / located.sizes,
        exact=located.forms.exact,
    )


def _criticality(kind: BifurcationKind, value: float, error: float) -> Criticality:
    """Return what a coefficient that is known with an error says."""
    if not abs(value) > CERTAIN * error:
        return Criticality.DEGENERATE
    if _FORMS[kind] == "quadratic":
        return Criticality.GENERIC
    above = (value > 0.0) == (kind is BifurcationKind.PERIOD_DOUBLING)
    return Criticality.SUPERCRITICAL if above else Criticality.SUBCRITICAL


class Reduction(NamedTuple):
    """Coefficient of a normal form, by how much the critical multiplier is off its value, and the eigenvectors."""

    coefficient: complex
    off: float
    right: Complexes
    left: Complexes


def reduction(kind: BifurcationKind, forms: Tensors, sizes: Floats) -> Reduction | None:
    """Reduce a map with the derivatives A, B, C (n, d, ...) along a cycle, in natural sizes; None without a pair."""
    matrices = forms[0]
    critical = -1.0 + 0.0j if kind is BifurcationKind.PERIOD_DOUBLING else 1.0 + 0.0j
    multipliers = multipliers_along(matrices)
    if kind is BifurcationKind.NEIMARK_SACKER:
        upper = multipliers[multipliers.imag > 0.0]
        if not len(upper):
            return None
        nearest = upper[np.argmin(np.abs(np.abs(upper) - 1.0))]
        critical = nearest / abs(nearest)
    along, p = eigenvectors(matrices, critical)
    q = along[0] * sizes
    largest = q[np.argmax(np.abs(q))]
    scaled = abs(largest) / largest / np.linalg.norm(q)
    off = float(np.abs(multipliers - critical).min())
    centre = Centre.of(matrices, [critical], _SINGULAR)
    if centre is None:
        return Reduction(complex(np.nan), off, along[0] * scaled, p)
    value = coefficient(kind, forms, centre) * (scaled.real if _FORMS[kind] == "quadratic" else abs(scaled) ** 2)
    return Reduction(value, off, along[0] * scaled, p / (p @ along[0] * scaled))


def coefficient(kind: BifurcationKind, forms: Tensors, centre: Centre) -> complex:
    """Return the coefficient of the normal form of a map with the derivatives A, B, C along a cycle."""
    order, pair = (2 if _FORMS[kind] == "quadratic" else 3), kind is BifurcationKind.NEIMARK_SACKER
    value = normal_form_terms(forms[:order], centre, order)[0, (2, 1) if pair else (order,)]
    return value / complex(centre.linear[0, 0]) if pair else value


@dataclass(frozen=True, eq=False)
class LocatedForms:
    """Derivatives of a map along a cycle, in natural sizes (d,), and along neighbours displaced along each unknown.

    Those of order k are (2, neighbours, n, d, d, ...) for a cycle of n points.
    """

    forms: MultilinearForms
    sizes: Floats

    @classmethod
    def at(cls, point_map: PointMap, point: ArrayLike, period: int, order: int = 3) -> LocatedForms:
        """Return the derivatives at a point that is known exactly; check it, and the period."""
        exact, rounds = point_map.without_table, whole_number("period", period, at_least=1)
        place = state_points("point", one_point("point", point, exact.dimension), exact.coordinates)
        sizes = natural_sizes(exact, place, rounds)
        found = multilinear_forms(exact, place[None], rounds, sizes, order=order)
        return cls(replace(found, tensors=tuple(t[:, :, None] for t in found.tensors)), sizes)

    @classmethod
    def of(cls, problem: OrbitProblem, unknowns: Floats, order: int = 3) -> LocatedForms:
        """Return the derivatives at unknowns (n d + m,) of an orbit problem, which have been located with an error.

        One further step of Newton's method is made first.
        """
        d = problem.dimension
        scale = np.append(problem.scale[:d], problem.scale[problem.states :])
        residual, derivatives = problem(unknowns)
        closed = unknowns - np.linalg.lstsq(derivatives, residual, rcond=_DEFICIENT)[0]
        moves = np.vstack([np.zeros(len(scale)), _DISPLACEMENT * np.diag(scale)])
        return cls(forms_along(problem, problem.cycle(closed) + moves[:, None], order), problem.scale[:d])

    @property
    def tensors(self) -> Tensors:
        """Derivatives A, B, C, ... (n, d, d, ...) along the cycle."""
        return self.forms.at(0, 0)

    def error_of(self, value: Any, function: Function, off: float) -> Any:
        """Return the error of numbers (...) that a function computes from the derivatives at the point.

        These are disturbed at random, by as much as two evaluations differ, by rounding, by the error of the place, and
        by that part of their size by which critical multipliers are `off` their value.  Infinite where a value is not
        finite.
        """
        rng, scatter = np.random.default_rng(0), list[Any]()
        for _ in range(_TRIALS):
            moved = rng.standard_normal(self.forms.linear.shape[1] - 1) * _LOCATION / _DISPLACEMENT
            disturbed = list[Floats]()
            for both in self.forms.tensors:
                tensor, others = both[0, 0], both[0, 1:]
                apart = float(np.sqrt(np.mean((tensor - both[1, 0]) ** 2)))
                level = np.hypot(apart, (off + _ROUNDING) * np.abs(tensor).max())
                shift = np.tensordot(moved, np.nan_to_num(others - tensor), 1)
                disturbed.append(tensor + shift + level * rng.standard_normal(tensor.shape))
            scatter.append(np.abs(np.asarray(function(tuple(disturbed))) - value) ** 2)
        error = _SAFETY * np.sqrt(np.mean(scatter, axis=0))
        return np.where(np.isfinite(error), error, np.inf)[()]


def forms_along(problem: OrbitProblem, states: Floats, order: int = 3, once: bool = False) -> MultilinearForms:
    """Return the derivatives (2, k, n, d, d, ...) from each state (k, n, d + m) of some cycles to the next one."""
    (number, nodes, width), count, sizes = states.shape, problem.divisions, problem.scale[: problem.dimension]
    periods = problem.period * count // nodes
    places = [states[:, k::count].reshape(-1, width) for k in range(count)]
    parts = [
        multilinear_forms(problem.swept, some, periods, sizes, once, order, part=(k, count))
        for k, some in enumerate(places)
    ]
    tensors = list[Floats]()
    for of_order in zip(*(part.tensors for part in parts), strict=True):
        apart = [t.reshape(len(t), number, nodes // count, *t.shape[2:]) for t in of_order]
        tensors.append(np.stack(apart, axis=3).reshape(len(apart[0]), number, nodes, *of_order[0].shape[2:]))
    return MultilinearForms(tuple(tensors), all(part.exact for part in parts))
