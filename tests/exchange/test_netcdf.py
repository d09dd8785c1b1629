"""Results as labelled arrays of xarray, and through netCDF files."""

from __future__ import annotations

import json
import sys

import h5py
import numpy as np
import pytest
import xarray

import systems
from cellmap import (
    CellGrid,
    Label,
    bifurcation_diagram,
    certify,
    discrete_map,
    find_basins,
    interpolated_map,
    stability_map,
)
from cellmap.attractors.labels import LABEL_NAMES
from cellmap.basins import Evidence, continue_basins
from cellmap.bifurcations import attractor_atlas
from cellmap.exchange import to_xarray
from cellmap.exchange.conventions import flags, variable_names
from cellmap.maps import angle
from cellmap.orbits import finite_time_exponents

WINDOW = CellGrid((-1.5, -1.0), (1.5, 1.0), (12, 8))


def wells(r: float = 1.5):
    return discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3, 0.5 * x[1]), {"r": r}, ("x", "y"), "two wells")


def interpolated():
    return find_basins(interpolated_map(wells(), WINDOW, order=1, tolerance=0.3), WINDOW, max_periods=60)


CASES = {
    "basins": lambda: find_basins(wells(), WINDOW),
    "chaotic and diverged": lambda: find_basins(systems.henon_map(), CellGrid((-2, -2), (2, 2), (16, 12))),
    "no attractors": lambda: find_basins(
        discrete_map(lambda x, p: (2 * x[0], x[1]), {}, ("x", "y")), CellGrid((1, 1), (2, 2), (3, 2))
    ),
    "initial conditions": lambda: find_basins(wells(), np.random.default_rng(0).uniform(-1, 1, (4, 3, 2))),
    "one initial condition": lambda: find_basins(wells(), [0.1, 0.2]),
    "certificate": lambda: certify(interpolated()),
    "continuation": lambda: continue_basins(wells(), "r", [1.2, 1.5, 1.8], WINDOW),
    "diagram": lambda: bifurcation_diagram(wells(), "r", [1.2, 1.5, 2.8], [[0.4, 0.1], [-0.3, 0.2]], periods=64),
    "atlas": lambda: attractor_atlas(
        systems.henon_map(0.2, 0.3), ("a", [0.1, 0.2, 0.5]), ("b", [0.2, 0.3]), [[0.0, 0.0]], curves=0
    ),
    "exponents": lambda: finite_time_exponents(wells(), WINDOW, 4),
}


@pytest.mark.filterwarnings("ignore::cellmap.basins.doubts.UnsettledWarning")
@pytest.mark.parametrize("case", CASES)
def test_netcdf_gives_back_what_was_written(case, tmp_path):
    """Every value, type and attribute; xarray compares them."""
    written = CASES[case]().to_xarray()
    path = tmp_path / "result.nc"
    written.to_netcdf(path, engine="h5netcdf")
    read = xarray.open_datatree if isinstance(written, xarray.DataTree) else xarray.open_dataset
    with read(path, engine="h5netcdf") as opened:
        found = opened.load()
    pairs = [(written, found)]
    if isinstance(written, xarray.DataTree):
        pairs = [(node.to_dataset(), found[node.path].to_dataset()) for node in written.subtree]
        assert {node.path for node in found.subtree} == {"/", "/attractors"}
    for before, after in pairs:
        xarray.testing.assert_identical(before, after)
        for name, variable in before.variables.items():
            assert after[name].dtype == variable.dtype or variable.dtype.kind in "OUT", name


def test_basins_have_their_labels_where_they_belong():
    basins = find_basins(systems.henon_map(), CellGrid((-2, -2), (2, 2), (16, 12)))
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
    basins = find_basins(wells(), WINDOW)
    basins.to_xarray().to_netcdf(tmp_path / "basins.nc", engine="h5netcdf")
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
    for basins in (find_basins(wells(), WINDOW), find_basins(period_two, CellGrid((0.05, -1), (0.95, 1), (8, 6)))):
        group = basins.to_xarray()["attractors"]
        assert group["number_of_points"].attrs["sample_dimension"] == "point"
        for k, attractor in enumerate(basins.attractors):
            row = group.to_dataset().isel(attractor=k)
            own = group["points"].values[group["point_attractor"].values == k]
            np.testing.assert_array_equal(own, attractor.points)
            assert (row["label"], row["name"], row["orbit_period"]) == (k, attractor.name, attractor.period)
            assert row["count"] == basins.fractions[k].count
            np.testing.assert_array_equal(
                row["multipliers_real"] + 1j * row["multipliers_imaginary"], attractor.multipliers
            )


def test_angles_say_their_unit_period_and_branch_cut():
    rotating = discrete_map(lambda x, p: (x[0] / 2, x[1] / 2), {}, (angle("theta"), "theta'"))
    tree = find_basins(rotating, CellGrid((-np.pi, -1), (np.pi, 1), (8, 4))).to_xarray()
    assert tree["labels"].dims == ("theta", "theta_")
    assert tree["theta"].attrs == {
        "long_name": "theta", "units": "rad", "period": 2 * np.pi, "branch_cut": -np.pi,
    }  # fmt: skip
    assert tree["theta_"].attrs == {"long_name": "theta'", "units": "1"}


def test_certificates_add_the_evidence():
    certificate = certify(interpolated())
    evidence = certificate.to_xarray()["evidence"]
    np.testing.assert_array_equal(evidence, certificate.evidence)
    assert evidence.attrs["flag_values"].tolist() == list(Evidence)
    assert evidence.attrs["flag_meanings"] == "cell orbit exact open direct proved"


def test_continuations_select_by_value_and_label():
    result = continue_basins(wells(), "r", [0.8, 1.2, 1.5], WINDOW)
    tree = result.to_xarray()
    k = result.labels.index(1)
    assert tree["fractions"].sel(r=1.5, label=1) == result.fractions[2, k]
    group = tree["attractors"].to_dataset()
    assert group.sizes["attractor"] == sum(map(len, result.attractors))
    place = ((group["parameter_value"] == 1.5) & (group["label"] == 1)).values.argmax()
    # Fixed points of r x - x^3 are 0 and the roots of r - 1.
    assert abs(group["points"].values[group["point_attractor"] == place][0, 0]) == pytest.approx(0.5**0.5, abs=1e-9)


def test_diagrams_have_a_variable_for_each_state_variable():
    result = bifurcation_diagram(wells(), "r", [1.2, 1.5, 2.8], [0.4, 0.1], periods=64)
    found = result.to_xarray()
    assert found["x"].dims == ("branch", "r", "step")
    np.testing.assert_array_equal(found["y"], result.points[..., 1])
    assert found["orbit_period"].sel(r=1.5).values.tolist() == [1, 1]
    assert found["direction"].values.tolist() == ["up", "down"]


def test_stability_maps_have_the_parameters_as_coordinates(tmp_path):
    result = stability_map(
        systems.dimensionless_pendulum(gamma=0.3), (0.0, 0.0), ("alpha", [0.1, 0.2, 0.3]), ("beta", [0.1, 0.2, 0.25])
    )
    found = result.to_xarray()
    assert found["largest"].dims == ("beta", "alpha")
    assert found["largest"].sel(alpha=0.2, beta=0.25) == result.largest[2, 1]
    boundary = found["boundary_alpha"].values[found["refined"].values == 0]
    np.testing.assert_array_equal(boundary, result.rows.x)
    found.to_netcdf(tmp_path / "stability.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "stability.nc", engine="h5netcdf") as read:
        xarray.testing.assert_identical(read.load(), found)


def test_names_and_meanings_are_different():
    assert variable_names(["x", "x'", "x_", "points", "labels"]) == ["x", "x_", "x__", "points", "labels_"]
    assert flags({0: "a b", 1: "a  b", 2: "π"}, np.int8)["flag_meanings"] == "a_b a_b_1 pi"


def test_other_results_are_refused():
    with pytest.raises(TypeError, match=r"^result=3: give Basins"):
        to_xarray(3)


def test_without_xarray_the_error_names_the_extra(monkeypatch):
    basins = find_basins(wells(), WINDOW)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'cellmap-dynamics\[xarray\]'"):
        basins.to_xarray()
