"""The natural frequency from half swings of any width, under any damping."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from systems.lab import natural_frequency, swing_envelope
from systems.lab.free_swings.natural_frequency import _AMPLITUDES, _LONGER, _UNSURE
from systems.lab.free_swings.swing_extremes import GAUSS, slowing

FREQUENCY = 12.0
TIMES = np.linspace(0.0, 6.0, 3000)


def half_swing(kind: str, amplitude: float, loss: float) -> float:
    """By how much a half swing of a pendulum with w = 1 is longer than the mean over its amplitudes, over loss^2."""
    strength = {"viscous": 0.6 * loss, "dry": 0.5 * loss * amplitude, "quadratic": 0.75 * loss / amplitude}[kind]

    def ends(t: float, x: Any) -> float:
        return float(x[1])

    ends.terminal, ends.direction = True, 1.0  # type: ignore[attr-defined]
    for _ in range(40):
        resist = {
            "viscous": lambda v, c=strength: c * v,
            "dry": lambda v, c=strength: -c,
            "quadratic": lambda v, c=strength: -c * v * v,
        }[kind]
        found = solve_ivp(
            lambda t, x, resist=resist: [x[1], -np.sin(x[0]) - resist(x[1])],
            (0.0, 60.0),
            [amplitude, -1e-12],
            "DOP853",
            events=ends,
            rtol=1e-12,
            atol=1e-14,
        )
        last, took = abs(float(found.y_events[0][-1][0])), float(found.t_events[0][-1])
        fraction = 1.0 - last / amplitude
        if abs(fraction / loss - 1.0) < 1e-6:
            break
        strength *= loss / fraction
    nodes, weights = GAUSS
    mean = 2.0 * np.pi / float((1.0 / slowing(last + 0.5 * (amplitude - last) * (nodes + 1.0))) @ weights)
    return (took / mean - 1.0) / fraction**2


@pytest.mark.parametrize("kind", ["viscous", "dry", "quadratic"])
@pytest.mark.parametrize(("amplitude", "loss"), [(0.02, 0.05), (0.8, 0.05), (1.7, 0.05), (2.4, 0.04), (2.8, 0.03)])
def test_a_half_swing_that_loses_amplitude_is_longer(kind: str, amplitude: float, loss: float) -> None:
    """Within what is allowed for, by integrating it; viscous damping of small swings by 1/(2 pi^2), exactly."""
    longer = half_swing(kind, amplitude, loss)
    middle, unsure = (float(np.interp(amplitude, _AMPLITUDES, table)) for table in (_LONGER, _UNSURE))
    assert abs(longer - middle) < 1.25 * unsure + 0.01
    if kind == "viscous" and amplitude < 0.1:
        assert longer == pytest.approx(0.5 / np.pi**2, rel=0.06)


@pytest.mark.thorough
@pytest.mark.parametrize("amplitude", [0.05, 0.8, 2.0, 2.8])
@pytest.mark.parametrize(
    "damping", [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, 0.0, 0.3), (0.3, 1.0, 0.0)], ids=str
)
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_strong_damping_is_within_the_error(amplitude, damping, noise):
    """Up to a quarter of the amplitude in a half swing; viscous damping, friction and drag, and two of them at once."""
    viscous, dry, quadratic = damping
    small = min(amplitude, 1.0)

    def pendulum(t: float, x: Any) -> Any:
        v = x[1]
        resist = viscous * v + quadratic * v * abs(v) + dry * small * np.tanh(v / 1e-4)
        return [v, -(FREQUENCY**2) * np.sin(x[0]) - resist]

    swing = solve_ivp(pendulum, (0.0, 6.0), [amplitude, 0.0], "LSODA", TIMES, rtol=1e-9, atol=1e-11).y[0]
    rng = np.random.default_rng(0)
    swing += rng.normal(0.0, noise * small, TIMES.size)
    found = natural_frequency(swing_envelope(TIMES, swing))
    assert found.standard_error < 4e-3 * FREQUENCY
    assert found.value == pytest.approx(FREQUENCY, abs=2.5 * found.standard_error)
