"""Discontinuous right-hand sides: sliding and sticking, crossings, events in time; against SciPy."""

import functools
from collections.abc import Callable
from math import exp, pi, sqrt
from typing import Any

import numpy as np
import pytest
from discontinuous_systems import (
    AT_ONCE,
    CASES,
    EVERY_CASE,
    Array,
    Mode,
    Oracle,
    differences,
    initial_conditions_of,
    rubbed,
    table,
)
from two_tiers import at_once

from cellmap import ForcedSystem, Status, stroboscopic_map
from cellmap._compiled.kernels.blocks import LANES
from cellmap.maps import ToleranceWarning, jacobian
from systems import dimensionless_pendulum


@functools.cache
def exact_images(name: str) -> Array:
    make, span = EVERY_CASE[name]
    oracle = Oracle(make())
    return np.array([oracle.image(ic) for ic in initial_conditions_of(span, 12)])


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *at_once(
            [("dry friction", tolerance) for tolerance in (1e-4, 1e-9)],
            later=[("dry friction", 1e-13), *((name, 1e-6 if "masses" in name else 1e-9) for name in CASES)],
        ),
        *[pytest.param(name, 1e-12, marks=pytest.mark.slow) for name in EVERY_CASE],
    ],
)
def test_images_agree_with_the_oracle(name: str, tolerance: float, allowance: Callable[..., Array]) -> None:
    make, span = EVERY_CASE[name]
    system, initial_conditions = make(), initial_conditions_of(span, 12)
    images = stroboscopic_map(system, rtol=tolerance, atol=tolerance).iterate(initial_conditions, 1)
    assert (images.status == Status.OK).all()
    exact = exact_images(name)
    floor = 1e-11 * np.abs(exact).max()
    assert (np.abs(images.unwrapped - exact) <= floor + allowance(system, exact, tolerance, tolerance)).all()


@pytest.mark.parametrize("name", [n if n in AT_ONCE else pytest.param(n, marks=pytest.mark.slow) for n in EVERY_CASE])
def test_derivatives_agree_with_the_oracle(name: str) -> None:
    """Saltation at crossings, loss of rank where sliding begins, none where it ends."""
    make, span = EVERY_CASE[name]
    system, initial_conditions = make(), initial_conditions_of(span, 2 if name in AT_ONCE else 6)
    scale = np.array(span)
    matrices = jacobian(stroboscopic_map(system), initial_conditions) * (scale[None, :] / scale[:, None])
    for ic, matrix in zip(initial_conditions, matrices, strict=True):
        expected = differences(Oracle(system), ic, scale)
        assert matrix == pytest.approx(expected, abs=1e-9 + 1e-6 * np.abs(expected).max())


def test_the_determinant_is_that_of_damping_and_jumps() -> None:
    """det DP = exp(-gamma T) times, for each crossing, deceleration after over deceleration before."""
    system = dimensionless_pendulum(0.5, 0.3, 0.03, 0.1)
    oracle, strobe, seen = Oracle(system), stroboscopic_map(system), 0
    for ic in initial_conditions_of((pi, 2.0), 12):
        log: list[tuple[float, Array, Mode, Mode]] = []
        oracle.image(ic, log)
        if all(0 not in after for _, _, _, after in log):
            expected = exp(-0.03 * system.length)
            for t, x, before, after in log:
                expected *= oracle.field(t, x, after)[1] / oracle.field(t, x, before)[1]
            assert np.linalg.det(jacobian(strobe, ic)) == pytest.approx(expected, rel=1e-9)
            seen += len(log)
    assert seen > 5


def test_one_bad_lane_does_not_disturb_the_others() -> None:
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 0.4))
    initial_conditions = initial_conditions_of((pi, 3.0), 2 * LANES)
    bad = initial_conditions.copy()
    bad[5], bad[40] = (1.0, 1e300), (1e15, -1e200)
    images, again = strobe.iterate(initial_conditions, 1), strobe.iterate(bad, 1)
    good = np.arange(len(initial_conditions)) % 35 != 5
    assert np.array_equal(images.points[good], again.points[good])
    assert (again.status[~good] != Status.OK).all()


def test_no_switches_no_events() -> None:
    """Without friction there is nothing of all this, whether it was asked for or is absent."""
    free, rough = dimensionless_pendulum(delta=0.0), dimensionless_pendulum(delta=0.1)
    assert free.switches is None and free.rhs is dimensionless_pendulum().rhs and rough.rhs is not free.rhs
    smooth = stroboscopic_map(free)
    limit = stroboscopic_map(rough.with_params(delta=0.0))
    initial_conditions = initial_conditions_of((pi, 2.0), 20)
    assert limit(initial_conditions) == pytest.approx(smooth(initial_conditions), abs=1e-9)


def test_events_without_end_are_reported() -> None:
    """x'' = -sign x - 0.4 sign x' comes to rest at the origin in a finite time, after infinitely many crossings."""

    def twisting(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
        return x[1], -s[0] - 0.4 * s[1]

    system = ForcedSystem(twisting, {}, 6.0, ("x", "v"), switches=lambda t, x, p: (x[0], x[1]))
    with pytest.warns(ToleranceWarning, match="2 of 3 orbits of twisting are out of steps"):
        images = stroboscopic_map(system, rtol=1e-4).iterate([[30.0, 0.0], [0.1, 0.0], [0.0, 0.0]], 1)
    assert images.status[0] == Status.OK
    assert (images.status[1:] != Status.OK).all()


def test_a_switching_function_without_a_value_is_reported() -> None:
    def edge(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[1] + 0.0 * sqrt(x[0]),)

    system = ForcedSystem(rubbed, dict(table(stiffness=0.0, force=1.0).params), 2.0 * pi, ("x", "v"), switches=edge)
    with pytest.warns(ToleranceWarning, match="1 of 2 orbits of rubbed are out of steps"):
        images = stroboscopic_map(system, rtol=1e-4).iterate([[20.0, 1.0], [0.01, -1.0]], 1)
    # Steps get shorter and shorter before the edge, beyond which the surface has no value: the period does not end.
    assert images.status.tolist() == [Status.OK, Status.OUT_OF_STEPS]
    assert np.isnan(images.points[1]).all() and np.isfinite(images.points[0]).all()
