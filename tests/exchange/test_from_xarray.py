"""Results from the labelled arrays of xarray that were made of them, through netCDF files too."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from math import cos, pi, sin

import numpy as np
import pytest
import xarray

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    bifurcation_diagram,
    certify,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    save_basins,
    stability_map,
    stroboscopic_map,
)
from cellmap.basins import continue_basins
from cellmap.exchange import from_xarray, to_xarray
from cellmap.exchange.attractor_group import attractor_group, attractors_of
from cellmap.maps import angle, rebuild_map
from cellmap.maps.coordinates import as_coordinates
from cellmap.orbits import Attractor, InvariantTorus, Kind, finite_time_exponents

WINDOW = CellGrid((-1.5, -1.0), (1.5, 1.0), (12, 8))
WELLS = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3, 0.5 * x[1]), {"r": 1.5}, ("x", "y"), "two wells")


def rigid_rotation(x, p):
    """The circle of radius 1, turned by 1 rad a step, attracts."""
    a, b = x
    r = (a * a + b * b) ** 0.5
    scale = (1 + 0.2 * (1 - r)) if r > 0.1 else 1.18
    return scale * (a * cos(1.0) - b * sin(1.0)), scale * (a * sin(1.0) + b * cos(1.0))


CASES = {
    "basins": lambda: find_basins(WELLS, WINDOW),
    "chaotic and diverged": lambda: find_basins(systems.henon_map(), CellGrid((-2, -2), (2, 2), (16, 12))),
    "quasi-periodic": lambda: find_basins(
        discrete_map(rigid_rotation, {}, ("a", "b")), CellGrid((-1.3, -1.2), (1.2, 1.3), (6, 6))
    ),
    "sticking": lambda: find_basins(
        stroboscopic_map(systems.driven_pendulum(friction=10.0)), CellGrid((-pi, -100.0), (pi, 100.0), (10, 10))
    ),
    "no attractors": lambda: find_basins(
        discrete_map(lambda x, p: (2 * x[0], x[1]), {}, ("x", "y")), CellGrid((1, 1), (2, 2), (3, 2))
    ),
    "angles": lambda: find_basins(
        discrete_map(lambda x, p: (x[0] / 2, x[1] / 2), {}, (angle("theta"), "theta'")),
        CellGrid((-pi, -1), (pi, 1), (8, 4)),
    ),
    "initial conditions": lambda: find_basins(WELLS, np.random.default_rng(0).uniform(-1, 1, (4, 3, 2))),
    "one initial condition": lambda: find_basins(WELLS, [0.1, 0.2]),
    "certificate": lambda: certify(
        find_basins(interpolated_map(WELLS, WINDOW, order=1, tolerance=0.3), WINDOW, max_periods=60)
    ),
    "continuation": lambda: continue_basins(WELLS, "r", [1.5, 1.2, 0.8], WINDOW),
    "continuation of states": lambda: continue_basins(WELLS, "r", [1.2, 1.5], [[0.3, 0.1], [-0.2, 0.5]]),
    "diagram": lambda: bifurcation_diagram(WELLS, "r", [1.2, 1.5, 2.8], [[0.4, 0.1], [-0.3, 0.2]], periods=64),
    "stability": lambda: stability_map(
        systems.dimensionless_pendulum(gamma=0.3), (0.0, 0.0), ("alpha", [0.1, 0.2, 0.3]), ("beta", [0.1, 0.2, 0.25])
    ),
    "exponents": lambda: finite_time_exponents(WELLS, WINDOW, 4),
}


def assert_same(found, expected):
    """Types and bits of all fields; maps are in no file, and what was a tuple in settings is a list."""
    if dataclasses.is_dataclass(expected):
        assert type(found) is type(expected)
        for field in dataclasses.fields(expected):
            if field.name != "point_map":
                assert_same(getattr(found, field.name), getattr(expected, field.name))
    elif isinstance(expected, np.ndarray):
        assert (found.dtype, found.shape) == (expected.dtype, expected.shape)
        assert found.tobytes() == expected.tobytes()
    elif isinstance(expected, Mapping):
        assert list(found) == list(expected)
        for key in expected:
            assert_same(found[key], expected[key])
    elif isinstance(expected, list | tuple):
        assert len(found) == len(expected)
        for a, b in zip(found, expected, strict=True):
            assert_same(a, b)
    else:
        assert found == expected or (found != found and expected != expected)


@pytest.mark.filterwarnings("ignore::cellmap.basins.doubts.UnsettledWarning")
@pytest.mark.parametrize("case", CASES)
def test_what_was_converted_comes_back(case, tmp_path):
    expected = CASES[case]()
    tree = expected.to_xarray()
    assert_same(from_xarray(tree), expected)
    tree.to_netcdf(tmp_path / "result.nc", engine="h5netcdf")
    opened = xarray.open_datatree if isinstance(tree, xarray.DataTree) else xarray.open_dataset
    with opened(tmp_path / "result.nc", engine="h5netcdf") as file:
        found = from_xarray(file)
    assert_same(found, expected)
    of_maps = {"map_period"} if case not in ("exponents",) else set()
    assert_same(found.to_xarray().attrs, {name: v for name, v in tree.attrs.items() if name not in of_maps})


def test_cases_have_trapping_regions_of_all_kinds():
    """Otherwise the test above says nothing of some of them."""
    kinds = {"chaotic and diverged": Kind.CHAOTIC, "quasi-periodic": Kind.QUASIPERIODIC, "sticking": Kind.EQUILIBRIA}
    for case, kind in kinds.items():
        assert any(a.kind == kind and a.cover is not None for a in CASES[case]().attractors), case


def test_tori_come_back():
    numbers = np.random.default_rng(0)
    torus = InvariantTorus(
        **{name: numbers.normal(size=2) for name in ("frequencies", "frequency_errors")},
        **{name: numbers.normal(size=3) for name in ("rotation_numbers", "rotation_errors")},
        coefficients=numbers.normal(size=(3, 5, 5)) + 1j * numbers.normal(size=(3, 5, 5)),
        invariance_error=1e-7,
    )
    axes = as_coordinates(["a", "b", "c"])
    empty = np.empty(0, np.complex128)
    plain = Attractor(Kind.CHAOTIC, 0, numbers.normal(size=(4, 3)), (0, 1, 0), empty, np.array([0.1]), axes)
    both = (plain, dataclasses.replace(plain, kind=Kind.QUASIPERIODIC, torus=torus, grazing_distance=0.25))
    assert_same(tuple(attractors_of(attractor_group(both, [0, 1], axes), axes)), both)


def test_the_file_of_basins_says_the_same(tmp_path):
    basins = find_basins(WELLS, WINDOW)
    assert_same(from_xarray(basins.to_xarray()), load_basins(save_basins(basins, tmp_path / "basins.h5")))


def test_the_map_is_rebuilt_to_the_same_bits():
    def rhs(t, x, p):
        return x[1], x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)

    system = ForcedSystem(rhs, {"delta": 0.2, "gamma": 0.1}, 2 * pi, ("q", "v"))
    exact = stroboscopic_map(system, rtol=1e-8)
    found = from_xarray(find_basins(exact, CellGrid((-2, -2), (2, 2), (8, 8))).to_xarray())
    again = rebuild_map(system.with_params(**found.params), found.settings["map"])
    assert again([0.3, 0.4]).tobytes() == exact([0.3, 0.4]).tobytes()


def test_what_is_no_result_is_refused():
    tree = find_basins(WELLS, WINDOW).to_xarray()
    with pytest.raises(TypeError, match=r"^tree=3: give a DataTree"):
        from_xarray(3)
    with pytest.raises(ValueError, match=r"record=None: give what to_xarray .* makes of one of Basins, "):
        from_xarray(xarray.Dataset({"labels": ("x", [0, 1])}))
    with pytest.raises(ValueError, match=r"not what to_xarray made of Basins .*labels is int16 of shape \(1, 8\)"):
        from_xarray(tree.isel(x=slice(1), attractor=slice(None)))
    with pytest.raises(ValueError, match="labels is int64"):
        from_xarray(tree.assign(labels=tree["labels"].astype(int)))
    with pytest.raises(ValueError, match="labels are not between -7 and 1"):
        from_xarray(tree.assign(labels=tree["labels"] + np.int16(5)))
    del tree.attrs["settings"]
    with pytest.raises(ValueError, match="KeyError: 'settings'"):
        from_xarray(tree)


def test_results_without_a_way_back_are_named(tmp_path):
    from cellmap.bifurcations import attractor_atlas

    atlas = attractor_atlas(systems.henon_map(0.2, 0.3), ("a", [0.1, 0.2]), ("b", [0.2, 0.3]), [[0.0, 0.0]], curves=0)
    with pytest.raises(ValueError, match="record='AttractorAtlas': give what to_xarray"):
        from_xarray(to_xarray(atlas))


@pytest.mark.parametrize("change", ["reversed", "transposed", "grid", "attractors"])
def test_trees_in_another_sequence_are_refused(change):
    wells = discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"), "two wells")
    tree = find_basins(wells, CellGrid((-1, -1), (1, 1), (20, 20))).to_xarray()
    if change == "reversed":
        tree = tree.isel(x=slice(None, None, -1))
    elif change == "transposed":
        tree["labels"] = tree["labels"].T
    elif change == "grid":
        tree.attrs["grid"] = tree.attrs["grid"].replace("-1", "-2", 1)
    else:
        tree["attractors"] = tree["attractors"].isel(attractor=[1, 0])
    with pytest.raises(ValueError, match="tree"):
        from_xarray(tree)
