"""A trace replaces its function only where it says the same."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap._compiled.codegen.kernel import why_untraced


def image(rhs, initial_condition=(1.0,)):
    names = ("x", "y")[: len(initial_condition)]
    return stroboscopic_map(ForcedSystem(rhs, {}, 1.0, names))(initial_condition)


def asks_for_the_type(t, x, p):
    return (-x[0] if isinstance(x[0], float) else -5.0 * x[0],)


def catches(t, x, p):
    try:
        v = math.log(x[0] - 10.0)
    except ValueError:
        v = -x[0]
    return (v,)


def test_function_that_asks_for_types():
    assert why_untraced(asks_for_the_type, 1, {}).startswith("they give other values than the function")
    assert image(asks_for_the_type)[0] == pytest.approx(math.exp(-1.0), abs=1e-8)


def test_function_that_catches_exceptions_is_refused():
    assert why_untraced(catches, 1, {}) != ""
    assert why_untraced(lambda t, x, p: (-x[0],), 1, {}) == ""
    with pytest.raises(TypeError, match="cannot be compiled"):
        image(catches)


def test_redefined_helper_is_seen():
    scope: dict[str, object] = {}
    exec("def helper(x): return -x\ndef rhs(t, x, p): return helper(x[0]),", scope)
    assert image(scope["rhs"])[0] == pytest.approx(math.exp(-1.0), abs=1e-8)
    exec("def helper(x): return -2 * x", scope)
    assert image(scope["rhs"])[0] == pytest.approx(math.exp(-2.0), abs=1e-8)


def test_compiled_functions_are_taken():
    assert image(numba.njit(lambda t, x, p: (-x[0],)))[0] == pytest.approx(math.exp(-1.0), abs=1e-8)
    assert discrete_map(numba.njit(lambda x, p: (x[0] / 2,)), {}, ("x",))([1.0])[0] == 0.5


def test_functions_of_any_number_of_arguments():
    largest, length = image(lambda t, x, p: (max(x[0], x[1], 0.0), math.hypot(3.0, 4.0, 12.0)), (1.0, -20.0))
    assert largest == pytest.approx(math.e, abs=1e-8)
    assert length == pytest.approx(-7.0, abs=1e-8)


def test_lists_that_are_too_short():
    for values in ([1.0, 2.0], np.ones(2)):
        with pytest.raises(ValueError, match="rhs reads beyond the end of a list or an array"):
            ForcedSystem(lambda t, x, p, values=values: (values[2] * x[0],), {}, 1.0, "q")


def test_more_state_variables_than_coordinates():
    with pytest.raises(ValueError, match=r"more state variables than there are coordinates \(q\)"):
        ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 1.0, "q")
