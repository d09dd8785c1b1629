"""Attractors: found without being told how many, refined, and proven stable."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from small_maps import CIRCLE, LINE, circle, ends_of, grid_of, logistic

import systems
from cellmap import CellGrid, PointMap, angle, discrete_map, find_attractors, find_basins, stroboscopic_map
from cellmap.attractors import search
from cellmap.attractors.kinds import continua, quasiperiodic
from cellmap.attractors.kinds.chaos import examine
from cellmap.attractors.kinds.ends import Ends
from cellmap.attractors.kinds.examined import Examined
from cellmap.attractors.kinds.quasiperiodic import Found
from cellmap.attractors.kinds.transients import Reason
from cellmap.maps.orbit_batch import Orbits
from cellmap.orbits import Kind

W = 2 * pi * 50  # the drive of the report's pendulum, rad/s


def spiral(modulus: float, phase: float) -> PointMap:
    """Shrink and rotate about (1, 2), and halve the distance to z = -3."""

    def spiral(x, p):
        a, b = x[0] - 1.0, x[1] - 2.0
        return 1.0 + p.c * a - p.s * b, 2.0 + p.s * a + p.c * b, -3.0 + 0.5 * (x[2] + 3.0)

    params = {"c": modulus * cos(phase), "s": modulus * sin(phase)}
    return discrete_map(spiral, params, ("x", "y", "z"))


# --- exact results


def test_fixed_point_of_the_logistic_map():
    (a,) = find_attractors(logistic(2.8), LINE)
    assert (a.kind, a.period, a.rotations, a.rotation_number) == (Kind.FIXED_POINT, 1, (0,), (0.0,))
    assert a.points == pytest.approx(np.array([[1 - 1 / 2.8]]), abs=1e-14)
    assert a.multipliers == pytest.approx([2 - 2.8], abs=1e-12)
    assert a.exponents == pytest.approx([np.log(0.8)], abs=1e-12)


@pytest.mark.parametrize("r", [3.05, 3.2, 3.4])
def test_cycle_of_two_of_the_logistic_map(r):
    """x = (r + 1 +- sqrt((r - 3)(r + 1))) / 2r with the multiplier 4 + 2 r - r^2."""
    (a,) = find_attractors(logistic(r), LINE)
    root = sqrt((r - 3) * (r + 1))
    assert (a.kind, a.period) == (Kind.PERIODIC, 2)
    assert a.points[:, 0] == pytest.approx([(r + 1 - root) / (2 * r), (r + 1 + root) / (2 * r)], abs=1e-13)
    assert a.multipliers == pytest.approx([4 + 2 * r - r * r], abs=1e-11)
    assert a.exponents == pytest.approx(np.log(np.abs(a.multipliers)) / 2, abs=1e-10)


@pytest.mark.parametrize(("r", "period"), [(3.5, 4), (3.55, 8), (3.566, 16), (3.83, 3), (3.845, 6), (3.7395, 5)])
def test_period_is_that_of_a_plain_iteration(r, period):
    """Windows of the logistic map (May 1976); the multiplier is the product of r (1 - 2 x) along the cycle."""
    (a,) = find_attractors(logistic(r), LINE)
    x = 0.3
    for _ in range(200_000):
        x = r * x * (1 - x)
    cycle = [x := r * x * (1 - x) for _ in range(period)]
    assert a.period == period
    assert np.sort(a.points[:, 0]) == pytest.approx(np.sort(cycle), abs=1e-10)
    assert a.multipliers[0] == pytest.approx(np.prod([r * (1 - 2 * x) for x in cycle]), abs=1e-7)


@pytest.mark.parametrize("rotations", [-2, -1, 0, 1, 3])
@pytest.mark.parametrize("period", [2 * pi, 360.0, 1.0])
def test_rotation_on_the_circle(rotations, period):
    """Fixed up to full rotations where sin = 2 pi rate/k; the multiplier is 1 - k cos."""
    rate, k = 0.05, 0.9
    (a,) = find_attractors(circle(rotations + rate, k, period), CIRCLE * period / (2 * pi))
    place = np.arcsin(2 * pi * rate / k)
    assert a.kind is (Kind.ROTATING if rotations else Kind.FIXED_POINT)
    assert (a.period, a.rotations, a.rotation_number) == (1, (rotations,), (rotations,))
    assert a.points == pytest.approx(np.array([[place * period / (2 * pi)]]), abs=1e-12 * period)
    assert a.multipliers == pytest.approx([1 - k * cos(place)], abs=1e-11)


@pytest.mark.parametrize(("rate", "p", "q"), [(0.5, 1, 2), (-0.5, -1, 2), (1.5, 3, 2), (0.342, 1, 3), (-0.342, -1, 3)])
def test_locked_rotation_has_a_rational_rotation_number(rate, p, q):
    (a,) = find_attractors(circle(rate, 0.95), CIRCLE)
    assert (a.kind, a.period, a.rotations) == (Kind.ROTATING, q, (p,))
    assert a.rotation_number == (p / q,)
    orbit = circle(rate, 0.95).iterate(a.points, q)
    assert orbit.points == pytest.approx(a.points, abs=1e-12)
    assert (orbit.rotations == p).all()


def test_rotations_of_two_angles_have_a_common_period():
    def torus(x, p):
        return x[0] + 2 * pi * 0.5 - 0.9 * sin(x[0]), x[1] + 2 * pi * 0.342 - 0.95 * sin(x[1])

    torus_map = discrete_map(torus, {}, (angle("a"), angle("b")))
    (a,) = find_attractors(torus_map, grid_of((-pi, -pi), (pi, pi), 12))
    assert (a.period, a.rotations, a.rotation_number) == (6, (3, 2), (1 / 2, 1 / 3))


@pytest.mark.parametrize("phase", [0.0, 0.7, pi / 2, pi])
def test_spiral_in_three_dimensions(phase):
    (a,) = find_attractors(spiral(0.9, phase), grid_of((-2, -2, -4), (2, 3, 1), 4))
    expected = [0.9 * np.exp(1j * phase), 0.9 * np.exp(-1j * phase), 0.5]
    assert a.points == pytest.approx(np.array([[1.0, 2.0, -3.0]]), abs=1e-13)
    assert a.multipliers == pytest.approx(np.array(expected), abs=1e-7)
    assert (np.diff(np.abs(a.multipliers)) <= 1e-9).all()


# --- the report's pendulum (REFERENCES.md) and published oscillators


def pendulum(amplitude: float, speed: float):
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=amplitude))
    return find_attractors(exact, grid_of((-pi, -speed), (pi, speed), 60))


def test_the_pendulum_at_two_and_three_millimetres():
    (alone,) = pendulum(0.002, 100.0)
    assert alone.kind is Kind.FIXED_POINT
    assert alone.points == pytest.approx(np.zeros((1, 2)), abs=1e-12)
    assert np.prod(alone.multipliers) == pytest.approx(np.exp(-0.2), abs=1e-10)
    hanging, inverted, plus, minus = pendulum(0.003, 500.0)
    assert hanging.points == pytest.approx(np.zeros((1, 2)), abs=1e-12)
    assert np.abs(inverted.points) == pytest.approx(np.array([[pi, 0.0]]), abs=1e-10)
    value = 0.865837958746 + 0.262783907940j
    assert inverted.multipliers == pytest.approx([value, value.conjugate()], abs=1e-10)
    point = np.array([2.520339579944, 1.019933227842 * W])
    for a, sign in ((plus, 1), (minus, -1)):
        assert (a.kind, a.period, a.rotations, a.rotation_number) == (Kind.ROTATING, 1, (sign, 0), (sign, 0))
        assert a.points[0] == pytest.approx(sign * point, rel=1e-10)


@pytest.mark.parametrize(
    ("system", "window", "expected"),
    [
        (systems.two_well_duffing(), ((-2.2,) * 2, (2.2,) * 2), [(-0.77905493, 0.02741682), (1.21009083, 0.05529497)]),
        (systems.forced_pendulum(), ((-pi, -4), (pi, 4)), [(-0.4782, -0.6082), (-0.4728, 2.0371)]),
        (
            systems.dimensionless_pendulum(0.5, 0.1, 0.03),
            ((-pi, -4), (pi, 4)),
            [(0.0, 0.0), (0.67083, 1.15836), (2.65934, 0.67711), (-2.65934, -0.67711)],
        ),
        (
            systems.dimensionless_pendulum(-0.1, 0.545, 0.2),
            ((-pi, -4), (pi, 4)),
            [(0.0, 0.0), (2.18475, 1.18826), (-2.18475, -1.18826)],
        ),
    ],
    ids=["Duffing", "forced pendulum", "vertically driven", "inverted"],
)
def test_published_attractors(system, window, expected):
    """REFERENCES.md, with the digits given there."""
    found = find_attractors(stroboscopic_map(system), grid_of(*window, 30))
    # Of the second Duffing point SciPy makes 1.21009082, 0.05529495: the last digits given are off by two.
    digits = 2e-8 if system.name == "two-well Duffing" else 1e-4 if system.name == "forced pendulum" else 1e-5
    assert [a.points[0].tolist() for a in found] == [pytest.approx(p, abs=digits) for p in expected]


# --- bad input


@pytest.mark.parametrize(
    ("function", "cause"),
    [
        (lambda x, p: (2.0 * x[0] + 1.0,), "3 diverged; take initial conditions whose orbits stay"),
        (lambda x, p: (-x[0],), "3 undecided; 3 of 3 examined: on a periodic orbit that is not verified"),
        (lambda x, p: (x[0] - x[0] ** 3,), "approach a cycle with a multiplier of 1 or -1, by a power of time; move"),
    ],
)
def test_a_search_that_finds_nothing_says_why(function, cause) -> None:
    with pytest.warns(UserWarning, match=f"no attractor was found from 3 initial conditions: .*{cause}"):
        assert find_attractors(discrete_map(function, {}, ("x",)), [[0.1], [0.2], [0.3]]) == ()


# --- orbits followed on beyond the periods that they have lasted


# From below 1 orbits go to the fixed point at 0, from above to infinity; at 1 the multiplier is 1.5.
SLOW = discrete_map(lambda x, p: (x[0] + 0.5 * x[0] * (x[0] - 1.0),), {}, ("x",))


def test_basins_name_what_escapes_later():
    """Ten cells within 0.001 of the repelling fixed point, from which orbits go to infinity after some 20 periods."""
    sink = find_attractors(SLOW, [[0.5]])
    basins = find_basins(SLOW, CellGrid((1.0,), (1.001,), (10,)), max_periods=10, attractors=sink)
    assert basins.undecided == {Reason.ENDING: 10}


def test_an_unstable_fixed_point_keeps_its_reason_among_chaotic_orbits():
    """1 - 1/r of the logistic map at r = 3.9."""
    chaotic = logistic(3.9).iterate(np.linspace(0.2, 0.4, 10)[:, None], 200).points
    found = examine(ends_of(logistic(3.9), np.vstack([chaotic, [[1 - 1 / 3.9]]]), 100))
    assert len(found.attractors) == 1
    assert found.reasons == (Reason.PERIODIC,)


@pytest.mark.parametrize("rate", [1.0, 1.5, 2.0 / 3.0])
def test_neutral_orbits_are_no_attractors(rate):
    """A rigid rotation by a rational angle: every point is periodic, none attracts."""
    assert find_attractors(circle(rate, 0.0), CIRCLE, max_periods=300) == ()


@pytest.mark.parametrize(
    ("age", "patient", "looked_for"), [(63, True, False), (64, True, True), (63, False, True), (1, False, True)]
)
def test_curves_are_looked_for_at_the_end_or_where_orbits_are_mature(monkeypatch, age, patient, looked_for):
    """A rigid rotation, of which no orbit settles: a search that goes on waits for 64 periods."""
    calls = []
    monkeypatch.setattr(
        quasiperiodic, "quasiperiodic_attractors", lambda *args: calls.append(f"slow {args[5]}") or Found([], [])
    )
    monkeypatch.setattr(continua, "continua", lambda *_: calls.append("continua") or [])
    turning = discrete_map(lambda x, p: (x[0] + 1.0,), {}, (angle("a"),))
    orbits, extent = Orbits.starting(np.array([[0.1], [2.0]])), np.array([2 * pi])
    examined = Examined.nothing_yet(turning, extent)
    for last in (False, True):
        calls.clear()
        ends = Ends(turning, orbits.points, age, [], examined, 4, patient=patient, last=last)
        left, found, *_ = search.sort_out(ends, orbits)
        assert calls == ([f"slow {last}", "continua"] if looked_for else [])
        assert len(left) == 2 and found == []


def test_attractors_of_another_map_are_refused_by_one_image():
    """The wells of x -> 1.5 x - x^3 are at +-sqrt(0.5), and no image of another map stays there."""
    wells = discrete_map(lambda x, p: (p.a * x[0] - x[0] ** 3,), {"a": 1.5}, ("x",))
    henon = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], 0.3 * x[0]), {"a": 1.4}, ("x", "y"))
    two = find_attractors(wells, [[-1.0], [1.0]])
    for other, found, states in (
        (wells.with_params(a=0.8), two, [[-1.0], [1.0]]),
        (wells.with_params(a=1.2), two, CellGrid((-1.0,), (1.0,), (50,))),
        (henon.with_params(a=1.0), find_attractors(henon, [[0.0, 0.0]]), [[0.0, 0.0]]),
    ):
        with pytest.raises(ValueError, match="no attractor of this map: it takes its points elsewhere"):
            find_basins(other, states, attractors=found)
    assert find_attractors(wells.with_params(a=1.5), [[-1.0]], attractors=two) == two


@pytest.mark.parametrize("untrapped", [True, False])
def test_trapped_boxes_are_looked_for_once(monkeypatch, untrapped):
    """By the one that looks for the attractor of many chaotic orbits early, or by the examination at the end."""
    asked = list[bool]()
    monkeypatch.setattr(search, "only_attractor", lambda *_: (None, untrapped))
    monkeypatch.setattr(search, "are_chaotic", lambda *_: True)
    monkeypatch.setattr(search, "examine", lambda *_, trapped: (asked.append(trapped) or [], []))
    swinging = stroboscopic_map(systems.dimensionless_pendulum(0.25, 0.55, 0.05))
    find_attractors(swinging, np.random.default_rng(0).uniform(-1.0, 1.0, (600, 2)), max_periods=64)
    assert asked == [not untrapped]
