"""Labels of arbitrary points, from the map and the attractors of known basins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Floats, Ints
from .._lib.checks import listed, real_array, shown, whole_number
from ..attractors.given import check_attractors
from ..attractors.kinds.creeping import settled_at_last
from ..attractors.search import MAX_PERIODS
from ..attractors.settling.escape import far_bound
from ..attractors.settling.labels import LABEL_NAMES, Label
from ..attractors.settling.settle import Catalogue, Classified, Rule, classify
from ..maps.coordinates import Coordinate
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .initial_conditions import InitialConditions
from .record import Basins

Outcome = Callable[[Floats], Any]
"""Tells of each point (n, d) the number of the final state in which it is, -1 while it is in none."""


@dataclass(frozen=True, eq=False)
class Labeller:
    """A map with its attractors; called with points (n, dimension) it returns their labels (n,).

    Parameters
    ----------
    point_map : PointMap
        The map.
    attractors : tuple of Attractor
        Attractor k has the label k.
    catalogue : Catalogue
        Their neighbourhoods.
    max_periods : int
        Periods after which a point that has not settled is undecided.
    rule : callable or None
        What tells final states in the place of attractors.
    bound : ndarray or None
        Where orbits that go on growing have diverged; only bounds of the map itself otherwise.
    """

    point_map: PointMap
    attractors: tuple[Attractor, ...]
    catalogue: Catalogue
    max_periods: int
    rule: Rule | None = None
    bound: Floats | None = None

    def __repr__(self) -> str:
        return f"Labeller({self.point_map.name}, {len(self.attractors)} attractors, {self.max_periods} periods)"

    def __call__(self, points: Floats) -> NDArray[np.int16]:
        """Return the labels of points (n, dimension); angles need not be wrapped."""
        return self.settle(points).labels

    def settle(self, points: Floats) -> Classified:
        """Return the labels and the settling times of points (n, dimension)."""
        last = partial(settled_at_last, self.point_map, self.attractors, self.max_periods, bound=self.bound)
        return classify(self.point_map, self.catalogue, points, self.max_periods, self.rule, at_last=last)


def labeller(
    source: Basins | PointMap,
    attractors: Sequence[Attractor] = (),
    point_map: PointMap | None = None,
    max_periods: int | None = None,
    name: str = "source",
    outcome: Outcome | None = None,
) -> Labeller:
    """Return a function that labels any point as basins do.

    Parameters
    ----------
    source : Basins or PointMap
        Basins with their map and attractors, or a map.
    attractors : sequence of Attractor, optional
        Attractors of a map; not for basins.
    point_map : PointMap, optional
        Another map to use; by default the exact one behind the map of the basins.
    max_periods : int, optional
        By default that of the basins, or 2000.
    name : str, optional
        Argument that the source is, in messages.
    outcome : callable, optional
        What tells final states in the place of attractors.

    Raises
    ------
    TypeError, ValueError
        For basins without their map, a map without attractors, or attractors of another map.
    """
    if isinstance(source, Basins):
        if len(attractors):
            raise ValueError("attractors are given together with basins, which have their own: leave them out")
        attractors = source.attractors
        used = point_map or (None if source.point_map is None else source.point_map.without_table)
        if used is None:
            raise ValueError(
                f"{name}={shown(source)}: these basins have no map, as it is with basins from a file: "
                "recompute_basins(basins, system) has one, or give it by the argument point_map, if there is one"
            )
        periods = max_periods or source.settings.get("max_periods", MAX_PERIODS)
    elif isinstance(source, PointMap):
        used, periods = point_map or source, max_periods or MAX_PERIODS
    else:
        raise TypeError(f"{name}={shown(source)}: give Basins, made by find_basins, or a PointMap with its attractors")
    most = whole_number("max_periods", periods, at_least=1)
    if outcome is not None:
        if not callable(outcome):
            raise TypeError(f"outcome={shown(outcome)}: give a function of points (n, {used.dimension})")
        return Labeller(used, (), Catalogue.of((), used), most, partial(_numbers, outcome))
    check_attractors(attractors, used, "attractors")
    if not len(attractors):
        if isinstance(source, Basins):
            raise ValueError(
                f"{name}={shown(source)}: no attractor is verified, so that no state has a basin; the warning of "
                "find_basins says why and what helps, and classify_by_features and edge_orbit(outcome=) do without"
            )
        raise ValueError("attractors is empty: without an attractor there is no basin; find attractors first")
    bound = None
    if isinstance(source, Basins):
        bound = far_bound(used, InitialConditions(source.grid, source.initial_conditions).region)
    return Labeller(used, tuple(attractors), Catalogue.of(attractors, used), most, bound=bound)


def _numbers(outcome: Outcome, points: Floats) -> Ints:
    numbers = np.asarray(outcome(points))
    if numbers.shape != (len(points),) or numbers.dtype.kind not in "iu":
        raise ValueError(
            f"outcome returns {numbers.dtype} of the shape {numbers.shape} for {len(points)} points: return one whole "
            "number for each, -1 for points that are in no final state yet"
        )
    return numbers.astype(np.int64)


def own_label(basins: Basins, label: int, argument: str = "label") -> int:
    """Check the label of a basin of an attractor."""
    if isinstance(label, int | np.integer) and label <= Label.ENDED and label in basins.fractions:
        raise ValueError(
            f"{argument}={label!r}: {basins.label_name(label)!r} is an end, where no orbit stays; give the label of an "
            f"attractor, 0 to {len(basins.attractors) - 1}"
        )
    number = whole_number(argument, label) if not isinstance(label, int | np.integer) or label >= 0 else -1
    if not 0 <= number < len(basins.attractors):
        raise ValueError(
            f"{argument}={label!r}: the basins have the labels 0 to {len(basins.attractors) - 1}; "
            f"negative ones ({', '.join(f'{k} {name}' for k, name in LABEL_NAMES.items())}) are not basins"
        )
    return number


def scale_of(given: ArrayLike | None, coordinates: Sequence[Coordinate], span: Floats | None) -> Floats:
    """Return the unit of length along each coordinate: given, or the span of a window."""
    if given is None:
        if span is None:
            raise ValueError("scale is missing: without a grid, give the unit of length along each coordinate")
        return np.array(span, dtype=float)
    scale = real_array("scale", given)
    scale = np.full(len(coordinates), scale) if scale.ndim == 0 else scale
    # Lengths in these units are squared.
    if scale.shape != (len(coordinates),) or not ((scale > 1e-150) & (scale < 1e150)).all():
        raise ValueError(
            f"scale={shown(given)}: give a positive number for each of {len(coordinates)} coordinates, "
            "above 1e-150 and below 1e150"
        )
    return scale


def chosen_coordinates(argument: str, along: Sequence[int | str] | None, coordinates: Sequence[Coordinate]) -> Ints:
    """Return the numbers of coordinates, given by number or name, in ascending order; all for None."""
    if along is None:
        return np.arange(len(coordinates))
    names = [c.name for c in coordinates]
    chosen: list[int] = []
    for one in (along,) if isinstance(along, str) else listed(argument, along):
        if isinstance(one, str):
            if one not in names:
                raise ValueError(f"{argument}={one!r}: the coordinates are {names}")
            chosen.append(names.index(one))
        else:
            chosen.append(whole_number(argument, one, at_most=len(names) - 1))
    if not chosen:
        raise ValueError(f"{argument} is empty: give at least one coordinate")
    return np.unique(np.array(chosen))


def places_of(basins: Basins) -> Floats:
    """Return all initial conditions of basins, shape (n, dimension), in the order of their raveled labels."""
    if basins.grid is not None:
        return basins.grid.centres().reshape(-1, basins.grid.dimension)
    assert basins.initial_conditions is not None
    return basins.initial_conditions.reshape(-1, basins.initial_conditions.shape[-1])


def span_of(basins: Basins) -> Floats | None:
    """Return the size of the window of basins, None without a grid."""
    return None if basins.grid is None else np.array(basins.grid.upper) - np.array(basins.grid.lower)
