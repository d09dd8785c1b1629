"""Proofs of basins: what is proved of a window, and where."""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..._lib.midpoint_radius import ROUNDING
from ..._lib.randomness import Rng
from ..._lib.records import Array, ConvertsToXarray, Keyed, Layout, ShownAsHtml
from ..._lib.sealed import array_of, get_mapping, get_number, get_numbers, group_of, put_text
from ..._lib.signatures import checked
from ...attractors.settling.labels import Label
from ...maps.coordinates import Coordinate
from ...maps.grid import CellGrid
from ...maps.orbit_batch import Cost
from ...orbits.contraction import ContractionBalls
from ..record import Basins
from ..store import add_array, load_with, save_with
from .regions import ProvedCells, Region, in_figures


@dataclass(frozen=True, eq=False)
class Proof(ShownAsHtml, ConvertsToXarray):
    """Proof of basins: every point of a proved cell converges to the attractor of its label.

    The statement is about the map whose formulas and parameters are the double-precision numbers given, or all numbers
    of the intervals in `parameters`.  It rests on IEEE arithmetic, the compiler and this library, not on a tolerance.

    Parameters
    ----------
    basins : Basins
        The basins whose labels were to be proved.
    attractors : mapping of int to ContractionBalls
        Labels of the attractors that are proved to exist, and balls in which every orbit converges to them.
    cells : ProvedCells
        Cells of the window and around it, as finely as they were divided.
    parameters : mapping of str to tuple of float
        Intervals of parameters for which all of it holds.
    splits, max_periods : int
        How often cells were halved, and for how many periods their images were followed.
    cost : Cost
        Wall time, and boxes whose image was enclosed, under ``evaluations``.
    """

    _layout: ClassVar = Layout(
        "Proved labels of {0.name}",
        {},
        {"labels": Array("{cells}", "label that is proved for the whole cell", flags="_meanings")},
        {"basins": "", "attractors": "", "cells": ""},
    )

    basins: Basins
    attractors: Mapping[int, ContractionBalls]
    cells: ProvedCells = field(repr=False)
    parameters: Mapping[str, tuple[float, float]]
    splits: int
    max_periods: int
    cost: Cost = Cost()

    def __repr__(self) -> str:
        parts = "; ".join(
            f"{self.basins.label_name(k)} at least {in_figures(area)}" for k, area in self.areas.items() if area > 0.0
        )
        known, sought = len(self.attractors), len(self.basins.attractors)
        nothing = f"no label is proved, though {known} of {sought} attractors are: take smaller cells"
        if not known:
            none = not any(a.period for a in self.basins.attractors)
            nothing = f"no label and no attractor is proved{': none that is periodic was found' if none else ''}"
        parts = parts or nothing
        return f"Proof({self.name}: {in_figures(100 * self.share)} % of the window; {parts})"

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.basins.name

    @property
    def grid(self) -> CellGrid:
        """Cells of the basins."""
        return self.cells.region.grid

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """State variables."""
        return self.basins.coordinates

    @property
    def _meanings(self) -> dict[int, str]:
        return self.basins._meanings

    @property
    def labels(self) -> NDArray[np.int16]:
        """Label of each cell of the grid that is proved as a whole, UNLABELLED for others; shape of the grid."""
        whole = self.cells.whole()
        return np.where(whole > 0, whole - 1, Label.UNLABELLED).astype(np.int16)

    @property
    def share(self) -> float:
        """Fraction of the window's area that is proved, parts of cells included."""
        return float(np.count_nonzero(self.cells.in_window > 0) / self.cells.in_window.size)

    @property
    def areas(self) -> dict[int, float]:
        """Lower bounds of the area of each attractor's basin within the window, in units of the coordinates.

        They are lengths, areas or volumes, by the number of coordinates that are not held by a slice.
        """
        volume = self.cells.region.least_volume()
        counts = np.bincount(np.maximum(self.cells.in_window, 0).ravel(), minlength=len(self.basins.attractors) + 1)
        found = {k: float(counts[k + 1]) * volume / ROUNDING.wider for k in range(len(self.basins.attractors))}
        return Keyed(found, "areas", lambda: self._meanings)

    @checked
    def check(self, n_samples: int = 10, *, rng: Rng = 0) -> Any:
        """Prove random cells again with another program: interval arithmetic of forty digits by mpmath.

        Parameters
        ----------
        n_samples : int, optional
            Number of proved cells, and of small boxes in the balls around attractors, drawn with replacement.
        rng : int, numpy.random.Generator or None, optional
            Seed or generator of the random draw.

        Returns
        -------
        ProofCheck
            How many were confirmed.

        Raises
        ------
        ModuleNotFoundError
            Without mpmath: ``pip install 'cellmap-dynamics[proofs]'``.
        ValueError
            For a proof without its map, such as one loaded from a file.
        """
        return importlib.import_module(f"{__package__}.checking").check(self, n_samples, rng)

    @checked
    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the proof with its basins to an HDF5 file; :func:`load_basins` reads the basins alone.

        Parameters
        ----------
        path : path-like
            Name of the file; an older file of that name is replaced.

        Returns
        -------
        Path
            The file.
        """

        def write(group: Any) -> None:
            own = group.create_group("proof")
            put_text(own, "parameters", json.dumps(dict(self.parameters)))
            put_text(own, "cost", json.dumps(vars(self.cost)))
            region = self.cells.region
            own.attrs.update(splits=self.splits, max_periods=self.max_periods, level=region.level)
            own.attrs.update(before=region.before, after=region.after)
            add_array(own, "labels", self.cells.labels)
            add_array(own, "ranks", self.cells.ranks)
            for k, balls in self.attractors.items():
                at = own.create_group(f"balls/{k}")
                at["centres"], at["frames"] = balls.centres, balls.frames
                at["radius"], at["rate"], at["reach"] = balls.radius, balls.rate, balls.reach

        return save_with(self.basins, path, write)

    @staticmethod
    @checked
    def load(path: str | os.PathLike[str]) -> Proof:
        """Read a proof from a file that :meth:`save` wrote.

        Parameters
        ----------
        path : path-like
            The file.

        Returns
        -------
        Proof
            The proof, with basins that have no map.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        StoreError
            For a file that is damaged, or holds no proof.
        """
        return load_with(path, _read)


def _read(group: Any, basins: Basins) -> Proof:
    if "proof" not in group or basins.grid is None:
        raise ValueError("it holds basins without a proof: load_basins reads them")
    own, d = group_of(group, "proof"), basins.grid.dimension
    before, after = (tuple(get_numbers(own, name, d)) for name in ("before", "after"))
    region = Region(basins.grid, basins.coordinates, before, after, get_number(own, "level"))
    labels = array_of(own, "labels", np.int16, region.shape)
    ranks = array_of(own, "ranks", np.int32, region.shape)
    attractors = {}
    for k in range(len(basins.attractors)):
        if f"balls/{k}" in own:
            at = group_of(own, f"balls/{k}")
            centres = array_of(at, "centres", np.float64, (None, d))
            frames = array_of(at, "frames", np.float64, (len(centres), d, d))
            numbers = (float(array_of(at, name, np.float64, ())) for name in ("radius", "rate", "reach"))
            attractors[k] = ContractionBalls(centres, frames, *numbers)
    parameters = {name: (float(a), float(b)) for name, (a, b) in get_mapping(own, "parameters").items()}
    return Proof(
        basins,
        Keyed(attractors, "attractors"),
        ProvedCells(region, labels, ranks),
        parameters,
        get_number(own, "splits"),
        get_number(own, "max_periods"),
        Cost(**get_mapping(own, "cost")),
    )
