"""Names of arguments: one for one thing, in all public signatures."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cellmap
import systems
from cellmap import CellGrid, discrete_map
from cellmap.orbits import zero_one_test_of_series

ROOMS = (
    *("maps", "orbits", "bifurcations", "attractors", "basins", "sets"),
    *("analysis.fractal", "analysis.resilience", "analysis.boundary", "exchange", "plot", "explorer"),
)

WRITTEN = {
    **{"initial_condition": "start", "initial_conditions": "starts ics", "region, or fit_range": "window"},
    **{"fit_range": "fit_window", "rng": "seed random_state", "parameter": "parameter_name", "period": "turn"},
    **{"perturbation": "nudge", "rotations": "turns", "scale": "scales", "coordinates": "components", "axes": "axes_"},
    **{"include": "also codes", "refine": "polish", "attractors": "known", "max_step": "leap", "cells": "numbers"},
    **{"n_ with what is counted": "n number", "max_ with what is bounded": "most", "threshold": "farthest"},
    **{"min_ with what is bounded": "fewest", "max_distance": "within", "stroboscopic": "strobe"},
    **{"periods": "length_of_orbit"},
}
FORMER = {former: name for name, several in WRITTEN.items() for former in several.split()}
"""Names that are not used for arguments of functions, and what is written in their place."""

TYPES = {
    **dict.fromkeys(("initial_conditions", "values", "scale"), "ArrayLike"),
    **dict.fromkeys(("transient", "longest_period", "max_periods", "max_steps", "max_points"), "int"),
    **dict.fromkeys(("region", "grid"), "CellGrid"),
    **{"initial_condition": "ArrayLike|Sequence", "points": "ArrayLike|StabilityPoints", "parameter": "str"},
    **{"periods": "int|float", "fit_range": "tuple", "rng": "Rng", "progress": "bool", "include": "Sequence[int]"},
    **{"orbit": "PeriodicOrbit", "attractors": "Sequence[Attractor]", "ax": "Axes"},
}
"""What the type of an argument of a name has in it, in every function; alternatives between bars."""


@cache
def public_functions() -> dict[str, Callable[..., Any]]:
    """Return functions and methods of the library and of the systems by their names; not constructors of records."""
    modules = [cellmap, *(importlib.import_module(f"cellmap.{room}") for room in ROOMS), systems]
    modules += [importlib.import_module("systems.lab")]
    found: dict[str, Callable[..., Any]] = {}
    for module in modules:
        for name in exported(module):
            thing = getattr(module, name)
            if inspect.isfunction(thing):
                found.setdefault(f"{module.__name__}.{name}", thing)
            elif inspect.isclass(thing) and not issubclass(thing, Enum | Warning | Exception):
                for key, member in vars(thing).items():
                    member = member.__func__ if isinstance(member, classmethod | staticmethod) else member
                    if inspect.isfunction(member) and not key.startswith("_"):
                        found.setdefault(f"{thing.__name__}.{key}", member)
    return found


def exported(module: Any) -> Iterator[str]:
    stub = Path(module.__file__).with_suffix(".pyi")
    text = (stub if stub.exists() else Path(module.__file__)).read_text(encoding="utf-8")
    yield from re.findall(r"import \w+ as (\w+)$", text, re.MULTILINE)


def arguments() -> Iterator[tuple[str, inspect.Parameter]]:
    for name, function in public_functions().items():
        for parameter in inspect.signature(function).parameters.values():
            yield name, parameter


def test_the_walk_comes_everywhere():
    assert len(public_functions()) > 150
    some = {"cellmap.find_basins", "Basins.verify", "systems.lab.fit_motion", "cellmap.plot.basins"}
    assert some <= set(public_functions())
    assert not [m.name for m in pkgutil.iter_modules(cellmap.__path__) if not m.ispkg]


def test_no_argument_has_a_second_name():
    found = [f"{name}({p.name}): write {FORMER[p.name]}" for name, p in arguments() if p.name in FORMER]
    assert not found, "\n".join(found)


def test_a_name_has_one_meaning():
    """The type of an argument tells a number of points from the points."""
    for name, allowed in TYPES.items():
        found = {f: str(p.annotation) for f, p in arguments() if p.name == name}
        assert found, name
        assert not {f: hint for f, hint in found.items() if not any(a in hint for a in allowed.split("|"))}, name


def test_defaults_change_on_purpose(request: pytest.FixtureRequest) -> None:
    """What a call means without its arguments; `pytest --update-reference` this file after a change."""
    kept = Path(__file__).parent / "reference/defaults.txt"
    plain = float | int | str | tuple
    found = [f"{f}({p.name}={p.default!r})" for f, p in arguments() if isinstance(p.default, plain)]
    if request.config.getoption("--update-reference"):
        kept.write_text("\n".join(sorted(found)) + "\n", encoding="utf-8")
    assert sorted(found) == kept.read_text(encoding="utf-8").splitlines()


def test_every_random_function_takes_rng_by_keyword():
    """A function that draws random numbers says so, and none has them under another name."""
    random = {name: p for name, p in arguments() if p.name == "rng"}
    assert len(random) >= 24
    for name, parameter in random.items():
        assert parameter.kind is inspect.Parameter.KEYWORD_ONLY, name
        assert isinstance(parameter.default, int), name
    drawing = {
        name
        for name, function in public_functions().items()
        if re.search(r"\brandom_(numbers|seed)\(", inspect.getsource(inspect.unwrap(function)))
    }
    assert drawing <= set(random)


def series() -> np.ndarray:
    return np.asarray(discrete_map(lambda x, p: (4 * x[0] * (1 - x[0]),), {}, ("x",)).orbit([0.3], 999).points[:, 0])


def test_a_seed_repeats_itself_and_a_generator_goes_on():
    x, generator = series(), np.random.default_rng(5)
    same = [zero_one_test_of_series(x, 20, rng=5).evidence for _ in range(2)]
    going = [zero_one_test_of_series(x, 20, rng=generator).evidence for _ in range(2)]
    np.testing.assert_array_equal(same[0], same[1])
    np.testing.assert_array_equal(same[0], going[0])
    assert not np.array_equal(going[0], going[1])
    assert not np.array_equal(*(zero_one_test_of_series(x, 20, rng=None).evidence for _ in range(2)))


def test_seeds_of_parts_come_from_a_generator_too():
    shift = discrete_map(lambda x, p: (0.5 * x[0],), {}, ("x",))
    grid, generator = CellGrid((-1.0,), (1.0,), (8,)), np.random.default_rng(1)

    def chain(rng):
        return cellmap.sets.generalized_cell_mapping(shift, grid, samples=4, noise=0.1, rng=rng).matrix.toarray()

    np.testing.assert_array_equal(chain(3), chain(3))
    assert not np.array_equal(chain(generator), chain(generator))
    assert not np.array_equal(chain(None), chain(None))


def test_no_function_has_the_name_of_a_file_beside_it():
    """Once the file is imported, its name would be that of the module."""
    for room in ROOMS:
        folder = Path(cellmap.__file__).parent.joinpath(*room.split("."))
        public = re.findall(r"as (\w+)", (folder / "__init__.pyi").read_text())
        assert not [name for name in public if (folder / f"{name}.py").exists()], room
