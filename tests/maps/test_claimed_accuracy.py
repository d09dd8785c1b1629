"""An image whose status is OK is within its tolerance: narrow layers, steep fronts, large expansions, in closed form.

Coordinates move steadily through the layers, so that what they leave behind is a known integral.
"""

from collections.abc import Callable
from math import cos, exp, pi, sin, tanh
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import erf, ive
from two_tiers import at_once

from cellmap import ForcedSystem, Status, stroboscopic_map
from cellmap.maps import SectionMap, ToleranceWarning, inverse_stroboscopic_map, section_map
from cellmap.maps.point_map import follow
from cellmap.maps.small_states import warn_of_small_states_ahead

WIDTHS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
METHODS = ("auto", "DOP853")
Points = NDArray[np.float64]


def bell(t: float, x: Any, p: Any) -> tuple[float, ...]:
    u = (x[0] - 0.3) / p.width
    return 1.0, exp(-u * u) / p.width


def after_bell(x: Points, width: float) -> Points:
    passed = erf((x[:, 0] + 1.0 - 0.3) / width) - erf((x[:, 0] - 0.3) / width)
    return np.stack([x[:, 0] + 1.0, x[:, 1] + 0.5 * np.sqrt(pi) * passed], axis=1)


def bump(t: float, x: Any, p: Any) -> tuple[float, ...]:
    u, v = (x[0] - 0.3) / p.width, (x[2] - 0.2) / p.width
    return 1.0, exp(-u * u - v * v) / p.width, 0.0


def after_bump(x: Points, width: float) -> Points:
    passed = erf((x[:, 0] + 1.0 - 0.3) / width) - erf((x[:, 0] - 0.3) / width)
    kick = 0.5 * np.sqrt(pi) * passed * np.exp(-(((x[:, 2] - 0.2) / width) ** 2))
    return np.stack([x[:, 0] + 1.0, x[:, 1] + kick, x[:, 2]], axis=1)


def front(t: float, x: Any, p: Any) -> tuple[float, ...]:
    return 1.0, tanh((x[0] - 0.3) / p.width)


def after_front(x: Points, width: float) -> Points:
    def integral(q: Points) -> Points:
        u = np.abs(q - 0.3) / width
        return width * (u + np.log1p(np.exp(-2.0 * u)))

    return np.stack([x[:, 0] + 1.0, x[:, 1] + integral(x[:, 0] + 1.0) - integral(x[:, 0])], axis=1)


Case = tuple[Callable[..., Any], Callable[[Points, float], Points], int]
LAYERS: dict[str, Case] = {
    "bell": (bell, after_bell, 2),
    "bump": (bump, after_bump, 3),
    "front": (front, after_front, 2),
}


def off(images: Points, exact: Points, tolerance: float) -> Points:
    """Largest error of each image, in tolerances, beside a few roundings."""
    return np.asarray((np.abs(images - exact) / (tolerance * (1.0 + np.abs(exact)) + 1e-14)).max(axis=1))


@pytest.mark.parametrize("tolerance", at_once([1e-9], later=[1e-6]))
@pytest.mark.parametrize(
    ("name", "method"),
    at_once([("bump", "auto"), ("front", "DOP853")], later=[(n, m) for n in LAYERS for m in METHODS]),
)
def test_layers_in_the_state(name: str, method: str, tolerance: float) -> None:
    rhs, after, dimension = LAYERS[name]
    rng, seen = np.random.default_rng(0), 0
    for width in WIDTHS:
        points = rng.uniform(-0.6, 0.2, (24, dimension))
        points[:, 2:] = 0.2 + width * rng.uniform(-1.0, 1.0, (24, dimension - 2))
        system = ForcedSystem(rhs, {"width": width}, 1.0, tuple("qvy"[:dimension]))
        found = follow(stroboscopic_map(system, rtol=tolerance, atol=tolerance, method=method), points, 1)
        met = found.status == Status.OK
        worst = off(found.points[met], after(points[met], width), tolerance).max(initial=0.0)
        assert worst <= 1.0, width
        seen += np.count_nonzero(met)
    assert seen >= 24 * (len(WIDTHS) if method == "auto" and dimension == 2 else 3)


@pytest.mark.parametrize("method", at_once(["auto"], later=METHODS))
def test_pulses_in_time(method: str) -> None:
    """Over a period exp(k (cos t - 1)) adds up to 2 pi exp(-k) I_0(k), where k is large by its asymptotic series."""
    for width in WIDTHS:
        sharpness = 1.0 / width**2
        system = ForcedSystem(
            lambda t, x, p: (exp(-2.0 * p.sharpness * sin(0.5 * t - 1.0) ** 2) * 1e3,),
            {"sharpness": sharpness},
            2.0 * pi,
            ("y",),
        )
        strength = ive(0, sharpness) if sharpness < 1e7 else (1.0 + 0.125 / sharpness) / np.sqrt(2.0 * pi * sharpness)
        found = follow(stroboscopic_map(system, method=method), np.linspace(-1.0, 1.0, 8)[:, None], 1)
        met = found.status == Status.OK
        exact = np.linspace(-1.0, 1.0, 8)[:, None] + 2e3 * pi * strength
        assert (off(found.points[met], exact[met], 1e-9) <= 1.0).all(), width


@pytest.mark.parametrize("method", [*METHODS, "Taylor", "RK45"])
def test_expansion_within_a_period(method: str) -> None:
    """A saddle expands by up to 1e6 what lies off its stable direction; images are of order 1."""
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    tolerance = 1e-6 if method == "RK45" else 1e-9
    for expansion in 10.0 ** np.arange(0, 7):
        rate = np.log(expansion) + 1e-3
        values = dict(zip("abcd", (turn @ np.diag([rate, -rate]) @ turn.T).ravel().tolist(), strict=True))
        system = ForcedSystem(
            lambda t, x, p: (p.a * x[0] + p.b * x[1], p.c * x[0] + p.d * x[1]), values, 1.0, ("x", "y")
        )
        own = np.random.default_rng(1).uniform(-1.0, 1.0, (16, 2)) * (np.exp(-rate), 1.0)
        exact = (own * (np.exp(rate), np.exp(-rate))) @ turn.T
        found = follow(stroboscopic_map(system, rtol=tolerance, atol=tolerance, method=method), own @ turn.T, 1)
        met = found.status == Status.OK
        assert met.any() or method == "RK45"
        assert (off(found.points[met], exact[met], tolerance) <= 1.0).all(), expansion


def test_long_expansions_are_within_the_tolerance_or_reported() -> None:
    """Ten periods of a chaotic oscillator as one expand by up to 1e7; SciPy at a thousandth of the tolerance."""
    system = ForcedSystem(
        lambda t, x, p: (x[1], x[0] - x[0] ** 3 - 0.1 * x[1] + 0.35 * cos(1.4 * t)), {}, 20.0 * pi / 1.4, ("q", "v")
    )
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (100, 2))
    tolerance = 1e-6
    found = follow(stroboscopic_map(system, rtol=tolerance, atol=tolerance), points, 1)
    exact = follow(stroboscopic_map(system, rtol=1e-11, atol=1e-11, method="DOP853"), points, 1)
    for k in (0, 7, 39):  # an image does not depend on its company
        alone = follow(stroboscopic_map(system, rtol=tolerance, atol=tolerance), points[k], 1)
        assert (alone.points == found.points[k]).all() and alone.status == found.status[k]
    both = (found.status == Status.OK) & (exact.status == Status.OK)
    assert both.sum() > 80
    assert (off(found.points[both], exact.points[both], tolerance) <= 1.0).all()
    for k in range(3):
        checked = solve_ivp(system.fun, (0.0, system.length), points[k], method="DOP853", rtol=3e-14, atol=1e-14)
        assert off(exact.points[k : k + 1], checked.y[:, -1][None], tolerance) <= 0.1


def epidemic(t: float, x: Any, p: Any) -> tuple[float, float]:
    infections = 1800.0 * (1.0 + 0.1 * cos(2.0 * pi * t)) * x[0] * x[1]
    return 0.02 * (1.0 - x[0]) - infections, infections - 100.02 * x[1]


def test_a_coordinate_below_its_tolerance_is_reported() -> None:
    """Between epidemics the infected fraction is 4e-13; SciPy's DOP853, to 1e-12 and 1e-22, knows what follows."""
    system, start = ForcedSystem(epidemic, {}, 1.0, ("S", "I")), (0.06, 1e-3)
    with pytest.warns(ToleranceWarning, match=r"I of epidemic fell below its atol .* atol=\{'I'"):
        stroboscopic_map(system, method="DOP853").iterate(start, 6)
    with pytest.warns(ToleranceWarning, match="I of epidemic fell"):
        stroboscopic_map(system, method="DOP853").orbit(start, 6)
    exact = solve_ivp(system.fun, (0.0, 6.0), start, method="DOP853", rtol=1e-12, atol=1e-22).y[:, -1]
    for atol in ({"I": 1e-22}, (1e-12, 1e-22)):
        for method in ("DOP853", "Rosenbrock"):
            strobe = stroboscopic_map(system, rtol=1e-11, atol=atol, method=method)
            assert strobe.iterate(start, 6).points == pytest.approx(exact, rel=1e-3)
            assert strobe.recipe["atol"] == (1e-9 if isinstance(atol, dict) else 1e-12, 1e-22)


def test_a_coordinate_that_will_fall_below_its_tolerance_is_told_at_once() -> None:
    """Before orbits are followed for long, unless it is left to the relative tolerance."""
    system, start = ForcedSystem(epidemic, {}, 1.0, ("S", "I")), (0.06, 1e-3)
    with pytest.warns(ToleranceWarning, match=r"I of epidemic falls to \S+ and grows again, .* atol=\{'I': 1e-290\}"):
        warn_of_small_states_ahead(stroboscopic_map(system), np.array([start]))
    warn_of_small_states_ahead(stroboscopic_map(system, rtol=1e-9, atol={"I": 1e-290}), np.array([start]))


def hunted(t: float, x: Any, p: Any) -> tuple[float, float]:
    eaten = 2.5 * x[0] * x[1] / (x[0] + 1.0)
    return 0.8 * x[0] * (1.0 - x[0] / p.K) - eaten, 0.5 * eaten - 0.4 * x[1]


def hunted_section(period: float, **options: Any) -> SectionMap:
    return section_map(ForcedSystem(hunted, {"K": 15.0}, period, ("N", "P")), ("N", 3.0, -1), **options)


def test_a_return_on_whose_way_a_coordinate_is_too_small_is_reported() -> None:
    back, message = hunted_section(40.0), r"N of hunted fell below its atol .* atol=\{'N'.* give a shorter one"
    points = np.array([[6.09567]])  # N falls to 3e-16 on the way back to P = 6.09567
    for use in (back, back.returns, lambda x: back.orbit(x, 1), lambda x: warn_of_small_states_ahead(back, x)):
        with pytest.warns(ToleranceWarning, match=message):
            use(points)
    with pytest.warns(ToleranceWarning, match=message):
        hunted_section(100.0, atol={"N": 1e-290}).returns(points)  # it falls and grows within one interval


def test_inverse_maps_take_tolerances_for_each_coordinate() -> None:
    """Backwards the infected grow from 1e-20, as exp(100 t) in the end."""
    system = ForcedSystem(lambda t, x, p: (-x[0], -30.0 * x[1]), {}, 1.0, ("S", "I"))
    back = inverse_stroboscopic_map(system, atol={"I": 1e-290})
    assert back([0.5, 1e-20])[1] == pytest.approx(1e-20 * exp(30.0), rel=1e-9)
    assert back.spec is not None and back.spec.atol == (1e-9, 1e-290)  # type: ignore[attr-defined]


def test_series_are_not_used_where_they_may_hide_something() -> None:
    """The default method expands products and sines; tanh may be saturated where the step begins."""

    def plain(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -(x[0] ** 3) - 0.1 * x[1] + cos(t) * p.width

    systems = [ForcedSystem(rhs, {"width": 0.1}, 2.0 * pi, ("x", "v")) for rhs in (plain, front, bell)]
    assert [stroboscopic_map(s).recipe["method"] for s in systems] == ["Taylor", "DOP853", "DOP853"]
