"""Tables over a parameter: against exact images, with bounds that hold, and refused where polynomials do not serve."""

from math import cos, pi, sin

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, PointMap, angle, discrete_map, interpolated_map, stroboscopic_map
from cellmap.maps.coordinates import difference
from cellmap.maps.interpolation.drafts import draft_of, examined
from cellmap.maps.interpolation.interpolated import Interpolated
from cellmap.maps.interpolation.over_parameter import Chebyshev, tables_over

GRID = CellGrid((-pi, -2.0), (pi, 2.0), (48, 40))


def rotor(x, p):
    y = 0.7 * x[1] + p.k * sin(x[0])
    return x[0] + y + p.turns, y


def oscillator(t, x, p):
    return x[1], x[0] - x[0] ** 3 - p.damping * x[1] + 0.1 * cos(p.speed * t)


def table(function=rotor, grid=GRID, **options):
    exact = discrete_map(function, {"k": 0.5, "turns": 0.0}, (angle("theta"), "y"))
    return interpolated_map(exact, grid, **options)


def errors(point_map, points):
    """Return the distances between images and exact images."""
    return np.abs(difference(point_map(points), point_map.exact(points), point_map.coordinates))


def points_in(grid, number=500):
    return np.random.default_rng(1).uniform(grid.lower, grid.upper, (number, grid.dimension))


@pytest.mark.parametrize("number", [5, 9])
def test_polynomials_are_exact_and_the_next_degree_errs_as_is_foreseen(number: int) -> None:
    """Of t^number at the nodes the error is the product of the distances from them."""
    nodes = Chebyshev(2.0, 5.0, number)
    values = np.array([2.0, 2.3, 3.7, 4.9, 5.0])
    for degree in range(number):
        found = [nodes.factors(value) @ nodes.nodes**degree for value in values]
        np.testing.assert_allclose(found, values**degree, rtol=1e-13)
    checked = np.array([2.2, 4.0])
    missed = np.array([abs(nodes.factors(v) @ nodes.nodes**number - v**number) for v in checked])
    everywhere = np.linspace(2.0, 5.0, 1001)
    largest = max(abs(nodes.factors(v) @ nodes.nodes**number - v**number) for v in everywhere)
    np.testing.assert_allclose(missed * nodes.scales(checked), largest, rtol=1e-6)


@pytest.mark.parametrize("interval", [(0.45, 0.55), (0.2, 1.2)])
def test_combined_tables_against_exact_images_and_their_own_bound(interval: tuple[float, float]) -> None:
    icm = table()
    tables = tables_over(icm.spec, "k", interval, 50)
    assert tables is not None
    points = points_in(GRID)
    for value in np.linspace(*interval, 7)[:-1] + 0.011:
        made, own = tables.at(value), icm.with_params(k=value)
        assert made.params["k"] == own.params["k"] == value
        assert made.spec.recipe == own.spec.recipe
        assert errors(made, points).max() < 1.05 * errors(own, points).max() + 1e-9
        # The bound of a cell holds, and is that of the value's own table but for factors and the parameter.
        bound = made.table.indicator.ravel()[GRID.locate(points)]
        assert (errors(made, points) / GRID.widths <= 1.5 * bound[:, None] + 1e-13).all()
        assert made.table.indicator.max() < 3.0 * own.table.indicator.max() + 1e-7
        assert np.abs(made.table.coefficients - own.table.coefficients).max() < 1e-7 * GRID.widths.min()


def test_images_that_go_around_several_times() -> None:
    """Over the interval the angle makes more than six full rotations: unwrapped images are a straight line."""
    icm = table()
    tables = tables_over(icm.spec, "turns", (0.0, 41.0), 50)
    assert tables is not None and tables.nodes.number == 5
    points = points_in(GRID)
    for value in (0.3, 17.0, 38.6):
        made, own = tables.at(value), icm.with_params(turns=value)
        np.testing.assert_allclose(errors(made, points), errors(own, points), atol=1e-12)
        images, exact = made.iterate(points, 1), made.exact.iterate(points, 1)
        assert np.array_equal(images.rotations, exact.rotations)


def test_a_flow_whose_period_depends_on_the_parameter() -> None:
    system = ForcedSystem(oscillator, {"damping": 0.2, "speed": 1.0}, lambda p: 2 * pi / p.speed, ("q", "v"))
    grid = CellGrid((-1.5, -1.5), (1.5, 1.5), (48, 48))
    icm = interpolated_map(stroboscopic_map(system), grid, tolerance=1e-2)
    points = points_in(grid)
    for name, interval in (("speed", (1.0, 1.02)), ("damping", (0.2, 0.22))):
        tables = tables_over(icm.spec, name, interval, 50)
        assert tables is not None
        value = sum(interval) / 2 + 0.003
        made, own = tables.at(value), icm.with_params(**{name: value})
        assert made.period == own.period
        usual = ~(own.table.fallback | made.table.fallback).ravel()[grid.locate(points)]
        shift = np.abs(made(points) - own(points))[usual]
        assert usual.any() and shift.max() < 1e-5  # a thousandth of the tolerance of cells


def jumping(x, p):
    y = 0.7 * x[1] + (p.k if p.k < 0.5 else p.k + 0.1) * sin(x[0])
    return x[0] + y, y


def kinked(x, p):
    y = 0.7 * x[1] + 0.3 * abs(x[1] - p.k)
    return x[0] + y, y


def escaping(x, p):
    y = 0.7 * x[1] + p.k * sin(x[0])
    return x[0] + y, y + (x[1] - p.k) ** 0.5


def bounded(x, p):
    y = 0.7 * x[1] + (0.6 - p.k) ** 0.5 * sin(x[0])
    return x[0] + y, y


@pytest.mark.parametrize("function", [jumping, kinked, escaping])
@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells")
def test_what_no_polynomial_approximates_is_refused(function) -> None:
    assert tables_over(table(function).spec, "k", (0.3, 0.7), 50) is None


def test_what_is_not_worthwhile_is_refused() -> None:
    icm = table()
    assert tables_over(icm.spec, "k", (0.4, 0.6), 15) is None
    assert tables_over(icm.spec, "k", (0.4, 0.4), 50) is None
    tables, own = tables_over(icm.spec, "k", (0.4, 0.6), 16), icm.with_params(k=0.6)
    assert tables.at(0.6).table.coefficients.tobytes() == own.table.coefficients.tobytes()  # at a node
    # The map has no images beyond 0.6: there is none at the nodes.
    assert tables_over(table(bounded).spec, "k", (0.3, 0.7), 50) is None


def test_cells_of_a_kink_that_stays_are_evaluated_with_the_exact_map() -> None:
    def bent(x, p):
        y = p.k * x[1] + 0.3 * abs(x[1])
        return x[0] + y, y

    icm = table(bent)
    tables = tables_over(icm.spec, "k", (0.3, 0.5), 50)
    assert tables is not None
    made, own = tables.at(0.37), icm.with_params(k=0.37)
    assert own.table.fallback.any()
    assert not (own.table.fallback & ~made.table.fallback).any()
    assert made.table.fallback.mean() < 1.15 * own.table.fallback.mean() + 0.02


def forced(t, x, p):
    return x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + 0.1 * cos(t)


def kinked_force(t, x, p):
    return x[1], -x[0] - 0.2 * x[1] - (3.0 * x[0] if x[0] > 0.0 else 0.0) + 0.1 * cos(t)


def table_of(rhs, max_step: int = 1) -> PointMap:
    exact = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("q", "v")), rtol=1e-7, atol=1e-7)
    return interpolated_map(exact, CellGrid((-2, -2), (2, 2), (80, 80)), tolerance=1e-3, max_step=max_step)


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells")
@pytest.mark.parametrize(
    ("rhs", "max_step"), [(forced, 1), (kinked_force, 1), (forced, 4)], ids=["smooth", "kink", "multi-period steps"]
)
def test_an_examined_draft_is_the_map_itself(rhs, max_step: int) -> None:
    whole = table_of(rhs, max_step)
    assert isinstance(whole.spec, Interpolated)
    draft = draft_of(whole.spec)
    made = examined(draft)
    assert whole.table is not None
    for one in (draft, made):
        assert one.table is not None
        assert one.table.coefficients.tobytes() == whole.table.coefficients.tobytes()
    assert draft.cost.evaluations < made.cost.evaluations == whole.cost.evaluations
    assert made.table.indicator.tobytes() == whole.table.indicator.tobytes()
    assert np.array_equal(made.table.fallback, whole.table.fallback)
    assert not (draft.table.fallback & ~whole.table.fallback).any()
    points = np.random.default_rng(0).uniform(-1.9, 1.9, (500, 2))
    assert made.iterate(points, 9).points.tobytes() == whole.iterate(points, 9).points.tobytes()
