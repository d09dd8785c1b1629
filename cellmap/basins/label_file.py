"""Labels of initial conditions in a checkpoint, which becomes a file of basins at the end."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Floats, Ints
from .._lib.checkpoint import TILE, Arrays, Checkpoint, check_belongs, damaged, made, resumed
from .._lib.checks import claim_disk, claim_memory
from .._lib.sealed import array_of, get_number, get_numbers, group_of, within
from .._lib.threads import run_over, slices
from ..attractors.kinds.examined import Examined
from ..attractors.settling.labels import LABEL_NAMES, label_type
from ..attractors.settling.settle import Settled
from ..maps.orbit_batch import Tally
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .initial_conditions import BLOCK, InitialConditions, Rows
from .label_store import LabelStore, basins_disk, basins_memory
from .record import Basins
from .store import basins_file, is_basins_file, mapped_basins, read_mapped
from .stored_attractors import read_attractors, write_attractors
from .sweeps import Progress

_COPIED = 2**18  # labels that a thread copies before it gives their pages back
_FORGET = 64  # tiles after which pages of a file need not stay in memory


class OnDisk(LabelStore):
    """Labels and settling times in a checkpoint.

    Each sweep has a file of its own, which takes the place of the one before as a whole; in it tiles are filled in.
    """

    def __init__(self, shape: tuple[int, ...], path: Path, belongs: Mapping[str, Any]) -> None:
        super().__init__(shape)
        self._path, self._belongs = path, belongs
        self._file: Checkpoint | None = None  # until a sweep has begun
        self._whole = self._found()
        if self._whole is None:
            what, remedy = (
                f"labelling {self.total:,} initial conditions",
                "take fewer initial conditions, or another disk",
            )
            claim_memory(what, basins_memory(self.total, checkpoint=True), "free some")
            claim_disk(f"checkpoint={str(path)!r}", basins_disk(self.total), path, remedy)

    @classmethod
    def of(
        cls,
        point_map: PointMap,
        places: InitialConditions,
        settings: Mapping[str, Any],
        known: Sequence[Attractor],
        path: Path,
    ) -> OnDisk:
        """Return the labels of a run, which are found again under the same arguments alone."""
        limits = {name: settings[name] for name in ("max_periods", "longest_period")}
        return cls(
            places.shape,
            path,
            {"what": "basins", **limits, "attractors": describe_attractors(known), **places.fingerprint(point_map)},
        )

    def begin(self, now: Progress) -> None:
        """Write the file of a sweep, with the labels of all other starts from the file before."""
        settled = self._settled_before(now)
        with made(
            self._path, self._belongs, self._arrays(now), lambda file: _write_progress(file, now, settled)
        ) as fresh:
            if now.rows.bits is not None:
                self._copy_to(fresh)
        self._use(fresh)

    def resume(self, examined: Examined) -> Progress | None:
        """Return the sweep that the file has come to, None where there is no file; `examined` is an empty record."""
        found = resumed(
            self._path,
            self._belongs,
            lambda read: self._arrays(read[0]),
            lambda file: _read_progress(
                group_of(file, "pass"), examined, self.total, self._belongs["max_periods"] or inf
            ),
        )
        if found is None:
            return None
        file, (now, settled) = found
        self._use(file)
        if settled != self._settled_before(now):
            raise damaged(self._path, "labels are not those that were written")
        if now.rows.bits is not None:
            for part in slices(self.total, BLOCK):
                if not self._known(self.labels[part][~now.rows.inside(part)], now):
                    raise damaged(self._path, "labels name attractors that do not exist")
                self.release()
        return now

    def finished(self) -> Basins | None:
        """Return the basins, where the file is one of finished ones."""
        return self._whole

    def _found(self) -> Basins | None:
        if not is_basins_file(self._path):
            return None
        basins, belongs = read_mapped(self._path)
        check_belongs(self._path, belongs, self._belongs)
        return basins

    def unfinished(self, now: Progress) -> list[int]:
        """Return the tiles of a sweep that are to do, those that were torn among them."""
        assert self._file is not None
        open_ = []
        for number in range(len(now.parts)):
            rows = now.rows_of(number)
            labels = self.labels[rows]
            if not self._file.is_done("tiles", number, [labels, self.times[rows]]) or not self._known(labels, now):
                open_.append(number)
            if number % _FORGET == 0:
                self.release()
        return open_

    def put(self, number: int, rows: slice | Ints, settled: Settled) -> None:
        """Write a finished tile: first its contents, then that it is done."""
        assert self._file is not None
        self.labels[rows], self.times[rows] = settled.labels, settled.times
        self._file.finish("tiles", number, settled.tally, [settled.labels, settled.times])

    def finish(self, basins: Basins, numbers: NDArray[np.int16]) -> Basins:
        """Put a file of basins in the place of the checkpoint, and return them with labels that stay in the file.

        Changes of these labels are not written, so nothing is given back any more once somebody else has them.
        """
        with basins_file(self._path, basins, self._belongs, self.shape) as (file, labels, times):
            changes = (numbers != np.arange(len(numbers)) + min(LABEL_NAMES)).any()

            def copy(part: slice) -> None:
                mine = self.labels[part]
                labels[part] = np.take(numbers, mine.astype(np.int64) - min(LABEL_NAMES)) if changes else mine
                times[part] = self.times[part]
                self.release()
                file.release()

            run_over(slices(self.total, _COPIED), copy)
        self._file = Checkpoint(self._path, "c")
        return mapped_basins(self._file, basins)

    def release(self) -> None:
        """Give pages of the file back to the system."""
        if self._file is not None:
            self._file.release()

    def _known(self, labels: NDArray[np.int16], now: Progress) -> bool:
        return within(labels, min(LABEL_NAMES), len(now.attractors) - 1)

    def _arrays(self, now: Progress) -> Arrays:
        """Arrays of the file of a sweep."""
        labels, times, tiles = (self.total,), (self.total,), (len(now.parts),)
        kind = label_type(len(now.attractors))
        return {"labels": (labels, kind), "settling_time": (times, np.int32), "tiles": (tiles, TILE)}

    def _use(self, file: Checkpoint) -> None:
        self._file = file
        self.labels, self.times, self.tallies = file["labels"], file["settling_time"], file["tiles"]["tally"]

    def _copy_to(self, fresh: Checkpoint) -> None:
        labels, times = fresh["labels"], fresh["settling_time"]
        for part in slices(self.total, BLOCK):
            labels[part], times[part] = self.labels[part], self.times[part]
            self.release()
            fresh.release()

    def _settled_before(self, now: Progress) -> list[int]:
        """Checksums of what a sweep leaves as it is, block by block."""
        if now.rows.bits is None:
            return []
        codes = []
        for part in slices(self.total, BLOCK):
            others = ~now.rows.inside(part)
            labels = self.labels[part][others].astype(label_type(len(now.attractors)))
            codes.append(zlib.crc32(self.times[part][others].tobytes(), zlib.crc32(labels.tobytes())))
            self.release()
        return codes


def _write_progress(file: h5py.File, now: Progress, settled: list[int]) -> None:
    group = file.create_group("pass")
    group.attrs.update(restart_times=np.array(now.restart_times, np.int64), time_limit=now.time_limit)
    group.attrs["repeats"] = now.repeats
    group.attrs.update(tally=np.array(now.tally, np.int64), undecided=-1 if now.undecided is None else now.undecided)
    write_attractors(group.create_group("attractors"), now.attractors)
    if now.rows.bits is not None:
        group["rows"] = now.rows.bits
        group["settled"] = np.array(settled, np.uint32)
    _write_examined(group.create_group("examined"), now.examined)


def _read_progress(group: h5py.Group, examined: Examined, total: int, limit: float) -> tuple[Progress, list[int]]:
    rows = Rows(total, array_of(group, "rows", np.uint8, (-(-total // 8),)) if "rows" in group else None)
    names = ("legs", "horizon") if "legs" in group.attrs else ("restart_times", "time_limit")  # those of 0.1
    restart_times, time_limit = get_numbers(group, names[0]), get_number(group, names[1], 1)
    if not all(0 < one < other <= limit for one, other in pairwise([*restart_times, time_limit])) or time_limit > limit:
        raise ValueError(f"its sweeps run to {time_limit} periods")
    now = Progress(
        attractors=read_attractors(group_of(group, "attractors"), examined.coordinates),
        examined=_read_examined(group_of(group, "examined"), examined),
        rows=rows,
        restart_times=tuple(restart_times),
        time_limit=time_limit,
        repeats=get_number(group, "repeats"),
        undecided=None if get_number(group, "undecided", -1) < 0 else get_number(group, "undecided"),
        tally=Tally(*get_numbers(group, "tally", len(Tally._fields))),
    )
    return now, array_of(group, "settled", np.uint32, (None,)).tolist() if "settled" in group else []


def _write_examined(group: h5py.Group, examined: Examined) -> None:
    d = examined.points.shape[1]
    nothing = np.full(d, np.nan)
    group["points"] = examined.points
    group["images"] = np.array([examined.images], float)
    group["bound"] = np.full((0, d), np.nan) if examined.bound is None else examined.bound[None]
    group["guesses"] = np.array([np.frombuffer(bits) for bits, _ in examined.ends]).reshape(-1, d)
    group["periods"] = np.array([period for _, period in examined.ends], np.int64)
    group["solved"] = np.array([end is not None for end in examined.ends.values()], bool)
    group["ends"] = np.array([nothing if end is None else end for end in examined.ends.values()]).reshape(-1, d)
    group["lines"] = np.concatenate([np.empty((0, d)), *examined.lines])
    group["points of lines"] = np.array([len(line) for line in examined.lines], np.int64)


def _read_examined(group: h5py.Group, empty: Examined) -> Examined:
    d = empty.points.shape[1]
    guesses, ends = (array_of(group, name, np.float64, (None, d)) for name in ("guesses", "ends"))
    periods, solved = array_of(group, "periods", np.int64, (None,)), array_of(group, "solved", np.bool_, (None,))
    known = {
        (guess.tobytes(), int(period)): end if success else None
        for guess, period, success, end in zip(guesses, periods, solved, ends, strict=True)
    }
    lines: list[Floats] = []
    if "lines" in group:  # files of 0.1 have none
        points, counts = (
            array_of(group, "lines", np.float64, (None, d)),
            array_of(group, "points of lines", int, (None,)),
        )
        if (counts < 1).any() or counts.sum() != len(points):
            raise ValueError(f"it has {len(points)} points of lines of {counts.tolist()}")
        lines = np.split(points, np.cumsum(counts)[:-1]) if len(counts) else []
    points = array_of(group, "points", np.float64, (None, d))
    images = float(array_of(group, "images", np.float64, (1,))[0]) if "images" in group else empty.images
    bound = empty.bound
    if "bound" in group:  # earlier files have none
        bounds = array_of(group, "bound", np.float64, (None, d))
        bound = bounds[0] if len(bounds) else None
    return replace(empty, points=points, ends=known, lines=lines, images=images, bound=bound)


def describe_attractors(attractors: Sequence[Attractor]) -> str:
    """Return plain text that identifies attractors."""
    if not attractors:
        return "none"
    return f"{len(attractors)}, {zlib.crc32(json.dumps([_described(a) for a in attractors]).encode()):08x}"


def _described(value: Any) -> Any:
    if is_dataclass(value):
        return {f.name: _described(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        return [str(value.dtype), value.shape, zlib.crc32(np.ascontiguousarray(value).tobytes())]
    return repr(value)
