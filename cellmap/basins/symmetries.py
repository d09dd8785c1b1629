"""Attractors that are images of one another under symmetries of the map, grouped."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from .._lib.arrays import Floats, Ints
from .._lib.checks import check_mapping, of_the_user, shown
from .._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Layout
from .._lib.signatures import checked
from ..attractors.matching import attractor_distance
from ..maps.coordinates import Coordinate, difference, wrap
from ..maps.point_map import PointMap
from ..maps.stroboscopic import Stroboscopic
from ..orbits.attractor import Attractor
from .initial_conditions import InitialConditions
from .record import Basins

Symmetry = Callable[[Floats], Floats]

_PROBES, _SIGNS = 8, "all signs"
_SAME_FORMULAS, _SAME_IMAGES = 1e-11, 1e-7  # relative changes of values by a symmetry that are rounding
_SAME_POINTS, _SAME_CLOUDS = 1e-5, 0.03  # distances of attractors that are one, in extents of the initial conditions


@dataclass(frozen=True, eq=False)
class SymmetricGroups(ConvertsToXarray, ConvertsToDataFrame):
    """Groups of attractors that are images of one another, the largest fraction first.

    Parameters
    ----------
    symmetries : tuple of str
        Names of the symmetries.
    groups : tuple of tuple of int
        Labels of the attractors of each group.
    names : tuple of str
        Name of the first attractor of each group.
    sizes : ndarray of int, shape (groups,)
        Number of attractors in each group.
    fractions, standard_errors : ndarray, shape (groups,)
        Fraction of the initial conditions that converge to one of the group, and its standard error.
    missing : tuple of tuple of int and str
        Labels of attractors, with a symmetry, whose image is none of the attractors: it was not found, because few
        initial conditions converge to it, or was not distinguished.
    n_initial_conditions : int
        Number of initial conditions.
    """

    _layout: ClassVar = Layout(
        "Groups of symmetric attractors",
        {"names": Array("group", "first attractor of the group")},
        {name: Array("group") for name in ("sizes", "fractions", "standard_errors")},
        {"symmetries": "", "groups": "", "missing": ""},
    )

    symmetries: tuple[str, ...]
    groups: tuple[tuple[int, ...], ...]
    names: tuple[str, ...]
    sizes: Ints
    fractions: Floats
    standard_errors: Floats
    missing: tuple[tuple[int, str], ...]
    n_initial_conditions: int

    def __repr__(self) -> str:
        count = sum(map(len, self.groups))
        by = ", ".join(self.symmetries) or "no symmetry"
        return f"SymmetricGroups({count} attractors in {len(self.groups)} groups, by {by}; {len(self.missing)} missing)"

    @checked
    def group_of(self, label: int) -> int:
        """Return the number of the group of an attractor.

        Parameters
        ----------
        label : int
            Label of the attractor.

        Returns
        -------
        int
            Place in `groups`.

        Raises
        ------
        ValueError
            For a label that no attractor has.
        """
        for number, labels in enumerate(self.groups):
            if label in labels:
                return number
        raise ValueError(f"label={shown(label)}: give the label of an attractor")


@checked
def symmetric_groups(basins: Basins, symmetries: Mapping[str, Symmetry] | None = None) -> SymmetricGroups:
    """Group attractors that are images of one another under symmetries of the map.

    Symmetries are given, or are found among these: a change of all signs; for coordinates in blocks of equal length,
    such as all positions and then all velocities, a cyclic shift within the blocks, their reversal, and an exchange of
    the first two of each; and these with a change of all signs.  A symmetry holds if it changes neither the formulas of
    a forced system nor the images of a map at random states.

    Parameters
    ----------
    basins : Basins
        Basins with their map.
    symmetries : mapping of str to callable, optional
        Functions of states (n, dimension) that return states (n, dimension), by names; those that generate a group are
        enough.  A symmetry that takes half a period, x(t) to -x(t + T/2), is one of the map too, as a function that
        integrates over half a period and changes the signs.  By default symmetries are searched for.

    Returns
    -------
    SymmetricGroups
        Groups with their fractions.

    Raises
    ------
    TypeError, ValueError
        For basins without their map, and functions that are no symmetries of it.

    References
    ----------
    Golubitsky, Stewart, *The Symmetry Perspective* (2002), chapter 1.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> def two_wells(x, p):
    ...     pull = 0.05 * (x[1] - x[0])
    ...     return 1.5 * x[0] - 0.5 * x[0] ** 3 + pull, 1.5 * x[1] - 0.5 * x[1] ** 3 - pull
    >>> basins = find_basins(discrete_map(two_wells, {}, ("x", "y")), CellGrid((-1, -1), (1, 1), (20, 20)))
    >>> found = symmetric_groups(basins)
    >>> found
    SymmetricGroups(4 attractors in 2 groups, by all signs, shift of 2; 0 missing)
    >>> found.fractions.round(2)
    array([0.58, 0.42])
    """
    if basins.point_map is None:
        raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
    exact = basins.point_map.without_table
    places = InitialConditions(basins.grid, basins.initial_conditions)
    some = places.points(np.linspace(0, len(places) - 1, min(len(places), 4096)).astype(np.int64))
    points = np.concatenate([some, *(a.points for a in basins.attractors)])
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.where(high > low, high - low, 1.0)
    probes = np.random.default_rng(0).uniform(low, low + extent, (_PROBES, exact.dimension))
    if symmetries is not None:
        check_mapping("symmetries", symmetries, "of names to functions, or None for the usual ones")
    chosen = dict(_candidates(exact.coordinates)) if symmetries is None else dict(symmetries)
    holding: dict[str, Symmetry] = {}
    for name, symmetry in chosen.items():
        if symmetries is None and name.endswith(f" and {_SIGNS}") and _SIGNS in holding:
            continue  # a product of two that are tried by themselves
        defect = _defect(exact, symmetry, probes, extent, name, formulas=symmetries is None)
        if defect <= 1.0:
            holding[name] = symmetry
        elif symmetries is not None:
            raise ValueError(f"symmetries[{name!r}]: images of the map change with it; give a symmetry of the map")
    return _grouped(basins, holding, extent)


def _candidates(coordinates: tuple[Coordinate, ...]) -> Iterator[tuple[str, Symmetry]]:
    """Yield names and signed permutations, each permutation once."""
    d, known = len(coordinates), set()
    kinds = [(c.period, c.unit) for c in coordinates]
    permutations: list[tuple[str, Ints]] = [("", np.arange(d))]
    for length in range(2, d + 1):
        if d % length == 0:
            index = np.arange(length)
            swap = np.concatenate([[1, 0], index[2:]])
            named = ("shift", np.roll(index, 1)), ("reversal", index[::-1]), ("exchange", swap)
            for what, order in named:
                blocks = np.arange(0, d, length)
                permutations.append((f"{what} of {length}", (blocks[:, None] + order).ravel()))
                permutations.append(
                    (
                        f"{what} of {length}, interleaved",
                        (order[:, None] * (d // length) + np.arange(d // length)).ravel(),
                    )
                )
    for what, order in permutations:
        if tuple(order) in known or [kinds[j] for j in order] != kinds:
            continue
        known.add(tuple(order))
        for sign in (1.0, -1.0):
            name = what if sign > 0.0 else f"{what} and {_SIGNS}" if what else _SIGNS
            if name:
                yield name, partial(_permuted, order=order, sign=sign)


def _permuted(states: Floats, order: Ints, sign: float) -> Floats:
    return np.asarray(sign * states[:, order])


def _defect(exact: PointMap, symmetry: Symmetry, x: Floats, extent: Floats, name: str, formulas: bool) -> float:
    """Return the largest change of images under a symmetry, in units of the error allowed."""
    argument = f"symmetries[{name!r}]"

    def image(states: Floats) -> Floats:
        found = np.asarray(of_the_user(argument, symmetry, states), float)
        if found.shape != states.shape:
            raise ValueError(f"{argument} returns the shape {found.shape}: return states, shape {states.shape}")
        return found

    spec = exact.spec
    if formulas and isinstance(spec, Stroboscopic) and spec.system.switches is None and not spec.system.impacts:
        system, times = spec.system, np.linspace(0.0, 0.9, len(x)) * spec.system.length
        before, after = (
            np.array([system.fun(t, state) for t, state in zip(times, states, strict=True)]) for states in (x, image(x))
        )
        size = np.abs(before).max(axis=0) + np.abs(image(before)).max(axis=0) + 1.0
        return float((np.abs(after - image(before)) / size).max() / _SAME_FORMULAS)
    begin = wrap(x, exact.coordinates)
    before, after = exact(begin), exact(wrap(image(begin), exact.coordinates))
    alive = np.isfinite(before).all(axis=-1) & np.isfinite(after).all(axis=-1)
    if not alive.any():
        return np.inf
    apart = difference(after[alive], wrap(image(before[alive]), exact.coordinates), exact.coordinates)
    return float((np.abs(apart) / np.maximum(extent, np.abs(after[alive]))).max() / _SAME_IMAGES)


def _grouped(basins: Basins, symmetries: Mapping[str, Symmetry], extent: Floats) -> SymmetricGroups:
    attractors, missing = basins.attractors, []
    group = np.arange(len(attractors))
    for name, symmetry in symmetries.items():
        for k, attractor in enumerate(attractors):
            moved = replace(attractor, points=wrap(np.asarray(symmetry(attractor.points)), basins.coordinates))
            other = _owner(moved, attractors, extent)
            if other is None:
                missing.append((k, name))
            else:
                group[group == group[other]] = group[k]
    counts = {k: f.count for k, f in basins.fractions.items()}
    members = [tuple(np.flatnonzero(group == g).tolist()) for g in np.unique(group)]
    members.sort(key=lambda labels: (-sum(counts[k] for k in labels), labels))
    total, names = basins.labels.size, [basins.label_name(k) for k in range(len(attractors))]
    mean = np.array([sum(counts[k] for k in labels) for labels in members], float) / total
    return SymmetricGroups(
        tuple(symmetries),
        tuple(members),
        tuple(names[labels[0]] for labels in members),
        np.array([len(labels) for labels in members], np.int64),
        mean,
        np.sqrt(mean * (1.0 - mean) / total),
        tuple(missing),
        total,
    )


def _owner(moved: Attractor, attractors: tuple[Attractor, ...], extent: Floats) -> int | None:
    """Return the attractor that the image of one is, by a point of a cycle or by the distance of clouds."""
    alike = [k for k, a in enumerate(attractors) if a.kind is moved.kind and a.period == moved.period]
    if moved.period and alike:
        points = np.concatenate([attractors[k].points for k in alike])
        owners = np.repeat(alike, [len(attractors[k].points) for k in alike])
        apart = (np.abs(difference(points, moved.points[0], moved.coordinates)) / extent).max(axis=1)
        nearest = int(np.argmin(apart))
        return int(owners[nearest]) if apart[nearest] <= _SAME_POINTS else None
    apart_of = {k: attractor_distance(moved, attractors[k], extent) for k in alike}
    best = min(apart_of, key=lambda k: apart_of[k], default=None)
    return best if best is not None and apart_of[best] <= _SAME_CLOUDS else None
