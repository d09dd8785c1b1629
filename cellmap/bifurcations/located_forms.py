"""Derivatives of a map at a located bifurcation, and the errors of what is computed from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from ..maps.multilinear import MultilinearForms, multilinear_forms
from ..maps.point_map import PointMap
from ..orbits.orbit_equations import OrbitProblem

CERTAIN = 3.0
"""Errors that a coefficient is away from zero, from which on it counts as not zero."""

_TRIALS = 8
_SAFETY = 1.6  # over the standard deviation
_ROUNDING = 2e-16
_LOCATION = 5e-16  # error of the unknowns, in natural sizes
_DISPLACEMENT = 1e-6  # the same, by which derivatives are compared
_DEFICIENT = 1e-6  # singular value of the equations at a branch point

Tensors = tuple[Floats, ...]
Function = Callable[[Tensors], Any]


@dataclass(frozen=True, eq=False)
class LocatedForms:
    """Derivatives of a map along a cycle, in natural sizes (d,), and along neighbours displaced along each unknown.

    Those of order k are (2, neighbours, n, d, d, ...) for a cycle of n points.
    """

    forms: MultilinearForms
    sizes: Floats

    @classmethod
    def at(cls, point_map: PointMap, point: Floats, period: int, sizes: Floats, order: int = 3) -> LocatedForms:
        """Return the derivatives at a point that is known exactly."""
        found = multilinear_forms(point_map, point[None], period, sizes, order=order)
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
