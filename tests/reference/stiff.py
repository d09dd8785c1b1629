"""Images of stiff systems by SciPy's Radau method at tight tolerances; ``python -m tests.reference.stiff`` prints them.

It is an implicit Runge-Kutta method of order 5 with its own steps and its own error control, and shares nothing with
the integrators of cellmap.
"""

from collections.abc import Callable
from math import cos, exp, pi, tanh
from types import SimpleNamespace
from typing import Any, NamedTuple

from scipy.integrate import solve_ivp


def van_der_pol(t: float, x: Any, p: Any) -> tuple[float, float]:
    return x[1], p.mu * (1.0 - x[0] ** 2) * x[1] - x[0] + p.force * cos(p.omega * t)


def robertson(t: float, x: Any, p: Any) -> tuple[float, float, float]:
    a, b, c = x
    first, second, third = 0.04 * (1.0 + 0.5 * cos(2.0 * pi * t / 10.0)) * a, p.k2 * b * c, p.k3 * b * b
    return 0.1 - first + second - 0.1 * a, first - second - third - 0.1 * b, third - 0.1 * c


def rubbing(t: float, x: Any, p: Any) -> tuple[float, float]:
    return x[1], -x[0] - 0.5 * tanh(p.steepness * x[1]) + 1.2 * cos(t)


def epidemic(t: float, x: Any, p: Any) -> tuple[float, float]:
    """Logarithms of the susceptible and the infected fraction, with a seasonal contact rate, in years."""
    s, i = x
    rate = 1800.0 * (1.0 + p.season * cos(2.0 * pi * t))
    return 0.02 * (exp(-s) - 1.0) - rate * exp(i), rate * exp(s) - 100.02


class Case(NamedTuple):
    rhs: Callable[..., tuple[float, ...]]
    params: dict[str, float]
    period: float
    initial_condition: tuple[float, ...]
    image: tuple[float, ...]


def _pol(mu: float, omega: float, ic: tuple[float, float], image: tuple[float, ...]) -> Case:
    return Case(van_der_pol, {"mu": mu, "force": 0.5 * mu, "omega": omega}, 2.0 * pi / omega, ic, image)


CASES = {
    "van der Pol, mu = 1": _pol(1.0, 0.5, (2.0, 1.0), (-0.6718105544264082, 1.7663225774918967)),
    "van der Pol, mu = 10": _pol(10.0, 0.5, (0.5, 0.0), (-1.6626983460929978, 0.36536386130080456)),
    "van der Pol, mu = 100": _pol(100.0, 0.05, (2.0, 1.0), (2.0057592223100555, 6.056603599777289)),
    "van der Pol, mu = 1000": _pol(1000.0, 0.05, (-1.0, 3.0), (-1.127872049293396, 1.7582647884311922)),
    "Robertson": Case(
        robertson,
        {"k2": 1e4, "k3": 3e7},
        10.0,
        (0.3, 1e-5, 0.5),
        (0.7252133367573848, 1.7209510095313205e-05, 0.20119724429264288),
    ),
    "tanh(1000 v)": Case(
        rubbing, {"steepness": 1000.0}, 2.0 * pi, (2.0, 0.0), (0.6761945795083072, 2.8231440730623536)
    ),
    "epidemic": Case(epidemic, {"season": 0.1}, 1.0, (-2.8, -7.5), (-2.868292223842, -17.958001071589795)),
}


def image(case: Case) -> tuple[float, ...]:
    """Return the state after a period."""
    p = SimpleNamespace(**case.params)
    solution = solve_ivp(
        lambda t, x: case.rhs(t, x, p), (0.0, case.period), case.initial_condition, "Radau", rtol=1e-12, atol=1e-14
    )
    return tuple(solution.y[:, -1].tolist())


if __name__ == "__main__":
    for name, case in CASES.items():
        print(f"{name}: {image(case)}")
