"""Basins recomputed from the settings of a stored result."""

from __future__ import annotations

from .._lib.signatures import checked
from ..maps.interpolation.interpolated import Interpolated
from ..maps.point_map import PointMap
from ..maps.rebuild import specification
from ..maps.system import ForcedSystem
from .finding import find_basins
from .record import Basins


@checked
def recompute_basins(basins: Basins, source: ForcedSystem | PointMap) -> Basins:
    """Recompute basins from the settings of a stored result and its system.

    Parameters
    ----------
    basins : Basins
        A result, as :func:`load_basins` returns it.
    source : ForcedSystem or PointMap
        The system, or the discrete map.

    Returns
    -------
    Basins
        The same labels, with their map.

    Raises
    ------
    ValueError
        For a source whose parameters are not those of the basins.
    """
    if "method" in basins.settings:
        raise ValueError(
            f"basins are from a {basins.settings['method']}, not from find_basins: compute that mapping again"
        )
    if dict(source.params) != dict(basins.params):
        raise ValueError(f"source has params {dict(source.params)} and the basins {dict(basins.params)}")
    spec = specification(source, basins.settings["map"])
    exact = spec.exact if isinstance(spec, Interpolated) else spec.build()
    if exact.coordinates != basins.coordinates:
        theirs, ours = (", ".join(map(repr, c)) for c in (exact.coordinates, basins.coordinates))
        raise ValueError(f"source has the coordinates ({theirs}) and the basins ({ours})")
    initial_conditions = basins.grid if basins.grid is not None else basins.initial_conditions
    assert initial_conditions is not None
    point_map = spec.build() if isinstance(spec, Interpolated) else exact
    names = ("max_periods", "longest_period")
    limits = {name: basins.settings[name] for name in names if name in basins.settings}
    if basins.settings.get("goes_on"):
        limits["max_periods"] = None
    return find_basins(point_map, initial_conditions, **limits)
