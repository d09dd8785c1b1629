"""Remainders and quotients in one application of a map are those of Python, to the bit."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap.maps import jacobian

SPECIAL = (0.0, 5e-324, 1e-310, 1e-300, 0.1, 0.5, 1.0, 3.0, 2 * math.pi, 345.3, 1e15, 2.0**53, 2.0**60, 1e22, 1e99)


def pairs() -> NDArray[np.float64]:
    """Special numbers of both signs, multiples of a divisor and their neighbours, quotients beyond 2**53."""
    rng = np.random.default_rng(1)
    signed = [s * v for v in SPECIAL for s in (1.0, -1.0)]
    whole = rng.integers(-(10**6), 10**6, 1000) * 0.1
    divisor = 10 ** rng.uniform(-8, 8, 1500) * rng.choice([-1.0, 1.0], 1500)
    multiple = divisor * np.round(10 ** rng.uniform(0, 17, 1500)) * rng.choice([-1.0, 1.0], 1500)
    columns = [
        np.array([(a, b) for a in signed for b in signed]),
        np.stack([np.append(whole, whole), np.repeat([0.1, -0.1], 1000)], axis=1),
        np.stack([np.append(multiple, np.nextafter(multiple, 0.0)), np.append(divisor, divisor)], axis=1),
        10 ** rng.uniform(-90, 90, (1000, 2)),
    ]
    return np.concatenate(columns)


def by_python(function: Callable[..., float], a: float, b: float) -> float:
    try:
        value = function(a, b)
    except (ZeroDivisionError, ValueError):
        return math.nan
    return value if abs(value) < 1e100 else math.nan  # where the map has diverged


TEXTS = """a % b|a // b|np.mod(a, b)|math.fmod(a, b)|divmod(a, b)[0] - divmod(a, b)[1]|a % 1|a % (2 * math.pi)|a % -0.1
a % math.inf|a // -math.inf|(a * 1e300 * 1e300) % b|7.3 // b|math.copysign(b, a)|abs(a)|abs(float(math.trunc(a)))
abs(float(round(a)))""".replace("\n", "|").split("|")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # NumPy's own, of remainders by zero
@pytest.mark.parametrize("text", TEXTS)
def test_they_are_those_of_python(text: str) -> None:
    function, points = eval(f"lambda a, b: {text}"), pairs()
    images = discrete_map(lambda x, p: (function(*x), x[1]), {}, ("a", "b")).iterate(points, 1).points[:, 0]
    expected = np.array([by_python(function, a, b) for a, b in points.tolist()])
    wrong = ~(
        (images == expected) & (np.signbit(images) == np.signbit(expected)) | np.isnan(images) & np.isnan(expected)
    )
    assert points[wrong & (np.abs(points) < 1e100).all(axis=1)].tolist() == []


def test_the_values_of_a_review() -> None:
    remainder = discrete_map(lambda x, p: (x[0] % 0.1, x[0] // 0.1), {}, ("q", "r"))
    assert remainder([345.3, 0.0]).tolist() == [0.0999999999999922, 3452.0]
    assert discrete_map(lambda x, p: (math.fmod(x[0], 0.1),), {}, ("q",))([-0.5]).tolist() == [-0.09999999999999998]


def test_derivatives_of_remainders() -> None:
    """The one in the divisor is less the whole quotient: 7.5 % 2 = 7.5 - 3 * 2, and fmod(-7.5, 2) = -7.5 + 3 * 2."""
    for function, a, quotient in ((lambda a, b: a % b, 7.5, 3.0), (math.fmod, 7.5, 3.0), (math.fmod, -7.5, -3.0)):
        found = jacobian(discrete_map(lambda x, p, f=function: (f(*x), x[1]), {}, ("a", "b")), [a, 2.0])
        assert found.tolist() == [[1.0, -quotient], [0.0, 1.0]]


def test_a_remainder_of_a_parameter_in_a_flow() -> None:
    system = ForcedSystem(lambda t, x, p: (p.a % 0.1 + p.a // 0.1,), {"a": 345.3}, 1.0, ("q",))
    for method in ("auto", "DOP853", "Rosenbrock"):
        assert stroboscopic_map(system, method=method)([0.0])[0] == pytest.approx(3452.0999999999999922, rel=1e-12)
