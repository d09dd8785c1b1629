"""Arguments that analyses of bifurcations refuse: a call, and the words of the message."""

from dataclasses import replace
from math import cos, pi, sin
from types import SimpleNamespace

import numpy as np
import pytest
from branch_kinds import POINT
from cases import HANGING, branch_at_rest, branch_of, delayed_logistic, mathieu

from cellmap import (
    CellGrid,
    ForcedSystem,
    angle,
    bifurcation_diagram,
    continue_orbit,
    discrete_map,
    find_attractors,
    periodic_orbit,
    stability_map,
)
from cellmap.bifurcations import (
    OrbitFunction,
    arnold_tongue,
    attractor_atlas,
    codimension_two_form,
    continue_bifurcation,
    continue_circle,
    critical_values,
    find_branches,
    floquet_multipliers,
    period_doubling_cascade,
    switch_branch,
    switch_circle,
)
from systems import driven_pendulum, henon_map

SCALED = discrete_map(lambda x, p: (p.r * x[0] * (1 - p.s * x[0]),), {"r": 3.3, "s": 1.0}, ("x",))
CUBIC = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3 + p.e * x[0],), {"r": 0.5, "e": 0.0}, ("x",))
TWINS = discrete_map(lambda x, p: tuple(p.r * v + p.e - v**3 for v in x), {"r": 0.5, "e": 0.0}, ("x", "y"))
LINE = discrete_map(lambda x, p: (p.a * x[0] + p.b,), {"a": 0.5, "b": 0.1}, ("x",))
FLIP = discrete_map(lambda x, p: (0.5 * x[0], -x[1]), {"s": 1.0}, ("x", "y"))
THREE, WIDE = [1.0, 2.0, 3.0], ((0.5, 1.5), (-0.5, 0.5))
CELLS = CellGrid((0.0,), (1.0,), (10,))
AXES = ("alpha", THREE), ("beta", THREE)


@pytest.fixture(scope="module")
def s(pendulum, henon):
    cubic, twins = (branch_at_rest(m, "r", 0.5, 1.5, step=0.2) for m in (CUBIC, TWINS))
    delayed = branch_of(delayed_logistic(1.7, 1.0), [0.4, 0.4], "r", 1.5, 2.3)
    chaotic = find_attractors(henon_map(), [[0.1, 0.1]])[0]
    unstable = periodic_orbit(SCALED, [0.69])
    fold, doubling = henon.bifurcations
    return SimpleNamespace(**{name: value for name, value in locals().items() if name != "s"})


def atlas(**changes):
    attractor_atlas(
        SCALED, **({"x": ("r", [2.0, 3.0]), "y": ("s", [0.5, 1.0]), "initial_conditions": [[0.3]]} | changes)
    )


def diagram(**changes):
    good = {"point_map": SCALED, "parameter": "r", "values": [3.0, 3.2], "initial_conditions": [0.3]}
    bifurcation_diagram(**(good | changes))


def branch(**changes):
    good = {"orbit": periodic_orbit(CUBIC, [0.0]), "parameter": "r", "lower": 0.0, "upper": 1.5}
    continue_orbit(CUBIC, **(good | changes))


def tongue(sign=1, rotations=1, period=3, window=(2.0, 2.4), start=(0.1,)):
    circle = discrete_map(lambda x, p: (x[0] + sign * p.w - p.k * sin(x[0]),), {"w": 2.2, "k": 0.8}, (angle("x"),))
    few = {"transient": 200, "periods": 300, "step": 0.5}
    arnold_tongue(circle, rotations, period, ("w", "k"), window, (0.7, 0.9), start, **few)


def multipliers(*arguments, **more):
    floquet_multipliers(mathieu(), *(arguments or (HANGING,)), **more)


BRANCHING = ForcedSystem(lambda t, x, p: (-x[0] if x[0] > 0 else -2 * x[0],), {}, 1.0, ("x",))
FIXED = ForcedSystem(lambda t, x, p: (cos(p.rate * t) * x[0],), {"rate": 1.0}, 2 * pi, ("x",))

VALUES = [
    (lambda s: atlas(x=("q", [0.0, 1.0])), r"x\[0\]='q': this map has the parameters"),
    (lambda s: atlas(y=("r", [0.0, 1.0])), "y has the parameter 'r' of x"),
    (lambda s: atlas(x=("r", [1.0, 0.0])), "give at least 2 values in increasing order"),
    (lambda s: atlas(initial_conditions=[0.3]), "give rows"),
    (lambda s: diagram(values=[3.0, 3.2, 3.1]), "values goes up and down"),
    (lambda s: diagram(values=[3.0, np.nan]), "values has the value nan"),
    (lambda s: diagram(initial_conditions=[0.3, 0.4]), "initial_conditions has shape"),
    (lambda s: diagram(initial_conditions=[[[0.3]]]), "initial_conditions has shape"),
    (lambda s: diagram(periods=19), "periods=19"),
    (lambda s: diagram(longest_period=65), "longest_period=65"),
    (lambda s: diagram(perturbation=np.inf), "perturbation"),
    (lambda s: diagram(perturbation=[1e-6, 1e-6]), "perturbation"),
    (lambda s: branch(parameter="depth"), "parameter='depth'"),
    (lambda s: branch(lower=0.7), r"must contain r=0\.5"),
    (lambda s: branch(lower=1.0, upper=0.2), r"upper=0\.2: give a number above"),
    (lambda s: branch(sizes=[0.0]), "positive numbers"),
    (lambda s: continue_orbit(SCALED, periodic_orbit(SCALED.with_params(r=2.0), [0.5]), "r", 1, 4), "is no orbit of"),
    (lambda s: branch_of(s.pendulum, HANGING, "frequency", -10.0, 100.0), "period"),
    (lambda s: switch_branch(s.cubic, s.cubic.bifurcations[0], 1.2, 1.4), "must contain the bifurcation"),
    (lambda s: switch_branch(s.henon, s.doubling, -1.0, 1.4, side=2), "side=2"),
    (lambda s: switch_branch(s.henon, s.doubling, -1.0, 1.4, step=1.1), r"step=1\.1"),
    (lambda s: switch_branch(s.henon, s.doubling, -1.0, 1.4, step=-1.0), r"step=-1\.0"),
    (lambda s: switch_branch(s.henon, s.fold, -1.0, 1.0), "no branch of periodic orbits"),
    (lambda s: switch_branch(s.henon, replace(s.doubling, _branch_direction=None), -1, 1), "no branch of periodic"),
    (lambda s: switch_branch(s.delayed, s.delayed.bifurcations[0], 1.5, 2.3), "no branch of periodic orbits"),
    (lambda s: switch_circle(s.delayed, s.delayed.bifurcations[0], 1.6, 1.8), "must contain the bifurcation"),
    (lambda s: switch_circle(s.henon, s.doubling, -1.0, 1.0), "give a Neimark-Sacker bifurcation"),
    (lambda s: continue_bifurcation(s.cubic, s.cubic.bifurcations[0], "depth", *WIDE), "parameter='depth'"),
    (lambda s: continue_bifurcation(s.cubic, s.cubic.bifurcations[0], "e", WIDE[0], (0.1, 1.0)), "second="),
    (lambda s: continue_bifurcation(s.cubic, s.fold, "e", *WIDE), r"^bifurcation=.*it is not of branch=.*give one of"),
    (
        lambda s: continue_bifurcation(s.twins, s.twins.bifurcations[0], "e", *WIDE),
        r"^bifurcation=Bifurcation\(degenerate.*no condition singles out",
    ),
    (lambda s: period_doubling_cascade(SCALED, s.unstable, "r", 3.5), "give a stable orbit"),
    (lambda s: period_doubling_cascade(SCALED, s.unstable, "r", 3.3), r"limit=3\.3"),
    (lambda s: period_doubling_cascade(henon_map(), s.chaotic, "a", 1.2), "give a periodic orbit"),
    (lambda s: multipliers([0.1, 0.0]), "v is not constant there"),
    (lambda s: multipliers([HANGING]), "give one state"),
    (lambda s: multipliers(params={"omega": 1.0}), r"params has 'omega': this system has \['alpha', 'beta', 'gamma'\]"),
    (lambda s: multipliers(params={"beta": [0.1, np.nan]}), "give finite numbers"),
    (lambda s: multipliers(params={"beta": [1, 2], "alpha": THREE}), r"parameters have the shapes beta \(2,\), alpha"),
    (lambda s: multipliers(rtol=1e-20), "rtol=1e-20"),
    (lambda s: floquet_multipliers(FIXED, [0.0], {"rate": [1.0, 1.5]}), "one period later"),
    (
        lambda s: stability_map(mathieu(), HANGING, ("beta", [1, 2]), AXES[0]),
        "give at least 3 values in increasing order",
    ),
    (
        lambda s: stability_map(mathieu(), HANGING, ("beta", [1, 3, 2]), AXES[0]),
        "at least 3 values in increasing order",
    ),
    (lambda s: stability_map(mathieu(), HANGING, AXES[1], AXES[1]), "give two parameters"),
    (lambda s: stability_map(SCALED, s.unstable, ("depth", THREE), ("s", THREE)), "parameter='depth'"),
    (lambda s: stability_map(SCALED, s.unstable, ("r", THREE), ("depth", THREE)), r"y\[0\]='depth'"),
    (lambda s: critical_values(mathieu(), HANGING, "beta", 0.2, 0.1), r"upper=0\.1: give a number above lower=0\.2"),
    (lambda s: critical_values(mathieu(), HANGING, "beta", 0.1, 0.2, n_points=2), "n_points=2"),
    (lambda s: codimension_two_form(FLIP, [0.0, 0.0], POINT.RESONANCE_1_4), r"kind=.*1:4 resonance.*multipliers"),
    (lambda s: s.cubic.with_zeros({"same": lambda t, x, p: x[0]}), r"functions\['same'\]: it is zero at all points"),
    (lambda s: s.cubic.with_zeros({"fast": "speed"}), "quantity='speed'"),
    (lambda s: s.cubic.measure("energy"), "quantity='energy': the coordinates are"),
    (lambda s: s.henon.measure(2), "quantity=2: the coordinates have the numbers 0 to 1"),
    (lambda s: s.cubic.measure("x", "peak"), "measure='peak'"),
    (lambda s: OrbitFunction("x", value=np.nan), "value=nan: give a finite number"),
    (lambda s: find_branches(SCALED, "r", 2.0, 1.0, CELLS), "upper=1"),
    (lambda s: tongue(1, 2, 4), "without common divisor"),
    (lambda s: tongue(1, 1, 2), "no orbit with the rotation number"),
    (lambda s: tongue(-1, 1), r"turns the other way, with the rotation number -0\.333333333"),
    (lambda s: tongue(-1, -4), "rotations=-4: give a whole number of at least -3"),
    (lambda s: tongue(start=[[0.1]]), "give one state"),
    (lambda s: arnold_tongue(LINE, 1, 2, ("a", "b"), *WIDE, [0.1]), "neither an angle nor a plane"),
    (lambda s: continue_circle(s.delayed.point_map, "r", [2.1], [[0.5, 0.4]]), "give one state"),
]
TYPES = [
    (lambda s: continue_bifurcation(s.cubic, s.cubic.bifurcations[0], "e", 0.01, (-1.0, 1.0)), "two numbers"),
    (lambda s: multipliers(params={"beta": "much"}), "give real numbers"),
    (lambda s: multipliers(params=[0.1]), "give a mapping of names to arrays"),
    (lambda s: floquet_multipliers("pendulum", HANGING), "give a ForcedSystem"),
    (
        lambda s: floquet_multipliers(driven_pendulum(friction=1.0), HANGING),
        "its right-hand side is discontinuous.*give a system without switching functions",
    ),
    (lambda s: floquet_multipliers(BRANCHING, [0.0]), "derivatives of its right-hand side are not known"),
    (lambda s: stability_map(mathieu(), HANGING, "beta", AXES[0]), "give a pair of a parameter's name and its values"),
    (lambda s: stability_map(mathieu(), HANGING, (1, THREE), AXES[0]), "give the name of a parameter"),
    (lambda s: stability_map(SCALED, [0.7], ("r", THREE), ("s", THREE)), "give a PeriodicOrbit"),
    (lambda s: stability_map(mathieu(), s.unstable, *AXES), "give its PointMap"),
    (lambda s: OrbitFunction("x", value="1"), "value='1': give one real number"),
    (lambda s: OrbitFunction("x", extremum="no"), "extremum='no': give True or False"),
    (lambda s: s.cubic.with_zeros(None), "functions=None: give a mapping"),
]


@pytest.mark.parametrize(
    ("call", "message", "error"), [(*v, ValueError) for v in VALUES] + [(*t, TypeError) for t in TYPES]
)
def test_bad_arguments_are_refused(s, call, message, error):
    with pytest.raises(error, match=message):
        call(s)


def test_diagrams_beyond_memory_are_refused():
    with pytest.raises(MemoryError, match="take fewer"):
        diagram(values=np.linspace(3, 4, 1_000_001), periods=10**8)


@pytest.mark.parametrize(
    "function",
    [
        lambda x: x,
        lambda t, x, p: p.b,
        lambda t, x, p: x[5],
        lambda t, x, p: 1j * x[0],
        lambda t, x, p: None,
    ],
)
def test_wrong_functions_of_orbits_are_refused(s, function):
    errors = (TypeError, ValueError, AttributeError, IndexError)
    with pytest.raises(errors, match=r"quantity=.*; give a function f\("):
        s.cubic.measure(function, None)
