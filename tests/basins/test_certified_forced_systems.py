"""Certified labels of forced systems of other kinds, against another integrator with attractors of its own."""

from __future__ import annotations

from math import cos, inf, pi

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, certify, find_basins, interpolated_map, stroboscopic_map
from cellmap.basins import Evidence


def lorenz(t, x, p):
    """Lorenz (1963) with a forced Rayleigh number below that of chaos: two fixed points attract."""
    return 9.0 * (x[1] - x[0]), x[0] * (10.0 + 0.5 * cos(6.0 * t) - x[2]) - x[1], x[0] * x[1] - 2.5 * x[2]


def switch(t, x, p):
    """Toggle switch of two genes that repress each other (Gardner, Cantor, Collins 2000), one of them driven."""
    return 3.0 / (1 + x[1] ** 4) - x[0] + 0.2 * cos(t), 2.6 / (1 + x[0] ** 4) - x[1]


@pytest.mark.parametrize(
    ("rhs", "period", "window", "grid", "order"),
    [
        (
            lorenz, pi / 3, CellGrid((-18, -25, -8), (18, 25, 35), (14, 14, 14)),
            CellGrid((-12, -12, 0), (12, 12, 20), (8, 8, 5)), 3,
        ),
        (switch, 2 * pi, CellGrid((-0.8, -0.2), (5, 5), (24, 24)), CellGrid((0, 0), (4, 4), (24, 24)), 1),
    ],
    ids=["Lorenz", "switch"],
)  # fmt: skip
def test_no_certified_label_is_wrong(rhs, period, window, grid, order):
    """On coarse interpolation grids; initial conditions are few beside the boundary, where labels may stay open."""
    system = ForcedSystem(rhs, {}, period, ("x", "y", "z")[: grid.dimension])
    table = interpolated_map(stroboscopic_map(system), window, order, tolerance=10.0)
    certificate = certify(find_basins(table, grid, 300), audit=50, max_cost=inf)
    direct = find_basins(stroboscopic_map(system, method="DOP853", rtol=1e-12, atol=1e-13), grid, 300)
    (ours, theirs) = ([a.points[0] for a in b.attractors] for b in (certificate.basins, direct))
    assert len(ours) == 2
    np.testing.assert_allclose(ours, theirs, atol=1e-5)  # the tolerance of the map that is interpolated
    sure = certificate.evidence != Evidence.OPEN
    assert sure.mean() > 0.9
    assert np.array_equal(certificate.basins.labels[sure], direct.labels[sure])
