"""Stroboscopic maps: the tolerance is met, the bits depend on nothing else, failures are said."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping
from math import atan2, cos, erf, inf, nan, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cellmap import ForcedSystem, angle, stroboscopic_map
from cellmap._compiled.codegen.kernel import flow_kernel
from cellmap._compiled.kernels.blocks import LANES
from cellmap._compiled.machine_code import machine_code
from cellmap._lib.threads import set_threads
from cellmap.maps.orbit_batch import CHUNK, Status
from cellmap.maps.point_map import ToleranceWarning

SPANS: dict[str, tuple[float, ...]] = {
    "pendulum, 3 mm": (pi, 500.0),
    "pendulum, 10 mm": (pi, 500.0),
    "vertically driven": (pi, 4.0),
    "Duffing": (2.2, 2.2),
    "forced pendulum": (pi, 4.0),
    "double pendulum": (pi, pi, 1.0, 1.0),
}
ImagesOf = Callable[..., NDArray[np.float64]]


def starts_of(name: str, count: int, seed: int = 0) -> NDArray[np.float64]:
    span = SPANS[name]
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, len(span))) * span


# Accuracy


@pytest.mark.parametrize(
    ("method", "tolerance"),
    [
        ("auto", 1e-9),
        ("auto", 1e-12),
        ("DOP853", 1e-6),
        ("DOP853", 1e-9),
        ("DOP853", 1e-12),
        ("RK45", 1e-6),
        ("RK45", 1e-9),
    ],
)
@pytest.mark.parametrize("name", SPANS)
def test_the_tolerance_is_met_at_precise_images(
    problems: Mapping[str, ForcedSystem],
    precise_images: list[dict[str, Any]],
    allowance: ImagesOf,
    name: str,
    method: str,
    tolerance: float,
) -> None:
    """Against mpmath's images, fast rotations included."""
    rows = [r for r in precise_images if r["problem"] == name]
    initial_conditions, exact = (np.array([r[key] for r in rows]) for key in ("start", "image"))
    strobe = stroboscopic_map(problems[name], rtol=tolerance, atol=tolerance, method=method)
    images = strobe.iterate(initial_conditions, 1)
    assert (images.status == Status.OK).all()
    assert (np.abs(images.unwrapped - exact) <= allowance(problems[name], exact, tolerance, tolerance)).all()


RANDOM = 20_000  # initial conditions


@pytest.fixture(scope="module")
def tight_images(problems: Mapping[str, ForcedSystem]) -> ImagesOf:
    """Unwrapped images of random starts by the tightest tolerance, which the test above ties to mpmath."""

    @functools.cache
    def images(name: str) -> NDArray[np.float64]:
        strobe = stroboscopic_map(problems[name], rtol=1e-13, atol=1e-13, method="DOP853")
        return strobe.iterate(starts_of(name, RANDOM), 1).unwrapped

    return images


@pytest.mark.parametrize("method", ["auto", "DOP853"])
@pytest.mark.parametrize("name", SPANS)
def test_the_default_tolerance_is_met_at_random_starts(
    problems: Mapping[str, ForcedSystem], allowance: ImagesOf, tight_images: ImagesOf, name: str, method: str
) -> None:
    system, initial_conditions = problems[name], starts_of(name, RANDOM)
    exact = tight_images(name)
    images = stroboscopic_map(system, method=method).iterate(initial_conditions, 1).unwrapped
    assert (np.abs(images - exact) <= allowance(system, exact, 1e-9, 1e-9)).all()


@pytest.mark.parametrize("name", ["pendulum, 10 mm", "vertically driven", "Duffing"])
def test_taylor_meets_a_loose_tolerance_at_random_starts(
    problems: Mapping[str, ForcedSystem], allowance: ImagesOf, tight_images: ImagesOf, name: str
) -> None:
    system, initial_conditions = problems[name], starts_of(name, RANDOM)
    exact = tight_images(name)
    strobe = stroboscopic_map(system, rtol=1e-6, atol=1e-6, method="Taylor")
    error = np.abs(strobe.iterate(initial_conditions, 1).unwrapped - exact)
    assert (error <= allowance(system, exact, 1e-6, 1e-6)).all()


@pytest.mark.parametrize("name", ["Duffing", "double pendulum"])
@pytest.mark.parametrize(
    ("method", "tolerance"), [("DOP853", 1e-4), ("DOP853", 1e-6), ("RK45", 1e-3), ("RK45", 1e-5), ("RK45", 1e-7)]
)
def test_loose_tolerances_are_met(
    problems: Mapping[str, ForcedSystem],
    allowance: ImagesOf,
    tight_images: ImagesOf,
    name: str,
    method: str,
    tolerance: float,
) -> None:
    """The flow stretches the errors of large steps most; the margin under the tolerance makes up for it."""
    system, initial_conditions = problems[name], starts_of(name, RANDOM)[:5_000]
    exact = tight_images(name)[:5_000]
    strobe = stroboscopic_map(system, rtol=tolerance, atol=tolerance, method=method)
    error = np.abs(strobe.iterate(initial_conditions, 1).unwrapped - exact)
    assert (error <= allowance(system, exact, tolerance, tolerance)).all()


def test_agreement_with_scipy_at_random_starts(problems: Mapping[str, ForcedSystem], scipy_images: ImagesOf) -> None:
    for name, span in SPANS.items():
        initial_conditions = starts_of(name, 8, seed=7)
        exact = scipy_images(problems[name], initial_conditions)
        images = stroboscopic_map(problems[name], rtol=1e-12, atol=1e-12).iterate(initial_conditions, 1).unwrapped
        assert np.abs(images - exact).max() <= 1e-9 * max(span)


def test_agreement_with_heyoka(problems: Mapping[str, ForcedSystem]) -> None:
    hy = pytest.importorskip("heyoka")
    theta, v = hy.make_vars("theta", "v")
    equations = [(theta, v), (v, -0.08 * v - (0.1 + 0.545 * hy.cos(hy.time)) * hy.sin(theta))]
    initial_conditions = starts_of("vertically driven", 50, seed=3)
    integrator = hy.taylor_adaptive(equations, [0.0, 0.0], tol=1e-16)
    exact = []
    for start in initial_conditions:
        integrator.time = 0.0
        integrator.state[:] = start
        integrator.propagate_until(2 * pi)
        exact.append(integrator.state.copy())
    strobe = stroboscopic_map(problems["vertically driven"], rtol=1e-12, atol=1e-12)
    assert np.abs(strobe.iterate(initial_conditions, 1).unwrapped - exact).max() < 1e-11


@pytest.mark.slow
def test_the_table_of_precise_images_is_reproduced(
    problems: Mapping[str, ForcedSystem], precise_images: list[dict[str, Any]], precise_image: ImagesOf
) -> None:
    for name in SPANS:
        row = next(r for r in precise_images if r["problem"] == name)
        assert precise_image(problems[name], row["start"]) == pytest.approx(row["image"], rel=1e-15)


@pytest.mark.parametrize("method", ["DOP853", "Taylor"])
def test_a_linear_flow_is_its_exponential(method: str) -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -x[0]

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, pi / 2, ("x", "v")), rtol=1e-14, atol=1e-14, method=method)
    assert strobe([[1.0, 0.0], [3.0, -2.0]]) == pytest.approx(np.array([[0.0, -1.0], [-2.0, -3.0]]), abs=3e-14)


# Time, phase and angles


@pytest.mark.parametrize("phase", [0.0, 0.25, -0.4, 3.25])
def test_the_section_lies_at_the_phase(
    problems: Mapping[str, ForcedSystem], scipy_images: ImagesOf, phase: float
) -> None:
    for name in ("Duffing", "pendulum, 3 mm"):
        initial_conditions = starts_of(name, 4, seed=5)
        images = stroboscopic_map(problems[name], phase=phase).iterate(initial_conditions, 1).unwrapped
        exact = scipy_images(problems[name], initial_conditions, phase=phase)
        assert images == pytest.approx(exact, rel=1e-8, abs=1e-8)


def test_maps_at_two_phases_are_conjugate(problems: Mapping[str, ForcedSystem], scipy_images: ImagesOf) -> None:
    system = problems["Duffing"]
    initial_conditions = starts_of("Duffing", 4, seed=6)
    through = stroboscopic_map(system, phase=0.3)(scipy_images(system, initial_conditions, periods=0.3))
    back = scipy_images(system, through, phase=0.3, periods=0.7)
    assert back == pytest.approx(stroboscopic_map(system).iterate(initial_conditions, 2).points, abs=1e-6)


def test_whole_turns_of_a_fast_rotation(problems: Mapping[str, ForcedSystem], scipy_images: ImagesOf) -> None:
    """Up to 3000 rad a period and 40 periods; the angle returned stays wrapped."""
    system = problems["forced pendulum"]
    initial_conditions = np.array([[0.0, 500.0], [2.0, -333.0], [3.1, 41.0], [-3.1, 0.1]])
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate(initial_conditions, 1)
    exact = scipy_images(system, initial_conditions)
    assert images.unwrapped == pytest.approx(exact, rel=1e-10, abs=1e-9)
    assert np.array_equal(images.rotations[:, 0], np.floor((exact[:, 0] + pi) / (2 * pi)))
    assert not images.rotations[:, 1].any()
    many = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate(initial_conditions[:2], 2)
    assert many.unwrapped == pytest.approx(scipy_images(system, exact[:2], phase=1.0), rel=1e-9, abs=1e-6)
    assert (np.abs(many.points[:, 0]) <= pi).all()


def test_free_rotation_loses_nothing_over_many_periods() -> None:
    """A rotor at 7.25 rotations a period: after 2,000 periods the angle is exact to rounding of each."""
    rotor = ForcedSystem(
        lambda t, x, p: (x[1], 0.0 * x[0]), {}, 1.0, (angle("x", "turns", period=1.0, lower=0.0), "rate")
    )
    images = stroboscopic_map(rotor).iterate([0.125, 7.25], 2000)
    assert images.points == pytest.approx([0.125, 7.25], abs=1e-11)
    assert images.rotations.tolist() == [14500, 0]


# Purity


BATCHES = (1, 2, LANES - 1, LANES, LANES + 1, 3 * LANES + 5)


@pytest.mark.parametrize(
    ("name", "method"), [("vertically driven", "auto"), ("Duffing", "DOP853"), ("double pendulum", "auto")]
)
def test_an_image_does_not_depend_on_its_neighbours(
    problems: Mapping[str, ForcedSystem], name: str, method: str
) -> None:
    """Bit by bit: order, number and kind of the other orbits, and the number of threads."""
    strobe = stroboscopic_map(problems[name], method=method)
    initial_conditions = starts_of(name, CHUNK + 777)
    set_threads(1)
    images = strobe.iterate(initial_conditions, 2).points
    set_threads(None)
    order = np.random.default_rng(1).permutation(len(initial_conditions))
    assert np.array_equal(strobe.iterate(initial_conditions[order], 2).points, images[order])
    for count in BATCHES:
        assert np.array_equal(
            strobe.iterate(initial_conditions[1000 : 1000 + count], 2).points, images[1000 : 1000 + count]
        )
    for threads in (2, 3):
        set_threads(threads)
        assert np.array_equal(strobe.iterate(initial_conditions, 2).points, images)


def test_repeated_starts_have_one_image(problems: Mapping[str, ForcedSystem]) -> None:
    initial_conditions = np.repeat(starts_of("Duffing", 1), 1000, axis=0)
    images = stroboscopic_map(problems["Duffing"])(initial_conditions)
    assert (images == images[0]).all()


# Sweeps


def test_a_sweep_compiles_nothing(problems: Mapping[str, ForcedSystem]) -> None:
    system = problems["Duffing"]
    stroboscopic_map(system)([0.1, 0.1])
    compiled = machine_code.cache_info().misses
    swept = [system.with_params(forcing=f, frequency=w) for f in np.linspace(0.1, 0.3, 5) for w in (0.9, 1.0)]
    images = [stroboscopic_map(one)([0.1, 0.1]) for one in swept]
    assert machine_code.cache_info().misses == compiled
    assert len(np.unique(images, axis=0)) == 10


def test_equal_right_hand_sides_share_their_compiled_code() -> None:
    def make() -> ForcedSystem:
        return ForcedSystem(lambda t, x, p: (x[1], -p.k * x[0] + cos(t)), {"k": 2.0}, 2 * pi, ("x", "v"))

    first, second = make(), make()
    kernels = [flow_kernel(s.rhs, 2, ("k",), "RK45", 1e-6) for s in (first, second)]
    assert first.rhs is not second.rhs
    assert kernels[0].advance is kernels[1].advance


# Right-hand sides of every kind


def test_a_right_hand_side_that_branches(scipy_images: ImagesOf) -> None:
    """A stop on one side: a spring that is stiffer for x > 0.  Its kink is no obstacle to a met tolerance."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        stiffness = p.k if x[0] > 0.0 else 1.0
        return x[1], -0.1 * x[1] - stiffness * x[0] + sin(t)

    system = ForcedSystem(rhs, {"k": 4.0}, 2 * pi, ("x", "v"))
    initial_conditions = np.random.default_rng(2).uniform(-1.0, 1.0, (10, 2))
    images = stroboscopic_map(system, rtol=1e-7, atol=1e-7)(initial_conditions)
    assert images == pytest.approx(scipy_images(system, initial_conditions, rtol=1e-12), abs=2e-6)
    many = stroboscopic_map(system, rtol=1e-7, atol=1e-7)(np.repeat(initial_conditions, 10, axis=0))
    assert np.array_equal(many[::10], images)


def test_modules_and_functions_of_math_in_a_right_hand_side_that_branches(scipy_images: ImagesOf) -> None:
    import math

    def torque(v: float) -> float:
        return 0.1 * v if v > 0.0 else 0.2 * v

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -torque(x[1]) - math.sin(x[0]) + p.f * np.cos(t) + math.pi * 0.0 + 0.01 * min(x[0], 1.0)

    system = ForcedSystem(rhs, {"f": 0.3}, 2 * pi, ("x", "v"))
    initial_conditions = [[0.5, 0.1], [-1.0, -0.5]]
    images = stroboscopic_map(system, rtol=1e-7, atol=1e-7)(initial_conditions)
    assert images == pytest.approx(scipy_images(system, initial_conditions, rtol=1e-12), abs=2e-6)


def test_functions_without_vector_form_come_from_libm(scipy_images: ImagesOf) -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -atan2(x[0], 1.0 + x[1] ** 2) - 0.1 * erf(x[1]) + 0.2 * cos(t)

    system = ForcedSystem(rhs, {}, 2 * pi, ("x", "v"))
    initial_conditions = np.random.default_rng(4).uniform(-2.0, 2.0, (6, 2))
    assert stroboscopic_map(system)(initial_conditions) == pytest.approx(
        scipy_images(system, initial_conditions), abs=1e-8
    )


def test_no_parameters_one_variable_and_an_unforced_flow() -> None:
    decay = ForcedSystem(lambda t, x, p: (-x[0],), {}, 1.0, ("x",))
    for method in ("DOP853", "RK45", "Taylor"):
        assert stroboscopic_map(decay, method=method)([2.0]) == pytest.approx(2.0 * np.exp(-1.0), rel=1e-8)


def test_helpers_loops_and_numpy_in_a_right_hand_side(scipy_images: ImagesOf) -> None:
    def spring(a: float, b: float) -> float:
        return np.sin(a - b) + 0.1 * (a - b) ** 3

    def rhs(t: float, x: Any, p: Any) -> tuple[float, ...]:
        n = len(x) // 2
        force = [sum(spring(x[j], x[i]) for j in (i - 1, i + 1) if 0 <= j < n) for i in range(n)]
        return *x[n:], *(f - p.c * v + 0.1 * np.cos(t) for f, v in zip(force, x[n:], strict=True))

    names = ("a", "b", "c", "u", "v", "w")
    system = ForcedSystem(rhs, {"c": 0.1}, 2 * pi, names)
    initial_conditions = np.random.default_rng(5).uniform(-1.0, 1.0, (3, 6))
    strobe = stroboscopic_map(system, rtol=1e-7, atol=1e-7, method="RK45")
    assert strobe(initial_conditions) == pytest.approx(scipy_images(system, initial_conditions), abs=1e-6)


# Failures are said


def test_what_is_not_finite_spoils_no_neighbour() -> None:
    """The right-hand side is not a number where abs(x) > 1: those orbits end, all others keep their bits."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return 0.01 * sqrt(1.0 - x[0] ** 2) - 0.1 * x[0], -x[1] + cos(t)

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("x", "v")))
    initial_conditions = np.column_stack([np.linspace(-1.05, 0.9, 400), np.linspace(-1.0, 1.0, 400)])
    bad = np.abs(initial_conditions[:, 0]) > 1.0
    images = strobe.iterate(initial_conditions, 1)
    assert 5 < bad.sum() < 20
    assert np.array_equal(images.status == Status.DIVERGED, bad)
    assert np.isnan(images.points[bad]).all() and not images.rotations[bad].any()
    assert np.array_equal(images.points[~bad], strobe(initial_conditions[~bad]))


@pytest.mark.parametrize("form", ["traced", "branching", "as it is"])
def test_a_blow_up_in_finite_time(form: str) -> None:
    """x' = x^2 has x(1) = x0 / (1 - x0): finite for x0 < 1, blown up within the period for x0 > 1."""

    def traced(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[0] ** 2,)

    def branching(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[0] ** 2 if x[0] < 1e300 else 2.0 * x[0] ** 2,)

    def as_it_is(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[0] ** 2 if x[0] != 1e300 else 2.0 * x[0] ** 2,)

    forms = {"traced": traced, "branching": branching, "as it is": as_it_is}
    system = ForcedSystem(forms[form], {}, 1.0, ("x",))
    initial_conditions = np.array([[-5.0], [0.0], [0.5], [0.9], [0.99], [1.01], [1.5], [100.0]])
    images = stroboscopic_map(system, rtol=1e-9, atol=1e-9).iterate(initial_conditions, 1)
    assert images.status.tolist() == [Status.OK] * 5 + [Status.DIVERGED] * 3
    exact = initial_conditions[:5] / (1.0 - initial_conditions[:5])
    assert images.points[:5] == pytest.approx(exact, rel=1e-7)
    assert np.isnan(images.points[5:]).all()


def test_angles_too_fast_for_any_number_of_steps_have_diverged(problems: Mapping[str, ForcedSystem]) -> None:
    images = stroboscopic_map(problems["forced pendulum"]).iterate([[0.0, 1e200], [0.0, 1.0]], 1)
    assert images.status.tolist() == [Status.DIVERGED, Status.OK]
    assert np.isfinite(images.points).all(axis=1).tolist() == (images.status < Status.ESCAPED).tolist()


def test_a_missed_tolerance_is_said(problems: Mapping[str, ForcedSystem]) -> None:
    strobe = stroboscopic_map(problems["forced pendulum"], rtol=1e-13, atol=1e-13, method="RK45", max_steps=64)
    initial_conditions = [[1.0, 2.0], [0.5, 3.0]]
    for use in (strobe, lambda x: strobe.iterate(x, 2), lambda x: strobe.orbit(x, 2)):
        with pytest.warns(ToleranceWarning, match="2 of 2 orbits of forced pendulum did not meet the tolerance"):
            use(initial_conditions)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        images = strobe.iterate(initial_conditions, 1)
    assert (images.status == Status.INACCURATE).all()
    best = stroboscopic_map(problems["forced pendulum"])(initial_conditions)
    assert images.points == pytest.approx(best, abs=1e-4)


def test_a_missed_tolerance_is_not_forgotten(problems: Mapping[str, ForcedSystem]) -> None:
    """The status stays with the orbit through later periods that are accurate again."""
    system = ForcedSystem(lambda t, x, p: (x[1], -8.0 * x[1] - sin(x[0])), {}, 2 * pi, (angle("theta"), "v"))
    strobe = stroboscopic_map(system, method="RK45", rtol=1e-6, atol=1e-6, max_steps=300)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        orbit = strobe.orbit([[1.0, 3000.0], [1.0, 0.0]], 4)
    assert orbit.status[:, 0].tolist() == [Status.OK] + [Status.INACCURATE] * 4
    assert (orbit.status[:, 1] == Status.OK).all()


def test_stiff_damping_is_met_or_said() -> None:
    """gamma T = 2000: explicit methods need steps of 2.785 / gamma, many more than usual; none is silently wrong."""
    system = ForcedSystem(lambda t, x, p: (x[1], -2000.0 * x[1] - x[0]), {}, 1.0, ("x", "v"))
    fast = 0.5 * (2000.0 + sqrt(2000.0**2 - 4.0))
    slow = 1.0 / fast
    exact = (fast * np.exp(-slow) - slow * np.exp(-fast)) / (fast - slow)
    images = stroboscopic_map(system).iterate([1.0, 0.0], 1)
    assert images.status == Status.OK
    assert images.points[0] == pytest.approx(exact, abs=2e-9)


@pytest.mark.parametrize("period", [1e-6, 1e6])
def test_tiny_and_huge_periods(period: float) -> None:
    """x' = (cos(w t) - x) w in units of the period's own phase: the map is that of w = 1."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float]:
        return ((cos(p.w * t) - x[0]) * p.w,)

    system = ForcedSystem(rhs, {"w": 2 * pi / period}, lambda p: 2 * pi / p.w, ("x",))
    # x(2 pi) = exp(-2 pi) (x0 - 1/2) + 1/2 for x' = cos(s) - x.
    assert stroboscopic_map(system)([3.0]) == pytest.approx(np.exp(-2 * pi) * 2.5 + 0.5, abs=1e-8)


# Bad input


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"system": 3}, TypeError, "system=3: give a ForcedSystem"),
        ({"phase": nan}, ValueError, "phase=nan: give a finite number"),
        ({"phase": "0"}, TypeError, "phase='0': give one real number"),
        ({"rtol": 0.0}, ValueError, "rtol=0.0: give a number of at least 1e-14"),
        ({"rtol": -1e-9}, ValueError, "rtol=-1e-09: give a number of at least 1e-14"),
        ({"rtol": inf}, ValueError, "rtol=inf: give a finite number"),
        ({"atol": 1e-15}, ValueError, "atol=1e-15: give a number of at least 1e-14"),
        ({"atol": None}, TypeError, "atol=None: give one real number"),
        ({"method": "RK4"}, ValueError, "method='RK4': choose one of 'auto', 'DOP853', 'RK45', 'Taylor'"),
        ({"method": None}, ValueError, "method=None: choose one of"),
        ({"method": ["RK45"]}, ValueError, "choose one of"),
        ({"max_steps": 2}, ValueError, "max_steps=2: give a whole number of at least 4"),
        ({"max_steps": 1e4}, TypeError, "max_steps=10000.0: give a whole number"),
        ({"max_steps": True}, TypeError, "max_steps=True: give a whole number"),
    ],
)
def test_bad_arguments_are_refused(
    problems: Mapping[str, ForcedSystem], changes: dict[str, Any], error: type[Exception], message: str
) -> None:
    arguments: dict[str, Any] = {"system": problems["Duffing"], **changes}
    with pytest.raises(error, match=message):
        stroboscopic_map(**arguments)


def test_taylor_refuses_what_has_no_series() -> None:
    system = ForcedSystem(lambda t, x, p: (x[1], -erf(x[0])), {}, 1.0, ("x", "v"))
    with pytest.raises(ValueError, match="use method='DOP853'"):
        stroboscopic_map(system, method="Taylor")
    assert stroboscopic_map(system).recipe["method"] == "DOP853"


def test_what_cannot_be_compiled_is_refused_clearly() -> None:
    table = {"a": 1.0}

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -table["a"] * (x[0] if x[0] != 0 else 2.0 * x[0])

    with pytest.raises(TypeError, match="cannot be compiled: write it with plain arithmetic"):
        stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("x", "v")))
