"""A trace replaces its function only where it says the same."""

import math

import numpy as np
import pytest

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap._compiled.codegen.kernel import why_untraced


def image(rhs, initial_condition=(1.0,)):
    names = ("x", "y")[: len(initial_condition)]
    return stroboscopic_map(ForcedSystem(rhs, {}, 1.0, names))(initial_condition)


def test_functions_that_ask_for_types_or_catch_exceptions():
    def asks(t, x, p):
        return (-x[0] if isinstance(x[0], float) else -5.0 * x[0],)

    def catches(t, x, p):
        try:
            return (math.log(x[0] - 10.0),)
        except ValueError:
            return (-x[0],)

    assert why_untraced(asks, 1, {}).startswith("they give other values than the function")
    assert image(asks)[0] == pytest.approx(math.exp(-1.0), abs=1e-8)
    assert why_untraced(catches, 1, {}) != ""
    assert why_untraced(lambda t, x, p: (-x[0],), 1, {}) == ""
    with pytest.raises(TypeError, match="cannot be compiled"):
        image(catches)


def test_a_map_without_formulas_warns_of_what_it_costs():
    def looks_up(t, x, p):
        return (-x[0] * (1.0, p.k)[int(x[0] > 9.0)] + math.gamma(2.0 + math.sin(x[0])),)

    with pytest.warns(UserWarning, match=r"one step takes [\d.e+]+ times .* \(measured .* length of a loop"):
        point_map = stroboscopic_map(ForcedSystem(looks_up, {"k": 2.0}, 1.0, ("x",)))
    assert "length of a loop" in repr(point_map)


def test_redefined_helper_is_seen():
    scope: dict[str, object] = {}
    exec("def helper(x): return -x\ndef rhs(t, x, p): return helper(x[0]),", scope)
    assert image(scope["rhs"])[0] == pytest.approx(math.exp(-1.0), abs=1e-8)
    exec("def helper(x): return -2 * x", scope)
    assert image(scope["rhs"])[0] == pytest.approx(math.exp(-2.0), abs=1e-8)


def test_compiled_functions_are_taken():
    import numba

    assert image(numba.njit(lambda t, x, p: (-x[0],)))[0] == pytest.approx(math.exp(-1.0), abs=1e-8)
    assert discrete_map(numba.njit(lambda x, p: (x[0] / 2,)), {}, ("x",))([1.0])[0] == 0.5


def test_functions_of_any_number_of_arguments():
    largest, length = image(lambda t, x, p: (max(x[0], x[1], 0.0), math.hypot(3.0, 4.0, 12.0)), (1.0, -20.0))
    assert largest == pytest.approx(math.e, abs=1e-8)
    assert length == pytest.approx(-7.0, abs=1e-8)


@pytest.mark.parametrize(
    ("rhs", "said"),
    [
        (lambda t, x, p, values=[1.0, 2.0]: (values[2] * x[0],), "rhs reads beyond the end of a list or an array"),
        (lambda t, x, p, values=np.ones(2): (values[2] * x[0],), "rhs reads beyond the end of a list or an array"),  # noqa: B008
        (lambda t, x, p: (x[1], -x[0]), r"more state variables than there are coordinates \(q\)"),
    ],
)
def test_what_is_too_short_is_refused(rhs, said):
    with pytest.raises(ValueError, match=said):
        ForcedSystem(rhs, {}, 1.0, "q")
