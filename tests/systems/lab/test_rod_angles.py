"""Angles, rates and circles against motions known exactly."""

import re
from math import pi
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from systems.lab import MarkerStatus, Tracks, fit_circle, joint_angles

PIVOT = (30.0, 20.0)


def tracks_of(times, angles, length=50.0, noise=0.0, hidden=(), seed=0):
    """Tracks of a chain of rods of one length whose first pivot is at PIVOT, with normal errors."""
    rng = np.random.default_rng(seed)
    angles = np.asarray(angles).reshape(len(times), -1)
    steps = length * np.stack([np.sin(angles), np.cos(angles)], axis=-1)
    places = np.array(PIVOT) + np.cumsum(steps, axis=1)
    places = places + noise * rng.standard_normal(places.shape)
    status = np.zeros(angles.shape, np.uint8)
    status[list(hidden)] = MarkerStatus.LOST
    places[status > 0] = np.nan
    errors = np.where(np.isfinite(places), max(noise, 1e-6), np.nan)
    return Tracks(np.asarray(times), places, errors, status, places, np.ones(angles.shape), 100.0)


TIMES = np.arange(200) / 200.0


def test_angles_from_below_counter_clockwise() -> None:
    """Down, right, up and left in an image whose rows go down: 0, pi/2, pi, 3 pi/2, and on."""
    angle = np.arange(9) * pi / 4
    found = joint_angles(tracks_of(np.arange(9.0), angle), [PIVOT], window_length=5)
    assert found.angles[:, 0] == pytest.approx(angle)
    assert repr(found) == "JointAngles(9 frames, angles in 9, stretches: 1)"


def test_a_pivot_given_wrongly_shows() -> None:
    """3 pixels off, a rod of 50 seems 47 to 53 long, and angles err by up to 3/50; noise alone is no such sign."""
    angles = 9.0 * np.sin(3.0 * TIMES)
    for noise in (0.0, 0.02, 0.2):
        tracks = tracks_of(TIMES, angles, noise=noise)
        right, wrong = joint_angles(tracks, [PIVOT]), joint_angles(tracks, [(PIVOT[0] + 3.0, PIVOT[1])])
        assert "not rigid" not in repr(right)
        assert right.lengths == pytest.approx(np.full((200, 1), 50.0), abs=5.0 * noise + 1e-9)
        assert re.search(r"; joint 0 is not rigid, 4[67]\.\d+ to 5[23]\.\d+ pixels", repr(wrong))
        assert np.abs(wrong.angles - right.angles).max() == pytest.approx(0.06, rel=0.1)


def test_a_chain_has_absolute_angles() -> None:
    angles = np.stack([3.0 * np.sin(5.0 * TIMES), 14.0 * TIMES], axis=-1)
    found = joint_angles(tracks_of(TIMES, angles), [PIVOT, 0])
    assert np.abs(found.angles - angles).max() < 1e-12
    rates = np.stack([15.0 * np.cos(5.0 * TIMES), np.full(200, 14.0)], axis=-1)
    middle = slice(3, -3)
    assert np.abs(found.rates - rates)[middle].max() < 1e-4
    assert np.isnan(found.rates[[0, 1, 2, -3, -2, -1]]).all()
    tilted = joint_angles(tracks_of(TIMES, angles), [None, 0])
    assert np.abs(tilted.angles[:, 0] - angles[:, 1]).max() < 1e-12


def test_orders_of_convergence_of_rates() -> None:
    """Cubic polynomials in windows of seven frames: error h^4 where they are symmetric, h^3 where they are not."""
    worst: dict[bool, list[float]] = {True: [], False: []}
    for count in (100, 200, 400):
        for even in worst:
            times = np.arange(count) / count
            if not even:
                times = times + 0.2 / count * np.sin(7.0 * np.arange(count))
            found = joint_angles(tracks_of(times, np.sin(9.0 * times)), [PIVOT])
            worst[even].append(np.nanmax(np.abs(found.rates[:, 0] - 9.0 * np.cos(9.0 * times))))
    for even, values in worst.items():
        ratios = np.array(values[:-1]) / values[1:]
        assert ratios == pytest.approx([16.0, 16.0] if even else [8.0, 8.0], rel=0.1)


@pytest.mark.thorough
def test_standard_errors_cover() -> None:
    """Errors over standard errors have the standard deviation 1, of angles and of rates, up to chance."""
    angles = np.stack([1.2 * np.sin(6.0 * TIMES), 5.0 * TIMES], axis=-1)
    rates = np.stack([7.2 * np.cos(6.0 * TIMES), np.full(200, 5.0)], axis=-1)
    off, slopes = [], []
    for seed in range(40):
        found = joint_angles(tracks_of(TIMES, angles, noise=0.05, seed=seed), [PIVOT, 0], window_length=9)
        apart = found.angles - angles
        off.append(apart / found.errors)
        slopes.append((found.rates - rates) / found.rate_errors)
    assert np.std(off, axis=(0, 1)) == pytest.approx([1.0, 1.0], abs=0.04)
    # Neighbours share a window of nine: fewer independent numbers.
    assert np.nanstd(np.array(slopes)[:, ::5], axis=(0, 1)) == pytest.approx([1.0, 1.0], abs=0.1)


def test_gaps_and_their_edges() -> None:
    """No angle in a gap, no rate within half a window of it; every rate where one-sided ones are asked for."""
    angles = 2.0 * np.sin(4.0 * TIMES)
    for absent in (False, True):
        tracks = tracks_of(TIMES, angles, hidden=range(60, 66))
        expected = np.full(200, True)
        expected[[0, 1, 2, *range(57, 69), -3, -2, -1]] = False
        if absent:
            kept = np.delete(np.arange(200), range(60, 66))
            tracks = tracks_of(TIMES[kept], angles[kept])
            expected = expected[kept]
        found = joint_angles(tracks, [PIVOT])
        assert (np.isfinite(found.rates[:, 0]) == expected).all()
        assert (np.isfinite(found.rate_errors[:, 0]) == expected).all()
        assert found.stretches.max() == 0
        sides = joint_angles(tracks, [PIVOT], one_sided=True)
        assert np.isfinite(sides.rates[:, 0]).sum() == 194
        truth = 8.0 * np.cos(4.0 * tracks.times)
        assert np.nanmax(np.abs(sides.rates[:, 0] - truth)) < 2e-3


def test_rotations_across_a_long_gap_are_not_known() -> None:
    """At 20 rad/s half a rotation takes 0.157 s: 0.1 s leave no doubt, 0.25 s do, and a new stretch begins."""
    for frames, stretches in ((20, 1), (50, 2)):
        found = joint_angles(tracks_of(TIMES, 20.0 * TIMES, hidden=range(60, 60 + frames - 1)), [PIVOT])
        assert found.stretches.max() + 1 == stretches
        assert (found.stretches[60 : 60 + frames - 1] == -1).all()
        after = found.angles[150, 0] - 20.0 * TIMES[150]
        assert after / (2 * pi) == pytest.approx(round(after / (2 * pi)), abs=1e-9)
        assert (abs(after) < 1e-9) == (stretches == 1)


@pytest.mark.parametrize(
    ("pivots", "options", "error"),
    [
        ([PIVOT, PIVOT], {}, "pivots are 2: give one, or None, for each of the 1 markers"),
        ([None], {}, "pivots are all None"),
        ([0], {}, "a marker is not its own pivot"),
        ([3], {}, r"pivots\[0\]=3"),
        ([(1.0, np.nan)], {}, r"pivots\[0\]\[1\]=nan"),
        ([PIVOT], {"window_length": 6}, "window_length=6: give an odd number"),
        ([PIVOT], {"window_length": 3}, "window_length=3: give a whole number of at least 5"),
        ([PIVOT], {"turn_limit": 1.0}, "turn_limit=1.0"),
    ],
)
def test_what_has_no_angles(pivots: Any, options: Any, error: str) -> None:
    with pytest.raises((TypeError, ValueError), match=error):
        joint_angles(tracks_of(TIMES, TIMES), pivots, **options)


def test_a_marker_that_is_never_known() -> None:
    with pytest.raises(ValueError, match="are known in 1 frames; 2 are needed"):
        joint_angles(tracks_of(TIMES, TIMES, hidden=range(199)), [PIVOT])


def arc(span: float, noise: float, seed: int, count: int = 200) -> Any:
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.7, 0.7 + span, count)
    return np.stack([30.0 + 50.0 * np.cos(angle), 20.0 + 50.0 * np.sin(angle)], axis=-1) + noise * rng.normal(
        size=(count, 2)
    )


def test_the_circle_of_least_squares() -> None:
    """Against another minimiser from another start; gaps are left out."""
    points = arc(1.5, 0.5, 0)
    points[7] = np.nan
    found = fit_circle(points)
    kept = points[np.isfinite(points[:, 0])]
    other = least_squares(lambda g: np.hypot(*(kept - g[:2]).T) - g[2], [0.0, 0.0, 30.0], xtol=1e-14, ftol=1e-14)
    assert [*found.centre, found.radius] == pytest.approx(other.x, rel=1e-6)
    assert found.arc == pytest.approx(1.5, abs=0.05)
    assert found.scatter == pytest.approx(0.5, rel=0.15)
    assert repr(found).startswith("Circle((")


@pytest.mark.thorough
@pytest.mark.parametrize("span", [0.6, 3.0, 6.2])
def test_standard_errors_of_the_circle(span: float) -> None:
    """The truth lies within 1.96 of them in 95 % of 400 cases, give or take 4 binomial standard deviations."""
    inside = []
    for seed in range(400):
        found = fit_circle(arc(span, 0.05, seed))
        off = np.array([*found.centre, found.radius]) - [30.0, 20.0, 50.0]
        inside.append(np.abs(off) < 1.96 * found.errors)
    assert np.mean(inside, axis=0) == pytest.approx(np.full(3, 0.95), abs=4.0 * np.sqrt(0.95 * 0.05 / 400))


@pytest.mark.parametrize(
    ("points", "error"),
    [
        (np.zeros((5, 3)), "give places"),
        (np.zeros((3, 2)), "3 are finite; give at least 4"),
        (np.full((9, 2), np.nan), "0 are finite"),
        (np.ones((9, 2)), "all at one place"),
        (np.outer(np.arange(9.0), [1.0, 2.0]), "points lie on a line"),
        (arc(0.05, 0.01, 3), "points span .* at least 0.2 are needed"),
    ],
)
def test_points_without_a_circle(points: Any, error: str) -> None:
    with pytest.raises(ValueError, match=error):
        fit_circle(points)


@pytest.mark.thorough
@pytest.mark.parametrize(("window", "degree"), [(7, 3), (9, 3), (7, 2), (11, 4)])
@pytest.mark.parametrize(("fast", "noise"), [(12.0, 0.02), (46.0, 0.005), (46.0, 0.1), (90.0, 0.02)])
def test_errors_of_rates_hold_what_a_polynomial_cannot_follow(window, degree, fast, noise):
    """From noise alone to 400 times that: 14 frames a swing are too few for parabolas, and for seven frames cubics."""
    times, squares, allowed = np.arange(400) / 200.0, [], []
    angle, rate = 0.5 * np.cos(fast * times), -0.5 * fast * np.sin(fast * times)
    for seed in range(5):
        found = joint_angles(tracks_of(times, angle, noise=noise, seed=seed), [PIVOT], window, degree)
        squares.append(np.nanmean((found.rates[:, 0] - rate) ** 2))
        allowed.append(np.nanmean(found.rate_errors[:, 0] ** 2))
    assert 0.9 < np.sqrt(np.mean(squares) / np.mean(allowed)) < 1.5
