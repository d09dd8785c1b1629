"""Linear maps, and the driven pendulum."""

import pytest

from cellmap import discrete_map, stroboscopic_map
from systems import driven_pendulum


@pytest.fixture(scope="session")
def linear():
    """The map of a matrix, as a function."""

    def of(matrix):
        rows = [[float(entry) for entry in row] for row in matrix]
        return discrete_map(
            lambda x, p: tuple(sum(a * b for a, b in zip(row, x, strict=True)) for row in rows),
            {},
            tuple("abcd"[: len(rows)]),
        )

    return of


@pytest.fixture(scope="session")
def pendulum():
    return stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)
