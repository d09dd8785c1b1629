"""Three switching functions: each block on a rough table is held by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, stroboscopic_map


def test_three_blocks_stop_one_after_the_other() -> None:
    """Three switches, x_i'' = -i friction sign(x_i'): each block is held from v_i/(i friction) on."""

    def rhs(t: float, x: Any, p: Any, s: Any) -> tuple[float, ...]:
        return (*x[3:], *(-(i + 1) * p.friction * s[i] for i in range(3)))

    system = ForcedSystem(
        rhs, {"friction": 1.0}, 1.0, ("a", "b", "c", "u", "v", "w"), switches=lambda t, x, p: (x[3], x[4], x[5])
    )
    deceleration = np.array([1.0, 2.0, 3.0])
    speeds = np.array([[0.5, 1.9, -0.6], [-1.5, 0.2, 0.9], [0.4, -2.5, 5.0]])
    time = np.minimum(np.abs(speeds) / deceleration, 1.0)
    lost = np.sign(speeds) * deceleration * time
    exact = np.concatenate([(speeds - 0.5 * lost) * time, speeds - lost], axis=1)
    images = stroboscopic_map(system)(np.concatenate([np.zeros((3, 3)), speeds], axis=1))
    assert images == pytest.approx(exact, abs=1e-13)
