"""Maps rebuilt from their recipes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from .._lib.signatures import checked
from .grid import CellGrid
from .interpolation.interpolated import interpolated_map
from .poincare import section_map
from .point_map import PointMap
from .stroboscopic import stroboscopic_map
from .system import ForcedSystem


@checked
def rebuild_map(source: ForcedSystem | PointMap, recipe: Mapping[str, Any]) -> PointMap:
    """Rebuild a map from its recipe, as stored in the map, its basins or a file.

    Parameters
    ----------
    source : ForcedSystem or PointMap
        The system, or for a discrete map the map itself, with the parameters of the original.
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
    >>> decay = ForcedSystem(lambda t, x, p: (-p.rate * x[0],), {"rate": 1.0}, 2 * pi, ("x",))
    >>> original = stroboscopic_map(decay, rtol=1e-6)
    >>> bool(rebuild_map(decay, original.recipe)([1.0]) == original([1.0]))
    True
    """
    if not isinstance(recipe, Mapping):
        raise TypeError(f"recipe={recipe!r}: give point_map.recipe, or basins.settings['map']")
    kind = recipe.get("kind")
    match kind, source:
        case "interpolated", _:
            return interpolated_map(
                rebuild_map(source, recipe["exact"]),
                CellGrid(tuple(recipe["lower"]), tuple(recipe["upper"]), tuple(recipe["shape"])),
                order=int(recipe["order"]),
                outside=recipe["outside"],
                tolerance=recipe["tolerance"],
                leap=recipe.get("leap", 1),
            )
        case "stroboscopic", ForcedSystem():
            if source.length != recipe["period"]:
                raise ValueError(
                    f"source has the period {source.length!r}, not {recipe['period']!r}: give the same parameters, "
                    "or for a map of flow_map the system with that period"
                )
            settings = {name: recipe[name] for name in ("phase", "rtol", "atol", "method", "max_steps")}
            return stroboscopic_map(source, **settings)
        case "section", ForcedSystem():
            section = recipe["coordinate"], recipe["value"], recipe["direction"]
            settings = {name: recipe[name] for name in ("max_time", "rtol", "atol", "max_steps")}
            return section_map(replace(source, period=recipe["period"]), section, **settings)
        case "discrete", PointMap():
            return source
    raise ValueError(f"recipe of kind {kind!r} cannot be rebuilt from {source!r}: give its system")
