"""Proofs of basins: labels that hold for whole cells, by interval arithmetic."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..._compiled.kernels.cell_covers import HOPELESS, Place
from ..._lib.arrays import Bools, Floats
from ..._lib.checks import claim_memory, parameter_intervals, whole_number
from ..._lib.records import Keyed
from ..._lib.signatures import checked
from ...attractors.settling.labels import Label
from ...attractors.settling.settle import Catalogue, classify
from ...maps.coordinates import turns_of
from ...maps.enclosures import enclosed_images
from ...maps.orbit_batch import Cost
from ...orbits.attractor import Kind
from ...orbits.contraction import check_periods, contraction_balls, point_width
from ..record import Basins
from .growing import grown
from .level_file import levels_kept
from .passes import Machine
from .proof import Proof
from .regions import ProvedCells, alike, centres_of, extremes, region_of

_PLACES = 16  # places where the periods of angles are checked
_APART, _AT_LAST = 4, 12  # steps between settling times of neighbours, beyond which a proof is not tried
_PROVABLE = (Kind.FIXED_POINT, Kind.PERIODIC, Kind.ROTATING)
_BYTES = 60  # bytes for a cell: its label and rank, those of the level before, and the cells that its image meets


@checked
def prove(
    basins: Basins,
    splits: int = 1,
    max_periods: int = 40,
    progress: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Proof:
    """Prove labels of whole cells by interval arithmetic.

    First, attractors: around each periodic one the largest balls are sought that the map is proved to contract into one
    another, so that there is one periodic orbit in them to which all points converge; and larger ones, whose points are
    proved to come to these by following boxes that cover them.  Then cells: one is proved if
    all cells that its enclosed image meets are proved with the same label, beginning with those that lie in a ball.
    Other cells are followed as parallelepipeds until they lie in proved cells or in a ball.  What remains is halved
    along each axis, and tried again.  Cells one of whose neighbours has another label or a quite different settling
    time, by the map that the basins were found with, are not tried before they are halved: this saves time, and no
    proof rests on it.

    Chaotic and quasi-periodic attractors are not proved, nor what converges to them.

    Parameters
    ----------
    basins : Basins
        Found by :func:`find_basins` on a grid, for a discrete map or a smooth flow whose function can be traced.  On a
        slice, with coordinates of one value, cells are proved by their orbits alone.
    splits : int, optional
        How often cells that are not proved are halved along each axis.
    max_periods : int, optional
        Periods for which images of cells are followed; 0 for none.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.
    checkpoint : path-like, optional
        File that keeps each level of cells when it is done; the same call goes on from there.
    parameters : mapping of str to tuple of float, optional
        Intervals (lowest, highest) of some parameters, for all of whose values the labels are to be proved; other
        parameters have the exact values of the map.

    Returns
    -------
    Proof
        The fraction of the window that is proved, lower bounds of the basins' areas, attractors, and labels.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, basins without their map or on no grid, a map whose formulas are not known, or a
        checkpoint of another run.
    MemoryError
        If labels of all cells do not fit.
    StoreError
        For a checkpoint that is damaged or of another kind.

    References
    ----------
    Moore, Kearfott, Cloud, *Introduction to Interval Analysis* (2009); Lohner, in *Computer Arithmetic* (1987) 255;
    Kapela, Mrozek, Wilczak, Zgliczynski, Communications in Nonlinear Science and Numerical Simulation 101 (2021)
    105578.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> def henon(x, p):
    ...     return 1 - p.a * x[0] ** 2 + x[1], p.b * x[0]
    >>> sink = discrete_map(henon, {"a": 0.2, "b": 0.3}, ("x", "y"))
    >>> proof = prove(find_basins(sink, CellGrid((-2, -2), (2, 2), (40, 40))), splits=0)
    >>> proof.share, proof.attractors[0].rate < 1.0
    (1.0, True)
    """
    began = time.perf_counter()
    splits = whole_number("splits", splits, at_most=12)
    max_periods = whole_number("max_periods", max_periods)
    point_map, grid = basins.point_map, basins.grid
    if point_map is None:
        raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
    if grid is None:
        raise ValueError("basins are of a list of initial conditions: find them on a CellGrid, whose cells are proved")
    if grid.dimension > 3 and not any(a == b for a, b in zip(grid.lower, grid.upper, strict=True)):
        raise ValueError(f"basins have {grid.dimension} axes: cells are proved in up to three, others on a slice")
    intervals = parameter_intervals(parameters, point_map.params)
    exact, extent = point_map.without_table, _extent(basins)
    region = region_of(grid, point_map, np.isin(basins.labels, _provable(basins)))
    cells = math.prod(region.shape) * 2 ** (splits * (grid.dimension - sum(region.fixed)))
    if max(cells, len(basins.attractors) << 16) >= 2**31:
        raise ValueError(
            f"{cells:,} cells, {len(basins.attractors):,} attractors: proofs are of fewer than 2,147,483,648 cells and "
            "32,768 attractors; take fewer splits, or a smaller window"
        )
    claim_memory(f"proofs of {cells:,} cells", _BYTES * cells, "take fewer splits, or a grid of fewer cells")
    places = _some_places(basins, point_width(intervals) * extent)
    try:
        enclosed_images(exact, *places, parameters=intervals)
    except (TypeError, ValueError) as error:  # that says why maps without enclosures have none
        raise type(error)(f"basins.{error}") from error
    check_periods(exact, *places, intervals)
    attractors, boxes = {}, 0
    for k in _provable(basins):
        a = basins.attractors[k]
        balls = contraction_balls(exact, a.points[: a.period], extent, intervals)
        if balls is not None:
            attractors[k], more = grown(exact, balls, extent, max_periods, intervals)
            boxes += more
    machine = Machine.of(exact, intervals, attractors, extent, progress)
    proved = ProvedCells.none(region)
    with levels_kept(checkpoint, basins, region, splits, max_periods, intervals) as kept:
        for level in range(splits + 1):
            proved = proved.refined() if level else proved
            done = kept.found(level, proved)
            if done is None:
                done = _prove_level(machine, proved, basins, max_periods, _APART if level < splits else _AT_LAST)
                kept.finish(level, proved, done)
            boxes += done
    cost = Cost(seconds=time.perf_counter() - began, evaluations=boxes)
    return Proof(basins, Keyed(attractors, "attractors"), proved, intervals, splits, max_periods, cost)


def _some_places(basins: Basins, half: Floats) -> tuple[Floats, Floats]:
    """Return some centres of cells, and half-widths for each."""
    grid = basins.grid
    assert grid is not None
    index = np.unravel_index(np.unique(np.linspace(0, grid.size - 1, _PLACES).astype(np.int64)), grid.shape)
    points = np.stack([grid.along(j, i + 0.5) for j, i in enumerate(index)], axis=-1)
    return points, np.broadcast_to(half, points.shape)


def _provable(basins: Basins) -> list[int]:
    """Return the labels of attractors that may be proved."""
    return [k for k, a in enumerate(basins.attractors) if a.kind in _PROVABLE]


def _extent(basins: Basins) -> Floats:
    """Return the size of the region that matters along each coordinate, on a slice that of the attractors."""
    turn, grid = turns_of(basins.coordinates)[1], basins.grid
    assert grid is not None
    points = [a.points for a in basins.attractors]
    spread = np.ptp(np.concatenate([np.zeros((1, len(turn))), *points]), axis=0)
    widths = np.array(grid.upper) - np.array(grid.lower)
    return np.asarray(np.where(turn > 0.0, turn, np.where(widths > 0.0, widths, np.maximum(spread, 1.0))))


def _prove_level(machine: Machine, proved: ProvedCells, basins: Basins, most: int, apart: int) -> int:
    """Prove cells of one size; return how many boxes were enclosed."""
    place = proved.region.place()
    machine.claim_balls(proved, place)
    if proved.region.is_slice:
        return machine.claim_orbits(proved, place, np.flatnonzero(proved.labels == 0), most)
    proved.labels[(proved.labels == 0) & ~_promising(proved, place, basins, apart)] = HOPELESS
    met, boxes = machine.claim_images(proved, place)
    if most:
        within = np.zeros(proved.labels.shape, bool)
        within[proved.region.window] = True
        boxes += machine.claim_orbits(proved, place, np.flatnonzero((proved.labels == 0) & within), most)
        met.prove(proved)
    proved.labels[proved.labels == HOPELESS] = 0
    return boxes


def _promising(proved: ProvedCells, place: Place, basins: Basins, apart: int) -> Bools:
    """Return the cells that have the label of all their neighbours, and nearly their settling time.

    Both are those of the map that the basins were found with.  Times that differ much tell of cells that are stretched
    far before they come to their attractor; where a chaotic saddle is near, all are.
    """
    region, labels, point_map = proved.region, proved.labels, basins.point_map
    assert point_map is not None
    around, within = np.zeros(labels.shape, bool), region.window
    known = labels[within]
    if region.level == 0:
        found, times = basins.labels, basins.settling_time
        around = labels == 0  # nothing is known of cells outside of the window, which are few and tried once
    else:
        found = np.where(known > 0, known - 1, Label.UNLABELLED).astype(np.int16)
        times = np.zeros(known.shape, np.int32)
        outside = np.ones(labels.shape, bool)
        outside[within] = known > 0
        rows = np.flatnonzero(~outside)
        catalogue, periods = Catalogue.of(basins.attractors, point_map), int(basins.settings["max_periods"])
        classified = classify(point_map, catalogue, centres_of(place, rows), periods)
        found[known == 0], times[known == 0] = classified.labels, classified.times
    most = np.iinfo(np.int32).max // 2
    soonest, latest = (np.where(known > 0, limit, times) for limit in (most, -most))
    soonest, latest = extremes(soonest, latest, region.grid.wraps)
    even = latest - soonest <= apart
    around[within] = even & alike(found, region.grid.wraps) & np.isin(found, _provable(basins))
    return around
