"""Branches and curves through netCDF files and in AUTO's format, and restarts at their points."""

from math import cos, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, continue_orbit, discrete_map, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import (
    BifurcationCurve,
    BifurcationKind,
    Branch,
    OrbitFunction,
    continue_bifurcation,
    switch_branch,
)
from cellmap.exchange import from_xarray, save_auto, to_dataframe, to_xarray
from cellmap.maps import Impact
from systems import henon_map


@pytest.fixture(scope="module")
def branch() -> Branch:
    exact = henon_map(0.2, 0.3)
    return continue_orbit(exact, periodic_orbit(exact, [0.5, 0.2]), "a", -0.2, 0.6, step=0.02, max_points=150)


def through_a_file(result: Any, path: Path, point_map: Any) -> Any:
    import xarray

    result.to_xarray().to_netcdf(path, engine="h5netcdf")
    with xarray.open_dataset(path, engine="h5netcdf") as read:
        return from_xarray(read.load(), point_map)


def same(one: Any, other: Any) -> None:
    for name in ("values", "points", "multipliers"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.ends == other.ends and one.period == other.period


@pytest.mark.thorough
def test_a_branch_that_ends_at_grazing_returns_from_a_file(tmp_path: Path) -> None:
    """Beside grazing one multiplier is as large as one likes, and at it there is none."""
    wall = Impact(lambda t, x, p: 1.0 - x[0], lambda t, x, p: (x[0], -0.8 * x[1]))

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], p.F * cos(0.7 * t) - 0.1 * x[1] - x[0]

    struck = ForcedSystem(rhs, {"F": 0.53}, 2 * pi / 0.7, ("x", "v"), impacts=[wall])
    exact = stroboscopic_map(struck, rtol=1e-11, atol=1e-11)
    branch = continue_orbit(exact, periodic_orbit(exact, exact.iterate([0.2, 0.3], 400).points), "F", 0.5, 0.53, 0.1)
    assert branch.ends == ("grazing", "left the interval")
    same(through_a_file(branch, tmp_path / "branch.nc", exact), branch)
    with pytest.raises(ValueError, match="give the map of the branch"):
        from_xarray(branch.to_xarray(), stroboscopic_map(struck.with_params(F=0.5), phase=0.1))


def test_a_branch_from_a_file_is_continued_as_before(branch: Branch, tmp_path: Path) -> None:
    read = through_a_file(branch, tmp_path / "branch.nc", henon_map())
    same(read, branch)
    assert repr(read) == repr(branch) and read.point_map.params == branch.point_map.params
    for one, other in zip(read.bifurcations, branch.bifurcations, strict=True):
        assert repr(one) == repr(other)
        np.testing.assert_array_equal(one.multipliers, other.multipliers)
        assert one.normal_form.coefficient == other.normal_form.coefficient
    box = (-0.2, 0.6), (0.2, 0.4)
    flip, again = branch.bifurcations[-1], read.bifurcations[-1]
    curve = continue_bifurcation(branch, flip, "b", *box, step=0.2)
    same(continue_bifurcation(read, again, "b", *box, step=0.2), curve)
    same(switch_branch(read, again, -0.2, 0.6, step=0.1), switch_branch(branch, flip, -0.2, 0.6, step=0.1))
    np.testing.assert_array_equal(read.orbits_at(0.5)[0].points, branch.orbits_at(0.5)[0].points)
    zero = {"x": lambda t, x, p: x[0] - 1.0}
    assert repr(read.with_zeros(zero).zeros) == repr(branch.with_zeros(zero).zeros)
    second = through_a_file(curve, tmp_path / "curve.nc", henon_map())
    same(second, curve)
    assert second.codimension_two() == curve.codimension_two() == ()


@pytest.mark.thorough
def test_orbits_in_segments_from_a_file(tmp_path: Path) -> None:
    # The orbit of period two of 1 - a x^2 has the multiplier 4 (1 - a).
    steep = discrete_map(lambda x, p: (1.0 - p.a * x[0] ** 2,), {"a": 1e5}, ("x",))
    root = np.sqrt(4e5 - 3.0)
    branch = continue_orbit(steep, periodic_orbit(steep, [(1.0 + root) / 2e5], 2), "a", 1e5, 1e6)
    assert len(branch._parts) == 3
    read = through_a_file(branch, tmp_path / "steep.nc", steep)
    same(read, branch)
    np.testing.assert_allclose(read.multipliers[:, 0], 4.0 * (1.0 - read.values), rtol=1e-9)
    (orbit,) = read.orbits_at(8e5)
    assert orbit.multipliers[0].real == pytest.approx(4.0 * (1.0 - 8e5), rel=1e-9)
    assert read.orbit(len(read.values) - 1).params["a"] == 1e6


def test_restarts_at_points_of_branches_and_curves(branch: Branch) -> None:
    exact = henon_map()
    fold, flip = branch.of_kind(BifurcationKind.FOLD)[0], branch.of_kind(BifurcationKind.PERIOD_DOUBLING)[-1]
    # Folds at a = -(1 - b)^2 / 4, period doublings at a = 3/4 (1 - b)^2: in b at the same places.
    for start in (fold, flip):
        other = continue_orbit(exact, start, "b", 0.0, 0.9, step=0.05)
        here = [b for b in other.of_kind(start.kind) if abs(b.value - 0.3) < 1e-8]
        assert len(here) == 1 and other.point_map.params["a"] == pytest.approx(start.value)
    curve = continue_bifurcation(branch, flip, "b", (-0.2, 4.0), (-1.5, 0.9), step=0.1)
    point = curve.codimension_two()[0]  # the 1:2 resonance at a = 3, b = -1
    assert point.orbit.params == pytest.approx({"a": 3.0, "b": -1.0})
    other = continue_orbit(exact, point, "a", 2.5, 3.5, step=0.05)
    assert other.values[0] == 2.5 and other.values[-1] == 3.5
    orbit = curve.orbit(4)
    a, b = orbit.params["a"], orbit.params["b"]
    assert (a, b) == tuple(curve.values[4])
    along = continue_orbit(exact.with_params(**orbit.params), orbit, "b", b - 0.1, b + 0.1, step=0.05)
    assert [k.value for k in along.of_kind(BifurcationKind.PERIOD_DOUBLING)] == pytest.approx([b], abs=1e-9)
    np.testing.assert_array_equal(branch.orbit(0).points[0], branch.points[0])


def test_what_cannot_be_made_again_says_so(branch: Branch) -> None:
    (zero,) = branch.with_zeros({"x": lambda t, x, p: x[0] - 1.0}).zeros
    curve = continue_bifurcation(branch, zero, "b", (-0.2, 0.6), (0.2, 0.4), step=0.1)
    # x = 1 - a x^2 + b x at x = 1.
    np.testing.assert_allclose(curve.values[:, 0], curve.values[:, 1], rtol=1e-12)
    with pytest.raises(ValueError, match=r"^result=.*curves of functions .* are not written"):
        to_xarray(curve)
    with pytest.raises(ValueError, match="place=1000"):
        branch.orbit(1000)


def drift(at: Any, **params: float) -> Any:
    return discrete_map(lambda x, p: (at(x[0], p[0]),), params or {"q": 0.25}, ("x",))


@pytest.mark.parametrize(
    ("other", "says"),
    [  # orbits x^2 = q with multipliers 1 - 2 x
        (
            drift(lambda x, q: x + q - 2.0 * x**2 - 0.1 * x),
            r".*no orbit of it; at q=.* fails to close by.*: give the map",
        ),
        (drift(lambda x, q: x + 0.5 * (q - x**2)), r".*multipliers \[.*: give the map"),
        (drift(lambda x, q: x + 1e3), r".*no orbit of it; at q=.* fails to close by.*: give the map"),
        (henon_map(), ".*it has other state variables than"),
        (drift(lambda x, r: x + r - x**2, r=0.25), ".*it has other parameters than"),
        (None, "None: give the map"),
    ],
    ids=["other orbits", "other multipliers", "no orbit", "other variables", "other parameters", "none"],
)
def test_another_map_is_refused(other: Any, says: str) -> None:
    exact = drift(lambda x, q: x + q - x**2)
    roots = continue_orbit(exact, periodic_orbit(exact, [0.5]), "q", 0.1, 0.8, step=0.1)
    with pytest.raises(ValueError, match=f"^point_map={says}"):
        from_xarray(roots.to_xarray(), other)


@pytest.mark.parametrize("name", ["bifurcations", "scale_0", "unknowns_0", "bifurcation_kinds", "multipliers"])
def test_damaged_datasets_are_refused(branch: Branch, name: str) -> None:
    whole = branch.to_xarray()
    with pytest.raises(ValueError, match="tree"):
        from_xarray(whole.drop_vars(name), henon_map())
    if whole[name].dtype == float:
        altered = whole.assign_coords({name: whole[name] * (1.0 + 1e-9)})
        with pytest.raises(ValueError, match="tree has another"):
            from_xarray(altered, henon_map())


def test_zeros_of_named_quantities_come_back(branch: Branch) -> None:
    # The fixed point x = 1 - a x^2 + b x has x = 1 at a = b.
    named = {"one": OrbitFunction("x", value=1.0), "two": OrbitFunction(0, "mean", 1.2), "top": OrbitFunction("y")}
    found = branch.with_zeros({**named, "own": lambda t, x, p: x[0] - 1.1})
    assert {z.name for z in found.zeros} == {"one", "two", "own"}
    with pytest.warns(UserWarning, match=r"functions \['own'\] are left out.*with_zeros"):
        tree = found.to_xarray()
    with pytest.warns(UserWarning, match=r"functions \['own'\] were not written.*with_zeros"):
        read = from_xarray(tree, henon_map())
    mine = [z for z in found.zeros if z.name != "own"]
    assert [repr(z) for z in read.zeros] == [repr(z) for z in mine] != []
    assert [z.function for z in read.zeros] == [z.function for z in mine]
    (one,) = [z for z in read.zeros if z.name == "one"]
    assert one.value == pytest.approx(0.3, abs=1e-12)
    curve = continue_bifurcation(branch, branch.bifurcations[-1], "b", (-0.2, 0.9), (-0.2, 0.9), step=0.1)
    # The period doubling at a = 3/4 (1 - b)^2 has x = (1 - b) / (2 a) = 2 / (3 (1 - b)), which is 1 at b = 1/3.
    (zero,) = from_xarray(curve.with_zeros({"x": OrbitFunction("x", value=1.0)}).to_xarray(), henon_map()).zeros
    np.testing.assert_allclose(zero.values, [1.0 / 3.0, 1.0 / 3.0], rtol=1e-10)


@pytest.mark.parametrize("name", ["x", "a", "unstable", "largest_multiplier"])
def test_functions_with_the_names_of_columns_are_refused(branch: Branch, name: str) -> None:
    for convert in (branch.to_dataframe, branch.to_xarray):
        with pytest.raises(ValueError, match=rf"^functions\['{name}'\]: '{name}' is already there"):
            convert({name: OrbitFunction("y")})
    with pytest.raises(ValueError, match=r"^functions\['point'\]"):
        branch.to_xarray({"point": 0})


# --- files in AUTO's format, read again by fixed columns, as AUTO reads them


def read(path: Path) -> dict[int, tuple[list[str], np.ndarray]]:
    """Return the names of the columns and the rows (point, type, label, values) of each branch of a file."""
    names: list[str] = []
    found: dict[int, tuple[list[str], list[list[float]]]] = {}
    for line in path.read_text().splitlines():
        number = int(line[:4])
        if not number:
            names = line[20:].split() if line[4:].split()[0] == "PT" else names
            continue
        head = [float(line[4:10]), float(line[10:14]), float(line[14:19])]
        values = [float(line[k : k + 19]) for k in range(19, len(line), 19)]
        found.setdefault(number, (names, []))[1].append(head + values)
    return {number: (columns, np.array(rows)) for number, (columns, rows) in found.items()}


@pytest.fixture(scope="module")
def curve(branch: Branch) -> BifurcationCurve:
    return continue_bifurcation(branch, branch.bifurcations[-1], "b", (0.0, 1.4), (-0.5, 0.5), step=0.05)


def test_a_branch_and_a_curve(branch: Branch, curve: BifurcationCurve, tmp_path: Path) -> None:
    path = save_auto([branch, curve], tmp_path / "b.henon")
    (names, rows), (others, points) = read(path).values()
    assert names == ["a", "L2-NORM", "x", "y"]
    assert others == ["a", "L2-NORM", "x", "y", "b"]
    assert len(rows) == len(branch.values) + len(branch.bifurcations)
    point, kind, label, value = rows.T[:4]
    np.testing.assert_array_equal(np.abs(point), np.arange(1, len(rows) + 1))
    special = np.flatnonzero(kind)
    np.testing.assert_array_equal(label[special], np.arange(1, len(special) + 1))
    (doubling,) = np.flatnonzero(kind == 7)
    np.testing.assert_allclose(value[doubling], 0.75 * 0.7**2, rtol=1e-10)
    np.testing.assert_array_equal(point[rows[:, 3] > 0.37] > 0, True)
    assert (point[(value > 0.0) & (value < 0.36) & (rows[:, 5] > 0.0)] < 0).all()
    assert kind[0] == kind[-1] == 9
    np.testing.assert_allclose(rows[:, 4], np.hypot(rows[:, 5], rows[:, 6]), rtol=1e-9)
    np.testing.assert_allclose(points[:, 3], 0.75 * (1.0 - points[:, -1]) ** 2, rtol=1e-9, atol=1e-9)


def test_a_torus_bifurcation_has_autos_number(tmp_path: Path) -> None:
    """The delayed logistic map at a = 2: TR is 8 (AUTO's manual)."""
    delayed = discrete_map(lambda x, p: (p.a * x[0] * (1 - x[1]), x[0]), {"a": 1.9}, ("x", "y"))
    swept = continue_orbit(delayed, periodic_orbit(delayed, [0.47, 0.47]), "a", 1.8, 2.1, step=0.1)
    ((_, rows),) = read(save_auto(swept, tmp_path / "b.delayed")).values()
    (torus,) = rows[rows[:, 1] == 8]
    assert torus[3] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.thorough
def test_norms_and_maxima_over_the_period(curve: BifurcationCurve, tmp_path: Path) -> None:
    # x'' + b x' + 4 x = cos(t): x = A cos(t - phi), A^2 = 1 / (9 + b^2), for x and v together a norm of A.
    linear = ForcedSystem(lambda t, x, p: (x[1], cos(t) - 4.0 * x[0] - p.b * x[1]), {"b": 0.5}, 2.0 * pi, ("x", "v"))
    exact = stroboscopic_map(linear, rtol=1e-12, atol=1e-12)
    swept = continue_orbit(exact, periodic_orbit(exact, [0.0, 0.0]), "b", 0.1, 1.0, step=0.1)
    ((names, rows),) = read(save_auto(swept, tmp_path / "b.linear", measures=True)).values()
    assert names == ["b", "L2-NORM", "MAX_x", "MAX_v"]
    for column in rows.T[4:]:
        np.testing.assert_allclose(column, 1.0 / np.sqrt(9.0 + rows[:, 3] ** 2), rtol=1e-9)
    ((names, rows),) = read(save_auto(curve, tmp_path / "b.henon", measures=True)).values()
    assert names == ["a", "L2-NORM", "MAX_x", "MAX_y", "b"]
    np.testing.assert_allclose(rows[:, 5:7], curve.points, rtol=1e-9)


def test_the_same_as_labelled_arrays(branch: Branch, curve: BifurcationCurve, tmp_path: Path) -> None:
    np.testing.assert_array_equal(branch.to_xarray()["a"], branch.values)
    assert list(branch.to_xarray().data_vars) == list(branch.to_dataframe().columns)
    labelled = curve.to_xarray()
    np.testing.assert_array_equal(np.column_stack([labelled["a"], labelled["b"]]), curve.values)
    assert (labelled.attrs["ends"], labelled.attrs["bifurcation_count"]) == (", ".join(curve.ends), 0)
    table = to_dataframe(curve)
    np.testing.assert_allclose(table["largest_multiplier"], 1.0, rtol=1e-9)
    np.testing.assert_allclose(np.abs(table["argument"]), pi)  # of the multiplier -1
    with pytest.raises(TypeError, match="give a Branch"):
        save_auto([], tmp_path / "b.nothing")
