"""Finite-time Lyapunov exponents of boxes."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import claim_memory, whole_number
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..maps.coordinates import wrap
from ..maps.orbit_batch import CHUNK
from ..maps.point_map import PointMap
from ..orbits.exponent_fields import growth
from .box_images import check_boxes
from .box_set import BoxSet


@checked
def box_ftle(boxes: BoxSet, point_map: PointMap, periods: int = 10) -> Floats:
    """Compute the finite-time Lyapunov exponent of the centre of each box.

    It is the logarithm of the largest singular value of the derivative of `periods` steps, divided by their number, as
    in :func:`finite_time_exponents` for whole grids; here only the boxes of the set are evaluated.

    Parameters
    ----------
    boxes : BoxSet
        Boxes at whose centres the exponent is computed.
    point_map : PointMap
        Stroboscopic or discrete map, in any dimension; for an interpolated map, its exact map is used.
    periods : int, optional
        Steps of the map, at least 1.

    Returns
    -------
    ndarray, shape (n,)
        Exponents per step of the map; NaN where the orbit terminated.

    References
    ----------
    Haller, Physica D 149 (2001) 248; Padberg, Thiere, Preis, Dellnitz, Communications in Nonlinear Science and
    Numerical Simulation 14 (2009) 4176.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> saddle = discrete_map(lambda x, p: (2 * x[0], x[1] / 4), {}, ("x", "y"))
    >>> boxes = BoxSet.of_points(CellGrid((-1, -1), (1, 1), (8, 8)), [[0.1, 0.1], [0.3, 0.9]])
    >>> (box_ftle(boxes, saddle) / np.log(2.0)).round(12).tolist()
    [1.0, 1.0]
    """
    check_boxes(boxes, point_map)
    periods = whole_number("periods", periods, at_least=1)
    exact = point_map.without_table
    claim_memory(f"exponents of {len(boxes):,} boxes", 8 * (2 * boxes.grid.dimension + 1) * len(boxes), "take fewer")
    initial_conditions, exponents = wrap(boxes.centres(), exact.coordinates), np.empty(len(boxes))

    def work(part: slice) -> None:
        exponents[part] = growth(exact, initial_conditions[part], periods)[0]

    run_over(slices(len(boxes), CHUNK // 16), work)
    return exponents / periods
