"""What every factory of a reference system must meet.  A new one is found by itself."""

import functools
import importlib
import inspect
import itertools
import pkgutil
from collections.abc import Callable
from math import inf, pi
from typing import Any, get_type_hints

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import systems
from cellmap import ForcedSystem, PointMap, stroboscopic_map
from cellmap._compiled.codegen.expression import in_order, operation_on_numbers
from cellmap._compiled.codegen.kernel import traced_function, traced_switching
from cellmap._compiled.codegen.rebind import rebind
from cellmap._compiled.codegen.trace import parameter_record
from cellmap.maps import jacobian

Factory = Callable[..., Any]


def factories() -> dict[str, Factory]:
    """Public functions of the package that return a system or a map and need no argument."""
    found = {}
    for module in pkgutil.iter_modules(systems.__path__, "systems."):
        for name, function in inspect.getmembers(importlib.import_module(module.name), inspect.isfunction):
            if name.startswith("_") or function.__module__ != module.name:
                continue
            result = get_type_hints(function).get("return")
            arguments = inspect.signature(function).parameters.values()
            if result in (ForcedSystem, PointMap) and all(a.default is not a.empty for a in arguments):
                found[name] = function
    return found


FACTORIES = factories()
FLOWS = [name for name, f in FACTORIES.items() if get_type_hints(f)["return"] is ForcedSystem]
SMOOTH_FLOWS = [name for name in FLOWS if FACTORIES[name]().switches is None]
JUMPING_FLOWS = [name for name in FLOWS if name not in SMOOTH_FLOWS]
MAPS = [name for name in FACTORIES if name not in FLOWS]
EVERY = pytest.mark.parametrize("name", FACTORIES)
EVERY_FLOW = pytest.mark.parametrize("name", FLOWS)
EVERY_SMOOTH_FLOW = pytest.mark.parametrize("name", SMOOTH_FLOWS)
EVERY_JUMPING_FLOW = pytest.mark.parametrize("name", JUMPING_FLOWS)
EVERY_MAP = pytest.mark.parametrize("name", MAPS)
ELEMENTARY = ("sin", "cos", "exp", "sqrt")


def span_of(system: ForcedSystem | PointMap) -> NDArray[np.float64]:
    """Half the circle for angles; 100 for rates per second, 2 for other variables."""
    coordinates = system.axes if isinstance(system, ForcedSystem) else system.coordinates
    return np.array([0.5 * c.period if c.period else 100.0 if c.unit.endswith("/s") else 2.0 for c in coordinates])


def random_initial_conditions(system: ForcedSystem | PointMap, count: int) -> NDArray[np.float64]:
    span = span_of(system)
    return np.random.default_rng(0).uniform(-1.0, 1.0, (count, len(span))) * span


@functools.cache
def map_of(name: str) -> PointMap:
    return stroboscopic_map(FACTORIES[name](), rtol=1e-12, atol=1e-12)


def initial_conditions_that_stay(name: str, count: int) -> NDArray[np.float64]:
    """Random initial conditions whose orbits are not divergent after a period."""
    system = FACTORIES[name]()
    initial_conditions = random_initial_conditions(system, 10 * count)
    images = map_of(name).iterate(initial_conditions, 1).unwrapped
    farthest = [inf if c.period else 10.0 * span for c, span in zip(system.axes, span_of(system), strict=True)]
    staying = (np.abs(images) <= farthest).all(axis=-1)  # NaN, where an orbit has diverged, does not stay
    assert np.count_nonzero(staying) >= count
    return initial_conditions[staying][:count]


def _changed(value: Any) -> Any:
    """Other numbers; how many there are, and what is connected, belongs to the equations."""
    if isinstance(value, tuple):
        return tuple(map(_changed, value))
    return 1.1 * value if isinstance(value, float) else value


def growth_of_volumes(system: ForcedSystem, initial_conditions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Liouville: the exponential of the divergence, integrated along the orbits of one period by SciPy."""
    rhs = rebind(system.rhs, {n: getattr(np, n) for n in ELEMENTARY})
    count, d = initial_conditions.shape
    directions = 1e-30j * np.eye(d)[:, :, None]  # complex steps: derivatives without cancellation

    def fun(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        states = y.reshape(d + 1, count)[:d]
        rates = [np.broadcast_to(v, count) for v in rhs(t, tuple(states), system.parameters)]
        moved = (
            np.broadcast_to(rhs(t, tuple(states + step), system.parameters)[j], count)
            for j, step in enumerate(directions)
        )
        return np.concatenate([*rates, sum(v.imag for v in moved) / 1e-30])

    begin = np.vstack([initial_conditions.T, np.zeros(count)]).ravel()
    solution = solve_ivp(fun, (0.0, system.length), begin, method="DOP853", rtol=1e-13, atol=1e-14)
    assert solution.success
    return np.exp(solution.y[-count:, -1])


def test_the_factories_of_the_package_are_found() -> None:
    known = {"driven_pendulum", "dimensionless_pendulum", "two_well_duffing", "forced_pendulum", "henon_map"}
    assert known <= set(FACTORIES)


@EVERY
def test_a_factory_is_exported_and_documented(name: str) -> None:
    factory = FACTORIES[name]
    assert getattr(systems, name) is factory
    text = inspect.getdoc(factory) or ""
    assert "References\n----------" in text, "the source of the equation is missing"
    assert any(year in text for year in map(str, range(1900, 2100))), "the year of the source is missing"
    assert " = " in text.split("Parameters\n")[0], "the equation is missing"
    assert ">>>" in text
    for argument in inspect.signature(factory).parameters:
        assert argument in text


@EVERY
def test_every_number_given_is_checked(name: str) -> None:
    for argument in inspect.signature(FACTORIES[name]).parameters:
        for bad in (float("nan"), float("inf"), None, "1.0", 1j):
            with pytest.raises((TypeError, ValueError), match=f"{argument}.*=.*: give"):
                FACTORIES[name](**{argument: bad})


@EVERY_FLOW
def test_the_right_hand_side_is_one_function_for_all_values(name: str) -> None:
    one = FACTORIES[name]()
    arguments = inspect.signature(FACTORIES[name]).parameters.values()
    other = FACTORIES[name](**{a.name: _changed(a.default) for a in arguments})
    assert other.rhs is one.rhs
    assert other.length > 0.0


def computed(outputs: Any, time: float, state: Any, system: ForcedSystem, signs: Any = ()) -> list[float]:
    """What a trace says, node by node."""
    values: dict[str, Any] = {"time": lambda _: time, "state": state.__getitem__, "sign": signs.__getitem__}
    values["parameter"] = tuple(system.params.values()).__getitem__
    known: dict[Any, float] = {}
    for node in in_order(outputs):
        read = values.get(node.operation, operation_on_numbers(node.operation) if node.arguments else float)
        known[node] = read(*(known[a] for a in node.arguments)) if node.arguments else read(node.value)
    return [known[e] for e in outputs]


@EVERY_SMOOTH_FLOW
def test_plain_python_scipy_and_the_trace_agree(name: str) -> None:
    system = FACTORIES[name]()
    traced = traced_function(system.rhs, system.dimension, tuple(system.params))
    assert traced is not None and traced.is_analytic
    for t, x in zip((0.0, 0.3, 0.8), random_initial_conditions(system, 3), strict=True):
        plain = system.derivative(t * system.length, tuple(map(float, x)))
        assert computed(traced.outputs, t * system.length, x.tolist(), system) == pytest.approx(plain, rel=1e-14)
        assert np.array_equal(system.fun(t * system.length, x), plain)


@EVERY_SMOOTH_FLOW
def test_the_right_hand_side_repeats_itself_after_the_period(name: str) -> None:
    """With 30 digits, so that a period that is nearly right does not pass."""
    import mpmath

    system = FACTORIES[name]()
    with mpmath.workdps(30):
        rhs = rebind(system.rhs, {n: getattr(mpmath, n) for n in ELEMENTARY})
        p = parameter_record(tuple(system.params))(*map(mpmath.mpf, system.params.values()))
        for t, x in zip((0.0, 0.21, 0.73), random_initial_conditions(system, 3), strict=True):
            begin, period = mpmath.mpf(t) * system.length, mpmath.mpf(system.length)
            state = tuple(map(mpmath.mpf, map(float, x)))
            now, later = rhs(begin, state, p), rhs(begin + period, state, p)
            scale = max(abs(v) for v in now)
            assert max(abs(a - b) for a, b in zip(now, later, strict=True)) < 1e-14 * scale


@EVERY_JUMPING_FLOW
def test_every_side_is_smooth_and_periodic_and_is_what_its_trace_says(name: str) -> None:
    system = FACTORIES[name]()
    assert system.switches is not None
    traced = traced_switching((system.rhs, system.switches), system.dimension, tuple(system.params))
    assert traced is not None and traced.is_analytic
    for t, x in zip((0.0, 0.3, 0.8), random_initial_conditions(system, 3), strict=True):
        time, state = t * system.length, tuple(map(float, x))
        for signs in itertools.product((-1.0, 1.0), repeat=len(traced.surfaces)):
            plain = system.derivative(time, state, signs)
            seen = computed(traced.free_motion.outputs, time, state, system, signs)
            assert seen == pytest.approx(plain, rel=1e-14)
            assert system.derivative(time + system.length, state, signs) == pytest.approx(plain, rel=1e-12, abs=1e-12)


@EVERY_FLOW
def test_angles_are_angles(name: str) -> None:
    """A full rotation of an angle changes nothing."""
    system = FACTORIES[name]()
    for x in random_initial_conditions(system, 5):
        for j, coordinate in enumerate(system.axes):
            if coordinate.period:
                rotated = x.copy()
                rotated[j] += 3.0 * coordinate.period
                assert system.fun(0.3, rotated) == pytest.approx(system.fun(0.3, x), rel=1e-11, abs=1e-11)


@EVERY_SMOOTH_FLOW
def test_the_map_agrees_with_scipy(name: str, scipy_images: Callable[..., NDArray[np.float64]]) -> None:
    initial_conditions = initial_conditions_that_stay(name, 6)
    expected = scipy_images(FACTORIES[name](), initial_conditions, rtol=1e-12)
    assert map_of(name).iterate(initial_conditions, 1).unwrapped == pytest.approx(expected, rel=1e-9, abs=1e-9)


SMALL, LARGE = ([n for n in SMOOTH_FLOWS if (FACTORIES[n]().dimension > 3) is large] for large in (False, True))


@pytest.mark.parametrize("name", [*SMALL, *(pytest.param(n, marks=pytest.mark.thorough) for n in LARGE)])
def test_volumes_grow_by_the_divergence(name: str) -> None:
    system = FACTORIES[name]()
    scale, initial_conditions = span_of(system), initial_conditions_that_stay(name, 5)
    matrices = jacobian(map_of(name), initial_conditions) * (scale[None, :] / scale[:, None])
    expected = growth_of_volumes(system, initial_conditions)
    assert np.linalg.det(matrices) == pytest.approx(expected, rel=1e-10, abs=1e-10)


@EVERY_FLOW
def test_with_params_takes_every_parameter(name: str) -> None:
    system = FACTORIES[name]()
    for parameter, value in system.params.items():
        assert getattr(system.with_params(**{parameter: value * 1.25}).parameters, parameter) == value * 1.25


@EVERY_MAP
def test_a_discrete_map_is_a_point_map(name: str) -> None:
    made = FACTORIES[name]()
    initial_conditions = 0.1 * random_initial_conditions(made, 20)
    images = made.iterate(initial_conditions, 3)
    assert np.isfinite(images.points).all()
    h = 1e-6
    for j in range(made.dimension):
        moved = [initial_conditions + s * h * np.eye(made.dimension)[j] for s in (1, -1)]
        slope = (made.iterate(moved[0], 1).unwrapped - made.iterate(moved[1], 1).unwrapped) / (2 * h)
        assert jacobian(made, initial_conditions)[..., j] == pytest.approx(slope, abs=1e-8)


def test_periods_are_the_familiar_ones() -> None:
    assert systems.driven_pendulum().length == 0.02
    assert systems.dimensionless_pendulum().length == 2 * pi
    assert systems.two_well_duffing(frequency=2.0).length == pi
