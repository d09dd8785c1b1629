"""Cell mapping (Hsu 1980, 1981) and set-oriented methods (Dellnitz, Junge): maps as Markov chains on boxes."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
