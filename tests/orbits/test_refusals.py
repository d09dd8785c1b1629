"""What does not fit together, or is too little; what is wrong by itself is in `tests/_lib/bad_input/`."""

import numpy as np
import pytest

from cellmap import CellGrid, find_periodic_orbits, lyapunov_spectrum, periodic_orbit
from cellmap.orbits import (
    alignment_test,
    covariant_vectors,
    exponent_test,
    finite_time_exponents,
    zero_one_test,
    zero_one_test_of_series,
)
from systems import henon_map

HENON, SERIES, LINE, X = henon_map(), np.zeros(300), CellGrid((0.0,), (1.0,), (3,)), [0.1, 0.1]
REFUSED = {
    "initial_conditions is empty": lambda: lyapunov_spectrum(HENON, np.empty((0, 2)), 20),
    "remove points that are not finite": lambda: lyapunov_spectrum(HENON, [[0.0, np.nan]], 20),
    "periods=19: give a whole number of at least 20": lambda: lyapunov_spectrum(HENON, X, 19),
    "initial_conditions is empty.*": lambda: exponent_test(HENON, np.empty((0, 2))),
    "periods=10: give a whole number of at least": lambda: exponent_test(HENON, X, 10),
    "periods=10: give a whole number of at least.*": lambda: zero_one_test(HENON, X, 10),
    "one number for each": lambda: zero_one_test(HENON, X, 300, observable=lambda x: x),
    "at least 200 values": lambda: zero_one_test_of_series(SERIES[:100]),
    "not finite": lambda: zero_one_test_of_series(SERIES + np.nan),
    "at least one series": lambda: zero_one_test_of_series(np.zeros((300, 0))),
    "frequencies=5": lambda: zero_one_test_of_series(SERIES, 5),
    "confidence=1.0": lambda: zero_one_test_of_series(SERIES, 20, 1.0),
    "periods=43": lambda: alignment_test(HENON, X, 43),
    "order=3": lambda: alignment_test(HENON, X, order=3),
    "order=1": lambda: alignment_test(HENON, X, order=1),
    "give one point": lambda: covariant_vectors(HENON, [X], periods=30),
    "orbit terminates": lambda: covariant_vectors(HENON, [1e200, 0.0], periods=30),
    "periods=19": lambda: covariant_vectors(HENON, X, periods=19),
    "derivative is singular": lambda: covariant_vectors(henon_map(1.4, 0.0), X, periods=30),
    "grid has 1 axis": lambda: finite_time_exponents(HENON, LINE, 1),
    "one state": lambda: periodic_orbit(HENON, [X]),
    "1 axis": lambda: find_periodic_orbits(HENON, LINE),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_does_not_fit_is_refused(message):
    with pytest.raises(ValueError, match=message):
        REFUSED[message]()


def test_memory_is_claimed_beforehand(monkeypatch):
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: 1000)
    with pytest.raises(MemoryError, match=r"exponents of 35 initial conditions needs 1.12 kB.*take fewer cells"):
        finite_time_exponents(HENON, CellGrid((-1.0, -1.0), (1.0, 1.0), (7, 5)), 1)
    with pytest.raises(MemoryError, match=r"frames along 50 steps needs 4.8 kB.*take fewer periods"):
        covariant_vectors(HENON, X, periods=20, transient=30)
