"""Derivatives of a map at a located bifurcation, and the errors of what is computed from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..maps.multilinear import MultilinearForms, multilinear_forms
from ..maps.point_map import PointMap
from ..orbits.orbit_equations import OrbitProblem

CERTAIN = 3.0
"""Errors that a coefficient is away from zero, from which on it counts as not zero."""

_TRIALS = 8
_SAFETY = 1.2  # over the standard deviation
_ROUNDING = 2e-16
_LOCATION = 5e-16  # error of the unknowns, in natural sizes
_DISPLACEMENT = 1e-6  # the same, by which derivatives are compared
_DEFICIENT = 1e-6  # singular value of the equations at a branch point

Tensors = tuple[NDArray[np.float64], ...]
Function = Callable[[Tensors], Any]


@dataclass(frozen=True, eq=False)
class LocatedForms:
    """Derivatives of a map at a point, in natural sizes (d,), and at neighbours displaced along each unknown."""

    forms: MultilinearForms
    sizes: NDArray[np.float64]

    @classmethod
    def at(
        cls, point_map: PointMap, point: NDArray[np.float64], period: int, sizes: NDArray[np.float64], order: int = 3
    ) -> LocatedForms:
        """Return the derivatives at a point that is known exactly."""
        return cls(multilinear_forms(point_map, point[None], period, sizes, order=order), sizes)

    @classmethod
    def of(cls, problem: OrbitProblem, unknowns: NDArray[np.float64], order: int = 3) -> LocatedForms:
        """Return the derivatives at unknowns (d + m,) of an orbit problem, which have been located with an error.

        One further step of Newton's method is made first.
        """
        d = problem.dimension
        scale = np.append(problem.scale[:d], problem.scale[problem.states :])
        residual, derivatives = problem(unknowns)
        closed = unknowns - np.linalg.lstsq(derivatives, residual, rcond=_DEFICIENT)[0]
        state = problem.once(closed * problem.scale)
        places = state + np.vstack([np.zeros(len(scale)), _DISPLACEMENT * np.diag(scale)])
        sizes = problem.scale[:d]
        return cls(multilinear_forms(problem.swept, places, problem.period, sizes, order=order), sizes)

    @property
    def tensors(self) -> Tensors:
        """Derivatives A, B, C, ... at the point."""
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
            disturbed = list[NDArray[np.float64]]()
            for both in self.forms.tensors:
                tensor, others = both[0, 0], both[0, 1:]
                apart = float(np.sqrt(np.mean((tensor - both[1, 0]) ** 2)))
                level = np.hypot(apart, (off + _ROUNDING) * np.abs(tensor).max())
                shift = np.tensordot(moved, np.nan_to_num(others - tensor), 1)
                disturbed.append(tensor + shift + level * rng.standard_normal(tensor.shape))
            scatter.append(np.abs(np.asarray(function(tuple(disturbed))) - value) ** 2)
        error = _SAFETY * np.sqrt(np.mean(scatter, axis=0))
        return np.where(np.isfinite(error), error, np.inf)[()]
