"""Stability of equilibria, continuation of periodic orbits, bifurcations and their curves, bifurcation diagrams."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
