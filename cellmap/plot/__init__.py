"""Figures of results, with matplotlib.

Each function takes a result, everything else by keyword, and draws on `ax` or on a new figure.  It returns its axes;
those with several panels (`time_series`, `bifurcation_diagram` and `basin_continuation`) always return a tuple of them.
`draw` chooses the function by the type of the result.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
