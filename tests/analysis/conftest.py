"""What the rooms of analysis share: figures without a screen, and the basins of the driven pendulum."""

from math import pi

import matplotlib as mpl
import pytest

from cellmap import Basins, CellGrid, find_basins, interpolated_map, stroboscopic_map
from systems import driven_pendulum

mpl.use("Agg")


@pytest.fixture(scope="session")
def pendulum() -> Basins:
    """Hanging, inverted and rotating at 3 mm; the map of the basins is a table, which holds the exact one."""
    exact = stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)
    table = interpolated_map(exact, CellGrid((-pi, -1000.0), (pi, 1000.0), (128, 256)), outside="integrate")
    return find_basins(table, CellGrid((-pi, -500.0), (pi, 500.0), (200, 200)))
