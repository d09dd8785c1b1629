"""How large and how safe basins are: basin stability, settling times, fatal shocks, integrity, tipping."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
