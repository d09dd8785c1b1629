"""Maps rebuilt from their recipes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .._lib.signatures import checked

# Importing the kinds of maps makes them known.
from . import discrete, inverse, parameters_as_states, poincare, stroboscopic  # noqa: F401
from .interpolation import interpolated  # noqa: F401
from .point_map import PointMap
from .specification import specification as specification
from .system import ForcedSystem


@checked
def rebuild_map(source: ForcedSystem | PointMap, recipe: Mapping[str, Any]) -> PointMap:
    """Rebuild a map from its recipe, as stored in the map, its basins or a file.

    Parameters
    ----------
    source : ForcedSystem or PointMap
        The system, or for a map without one a map of the same kind, with the parameters of the original.
    recipe : mapping
        ``point_map.recipe``, or ``basins.settings["map"]``.

    Returns
    -------
    PointMap
        A map with bitwise identical images on a processor of the same kind.

    Raises
    ------
    ValueError
        For a recipe that does not fit the source.

    Examples
    --------
    >>> from math import pi
    >>> from cellmap import ForcedSystem, stroboscopic_map
    >>> decay = ForcedSystem(lambda t, x, p: (-p.rate * x[0],), {"rate": 1.0}, 2 * pi, ("x",))
    >>> original = stroboscopic_map(decay, rtol=1e-6)
    >>> bool(rebuild_map(decay, original.recipe)([1.0]) == original([1.0]))
    True
    """
    if not isinstance(recipe, Mapping):
        raise TypeError(f"recipe={recipe!r}: give point_map.recipe, or basins.settings['map']")
    made = specification(source, recipe).build()
    assert isinstance(made, PointMap)
    return made
