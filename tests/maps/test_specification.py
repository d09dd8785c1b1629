"""Maps built from specifications: the kinds of the library, and one of a user's own."""

import json
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cellmap import (
    CellGrid,
    ForcedSystem,
    PointMap,
    Status,
    angle,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    save_basins,
    stroboscopic_map,
)
from cellmap.basins import recompute_basins
from cellmap.maps import Coordinate, MapSpec, inverse_stroboscopic_map, rebuild_map, section_map, swept_map
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.specification import _KINDS
from systems import driven_pendulum


@dataclass(frozen=True)
class Valley(MapSpec[PointMap]):
    """Two attracting points of the line, at -`width` and `width`: x goes a part of the way to the nearer one."""

    kind = "valley of the tests"
    params: Mapping[str, float]
    width: float = 1.0
    ends: tuple[float, ...] = (-3.0, 3.0)

    def make(self) -> PointMap:
        def advance(orbits: Orbits, periods: int) -> None:
            for _ in range(periods):
                for now in orbits.living():
                    x = now.points
                    x += self.params["pull"] * (np.where(x < 0.0, -self.width, self.width) - x)
                    now.end((x[:, 0] < self.ends[0]) | (x[:, 0] > self.ends[1]), Status.DIVERGED)

        return PointMap("valley", (Coordinate("x"),), self.params, advance)


@pytest.fixture(scope="module")
def valley() -> PointMap:
    return Valley({"pull": 0.5}, width=2.0).build()


def decay(t: float, x: Any, p: Any) -> tuple[float, ...]:
    return x[1], -x[0] - p.rate * x[1] + 0.1 * cos(t)


def rotating(x: Any, p: Any) -> tuple[float, float]:
    return x[0] + 1.0 + p.k * sin(x[0]), 0.5 * x[1] + 0.1 * cos(x[0])


SYSTEM = ForcedSystem(decay, {"rate": 0.3}, 2 * pi, ("q", "v"))
FREE = ForcedSystem(lambda t, x, p: (x[1], -x[0] - p.rate * x[1]), {"rate": 0.3}, 6.0, ("q", "v"))
ROTATING = discrete_map(rotating, {"k": 0.2}, (angle("a"), "y"))
GRID = CellGrid((-pi, -1.0), (pi, 1.0), (16, 8))
CASES = {
    "stroboscopic": (SYSTEM, lambda: stroboscopic_map(SYSTEM, 0.3, 1e-5, 1e-6, method="RK45", max_steps=500)),
    "inverse": (SYSTEM, lambda: inverse_stroboscopic_map(SYSTEM, phase=0.25)),
    "section": (FREE, lambda: section_map(FREE, ("q", 0.0, 1), rtol=1e-7)),
    "discrete": (ROTATING, lambda: ROTATING),
    "interpolated": (ROTATING, lambda: interpolated_map(ROTATING, GRID, order=3, tolerance=1.0, max_step=2)),
    "swept": (SYSTEM, lambda: swept_map(stroboscopic_map(SYSTEM, rtol=1e-6), "rate")),
}
INITIAL_CONDITIONS = np.random.default_rng(1).uniform(0.2, 0.9, (20, 3))


def test_all_kinds_of_the_library_have_a_case() -> None:
    assert {name for name, kind in _KINDS.items() if kind.__module__.startswith("cellmap.")} == set(CASES)


def bits(point_map: PointMap) -> bytes:
    return point_map.iterate(INITIAL_CONDITIONS[:, : point_map.dimension], 2).points.tobytes()


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("kind", CASES)
def test_every_kind_is_built_again_from_files_and_in_other_processes(kind: str) -> None:
    source, make = CASES[kind]
    original = make()
    assert original.spec is not None
    assert original.recipe["kind"] == kind
    recipe = json.loads(json.dumps(original.recipe))
    again = rebuild_map(source, recipe)
    assert bits(again) == bits(original)
    assert json.loads(json.dumps(again.recipe)) == recipe
    if source is not FREE:  # whose right-hand side is not the function of a module
        other = pickle.loads(pickle.dumps(original))
        assert bits(other) == bits(original)
        assert other.recipe == original.recipe


@pytest.mark.parametrize("kind", CASES)
def test_parameters_of_every_kind_can_be_changed(kind: str) -> None:
    original = CASES[kind][1]()
    (name,) = original.params
    other = original.with_params(**{name: 0.7})
    assert other.recipe == original.recipe
    assert other.params == {name: 0.7}
    if kind != "swept":  # whose parameters are those of its points
        assert bits(other) != bits(original)
    assert bits(other.with_params(**original.params)) == bits(original)


def test_an_inverse_map_is_not_rebuilt_as_its_forward_map() -> None:
    forward, inverse = stroboscopic_map(SYSTEM), inverse_stroboscopic_map(SYSTEM)
    again = rebuild_map(SYSTEM, inverse.recipe)
    assert again(forward(INITIAL_CONDITIONS[:, :2])) == pytest.approx(INITIAL_CONDITIONS[:, :2], abs=1e-5)


def test_a_kind_of_ones_own_loses_nothing(valley: PointMap, tmp_path: Path) -> None:
    window = CellGrid((-2.5,), (2.5,), (50,))
    table = interpolated_map(valley, window, order=1, tolerance=0.1)
    for point_map in (valley, table):
        basins = find_basins(point_map, window)
        stored = load_basins(save_basins(basins, tmp_path / "basins.h5"))
        again = recompute_basins(stored, valley)
        assert np.array_equal(again.labels, basins.labels)
        reached = np.array([a.points[0, 0] for a in again.attractors])[again.labels]
        assert reached == pytest.approx(np.where(window.centres()[..., 0] < 0.0, -2.0, 2.0))
    other = pickle.loads(pickle.dumps(table))
    assert other([0.5]) == table([0.5])
    assert other.with_params(pull=1.0)([0.5]) == pytest.approx([2.0], abs=1e-12)


def test_parameters_of_a_kind_of_ones_own(valley: PointMap) -> None:
    assert valley.with_params(pull=0.25)([1.0]) == 1.25
    assert swept_map(valley, "pull")([[1.0, 0.5], [1.0, 0.25]]).tolist() == [[1.5, 0.5], [1.25, 0.25]]
    assert rebuild_map(valley.with_params(pull=0.25), json.loads(json.dumps(valley.recipe)))([1.0]) == 1.25


def test_a_file_that_lacks_a_field_takes_that_of_the_source(valley: PointMap) -> None:
    recipe = {"kind": Valley.kind, "width": 1.0}
    assert rebuild_map(valley, recipe)([0.5]) == 0.75
    with pytest.raises(ValueError, match=r"cannot be rebuilt from .*: give its system, or a map of the same kind"):
        rebuild_map(ROTATING, recipe)


def test_kinds_have_names_of_their_own() -> None:
    with pytest.raises(TypeError, match=r"kind='discrete' of Mine is that of cellmap.maps.discrete: give another name"):

        @dataclass(frozen=True)
        class Mine(MapSpec[PointMap]):
            kind = "discrete"

            def make(self) -> PointMap:
                raise NotImplementedError


def test_a_map_that_was_changed_by_hand_is_not_built_again(valley: PointMap) -> None:
    changed = replace(valley, name="another")
    assert changed.spec is None
    assert changed.recipe == {"kind": "map"}


@pytest.mark.parametrize("dimension", [1, 2])
def test_tables_with_foreign_memory_behind_them_are_evaluated_alike(dimension: int) -> None:
    from cellmap.maps.interpolation.look_ups import LookUps

    exact = ROTATING if dimension == 2 else Valley({"pull": 0.5}).build()
    grid = GRID if dimension == 2 else CellGrid((-2.0,), (2.0,), (10,))
    table = interpolated_map(exact, grid, order=5, tolerance=10.0).table
    assert table is not None
    expected = Orbits.starting(INITIAL_CONDITIONS[:, :dimension].copy())
    LookUps(exact, [table], "integrate")(expected, 1)
    size, shape = table.coefficients.size, table.coefficients.shape
    foreign = np.full(size + 64, np.nan)
    foreign[:size] = table.coefficients.ravel()
    wider = np.full((*shape[:-1], dimension + 1), np.nan)
    wider[..., :dimension] = table.coefficients
    for coefficients in (foreign[:size].reshape(shape), table.coefficients.copy(), wider[..., :dimension]):
        orbits = Orbits.starting(INITIAL_CONDITIONS[:, :dimension].copy())
        LookUps(exact, [replace(table, coefficients=coefficients)], "integrate")(orbits, 1)
        assert orbits.points.tobytes() == expected.points.tobytes()


@pytest.mark.parametrize("missing", ["rtol", "method", "phase", "period"])
def test_incomplete_recipe_names_what_is_missing(missing):
    pendulum = driven_pendulum()
    recipe = {k: v for k, v in stroboscopic_map(pendulum).recipe.items() if k != missing}
    with pytest.raises((ValueError, KeyError), match=missing):
        rebuild_map(pendulum, recipe)
