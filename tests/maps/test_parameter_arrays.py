"""Parameters that are arrays: entries are parameters like others, with names such as K[0, 1]."""

from __future__ import annotations

import pickle
from math import cos, pi
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap.maps import swept_map

MATRIX = np.array([[0.0, 0.3], [0.2, 0.0]])
POWERS = np.array([0.5, -0.1])


def coupled(t: float, x: Any, p: Any) -> tuple[Any, ...]:
    return tuple(-x[i] + p.P[i] * cos(t) + p.c * sum(p.K[i, j] * (x[j] - x[i]) for j in range(2)) for i in range(2))


def by_numbers(t: float, x: Any, p: Any) -> tuple[Any, ...]:
    a, b = x
    return -a + p.P0 * cos(t) + p.c * p.K01 * (b - a), -b + p.P1 * cos(t) + p.c * p.K10 * (a - b)


SYSTEM = ForcedSystem(coupled, {"K": MATRIX, "c": 2.0, "P": POWERS}, 2 * pi, ("a", "b"))
NUMBERS = ForcedSystem(by_numbers, {"c": 2.0, "K01": 0.3, "K10": 0.2, "P0": 0.5, "P1": -0.1}, 2 * pi, ("a", "b"))


def test_arrays_are_as_good_as_numbers() -> None:
    exact = stroboscopic_map(SYSTEM)
    np.testing.assert_allclose(exact([0.3, 0.4]), stroboscopic_map(NUMBERS)([0.3, 0.4]), rtol=1e-9)
    assert list(exact.params)[:5] == ["K[0, 0]", "K[0, 1]", "K[1, 0]", "K[1, 1]", "c"]
    assert "K: 4 entries" in repr(SYSTEM) and "K: 4 entries" in repr(exact)
    np.testing.assert_array_equal(SYSTEM.parameters.K, MATRIX)


def test_arrays_and_entries_change() -> None:
    changed = SYSTEM.with_params(K=MATRIX.T)
    np.testing.assert_array_equal(changed.parameters.K, MATRIX.T)
    exact, own = stroboscopic_map(SYSTEM), {"K[0, 1]": 0.2, "K[1, 0]": 0.3}
    np.testing.assert_array_equal(exact.with_params(**own)([0.3, 0.4]), stroboscopic_map(changed)([0.3, 0.4]))
    with pytest.raises(ValueError, match="this system has 4 entries"):
        SYSTEM.with_params(K=np.ones((1, 2)))
    with pytest.raises(ValueError, match=r"K\[2, 0\]"):
        SYSTEM.with_params(K=np.ones((3, 2)))


def test_entries_are_swept_like_numbers() -> None:
    swept = swept_map(stroboscopic_map(SYSTEM), "K[0, 1]")
    expected = stroboscopic_map(SYSTEM.with_params(**{"K[0, 1]": 0.7}))([0.3, 0.4])
    np.testing.assert_allclose(swept([[0.3, 0.4, 0.7]])[0, :2], expected, rtol=1e-8)


def test_pickles_and_discrete_maps() -> None:
    again = pickle.loads(pickle.dumps(SYSTEM))
    assert again.params == SYSTEM.params
    linear = discrete_map(lambda x, p: tuple(p.A @ np.array(x)), {"A": MATRIX}, ("x", "y"))
    np.testing.assert_allclose(linear([1.0, 2.0]), MATRIX @ [1.0, 2.0], rtol=1e-15)


def test_some_entries_are_no_array() -> None:
    with pytest.raises(ValueError, match="not all of them"):
        ForcedSystem(coupled, {"K[0, 1]": 0.3, "c": 2.0, "P": POWERS}, 2 * pi, ("a", "b"))
