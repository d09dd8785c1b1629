"""Branches of the driven pendulum and of Henon's map, and curves of the generalised one."""

import pytest
from cases import INVERTED, branch_of, generalised_henon

from cellmap import stroboscopic_map
from cellmap.bifurcations import continue_bifurcation
from systems import driven_pendulum, henon_map


@pytest.fixture(scope="session")
def pendulum():
    return stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)


@pytest.fixture(scope="session")
def inverted(pendulum):
    return branch_of(pendulum, INVERTED, "amplitude", 0.001, 0.014)


@pytest.fixture(scope="session")
def henon():
    return branch_of(henon_map(0.2, 0.3), [0.5, 0.2], "a", -1.0, 1.4, max_points=300)


@pytest.fixture(scope="session")
def henon_curves():
    """Folds, period doublings and Neimark-Sacker bifurcations of the fixed points, by their kinds."""
    branch = branch_of(generalised_henon(), [0.2, 0.2], "alpha", -2.0, 4.0)
    box = (-2.0, 4.0), (-2.0, 2.0)
    return {b.kind: continue_bifurcation(branch, b, "beta", *box, step=0.05) for b in branch.bifurcations}
