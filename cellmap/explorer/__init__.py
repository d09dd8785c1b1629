"""The explorer: basin images in the browser that follow parameters, phase and window while they are changed."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
