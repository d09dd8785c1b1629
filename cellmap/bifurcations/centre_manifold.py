"""Coefficients of normal forms on the centre manifold of a fixed point, in terms of multilinear forms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kinds import BifurcationKind

Vector = NDArray[Any]


def coefficient(
    kind: BifurcationKind,
    critical: complex,
    forms: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    q: Vector,
    p: Vector,
) -> tuple[complex, float, float]:
    """Return the coefficient of the normal form of a map with the derivatives A, B, C.

    `q` and `p` are eigenvectors of A and of its transpose for the `critical` multiplier, and p . q = 1; with another
    product the coefficient is multiplied by it.  Also returned are the sum of the sizes of all terms, and the smallest
    singular value among the matrices that were inverted.  NaN where one of them is singular.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), section 5.4.
    """
    a, b, c = forms
    unit = np.eye(len(a))
    terms, gaps = list[float](), [1.0]

    def two(u: Vector, v: Vector) -> Vector:
        return np.asarray(np.einsum("ijk,j,k", b, u, v))

    def projected(u: Vector) -> complex:
        terms.append(float(np.abs(p) @ np.abs(u)))
        return complex(p @ u)

    def solved(matrix: NDArray[Any], rhs: Vector) -> Vector:
        gaps.append(float(np.linalg.svd(matrix, compute_uv=False)[-1]))
        return np.asarray(np.linalg.solve(matrix, rhs))

    three = np.asarray(np.einsum("ijkl,j,k,l", c, q, q, q.conj()))
    try:
        match kind:
            case BifurcationKind.PERIOD_DOUBLING:
                value = (projected(three) + projected(3.0 * two(q, solved(unit - a, two(q, q))))) / 6.0
            case BifurcationKind.NEIMARK_SACKER:
                mean = solved(unit - a, two(q, q.conj()))
                double = solved(critical**2 * unit - a, two(q, q))
                value = projected(three) + projected(2.0 * two(q, mean)) + projected(two(q.conj(), double))
                value /= 2.0 * critical
            case BifurcationKind.PITCHFORK:
                bordered = np.block([[unit - a, q[:, None]], [p[None], np.zeros((1, 1))]])
                bent = solved(bordered, np.append(two(q, q), 0.0))[:-1]
                value = (projected(three) + projected(3.0 * two(q, bent))) / 6.0
            case _:
                value = 0.5 * projected(two(q, q))
    except np.linalg.LinAlgError:
        value = complex(np.nan)
    return value, sum(terms), min(gaps)
