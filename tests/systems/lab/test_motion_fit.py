"""Parameters from measured motions, with truth known: values, errors, gaps, wrong models."""

from math import cos, pi
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, trajectory
from systems import Chain, Gravity, VerticalDrive, ViscousDamping, lab, scene
from systems.lab.free_swings.simulation import Simulation, clear_of_noise

TRUE = {"length": 0.069, "damping": 0.4}


def rod(**params: float) -> ForcedSystem:
    return lab.free_pendulum(0.069, {"damping": 0.4}).with_params(**params)


@pytest.fixture(scope="module")
def film() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eight periods of a wide swing at some 200 frames a second, without noise."""
    motion = trajectory(rod(), [1.3, 0.0], periods=8, samples_per_period=105, rtol=1e-11, atol=1e-11)
    return motion.times, motion.states[:, 0]


def noisy(angles: NDArray[np.float64], seed: int, noise: float = 0.004) -> NDArray[np.float64]:
    return angles + np.random.default_rng(seed).normal(0.0, noise, angles.size)


def fisher_errors(times: NDArray[np.float64], noise: float = 0.004) -> dict[str, float]:
    """Least standard errors that white noise allows (Cramer and Rao), from differences of SciPy's solutions."""
    true = {**TRUE, "start theta": 1.3, "start theta'": 0.0}

    def angles(values: dict[str, float]) -> NDArray[np.float64]:
        system = rod(length=values["length"], damping=values["damping"])
        ic = [values["start theta"], values["start theta'"]]
        span = (0.0, float(times[-1]))
        return solve_ivp(system.fun, span, ic, "DOP853", times, rtol=1e-12, atol=1e-12).y[0]

    slopes = [(angles({**true, n: v + 1e-5}) - angles({**true, n: v - 1e-5})) / 2e-5 for n, v in true.items()]
    matrix = np.array(slopes)
    return dict(zip(true, noise * np.sqrt(np.diag(np.linalg.inv(matrix @ matrix.T))), strict=True))


def test_exact_series_give_exact_parameters(film: tuple[NDArray[np.float64], NDArray[np.float64]]) -> None:
    times, angles = film
    found = lab.fit_motion(rod(length=0.075, damping=0.1), times, angles, ["length", "damping"])
    assert found.converged
    assert found.at_bound == ()
    assert found.estimates["length"] == pytest.approx(0.069, rel=1e-7)
    assert found.estimates["damping"] == pytest.approx(0.4, rel=1e-6)
    assert found.estimates["start theta"] == pytest.approx(1.3, abs=1e-6)
    assert found.system.params["length"] == found.estimates["length"]
    assert found.rmse < 1e-6


@pytest.mark.thorough
def test_gaps_and_uneven_times(film: tuple[NDArray[np.float64], NDArray[np.float64]]) -> None:
    times, angles = film
    gapped = noisy(angles, 1)
    gapped[100:300] = np.nan
    kept = np.sort(np.random.default_rng(0).choice(times.size, 500, replace=False))
    found = lab.fit_motion(rod(length=0.07, damping=0.3), times[kept], gapped[kept], ["length", "damping"])
    for name, value in TRUE.items():
        assert found.estimates[name] == pytest.approx(value, abs=4.0 * found.standard_errors[name])
    assert np.isnan(found.residuals).sum() == np.isnan(gapped[kept]).sum()
    assert "damping" in repr(found)
    expected = fisher_errors(times[kept][np.isfinite(gapped[kept])])
    for name, error in expected.items():  # the noise is known to 4 % from 380 samples
        assert found.standard_errors[name] == pytest.approx(error, rel=0.12)
        low, high = found.interval(name)
        assert (high - low) / 2 == pytest.approx(1.966 * found.standard_errors[name], rel=2e-3)
        assert (high + low) / 2 == pytest.approx(found.estimates[name])


def test_a_swing_that_grows_ends_on_the_bound_of_its_damping() -> None:
    """No damping of at least zero lets a swing grow: the nearest is zero, and the interval begins there."""
    growing = rod(damping=-0.05)
    motion = trajectory(growing, [0.3, 0.0], periods=8, samples_per_period=50)
    found = lab.fit_motion(rod(damping=0.05), motion.times, noisy(motion.states[:, 0], 4), ["length", "damping"])
    assert found.at_bound == ("damping",)
    assert found.estimates["damping"] == pytest.approx(0.0, abs=1e-9)
    assert found.interval("damping")[0] == 0.0
    assert "damping on its bound" in repr(found)


@pytest.mark.thorough
def test_a_poor_guess_slips_no_rotation_in_a_long_film() -> None:
    """Some 57 swings of a rod whose length is guessed 30 % too long; exact within the scatter of the noise."""
    true = rod(damping=0.08)
    motion = trajectory(true, [0.9, 0.0], periods=57, samples_per_period=50)
    guess = rod(length=1.3 * 0.069, damping=0.1)
    found = lab.fit_motion(guess, motion.times, noisy(motion.states[:, 0], 5, 0.003), ["length", "damping"])
    assert found.converged
    for name, value in {"length": 0.069, "damping": 0.08}.items():
        assert found.estimates[name] == pytest.approx(value, abs=4.0 * found.standard_errors[name])


@pytest.mark.parametrize("begin", [-0.37, pytest.param(1.2345, marks=pytest.mark.thorough)])
def test_the_frequency_of_a_drive(begin: float) -> None:
    """A driven oscillator by SciPy, filmed from some moment; the period of the system is that of the drive."""

    def rhs(t: float, x: Any, p: Any) -> tuple[Any, Any]:
        q, v = x
        return v, -q - p.damping * v + cos(p.omega * t)

    def driven(t: float, x: NDArray[np.float64]) -> list[float]:
        return [x[1], -x[0] - 0.2 * x[1] + cos(1.4 * t)]

    times = begin + np.arange(0.0, 40.0, 0.1)
    exact = solve_ivp(driven, (begin, times[-1]), [0.5, 0.0], t_eval=times, rtol=1e-10, atol=1e-11).y[0]
    guess = ForcedSystem(rhs, {"damping": 0.25, "omega": 1.37}, lambda p: 2.0 * pi / p.omega, ("q", "v"))
    found = lab.fit_motion(guess, times, exact, ["damping", "omega"])
    assert found.estimates["omega"] == pytest.approx(1.4, abs=1e-6)
    assert found.estimates["damping"] == pytest.approx(0.2, abs=1e-6)
    assert found.rmse < 1e-6


def test_noise_between_dense_samples_is_no_swing() -> None:
    """A thousand samples a swing: the first ones show none, so that no fit begins with them alone."""
    times = np.linspace(0.0, 4.0, 4001)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, times.size)
    angles = (0.1 * np.exp(-0.02 * times) * np.cos(2.0 * pi * times) + noise)[:, None]
    job = Simulation(rod(), ("length",), times, angles, True, 1e-8, clear_of_noise(times, angles))
    assert job.swings == pytest.approx(4.0, abs=0.51)
    assert max(job.until(0.5**k).swings for k in (7, 6, 5, 4)) < 1.0
    assert job.until(0.5).swings == pytest.approx(2.0, abs=0.51)


def test_dry_friction_of_a_short_swing() -> None:
    """A rod that comes to rest within the film."""
    true = {"length": 0.069, "friction": 2.5}
    motion = trajectory(lab.free_pendulum(0.069, {"friction": 2.5}), [0.6, 0.0], periods=4, samples_per_period=50)
    found = lab.fit_damping(motion.times, noisy(motion.states[:, 0], 5, 0.0067), ["dry"], zero=False).best
    for name, value in true.items():
        assert found.estimates[name] == pytest.approx(value, abs=4.0 * found.standard_errors[name])
    assert found.rmse == pytest.approx(0.0067, rel=0.15)


@pytest.mark.thorough
def test_parameters_that_the_motion_does_not_tell_are_named(film):
    """A pendulum tells gravity over length alone."""
    times, angles = film
    with pytest.warns(UserWarning, match=r"length=0\.\d+ \+- .*, gravity=.*does not tell it from zero; fit fewer"):
        both = lab.fit_motion(rod(length=0.07), times, noisy(angles, 0), ["length", "gravity", "damping"])
    assert both.undetermined == ("length", "gravity")
    assert "length undetermined" in repr(both)
    assert lab.fit_motion(rod(length=0.07), times, noisy(angles, 0), ["length", "damping"]).undetermined == ()


def test_damping_that_a_double_pendulum_does_not_tell_is_warned_of() -> None:
    """A second in which the upper joint loses 1 % of its energy, under noise of 0.03 rad."""

    def links(damping: float) -> ForcedSystem:
        effects = Gravity(9.8), ViscousDamping((damping, damping))
        return scene(Chain((0.5, 0.5), (1.0, 1.0)), *effects, period=1.0)

    motion = trajectory(links(0.02), [0.6, 0.5, 0.0, 0.0], periods=1, samples_per_period=60)
    noise = np.random.default_rng(1).normal(0.0, 0.03, (len(motion.times), 2))
    with pytest.warns(UserWarning, match=r"damping_1=0\.\d+ \+- ") as told:
        found = lab.fit_motion(links(0.05), motion.times, motion.states[:, :2] + noise, ["damping_1"])
    assert told[0].filename == __file__
    assert found.converged
    assert found.undetermined == ("damping_1",)
    assert found.standard_errors["damping_1"] > found.estimates["damping_1"]


def test_guesses_take_the_place_of_extremes(film: tuple[NDArray[np.float64], NDArray[np.float64]]) -> None:
    """Three extremes are enough for the motion, and too few for its decay profile; six are asked for everywhere."""
    times, angles = film
    t, x = times[:230], noisy(angles, 3)[:230]
    with pytest.raises(ValueError, match=r"angles have 3 extremes.*at least 6, .*give guess= of length, damping"):
        lab.fit_damping(t, x, ["viscous"])
    with pytest.raises(ValueError, match=r"at least 6, .*give guess= of damping$"):
        lab.fit_damping(t, x, ["viscous"], guess={"length": 0.08})
    fits = lab.fit_damping(t, x, ["viscous"], guess={"length": 0.08, "damping": 2.0})
    assert fits.profile is None
    for name, value in TRUE.items():
        assert fits.best.estimates[name] == pytest.approx(value, abs=4.0 * fits.best.standard_errors[name])


def test_all_fits_of_the_laboratory_name_what_is_undetermined() -> None:
    """By one rule; the best kind of damping, and a radius, are warned of."""
    t = np.linspace(0.0, 8.0, 1601)
    swings = lab.swing_envelope(t, 0.3 * np.exp(-0.2 * t) * np.cos(12.0 * t) + noisy(0.0 * t, 0, 1e-3))
    assert lab.compare_decays(swings)["viscous and dry"].undetermined == ("friction",)
    with pytest.warns(UserWarning, match=r"friction=.* \+- .*compare fewer kinds="):
        assert "friction undetermined" in repr(lab.compare_decays(swings, kinds=["viscous and dry"]).best)
    line = lab.quadratic_decay(lab.swing_envelope(t, (0.9 - 0.1 * t) * np.cos(12.0 * t) + noisy(0.0 * t, 0)))
    assert line.undetermined == ("a",)
    t = np.linspace(0.0, 1.0, 2000, endpoint=False)
    found = lab.recover_drive(t, lab.record_acceleration(VerticalDrive(0.003, 50.0), t, noise=3.0, rng=1), harmonics=4)
    faint = np.flatnonzero(found.amplitudes < found.amplitude_errors) + 1
    assert found.undetermined == tuple(faint) != ()
    turn = np.linspace(0.0, 0.3, 20)
    arc = np.stack([np.cos(turn), np.sin(turn)], axis=-1) + np.random.default_rng(0).normal(0.0, 0.01, (20, 2))
    with pytest.warns(UserWarning, match=r"radius=.*wider swing"):
        lab.fit_circle(arc, least_arc=0.01)
