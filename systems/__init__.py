"""Pendulums composed from bodies, effects and drives, and reference systems of the literature.

:func:`scene` makes a system from a body and the effects on it.  Each reference system has one factory, with defaults
for all of its parameters.  The laboratory, in :mod:`systems.lab`, measures their parameters.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
