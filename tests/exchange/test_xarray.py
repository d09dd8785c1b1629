"""Results as labelled arrays of xarray, through netCDF files and back, and as tables of pandas."""

import dataclasses
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import cos, pi
from typing import ClassVar

import h5py
import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    bifurcation_diagram,
    certify,
    continue_orbit,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    load_basins,
    periodic_orbit,
    save_basins,
    stability_map,
    stroboscopic_map,
)
from cellmap._lib.arrays import Floats, Ints
from cellmap._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Layout
from cellmap.attractors.settling.labels import LABEL_NAMES, Label
from cellmap.basins import Evidence, continue_basins
from cellmap.bifurcations import attractor_atlas
from cellmap.exchange import from_xarray, to_dataframe, to_xarray
from cellmap.exchange.attractor_group import attractor_group, attractors_of
from cellmap.exchange.conventions import flags, variable_names
from cellmap.exchange.records import _Read
from cellmap.maps import angle, rebuild_map
from cellmap.maps.coordinates import as_coordinates
from cellmap.orbits import Attractor, InvariantTorus, Kind, finite_time_exponents
from cellmap.orbits.attractor import Cover

WINDOW = CellGrid((-1.5, -1.0), (1.5, 1.0), (12, 8))
WELLS = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3, 0.5 * x[1]), {"r": 1.5}, ("x", "y"), "two wells")
DELAYED = discrete_map(lambda x, p: (2.1 * x[0] * (1 - x[1]), x[0]), {}, ("x", "y"))
LINE = discrete_map(lambda x, p: (x[0], x[1] / 2), {}, ("x", "y"))
ANGLES = discrete_map(lambda x, p: (x[0] / 2, x[1] / 2), {}, (angle("theta"), "theta'"))


CASES = {
    "basins": lambda: find_basins(WELLS, WINDOW),
    "chaotic and diverged": lambda: find_basins(systems.henon_map(), CellGrid((-2, -2), (2, 2), (16, 12))),
    "quasi-periodic": lambda: find_basins(DELAYED, CellGrid((0.2, 0.2), (0.8, 0.8), (6, 6))),
    "line": lambda: find_basins(LINE, WINDOW),
    "no attractors": lambda: find_basins(WELLS, CellGrid((3, 1), (4, 2), (3, 2))),
    "angles": lambda: find_basins(ANGLES, CellGrid((-pi, -1), (pi, 1), (8, 4))),
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


@cache
def result(case):
    return CASES[case]()


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


def through_a_file(tree, path, read=lambda file: None):
    """What is read off the file; every value, type and attribute in it is what was written, as xarray compares them."""
    import xarray

    tree.to_netcdf(path, engine="h5netcdf")
    is_tree = isinstance(tree, xarray.DataTree)
    with (xarray.open_datatree if is_tree else xarray.open_dataset)(path, engine="h5netcdf") as file:
        found, again = read(file), file.load()
    assert not is_tree or {node.path for node in again.subtree} == {"/", "/attractors"}
    for node in tree.subtree if is_tree else [tree]:
        before, after = (node.to_dataset(), again[node.path].to_dataset()) if is_tree else (node, again)
        xarray.testing.assert_identical(before, after)
        for name, variable in before.variables.items():
            assert after[name].dtype == variable.dtype or variable.dtype.kind in "OUT", name
    return found


@pytest.mark.parametrize("case", CASES)
def test_what_was_converted_comes_back(case):
    expected = result(case)
    tree = expected.to_xarray()
    found = from_xarray(tree)
    assert_same(found, expected)
    of_maps = set() if case == "exponents" else {"map_period"}
    assert_same(found.to_xarray().attrs, {name: v for name, v in tree.attrs.items() if name not in of_maps})
    # Cases have trapping regions of all kinds.
    kinds = {"chaotic and diverged": Kind.CHAOTIC, "quasi-periodic": Kind.QUASIPERIODIC, "line": Kind.EQUILIBRIA}
    if case in kinds:
        assert any(a.kind == kinds[case] and a.cover is not None for a in expected.attractors)


@pytest.mark.parametrize(
    "case", [c if c in ("continuation", "exponents") else pytest.param(c, marks=pytest.mark.thorough) for c in CASES]
)
def test_files_hold_what_was_converted(case, tmp_path):
    assert_same(through_a_file(result(case).to_xarray(), tmp_path / "result.nc", from_xarray), result(case))


def test_results_without_a_way_back_are_named(tmp_path):
    henon, points = systems.henon_map(0.2, 0.3), [[0.0, 0.0], [0.1, 0.1]]
    atlas = attractor_atlas(henon, ("a", [0.1, 0.2, 0.5]), ("b", [0.2, 0.3]), points, curves=0)
    assert to_dataframe(atlas)["fraction"].max() == 1.0
    tree = to_xarray(atlas)
    through_a_file(tree, tmp_path / "atlas.nc")
    with pytest.raises(ValueError, match="record='AttractorAtlas': give what to_xarray"):
        from_xarray(tree)


def test_tori_and_covers_come_back():
    numbers = np.random.default_rng(0)
    torus = InvariantTorus(
        **{name: numbers.normal(size=2) for name in ("frequencies", "frequency_errors")},
        **{name: numbers.normal(size=3) for name in ("rotation_numbers", "rotation_errors")},
        coefficients=numbers.normal(size=(3, 5, 5)) + 1j * numbers.normal(size=(3, 5, 5)),
        invariance_error=1e-7,
    )
    axes, exponents = as_coordinates(["a", "b", "c"]), np.array([0.1])
    cover = Cover(np.zeros(3), np.ones(3), np.zeros((2, 3), np.int64), residence=12)
    plain = Attractor(Kind.CHAOTIC, 0, numbers.normal(size=(4, 3)), (0, 1, 0), 0j * np.empty(0), exponents, axes)
    torus = dataclasses.replace(plain, kind=Kind.QUASIPERIODIC, torus=torus, grazing_distance=0.25)
    both = (dataclasses.replace(plain, cover=cover), torus)
    assert_same(tuple(attractors_of(attractor_group(both, [0, 1], axes), axes)), both)


def test_the_map_is_rebuilt_to_the_same_bits():
    system = ForcedSystem(lambda t, x, p: (p.a * cos(t) - x[0],), {"a": 0.2}, 2 * pi, ("q",))
    exact = stroboscopic_map(system, rtol=1e-8)
    found = from_xarray(find_basins(exact, [[0.0], [0.1]]).to_xarray())
    again = rebuild_map(system.with_params(**found.params), found.settings["map"])
    assert again([0.3]).tobytes() == exact([0.3]).tobytes()


def with_attributes(tree, change):
    tree.attrs = change(tree.attrs)
    return tree


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda tree: 3, r"^tree=3: give a DataTree"),
        (
            lambda tree: type(tree.to_dataset())({"labels": ("x", [0, 1])}),
            r"record=None: give what to_xarray .* makes of one of Basins, ",
        ),
        (
            lambda tree: tree.isel(x=slice(1), attractor=slice(None)),
            r"not what to_xarray made of Basins .*labels is int16 of shape \(1, 8\)",
        ),
        (lambda tree: tree.assign(labels=tree["labels"].astype(int)), "labels is int64"),
        (lambda tree: tree.assign(labels=tree["labels"] + np.int16(5)), "labels are not between -23 and 1"),
        (
            lambda tree: with_attributes(tree, lambda a: {k: v for k, v in a.items() if k != "settings"}),
            "KeyError: 'settings'",
        ),
        (lambda tree: tree.isel(x=slice(None, None, -1)), "tree"),
        (lambda tree: tree.assign(labels=tree["labels"].T), "tree"),
        (lambda tree: with_attributes(tree, lambda a: {**a, "grid": a["grid"].replace("-1", "-2", 1)}), "tree"),
        (lambda tree: tree.assign({"attractors": tree["attractors"].isel(attractor=[1, 0])}), "tree"),
    ],
)
def test_what_is_no_result_is_refused(change, message):
    with pytest.raises((TypeError, ValueError), match=message):
        from_xarray(change(result("basins").to_xarray()))


def test_basins_have_their_labels_where_they_belong():
    basins = result("chaotic and diverged")
    tree = basins.to_xarray()
    for i, j in ((0, 0), (5, 7), (8, 6), (15, 11)):
        x, y = basins.grid.centres()[i, j]
        assert tree["labels"].sel(x=x, y=y).item() == basins.labels[i, j]
    assert tree["labels"].dtype == np.int16
    np.testing.assert_array_equal(tree["settling_time"], basins.settling_time)
    attributes = tree["labels"].attrs
    meanings = dict(zip(attributes["flag_values"].tolist(), attributes["flag_meanings"].split(), strict=True))
    assert meanings == {0: "chaotic", **{k: name.replace(" ", "_") for k, name in LABEL_NAMES.items()}}
    assert attributes["flag_values"].dtype == np.int16
    assert (tree["labels"] == Label.DIVERGED).sum() == basins.fractions[Label.DIVERGED].count
    assert json.loads(tree.attrs["params"]) == basins.params
    assert tree.attrs["map_period"] == 1.0


def test_other_readers_of_hdf5_see_the_same(tmp_path):
    """By h5py alone: variables, flags, and coordinates as dimension scales, as netCDF-4 has them."""
    basins = result("basins")
    basins.to_xarray().to_netcdf(tmp_path / "basins.nc", engine="h5netcdf")
    assert_same(from_xarray(basins.to_xarray()), load_basins(save_basins(basins, tmp_path / "basins.h5")))
    with h5py.File(tmp_path / "basins.nc") as file:
        labels = file["labels"]
        assert labels.dtype == np.int16
        np.testing.assert_array_equal(labels, basins.labels)
        assert labels.attrs["flag_values"].tolist()[:2] == [0, 1]
        assert [dim[0].name for dim in labels.dims] == ["/x", "/y"]
        np.testing.assert_array_equal(file["x"], WINDOW.axis(0))
        assert file.attrs["Conventions"] == "CF-1.11"
        assert sorted(file["attractors/name"].asstr()[()]) == sorted(a.name for a in basins.attractors)


def test_attractors_are_a_group_with_their_points_one_after_another():
    period_two = discrete_map(lambda x, p: (3.2 * x[0] * (1 - x[0]), 0.5 * x[1]), {}, ("x", "y"))
    for basins in (result("basins"), find_basins(period_two, CellGrid((0.05, -1), (0.95, 1), (8, 6)))):
        group = basins.to_xarray()["attractors"]
        assert group["number_of_points"].attrs["sample_dimension"] == "point"
        for k, attractor in enumerate(basins.attractors):
            row = group.to_dataset().isel(attractor=k)
            own = group["points"].values[group["point_attractor"].values == k]
            np.testing.assert_array_equal(own, attractor.points)
            assert (row["label"], row["name"], row["orbit_period"]) == (k, attractor.name, attractor.period)
            assert row["count"] == basins.fractions[k].count
            multipliers = row["multipliers_real"] + 1j * row["multipliers_imaginary"]
            np.testing.assert_array_equal(multipliers, attractor.multipliers)


def test_angles_say_their_unit_period_and_branch_cut_and_certificates_their_evidence():
    tree = result("angles").to_xarray()
    assert tree["labels"].dims == ("theta", "theta_")
    assert tree["theta"].attrs == {"long_name": "theta", "units": "rad", "period": 2 * pi, "branch_cut": -pi}
    assert tree["theta_"].attrs == {"long_name": "theta'", "units": "1"}
    evidence = result("certificate").to_xarray()["evidence"]
    np.testing.assert_array_equal(evidence, result("certificate").evidence)
    assert evidence.attrs["flag_values"].tolist() == list(Evidence)
    assert evidence.attrs["flag_meanings"] == "cell orbit exact open direct proved"


def test_continuations_select_by_value_and_label():
    swept = result("continuation")
    tree = swept.to_xarray()
    assert tree["fractions"].sel(r=1.5, label=1) == swept.fractions[0, swept.labels.index(1)]
    group = tree["attractors"].to_dataset()
    assert group.sizes["attractor"] == sum(map(len, swept.attractors))
    place = ((group["parameter_value"] == 1.5) & (group["label"] == 1)).values.argmax()
    # Fixed points of r x - x^3 are 0 and the roots of r - 1.
    assert abs(group["points"].values[group["point_attractor"] == place][0, 0]) == pytest.approx(0.5**0.5, abs=1e-9)


def test_diagrams_and_stability_maps_have_their_parameters_as_coordinates():
    diagram = bifurcation_diagram(WELLS, "r", [1.2, 1.5, 2.8], [0.4, 0.1], periods=64)
    found = diagram.to_xarray()
    assert found["x"].dims == ("branch", "r", "step")
    np.testing.assert_array_equal(found["y"], diagram.points[..., 1])
    assert found["orbit_period"].sel(r=1.5).values.tolist() == [1, 1]
    assert found["direction"].values.tolist() == ["up", "down"]
    stability = result("stability")
    found = stability.to_xarray()
    assert found["largest"].dims == ("beta", "alpha")
    assert found["largest"].sel(alpha=0.2, beta=0.25) == stability.largest[2, 1]
    np.testing.assert_array_equal(found["boundary_alpha"].values[found["refined"].values == 0], stability.rows.x)


def test_without_xarray_the_error_names_the_extra(monkeypatch):
    with pytest.raises(TypeError, match=r"^result=3: give Basins"):
        to_xarray(3)
    basins = result("basins")
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'cellmap-dynamics\[xarray\]'"):
        basins.to_xarray()


# --- tables of pandas


def test_attractors_have_a_row_each():
    """Fixed points at ±sqrt(r - 1) with the multipliers r - 3 (r - 1) = 0 at r = 1.5 and 1/2."""
    basins = result("basins")
    table = basins.to_dataframe()
    np.testing.assert_allclose(np.sort(table["x"]), [-(0.5**0.5), 0.5**0.5], atol=1e-9)
    np.testing.assert_allclose(table["largest_multiplier"], 0.5, atol=1e-9)
    assert table["count"].tolist() == [48, 48]
    assert table["name"].tolist() == [basins.label_name(k) for k in range(2)]
    assert "fraction" not in to_dataframe(basins.attractors)


def test_tables_without_rows_and_of_superstable_attractors():
    doubled = discrete_map(lambda x, p: (2 * x[0] + 1,), {}, ("x",))
    table = find_basins(doubled, CellGrid((1.0,), (2.0,), (4,))).to_dataframe()
    assert len(table) == 0 and "fraction" in table
    squared = discrete_map(lambda x, p: (x[0] ** 2,), {}, ("x",))
    assert to_dataframe(find_attractors(squared, [[0.1]]))["largest_multiplier"].tolist() == pytest.approx([0.0])
    for other in (3, (), [3]):
        with pytest.raises(TypeError, match=r"^result=.*: give Basins"):
            to_dataframe(other)


def test_branches_and_their_bifurcations():
    """The orbit at 0 loses stability at r = 1, where its multiplier r crosses 1."""
    branch = continue_orbit(WELLS, periodic_orbit(WELLS, [0.0, 0.0]), "r", 0.7, 1.6)
    table = branch.to_dataframe()
    assert list(table) == ["r", "x", "y", "largest_multiplier", "unstable"]
    np.testing.assert_allclose(table["largest_multiplier"], np.maximum(table["r"], 0.5), atol=1e-8)
    assert table["unstable"].tolist() == (table["r"] > 1).astype(int).tolist()
    found = to_dataframe(branch.bifurcations)
    assert found["kind"].tolist() == ["pitchfork"]
    assert found["value"].tolist() == pytest.approx([1.0], abs=1e-9)


def test_diagrams_have_a_row_for_each_point():
    diagram = bifurcation_diagram(WELLS, "r", [1.2, 1.5], [0.4, 0.1], periods=64)
    table = diagram.to_dataframe()
    assert len(table) == 2 * 2 * 64
    chosen = table[(table["r"] == 1.5) & (table["direction"] == "down")]
    np.testing.assert_array_equal(chosen["x"], diagram.points[1, 1, :, 0])
    np.testing.assert_allclose(chosen["x"], 0.5**0.5, atol=1e-5)


def test_names_and_meanings_are_kept_apart():
    assert variable_names(["x", "x'", "x_", "points", "labels"]) == ["x", "x_", "x__", "points", "labels_"]
    assert flags({0: "a b", 1: "a  b", 2: "π"}, np.int8)["flag_meanings"] == "a_b a_b_1 pi"
    halved = discrete_map(lambda x, p: (x[0] / 2, x[1] / 2), {}, (angle("period"), "kind"))
    table = to_dataframe(find_attractors(halved, [[0.1, 0.1]]))
    assert table[["period", "period_", "kind", "kind_"]].to_numpy().tolist() == [[1, 0.0, "fixed point", 0.0]]


# --- a new record


@dataclass(frozen=True, eq=False)
class Decay(ConvertsToXarray, ConvertsToDataFrame):
    """Numbers over a parameter."""

    _layout: ClassVar = Layout(
        "Decay of {0.name}",
        {"values": Array("{parameter}", "{0.parameter}", "{parameter}")},
        {"rate": Array("{parameter}", "rate of decay", unit="1/s"), "ends": Array("{parameter}", flags=Label)}
        | {name: Array("{parameter}") for name in ("steps", "orders", "words", "errors")},
        {"bound": "upper_bound"},
    )
    _made_by: ClassVar = "decay_of"

    name: str
    parameter: str
    values: Floats
    rate: Floats
    ends: Ints
    bound: float = 1.0
    steps: tuple[float, ...] = (0.25, 1e6)
    orders: tuple[int, ...] = (70_000, -1)
    words: tuple[str, ...] = ("a", "b")
    errors: Floats | None = None
    limit: float | None = None
    sure: bool = False


DECAY = Decay("rods", "my rate", np.array([1.0, 2.0]), np.array([0.5, 0.25]), np.array([-1, -2]), 3.0)


def test_variables_attributes_and_a_table_follow():
    found = DECAY.to_xarray()
    assert found.attrs["title"] == "Decay of rods" and found.attrs["record"] == "Decay"
    assert (found.attrs["system"], found.attrs["upper_bound"], found.attrs["parameter"]) == ("rods", 3.0, "my rate")
    assert found["rate"].dims == ("my_rate",) and found["rate"].attrs == {"long_name": "rate of decay", "units": "1/s"}
    assert found["my_rate"].attrs == {"long_name": "my rate"} and "my_rate" in found.coords
    assert found["ends"].attrs["flag_values"].tolist()[0] == int(next(iter(Label)))
    assert "errors" not in found and "limit" not in found.attrs
    table = to_dataframe(DECAY)
    assert table["rate"].tolist() == [0.5, 0.25] and "errors" not in table


def test_it_is_read_by_its_types(tmp_path):
    import xarray

    again = _Read(DECAY.to_xarray()).record(Decay)
    assert (again.name, again.parameter, again.bound) == ("rods", "my rate", 3.0)
    assert again.rate.dtype == np.float64 and again.ends.tolist() == [-1, -2]
    assert (again.steps, again.orders, again.words) == (DECAY.steps, DECAY.orders, DECAY.words)
    assert (again.errors, again.limit, again.sure) == (None, None, False)
    other = replace(DECAY, errors=np.array([0.1, 0.2]), limit=2.0, sure=True)
    other.to_xarray().to_netcdf(tmp_path / "decay.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "decay.nc", engine="h5netcdf") as file:
        again = _Read(file.load()).record(Decay)
    assert (again.errors.tolist(), again.limit, again.sure, again.words) == ([0.1, 0.2], 2.0, True, ("a", "b"))
    with pytest.raises(ValueError, match="rate is int64"):
        _Read(DECAY.to_xarray().assign(rate=DECAY.to_xarray()["rate"].astype(np.int64))).record(Decay)
    with pytest.raises(ValueError, match="record='Decay': give what to_xarray"):
        from_xarray(DECAY.to_xarray())  # which is no public record
