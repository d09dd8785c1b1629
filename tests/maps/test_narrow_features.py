"""Right-hand sides with features much narrower than a step: seen, or reported, never passed over as met."""

from __future__ import annotations

import functools
from math import cos, exp, pi, tanh

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, Status, stroboscopic_map
from cellmap._compiled.codegen.rebind import ARRAY_FUNCTIONS, rebind
from cellmap.maps.point_map import follow

PERIOD = 2 * pi


def front(width):
    return lambda t, x, p: (x[1], -x[0] - 0.3 * tanh(x[1] / width) - 0.05 * x[1] + cos(t))


def pulse(t, x, p):
    return x[1], -x[0] - 0.1 * x[1] + 2.0 * exp(1e5 * (cos(t - 2.0) - 1.0)) + 200.0 * cos(t)


def bell(t, x, p):
    return x[1], -40.0 * x[0] * exp(-((x[0] / 0.1) ** 2)) - 0.1 * x[1] + 0.3 * cos(t)


INITIAL_CONDITIONS = np.random.default_rng(0).uniform(-2, 2, (12, 2))


@functools.cache
def by_short_steps(rhs):
    """Images by SciPy, all orbits as one system, with steps of a five-hundredth of the period."""
    of_arrays, shape = rebind(rhs, ARRAY_FUNCTIONS), INITIAL_CONDITIONS.T.shape

    def fun(t, y):
        return np.concatenate(of_arrays(t, y.reshape(shape), None))

    options = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-14, "max_step": PERIOD / 500}
    return solve_ivp(fun, (0, PERIOD), INITIAL_CONDITIONS.T.ravel(), **options).y[:, -1].reshape(shape).T


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("rhs", [front(0.1), front(0.03), pulse, bell], ids=["tanh 0.1", "tanh 0.03", "pulse", "bell"])
def test_what_is_called_met_is_met(rhs, tolerance):
    """Against SciPy with steps too short to pass over anything.

    Nothing is passed over; where a step is as long as the feature, the estimate may be short by a factor of some units.
    """
    system = ForcedSystem(rhs, {}, PERIOD, ("x", "v"))
    images = follow(stroboscopic_map(system, rtol=tolerance, atol=tolerance), INITIAL_CONDITIONS, 1)
    met = images.status == Status.OK
    assert met.sum() >= 10
    exact = by_short_steps(rhs)[met]
    assert (np.abs(images.points[met] - exact) <= 4.0 * tolerance * (1.0 + np.abs(exact))).all()


def test_series_are_not_used_where_they_may_hide_something():
    """The default method expands products and sines; tanh may be saturated where the step begins."""

    def plain(t, x, p):
        return x[1], -(x[0] ** 3) - 0.1 * x[1] + cos(t)

    methods = [
        stroboscopic_map(ForcedSystem(f, {}, PERIOD, ("x", "v"))).recipe["method"] for f in (plain, front(0.1), bell)
    ]
    assert methods == ["Taylor", "DOP853", "DOP853"]


def test_kinks_are_given_up_early_and_reported():
    """Across a kink that a method does not locate the error falls as h^2: the ladder of steps is left before its end.

    The method that locates it meets the tolerance.
    """

    def bilinear(t, x, p):
        return x[1], -x[0] - 10.0 * max(x[0] - 0.3, 0.0) - 0.2 * x[1] + cos(1.2 * t)

    system = ForcedSystem(bilinear, {}, PERIOD / 1.2, ("x", "v"))
    initial_conditions = np.random.default_rng(1).uniform(-2, 2, (20, 2))
    images = follow(stroboscopic_map(system, method="DOP853"), initial_conditions, 1)
    assert (images.status == Status.INACCURATE).any()
    loose = follow(stroboscopic_map(system, rtol=1e-5, atol=1e-5, method="DOP853"), initial_conditions, 1)
    assert (loose.status == Status.OK).all()
    assert np.abs(images.points - loose.points).max() < 1e-4
    located = follow(stroboscopic_map(system), initial_conditions, 1)
    assert (located.status == Status.OK).all()
    assert np.abs(located.points - loose.points).max() < 1e-4


def test_stiff_and_bounded_is_not_diverged():
    """x' = -1e4 (x - cos t): the image is cos 0 = 1 to 1e-8 from everywhere."""
    system = ForcedSystem(lambda t, x, p: (-1e4 * (x[0] - cos(t)),), {}, PERIOD, ("x",))
    images = follow(stroboscopic_map(system, rtol=1e-6, atol=1e-6), [[0.5], [-2.0]], 1)
    assert (images.status != Status.DIVERGED).all()
    assert images.points[:, 0] == pytest.approx(1.0, abs=1e-7)
