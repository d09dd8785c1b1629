"""Analyses of the page on bifurcations: a vibration absorber by harmonic balance, a pendulum with torque by SciPy."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pytest import approx
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar, root

from cellmap import ForcedSystem, angle, continue_orbit, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import BifurcationKind, OrbitFunction, continue_bifurcation, switch_branch

MASS, DAMPING, FORCE = 0.05, 0.0127, 0.05
ORDERS = np.array([1, 3, 5, 7, 9])
ANGLES = 2.0 * pi * np.arange(64) / 64


def absorber(t: Any, s: Any, p: Any) -> Any:
    x, v, y, u = s
    force = p.damping * (u - v) + p.stiffness * (y - x)
    return v, p.force * cos(p.frequency * t) - 0.02 * v - x - x**3 + force, u, -force / MASS


def balanced(w: float, stiffness: float, guess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the complex amplitudes (2, orders) of x and y that balance all harmonics up to the ninth."""
    waves = np.exp(1j * np.outer(ORDERS, ANGLES))

    def defects(flat: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = flat.reshape(2, 2, -1)[0] + 1j * flat.reshape(2, 2, -1)[1]
        d = 1j * w * ORDERS
        force = DAMPING * d * (y - x) + stiffness * (y - x)
        cubes = np.conj(waves) @ (x @ waves).real ** 3 * 2.0 / len(ANGLES)
        one = d**2 * x + 0.02 * d * x + x + cubes - force - FORCE * (ORDERS == 1)
        both = np.array([one, MASS * d**2 * y + force])
        return np.array([both.real, both.imag]).ravel()

    found = root(defects, np.array([guess.real, guess.imag]).ravel(), tol=1e-13)
    parts = found.x.reshape(2, 2, -1)
    return np.asarray(parts[0] + 1j * parts[1])


def height(w: float, stiffness: float, guess: NDArray[np.float64]) -> float:
    x = balanced(w, stiffness, guess)[0]

    def displacement(phase: float) -> float:
        return -float((x @ np.exp(1j * ORDERS * phase)).real)

    place = -np.angle(x[0])
    return -float(minimize_scalar(displacement, bounds=(place - 0.3, place + 0.3), options={"xatol": 1e-10}).fun)


def test_an_absorber_has_the_peaks_of_harmonic_balance() -> None:
    params = {"frequency": 0.6, "force": FORCE, "stiffness": MASS / 1.05**2, "damping": DAMPING}
    system = ForcedSystem(absorber, params, lambda p: 2 * pi / p.frequency, ("x", "v", "y", "u"))
    structure = stroboscopic_map(system)
    resonance = continue_orbit(
        structure, periodic_orbit(structure, [0.1, 0.0, 0.1, 0.0]), "frequency", 0.6, 1.6, step=0.03
    )
    resonance = resonance.with_zeros({"peak": OrbitFunction("x", "amplitude", extremum=True)})
    amplitude, guess = resonance.measure("x", "amplitude"), np.full((2, len(ORDERS)), 1e-6 + 0j)
    guess[:, 0] = 0.1
    for k in range(0, len(amplitude), 30):
        guess = balanced(resonance.values[k], params["stiffness"], guess)
        assert height(resonance.values[k], params["stiffness"], guess) == approx(amplitude[k], rel=1e-7)
    box = (0.6, 1.6), (0.044, 0.049)
    peaks = continue_bifurcation(resonance, resonance.zeros[-1], "stiffness", *box, step=0.1)
    assert len(resonance.zeros) == 3
    found = [(resonance.zeros[0].value, params["stiffness"]), *peaks.values[[0, -1]].tolist()]
    for w, stiffness in found:
        guess = balanced(w, stiffness, np.asarray(guess))
        before, here, after = (height(w + h, stiffness, guess) for h in (-1e-3, 0.0, 1e-3))
        # The vertex of a parabola is as far away as its third derivative makes it.
        assert (before - after) / (2.0 * (before - 2.0 * here + after)) == approx(0.0, abs=0.02)


def test_a_pendulum_with_torque_has_a_cusp_at_its_pitchfork() -> None:
    system = ForcedSystem(
        lambda t, x, p: (x[1], p.torque + p.amplitude * cos(2 * t / 3) - x[1] / 2 - sin(x[0])),
        {"amplitude": 0.9, "torque": 0.0},
        3 * pi,
        (angle("theta"), "omega"),
    )
    driven = stroboscopic_map(system)
    symmetric = continue_orbit(driven, periodic_orbit(driven, [1.0, 1.0]), "amplitude", 0.8, 1.1, step=0.05)
    (pitchfork,) = symmetric.bifurcations
    broken = switch_branch(symmetric, pitchfork, 0.8, 1.1, step=0.05)
    start = broken.orbit(3)
    loop = continue_orbit(driven.with_params(**start.params), start, "torque", -1.0, 1.0, step=0.05)
    assert loop.ends == ("closed", "closed") and len(loop.of_kind(BifurcationKind.FOLD)) == 4
    values = sorted(b.value for b in loop.bifurcations)
    np.testing.assert_allclose(values, [-v for v in reversed(values)], atol=1e-9)
    folds = sorted(loop.of_kind(BifurcationKind.FOLD), key=lambda b: b.value)
    inner, outer = folds[2:]
    unfolded = continue_bifurcation(loop, inner, "amplitude", (-0.1, 0.1), (0.9, 1.1), step=0.05)
    (cusp,) = unfolded.codimension_two()
    assert cusp.values == approx([0.0, pitchfork.value], abs=1e-8)
    edge = continue_bifurcation(loop, outer, "amplitude", (0.5, 1.0), (0.0, 1.1), step=0.05)
    # Without a force the equilibrium sin(theta) = T vanishes at T = 1.
    last = edge.values[np.argmin(edge.values[:, 1])]
    assert last == approx([1.0, 0.0], abs=1e-8)
    doubling = loop.of_kind(BifurcationKind.PERIOD_DOUBLING)[0]

    def flow(t: float, y: Any) -> Any:
        force = doubling.value + start.params["amplitude"] * cos(2.0 * t / 3.0)
        slopes = np.array([[0.0, 1.0], [-cos(y[0]), -0.5]])
        return np.concatenate([[y[1], force - y[1] / 2.0 - sin(y[0])], (slopes @ y[2:].reshape(2, 2)).ravel()])

    end = solve_ivp(flow, (0.0, 3 * pi), [*doubling.point, 1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(np.exp(1j * end[0]), np.exp(1j * doubling.point[0]), atol=1e-9)
    assert np.linalg.eigvals(end[2:].reshape(2, 2)).min() == approx(-1.0, abs=1e-8)
