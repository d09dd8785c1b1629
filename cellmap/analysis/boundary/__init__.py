"""Basin boundaries: edge states, saddles, stable and unstable manifolds, chaotic saddles, escape rates."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
