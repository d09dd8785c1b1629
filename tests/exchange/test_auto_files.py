"""Files in AUTO's format: read again by fixed columns, as AUTO reads them."""

from __future__ import annotations

from math import cos, pi
from pathlib import Path

import numpy as np
import pytest

from cellmap import ForcedSystem, continue_orbit, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import continue_bifurcation
from cellmap.exchange import save_auto
from systems import henon_map


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


def test_a_branch_and_a_curve(tmp_path: Path) -> None:
    exact = henon_map(0.2, 0.3)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.5, 0.2]), "a", -0.2, 0.6, step=0.05)
    flip = branch.bifurcations[-1]
    curve = continue_bifurcation(branch, flip, "b", (0.0, 1.4), (-0.5, 0.5), step=0.05)
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


def test_norms_and_maxima_over_the_period(tmp_path: Path) -> None:
    # x'' + b x' + 4 x = cos(t): x = A cos(t - phi), A^2 = 1 / (9 + b^2), for x and v together a norm of A.
    linear = ForcedSystem(lambda t, x, p: (x[1], cos(t) - 4.0 * x[0] - p.b * x[1]), {"b": 0.5}, 2.0 * pi, ("x", "v"))
    exact = stroboscopic_map(linear, rtol=1e-12, atol=1e-12)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.0, 0.0]), "b", 0.1, 1.0, step=0.1)
    ((names, rows),) = read(save_auto(branch, tmp_path / "b.linear", measures=True)).values()
    assert names == ["b", "L2-NORM", "MAX_x", "MAX_v"]
    for column in rows.T[4:]:
        np.testing.assert_allclose(column, 1.0 / np.sqrt(9.0 + rows[:, 3] ** 2), rtol=1e-9)
    henon = henon_map(0.2, 0.3)
    branch = continue_orbit(henon, periodic_orbit(henon, [0.5, 0.2]), "a", -0.2, 0.6, step=0.1)
    curve = continue_bifurcation(branch, branch.bifurcations[-1], "b", (0.0, 1.4), (-0.5, 0.5), step=0.1)
    ((names, rows),) = read(save_auto(curve, tmp_path / "b.henon", measures=True)).values()
    assert names == ["a", "L2-NORM", "MAX_x", "MAX_y", "b"]
    np.testing.assert_allclose(rows[:, 5:7], curve.points, rtol=1e-9)


def test_the_same_as_labelled_arrays() -> None:
    pytest.importorskip("xarray")
    exact = henon_map(0.2, 0.3)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.5, 0.2]), "a", -0.2, 0.6, step=0.05)
    curve = continue_bifurcation(branch, branch.bifurcations[-1], "b", (0.0, 1.4), (-0.5, 0.5), step=0.05)
    np.testing.assert_array_equal(branch.to_xarray()["a"], branch.values)
    assert list(branch.to_xarray().data_vars) == list(branch.to_dataframe().columns)
    labelled = curve.to_xarray()
    np.testing.assert_array_equal(np.column_stack([labelled["a"], labelled["b"]]), curve.values)
    assert labelled.attrs["ends"] == ", ".join(curve.ends)


def test_other_things_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="give a Branch"):
        save_auto([], tmp_path / "b.nothing")
