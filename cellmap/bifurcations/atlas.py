"""Atlas of attractors: which attractors coexist at the points of a plane of two parameters, and where that changes."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats, Ints
from .._lib.checkpoint import check_belongs, plain
from .._lib.checks import claim_memory, known_parameter, monotone_values, shown, whole_number
from .._lib.files import StoreError, as_path, opened_file, write_whole, written_whole
from .._lib.records import Keyed
from .._lib.signatures import checked
from .._lib.tiles import check_client, completed
from ..maps.coordinates import state_points, turns_of
from ..maps.fingerprint import fingerprint
from ..maps.orbit_batch import Orbits
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from .atlas_curves import borders_of, curves_at
from .atlas_families import AtlasKind, Attractors, families_of
from .atlas_neighbours import links_between, spread
from .atlas_record import AttractorAtlas, AttractorFamily
from .coexistence import AttractorSearch
from .intervals import axis_of

_ORBITS = 65536  # orbits in a tile
_PILOTS = 32  # parameter points and initial conditions of the orbits whose images tell the size of attractors
_PILOT_PERIODS = 32  # periods after which these images are taken


@checked
def attractor_atlas(
    point_map: PointMap,
    x: tuple[str, ArrayLike],
    y: tuple[str, ArrayLike],
    initial_conditions: ArrayLike,
    max_periods: int = 400,
    longest_period: int = 8,
    curves: int = 12,
    checkpoint: str | PathLike[str] | None = None,
    progress: bool = False,
    client: Any = None,
) -> AttractorAtlas:
    """Compute which attractors coexist over a plane of two parameters, with what fractions of initial conditions.

    At every point of the grid every initial condition is iterated, all in SIMD lanes.  Orbits that nearly return are
    refined by Newton's method to periodic points.  A stable orbit gets ellipsoids: the largest, up to a quarter of the
    extent of the initial conditions, on which images of 16 points (in the plane), on it and on all smaller ones down
    to 1/128 by factors of 2, are nearer to the orbit.  An orbit that enters one has converged.  This is evidence, not
    the proof that the trapping regions of :func:`find_attractors` are: compare points of interest with
    :func:`find_basins`.  What has not converged after `max_periods` is classified by the largest Lyapunov exponent of
    one orbit at the parameter point.  Where that is zero, the orbit counts as quasi-periodic if its mean square
    distances from itself up to 64 steps later are the same in the next `max_periods` and in as many after these; else
    it is undecided, as an orbit is that comes to its attractor slowly.

    Periodic attractors are looked for at the neighbouring points too, where no initial condition may have reached them.
    Attractors of neighbouring points that continue each other form families.  Where one has no continuation at the next
    point, its orbit is continued across this border, and the bifurcation found is continued through the plane, so that
    borders are known to rounding error instead of to a cell.

    Parameters
    ----------
    point_map : PointMap
        The map; for an interpolated map, its exact map is used.  A loose tolerance, such as 1e-6, saves a third of the
        time.
    x, y : tuple of str and array_like
        Name of each parameter and its values, at least 2, increasing, in its unit.
    initial_conditions : array_like, shape (k, dimension)
        Initial conditions at every parameter point.
    max_periods : int, optional
        Longest orbit.
    longest_period : int, optional
        Longest period of periodic attractors.
    curves : int, optional
        Largest number of bifurcation curves; 0 for none.
    checkpoint : path-like, optional
        Folder in which finished tiles are stored.  Repeating a call that was interrupted or killed resumes it, with the
        same result; delete the folder afterwards.
    progress : bool, optional
        Show progress on a terminal.
    client : distributed.Client, optional
        Dask cluster that works; by default the threads of this process do.

    Returns
    -------
    AttractorAtlas
        Attractors, counts of initial conditions, families and curves.

    Raises
    ------
    TypeError, ValueError
        For unknown or equal parameters, values that do not increase, and initial conditions that are not rows.
    MemoryError
        If the atlas needs more memory than is free.

    References
    ----------
    Datseris, Luiz Rossi, Wagemakers, Chaos 33 (2023) 073151 (basin fractions over parameters); Keller, in *Applications
    of Bifurcation Theory* (1977) 359 (curves).

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 0.2, "b": 0.3}, ("x", "y"))
    >>> axes = ("a", np.linspace(0.0, 0.7, 31)), ("b", np.linspace(0.1, 0.4, 16))
    >>> atlas = attractor_atlas(henon, *axes, [[0.0, 0.0], [0.3, 0.1]])
    >>> atlas.families[:2]
    (AttractorFamily(period 1, at ... parameter points), AttractorFamily(period 2, at ... parameter points))
    >>> a, b = atlas.curves[0].values.T
    >>> bool((abs(a - 0.75 * (1 - b)**2) < 1e-10).all())
    True
    """
    exact = point_map.without_table
    (first, across), (second, up) = (_axis(label, given, exact) for label, given in (("x", x), ("y", y)))
    if first == second:
        raise ValueError(f"y has the parameter {second!r} of x: give two parameters")
    states = state_points("initial_conditions", initial_conditions, exact.coordinates)
    if states.ndim != 2 or not len(states):
        raise ValueError(
            f"initial_conditions has shape {states.shape}: give rows in an array of shape (n, {exact.dimension})"
        )
    periods = whole_number("max_periods", max_periods, at_least=1)
    longest = whole_number("longest_period", longest_period, at_least=1)
    most = whole_number("curves", curves)
    check_client(client)
    shape = up.size, across.size
    claim_memory(f"an atlas of {shape[1]} x {shape[0]}", 8 * across.size * up.size * 40, "give fewer values")
    values = np.stack(np.broadcast_arrays(across, up[:, None]), axis=-1).reshape(-1, 2)
    swept = swept_map(exact, first, second)
    job = AttractorSearch(swept, states, _extent(swept, states, values), periods, longest)
    tile = max(1, _ORBITS // len(states))
    label = f"atlas of {exact.name}" if progress else None
    numbers = range(-(-len(values) // tile))

    def part(number: int) -> Floats:
        return values[number * tile : (number + 1) * tile]

    if checkpoint is None:
        parts = dict(completed(numbers, part, job, client, label))
    else:
        if client is not None:
            raise ValueError(
                "client and checkpoint are both given: tiles of a cluster are not stored; give one of them"
            )
        belongs = fingerprint(swept, np.column_stack([np.tile(states[:1], (len(values[:64]), 1)), values[:64]]))
        run = {"x": [first, *across.tolist()], "y": [second, *up.tolist()], "initial conditions": states.tolist()}
        tiles = _Tiles.of(
            as_path("checkpoint", checkpoint), belongs | run | {"max_periods": periods, "longest_period": longest}
        )
        parts = dict(completed(numbers, int, tiles.remembering(lambda number: job(part(number))), None, label))
    found = Attractors.joined(*(parts[k][0].shifted(k * tile) for k in numbers))
    escaped, undecided = (np.concatenate([parts[k][j] for k in numbers]).reshape(shape) for j in (1, 2))
    found = spread(job, values, shape, found, label)
    found = found[np.lexsort((found.point[:, 0], found.period, found.kind, found.place))]
    links = links_between(job, values, shape, found)
    family = families_of(len(found), links)
    borders = borders_of(found, links, family, shape)
    names = (first, second)
    label = "bifurcation curves" if progress else None
    lines, explained = curves_at(exact, names, (across, up), found, borders, most, label)
    return AttractorAtlas(
        system=exact.name,
        parameters=names,
        x=across,
        y=up,
        rows=found.place // across.size,
        columns=found.place % across.size,
        kind=found.kind,
        period=found.period,
        rotations=found.rotations,
        points=found.point,
        modulus=found.modulus,
        counts=found.count,
        family=family,
        families=_families(found, family),
        escaped=escaped,
        undecided=undecided,
        curves=lines,
        explained=float(np.mean(explained)) if explained.size else float("nan"),
        coordinates=exact.coordinates,
        params=Keyed({key: v for key, v in exact.params.items() if key not in names}, "params"),
        settings={"initial_conditions": len(states), "max_periods": periods, "longest_period": longest, "curves": most},
        parameter_units=exact.parameter_units,
    )


def _families(found: Attractors, family: Ints) -> tuple[AttractorFamily, ...]:
    one = np.unique(family, return_index=True)[1]
    size = np.bincount(family, minlength=len(one))
    return tuple(
        AttractorFamily(
            AtlasKind(int(found.kind[k])), int(found.period[k]), tuple(found.rotations[k].tolist()), int(size[n])
        )
        for n, k in enumerate(one)
    )


def _extent(swept: PointMap, states: Floats, values: Floats) -> Floats:
    """Return the typical size of each coordinate: the period of an angle, or the span of states and of some images."""
    d = states.shape[1]
    some, few = values[:: -(-len(values) // _PILOTS)], states[:: -(-len(states) // _PILOTS)]
    orbits = Orbits.starting(np.column_stack([np.tile(few, (len(some), 1)), np.repeat(some, len(few), axis=0)]))
    swept.advance(orbits, _PILOT_PERIODS)
    images = orbits.points[orbits.alive, :d]
    ends = np.quantile(images, (0.05, 0.95), axis=0) if len(images) else states[:2]
    span = np.ptp(np.concatenate([states, ends]), axis=0)
    size = np.where(span > 0.0, span, np.where(np.abs(states[0]) > 0.0, np.abs(states[0]), 1.0))
    turn = turns_of(swept.coordinates)[1][:d]
    return np.where(turn > 0.0, turn, size)


def _axis(label: str, given: tuple[str, ArrayLike], exact: PointMap) -> tuple[str, Floats]:
    name, values = axis_of(label, given)
    known_parameter(f"{label}[0]", name, exact.params)
    axis = monotone_values(f"{label}[1]", values)
    if axis.size < 2 or axis[0] > axis[-1]:
        raise ValueError(f"{label}[1]={shown(values)}: give at least 2 values in increasing order")
    return name, axis


_Result = tuple[Attractors, Ints, Ints]


@dataclass(frozen=True, eq=False)
class _Tiles:
    """A folder with a file for each tile that is done, and one that says to which run they belong."""

    folder: Path

    @classmethod
    def of(cls, folder: Path, belongs: Mapping[str, Any]) -> _Tiles:
        """Open or make a folder; one of another run is refused, by what differs."""
        if os.path.lexists(folder) and not folder.is_dir():
            raise NotADirectoryError(f"checkpoint={str(folder)!r} is no folder: give the name of one")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise type(error)(
                f"checkpoint={str(folder)!r}: the folder cannot be made ({error.strerror}); give another one"
            ) from None
        settings = folder / "atlas.json"
        if settings.exists():
            try:
                with opened_file(settings) as stream:
                    theirs = json.loads(stream.read())
            except (ValueError, OSError) as error:
                raise StoreError(f"checkpoint={str(folder)!r} holds a damaged atlas.json: delete the folder") from error
            check_belongs(folder, theirs, belongs)
        else:
            if any(folder.iterdir()):
                raise StoreError(f"checkpoint={str(folder)!r} is a folder with other files: give a new one")
            write_whole(settings, json.dumps(plain(belongs)).encode())
        return cls(folder)

    def remembering(self, work: Callable[[int], _Result]) -> Callable[[int], _Result]:
        """Return work on tiles that is done once: its results are kept, and read where they are there."""

        def remembered(number: int) -> _Result:
            found = self._read(number)
            if found is None:
                found = work(number)
                self._write(number, found)
            return found

        return remembered

    def _place(self, number: int) -> Path:
        return self.folder / f"tile-{number:06d}.npz"

    def _write(self, number: int, result: _Result) -> None:
        attractors, escaped, undecided = result
        columns = {f.name: getattr(attractors, f.name) for f in fields(attractors)}
        with written_whole(self._place(number)) as temporary:
            np.savez(temporary, escaped=escaped, undecided=undecided, **columns)

    def _read(self, number: int) -> _Result | None:
        """Return a tile; None where it is not there, or damaged."""
        try:
            with opened_file(self._place(number)) as stream, np.load(stream) as file:
                attractors = Attractors(*(file[f.name] for f in fields(Attractors)))
                return attractors, file["escaped"], file["undecided"]
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None
