"""Systems and their point maps: stroboscopic, Poincaré, discrete and interpolated maps."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
