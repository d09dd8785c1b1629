"""Fractal geometry of basins and attractors: dimensions, uncertainty exponents, basin entropy, Wada tests."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
