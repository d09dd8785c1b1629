"""Floquet multipliers: arguments that are refused."""

from __future__ import annotations

from math import cos, pi
from typing import Any

import numpy as np
import pytest
from mathieu import HANGING, mathieu

from cellmap import ForcedSystem, stability_map
from cellmap.bifurcations import critical_values, floquet_multipliers
from systems import driven_pendulum


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (([0.1, 0.0],), ValueError, "v is not constant there"),
        (([0.0],), ValueError, "its last axis must hold the 2 state variables"),
        (([HANGING],), ValueError, "give one state"),
        (
            (HANGING, {"omega": 1.0}),
            ValueError,
            r"params has 'omega': this system has \['alpha', 'beta', 'gamma'\]",
        ),
        ((HANGING, {"beta": [0.1, np.nan]}), ValueError, "give finite numbers"),
        ((HANGING, {"beta": "much"}), TypeError, "give real numbers"),
        ((HANGING, {"beta": [1, 2], "alpha": [1, 2, 3]}), ValueError, r"parameters have the shapes beta \(2,\), alpha"),
        ((HANGING, [0.1]), TypeError, "give a mapping of names to arrays"),
        ((HANGING, {}, 1e-20), ValueError, "rtol=1e-20"),
    ],
)
def test_bad_input_is_refused(arguments: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        floquet_multipliers(mathieu(), *arguments)


def test_bad_systems_are_refused() -> None:
    with pytest.raises(TypeError, match="give a ForcedSystem"):
        floquet_multipliers("pendulum", HANGING)  # type: ignore[arg-type]
    with pytest.raises(
        TypeError, match=r"its right-hand side is discontinuous.*give a system without switching functions"
    ):
        floquet_multipliers(driven_pendulum(friction=1.0), HANGING)
    branching = ForcedSystem(lambda t, x, p: (-x[0] if x[0] > 0 else -2 * x[0],), {}, 1.0, ("x",))
    with pytest.raises(TypeError, match="derivatives of its right-hand side are not known"):
        floquet_multipliers(branching, [0.0])
    fixed = ForcedSystem(lambda t, x, p: (cos(p.rate * t) * x[0],), {"rate": 1.0}, 2 * pi, ("x",))
    with pytest.raises(ValueError, match="one period later"):
        floquet_multipliers(fixed, [0.0], {"rate": [1.0, 1.5]})


@pytest.mark.parametrize(
    ("x", "y", "error", "message"),
    [
        ("beta", ("alpha", [1, 2, 3]), TypeError, "give a pair of a parameter's name and its values"),
        ((1, [1, 2, 3]), ("alpha", [1, 2, 3]), TypeError, "give the name of a parameter"),
        (("beta", [1, 2]), ("alpha", [1, 2, 3]), ValueError, "give at least 3 values in increasing order"),
        (("beta", [1, 3, 2]), ("alpha", [1, 2, 3]), ValueError, "give at least 3 values in increasing order"),
        (("beta", [1, 2, 3]), ("beta", [1, 2, 3]), ValueError, "give two parameters"),
    ],
)
def test_bad_axes_are_refused(x: Any, y: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        stability_map(mathieu(), HANGING, x, y)


def test_bad_intervals_are_refused() -> None:
    with pytest.raises(ValueError, match=r"upper=0\.1: give a number above lower=0\.2"):
        critical_values(mathieu(), HANGING, "beta", 0.2, 0.1)
    with pytest.raises(ValueError, match="n_points=2"):
        critical_values(mathieu(), HANGING, "beta", 0.1, 0.2, n_points=2)
