"""Curves of bifurcations of the orbits that are born at points of codimension two, by their normal forms."""

from __future__ import annotations

from dataclasses import dataclass

from .codimension_two_forms import CodimensionTwoForm
from .kinds import BifurcationKind, CodimensionTwoKind

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
