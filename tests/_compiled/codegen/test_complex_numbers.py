"""Complex arithmetic in a traced function, against Python's own, and slopes against derivatives by hand."""

import cmath
from collections import namedtuple
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap.maps import jacobian

PLACES = np.array([[0.7, -0.4], [-1.2, 0.9], [0.3, 1.6]])
ANALYTIC: dict[str, tuple[Any, Any]] = {
    "arithmetic": (lambda z: (1 + 2j) / z - 1j * z + 0.5, lambda z: -(1 + 2j) / z**2 - 1j),
    "powers": (lambda z: z**3 + z**-2 + z**1.5, lambda z: 3 * z**2 - 2 * z**-3 + 1.5 * z**0.5),
    "exponentials": (lambda z: np.exp(1j * z) + 2**z, lambda z: 1j * np.exp(1j * z) + cmath.log(2) * 2**z),
    "logarithms": (lambda z: cmath.log(z) + np.sqrt(z), lambda z: 1 / z + 0.5 / cmath.sqrt(z)),
    "sines": (lambda z: np.sin(z) * cmath.cos(z), lambda z: np.cos(2 * z)),
    "tangents": (lambda z: cmath.tan(z) + np.tanh(z), lambda z: 1 / cmath.cos(z) ** 2 + 1 / cmath.cosh(z) ** 2),
    "hyperbolas": (lambda z: np.sinh(z) + cmath.cosh(z), lambda z: cmath.exp(z)),
    "arrays": (lambda z: (np.array([[1, 1j], [1j, 2]]) @ [z, z * z])[1], lambda z: 1j + 4 * z),
    "equations": (lambda z: np.linalg.solve([[2, 1j], [1j, 3]], [1, z])[1], lambda z: 2 / 7),
    "polynomials": (lambda z: np.polyval([1, 2j, -1], z), lambda z: 2 * z + 2j),
    "kinds": (lambda z: z + np.zeros(2, dtype=complex)[0] + complex(z.real, 0.0) - z.real, lambda z: 1),
}


@pytest.mark.parametrize("name", ANALYTIC)
def test_values_and_derivatives_of_complex_functions(name: str) -> None:
    function, derivative = ANALYTIC[name]

    def f(x: Any, p: Any) -> Any:
        w = function(x[0] + 1j * x[1])
        return w.real, w.imag

    image = discrete_map(f, {}, ("x", "y"))
    assert image.unknown_formulas == ""
    for place in PLACES:
        w, slope = complex(function(complex(*place))), complex(derivative(complex(*place)))
        assert image(place) == pytest.approx([w.real, w.imag], rel=1e-14, abs=1e-14)
        assert jacobian(image, place) == pytest.approx(
            np.array([[slope.real, -slope.imag], [slope.imag, slope.real]]), rel=1e-12, abs=1e-12
        )


def parts(x: Any, p: Any) -> Any:
    z = complex(*x)
    w = np.array([z, 1j * z])
    sizes = abs(z) ** 2 + np.linalg.norm(w) + np.abs(w).sum() + z * z.conjugate()
    turned = cmath.rect(*cmath.polar(z)) if z != 0 else z
    return sizes.real + np.angle(z), turned.imag + w.view(float)[1] + np.imag(np.where(z.real > 0.0, z, -z))


def test_sizes_angles_and_choices() -> None:
    image = discrete_map(parts, {}, ("x", "y"))
    assert image.unknown_formulas == ""
    for place in PLACES:
        assert image(place) == pytest.approx(parts(place.tolist(), ()), rel=1e-13)


@dataclass
class Parameters:
    growth: float = 0.5
    drive: float = 0.3


@pytest.mark.parametrize("params", [Parameters(), namedtuple("P", "growth drive")(0.5, 0.3)])
def test_a_flow_of_complex_amplitudes_costs_what_its_parts_do(params: Any) -> None:
    def amplitude(t: float, x: Any, p: Any) -> Any:
        z = x.view(complex)
        return ((p.growth + 1j) * z - abs(z) ** 2 * z + p.drive * np.exp(1j * t)).view(float)

    def in_parts(t: float, x: Any, p: Any) -> Any:
        u, v = x
        r = u * u + v * v
        drive = p.drive * np.cos(t), p.drive * np.sin(t)
        return p.growth * u - v - r * u + drive[0], u + p.growth * v - r * v + drive[1]

    found, expected = (stroboscopic_map(ForcedSystem(f, params, 2 * np.pi, ("u", "v"))) for f in (amplitude, in_parts))
    assert found.unknown_formulas == "" and found.params == {"growth": 0.5, "drive": 0.3}
    assert np.abs(found(PLACES) - expected(PLACES)).max() < 1e-9
