"""What is refused, and the words that say what to give instead; all other arguments: tests/_lib/bad_input."""

from collections.abc import Callable
from dataclasses import replace
from math import atan2, cos, erf, gamma, inf, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy import special

from cellmap import (
    CellGrid,
    Coordinate,
    ForcedSystem,
    angle,
    discrete_map,
    find_basins,
    find_periodic_orbits,
    interpolated_map,
    stroboscopic_map,
    trajectory,
)
from cellmap.maps import (
    Impact,
    flow_map,
    inverse_stroboscopic_map,
    jacobian,
    rebuild_map,
    section_map,
    swept_map,
    swept_system,
)
from cellmap.maps.coordinates import as_coordinates
from cellmap.maps.enclosures import enclosed_images
from systems import driven_pendulum, henon_map, stick_slip_oscillator, two_well_duffing

PARAMS = {"delta": 0.15, "gamma": 0.2, "omega": 2.0}
SPEED = lambda t, x, p: (x[1],)  # noqa: E731
BLOCK = {"rhs": lambda t, x, p, s: (x[1], -0.3 * s[0]), "switches": SPEED}
DRIVEN, HENON = two_well_duffing(), henon_map()
PENDULUM = stroboscopic_map(driven_pendulum())
SLICE = CellGrid((-2, 0.5), (2, 0.5), (20, 1))
SQUARE, BALL = CellGrid((-1.0, -1.0), (1.0, 1.0), (8, 8)), Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -x[1]))
MATRIX = np.array([[0.0, 0.3], [0.2, 0.0]])


def duffing(t: float, x: Any, p: Any) -> tuple[float, float]:
    q, v = x
    return v, q - q**3 - p.delta * v + p.gamma * cos(p.omega * t)


def system(rhs: Any = duffing, params: Any = PARAMS, period: Any = pi, names: Any = ("q", "v"), **more: Any) -> Any:
    return ForcedSystem(rhs, params, period, names, **more)


def free(rhs: Any = lambda t, x, p: (x[1], -x[0]), **more: Any) -> Any:
    return system(rhs, **more)


def coupled(params: Any) -> Any:
    return system(lambda t, x, p: tuple(p.K @ np.array(x)), params)


def strobe(rhs: Any, **options: Any) -> Any:
    return stroboscopic_map(free(rhs), **options)


def mapping(function: Any, **changes: Any) -> Any:
    return discrete_map(function, **{"params": {"a": 1.4}, "coordinates": ("x", "y"), **changes})


def grid(lower: Any = (-1.0, 0.0), upper: Any = (1.0, 1.0), shape: Any = (4, 4), *wraps: Any) -> Any:
    return CellGrid(lower, upper, shape, *wraps)


def table() -> Any:
    return interpolated_map(HENON, SQUARE)


def struck(guard: Any = BALL.guard, reset: Any = BALL.reset) -> Any:
    return system(impacts=[Impact(guard, reset)])


def turning(guard: Any = lambda t, x, p: sin(2.0 - x[0]), reset: Any = BALL.reset) -> Any:
    return system(lambda t, x, p: (x[1], -sin(x[0])), names=(angle("theta"), "v"), impacts=[Impact(guard, reset)])


def enclosed(point_map: Any, centres: Any = ((0.5, 0.5),), halves: Any = (0.1, 0.1), **options: Any) -> Any:
    return enclosed_images(point_map, centres, halves, **options)


def writes(t: float, x: Any, p: Any) -> Any:
    if x[0] < 0.0:
        x[1] = -x[1]
    return x[1], -x[0]


def remembers(t: float, x: Any, p: Any, last: list[float] = [1.0]) -> Any:  # noqa: B006
    last[0] = x[0]
    return x[1], -last[0]


def by_name(t: float, x: Any, p: Any) -> Any:
    return x[1], -PARAMS["gamma"] * (x[0], 2.0 * x[0])[int(x[0]) % 2]


def compares(t: float, x: Any, p: Any, s: Any) -> Any:
    return x[1], s[0] + (0.1 if x[0] == 1.0 else 0.0)


def switched(rhs: Any, switches: Any) -> Any:
    return stroboscopic_map(system(rhs, {"k": 0.3}, switches=switches))


def signs(values: Any) -> Any:
    return free(**BLOCK).derivative(0.0, (0.5, 0.0), values)


def rate(t: float, x: Any, p: Any) -> tuple[float]:
    return (-x[0] + cos(p.w * t),)


CUBES, LONG = np.linspace(-1.0, 1.0, 65) ** 3, np.linspace(0.0, 1.0, 2000)
VALUES = (
    # systems
    (lambda: system(lambda t, x, p: (x[1],)), r"rhs returns 1 components for 2 coordinates \(q, v\)"),
    (lambda: system(lambda t, x, p: (x[1], absent * x[0])), "'absent' is not defined.*or make it a parameter"),  # noqa: F821
    (lambda: system(names="qv"), r"coordinates='qv' has .* such as \('q', 'v'\)"),
    (lambda: free(names="qv"), r"coordinates='qv' is one name: give one for each, such as \('q', 'v'\)"),
    (lambda: system(names=("q",)), "not enough values to unpack .* one coordinate for each state variable"),
    (lambda: system(names=(angle("q"), "v")), "so q is not an angle of period 6.28319; give period= its period"),
    (lambda: system(lambda t, x, p: (x[1], p.absent)), "rhs asks for a parameter that params lacks"),
    (lambda: system(lambda t, x, p: (sqrt(-1.0 - x[0]), x[1])), "rhs fails at every state tried"),
    (lambda: system(remembers), r"changes a value outside of it: .* impacts="),
    (lambda: system(period=3.0), "period=3.0: rhs at t = .* give the period of the forcing"),
    (lambda: system(period=lambda p: p.absent), "period asks for a parameter that params lacks: p.absent"),
    *(
        (lambda name=name: system(params={**PARAMS, name: 1.0}), f"params has the name {name!r}")
        for name in ("not a name", "_hidden", "lambda", 3)
    ),
    (lambda: system().with_params(gama=0.3), r"no \['gama'\]: this system has \['delta', 'gamma', 'omega'\]"),
    (lambda: signs((1.0, 1.0)), "give 1, one for each switching function"),
    (lambda: free(lambda t, x, p, s: (x[1], s[1]), switches=SPEED), "as many switches as there are signs"),
    (lambda: struck(lambda t, x, p: x[5]), r"impacts\[0\].guard fails at"),
    (lambda: struck(reset=lambda t, x, p: x[:1]), r"impacts\[0\].reset returns .* the 2 state variables"),
    (lambda: Impact(BALL.guard, BALL.reset, direction=2), "direction=2"),
    (lambda: struck(lambda t, x, p: x), r"impacts\[0\].guard returns .*: return a number"),
    (lambda: system(lambda t, x, p: (x.v, -x.q)), r"reads x.v: x is a plain tuple; begin with `q, v = x`"),
    (lambda: turning(lambda t, x, p: 2.0 - x[0]), r"\.guard is .* one period of theta further on .*: write it with"),
    (lambda: turning(lambda t, x, p: sin((2.0 - x[0]) / 2)), r"\.guard is .* one period of theta further on"),
    (lambda: turning(reset=lambda t, x, p: (x[0], -x[1] * x[0])), r"\.reset is .* one period of theta further on"),
    # arrays of parameters
    (lambda: coupled({"K": MATRIX}).with_params(K=np.ones((1, 2))), "this system has 4 entries"),
    (lambda: coupled({"K": MATRIX}).with_params(K=np.ones((3, 2))), r"K\[2, 0\]"),
    (lambda: coupled({"K[0, 1]": 0.3}), "not all of them"),
    # coordinates and grids
    (lambda: Coordinate("x", lower=0.0), "lower=0.0: only an angle has a branch cut"),
    (lambda: Coordinate("x", "deg", period=2 * pi), "unit='deg': an angle in degrees has period=360"),
    (lambda: as_coordinates(("x", angle("x"))), "one different name for each state variable"),
    (lambda: grid((2.0, 0.0)), "empty or inverted.*lower has the lower ends of all axes"),
    (lambda: grid((-2, 2), (2, 2), (5, 5)), r"lower=2.0, upper=2.0 along axis 1.*for a slice give one cell"),
    (lambda: grid(shape=40), r"such as shape=\(40, 40\)"),
    (lambda: grid(shape=(4,)), "a grid needs one entry for each coordinate"),
    (lambda: grid((-1e308, 0.0), (1.7e308, 1.0)), "no floating-point numbers separate"),
    (lambda: interpolated_map(HENON, SLICE), r"both 0\.5 along axis 1, which is a slice.*different corners"),
    (lambda: SLICE.locate([0, 0.5]), r"both 0\.5 along axis 1, which is a slice.*different corners"),
    (lambda: find_periodic_orbits(HENON, SLICE), r"both 0\.5 along axis 1, which is a slice.*different corners"),
    (lambda: grid().locate([0.5]), "its last axis must hold 2 coordinates"),
    (lambda: grid((-pi, -1.0), (2 * pi, 1.0)).on(as_coordinates((angle("a"), "v"))), "more than one period"),
    (lambda: CellGrid(0, 1, 5).on(as_coordinates(("q", "v"))), "grid has 1 axis and the system 2 coordinates"),
    # discrete maps, points, tables
    (lambda: mapping(lambda x, p: (x[0],)), "function returns 1 components for 2 coordinates"),
    (lambda: mapping(lambda x, p: (x[0], p.c)), "function asks for a parameter that params lacks"),
    (lambda: mapping(lambda p, x: (p.a, x[0])), "reads a parameter a of the state, .* before the parameters"),
    (lambda: HENON.iterate(0.5, 1), r"points has shape \(\): its last axis must hold the 2 state variables"),
    (lambda: HENON([[1.0, 2.0], [inf, 0.0]]), r"points\[1, 0\] = inf: remove points that are not finite"),
    (lambda: jacobian(HENON, [[0.1]]), "its last axis must hold the 2 state variables"),
    (lambda: HENON.error(), "is exact; only an interpolated map has an error"),
    (lambda: interpolated_map(HENON, SQUARE, max_step=3), "max_step=3"),
    (lambda: table().error(0), "n_samples=0"),
    (lambda: find_basins(HENON, CellGrid(0, 1, 8)), r"has 1 axis .*: x, y; initial_conditions=CellGrid.*: give one"),
    # flows
    (lambda: stroboscopic_map(DRIVEN, atol={"R": 1e-9}), "there is no 'R'; coordinates are x, v"),
    (lambda: stroboscopic_map(DRIVEN, atol=(1e-9, 0.0)), "above 0"),
    (lambda: stroboscopic_map(free(**BLOCK), method="RK45"), "method='RK45': a discontinuous right-hand side needs"),
    (lambda: stroboscopic_map(free(impacts=[BALL]), method="DOP853"), "impacts need method='Taylor'"),
    (lambda: strobe(lambda t, x, p: (x[1], -atan2(x[0], 1.0)), method="Taylor"), "use method='DOP853'"),
    (lambda: switched(lambda t, x, p, s: (x[1], s[0] * s[1]), lambda t, x, p: x), "multiplies signs"),
    (lambda: inverse_stroboscopic_map(stick_slip_oscillator()), "switches"),
    (lambda: inverse_stroboscopic_map(free(impacts=[BALL])), "impacts"),
    (lambda: trajectory(free(), [0.1, 0.1], 1).output("power"), "name='power': the outputs of"),
    (lambda: section_map(DRIVEN, ("v", 0.0, 1)), "depends on time"),
    (lambda: flow_map(DRIVEN, 1.0), "depends on time"),
    (lambda: section_map(free(impacts=[BALL]), ("v", 0.0, -1)), "impacts"),
    (lambda: section_map(free(**BLOCK), ("q", 0.0, 1)), "has switches.*flow_map"),
    (lambda: section_map(free(), ("w", 0.0, 1)), r"coordinates are \['q', 'v'\]"),
    (lambda: section_map(free(), ("v", 0.0, 2)), r"section\[2\]=2"),
    (lambda: section_map(free(), ("q", 0.0, 1), atol={"Q": 1e-9}), "there is no 'Q'; coordinates are q, v"),
    # maps with parameters in the state, and maps from recipes
    (lambda: swept_map(HENON, "depth"), "parameters='depth'"),
    (lambda: swept_map(HENON, "a", "a"), "different parameters"),
    (lambda: swept_map(replace(HENON, name="other"), "a"), "build it from a MapSpec"),
    (lambda: swept_map(stroboscopic_map(system(rate, {"w": 2.0}, pi, "q")), "w"), "period=lambda p"),
    (lambda: swept_system(DRIVEN), r"parameters=.*: give the names of one or several different parameters"),
    (lambda: swept_system(DRIVEN, "nothing"), r"parameters='nothing': .*damping"),
    (lambda: rebuild_map(DRIVEN, {"kind": "discrete"}), "cannot be rebuilt from .*: give its system"),
    (lambda: rebuild_map(driven_pendulum(frequency=40.0), PENDULUM.recipe), r"period 0\.025.*: give the same par"),
    # enclosures
    (lambda: enclosed(mapping(lambda x, p: (abs(x[0]), x[1]))), "fabs is not enclosed"),
    (lambda: enclosed(mapping(lambda x, p: (x[0] if x[0] > 0 else 1.0, x[1]))), "a branch is not enclosed"),
    (lambda: enclosed(mapping(lambda x, p: (erf(x[0]), x[1]))), "erf is not enclosed"),
    (lambda: enclosed(replace(HENON, unknown_formulas="a loop")), "only formulas are enclosed"),
    (lambda: enclosed(table()), r"give point_map\.exact"),
    (lambda: enclosed(HENON, [0.5, 0.5]), "centres has the shape"),
    (lambda: enclosed(HENON, halves=0.1), "half_widths has the shape"),
    (lambda: enclosed(HENON, parameters={"c": (0.0, 1.0)}), "this map has the parameters"),
    (lambda: enclosed(HENON, parameters={"a": (2.0, 1.0)}), "give the lower end first"),
    (lambda: enclosed(strobe(lambda t, x, p: (x[1], 1.0 if x[1] > 0.0 else -1.0))), "a branch is not enclosed"),
    (lambda: enclosed(stroboscopic_map(free(impacts=[BALL]))), "impacts and switches are not enclosed"),
)
TYPES = (
    (lambda: free(lambda x, t, p: (x[1], -x[0] + cos(2 * t))), r"state before the time: .* rhs\(t, x, p\)"),
    (lambda: system(lambda t, x: x), r"rhs must be callable as rhs\(t, x, p\)"),
    (lambda: system(lambda t, x, p: -0.5 * p), "p is a tuple: write p.name"),
    (lambda: system(lambda t, x, p: ("a", "b")), "its components must be real numbers"),
    (lambda: system(lambda t, x, p: (x[1], -p["d"] * x[1])), r"p\['name'\]: p is a named tuple; write p.name"),
    (lambda: free(lambda t, x, p: -x[0], names=("x",)), r"not iterable; return .*`return \(value,\)`"),
    (lambda: ForcedSystem(duffing, PARAMS, pi), "missing .* argument: 'coordinates'"),
    (lambda: system(params={"P": [1.0, 2.0]}), r"params\['P'\]=\[1.0, 2.0\]: .* or an array of them"),
    (lambda: system(params={**PARAMS, "delta": "0.15"}), r"params\['delta'\]='0.15': give one real number"),
    (lambda: as_coordinates(2), "coordinates=2: give the names of the state variables"),
    (lambda: signs("a"), "one real number"),
    (lambda: grid(shape=(4.0, 4)), "shape=4.0: give a whole number, the int 4"),
    (lambda: mapping(lambda x: x), r"function must be callable as function\(x, p\)"),
    (lambda: mapping(lambda x, p: (x[0] * p, 0.0)), "p is a tuple: write p.name"),
    (lambda: mapping(lambda x, p: -x[0], coordinates=("x",)), r"returns -0\.1: .*`return \(value,\)`"),
    (lambda: mapping(lambda x, p: (np.interp(x[0], [0.0, 2.0, 1.0], [0.0] * 3), x[1])), "must increase"),
    (lambda: mapping(lambda x, p: (np.interp(x[0], LONG, LONG), x[1])), r"2000 points.*systems\.sampled_drive"),
    (lambda: HENON([[1.0, 2.0], [1.0]]), "points=.*: give real numbers in an array"),
    (lambda: interpolated_map(driven_pendulum(), SQUARE), "exact=.*: give a PointMap, made by stroboscopic_map or"),
    (lambda: interpolated_map(table(), SQUARE), "give an exact map"),
    (lambda: section_map(free(), 3), "section=3"),
    (lambda: strobe(writes), r"changes the state x .* declare impacts=\[Impact\(guard, reset\)\]"),
    (lambda: strobe(lambda t, x, p: x[1:] + x[:1]), r"joins tuples and adds arrays.*write \(\*x\[1:\], \*x\[:1\]\)"),
    (lambda: strobe(lambda t, x, p: np.linalg.eigvalsh([[x[0], 1.0], [1.0, x[1]]])), "eigvalsh has no formula"),
    (lambda: strobe(by_name), "cannot be compiled: write it with plain arithmetic"),
    (lambda: strobe(lambda t, x, p: (x[1], -special.jv(0, x[0])))([0.1, 0.2]), r"says: Unknown attribute 'jv'[^\n]*$"),
    (
        lambda: strobe(lambda t, x, p: (x[1], -np.interp(x[0], CUBES, CUBES**2))),
        r"equal distances.*systems\.sampled_drive",
    ),
    (lambda: switched(lambda t, x, p, s: (x[1], -s[0] * gamma(x[0] + 9.0)), SPEED), "analytic functions of math"),
    (lambda: switched(BLOCK["rhs"], lambda t, x, p: x[1]), "and return a tuple"),
    (lambda: switched(BLOCK["rhs"], lambda t, x: (x[1],)), r"switches as switches\(t, x, p\)"),
    (lambda: switched(compares, SPEED), r"functions of math \(it compares by == or != what moves"),
)


@pytest.mark.parametrize(
    ("error", "call", "words"), [*((ValueError, *row) for row in VALUES), *((TypeError, *row) for row in TYPES)]
)
def test_the_message_says_what_to_give(error: type[Exception], call: Callable[[], Any], words: str) -> None:
    with pytest.raises(error, match=words):
        call()


def test_an_impact_that_is_alike_at_every_turn_of_an_angle_is_taken() -> None:
    assert turning(reset=lambda t, x, p: (-x[0], -x[1])).impacts
