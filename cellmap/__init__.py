"""Global analysis of periodically forced dynamical systems by cell mapping.

A plain right-hand side becomes a :class:`ForcedSystem`, that a stroboscopic :class:`PointMap`, that an interpolated
cell map; attractors and basins of attraction are found on any of them.  What is used most is here; everything else is
in the subpackages `maps`, `orbits`, `bifurcations`, `attractors`, `basins`, `sets`, `analysis` and `plot`.
"""

import lazy_loader as _lazy

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
