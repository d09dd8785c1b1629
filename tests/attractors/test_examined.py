"""What a search has tried is not tried again."""

from __future__ import annotations

from math import pi

import numpy as np

import systems
from cellmap import Label, discrete_map, find_basins, stroboscopic_map
from cellmap.attractors.examined import Examined, guesses_of
from cellmap.attractors.quasiperiodic import Found
from cellmap.attractors.search import curves_and_cycles
from cellmap.orbits.newton import newton, return_distances


def test_no_guess_is_refined_twice(monkeypatch):
    """Orbits in a chaotic transient: looks at the same ends, for the sample and for its labels, cost nothing more."""
    guesses = []

    def counted(point_map, points, periods, extent, **options):
        guesses.extend((point.tobytes(), int(period)) for point, period in zip(points, periods, strict=True))
        return newton(point_map, points, periods, extent, **options)

    monkeypatch.setattr("cellmap.attractors.examined.newton", counted)
    initial_conditions = np.random.default_rng(0).uniform((-pi, -3.0), (pi, 3.0), (200, 2))
    basins = find_basins(
        stroboscopic_map(systems.dimensionless_pendulum(0.25, 0.59, 0.05)), initial_conditions, max_periods=600
    )
    assert [a.period for a in basins.attractors] == [6]
    assert (basins.labels == Label.UNDECIDED).any()
    assert len(guesses) == len(set(guesses)) > 100


def test_ends_of_the_last_look_are_not_followed_again(monkeypatch):
    """Their distances are the same numbers as before; only ends that are new are followed."""
    henon = discrete_map(lambda x, p: (1 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
    ends = np.random.default_rng(0).uniform(-0.5, 0.5, (9, 2))
    whole = Examined.nothing_yet(henon, np.ones(2)).return_distances(henon, ends, 8)
    examined, followed = Examined.nothing_yet(henon, np.ones(2)), []

    def counted(point_map, points, *arguments):
        followed.append(len(points))
        return return_distances(point_map, points, *arguments)

    monkeypatch.setattr("cellmap.attractors.examined.return_distances", counted)
    for part in (slice(0, 5), slice(2, 9), slice(2, 9)):
        assert np.array_equal(examined.return_distances(henon, ends[part], 8), whole[:, part])
    assert followed == [5, 4]


def wells(x, p):
    """Return steps x -> x + (x - x^3) / 4 to +-1, with multipliers 1/2; the first coordinate changes its sign."""
    first = x[0] + 0.25 * (x[0] - x[0] ** 3)
    return -first, *(v + 0.25 * (v - v**3) for v in x[1:])


def test_ends_that_have_closed_are_guesses_of_their_periods_once_for_each_place():
    six = discrete_map(wells, {}, tuple(f"x{i}" for i in range(6)))
    places = np.sign(np.random.default_rng(0).uniform(-1, 1, (9, 6)))
    ends = np.repeat(places, 5, axis=0) + 1e-9 * np.random.default_rng(1).standard_normal((45, 6))
    examined = Examined.nothing_yet(six, np.ones(6), ends)
    guesses, periods = next(guesses_of(six, ends, 8, np.ones(6), examined))
    assert np.unique(np.round(guesses), axis=0).tolist() == np.unique(places, axis=0).tolist()
    assert periods.tolist() == [2] * len(np.unique(places, axis=0))


def test_orbits_are_not_followed_along_curves_twice(monkeypatch):
    looks = []
    monkeypatch.setattr(
        "cellmap.attractors.search.quasiperiodic_attractors", lambda *a: looks.append(a[3]) or Found([], [])
    )
    six = discrete_map(wells, {}, tuple(f"x{i}" for i in range(6)))
    states = np.ones((3, 6))
    examined = Examined.nothing_yet(six, np.ones(6), states)
    for age, slow in ((64, False), (64, False), (128, False), (128, True)):
        curves_and_cycles(six, states, [], np.ones(6), examined, age, slow)
    assert looks == [64, 128, 128]
