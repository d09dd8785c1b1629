"""Maps made again from their recipes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from .basin_finding import find_basins
from .basins import Basins
from .grid import CellGrid
from .interpolated import interpolated_map
from .pointmap import PointMap
from .section import section_map
from .signatures import checked
from .stroboscopic import stroboscopic_map
from .system import ForcedSystem


@checked
def rebuild_map(source: ForcedSystem | PointMap, recipe: Mapping[str, Any]) -> PointMap:
    """Make a map again from the recipe that it, its basins or a file carry.

    Parameters
    ----------
    source : ForcedSystem or PointMap
        The system, or for a discrete map the map itself, with the parameters of the original.
    recipe : mapping
        ``point_map.recipe``, or ``basins.settings["map"]``.

    Returns
    -------
    PointMap
        A map with the same images, to the bit, on a processor of the same kind.

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
    raise ValueError(f"recipe of kind {kind!r} cannot be made from {source!r}: give the system it was made from")


@checked
def recompute_basins(basins: Basins, source: ForcedSystem | PointMap) -> Basins:
    """Find basins again, from what a stored result says about itself and its system.

    Parameters
    ----------
    basins : Basins
        A result, as :func:`load_basins` returns it.
    source : ForcedSystem or PointMap
        The system, or the discrete map.

    Returns
    -------
    Basins
        The same labels again, now with their map.

    Raises
    ------
    ValueError
        For a source whose parameters are not those of the basins.
    """
    if "method" in basins.settings:
        raise ValueError(
            f"basins are from a {basins.settings['method']}, not from find_basins: make that mapping again"
        )
    if dict(source.params) != dict(basins.params):
        raise ValueError(f"source has params {dict(source.params)} and the basins {dict(basins.params)}")
    axes = source.axes if isinstance(source, ForcedSystem) else source.coordinates
    recipe = basins.settings["map"]
    across = recipe.get("exact", recipe).get("coordinate")  # of a section, on which it is not a coordinate
    axes = tuple(c for c in axes if c.name != across)
    if axes != basins.coordinates:
        theirs, ours = (", ".join(map(repr, c)) for c in (axes, basins.coordinates))
        raise ValueError(f"source has the coordinates ({theirs}) and the basins ({ours})")
    starts = basins.grid if basins.grid is not None else basins.starts
    assert starts is not None
    point_map = rebuild_map(source, recipe)
    limits = {name: basins.settings[name] for name in ("max_periods", "max_period")}
    return find_basins(point_map, starts, **limits)
