"""The laboratory: from films and accelerometers to the parameters of a scene."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
