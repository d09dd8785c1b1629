"""Error ellipsoids of certificates, and the cells that they reach."""

import dataclasses
from math import sin

import numpy as np
import pytest
from scipy.ndimage import correlate1d, maximum_filter, minimum_filter
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import shortest_path

from cellmap import CellGrid, ForcedSystem, discrete_map, interpolated_map, stroboscopic_map
from cellmap._compiled.kernels.cell_errors import Bounds, Given, bounding, curve
from cellmap._compiled.kernels.cell_images import SEVERAL, reach_ends
from cellmap._compiled.kernels.certainty import carry_rows
from cellmap.basins.certification.table_errors import TableErrors, has_power_series, slopes_of, tolerance_in_cells
from systems import henon_map, two_well_duffing


def test_error_ellipsoids_hold_all_errors():
    rng = np.random.default_rng(3)
    for d in (1, 2, 3):
        for _ in range(50):
            root, slope, radius = rng.normal(size=(d, d)), rng.normal(size=(d, d)), abs(rng.normal())
            spread = root @ root.T
            errors = _directions(rng, 200, d) @ np.linalg.cholesky(spread).T @ slope.T
            errors += radius * _directions(rng, 200, d)
            carry_rows(spread[None], slope[None], np.array([radius]))
            sizes = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(spread), errors)
            assert sizes.max() <= 1.0 + 1e-9


def _directions(rng, number, d):
    vectors = rng.normal(size=(number, d))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_reach_of_cells_by_a_graph(seed, wraps):
    rng = np.random.default_rng(seed)
    cells = np.array([7, 9])
    n = int(cells.prod())
    circle = np.where(wraps, cells * 1.0, 0.0)
    first = rng.integers(-2, 9, (n, 2))
    last = first + rng.integers(0, 3, (n, 2))
    ends = np.zeros(n, np.int16)
    fixed = np.zeros(n, bool)
    for end, cell in ((1, 5), (2, 40)):
        ends[cell], fixed[cell] = end, True
    expected = _reach_by_graph(ends, fixed, first, last, cells, wraps, 3)
    reach_ends(ends, fixed, first.astype(np.int32), last.astype(np.int32), cells, circle, 3)
    np.testing.assert_array_equal(ends, expected)


def _reach_by_graph(ends, fixed, first, last, cells, wraps, beyond):
    n = len(ends)
    links = np.zeros((n + 1, n + 1), bool)  # the last node is the outside
    for c in np.flatnonzero(~fixed):
        for i in range(first[c, 0], last[c, 0] + 1):
            for j in range(first[c, 1], last[c, 1] + 1):
                place = [k % m if w else k for k, m, w in zip((i, j), cells, wraps, strict=True)]
                inside = all(0 <= k < m for k, m in zip(place, cells, strict=True))
                links[c, place[0] * cells[1] + place[1] if inside else n] = True
    reached = np.isfinite(shortest_path(csr_matrix(links), unweighted=True))
    own = np.append(ends, beyond)
    found = [set(own[reached[c]].tolist()) - {0} for c in range(n)]
    return np.array([SEVERAL if len(f) > 1 else max(f, default=0) for f in found])


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (False, True)])
def test_bounds_of_cells_by_maximum_filters(wraps):
    """SciPy's filters over the same neighbourhoods say the same, NaN left out."""
    rng = np.random.default_rng(5)
    cells, d, n = np.array([6, 9]), 2, 54
    slopes, indicator = rng.normal(size=(*cells, d, d)), rng.random(tuple(cells)).astype(np.float32)
    slopes[2, 3] = np.nan
    images, rough = rng.normal(size=(n, d)), rng.random(tuple(cells)) < 0.1
    widths = np.array([0.5, 0.25])
    rows = slopes.reshape(6, -1)
    curved, bends = np.empty(rows.shape), np.empty((n, 2))
    errors, tolerances, estimates = np.empty(n), np.empty(n), np.empty(n)
    curve(rows, cells, np.array(wraps), 0, 6, curved)
    table = (np.zeros(2), widths, cells, np.array(wraps))
    numbers = (4.0, 1e9, 1e-8, 1e-9)
    given, found = Given(rows, curved, images, indicator, rough), Bounds(bends, errors, tolerances, estimates)
    bounding(d)(table, given, numbers, 0, 6, found)
    modes = ["wrap" if w else "nearest" for w in wraps]
    change, bent = np.zeros(cells), np.zeros(cells)
    for i, k in np.ndindex(d, d):
        own = slopes[..., i, k]
        known = np.where(np.isnan(own), -np.inf, own), np.where(np.isnan(own), np.inf, own)
        high, low = maximum_filter(known[0], 3, mode=modes), minimum_filter(known[1], 3, mode=modes)
        change += np.maximum(high - own, own - low) ** 2
        line = sum(np.abs(correlate1d(own, [1, -2, 1], axis=j, mode=modes[j])) / 8 for j in range(d))
        bent += maximum_filter(np.where(np.isnan(line), 0.0, line), 3, mode=modes) ** 2
    clear = ~np.isnan(change.ravel())
    np.testing.assert_allclose(bends[clear, 0], np.sqrt(change).ravel()[clear], rtol=1e-13)
    np.testing.assert_allclose(bends[clear, 1], 2 * np.sqrt(bent).ravel()[clear], rtol=1e-13)
    tolerance = ((1e-9 + 1e-8 * np.abs(images * widths)) / widths).max(axis=1)
    error = 4.0 * maximum_filter(indicator.astype(float), 3, mode=modes).ravel() + tolerance
    np.testing.assert_allclose(estimates, error, rtol=1e-12)
    np.testing.assert_allclose(errors, np.where(clear & ~rough.ravel(), error, np.inf), rtol=1e-12)
    np.testing.assert_allclose(tolerances, np.where(clear, tolerance, np.inf), rtol=1e-12)


def test_slopes_and_bends_of_a_quadratic_map():
    """Differences of a polynomial of degree two are exact: f(x + h) - 2 f(x) + f(x - h) = h^2 f''."""
    a, b, c, e = 0.7, -0.4, 0.3, 0.9
    quadratic = discrete_map(
        lambda x, p: (a * x[0] ** 2 + e * x[1] ** 2, b * x[1] ** 2 + c * x[0] * x[1]), {}, ("x", "y")
    )
    points = np.random.default_rng(0).uniform(-1, 1, (20, 2))
    x, y = points.T
    widths, steps = np.array([0.5, 0.125]), np.linspace(0.1, 0.4, 20)
    slopes, bends = slopes_of(quadratic, points, widths, steps)
    derivatives = np.array([[2 * a * x, 2 * e * y], [c * y, c * x + 2 * b * y]]).transpose(2, 0, 1)
    np.testing.assert_allclose(slopes, derivatives * widths / widths[:, None], rtol=1e-11, atol=1e-12)
    # Along x only the first image bends, along y both.
    second = (
        np.array([[2 * a * widths[0] ** 2, 2 * e * widths[1] ** 2], [0.0, 2 * b * widths[1] ** 2]]) / widths[:, None]
    )
    np.testing.assert_allclose(bends, steps * np.linalg.norm(second), rtol=1e-11)


def test_tolerances_are_those_of_the_worst_coordinate():
    """(atol + rtol abs(x)) / width, by hand: 0.003 / 0.5 = 0.006 against 0.021 / 3 = 0.007, and 0.021 / 0.5 = 0.042."""
    exact = dataclasses.replace(henon_map(), tolerance=(0.01, 0.001))
    grid = CellGrid((0.0, 0.0), (5.0, 30.0), (10, 10))
    found = tolerance_in_cells(exact, np.array([[0.2, -2.0], [2.0, 2.0]]), grid)
    np.testing.assert_allclose(found, [0.007, 0.042], rtol=1e-14)


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_derivatives_in_smooth_fallback_cells():
    """Those between the centres are off by less than the bound, against differences of the exact map."""
    exact, n = stroboscopic_map(two_well_duffing()), 60
    icm = interpolated_map(exact, CellGrid((-2.9, -2.9), (2.9, 2.9), (n, n)), outside="integrate")
    bounds, grid = TableErrors.of(icm, 4.0, False), icm.table.grid
    smooth = np.flatnonzero(icm.table.fallback.ravel() & np.isfinite(bounds.of_orbits))
    assert len(smooth) > n * n // 3
    rng = np.random.default_rng(0)
    cells = rng.choice(smooth, 1000)
    place = np.stack(np.unravel_index(cells, grid.shape), -1) + rng.uniform(size=(1000, 2))
    exactly, _ = slopes_of(exact, grid.lower + place * grid.widths, grid.widths, np.full(1000, 1e-4))
    low = np.clip(np.floor(place - 0.5), 0, n - 2).astype(int)
    (u, v), (i, j) = (place - 0.5 - low).T[:, :, None, None], low.T
    slopes = bounds.slopes.reshape(n, n, 2, 2)
    between = (1 - u) * ((1 - v) * slopes[i, j] + v * slopes[i, j + 1])
    between += u * ((1 - v) * slopes[i + 1, j] + v * slopes[i + 1, j + 1])
    errors = np.linalg.norm(between - exactly, axis=(1, 2))
    assert (errors <= bounds.bends[cells, 1]).all()
    np.testing.assert_array_equal(bounds.of_orbits[cells], bounds.tolerances[cells])
    np.testing.assert_array_equal(bounds.errors[cells], bounds.estimates[cells])


def test_kinks_have_no_derivatives_from_the_table():
    for rhs, smooth in ((lambda t, x, p: (x[1], -abs(x[0])), False), (lambda t, x, p: (x[1], -sin(x[0])), True)):
        assert has_power_series(stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("x", "v")))) == smooth
    assert not has_power_series(henon_map())
