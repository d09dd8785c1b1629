"""Systems with a band matrix, against NumPy's solutions with the full one."""

import numpy as np
import pytest

from cellmap._compiled.kernels.banded import solve_banded


@pytest.mark.parametrize(("n", "reach"), [(1, 0), (1, 4), (5, 4), (40, 1), (60, 6)])
def test_solutions_are_those_of_the_full_matrix(n: int, reach: int) -> None:
    rng = np.random.default_rng(n)
    matrix = rng.standard_normal((n, n))
    rows, columns = np.indices((n, n))
    matrix[abs(rows - columns) > reach] = 0.0
    matrix[np.arange(0, n - 1, 3), np.arange(0, n - 1, 3)] = 0.0  # nothing is found without an exchange of rows
    band = np.zeros((n, 3 * reach + 1))
    inside = abs(rows - columns) <= reach
    band[rows[inside], (columns - rows + reach)[inside]] = matrix[inside]
    right = rng.standard_normal((n, 3))
    expected = np.linalg.solve(matrix, right)
    solve_banded(band, reach, right)
    assert right == pytest.approx(expected, rel=1e-9, abs=1e-9)
