"""Discrete maps, against closed forms and the numbers of REFERENCES.md."""

from math import cos, log, pi, sin

import numpy as np
import pytest

from cellmap import CellGrid, find_basins
from cellmap.attractors.kinds.exponents import Growing
from systems import grebogi_ott_yorke_map, henon_map, logistic_map, mcdonald_map, standard_map


def test_the_equations() -> None:
    x, y = 0.7, -0.4
    assert henon_map()([x, y]) == pytest.approx([1.0 - 1.4 * x * x + y, 0.3 * x], rel=1e-15)
    theta = x + 1.32 * sin(2.0 * x) - 0.90 * sin(4.0 * x) - y * sin(x)
    assert grebogi_ott_yorke_map()([x, y]) == pytest.approx([theta, -0.3 * cos(x)], rel=1e-14)
    assert mcdonald_map()([x, y]) == pytest.approx([3.0 * x - 2.0, 1.5 * y + cos(2.0 * pi * x)], rel=1e-14)
    assert mcdonald_map(degree=2)([x, y])[0] == pytest.approx(2.0 * x - 1.0, rel=1e-14)
    kicked = y + 0.9 * sin(x)
    assert standard_map(k=0.9)([x, y]) == pytest.approx([x + kicked, kicked], rel=1e-14)
    assert logistic_map(mu=3.5)([x]) == pytest.approx([3.5 * x * (1.0 - x)], rel=1e-15)


def test_henons_bounded_fraction() -> None:
    """0.4319 on 1000^2 points of [-2, 2]^2 (REFERENCES.md)."""
    basins = find_basins(henon_map(), CellGrid((-2.0, -2.0), (2.0, 2.0), (200, 200)))
    assert basins.fractions[0].fraction == pytest.approx(0.4319, abs=0.003)


def test_the_attractors_of_the_grebogi_ott_yorke_map_share_the_cylinder() -> None:
    basins = find_basins(grebogi_ott_yorke_map(), CellGrid((0.0, -0.5), (2.0 * pi, 0.5), (300, 300)))
    places = [a.points[0] for a in basins.attractors]
    assert places == [pytest.approx([0.0, -0.3], abs=1e-9), pytest.approx([pi, 0.3], abs=1e-9)]
    for attractor in basins.attractors:  # 1 + 2 a - 4 b -+ c, and 0
        assert np.abs(attractor.multipliers) == pytest.approx([0.34, 0.0], abs=1e-9)
    assert [f.fraction for f in basins.fractions.values()] == pytest.approx([0.5, 0.5], abs=0.003)


@pytest.mark.parametrize(("degree", "growth"), [(3, 1.5), (2, 1.5), (3, 2.5)])
def test_the_boundary_of_mcdonalds_map(degree: int, growth: float) -> None:
    """Points above the closed form escape upwards, those below downwards; on [-2, 2] each side has a half."""
    n, terms = 100, 60
    # Abscissae are odd multiples of 1/(2 n), so that turns^k x is known exactly, modulo 1.
    numerators = [2 * i + 1 for i in range(n)]
    boundary = np.array(
        [-sum(cos(pi * (m * degree**k % (2 * n)) / n) / growth ** (k + 1) for k in range(terms)) for m in numerators]
    )
    point_map = mcdonald_map(degree, growth)
    heights = np.linspace(-2.0, 2.0, 101)
    initial_conditions = np.stack(np.meshgrid(np.array(numerators) / (2 * n), heights, indexing="ij"), axis=-1)
    ends = point_map.iterate(initial_conditions, 30).points[..., 1]
    above = heights - boundary[:, None]
    clear = np.abs(above) > 1e-3
    assert (np.abs(ends[clear]) > 1.0 / (growth - 1.0)).all()
    assert (np.sign(ends[clear]) == np.sign(above[clear])).all()
    assert np.mean(ends > 0.0) == pytest.approx(0.5, abs=0.01)


def test_the_exponent_and_the_density_of_the_logistic_map() -> None:
    """For mu = 4, ln 2 and 1/(pi sqrt(x (1 - x))), from initial conditions that have this density."""
    point_map = logistic_map()
    initial_conditions = np.sin(0.5 * pi * np.random.default_rng(0).uniform(0.0, 1.0, (1000, 1))) ** 2
    exponents = Growing.along(point_map, initial_conditions, 200).exponents
    assert exponents.mean() == pytest.approx(log(2.0), abs=2e-3)
    cloud = np.sort(np.concatenate([point_map.iterate(initial_conditions, n).points[:, 0] for n in range(30, 50)]))
    fraction = np.arange(len(cloud)) / len(cloud)
    assert np.abs(2.0 / pi * np.arcsin(np.sqrt(cloud)) - fraction).max() < 0.02
