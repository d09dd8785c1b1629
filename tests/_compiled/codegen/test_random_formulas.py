"""Random formulas: values and gradients against mpmath, in vectors of lanes beside neighbours of all sizes."""

import math
import random
from typing import Any

import mpmath
import numpy as np
import pytest

from cellmap import discrete_map
from cellmap.maps import jacobian

OF_ONE = (
    "sin cos tan exp log sqrt sinh cosh tanh atan asin acos asinh acosh atanh log1p expm1 cbrt erf floor abs".split()
)
OF_TWO = "({} + {})|({} - {})|({} * {})|({} / {})|({} % {})|max({}, {})|min({}, {})|hypot({}, {})".split("|")
MATH = {name: getattr(math, name) for name in [*OF_ONE, "hypot"] if hasattr(math, name)}


def bounded(function: Any) -> Any:
    """Return a function of mpmath that has no values for huge arguments, which it would take very long to reduce."""

    def call(*arguments: Any) -> Any:
        if max(map(abs, arguments)) > 1e9:
            raise ValueError("too large")
        return function(*arguments)

    return call


EXACT = {name: bounded(getattr(mpmath, name)) for name in [*OF_ONE, "hypot"] if hasattr(mpmath, name)}
EXACT |= {"abs": abs, "cbrt": bounded(lambda x: mpmath.sign(x) * mpmath.cbrt(abs(x)))}


def formula(rng: random.Random, depth: int) -> str:
    if depth == 0 or rng.random() < 0.1:
        return rng.choice(["x", "y", "x", repr(round(rng.uniform(0.05, 3.0), 3)), "(-1.5)"])
    if rng.random() < 0.4:
        return f"{rng.choice(OF_ONE)}({formula(rng, depth - 1)})"
    if rng.random() < 0.1:
        a, b, c, d = (formula(rng, depth - 1) for _ in range(4))
        return f"({a} if {b} > {c} else {d})"
    return rng.choice(OF_TWO).format(formula(rng, depth - 1), formula(rng, depth - 1))


def exact(text: str, x: Any, y: Any) -> Any:
    """Value by mpmath; None outside of the domain of the formula."""
    try:
        value = eval(text, dict(EXACT), {"x": x, "y": y})
    except (ArithmeticError, AttributeError, NotImplementedError, TypeError, ValueError):
        return None  # complex numbers have no order
    return value if isinstance(value, mpmath.mpf | int | float) and 1e-200 < abs(value) < 1e60 else None


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (1, 2))])
def test_values_and_gradients_are_those_of_mpmath(seed: int) -> None:
    rng, values, gradients = random.Random(seed), 0, 0
    for _ in range(12):
        text = formula(rng, rng.choice([2, 3]))
        scope: dict[str, Any] = dict(MATH)
        exec(f"def f(s, p):\n    x, y = s\n    return {text}, y\n", scope)
        point_map = discrete_map(scope["f"], {}, ("x", "y"))
        points = np.array([[rng.uniform(-3.0, 3.0) for _ in "xy"] for _ in range(6)] + [[4e6, 0.3], [-700.0, 1e-9]])
        images = point_map.iterate(points, 1)
        slopes = None if point_map.unknown_formulas else jacobian(point_map, points)[:, 0]
        for k, point in enumerate(points):
            alone = point_map.iterate(point, 1)
            assert np.array_equal(alone.points, images.points[k], equal_nan=True), text
            with mpmath.workdps(40):
                x, y = (mpmath.mpf(float(v)) for v in point)
                h = mpmath.mpf(2) ** -47
                sides = [exact(text, x * (1 + a), y * (1 + b)) for a, b in ((0, 0), (h, 0), (-h, 0), (0, h), (0, -h))]
                if None in sides:
                    continue
                value, *others = sides
                spread = max(abs(v - value) for v in others)
                try:
                    rounding = abs(scope["f"](tuple(point.tolist()), None)[0] - value)
                except ArithmeticError:
                    continue
                if spread > 1e-6 * abs(value) or rounding > 1e-6 * abs(value):
                    continue  # beside a jump, or with hardly a digit
                values += 1
                assert abs(images.points[k, 0] - value) <= 2e-15 * abs(value) + spread + 30 * rounding, (text, point)
                curved = max(abs(others[i] + others[i + 1] - 2 * value) for i in (0, 2))
                if slopes is not None and curved <= 1e-12 * spread:
                    gradients += 1
                    for j, v in enumerate((x, y)):
                        slope = (others[2 * j] - others[2 * j + 1]) / (2 * h * v)
                        allowed = 1e-7 * abs(slope) + 1e-9 * spread / h / abs(v) + 1e-250
                        assert abs(slopes[k, j] - slope) <= allowed, (text, point)
    assert values > 30
    assert gradients > 20
