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
    forms: tuple[NDArray[np.float64], ...],
    q: Vector,
    p: Vector,
) -> complex:
    """Return the coefficient of the normal form of a map with the derivatives A, B, C.

    `q` and `p` are eigenvectors of A and of its transpose for the `critical` multiplier, and p . q = 1; with another
    product the coefficient is multiplied by it.  NaN where a matrix that is inverted is singular.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), section 5.4.
    """
    a, b, c = forms[:3]
    unit = np.eye(len(a))

    def two(u: Vector, v: Vector) -> Vector:
        return np.asarray(np.einsum("ijk,j,k", b, u, v))

    def solved(matrix: NDArray[Any], rhs: Vector) -> Vector:
        return np.asarray(np.linalg.solve(matrix, rhs))

    three = np.asarray(np.einsum("ijkl,j,k,l", c, q, q, q.conj()))
    try:
        match kind:
            case BifurcationKind.PERIOD_DOUBLING:
                bent = solved(unit - a, two(q, q))
                value = complex(p @ (three + 3.0 * two(q, bent)) / 6.0)
            case BifurcationKind.NEIMARK_SACKER:
                mean = solved(unit - a, two(q, q.conj()))
                double = solved(critical**2 * unit - a, two(q, q))
                value = complex(p @ (three + 2.0 * two(q, mean) + two(q.conj(), double)) / (2.0 * critical))
            case BifurcationKind.PITCHFORK:
                bordered = np.block([[unit - a, q[:, None]], [p[None], np.zeros((1, 1))]])
                bent = solved(bordered, np.append(two(q, q), 0.0))[:-1]
                value = complex(p @ (three + 3.0 * two(q, bent)) / 6.0)
            case _:
                value = complex(0.5 * p @ two(q, q))
    except np.linalg.LinAlgError:
        return complex(np.nan)
    return value
