"""Types of arrays, of any shape, and a choice of their rows."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Complexes: TypeAlias = NDArray[np.complex128]


def evenly(number: int, most: int) -> Ints:
    """Return at most so many of the numbers of rows, evenly spread, in rising order.

    Examples
    --------
    >>> evenly(10, 4), evenly(2, 4), evenly(0, 4)
    (array([0, 3, 6, 9]), array([0, 1]), array([], dtype=int64))
    """
    return np.unique(np.linspace(0, number - 1, min(number, most)).round().astype(np.int64))


def thinned(points: Floats, most: int) -> Floats:
    """Return at most so many of the points (n, dimension), spread evenly over them."""
    return points if len(points) <= most else points[evenly(len(points), most)]
