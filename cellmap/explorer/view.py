"""Views of images: parameters, phase, window, and the map that it is computed with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Floats
from .._lib.checks import finite_number, finite_points, is_sequence, parameter_values, shown, whole_number
from ..maps.grid import CellGrid, between
from ..maps.system import ForcedSystem
from .explored import Explored

SCHEMA = 1
"""Version of the state in addresses; a page that reads an older one says so."""

MOST_CELLS = 4_000_000
MOST_NODES = 1024


@dataclass(frozen=True, eq=False)
class View:
    """An image of one of the explorer's systems.

    Parameters
    ----------
    params : mapping of str to float
        All parameters.
    phase : float or None
        Phase of the section, None for discrete maps.
    axes : tuple of int
        Coordinates along the image, the horizontal one first; one or two.
    lower, upper : tuple of float
        Limits of the window along these axes.
    others : tuple of float
        State whose other coordinates the slice has.
    cells : tuple of int
        Initial conditions along the axes.
    nodes : int
        Cells of the interpolation grid along each axis; 0 for the exact map.
    tolerance : float
        Tolerance of the exact map.
    """

    params: Mapping[str, float]
    phase: float | None
    axes: tuple[int, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    others: tuple[float, ...]
    cells: tuple[int, ...]
    nodes: int
    tolerance: float

    @classmethod
    def first(cls, explored: Explored) -> View:
        """Return the image that is shown first of a system."""
        window, system = explored.window, explored.system
        axes = tuple(range(min(2, window.dimension)))
        return cls(
            params=system.params,
            phase=0.0 if isinstance(system, ForcedSystem) else None,
            axes=axes,
            lower=tuple(window.lower[j] for j in axes),
            upper=tuple(window.upper[j] for j in axes),
            others=tuple(0.5 * (a + b) for a, b in zip(window.lower, window.upper, strict=True)),
            cells=tuple(window.shape[j] for j in axes),
            nodes=explored.nodes,
            tolerance=1e-6,
        )

    @classmethod
    def of(cls, given: Any, explored: Explored) -> View:
        """Return the image that a message asks for; fields that it does not name are those of the first image.

        Raises
        ------
        TypeError, ValueError
            For values out of bounds.
        """
        if not isinstance(given, Mapping):
            raise TypeError(f"view={shown(given)}: give an object")
        usual = cls.first(explored)
        if unknown := given.keys() - set(cls.__dataclass_fields__):
            raise ValueError(f"view has no {sorted(map(str, unknown))}: it has {list(cls.__dataclass_fields__)}")
        values = {name: given.get(name, getattr(usual, name)) for name in cls.__dataclass_fields__}
        params = {**usual.params, **parameter_values(values["params"])}
        if unknown := params.keys() - usual.params.keys():
            raise ValueError(f"params has no {sorted(unknown)}: this system has {sorted(usual.params)}")
        phase = usual.phase if usual.phase is None else finite_number("phase", values["phase"])
        dimension = len(usual.others)
        axes = _wholes("axes", values["axes"], len(usual.axes), 0, dimension - 1)
        if len(set(axes)) < len(axes):
            raise ValueError(f"axes={axes}: choose different coordinates")
        cells = _wholes("cells", values["cells"], len(axes), 2, 4000)
        if np.prod(cells) > MOST_CELLS:
            raise ValueError(f"cells={cells}: give at most {MOST_CELLS:,} initial conditions")
        nodes = whole_number("nodes", values["nodes"], at_most=MOST_NODES)
        if nodes and (dimension > 2 or nodes < 8):
            raise ValueError(f"nodes={nodes}: give 0 (exact map), or at least 8 for at most two coordinates")
        return cls(
            params,
            phase,
            axes,
            tuple(finite_points("lower", values["lower"], len(axes)).reshape(-1).tolist()),
            tuple(finite_points("upper", values["upper"], len(axes)).reshape(-1).tolist()),
            tuple(finite_points("others", values["others"], dimension).reshape(-1).tolist()),
            cells,
            nodes,
            finite_number("tolerance", values["tolerance"], at_least=1e-13, at_most=1e-2),
        )

    def initial_conditions(self) -> CellGrid | Floats:
        """Return the grid of initial conditions, or the initial conditions of a slice."""
        if len(self.axes) == len(self.others):
            order = np.argsort(self.axes)
            return CellGrid(*(tuple(np.array(v)[order].tolist()) for v in (self.lower, self.upper, self.cells)))
        CellGrid(self.lower, self.upper, self.cells)  # for its checks
        points = np.empty((*self.cells, len(self.others)))
        points[:] = self.others
        for k, j in enumerate(self.axes):
            along = between(self.lower[k], self.upper[k], self.cells[k], np.arange(self.cells[k]) + 0.5)
            points[..., j] = along.reshape([-1 if k == m else 1 for m in range(len(self.axes))])
        return points

    def raster(self, labels: NDArray[np.int16]) -> NDArray[np.int16]:
        """Return labels of the initial conditions as rows from top to bottom."""
        if len(self.axes) == 1:
            return labels.reshape(1, -1)
        upright = labels if len(self.others) == 2 and self.axes == (1, 0) else labels.T
        return upright[::-1]

    def state(self, place: ArrayLike) -> Floats:
        """Return the initial condition at a place of the image, given by its coordinates along the axes."""
        state = np.array(self.others)
        state[list(self.axes)] = finite_points("point", place, len(self.axes)).reshape(-1)
        return state


def _wholes(name: str, given: Any, length: int, at_least: int, at_most: int) -> tuple[int, ...]:
    if not is_sequence(given) or len(given) != length:
        raise ValueError(f"{name}={shown(given)}: give {length} whole numbers")
    return tuple(whole_number(name, n, at_least, at_most) for n in given)
