"""Orbits that nothing bounds have diverged, long before 1e100; those that come back from far away have not."""

from math import pi, sin

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, Label, discrete_map, find_basins, stroboscopic_map
from cellmap.basins.classification import labeller

WINDOW = CellGrid((-1.5, -1.0), (1.5, 1.0), (12, 12))


@pytest.mark.parametrize("rate", [1.02, 1.1, 3.0])
def test_orbits_that_grow_for_ever_have_diverged(rate):
    """x grows by a factor from 0.75 on, and halves below that.  Labels of points and of `verify` are the same."""
    split = discrete_map(lambda x, p: (p.a * x[0] if x[0] > 0.75 else 0.5 * x[0], 0.5 * x[1]), {"a": rate}, ("x", "y"))
    basins = find_basins(split, WINDOW)
    right = np.where(WINDOW.centres()[..., 0] > 0.75, Label.DIVERGED, 0)
    assert np.array_equal(basins.labels, right)
    assert np.array_equal(labeller(basins)(WINDOW.centres().reshape(-1, 2)), right.ravel())
    again = basins.verify(100)
    assert (again.compared, again.wrong) == (100, 0)


def test_the_sporadical_map_escapes():
    """Its published attractors are at y = +-infinity: Wagemakers, arXiv 2504.01580."""

    def sporadical(x, p):
        if x[0] <= 0.0:
            z = 9.0 * x[0] / (4.0 - 5.0 * x[0])
        elif x[0] <= 4.0 / 9.0:
            z = 2.25 * x[0]
        elif x[0] <= 5.0 / 9.0:
            z = 20.25 * (x[0] - x[0] * x[0]) - 4.0
        else:
            z = 2.25 * (1.0 - x[0])
        return z, 1.1 * x[1] + sin(2.0 * pi * x[0])

    basins = find_basins(discrete_map(sporadical, {}, ("x", "y")), CellGrid((0, -2), (1, 6), (20, 20)))
    assert (basins.labels == Label.DIVERGED).all() and basins.cost.steps < 400 * 300


def lorenz(t, u, p):
    return 0.12 * (u[1] - u[0]), -u[0] * u[2] - u[1], u[0] * u[1] + 0.6 * u[2]


def test_orbits_that_turn_ever_faster_escape_beside_chaos_as_well():
    """z grows by exp(0.6) in a period along its axis, beside which x and y turn at a rate like sqrt(z).

    Of nine states a public study of basin stability says where they end (Stender, Hoffmann 2022); four of those that
    are unbounded are so after a chaotic transient of more than 64 periods.
    """
    strobe = stroboscopic_map(ForcedSystem(lorenz, {}, 1.0, ("x", "y", "z")))
    assert (find_basins(strobe, [[-0.5, -0.5, 6.0], [0.5, -0.5, 7.0]]).labels == Label.DIVERGED).all()
    bounded = [(7.6453857, 16.600159), (-1.41191, 15.417717), (8.293919, -11.854038), (2.8611069, -4.3688774)]
    late = [(-7.8937016, -9.220207), (9.03109, -16.989365), (3.739272, -3.5144272), (-6.3278904, -16.0377)]
    states = np.array([(x, y, 0.0) for x, y in [*bounded, *late, (9.186113, -4.3820715)]])
    basins = find_basins(strobe, states, 300)
    assert (basins.labels[:4] >= 0).all() and (basins.labels[4:] == Label.DIVERGED).all()


def spiking(x, p):
    return (3.0 * x[0] if x[0] < 0 else 1.5 * x[0] if x[0] < 1e9 else 1.0 + 1e-10 * x[0]), 0.5 * x[1]


COME_BACK = {
    "excursions to 1e9, beside orbits that escape": (spiking, WINDOW),
    "spirals from 1e8": (lambda x, p: (0.97 * x[0] - 0.2 * x[1], 0.97 * x[1] + 0.2 * x[0]), ((1e8, -1), (1e8 + 1, 1))),
    "logistic growth to 1e9": (lambda x, p: (x[0] * (1.5 - 0.5e-9 * x[0]), 0.5 * x[1]), ((0.5, -1), (1.5, 1))),
    "a node at 1e9": (lambda x, p: (0.99 * x[0] + 1e7, 0.5 * x[1]), ((0.5, -1), (1.5, 1))),
}


@pytest.mark.parametrize("name", COME_BACK)
def test_orbits_that_come_back_have_not_diverged(name):
    function, window = COME_BACK[name]
    grid = window if isinstance(window, CellGrid) else CellGrid(*window, (12, 12))
    basins = find_basins(discrete_map(function, {}, ("x", "y")), grid)
    assert len(basins.attractors) == 1
    right = np.where((grid.centres()[..., 0] < 0.0) & (function is spiking), Label.DIVERGED, 0)
    assert np.array_equal(basins.labels, right)
