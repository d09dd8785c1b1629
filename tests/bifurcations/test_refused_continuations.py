"""Bifurcations that are not continued, tongues of angles that turn backwards, and messages that say why."""

from __future__ import annotations

from math import sin
from typing import Any

import pytest

from cellmap import PointMap, angle, continue_orbit, discrete_map, periodic_orbit
from cellmap.bifurcations import Branch, OrbitFunction, arnold_tongue, continue_bifurcation
from systems import henon_map


def branch_of(exact: PointMap, name: str) -> Branch:
    return continue_orbit(exact, periodic_orbit(exact, [0.0] * exact.dimension), name, 0.5, 1.5, step=0.2)


def test_bifurcations_of_other_branches_are_refused() -> None:
    cubic = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3 + p.e * x[0],), {"r": 0.5, "e": 0.0}, ("x",))
    henon = henon_map(0.2, 0.3)
    other = continue_orbit(henon, periodic_orbit(henon, [0.5, 0.2]), "a", 0.1, 0.6, step=0.1)
    branch = branch_of(cubic, "r")
    with pytest.raises(ValueError, match=r"^bifurcation=.*it is not of branch=.*give one of its"):
        continue_bifurcation(branch, other.bifurcations[0], "e", (0.0, 2.0), (-1.0, 1.0))
    assert len(continue_bifurcation(branch, branch.bifurcations[0], "e", (0.5, 1.5), (-0.5, 0.5), step=0.5).values) > 2


def test_degenerate_points_are_refused() -> None:
    twice: Any = {"r": 0.5, "e": 0.0}
    exact = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3, p.r * x[1] - x[1] ** 3), twice, ("x", "y"))
    branch = branch_of(exact, "r")
    with pytest.raises(ValueError, match=r"^bifurcation=Bifurcation\(degenerate.*no condition singles out"):
        continue_bifurcation(branch, branch.bifurcations[0], "e", (0.0, 2.0), (-1.0, 1.0))


def test_measures_are_listed_by_their_names() -> None:
    with pytest.raises(ValueError, match=r"^measure='max': choose one of 'maximum', 'minimum'"):
        OrbitFunction("x", "max")


def test_tongues_of_angles_that_turn_backwards() -> None:
    """Under x -> -x the tongue -1/3 of x - w - k sin x is the tongue 1/3 of x + w - k sin x."""

    def tongue(sign: int, rotations: int) -> Any:
        circle = discrete_map(lambda x, p: (x[0] + sign * p.w - p.k * sin(x[0]),), {"w": 2.0, "k": 0.8}, (angle("x"),))
        few: Any = {"transient": 200, "periods": 300, "step": 0.5}
        return arnold_tongue(circle, rotations, 3, ("w", "k"), (2.0, 2.4), (0.7, 0.9), [0.1], **few)

    ahead, back = tongue(1, 1), tongue(-1, -1)
    assert back.values == pytest.approx(ahead.values, abs=1e-9) and back.orbit.rotations == (-1,)
    with pytest.raises(ValueError, match=r"turns the other way, with the rotation number -0\.333333333"):
        tongue(-1, 1)
    with pytest.raises(ValueError, match="rotations=-4: give a whole number of at least -3"):
        tongue(-1, -4)
