"""Inverses of maps by integration backwards in time."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap import stroboscopic_map
from cellmap.maps import inverse_stroboscopic_map
from systems import driven_pendulum, stick_slip_oscillator


def test_inverse_of_the_stroboscopic_map() -> None:
    system = driven_pendulum(amplitude=0.004)
    for phase in (0.0, 0.3):
        forward = stroboscopic_map(system, phase=phase, rtol=1e-12, atol=1e-12)
        initial_conditions = np.random.default_rng(0).uniform((-3.0, -400.0), (3.0, 400.0), (500, 2))
        there = forward.iterate(initial_conditions, 1)
        back = inverse_stroboscopic_map(system, phase).iterate(there.points, 1)
        assert back.points == pytest.approx(initial_conditions, rel=1e-9, abs=1e-9)
        assert np.array_equal(back.rotations[:, 0] + there.rotations[:, 0], np.zeros(500))
    with pytest.raises(ValueError, match="switches"):
        inverse_stroboscopic_map(stick_slip_oscillator())
    with pytest.raises(TypeError, match="ForcedSystem"):
        inverse_stroboscopic_map(forward)  # type: ignore[arg-type]
