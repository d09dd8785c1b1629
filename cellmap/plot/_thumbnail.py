"""Small images of basins, without a figure."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import matplotlib.image
import numpy as np

from ..basins.record import Basins
from ._basins import painted
from ._colours import label_colours

_PIXELS = 128  # along the longer side


def thumbnail(basins: Basins) -> bytes | None:
    """Return a PNG of at most 128 x 128 initial conditions, evenly spread; None for basins that are no plane.

    No figure is made, so that those of pyplot stay as they are.
    """
    if basins.grid is None or sum(n > 1 for n in basins.grid.shape) != 2:
        return None
    few = tuple(slice((n % step) // 2, None, step) for n, step in ((n, -(-n // _PIXELS)) for n in basins.labels.shape))
    small = replace(basins, labels=basins.labels[few], settling_time=basins.settling_time[few])
    image = painted(small, label_colours(basins), shade=False)
    file = BytesIO()
    matplotlib.image.imsave(file, np.ascontiguousarray(image[::-1]), format="png")
    return file.getvalue()
