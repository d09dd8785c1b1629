"""Grazing of impact surfaces, against closed forms of the linear oscillator."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq
from test_impacts import STRUCK
from two_tiers import at_once

from cellmap import CellGrid, ForcedSystem, continue_orbit, find_basins, stroboscopic_map
from cellmap.basins import load_basins, save_basins
from cellmap.maps import Impact, grazing_distance, jacobian
from cellmap.maps.grazing import contacts
from cellmap.orbits import periodic_orbit

FREE = STRUCK.with_params(damping=0.0, force=0.0, omega=1.0, wall=1.0, e=0.8)
FORCED = STRUCK.with_params(damping=0.1, wall=1.0)
AMPLITUDE = 1.0 / sqrt((1 - 0.8**2) ** 2 + (2 * 0.1 * 0.8) ** 2)


@pytest.mark.parametrize("reach", [0.5, 0.9, 1 - 1e-6, 1.0])
def test_distance_from_a_wall_that_is_not_reached(reach):
    """Oscillations between -a and a, with the wall at 1."""
    found = grazing_distance(stroboscopic_map(FREE), [[0.0, reach], [reach, 0.0]])
    assert found == pytest.approx((1 - reach) / (1 + reach), abs=1e-12)


@pytest.mark.parametrize("speed", [1e-2, 1e-4, 1e-6])
def test_impact_at_a_small_velocity(speed):
    """The wall decelerates nothing: without it the mass would come to rest speed^2/2 behind it.

    The saltation matrix has -(1 + e)/speed below its diagonal of -e, between the rotations of free motion.
    """
    exact, reach = stroboscopic_map(FREE, rtol=1e-12, atol=1e-12), sqrt(1 + speed**2)
    back = sqrt(1 + (0.8 * speed) ** 2)
    depth = grazing_distance(exact, [0.0, reach])
    assert depth == pytest.approx(speed**2 / 2 / (1 + back), rel=1e-3 + 1e-13 / speed**2)
    assert contacts(exact, np.array([[0.0, reach], [0.0, 0.5]]), 1)[1].tolist() == [1, 0]

    def rotation(t):
        return np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])

    first = np.arctan2(1.0, speed)
    expected = rotation(2 * pi - first) @ [[-0.8, 0.0], [-1.8 / speed, -0.8]] @ rotation(first)
    if speed > 1e-5:
        assert jacobian(exact, [0.0, reach]) == pytest.approx(expected, rel=1e-4, abs=1e-2)


@pytest.mark.parametrize(("beyond", "grazes"), [(1e-3, False), (1e-5, False), (1e-6, True), (0.0, True)])
def test_periodic_orbit_that_grazes(beyond, grazes):
    """The wall stands where the linear oscillator turns round, or a part of its amplitude behind that."""
    exact = stroboscopic_map(FORCED.with_params(wall=AMPLITUDE * (1 + beyond)), rtol=1e-12, atol=1e-12)
    linear = stroboscopic_map(FORCED.with_params(wall=10.0))
    orbit = periodic_orbit(exact, periodic_orbit(linear, [0.0, 0.0]).points[0])
    assert orbit.grazing_distance == pytest.approx(beyond / (2 + beyond), rel=1e-5, abs=1e-12)
    assert orbit.grazes is grazes
    assert ("grazes" in repr(orbit)) is grazes


def test_distance_over_several_periods():
    """The transient of a damped oscillator turns round nearest to the wall in its first period."""
    exact, place = stroboscopic_map(FORCED.with_params(force=0.0)), [0.99, 0.0]
    each = [grazing_distance(exact, exact.iterate(place, k).points) for k in range(3)]
    assert grazing_distance(exact, place, periods=3) == min(each)


def test_attractors_keep_it_in_files(tmp_path):
    basins = find_basins(
        stroboscopic_map(FORCED.with_params(wall=AMPLITUDE * 1.01)), CellGrid((-1, -1), (1, 1), (4, 4))
    )
    (near,) = (a for a in basins.attractors if a.grazing_distance < 0.01)
    assert near.grazing_distance == pytest.approx(0.01 / 2.01, rel=1e-4)
    save_basins(basins, tmp_path / "near.h5")
    assert [a.grazing_distance for a in load_basins(tmp_path / "near.h5").attractors] == [
        a.grazing_distance for a in basins.attractors
    ]


def test_surfaces_of_a_discontinuity_count_and_kinks_do_not():
    """A force that begins with a jump at q = 1, or with a kink there."""

    def distance(force):
        system = ForcedSystem(
            lambda t, x, p: (x[1], -x[0] - (force(x[0]) if x[0] > 1 else 0.0)), {}, 2 * pi, "q v".split()
        )
        return grazing_distance(stroboscopic_map(system), [0.9, 0.0])

    assert distance(lambda q: 0.5) == pytest.approx(0.1 / 1.9)
    assert distance(lambda q: 5.0 * (q - 1)) == np.inf


AT_ONE = Impact(lambda t, x, p: 1.0 - x[0], lambda t, x, p: (x[0], -p.e * x[1]))
MOVING = Impact(
    lambda t, x, p: 1.0 + 0.3 * sin(p.w * t) - x[0],
    lambda t, x, p: (x[0], (1 + p.e) * 0.3 * p.w * cos(p.w * t) - p.e * x[1]),
)
SLOWED = Impact(lambda t, x, p: 0.8 - x[1], lambda t, x, p: (x[0], 0.4))
STIFFNESS = 1 - 0.7**2 + 0.1j * 0.7  # force over displacement at the frequency 0.7


def struck(impact):
    def rhs(t, x, p):
        return x[1], p.F * cos(p.w * t) - 0.1 * x[1] - x[0]

    return ForcedSystem(rhs, {"F": 0.2, "w": 0.7, "e": 0.8}, lambda p: 2 * pi / p.w, ("x", "v"), impacts=[impact])


@pytest.mark.parametrize(
    ("impact", "force"),
    at_once(
        [(AT_ONE, abs(STIFFNESS))],
        later=[
            (MOVING, brentq(lambda f: abs(f / STIFFNESS + 0.3j) - 1.0, 0.2, 1.0, xtol=1e-14)),
            (SLOWED, 0.8 / 0.7 * abs(STIFFNESS)),
        ],
    ),
)
def test_a_branch_ends_where_its_orbit_begins_to_touch(impact, force):
    """The linear response, in closed form, reaches a wall, one that moves, and a bound of the velocity."""
    exact = stroboscopic_map(struck(impact), rtol=1e-11, atol=1e-11)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.4, 0.0]), "F", 0.1, 0.7, step=0.1)
    assert branch.ends == ("left the interval", "grazing")
    assert branch.values[-1] == pytest.approx(force, rel=1e-12)
    assert branch.orbit(len(branch.values) - 1).grazes


def test_a_branch_ends_where_its_orbit_loses_contact_and_where_an_impact_comes_to_the_section():
    """The orbit with one impact grazes at the force at which the linear response does."""
    exact = stroboscopic_map(struck(AT_ONE), rtol=1e-11, atol=1e-11).with_params(F=0.55)
    branch = continue_orbit(exact, periodic_orbit(exact, exact.iterate([0.2, 0.3], 400).points), "F", 0.2, 1, step=0.1)
    assert branch.ends == ("grazing", "impact at the section")
    assert branch.values[0] == pytest.approx(abs(STIFFNESS), rel=1e-8)
    assert branch.points[-1, 0] == pytest.approx(1.0, abs=1e-7)
    assert 0.52 < branch.bifurcations[0].value < 0.53


@pytest.mark.thorough
@pytest.mark.parametrize("force", [0.3, 1.0])
def test_branches_on_both_sides_of_the_onset_of_sliding_end_there(force):
    """A belt faster than the mass on it, until the linear response reaches its speed: then the mass sticks to it."""
    system = ForcedSystem(
        lambda t, x, p, s: (x[1], p.F * cos(p.w * t) - 0.1 * x[1] - x[0] - 0.3 * s[0]),
        {"F": force, "w": 0.7},
        lambda p: 2 * pi / p.w,
        ("x", "v"),
        switches=lambda t, x, p: (x[1] - 1.0,),
    )
    exact = stroboscopic_map(system, rtol=1e-11, atol=1e-11)
    branch = continue_orbit(
        exact, periodic_orbit(exact, exact.iterate([0.2, 0.3], 200).points), "F", 0.2, 1.2, step=0.1
    )
    ends = dict(zip(branch.ends, branch.values[[0, -1]], strict=True))
    assert ends.keys() == {"left the interval", "grazing"}
    assert ends["grazing"] == pytest.approx(abs(STIFFNESS) / 0.7, abs=1e-8)
