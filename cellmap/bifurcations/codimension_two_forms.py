"""Normal forms of bifurcations of codimension two, with errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Complexes, Floats
from .._lib.signatures import checked
from ..maps.point_map import PointMap
from ..orbits.multipliers import multipliers_along
from ..orbits.orbit_equations import OrbitProblem
from .homological import Centre, Term, normal_form_terms
from .kinds import CodimensionTwoKind as Kind
from .normal_forms import CERTAIN, LocatedForms, Tensors

_RESONANT = 1e-6  # difference of a multiplier and a product of multipliers that are taken for equal
_ELSEWHERE = 1e-2  # error of critical multipliers, from which they are others

Numbers = dict[str, complex]


@dataclass(frozen=True)
class _Form:
    """Normal form: terms by name, numbers that follow from them, and those that a generic bifurcation asks for."""

    order: int
    terms: dict[str, Term]
    further: Callable[[Numbers], Numbers] = lambda _: {}
    required: tuple[str, ...] = ()
    complex: tuple[str, ...] = ()


_THIRD = complex(-0.5, 0.75**0.5)
_FIFTH = _Form(5, {"lower": (0, (3,)), "e": (0, (5,))}, required=("e",))
_FORMS = {
    Kind.CUSP: _Form(3, {"lower": (0, (2,)), "c": (0, (3,))}, required=("c",)),
    Kind.GENERALISED_FLIP: _FIFTH,
    Kind.DEGENERATE_PITCHFORK: _FIFTH,
    Kind.CHENCINER: _Form(
        5,
        {"d1": (0, (2, 1)), "d2": (0, (3, 2))},
        further=lambda n: {"l2": n["d2"].real + 0.5 * n["d1"].imag ** 2, "lower": n["d1"].real},
        required=("l2",),
        complex=("d1", "d2"),
    ),
    Kind.RESONANCE_1_1: _Form(2, {"a": (1, (2, 0)), "b": (1, (1, 1))}, required=("a", "b")),
    Kind.RESONANCE_1_2: _Form(
        3,
        {"c": (1, (3, 0)), "d": (1, (2, 1))},
        further=lambda n: {"s": n["d"] + 3.0 * n["c"]},
        required=("c", "s"),
    ),
    Kind.RESONANCE_1_3: _Form(
        3,
        {"b": (0, (0, 2)), "c": (0, (2, 1))},
        further=lambda n: {"a": (_THIRD.conjugate() * n["c"]).real - abs(n["b"]) ** 2},
        required=("b", "a"),
        complex=("b", "c"),
    ),
    Kind.RESONANCE_1_4: _Form(
        3,
        {"c": (0, (2, 1)), "d": (0, (0, 3))},
        further=lambda n: {"a": -1j * n["c"] / abs(n["d"])},
        required=("d",),
        complex=("c", "d", "a"),
    ),
    Kind.FOLD_FLIP: _Form(
        3,
        {
            "a": (0, (2, 0)),
            "b": (0, (0, 2)),
            "e": (1, (1, 1)),
            "c1": (0, (3, 0)),
            "c2": (0, (1, 2)),
            "c3": (1, (2, 1)),
            "c4": (1, (0, 3)),
        },
        required=("a", "b", "e"),
    ),
    Kind.FOLD_NEIMARK_SACKER: _Form(
        3,
        {
            "a": (0, (2, 0, 0)),
            "b": (0, (0, 1, 1)),
            "e": (1, (1, 1, 0)),
            "c1": (0, (3, 0, 0)),
            "c2": (0, (1, 1, 1)),
            "c3": (1, (2, 1, 0)),
            "c4": (1, (0, 2, 1)),
        },
        required=("a", "b"),
        complex=("e", "c3", "c4"),
    ),
    Kind.FLIP_NEIMARK_SACKER: _Form(
        3,
        {"a": (0, (3, 0, 0)), "b": (0, (1, 1, 1)), "c": (1, (2, 1, 0)), "d": (1, (0, 2, 1))},
        required=("a", "d"),
        complex=("c", "d"),
    ),
    Kind.DOUBLE_NEIMARK_SACKER: _Form(
        3,
        {
            "a": (0, (2, 1, 0, 0)),
            "b": (0, (1, 0, 1, 1)),
            "c": (2, (1, 1, 1, 0)),
            "d": (2, (0, 0, 2, 1)),
        },
        required=("a", "d"),
        complex=("a", "b", "c", "d"),
    ),
}
_VANISHING = ("lower",)
"""Coefficients that are zero at the bifurcation."""

_BLOCKS = {kind: tuple(_FORMS[kind].terms.values()) for kind in (Kind.RESONANCE_1_1, Kind.RESONANCE_1_2)}
_REAL = {
    Kind.CUSP: (1.0,),
    Kind.GENERALISED_FLIP: (-1.0,),
    Kind.DEGENERATE_PITCHFORK: (1.0,),
    Kind.FOLD_FLIP: (1.0, -1.0),
    Kind.FOLD_NEIMARK_SACKER: (1.0,),
    Kind.FLIP_NEIMARK_SACKER: (-1.0,),
}
_KNOWN = {Kind.RESONANCE_1_3: _THIRD, Kind.RESONANCE_1_4: 1j}
_PAIRS = {
    Kind.CHENCINER: 1,
    Kind.FOLD_NEIMARK_SACKER: 1,
    Kind.FLIP_NEIMARK_SACKER: 1,
    Kind.DOUBLE_NEIMARK_SACKER: 2,
}
"""Numbers of complex pairs on the unit circle."""


@dataclass(frozen=True, eq=False)
class CodimensionTwoForm:
    """Normal form of a bifurcation of codimension two, for coordinates u, v (complex: w) on the centre manifold.

    Parameters
    ----------
    kind : CodimensionTwoKind
        Kind of the bifurcation.
    coefficients : dict of str to complex
        Coefficients by name.  Eigenvectors have length 1 in the units of the coordinates; the largest component of a
        complex one, in natural sizes, is real and positive.

        ====================  ==========================================================================
        cusp                  u -> u + c u^3
        generalised flip      u -> -u + e u^5
        degenerate pitchfork  u -> u + e u^5
        Chenciner             w -> exp(i theta) w (1 + d1 abs(w)^2 + d2 abs(w)^4), l2 = Re d2 + (Im d1)^2/2
        1:1 resonance         (u, v) -> (u + v, v + a u^2 + b u v)
        1:2 resonance         (u, v) -> (-u + v, -v + c u^3 + d u^2 v), s = d + 3 c
        1:3 resonance         w -> mu w + b conj(w)^2 + c w abs(w)^2, a = Re(c conj(mu)) - abs(b)^2
        1:4 resonance         w -> i w + c w abs(w)^2 + d conj(w)^3, a = -i c/abs(d)
        fold-flip             (u, v) -> (u + a u^2 + b v^2 + c1 u^3 + c2 u v^2, -v + e u v + c3 u^2 v + c4 v^3)
        fold-Neimark-Sacker   (u, w) -> (u + a u^2 + b abs(w)^2 + c1 u^3 + c2 u abs(w)^2,
                              mu w + e u w + c3 u^2 w + c4 w abs(w)^2)
        flip-Neimark-Sacker   (u, w) -> (-u + a u^3 + b u abs(w)^2, mu w + c u^2 w + d w abs(w)^2)
        double Neimark-       (w, z) -> (mu w (1 + a abs(w)^2 + b abs(z)^2), nu z (1 + c abs(w)^2 + d abs(z)^2)), where
        Sacker                the angle of mu is the smaller one
        ====================  ==========================================================================

        The cubic terms of the forms with quadratic ones depend on the choice of coordinates: the centre manifold has
        no resonant terms beyond its linear ones.
    errors : dict of str to float
        Estimates of their errors; infinite for coefficients that are not known, NaN.
    degenerate : tuple of str
        Names of those that must not vanish in the generic case and are zero within three errors, or not known.
    exact : bool
        Whether derivatives of the map come from its higher variational equations; else from differences of Jacobian
        matrices, which provide none of the fifth order.
    """

    kind: Kind
    coefficients: dict[str, complex]
    errors: dict[str, float]
    degenerate: tuple[str, ...]
    exact: bool

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value:.9g} +- {self.errors[name]:.1g}" for name, value in self.coefficients.items())
        return f"CodimensionTwoForm({self.kind}, {shown})"


@checked
def codimension_two_form(point_map: PointMap, point: ArrayLike, kind: Kind, period: int = 1) -> CodimensionTwoForm:
    """Return the normal form of a bifurcation of codimension two of a fixed or periodic point.

    The bifurcations on a :class:`BifurcationCurve` have it as their `normal_form`.  Derivatives of the map, up to the
    fifth where they are needed, are integrated with the orbit (higher variational equations).  The centre manifold and
    the normal form follow from the homological equation, degree by degree.

    Parameters
    ----------
    point_map : PointMap
        The map, at the bifurcation; for an interpolated map, its exact map is used.
    point : array_like, shape (dimension,)
        Point of the orbit.
    kind : CodimensionTwoKind
        Kind of the bifurcation.
    period : int, optional
        Period of the orbit, in steps of the map.

    Returns
    -------
    CodimensionTwoForm
        Coefficients with their errors.

    Raises
    ------
    ValueError
        Where the multipliers are not those that the kind asks for.

    References
    ----------
    Kuznetsov, Meijer, SIAM Journal on Scientific Computing 26 (2005) 1932; *Numerical Bifurcation Analysis of Maps*
    (2019), chapter 4.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> from cellmap.bifurcations import CodimensionTwoKind
    >>> cubic = discrete_map(lambda x, p: (x[0] - p.s * x[0]**3,), {"s": 0.5}, ("x",))
    >>> codimension_two_form(cubic, [0.0], CodimensionTwoKind.CUSP)
    CodimensionTwoForm(cusp, c=-0.5 +- ...)
    """
    found = _form(LocatedForms.at(point_map, point, period, _FORMS[kind].order), kind)
    if found is None:
        raise ValueError(f"kind={kind!r}: the multipliers of the orbit are not those of this bifurcation")
    return found


def form_of_two(problem: OrbitProblem, unknowns: Floats, kind: Kind) -> CodimensionTwoForm | None:
    """Return the normal form at unknowns (d + 2,) of an orbit problem; None where its multipliers do not allow it."""
    return _form(LocatedForms.of(problem, unknowns, _FORMS[kind].order), kind)


def _form(located: LocatedForms, kind: Kind) -> CodimensionTwoForm | None:
    form, centre = _FORMS[kind], _centre(located.tensors[0], kind)
    if centre is None or not centre.off(located.tensors[0]) < _ELSEWHERE:
        return None
    found = _numbers(located.tensors, kind, located.sizes)
    vanishing = [abs(found[name]) for name in _VANISHING if name in found]
    off = max(centre.off(located.tensors[0]), *np.nan_to_num(vanishing), 0.0)

    def again(tensors: Tensors) -> Complexes:
        return np.array(list(_numbers(tensors, kind, located.sizes).values()))

    values = np.array(list(found.values()))
    errors = dict(zip(found, located.error_of(values, again, off).tolist(), strict=True))
    names = [name for name in found if name not in _VANISHING]
    return CodimensionTwoForm(
        kind=kind,
        coefficients={name: found[name] if name in form.complex else found[name].real for name in names},
        errors={name: errors[name] for name in names},
        degenerate=tuple(name for name in form.required if not abs(found[name]) > CERTAIN * errors[name]),
        exact=located.forms.exact,
    )


def _numbers(tensors: Tensors, kind: Kind, sizes: Floats) -> Numbers:
    """Return the coefficients of a normal form, NaN where they are not known."""
    form, centre = _FORMS[kind], _centre(tensors[0], kind)
    found: Numbers = dict.fromkeys(form.terms, complex(np.nan))
    if centre is not None and len(tensors) >= form.order:
        terms = normal_form_terms(tensors[: form.order], centre, form.order)
        lengths = np.linalg.norm(centre.right[0] * sizes[:, None], axis=0)
        lengths = lengths if centre.is_diagonal else np.full_like(lengths, lengths[0])
        for name, (component, exponent) in form.terms.items():
            found[name] = terms[component, exponent] * complex(lengths[component] / np.prod(lengths**exponent))
            if kind in (Kind.CHENCINER, Kind.DOUBLE_NEIMARK_SACKER):
                found[name] /= centre.linear[component, component]
    with np.errstate(all="ignore"):
        return found | form.further({name: np.complex128(value) for name, value in found.items()})


def _centre(matrices: Floats, kind: Kind) -> Centre | None:
    """Return the critical eigenspace of a kind of bifurcation; None where there is none."""
    if kind in _BLOCKS:
        return Centre.of_block(matrices, 1.0 if kind is Kind.RESONANCE_1_1 else -1.0, _BLOCKS[kind])
    critical = list[complex](_REAL.get(kind, ()))
    if kind in _KNOWN:
        critical.append(_KNOWN[kind])
    if kind in _PAIRS:
        upper = multipliers_along(matrices)
        upper = upper[upper.imag > 0.0]
        nearest = upper[np.argsort(np.abs(np.abs(upper) - 1.0))[: _PAIRS[kind]]]
        if len(nearest) < _PAIRS[kind]:
            return None
        critical += (nearest / np.abs(nearest))[np.argsort(-nearest.real)].tolist()
    return Centre.of(matrices, critical, _RESONANT)
