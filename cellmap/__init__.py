"""Global analysis of periodically forced dynamical systems by cell mapping.

A plain right-hand side becomes a :class:`ForcedSystem`, that a stroboscopic :class:`PointMap`, that an interpolated
cell map; attractors and basins are found on any of them.
"""

from .attractor import Attractor as Attractor
from .attractor import Kind as Kind
from .basins import Basins as Basins
from .basins import find_basins as find_basins
from .coordinates import Coordinate as Coordinate
from .coordinates import angle as angle
from .discrete import discrete_map as discrete_map
from .grid import CellGrid as CellGrid
from .interpolated import interpolated_map as interpolated_map
from .jacobian import jacobian as jacobian
from .pointmap import Iterate as Iterate
from .pointmap import PointMap as PointMap
from .pointmap import Status as Status
from .pointmap import ToleranceWarning as ToleranceWarning
from .search import find_attractors as find_attractors
from .stroboscopic import stroboscopic_map as stroboscopic_map
from .system import ForcedSystem as ForcedSystem
from .threads import set_threads as set_threads
from .threads import thread_count as thread_count

__version__ = "0.1.0"
