"""Basin stability, settling times, fatal shocks, integrity, tipping."""

from __future__ import annotations

from dataclasses import replace
from math import atan2, cos, erf, log2, pi, sin, sqrt, tan
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from scipy.stats import binomtest

from cellmap import (
    Basins,
    CellGrid,
    PointMap,
    angle,
    discrete_map,
    find_basins,
    find_periodic_orbits,
    interpolated_map,
    plot,
    set_threads,
    stroboscopic_map,
)
from cellmap.analysis import binomial_interval
from cellmap.analysis.boundary import saddle_manifold
from cellmap.analysis.resilience import (
    FatalShock,
    basin_stability,
    largest_ball,
    local_integrity,
    minimal_fatal_shock,
    settling_statistics,
    tipping_probabilities,
)
from cellmap.maps import inverse_stroboscopic_map
from systems import driven_pendulum, logistic_map

mpl.use("Agg")


def _cubic(x: Any, p: Any) -> tuple[float, ...]:
    u = x[0] - p.c
    return (p.c + 1.5 * u - 0.5 * u**3,)


def _disc(x: Any, p: Any) -> tuple[float, ...]:
    return tuple(0.5 * (1.0 + sum(v * v for v in x)) * v for v in x)


@pytest.fixture(scope="module")
def cubic() -> PointMap:
    """Fixed points c - 1, c + 1; basins are bounded by c, and by c -+ sqrt(3), whose image is c."""
    return discrete_map(_cubic, {"c": 0.0}, ("x",))


@pytest.fixture(scope="module")
def line(cubic: PointMap) -> Basins:
    return find_basins(cubic, CellGrid((-1.5,), (1.5,), (300,)))


@pytest.fixture(scope="module")
def disc() -> Basins:
    """The basin of the origin is the open unit disc; all else diverges."""
    return find_basins(discrete_map(_disc, {}, ("x", "y")), CellGrid((-1.5, -1.5), (1.5, 1.5), (101, 77)))


@pytest.fixture(scope="module")
def pendulum() -> Basins:
    exact = stroboscopic_map(driven_pendulum(amplitude=0.003))
    table = interpolated_map(exact, CellGrid((-pi, -1000.0), (pi, 1000.0), (128, 256)), outside="integrate")
    return find_basins(table, CellGrid((-pi, -500.0), (pi, 500.0), (200, 200)))


@pytest.fixture(scope="module")
def shocks(pendulum: Basins) -> list[FatalShock]:
    """Out of the hanging and out of the inverted pendulum."""
    return [minimal_fatal_shock(pendulum, k, n_trials=1024) for k in (0, 1)]


# --- binomial intervals


@pytest.mark.parametrize(("name", "theirs"), [("exact", "exact"), ("Wilson", "wilson")])
@pytest.mark.parametrize(("k", "n"), [(0, 1), (0, 50), (7, 50), (50, 50), (481, 1000)])
def test_intervals_are_those_of_scipy(name: str, theirs: str, k: int, n: int) -> None:
    expected = binomtest(k, n).proportion_ci(0.99, method=theirs)
    low, high = binomial_interval(k, n, 0.99, name)
    assert (float(low), float(high)) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_interval_of_no_trials_says_nothing() -> None:
    assert [float(v) for v in binomial_interval(0, 0)] == [0.0, 1.0]
    assert [float(v) for v in binomial_interval(0, 0, method="Wilson")] == [0.0, 1.0]


@pytest.mark.parametrize(
    ("arguments", "match"),
    [((3, 2), "counts between"), ((1, 2, 1.5), "confidence"), ((1, 2, 0.9, "Wald"), "method='Wald'")],
)
def test_intervals_that_are_none(arguments: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        binomial_interval(*arguments)


# --- basin stability


def test_intervals_cover_a_known_share_as_often_as_they_say(cubic: PointMap, line: Basins) -> None:
    """Of [-0.5, 1.5] three quarters belong to the right basin; 95 % of 200 intervals is 190 +- 3.1."""
    window = CellGrid((-0.5,), (1.5,), (1,))
    hits = 0
    for seed in range(200):
        right = basin_stability(line, window, n_samples=100, rng=seed).fractions[0]
        hits += right.low <= 0.75 <= right.high
    assert hits >= 184
    assert (
        basin_stability(line, window, n_samples=100, rng=5).labels.tolist()
        != basin_stability(line, window, n_samples=100, rng=6).labels.tolist()
    )


def test_normal_distribution_of_perturbations(line: Basins) -> None:
    """Of a normal law about 1 with spread 0.4, the right basin holds (0, sqrt 3) and what jumps over and back."""

    def below(x: float) -> float:
        return 0.5 * (1.0 + erf((x - 1.0) / 0.4 / sqrt(2.0)))

    back = float(np.roots([-0.5, 0.0, 1.5, sqrt(3.0)]).real.max())  # its image is -sqrt 3
    known = below(sqrt(3.0)) - below(0.0) + below(sqrt(5.0)) - below(back)
    found = basin_stability(line, lambda rng, n: rng.normal(1.0, 0.4, (n, 1)), n_samples=40_000, confidence=0.999)
    assert found.fractions[0].low < known < found.fractions[0].high
    assert found.fractions[0].standard_error == pytest.approx(sqrt(known * (1 - known) / 40_000), rel=0.02)


def test_undecided_states_belong_to_no_basin_and_widen_the_intervals(line: Basins) -> None:
    window = CellGrid((-0.5,), (1.5,), (1,))
    hasty = basin_stability(line, window, n_samples=4000, max_periods=6)
    assert hasty.undecided > 50
    assert sum(s.count for s in hasty.fractions.values()) == 4000
    assert hasty.fractions[-3].count == hasty.undecided
    assert hasty.fractions[0].low < 0.75 < hasty.fractions[0].high
    patient = basin_stability(line, window, n_samples=4000)
    assert patient.undecided == 0
    assert -3 not in patient.fractions
    width = [b.fractions[0].high - b.fractions[0].low for b in (hasty, patient)]
    assert width[0] > width[1] + 0.9 * hasty.undecided / 4000


def test_a_map_with_attractors_will_do(cubic: PointMap, line: Basins) -> None:
    window = CellGrid((-0.5,), (1.5,), (1,))
    a = basin_stability(cubic, window, n_samples=500, attractors=line.attractors, rng=3)
    b = basin_stability(line, window, n_samples=500, rng=3)
    assert np.array_equal(a.labels, b.labels)


def test_states_that_diverge_have_a_share_of_their_own(disc: Basins) -> None:
    found = basin_stability(disc, n_samples=20_000, rng=1)
    assert found.fractions[0].low < pi / 9.0 < found.fractions[0].high
    assert found.fractions[-2].count + found.fractions[0].count == 20_000


def test_same_bits_for_any_number_of_threads(pendulum: Basins) -> None:
    results = []
    for threads in (1, 2):
        set_threads(threads)
        results.append(basin_stability(pendulum, n_samples=20_000, point_map=pendulum.point_map))
    assert np.array_equal(results[0].labels, results[1].labels)
    assert np.array_equal(results[0].settling_time, results[1].settling_time)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"n_samples": 0}, ValueError, "n_samples=0"),
        ({"distribution": 3}, TypeError, "distribution=3"),
        ({"distribution": lambda rng, n: np.zeros((n, 2))}, ValueError, "last axis"),
        ({"distribution": lambda rng, n: np.zeros((n - 1, 1))}, ValueError, "return 10000 states"),
        ({"distribution": CellGrid((0, 0), (1, 1), (1, 1))}, ValueError, "2 axes"),
        ({"confidence": 0.0}, ValueError, "confidence"),
        ({"method": "Wald"}, ValueError, "method"),
    ],
)
def test_what_basin_stability_refuses(line: Basins, change: Any, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        basin_stability(line, **change)


def test_a_map_without_attractors_or_basins_without_a_map_are_refused(cubic: PointMap, line: Basins) -> None:
    with pytest.raises(ValueError, match="attractors is empty"):
        basin_stability(cubic, CellGrid((0,), (1,), (1,)))
    with pytest.raises(ValueError, match="have no map"):
        basin_stability(replace(line, point_map=None))
    with pytest.raises(TypeError, match="give Basins"):
        basin_stability(np.zeros(3, int))  # type: ignore[arg-type]


# --- settling times


def test_settling_times_of_a_linear_map() -> None:
    """From x the neighbourhood of half-width r about 0 is reached in the first k with |x| / 2^k <= r."""
    half = discrete_map(lambda x, p: (0.5 * x[0],), {}, ("x",))
    basins = find_basins(half, CellGrid((-64.0,), (64.0,), (1000,)))
    neighbourhood = basins.attractors[0].neighbourhood
    assert neighbourhood is not None
    reach = 1.0 / sqrt(neighbourhood.metrics[0, 0, 0])
    assert basins.grid is not None
    known = np.array([max(0, int(np.ceil(log2(abs(x) / reach)))) for x in basins.grid.axis(0)])
    found = settling_statistics(basins, levels=(0.0, 0.5, 1.0)).basins[0]
    assert found.count == 1000
    assert found.mean == pytest.approx(known.mean())
    assert found.standard_error == pytest.approx(known.std(ddof=1) / sqrt(1000))
    assert found.quantiles.tolist() == [known.min(), np.sort(known)[499], known.max()]
    assert found.times.tolist() == np.bincount(known).tolist()


def test_starts_that_do_not_settle_are_kept_apart(line: Basins) -> None:
    labels, times = line.labels.copy(), line.settling_time.copy()
    labels[:10], labels[10:14], labels[14:15] = -3, -2, -1
    times[:15] = -1
    found = settling_statistics(replace(line, labels=labels, settling_time=times))
    assert found.undecided == 10
    assert {name: count for name, count in found.others.items() if count} == {
        "escaped": 1,
        "diverged": 4,
        "undecided": 10,
    }
    assert sum(s.count for s in found.basins.values()) == 285
    assert min(s.quantiles.min() for s in found.basins.values()) >= 0.0


def test_basin_without_starts_has_no_mean(line: Basins) -> None:
    none = replace(line, labels=np.full_like(line.labels, -3), settling_time=np.full_like(line.settling_time, -1))
    found = settling_statistics(none).basins[0]
    assert (found.count, found.longest) == (0, -1)
    assert np.isnan([found.mean, found.standard_error, *found.quantiles]).all()
    plot.settling_times(settling_statistics(none))


def test_what_settling_statistics_refuses(line: Basins) -> None:
    with pytest.raises(TypeError, match="give Basins"):
        settling_statistics(line.labels)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="levels"):
        settling_statistics(line, levels=(1.5,))


# --- minimal fatal shocks


def test_shock_that_the_window_does_not_show(line: Basins) -> None:
    """The window shows the boundary at 0, a distance of 1; but at sqrt(3), beyond it, orbits are thrown over."""
    shock = minimal_fatal_shock(line, 0, scale=1.0)
    assert shock.from_image == pytest.approx(1.005)
    assert shock.size == pytest.approx(sqrt(3.0) - 1.0, abs=1e-9)
    assert shock.bracket == pytest.approx((sqrt(3.0) - 1.0,) * 2, abs=1e-15)
    assert shock.bracket[0] <= shock.bracket[1]
    assert shock.reached == 1
    assert shock.end == pytest.approx([sqrt(3.0)])


def test_shock_out_of_a_disc(disc: Basins) -> None:
    shock = minimal_fatal_shock(disc, 0, scale=1.0)
    assert shock.size == pytest.approx(1.0, abs=1e-9)
    assert (shock.reached, shock.inside_fatal) == (-2, 0)
    assert shock.inside_high == pytest.approx(1.0 - 0.025 ** (1.0 / shock.tested))
    off = minimal_fatal_shock(disc, 0, point=(0.3, 0.4), scale=1.0)
    assert off.size == pytest.approx(0.5, abs=1e-9)
    assert atan2(off.shock[1], off.shock[0]) == pytest.approx(atan2(0.4, 0.3), abs=1e-4)


def test_scale_and_direction_of_a_shock(disc: Basins) -> None:
    flat = minimal_fatal_shock(disc, 0, scale=(1.0, 4.0))
    assert flat.size == pytest.approx(0.25, abs=1e-9)
    assert abs(flat.shock[1]) == pytest.approx(1.0, abs=1e-7)
    kicked = minimal_fatal_shock(disc, 0, point=(0.6, 0.0), scale=1.0, along=["y"])
    assert kicked.shock.tolist() == pytest.approx([0.0, kicked.shock[1]])
    assert kicked.size == pytest.approx(0.8, abs=1e-9)
    by_number = minimal_fatal_shock(disc, 0, point=(0.6, 0.0), scale=1.0, along=[1])
    assert by_number.size == kicked.size


def test_shock_out_of_a_ball_in_three_dimensions() -> None:
    ball = find_basins(discrete_map(_disc, {}, ("x", "y", "z")), CellGrid((-1.3,) * 3, (1.3,) * 3, (16,) * 3))
    shock = minimal_fatal_shock(ball, 0, point=(0.0, 0.3, 0.0), scale=1.0)
    assert shock.size == pytest.approx(0.7, abs=1e-9)
    assert shock.shock == pytest.approx([0.0, 0.7, 0.0], abs=1e-4)


def test_shock_goes_the_shorter_way_round_a_circle() -> None:
    """x' = x + sin(x)/2 pulls to pi, the branch cut; its basin ends at 0, a bump bounds it in y at 1."""
    shift = discrete_map(
        lambda x, p: (x[0] + 0.5 * cos(x[0] - 2.5), 0.5 * x[1] * (1 + x[1] ** 2)), {}, (angle("a"), "y")
    )
    basins = find_basins(shift, CellGrid((-pi, -1.5), (pi, 1.5), (90, 60)))
    # Stable where the cosine falls through 0: at 2.5 + pi/2 - 2 pi; unstable half a circle away.
    assert basins.attractors[0].points[0] == pytest.approx([2.5 + pi / 2 - 2 * pi, 0.0], abs=1e-9)
    far = minimal_fatal_shock(basins, 0, point=(-pi + 0.01, 0.9), scale=(1.0, 1.0))
    assert far.size == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("cut", [-pi, 0.0, 0.3, 17.0])
def test_shocks_do_not_depend_on_where_a_circle_is_cut(cut: float) -> None:
    """x' = x - 0.4 sin 2x: attractors at 0 and pi, half a circle of basin each."""
    halves = discrete_map(lambda x, p: (x[0] - 0.4 * sin(2.0 * x[0]), 0.5 * x[1]), {}, (angle("a", lower=cut), "y"))
    basins = find_basins(halves, CellGrid((cut, -1.0), (cut + 2 * pi, 1.0), (64, 20)))
    for k in (0, 1):
        assert minimal_fatal_shock(basins, k, scale=1.0, n_trials=256).size == pytest.approx(pi / 2, abs=1e-9)


def test_shock_out_of_the_inverted_pendulum_ends_on_the_saddles_stable_manifold(shocks: list[FatalShock]) -> None:
    """Independent witness: the distance from the attractor to the curve grown by backward integration."""
    system = driven_pendulum(amplitude=0.003)
    exact = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    window = CellGrid((-pi, -500.0), (pi, 500.0), (120, 120))
    unit = np.array([2 * pi, 1000.0])
    orbits = find_periodic_orbits(exact, window)
    saddle = next(o for o in orbits if not o.is_stable and 2.0 < o.points[0, 0] < 2.2)
    inverse = inverse_stroboscopic_map(system)
    curve = saddle_manifold(exact, saddle, "stable", window, length=3.0, spacing=5e-4, inverse=inverse).points
    for shock, at in zip(shocks, ([0.0, 0.0], [pi, 0.0]), strict=True):
        shift = curve - at
        shift[:, 0] -= 2 * pi * np.round(shift[:, 0] / (2 * pi))
        shift /= unit
        near = shift[np.argsort(np.linalg.norm(shift, axis=1))[:2]]
        piece = near[1] - near[0]
        share = -(near[0] @ piece) / (piece @ piece)
        known = np.linalg.norm(near[0] + share * piece)
        assert shock.size == pytest.approx(known, rel=2e-5)
        assert shock.inside_fatal == 0


def test_mirror_images_have_equal_shocks(pendulum: Basins) -> None:
    """The two rotations, labels 2 and 3, are mirror images."""
    sizes = [minimal_fatal_shock(pendulum, k, scale=(1.0, 300.0), n_trials=512).size for k in (2, 3)]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-7)


@pytest.mark.parametrize(
    ("label", "change", "match"),
    [
        (-1, {}, "are not basins"),
        (7, {}, "label=7"),
        (0, {"scale": 0.0}, "scale=0.0"),
        (0, {"scale": (1.0, 1.0, 1.0)}, "scale="),
        (0, {"point": (2.0, 0.0)}, r"label -2, not 0"),
        (0, {"point": (2.0,)}, "point has shape"),
        (0, {"along": ["z"]}, "along='z'"),
        (0, {"along": []}, "along is empty"),
        (0, {"n_trials": 0}, "n_trials=0"),
    ],
)
def test_what_a_shock_refuses(disc: Basins, label: int, change: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        minimal_fatal_shock(disc, label, **change)


def test_labels_that_are_no_whole_numbers() -> None:
    with pytest.raises(TypeError, match=r"basins=array.*: give Basins, or whole numbers as labels"):
        largest_ball(np.zeros((3, 3)), 0)


def test_no_shock_where_all_come_back(disc: Basins) -> None:
    inner = find_basins(discrete_map(_disc, {}, ("x", "y")), CellGrid((-0.5, -0.5), (0.5, 0.5), (10, 10)))
    with pytest.raises(ValueError, match="larger window"):
        minimal_fatal_shock(inner, 0)
    with pytest.raises(ValueError, match="larger window"):
        local_integrity(inner, 0)


def test_undecided_cells_are_not_fatal(disc: Basins) -> None:
    """With the cells outside relabelled as undecided, nothing is known to be fatal."""
    labels = np.where(disc.labels == -2, -3, disc.labels).astype(np.int16)
    with pytest.raises(ValueError, match="no initial condition has another label"):
        minimal_fatal_shock(replace(disc, labels=labels), 0)


def test_starts_without_a_grid_serve_as_well() -> None:
    initial_conditions = np.random.default_rng(0).uniform(-1.5, 1.5, (3000, 2))
    basins = find_basins(discrete_map(_disc, {}, ("x", "y")), initial_conditions)
    with pytest.raises(ValueError, match="scale is missing"):
        minimal_fatal_shock(basins, 0)
    assert minimal_fatal_shock(basins, 0, scale=1.0).size == pytest.approx(1.0, abs=1e-9)


# --- integrity


def test_integrity_of_a_disc(disc: Basins) -> None:
    rough, fine = (local_integrity(disc, 0, scale=1.0, refine=r) for r in (False, True))
    assert abs(rough.radius - 1.0) < rough.resolution
    assert fine.radius == pytest.approx(1.0, abs=1e-9)
    assert not fine.meets_window
    assert rough.shock is None
    assert fine.centre == pytest.approx([0.0, 0.0], abs=1e-12)


def test_integrity_of_a_cycle_is_that_of_its_weakest_point() -> None:
    """Logistic map, r = 3.2: both points of the 2-cycle lie in (0, 1), outside of which orbits diverge.

    Single points of the boundary within, such as the preimages of the unstable fixed point, have no room and no weight.
    """
    r = 3.2
    basins = find_basins(logistic_map(r), CellGrid((-0.5,), (1.5,), (200,)))
    high = (r + 1 + sqrt((r - 3) * (r + 1))) / (2 * r)
    ball = local_integrity(basins, 0, scale=1.0)
    assert ball.radius == pytest.approx(1.0 - high, abs=1e-9)
    assert ball.centre == pytest.approx([high])


def test_largest_ball_about_any_centre(disc: Basins) -> None:
    ball = largest_ball(disc, 0, scale=1.0)
    assert abs(ball.radius - 1.0) < ball.resolution
    assert np.linalg.norm(ball.centre) < ball.resolution
    refined = largest_ball(disc, 0, scale=1.0, refine=True)
    assert refined.radius == pytest.approx(1.0 - np.linalg.norm(refined.centre), abs=1e-7)


def test_largest_ball_goes_round_a_circle_and_stops_at_a_window() -> None:
    labels = np.zeros((20, 11), int)
    labels[:4], labels[-5:] = 1, 1
    closed = largest_ball(labels, 1, wraps=(True, False))
    assert closed.radius == 5.0  # nine rows across the branch cut: from the middle one to the first beyond
    assert closed.centre[0] in (19.5, 0.5 - 0.0)
    opened = largest_ball(labels, 1)
    assert opened.radius == 3.0
    assert opened.meets_window
    narrow = largest_ball(labels, 0, scale=(1.0, 0.1))
    assert narrow.radius == 6.0
    assert not narrow.meets_window


def test_undecided_cells_end_a_ball() -> None:
    labels = np.ones((9, 9), int)
    labels[4, 4] = -3
    # About cell (2, 2): the undecided one is nearer than the third row away, beyond the window.
    ball = largest_ball(labels, 1)
    assert ball.radius == pytest.approx(2.0 * sqrt(2.0))
    assert not ball.meets_window
    labels[4, 4] = 1
    assert largest_ball(labels, 1).radius == 5.0


@pytest.mark.parametrize(
    ("labels", "label", "change", "match"),
    [
        (np.zeros((0, 3), int), 0, {}, "shape"),
        (np.zeros((3, 3), int), 1, {}, "no cell has it"),
        (np.zeros(4, int), 0, {"wraps": [True]}, "has no boundary"),
        (np.zeros(4, int), 0, {"refine": True}, "has no map"),
        (np.zeros(4, int), -1, {}, "label=-1"),
    ],
)
def test_what_a_ball_refuses(labels: Any, label: int, change: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        largest_ball(labels, label, **change)


def test_one_cell_is_a_ball_that_meets_the_window() -> None:
    ball = largest_ball(np.zeros((1, 1), int), 0)
    assert (ball.radius, ball.meets_window) == (1.0, True)


# --- tipping


def test_overlap_of_shifted_basins(cubic: PointMap, line: Basins) -> None:
    """The boundary moves from 0 to 0.3: of 150 cells on the right, 30 tip to the left; none tips to the right.

    The other ends, at 0.3 -+ sqrt 3, leave the window to the right and enter it at -1.432 from the left: 7 of the left
    cells are then thrown to the right.
    """
    moved = find_basins(cubic.with_params(c=0.3), line.grid)
    found = tipping_probabilities(line, moved)
    right = [int(np.argmax([a.points[0, 0] for a in b.attractors])) for b in (line, moved)]
    left = [1 - k for k in right]
    assert found.probability(right[0], left[1]) == pytest.approx(30 / 150)
    assert found.probability(right[0], right[1]) == pytest.approx(120 / 150)
    assert found.probability(left[0], right[1]) == pytest.approx(7 / 150)
    assert found.probabilities.sum(axis=1) == pytest.approx([1.0, 1.0])
    assert (found.low <= found.probabilities).all()
    assert (found.probabilities <= found.high).all()
    assert found.landing is not None
    assert found.landing[right[0], right[1]] == 1.0  # 1 lies between 0.3 and 2.03


def _turned(x: Any, p: Any) -> tuple[float, ...]:
    r, t = sqrt(x[0] ** 2 + x[1] ** 2), atan2(x[1], x[0])
    turned, nearer = t - 0.3 * sin(2.0 * (t - p.phi)), r + 0.3 * (1.0 - r)
    return nearer * cos(turned), nearer * sin(turned)


@pytest.mark.parametrize("match", ["distance", "overlap"])
def test_attractors_are_matched_between_turned_bases(match: str) -> None:
    """Attractors at phi and phi + pi, half-planes as basins: turned by 0.4, tan(0.2)/2 of each half of a square tips.

    Labels are in the order of x, so that attractors exchange theirs as one passes the y axis.
    """
    window = CellGrid((-2.0, -2.0), (2.0, 2.0), (400, 400))
    point_map = discrete_map(_turned, {"phi": pi / 2 - 0.2}, ("x", "y"))
    before, after = (find_basins(point_map.with_params(phi=phi), window) for phi in (pi / 2 - 0.2, pi / 2 + 0.2))
    upper = [int(np.argmax([a.points[0, 1] for a in b.attractors])) for b in (before, after)]
    assert upper[0] != upper[1]
    found = tipping_probabilities(before, after, match=match)
    assert found.continuation == (1, 0)
    assert found.tipping[:, 0] == pytest.approx(np.full(2, tan(0.2) / 2.0), abs=2e-3)
    assert (found.tipping[:, 1] <= found.tipping[:, 0]).all()
    assert (found.tipping[:, 0] <= found.tipping[:, 2]).all()
    same = tipping_probabilities(before, after, match="labels")
    assert same.continuation == (0, 1)
    assert same.tipping[:, 0] == pytest.approx(1.0 - found.tipping[:, 0])
    assert len(plot.tipping(found).patches) == 2


def test_attractors_far_away_or_without_overlap_do_not_continue(cubic: PointMap, line: Basins) -> None:
    moved = find_basins(cubic.with_params(c=1.2), line.grid)
    assert tipping_probabilities(line, moved, threshold=0.1).continuation == (None, None)
    lost = tipping_probabilities(line, replace(moved, attractors=moved.attractors[:1], labels=0 * moved.labels))
    assert sorted(k is None for k in lost.continuation) == [False, True]
    assert lost.tipping[lost.continuation.index(None), 0] == 1.0
    assert tipping_probabilities([0, 0, 1, 1], [0, 1, 0, 1], match="overlap").continuation == (None, None)
    assert tipping_probabilities([0, 0, 1, 1], [5, 5, 5, 3], match="overlap").continuation == (5, 3)
    assert tipping_probabilities([0, 0, 0, 1], [5, 5, 5, 5], match="overlap").continuation == (5, None)


def test_attractor_that_lands_elsewhere(cubic: PointMap, line: Basins) -> None:
    """Moved by 1.2, the boundary has passed the attractor at 1."""
    moved = find_basins(cubic.with_params(c=1.2), line.grid)
    found = tipping_probabilities(line, moved)
    right = int(np.argmax([a.points[0, 0] for a in line.attractors]))
    left_after = int(np.argmin([a.points[0, 0] for a in moved.attractors]))
    assert found.landing is not None
    assert found.landing[right, found.after.index(left_after)] == 1.0


def test_labels_that_only_attractors_land_on_have_the_interval_asked_for(cubic: PointMap, line: Basins) -> None:
    """Moved by -3, the boundary leaves the attractors so far away that they diverge; no cell is said to."""
    moved = find_basins(cubic.with_params(c=-3.0), CellGrid((-4.5,), (-1.5,), (300,)))
    after = replace(moved, labels=0 * moved.labels, grid=line.grid)
    found = tipping_probabilities(line, after, confidence=0.5)
    assert found.after[-1] == -2
    assert found.high[:, -1] == pytest.approx(np.full(2, binomial_interval(0, 150, 0.5)[1]))
    assert found.landing is not None
    assert found.landing[:, -1].max() == 1.0


def test_what_matching_refuses(line: Basins) -> None:
    with pytest.raises(ValueError, match="have no attractors"):
        tipping_probabilities([0, 1], [0, 1], match="distance")
    with pytest.raises(ValueError, match="match='name'"):
        tipping_probabilities(line, line, match="name")
    with pytest.raises(ValueError, match="threshold=0"):
        tipping_probabilities(line, line, threshold=0.0)


def test_labels_alone_and_codes() -> None:
    found = tipping_probabilities([[0, 0, -2], [1, 1, -3]], [[0, -3, -2], [0, 1, 1]])
    assert (found.before, found.after) == ((0, 1, -2, -3), (0, 1, -2, -3))
    assert found.counts.tolist() == [[1, 0, 0, 1], [1, 1, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0]]
    assert found.landing is None
    assert found.probability(0, 5) == 0.0
    with pytest.raises(ValueError, match="before=9"):
        found.probability(9, 0)


@pytest.mark.parametrize(
    ("before", "after", "error", "match"),
    [
        ([0, 1], [0], ValueError, "shapes"),
        (np.zeros(0, int), np.zeros(0, int), ValueError, "empty"),
        ([0.5], [0], TypeError, "whole numbers"),
    ],
)
def test_what_tipping_refuses(before: Any, after: Any, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        tipping_probabilities(before, after)


def test_tipping_refuses_other_windows(cubic: PointMap, line: Basins) -> None:
    with pytest.raises(ValueError, match="one window"):
        tipping_probabilities(line, find_basins(cubic, CellGrid((-1.4,), (1.5,), (300,))))


# --- figures


def whole_turns_off(apart: Any, basins: Basins) -> Any:
    for j, c in enumerate(basins.coordinates):
        if c.period is not None:
            apart[:, j] -= c.period * np.round(apart[:, j] / c.period)
    return apart


def test_pictures(disc: Basins, pendulum: Basins, line: Basins, shocks: list[FatalShock]) -> None:
    assert len(plot.basin_stability(basin_stability(disc, n_samples=50)).patches) == 2
    assert len(plot.settling_times(settling_statistics(pendulum)).get_lines()) == 4
    for ball, basins in ((local_integrity(pendulum, 1, refine=False), pendulum), (largest_ball(disc, 0), disc)):
        lines = [line.get_xydata() for line in plot.ball(ball, basins=basins).get_lines()]
        circles = [line[np.isfinite(line).all(axis=1)] - ball.centre for line in lines if len(line) > 300]
        away = [np.hypot(*(whole_turns_off(d, basins) / ball.scale).T) for d in circles]
        assert any(np.allclose(d, ball.radius, rtol=1e-6) for d in away)
        assert any(np.allclose(line, ball.centre) for line in lines)
    ax = plot.fatal_shock(shocks[1], basins=pendulum)
    (cross,) = (line for line in ax.get_lines() if line.get_marker() == "X")
    assert cross.get_xydata()[0] == pytest.approx(shocks[1].end)
    assert ax.get_xlim() == pytest.approx((-pi, pi))
    assert plot.tipping(tipping_probabilities(line, line)).get_ylabel() == "before"
    solid = find_basins(discrete_map(_disc, {}, ("x", "y", "z")), CellGrid((-1.3,) * 3, (1.3,) * 3, (6,) * 3))
    with pytest.raises(ValueError, match="two axes"):
        plot.ball(largest_ball(solid, 0), basins=solid)
    for draw in (plot.basin_stability, plot.settling_times, plot.tipping):
        with pytest.raises(TypeError, match=r"=3: give .*, made by"):
            draw(3)  # type: ignore[operator]


def test_pictures_of_one_coordinate(line: Basins) -> None:
    """A strip in the colours of the basins: the shock ends where they change, the ball within one of them."""
    shock = minimal_fatal_shock(line, 0, scale=1.0, n_trials=64)
    ax = plot.fatal_shock(shock, basins=line)
    assert len(ax.patches) == 2
    arrow = ax.get_lines()[1].get_xydata()
    assert arrow == pytest.approx(np.array([[shock.point[0], 0.0], [shock.point[0] + shock.shock[0], 0.0]]))
    ball = local_integrity(line, 1, scale=1.0, refine=False)
    round_ = np.asarray(plot.ball(ball, basins=line).get_lines()[0].get_xydata())
    assert [round_[:, 0].min(), round_[:, 0].max()] == pytest.approx(ball.centre[0] + ball.radius * np.array([-1, 1]))
    turning = discrete_map(lambda x, p: (x[0] - 0.4 * sin(2.0 * x[0]),), {}, (angle("a"),))
    circle = find_basins(turning, CellGrid((-pi,), (pi,), (64,)))
    seam = plot.fatal_shock(minimal_fatal_shock(circle, 1, scale=1.0), basins=circle)  # about pi, the branch cut
    assert np.nanmax(np.abs(np.asarray(seam.get_lines()[0].get_xydata())[:, 0])) <= pi + 1e-12


def test_records_say_what_they_are_in_one_line(disc: Basins, line: Basins) -> None:
    records = [
        basin_stability(disc, n_samples=50),
        settling_statistics(disc),
        settling_statistics(disc).basins[0],
        minimal_fatal_shock(disc, 0, n_trials=64),
        local_integrity(disc, 0, refine=False),
        tipping_probabilities(line, line),
    ]
    for record in records:
        assert "\n" not in repr(record)
        assert len(repr(record)) < 250
