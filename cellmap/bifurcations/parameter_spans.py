"""How curves in the plane of two parameters are shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def spans(parameters: tuple[str, ...], values: NDArray[np.float64]) -> str:
    """Return the intervals of the parameters in which values (n, m) lie, in words."""
    columns = zip(parameters, values.T, strict=True)
    return ", ".join(f"{name} from {column.min():.6g} to {column.max():.6g}" for name, column in columns)
