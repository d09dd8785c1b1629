"""NaN in formulas: NumPy's functions keep it, Python's max and min go by order, comparisons with it do not hold."""

import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, Status, discrete_map, stroboscopic_map

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of NumPy, where there is no value
Function = Callable[..., Any]

OF_ONE: list[Function] = [
    np.sign, np.abs, abs, np.floor, np.ceil, np.trunc, np.tanh, np.sqrt, lambda a: np.clip(a, -0.5, 0.75), lambda a: -a,
    lambda a: max(a, 0.0), lambda a: min(0.25, a), lambda a: np.interp(a, [-1.0, 0.0, 2.0], [3.0, -1.0, 1.0]),
]  # fmt: skip
OF_TWO: list[Function] = [
    np.maximum, np.minimum, np.fmax, np.fmin, np.copysign, np.heaviside, max, min, np.divide, np.multiply, np.add,
    lambda a, b: 1.0 if a > b else -2.0, lambda a, b: 1.0 if a >= b else -2.0, lambda a, b: 1.0 if not a <= b else -2.0,
    lambda a, b: np.where(a <= b, a, -2.0) * 1.0, lambda a, b: np.where(a < 0.0, 3.0, b) * 1.0,
    lambda a, b: max(a, b, 0.5), lambda a, b: min(1.0, a, b, -1.0),
    lambda a, b: np.where(np.logical_not(a >= b), a, b) * 1.0,
]  # fmt: skip
PLACES = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (-0.0, 1.0), (0.3, -0.7), (-2.0, 1.5), (0.0, -1.0), (1.0, 1.0)]


def nesting(rng: random.Random, depth: int) -> Function:
    """Return a random nesting of these functions, of two states."""
    if depth == 0:
        return rng.choice([lambda x: x[0], lambda x: x[1], lambda x: x[0] / x[1], lambda x: np.sqrt(x[0] - x[1])])
    if rng.random() < 0.4:
        one, inner = rng.choice(OF_ONE), nesting(rng, depth - 1)
        return lambda x: one(inner(x))
    two, left, right = rng.choice(OF_TWO), nesting(rng, depth - 1), nesting(rng, rng.randrange(depth))
    return lambda x: two(left(x), right(x))


@pytest.mark.parametrize("seed", range(6))
def test_random_nestings_give_what_numpy_and_python_give(seed: int) -> None:
    """The witness is the function itself, called with NumPy's numbers, whose division by zero is NaN or infinite."""
    rng = random.Random(seed)
    f, g, h = (nesting(rng, 3) for _ in range(3))

    def image(x: Sequence[float], p: Any) -> tuple[Any, ...]:
        return f(x), g(x), h(x)

    compiled = discrete_map(image, {}, ("x", "y", "z"))
    assert not compiled.unknown_formulas
    for place in PLACES:
        with np.errstate(all="ignore"):
            wanted = np.array(image([np.float64(v) for v in (*place, 0.0)], None), dtype=float)
        found = compiled.iterate([[*place, 0.0]], 1)
        if np.isfinite(wanted).all():
            assert found.points[0] == pytest.approx(wanted, rel=1e-14, abs=1e-14)
        else:
            assert found.status[0] == Status.DIVERGED


LEFT = {
    "clip": lambda v: np.clip(np.sqrt(v), 0.0, 1.0),
    "sign": lambda v: np.sign(np.sqrt(v)),
    "heaviside": lambda v: np.heaviside(np.log(v), 0.5),
    "maximum": lambda v: np.maximum(np.sqrt(v), 0.2),
    "minimum": lambda v: np.minimum(0.2, np.sqrt(v)),
    "copysign": lambda v: np.clip(np.copysign(np.sqrt(v), 1.0), -1.0, 1.0),
    "sign of copysign": lambda v: np.copysign(0.3, np.sqrt(v)),
    "max": lambda v: max(np.sqrt(v), 0.2),
    "interp": lambda v: np.interp(np.sqrt(v), [0.0, 1.0], [0.0, 0.3]),
}


@pytest.mark.parametrize(
    "name", [n if n in ("clip", "sign", "max", "interp") else pytest.param(n, marks=pytest.mark.thorough) for n in LEFT]
)
@pytest.mark.parametrize("method", ["auto", pytest.param("DOP853", marks=pytest.mark.thorough)])
def test_a_friction_law_outside_of_its_domain_ends_an_orbit(name: str, method: str) -> None:
    """Of v' = -1 - f(v), from v = -0.5 on: f has no value at v < 0."""
    law = LEFT[name]
    system = ForcedSystem(lambda t, x, p: (-1.0 - law(x[0]),), {}, 1.0, ("v",))
    assert stroboscopic_map(system, method=method).iterate([[-0.5]], 1).status[0] == Status.DIVERGED


def test_a_side_that_is_not_taken_may_have_no_value() -> None:
    """Of v' = 3 from v = 0 on it is v(2) = 6 exactly, whatever stands on the other side."""
    guarded = [
        lambda v: np.where(v > -1.0, 3.0, np.clip(np.sqrt(v - 1.0), 0.0, 1.0)) * 1.0,
        lambda v: 3.0 if v > -1.0 else np.sign(np.log(v - 1.0)),
        lambda v: 3.0 + max(-1.0, np.sqrt(-1.0 - v)) + 1.0,
    ]
    for f in guarded:
        system = ForcedSystem(lambda t, x, p: (f(x[0]),), {}, 1.0, ("v",))  # noqa: B023
        assert stroboscopic_map(system).iterate([[0.0]], 2).points == pytest.approx(6.0, abs=1e-9)
