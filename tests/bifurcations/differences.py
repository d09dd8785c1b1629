"""Coefficients of normal forms by another way: differences of images that SciPy integrates."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem
from cellmap.bifurcations import BifurcationKind

FOLD, DOUBLING, PITCHFORK = (BifurcationKind(k) for k in ("fold", "period doubling", "pitchfork"))


def images(system: ForcedSystem, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return images (n, 2) over one period by SciPy's DOP853, all in one integration."""
    columns = np.asarray(states).T

    def rhs(t: float, flat: NDArray[np.float64]) -> NDArray[np.float64]:
        x = flat.reshape(columns.shape)
        return np.array([system.derivative(t, tuple(s)) for s in x.T]).T.ravel()

    end = solve_ivp(rhs, (0.0, system.length), columns.ravel(), "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return end.reshape(columns.shape).T


STENCILS = {
    1: np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280]),
    2: np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560]),
    3: np.array([-7 / 240, 3 / 10, -169 / 120, 61 / 30, 0, -61 / 30, 169 / 120, -3 / 10, 7 / 240]),
}
"""Central differences of order 8, 8 and 6."""


class Differences:
    """Derivatives of a map of two variables from its images on lines, in units of displacements."""

    def __init__(self, system: ForcedSystem, state: Any, sizes: Any, step: float) -> None:
        lines = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
        self.sizes, offsets = np.array(sizes), step * np.arange(-4, 5)
        places = np.array(state) + offsets[None, :, None] * lines[:, None] * self.sizes
        found = images(system, places.reshape(-1, 2)).reshape(places.shape) / self.sizes
        self.along = {k: np.einsum("s,lsi->li", w, found) / step**k for k, w in STENCILS.items()}

    def one(self, u: Any) -> Any:
        return self.along[1][0] * u[0] + self.along[1][1] * u[1]

    def two(self, u: Any, v: Any) -> Any:
        xx, yy, plus, minus = self.along[2]
        return xx * u[0] * v[0] + yy * u[1] * v[1] + 0.25 * (plus - minus) * (u[0] * v[1] + u[1] * v[0])

    def three(self, u: Any) -> Any:
        xxx, yyy, plus, minus = self.along[3]
        xyy, xxy = (plus + minus - 2.0 * xxx) / 6.0, (plus - minus - 2.0 * yyy) / 6.0
        return xxx * u[0] ** 3 + 3.0 * xxy * u[0] ** 2 * u[1] + 3.0 * xyy * u[0] * u[1] ** 2 + yyy * u[1] ** 3

    def coefficient(self, kind: BifurcationKind) -> float:
        """Return the coefficient by the formulas for maps of the plane, where (I - A)^-1 is known by eigenvectors."""
        matrix = np.column_stack([self.one((1.0, 0.0)), self.one((0.0, 1.0))])
        values, vectors = np.linalg.eig(matrix)
        k = int(np.argmin(np.abs(values - (-1.0 if kind is DOUBLING else 1.0))))
        vectors = vectors / np.linalg.norm(vectors * self.sizes[:, None], axis=0)
        q, left = vectors[:, k], np.linalg.inv(vectors)
        q, p = (s * np.sign((q * self.sizes)[np.argmax(np.abs(q * self.sizes))]) for s in (q, left[k]))
        if kind is FOLD:
            return float(0.5 * p @ self.two(q, q))
        parts = left @ self.two(q, q)
        others = values != values[k] if kind is PITCHFORK else np.full(2, True)
        parts = np.divide(parts, 1.0 - values, out=np.zeros_like(parts), where=others)
        return float(p @ (self.three(q) + 3.0 * self.two(q, vectors @ parts)) / 6.0)
