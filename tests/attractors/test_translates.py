"""Attractors that are one and the same, full rotations apart, in a coordinate that was not declared as an angle."""

import warnings
from math import cos, pi, sin

import pytest

from cellmap import CellGrid, ForcedSystem, angle, discrete_map, find_attractors, find_basins, stroboscopic_map
from cellmap.attractors import translates
from cellmap.maps import PointMap

WIDE = CellGrid((-3 * pi, -1), (3 * pi, 1), (12, 2))


def pendulum(force, first="theta") -> PointMap:
    def rhs(t, x, p):
        return x[1], -force(x[0]) - 0.5 * x[1] + 0.2 * cos(t)

    return stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, (first, "v")))


def test_a_pendulum_without_an_angle(monkeypatch: pytest.MonkeyPatch) -> None:
    """On three wells and at the bottom of two at the edges, one attractor is five."""
    exact = pendulum(sin)
    with pytest.warns(UserWarning, match=r"of . attractors, such as 1, .* as 0, .* 2 pi in theta, .* angle\('theta'\)"):
        basins = find_basins(exact, WIDE)
    monkeypatch.setattr(translates, "_MOST", 3)  # as many as there are: all of them are compared
    with pytest.warns(UserWarning, match=r"^2 of 3 attractors"):
        found = find_attractors(exact, [[0.1, 0.0], [6.2, 0.0], [-6.2, 0.0]])
    assert len(basins.attractors) >= len(found) == 3
    assert len(find_basins(pendulum(sin, angle("theta")), CellGrid((-pi, -1), (pi, 1), (12, 2))).attractors) == 1


def test_two_rotors_and_a_discrete_map() -> None:
    def rotors(x, p):
        a, b, u, w = x
        return a + u, b + w, 0.5 * u - 0.3 * sin(a) + 0.01 * sin(b - a), 0.5 * w - 0.3 * sin(b)

    pair = discrete_map(rotors, {}, ("a", "b", "u", "w"))
    with pytest.warns(UserWarning, match=r"3 of 4 .* in a or b, .* give angle\('a'\), angle\('b'\) among"):
        find_attractors(pair, [[x, y, 0.0, 0.0] for x in (0.1, 6.3) for y in (0.1, 6.3)])
    with pytest.warns(UserWarning, match=r"1 of 2 .* in a, .* give angle\('a'\) among"):
        find_attractors(pair, [[x, 0.1, 0.0, 0.0] for x in (0.1, 6.3)])


@pytest.mark.parametrize(
    "force",
    [
        lambda x: sin(x / 2),  # its wells are 4 pi apart, and 2 pi is no period
        lambda x: x * (x * x - pi * pi),  # its two wells are 2 pi apart
        lambda x: sin(x) + 0.001 * x,
        lambda x: sin(2 * pi * x),  # a lattice of another period
    ],
)
def test_wells_that_are_no_translates_bring_no_warning(force) -> None:
    states = [[x, 0.0] for x in (-4 * pi, -pi, 0.0, pi, 2 * pi, 4 * pi)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(find_attractors(pendulum(force), states)) > 1
