"""What a call returns, or a figure shows, in words and numbers that other machines and versions find as well.

As a program it writes what the good calls return where numbers of their arguments differ by some 1e-12, with one thread
and the loops of another processor: what does not agree with that says nothing, and is not compared.
"""

import contextlib
import functools
import inspect
import json
import os
import re
import subprocess
import sys
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isclose
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import public_calls
import small_systems
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba_array
from matplotlib.lines import Line2D
from matplotlib.text import Text

from cellmap import ForcedSystem, PointMap, set_threads

Described = dict[str, list[Any] | None]

LOOKS = "linewidth linestyle marker markersize alpha zorder hatch array clim extent".split()
COLOURS = "color facecolor edgecolor markerfacecolor".split()
ELSEWHERE = {"Prescott": 1.0 + 1e-12, "Zen": 1.0 - 3e-12, "Haswell": 1.0 + 1e-11}
"""Processors whose loops of BLAS are used, the first one also for NumPy, and factors of the arguments."""

CONVERT = ("scipy", "pandas", "xarray")
OPEN = (Mapping, tuple, list, set, frozenset, np.ndarray, Iterator)
MORE = "and others"
"""A word where a second run has found other words."""


def described(result: Any) -> Described:
    """Describe a result, or all figures where there are some: how often each word stands, and a few numbers."""
    found: Described = {}
    for number in plt.get_fignums():
        figure = plt.figure(number)
        found[f"{number} inches"] = figure.get_size_inches().tolist()
        for place, ax in enumerate(figure.axes):
            found |= {f"{number}.{place} {key}": values for key, values in _of_axes(ax).items()}
    if found:
        found |= _summary(
            "returns", [type(panel).__name__ for panel in (result if isinstance(result, tuple) else [result])]
        )
    leaves: dict[str, list[Any]] = defaultdict(list)
    for path, leaf in () if found else _leaves(result, "", {}):
        leaves[path].append(leaf)
    for path, values in leaves.items():
        found |= _summary(path, values)
    return found


def _leaves(thing: Any, path: str, seen: dict[int, Any]) -> Iterator[tuple[str, Any]]:
    """Yield words and arrays under the names of fields and properties; all entries of a sequence have the same."""
    if thing is None or isinstance(thing, Enum | str | bytes | os.PathLike) or inspect.isclass(thing):
        yield path, str(getattr(thing, "name", thing))
        if isinstance(thing, Path) and thing.suffix == ".branch":
            yield path, thing.read_text()
    elif (
        isinstance(thing, bool | int | float | complex | np.generic | np.ndarray) and np.asarray(thing).dtype != object
    ):
        array = np.asarray(thing)
        if array.dtype.names:
            yield from _leaves({name: array[name] for name in array.dtype.names}, path, seen)
        elif array.dtype.kind in "USMm":
            yield from ((path, str(entry)) for entry in array.ravel())
        else:
            where = f"{path} {array.shape}" if array.shape else path
            yield from ((where, part) for part in ((array.real, array.imag) if array.dtype.kind == "c" else (array,)))
    elif not isinstance(thing, OPEN) and not _described_too(type(thing)):
        yield path, getattr(thing, "__qualname__", type(thing).__name__)
    elif id(thing) not in seen:
        seen[id(thing)] = thing
        for name, part in _parts(thing, path):
            yield from _leaves(part, f"{path}.{name}", seen)


def _described_too(kind: type) -> bool:
    """Whether parts of a thing of another kind than sequences matter: records do, compiled code does not."""
    room, _, rest = kind.__module__.partition(".")
    return room in ("systems", *CONVERT) or (room == "cellmap" and not rest.startswith("_compiled"))


def _parts(thing: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Yield what a thing consists of: entries, or fields and properties; of a map the images of some points."""
    if type(thing).__module__.split(".")[0] in CONVERT:
        yield "", thing.toarray() if hasattr(thing, "toarray") else thing.to_dict()
    elif isinstance(thing, Mapping):
        yield from ((str(getattr(key, "name", key)), value) for key, value in thing.items())
    elif isinstance(thing, Iterator):  # whose entries come as time allows
        yield "", list(thing)[-1]
    elif isinstance(thing, Iterable) and not is_dataclass(thing) and not hasattr(thing, "_fields"):
        yield from (("", entry) for entry in thing)
    else:
        yield "", str(thing)
        if not path and hasattr(thing, "_repr_html_"):
            yield "html", re.sub('src="[^"]*"', "", thing._repr_html_())
        if isinstance(thing, PointMap | ForcedSystem):
            if path:
                return
            points = np.linspace(0.1, 0.5, 3 * thing.dimension).reshape(3, -1)
            yield "()", thing(points) if isinstance(thing, PointMap) else [thing.fun(0.3, point) for point in points]
        own = [field.name for field in fields(thing)] if is_dataclass(thing) else getattr(thing, "_fields", ())
        found = inspect.getmembers(type(thing), lambda m: isinstance(m, property | functools.cached_property))
        for name in (*own, *(name for name, _ in found)):
            if not name.startswith("_") and name != "advance":
                try:
                    value = getattr(thing, name)
                    yield name, str(value) if type(value) is type(thing) else value
                except (ValueError, TypeError, AttributeError, KeyError) as error:
                    yield name, str(error)


def _of_axes(ax: Axes) -> dict[str, list[float]]:
    legend = ax.get_legend()
    texts = [
        ax.get_title(),
        ax.get_xlabel(),
        ax.get_ylabel(),
        ax.get_xscale(),
        ax.get_yscale(),
        f"{ax.patch.get_hatch()}",
    ]
    texts += [text.get_text() for text in (*ax.texts, *(legend.get_texts() if legend else ()))]
    found = {f"says {text}": [1.0] for text in texts}
    found["limits"] = [*map(float, (*ax.get_xlim(), *ax.get_ylim(), bool(legend and legend.get_frame_on())))]
    handles = legend.legend_handles if legend else ()
    for kind, artists in (
        *(("line", ax.lines), ("collection", ax.collections), ("image", ax.images), ("patch", ax.patches)),
        ("text", ax.texts), ("key", handles),
    ):  # fmt: skip
        found |= _summary(f"{kind} place", map(_place, artists))
        for name in LOOKS:
            found |= _summary(f"{kind} {name}", (getattr(a, f"get_{name}", str)() for a in artists))
        for name in COLOURS:
            found |= _summary(f"{kind} {name}", (to_rgba_array(getattr(a, f"get_{name}", tuple)()) for a in artists))
    return found


def _place(artist: Artist) -> Any:
    if isinstance(artist, Line2D):
        return artist.get_xydata()
    if isinstance(artist, Text):
        return artist.get_position()
    if isinstance(artist, Collection):
        return np.concatenate([artist.get_offsets(), *(path.vertices for path in artist.get_paths())])
    return artist.get_path().vertices if hasattr(artist, "get_path") else ()


def _summary(name: str, values: Iterable[Any]) -> Described:
    """Return of each word how often it stands, and of numbers a few themselves, of many means that know their order."""
    found: Described = {}
    numbers = []
    for value in values:
        if isinstance(value, str) or value is None:
            if value:
                found[f"{name} {value}"] = [found.get(f"{name} {value}", [0])[0] + 1]
        else:
            array = np.ma.filled(np.ma.asarray(value), -1).ravel()
            numbers.append(array.astype(float) if array.dtype == object else array)
    every = np.concatenate(numbers) if numbers else np.zeros(0)
    if every.dtype.kind in "biu":
        every = every.astype(np.int64)
        long = (
            [every.size, *(int(v) for v in (every.min(), every.max(), every.sum(), every @ np.arange(every.size)))]
            if every.size > 6
            else every.tolist()
        )
        return found | ({name: long} if every.size else {})
    finite = np.nan_to_num(every, nan=-1.0, posinf=1e9, neginf=-1e9)
    if every.size > 6:
        weights = np.linspace(0.0, 1.0, every.size), np.cos(np.arange(every.size) ** 2)
        means = [float(v) for v in (finite.min(), finite.max(), finite.mean(), *((finite * w).mean() for w in weights))]
        return found | {name: [every.size, int(np.isfinite(every).sum()), *(float(f"{v:.7g}") for v in means)]}
    return found | ({name: [float(f"{v:.7g}") for v in finite.tolist()]} if every.size else {})


def differences(found: Described, kept: Described) -> Described:
    """Return what is not as it was kept: words, whole numbers, and other numbers by 1e-5 of them."""
    keys = kept.keys() if MORE in kept else kept.keys() | found.keys()
    return {
        key: [found.get(key), kept.get(key)] for key in sorted(keys) if not _agree(found.get(key), kept.get(key, []))
    }


def _agree(found: list[Any] | None, kept: list[Any] | None, rel: float = 1e-5) -> bool:
    if found is None or kept is None or len(found) != len(kept):
        return kept is None
    pairs = zip(found, kept, strict=True)
    return all(
        v is None or (u == v if isinstance(v, int) else isclose(u, v, rel_tol=rel, abs_tol=1e-3 * rel))
        for u, v in pairs
    )


def worth_keeping(found: Described, again: Described) -> Described:
    """Return a description without the words and numbers of which another one tells others."""
    kept: Described = {} if found.keys() == again.keys() else {MORE: None}
    for key in found.keys() & again.keys():
        one, other = found[key] or [], again[key] or []
        same = [v if _agree([u], [v], 1e-6) else None for u, v in zip(other, one, strict=False)]
        kept[key] = same if len(one) == len(other) and {*same} != {None} else None
    return kept


def _nudged(value: Any, by: float, maps: dict[int, Any]) -> Any:
    """Change floats that are no whole numbers, as they stand in arguments and in parameters of maps."""
    if isinstance(value, float):
        return value if value.is_integer() else by * value
    if isinstance(value, np.ndarray) and value.dtype == float:
        return by * value
    if type(value) is dict:
        return {key: _nudged(entry, by, maps) for key, entry in value.items()}
    if type(value) in (tuple, list):
        return type(value)(_nudged(entry, by, maps) for entry in value)
    if isinstance(value, PointMap | ForcedSystem) and id(value) not in maps:
        changed = value.with_params(_nudged(dict(value.params), by, maps))
        maps |= {id(value): changed, id(changed): changed, id(maps): [*maps.get(id(maps), ()), value]}
    return maps.get(id(value), value)


def elsewhere() -> list[dict[str, Described]]:
    """Describe the results of all good calls as other machines might find them, each in a process of its own."""
    found = []
    for processor, by in ELSEWHERE.items():
        environment = os.environ | {"OPENBLAS_CORETYPE": processor, "PYTHONPATH": os.pathsep.join(sys.path)}
        if not found:
            environment["NPY_DISABLE_CPU_FEATURES"] = "AVX2 FMA3 AVX512F"
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, __file__, str(by)], cwd=folder, env=environment, check=True)
            found.append(json.loads(Path(folder, "results.json").read_text()))
    return found


def _write(by: float) -> None:
    maps: dict[int, Any] = {}
    plain = public_calls.called

    def called(name: str, arguments: Mapping[str, Any]) -> Any:
        try:
            return plain(name, _nudged(dict(arguments), by, maps))
        except Exception as error:
            print(f"{name} refuses numbers that are nudged: {error}", file=sys.stderr)
            plt.close("all")
            return plain(name, arguments)

    public_calls.called, small_systems.NUDGE = called, by
    warnings.simplefilter("ignore")
    set_threads(1)
    found = {}
    for name in public_calls.TARGETS:
        for key, arguments in public_calls.cases(name).items():
            plt.close("all")
            with contextlib.suppress(Exception):  # which the test tells
                found[key] = described(called(name, arguments))
    Path("results.json").write_text(json.dumps(found))


if __name__ == "__main__":
    _write(float(sys.argv[1]))
