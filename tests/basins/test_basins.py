"""Basins: counts that two independent programs agree on, published shares, symmetry, verification, determinism."""

from __future__ import annotations

from dataclasses import replace
from math import cos, exp, pi, sin, sqrt, tanh

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import systems
from cellmap import (
    Basins,
    CellGrid,
    ForcedSystem,
    PointMap,
    Status,
    angle,
    certify,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    set_threads,
    stroboscopic_map,
)
from cellmap.attractors.labels import Label
from cellmap.basins.record import basins_memory
from cellmap.maps import ToleranceWarning
from cellmap.maps.coordinates import difference
from cellmap.orbits import Kind

W = 2 * pi * 50  # the drive of the report's pendulum, rad/s


def circle_grid(speed: float, cells: int) -> CellGrid:
    return CellGrid((-pi, -speed), (pi, speed), (cells, cells))


def counts(basins: Basins) -> list[int]:
    return [f.count for f in basins.fractions.values()]


def shares(basins: Basins) -> list[float]:
    return [f.fraction for f in basins.fractions.values()]


def halves(x, p):
    return (0.5 * x[0],)


def two_wells(x, p):
    return (tanh(2 * x[0]),)


LINE = discrete_map(two_wells, {}, ("x",), name="two wells")


# --- the report's pendulum: counts on 200 x 200 cells (REFERENCES.md)

PENDULUM = {
    "2 mm, 100 rad/s": (0.002, 100.0, [40000]),
    "3 mm, 100 rad/s": (0.003, 100.0, [32896, 7104]),
    "3 mm, 500 rad/s": (0.003, 500.0, [25484, 6152, 4182, 4182]),
}


@pytest.fixture(scope="module", params=PENDULUM)
def pendulum(request):
    amplitude, speed, expected = PENDULUM[request.param]
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=amplitude))
    return exact, find_basins(exact, circle_grid(speed, 200)), speed, expected


def test_counts_of_the_pendulum(pendulum):
    """At most 5 cells off, for the boundary is smooth."""
    _, basins, _, expected = pendulum
    assert [a.kind for a in basins.attractors] == [Kind.FIXED_POINT] * min(len(expected), 2) + [Kind.ROTATING] * (
        len(expected) - 2
    )
    assert counts(basins) == pytest.approx(expected, abs=5)
    assert basins.labels.min() == 0


@pytest.mark.parametrize("order", [3, 5])
def test_counts_by_interpolated_cell_mapping(pendulum, order):
    exact, basins, speed, expected = pendulum
    icm = interpolated_map(exact, circle_grid(1.1 * speed, 256), order, outside="integrate")
    by_table = find_basins(icm, circle_grid(speed, 200))
    assert counts(by_table) == pytest.approx(expected, abs=5)
    assert np.count_nonzero(by_table.labels != basins.labels) <= 5


def test_pendulum_is_verified(pendulum):
    _, basins, _, _ = pendulum
    check = basins.verify(300)
    assert (check.compared, check.wrong, check.fraction, check.low, check.excluded) == (300, 0, 0.0, 0.0, 0)
    assert check.high < 0.013


def test_small_rotations_at_ten_millimetres():
    """A pair of rotations by half a circle a period owns 10 of the 40,000 cells, and both methods see it."""
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=0.010))
    direct = find_basins(exact, circle_grid(500.0, 200))
    icm = interpolated_map(exact, circle_grid(550.0, 256), outside="integrate")
    for basins in (direct, find_basins(icm, circle_grid(500.0, 200))):
        small = {k: a for k, a in enumerate(basins.attractors) if abs(a.rotation_number[0]) == 0.5}
        assert sorted(a.rotations for a in small.values()) == [(-1, 0), (1, 0)]
        assert all(a.period == 2 for a in small.values())
        assert sum(basins.fractions[k].count for k in small) == pytest.approx(10, abs=2)
        assert basins.labels.min() == 0


PANELS = [(a, w) for w in (100.0, 500.0) for a in (0.0, 0.002, 0.003, 0.004, 0.010)]


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "speed"), PANELS)
def test_figure_19_by_table_and_by_direct_integration(amplitude, speed):
    """500 x 500 cells: no pixel differs where the boundary is smooth, at 10 mm at most 0.3 %."""
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=amplitude))
    icm = interpolated_map(exact, circle_grid(speed, 512), outside="integrate")
    grid = circle_grid(speed, 500)
    differing = (find_basins(icm, grid).labels != find_basins(exact, grid).labels).mean()
    assert differing <= (0.003 if amplitude == 0.010 else 0.0)


@pytest.mark.slow
def test_inverted_pendulum_by_table_and_by_direct_integration():
    exact = stroboscopic_map(systems.dimensionless_pendulum(-0.1, 0.545, 0.2))
    icm = interpolated_map(exact, circle_grid(4.0, 512), outside="integrate")
    grid = circle_grid(4.0, 500)
    assert np.array_equal(find_basins(icm, grid).labels, find_basins(exact, grid).labels)


# --- published or independently recomputed shares (REFERENCES.md)


def goy(x, p):
    """Grebogi, Ott, Yorke 1983, Physical Review Letters 50, 935."""
    theta, y = x
    return theta + 1.32 * sin(2 * theta) - 0.90 * sin(4 * theta) - y * sin(theta), -0.3 * cos(theta)


GOY = discrete_map(goy, {}, (angle("theta", lower=0.0), "x"), name="Grebogi, Ott, Yorke")
DUFFING = stroboscopic_map(systems.two_well_duffing())

# Map, initial conditions, points of the attractors, fractions, and the largest difference allowed (0.003 unless said).
PUBLISHED = {
    "forced pendulum": (
        stroboscopic_map(systems.forced_pendulum()),
        circle_grid(4.0, 200),
        [(-0.4782, -0.6082), (-0.4728, 2.0371)],
        [0.478, 0.522],
        0.003,
    ),
    "vertically driven": (
        stroboscopic_map(systems.dimensionless_pendulum(0.5, 0.1, 0.03)),
        circle_grid(4.0, 200),
        [(0, 0), (0.67083, 1.15836), (2.65934, 0.67711), (-2.65934, -0.67711)],
        [0.701, 0.212, 0.0435, 0.0435],
        0.003,
    ),
    "inverted": (
        stroboscopic_map(systems.dimensionless_pendulum(-0.1, 0.545, 0.2)),
        circle_grid(4.0, 200),
        [(0, 0), (2.18475, 1.18826), (-2.18475, -1.18826)],
        [0.6438, 0.1781, 0.1781],
        0.003,
    ),
    "two-well Duffing": (
        DUFFING,
        CellGrid((-2.2, -2.2), (2.2, 2.2), (200, 200)),
        [(-0.77905493, 0.02741682), (1.21009083, 0.05529497)],
        [0.5, 0.5],
        0.01,
    ),
    "Grebogi, Ott, Yorke": (
        GOY,
        CellGrid((0.0, -0.5), (2 * pi, 0.5), (200, 200)),
        [(0.0, -0.3), (pi, 0.3)],
        [0.5, 0.5],
        0.003,
    ),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_shares(name):
    point_map, grid, points, expected, allowed = PUBLISHED[name]
    basins = find_basins(point_map, grid)
    assert len(basins.attractors) == len(points)
    for a, point in zip(basins.attractors, points, strict=True):
        assert difference(a.points[0], np.array(point), a.coordinates) == pytest.approx(0.0, abs=1e-4)
    assert shares(basins) == pytest.approx(expected, abs=allowed)
    assert basins.labels.min() == 0


@pytest.mark.slow
def test_bounded_share_of_henons_map():
    """0.4319 of the 1000 x 1000 starts on the nodes of [-2, 2]^2 stay bounded."""
    nodes = np.linspace(-2.0, 2.0, 1000)
    basins = find_basins(systems.henon_map(), np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1))
    assert [a.kind for a in basins.attractors] == [Kind.CHAOTIC]
    assert basins.fractions[0].fraction == pytest.approx(0.4319, abs=0.00006)
    assert set(basins.fractions) == {0, Label.DIVERGED}


def test_bounded_share_of_henons_map_on_a_coarse_grid():
    grid = CellGrid((-2.0, -2.0), (2.0, 2.0), (200, 200))
    basins = find_basins(systems.henon_map(), grid, max_periods=500)
    assert basins.fractions[0].fraction == pytest.approx(0.4319, abs=0.003)


@pytest.mark.slow
def test_shares_do_not_depend_on_the_tolerance_where_the_boundary_is_fractal():
    """Two exact maps disagree on single cells, and agree on fractions to 0.3 points."""
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (300, 300))
    system = systems.two_well_duffing()
    rough, fine = (find_basins(stroboscopic_map(system, rtol=t, atol=t), grid) for t in (1e-8, 1e-12))
    assert (rough.labels != fine.labels).any()
    assert shares(rough) == pytest.approx(shares(fine), abs=0.003)


# --- symmetry


@pytest.mark.parametrize("parameters", [(0.5, 0.1, 0.03), (-0.1, 0.545, 0.2), (0.1, 0.545, 0.08)])
def test_vertically_driven_pendulum_has_mirrored_basins(parameters):
    """(theta, v) -> (-theta, -v) maps the system to itself, and the centres of a symmetric grid to one another.

    All of this holds to the last bit, so that even orbits next to a fractal boundary are mirror images.
    """
    basins = find_basins(stroboscopic_map(systems.dimensionless_pendulum(*parameters)), circle_grid(4.0, 100))
    partner = [mirror_image(a, basins.attractors) for a in basins.attractors]
    mirrored = np.append(partner, Label.UNDECIDED)[basins.labels][::-1, ::-1]
    assert np.array_equal(mirrored, basins.labels)


def mirror_image(a, attractors) -> int:
    for k, b in enumerate(attractors):
        apart = np.abs(difference(-a.points[0], b.points, a.coordinates)).max(axis=-1)
        if b.period == a.period and apart.min() < 1e-6:
            return k
    raise AssertionError(f"{a} has no mirror image")


def test_odd_map_has_equal_halves():
    basins = find_basins(LINE, CellGrid((-3.0,), (3.0,), (100,)))
    assert counts(basins) == [50, 50]
    assert np.array_equal(basins.labels, basins.labels[0] + np.repeat([0, 1 - 2 * basins.labels[0]], 50))


# --- the same labels for the same question

# Initial conditions of more than one tile each.
DETERMINISTIC = {
    "pendulum": (lambda: stroboscopic_map(systems.driven_pendulum(amplitude=0.010)), circle_grid(500.0, 130)),
    "table": (
        lambda: interpolated_map(
            stroboscopic_map(systems.driven_pendulum(amplitude=0.010)), circle_grid(300.0, 64), outside="escape"
        ),
        circle_grid(300.0, 130),
    ),
    "Henon": (systems.henon_map, CellGrid((-2.0, -2.0), (2.0, 2.0), (130, 130))),
}


@pytest.fixture(scope="module", params=DETERMINISTIC)
def repeated(request):
    """A function that makes a map, initial conditions, and the basins that are found on one thread."""
    make, grid = DETERMINISTIC[request.param]
    initial_conditions = grid.centres().reshape(-1, 2)
    set_threads(1)
    basins = find_basins(make(), initial_conditions, max_periods=500)
    set_threads(None)
    return make, initial_conditions, basins


def test_bits_do_not_depend_on_threads(repeated):
    make, initial_conditions, first = repeated
    for threads in (2, 3):
        set_threads(threads)
        other = find_basins(make(), initial_conditions, max_periods=500)
        assert np.array_equal(other.labels, first.labels)
        assert np.array_equal(other.settling_time, first.settling_time)
        assert all(np.array_equal(a.points, b.points) for a, b in zip(other.attractors, first.attractors, strict=True))


@pytest.mark.parametrize("seed", [0, 1])
def test_labels_do_not_depend_on_the_order_of_starts(repeated, seed):
    _, initial_conditions, straight = repeated
    order = np.random.default_rng(seed).permutation(len(initial_conditions))
    shuffled = find_basins(straight.point_map, initial_conditions[order], max_periods=500)
    assert [a.name for a in shuffled.attractors] == [a.name for a in straight.attractors]
    assert np.array_equal(shuffled.labels, straight.labels[order])


def test_grid_and_its_centres_have_the_same_labels():
    point_map = stroboscopic_map(systems.driven_pendulum())
    grid = circle_grid(500.0, 40)
    on_grid, points = find_basins(point_map, grid), find_basins(point_map, grid.centres())
    assert np.array_equal(on_grid.labels, points.labels)
    assert (points.grid, on_grid.initial_conditions) == (None, None)
    assert np.array_equal(points.initial_conditions, grid.centres())
    assert on_grid.grid.wraps == (True, False)


def test_known_attractors_give_the_same_labels():
    point_map = stroboscopic_map(systems.driven_pendulum())
    first = find_basins(point_map, circle_grid(500.0, 40))
    again = find_basins(point_map, circle_grid(500.0, 40), attractors=first.attractors)
    assert np.array_equal(first.labels, again.labels)
    assert len(again.attractors) == len(first.attractors)


def test_starts_that_are_settled_are_not_followed_again_for_an_attractor_that_is_found_late():
    """Five of 40,001 initial conditions belong to an attractor of their own, and the sample holds none of them."""
    point_map = discrete_map(tiny, {}, ("x",))
    initial_conditions = np.linspace(-10.0, 10.0, 40_001)[:, None]
    first = find_basins(point_map, initial_conditions)
    assert sorted(counts(first))[0] < 10
    again = find_basins(point_map, initial_conditions, attractors=first.attractors)
    assert np.array_equal(first.labels, again.labels)
    assert np.array_equal(first.settling_time, again.settling_time)
    assert first.cost.steps < again.cost.steps + 10 * 1000


def tiny(x, p):
    """Halve the distance to 0, but at 5 to 5."""
    return (0.5 * x[0] + 2.5 * exp(-(((x[0] - 5.0) / 1e-3) ** 2)),)


def test_known_attractors_without_a_start_get_no_label():
    point_map = stroboscopic_map(systems.driven_pendulum())
    wide = find_basins(point_map, circle_grid(500.0, 30))
    hanging = find_basins(point_map, [[0.1, 0.0], [0.2, 0.0]], attractors=wide.attractors)
    assert [a.name for a in hanging.attractors] == ["fixed point (0, 0)"]
    assert hanging.labels.tolist() == [0, 0]


@pytest.fixture(scope="module")
def both_wells():
    return find_attractors(LINE, [[0.5], [-0.5]])


@given(
    cells=st.integers(1, 40),
    lower=st.floats(-3, 3).map(lambda v: round(v, 3)),
    length=st.floats(0.01, 5).map(lambda v: round(v, 3)),
)
def test_labels_of_any_grid_are_those_of_its_centres(both_wells, cells, lower, length):
    """Two wells: the sign of the centre, and on the boundary itself no attractor."""
    grid = CellGrid((lower,), (lower + length,), (cells,))
    basins = find_basins(LINE, grid, max_periods=100, attractors=both_wells)
    sign = np.sign(grid.axis(0))
    for label, place in zip(basins.labels, sign, strict=True):
        if place == 0:
            assert label == Label.UNDECIDED
        else:
            assert np.sign(basins.attractors[label].points[0, 0]) == place


# --- what the record says


def test_shares_add_up_and_have_standard_errors():
    basins = find_basins(systems.henon_map(), CellGrid((-2.0, -2.0), (2.0, 2.0), (60, 60)), max_periods=300)
    fractions = basins.fractions
    assert sum(f.fraction for f in fractions.values()) == pytest.approx(1.0, abs=1e-12)
    assert sum(f.count for f in fractions.values()) == 3600
    for f in fractions.values():
        assert f.fraction == f.count / 3600
        assert f.standard_error == pytest.approx(sqrt(f.fraction * (1 - f.fraction) / 3600), rel=1e-12)


@pytest.mark.slow
def test_standard_error_is_that_of_random_starts():
    """The fraction of the left well among 200 random initial conditions scatters as its standard error says."""
    rng = np.random.default_rng(0)
    found = [find_basins(LINE, rng.uniform(-1, 2, (200, 1))) for _ in range(60)]
    left = [f.fractions[k] for f in found for k, a in enumerate(f.attractors) if a.points[0, 0] < 0]
    scatter = np.std([f.fraction for f in left])
    assert scatter == pytest.approx(np.mean([f.standard_error for f in left]), rel=0.3)
    assert np.mean([f.fraction for f in left]) == pytest.approx(1 / 3, abs=0.015)


def test_repr_names_the_attractors_and_their_shares():
    basins = find_basins(stroboscopic_map(systems.driven_pendulum()), circle_grid(100.0, 40))
    text = repr(basins)
    assert text.startswith("Basins(driven pendulum, 1,600 initial conditions: fixed point (0, 0) ")
    assert text.count(" %") == 2
    assert len(text) < 200
    undecided = find_basins(discrete_map(lambda x, p: (-x[0],), {}, ("x",), name="flip"), [[1.0], [2.0]], 40)
    assert repr(undecided) == "Basins(flip, 2 initial conditions: undecided 100 %)"


def test_labels_are_small_integers_in_the_shape_of_the_starts():
    for shape in ((), (1,), (3, 4), (2, 1, 5)):
        initial_conditions = np.random.default_rng(0).uniform(-1, 1, (*shape, 1))
        basins = find_basins(LINE, initial_conditions)
        assert basins.labels.shape == basins.settling_time.shape == shape
        assert basins.labels.dtype == np.int16


def test_single_start():
    basins = find_basins(stroboscopic_map(systems.driven_pendulum()), [1.0, 2.0])
    assert basins.labels.shape == ()
    assert int(basins.labels) == 0
    assert basins.fractions[0].fraction == 1.0
    assert basins.verify(5).wrong == 0


def test_record_says_how_it_was_made():
    icm = interpolated_map(stroboscopic_map(systems.driven_pendulum()), circle_grid(100.0, 64))
    basins = find_basins(icm, circle_grid(100.0, 10), max_periods=700, max_period=16)
    assert basins.settings["max_periods"] == 700
    assert basins.settings["max_period"] == 16
    assert basins.settings["map"] == icm.recipe
    assert basins.point_map is icm
    assert (basins.name, basins.coordinates, basins.params) == (icm.name, icm.coordinates, icm.params)
    assert basins.cost.seconds > 0
    assert basins.cost.steps > 0
    assert basins.inaccurate == 0


def test_one_dimensional_system():
    """x' = x - x^3 with a weak force: two attractors, one on each side."""
    system = ForcedSystem(lambda t, x, p: (x[0] - x[0] ** 3 + p.f * cos(t),), {"f": 0.1}, 2 * pi, ("x",))
    grid = CellGrid((-2.0,), (2.0,), (101,))
    basins = find_basins(stroboscopic_map(system), grid)
    assert [a.kind for a in basins.attractors] == [Kind.FIXED_POINT] * 2
    assert np.count_nonzero(np.diff(basins.labels)) == 1
    assert basins.verify(200).wrong == 0


def test_four_dimensional_starts_on_a_slice():
    """A slice of one cell along two axes is a grid like any other."""

    def two(x, p):
        return tanh(2 * x[0]), tanh(2 * x[1]), 0.5 * x[2] + 0.1 * x[0], 0.5 * x[3]

    four = discrete_map(two, {}, tuple("abcd"))
    basins = find_basins(four, CellGrid((-1, -1, -0.1, -0.1), (1, 1, 0.1, 0.1), (12, 12, 1, 1)))
    assert basins.labels.shape == (12, 12, 1, 1)
    assert sorted(counts(basins)) == [36, 36, 36, 36]


# --- codes


def test_orbits_that_leave_the_window_keep_their_own_code():
    exact = stroboscopic_map(systems.driven_pendulum())
    lost = find_basins(interpolated_map(exact, circle_grid(100.0, 128), outside="escape"), circle_grid(100.0, 100))
    kept = find_basins(exact, circle_grid(100.0, 100))
    escaped = lost.labels == Label.ESCAPED
    leaves = exact.orbit(lost.grid.centres(), 60).points[..., 1]
    assert 0 < escaped.mean() < 0.5
    assert np.array_equal(lost.labels[~escaped], kept.labels[~escaped])
    assert (np.abs(leaves) > 100.0).any(axis=0)[escaped].all()
    assert lost.label_name(Label.ESCAPED) == "escaped"
    assert lost.verify(200).excluded > 0


def test_an_attractor_outside_the_window_of_a_table_keeps_its_basin():
    """x -> tanh 2x has attractors at +-0.9575; the table ends at -0.5, between the left one and the boundary at 0."""
    exact = discrete_map(two_wells, {}, ("x",))
    window = CellGrid((-0.5,), (1.5,), (40,))
    kept = find_basins(interpolated_map(exact, window), window)
    lost = find_basins(interpolated_map(exact, window, outside="escape"), window)
    left = window.centres()[..., 0] < 0.0
    assert Label.ESCAPED not in kept.labels
    assert np.array_equal(lost.labels == Label.ESCAPED, left)
    for basins, initial_conditions in ((kept, np.ones_like(left)), (lost, ~left)):
        places = np.array([a.points[0, 0] for a in basins.attractors])
        assert places[basins.labels[initial_conditions]] == pytest.approx(
            np.where(left, -0.957504, 0.957504)[initial_conditions], abs=1e-6
        )
    assert np.array_equal(certify(kept).basins.labels, kept.labels)


def test_diverging_orbits_have_their_own_code():
    grid = CellGrid((-2.0,), (2.0,), (40,))
    basins = find_basins(discrete_map(lambda x, p: (x[0] ** 3,), {}, ("x",)), grid)
    inside = np.abs(grid.axis(0)) < 1
    assert (basins.labels[inside] == 0).all()
    assert (basins.labels[~inside] == Label.DIVERGED).all()
    assert basins.label_name(Label.DIVERGED) == "diverged"


def test_system_with_no_attractor_in_the_window():
    basins = find_basins(discrete_map(lambda x, p: (2 * x[0] + 1,), {}, ("x",)), CellGrid((0.0,), (1.0,), (10,)))
    assert basins.attractors == ()
    assert (basins.labels == Label.DIVERGED).all()
    drift = discrete_map(lambda x, p: (x[0] + 1,), {}, ("x",))
    table = interpolated_map(drift, CellGrid((0.0,), (5.0,), (10,)), outside="escape")
    basins = find_basins(table, CellGrid((0.0,), (5.0,), (10,)))
    assert basins.attractors == ()
    assert (basins.labels == Label.ESCAPED).all()


def test_attractor_outside_the_window_is_found_all_the_same():
    basins = find_basins(discrete_map(lambda x, p: (0.5 * x[0] + 5,), {}, ("x",)), CellGrid((0.0,), (1.0,), (10,)))
    assert basins.attractors[0].points == pytest.approx(np.array([[10.0]]))
    assert (basins.labels == 0).all()


# --- far initial conditions do not spoil the near ones


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("far", [10.0, 100.0, 1e4, 1e8, 1e200])
def test_far_starts_change_nothing_for_the_others(far):
    basins = find_basins(LINE, [[0.5], [-0.5], [far], [-far]])
    ends = [basins.attractors[k].points[0, 0] for k in basins.labels]
    assert ends == pytest.approx([0.957504, -0.957504, 0.957504, -0.957504], abs=1e-6)


@pytest.mark.parametrize("half_width", [20.0, 100.0, 1000.0])
def test_wide_window_keeps_two_wells_apart(half_width):
    grid = CellGrid((-half_width,), (half_width,), (1000,))
    basins = find_basins(LINE, grid)
    ends = np.array([a.points[0, 0] for a in basins.attractors])[basins.labels]
    assert np.array_equal(np.sign(ends), np.sign(grid.axis(0)))


def test_strong_damping_in_a_wide_window():
    """Labels are those of plain iteration of the exact map."""
    strobe = stroboscopic_map(systems.two_well_duffing(damping=3.0))
    grid = CellGrid((-200.0, -200.0), (200.0, 200.0), (31, 31))
    basins = find_basins(strobe, grid)
    ends = strobe.iterate(grid.centres(), 100).points
    for k, a in enumerate(basins.attractors):
        assert np.array_equal(basins.labels == k, np.abs(ends - a.points[0]).max(axis=-1) < 1e-3)


# --- verification


def planted(basins: Basins, wrong: int, label: int, seed: int = 3) -> Basins:
    """Change the labels of some random initial conditions with another label."""
    labels = basins.labels.copy()
    rows = np.random.default_rng(seed).choice(np.flatnonzero(labels.ravel() != label), wrong, replace=False)
    labels.ravel()[rows] = label
    return replace(basins, labels=labels)


def test_verify_finds_wrong_labels():
    """10 % of the labels are changed; n draws see that fraction, within its interval."""
    basins = find_basins(stroboscopic_map(systems.driven_pendulum()), circle_grid(500.0, 50))
    spoilt = planted(basins, 250, 1)
    check = spoilt.verify(1000)
    assert check.wrong == round(check.fraction * check.compared)
    assert check.low < 0.1 < check.high
    assert check.fraction == pytest.approx(0.1, abs=0.03)
    assert basins.verify(1000).wrong == 0


def test_verify_counts_exactly_what_is_planted():
    """One label in two: the draws are known from the seed."""
    basins = find_basins(LINE, CellGrid((-1.0,), (1.0,), (50,)))
    spoilt = replace(basins, labels=np.zeros_like(basins.labels))
    drawn = np.random.default_rng(5).integers(0, 50, 400)
    assert spoilt.verify(400, rng=5).wrong == np.count_nonzero(basins.labels[drawn] != 0)


@pytest.mark.parametrize(("n", "wrong"), [(10, 0), (10, 10), (200, 3), (400, 200), (1, 0)])
def test_interval_of_the_share(n, wrong):
    """Wilson's interval is where abs(share - p) = 1.96 sqrt(p (1 - p) / n)."""
    from cellmap.basins.record import Verification

    found = Verification.of(wrong, n)
    low, high = found.low, found.high
    assert 0 <= low <= wrong / n <= high <= 1
    for p in (low, high):
        if 0 < p < 1:
            assert abs(wrong / n - p) == pytest.approx(1.959964 * sqrt(p * (1 - p) / n), rel=1e-6)
    assert (low == 0) == (wrong == 0)
    assert (high == 1) == (wrong == n)


def test_undecided_starts_are_never_right():
    """A rotation has no attractor: by both maps all orbits are undecided, and nothing says that this is right."""
    turning = discrete_map(lambda x, p: (0.6 * x[0] - 0.8 * x[1], 0.8 * x[0] + 0.6 * x[1]), {}, ("x", "y"))
    basins = find_basins(turning, CellGrid((-1.0, -1.0), (1.0, 1.0), (10, 10)), max_periods=50)
    assert (basins.labels == Label.UNDECIDED).all()
    check = basins.verify(80)
    assert (check.compared, check.wrong, check.undecided) == (0, 0, 80)
    assert (check.low, check.high) == (0.0, 1.0)


def test_undecided_starts_reach_from_right_to_wrong():
    from cellmap.basins.record import Verification

    found = Verification.of(5, 50, undecided=45)
    assert found.fraction == 0.1
    assert found.low == Verification.of(5, 95).low
    assert found.high == Verification.of(50, 95).high


def test_verify_is_reproducible():
    basins = planted(find_basins(stroboscopic_map(systems.driven_pendulum()), circle_grid(500.0, 30)), 90, 0)
    assert basins.verify(100) == basins.verify(100)
    assert basins.verify(100) != basins.verify(100, rng=1)


def test_verify_leaves_out_what_has_no_answer():
    exact = stroboscopic_map(systems.driven_pendulum())
    icm = interpolated_map(exact, circle_grid(100.0, 64), outside="escape")
    basins = find_basins(icm, circle_grid(100.0, 40))
    check = basins.verify(500)
    assert check.compared + check.excluded == 500
    assert check.excluded / 500 == pytest.approx(basins.fractions[Label.ESCAPED].fraction, abs=0.05)
    assert check.wrong == 0


def test_verify_sees_what_a_coarse_table_spoils():
    """Straight lines on 24 x 24 cells mislabel some per cent; the interval holds the true share."""
    exact = stroboscopic_map(systems.driven_pendulum())
    icm = interpolated_map(exact, circle_grid(550.0, 24), order=1, outside="integrate", tolerance=1e3)
    basins = find_basins(icm, circle_grid(500.0, 60))
    truth = find_basins(exact, basins.grid, attractors=basins.attractors)
    share = float((truth.labels != basins.labels).mean())
    check = basins.verify(2000)
    assert share > 0.005
    assert check.low <= share <= check.high


def test_verify_does_not_trust_the_neighbourhoods():
    """An ellipsoid that is far too large, planted from outside, spoils labels; exact integration to the end sees it."""
    exact = LINE
    attractors = find_attractors(exact, [[0.5], [-0.5]])
    big = tuple(
        replace(a, neighbourhood=replace(a.neighbourhood, metrics=np.full((1, 1, 1), 0.25))) for a in attractors
    )
    basins = find_basins(exact, CellGrid((-1.0,), (1.0,), (100,)), attractors=big)
    assert len(set(basins.labels.tolist())) == 1
    assert basins.verify(200).fraction == pytest.approx(0.5, abs=0.1)


# --- warnings, memory, bad input


def test_starts_with_missed_tolerance_are_counted_and_warned_of():
    """Three steps a period do not suffice for anything."""
    strobe = stroboscopic_map(systems.driven_pendulum(), max_steps=4)
    with pytest.warns(ToleranceWarning, match="missed its tolerance along"):
        basins = find_basins(strobe, circle_grid(100.0, 6), max_periods=30)
    assert 0 < basins.inaccurate <= 36


@pytest.mark.filterwarnings("ignore::cellmap.maps.ToleranceWarning")
def test_status_of_inaccurate_orbits():
    strobe = stroboscopic_map(systems.driven_pendulum(), max_steps=4)
    assert strobe.iterate([1.0, 50.0], 1).status == Status.INACCURATE


def test_labels_that_do_not_fit_into_memory_are_refused():
    with pytest.raises(MemoryError, match=r"labels of 100,000,000,000,000 initial .* TB .*: take fewer initial"):
        find_basins(LINE, CellGrid((-1.0,), (1.0,), (10**14,)))


def test_memory_is_what_was_stated(monkeypatch):
    needed = basins_memory(100_000)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: needed - 1)
    with pytest.raises(MemoryError, match="labels of 100,000 initial conditions"):
        find_basins(LINE, CellGrid((-1.0,), (1.0,), (100_000,)))


STROBE = stroboscopic_map(systems.driven_pendulum())


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((None, [[0.0, 0.0]]), TypeError, "point_map=None: give a PointMap"),
        ((systems.driven_pendulum(), [[0.0, 0.0]]), TypeError, "give a PointMap"),
        ((STROBE, CellGrid((0.0,), (1.0,), (4,))), ValueError, "initial_conditions has 1 axes and the system 2"),
        ((STROBE, CellGrid((0.0, 0.0), (7.0, 1.0), (4, 4))), ValueError, "more than one period"),
        ((STROBE, [[0.0]]), ValueError, "last axis must hold the 2 state variables"),
        ((STROBE, [0.0, 0.0, 0.0]), ValueError, "last axis"),
        ((STROBE, 1.0), ValueError, "last axis"),
        ((STROBE, np.empty((0, 2))), ValueError, "initial_conditions is empty"),
        ((STROBE, [[0.0, np.nan]]), ValueError, "remove points that are not finite"),
        ((STROBE, [[np.inf, 0.0]]), ValueError, "remove points that are not finite"),
        ((STROBE, [["a", "b"]]), TypeError, "real numbers"),
        ((STROBE, [[1j, 0.0]]), TypeError, "real numbers"),
        ((STROBE, None), (TypeError, ValueError), "initial_conditions"),
        ((STROBE, [[0.0, 0.0]], 0), ValueError, "max_periods=0"),
        ((STROBE, [[0.0, 0.0]], -5), ValueError, "max_periods=-5"),
        ((STROBE, [[0.0, 0.0]], 1e3), TypeError, "max_periods=1000.0: give a whole number"),
        ((STROBE, [[0.0, 0.0]], 10, 0), ValueError, "max_period=0"),
        ((STROBE, [[0.0, 0.0]], 10, "all"), TypeError, "max_period='all'"),
        ((STROBE, [[0.0, 0.0]], 10, 4, "hanging"), TypeError, "attractors"),
        ((STROBE, [[0.0, 0.0]], 10, 4, [np.zeros(2)]), TypeError, "attractors"),
    ],
)
def test_bad_arguments(arguments, error, message):
    with pytest.raises(error, match=message):
        find_basins(*arguments)


def test_known_attractors_of_another_system():
    (other,) = find_attractors(discrete_map(halves, {}, ("x",)), [[0.1]])
    with pytest.raises((TypeError, ValueError), match="attractors"):
        find_basins(STROBE, [[0.0, 0.0]], attractors=[other])


@pytest.mark.parametrize("n", [0, -1, 2.5, "many"])
def test_bad_number_of_starts_to_verify(n):
    with pytest.raises((TypeError, ValueError), match="n_samples="):
        find_basins(LINE, [[0.5]]).verify(n)


def test_basins_without_their_map_cannot_be_verified():
    basins = replace(find_basins(LINE, [[0.5]]), point_map=None)
    with pytest.raises(ValueError, match="rebuild_map"):
        basins.verify()


def test_starts_are_copied():
    initial_conditions = np.array([[0.5], [-0.5]])
    basins = find_basins(LINE, initial_conditions)
    initial_conditions[:] = np.nan
    assert np.isfinite(basins.initial_conditions).all()


@pytest.fixture(scope="module")
def maps() -> list[PointMap]:
    exact = stroboscopic_map(systems.driven_pendulum())
    return [exact, interpolated_map(exact, circle_grid(550.0, 64), outside="integrate"), systems.henon_map()]


@pytest.mark.parametrize("number", range(3))
def test_same_function_on_every_kind_of_map(maps, number):
    point_map = maps[number]
    basins = find_basins(point_map, CellGrid((-1.0, -1.0), (1.0, 1.0), (20, 20)), max_periods=500)
    assert isinstance(basins, Basins)
    assert len(basins.attractors) >= 1
    assert sum(counts(basins)) == 400
