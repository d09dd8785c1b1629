"""Global analysis of periodically forced dynamical systems by cell mapping."""

from .coordinates import Coordinate as Coordinate
from .coordinates import angle as angle
from .grid import CellGrid as CellGrid
from .pointmap import PointMap as PointMap
from .stroboscopic import stroboscopic_map as stroboscopic_map
from .system import ForcedSystem as ForcedSystem
from .discrete import discrete_map as discrete_map
from .jacobian import jacobian as jacobian
from .interpolated import interpolated_map as interpolated_map
