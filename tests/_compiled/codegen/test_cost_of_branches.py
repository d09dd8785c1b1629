"""What is compiled for right-hand sides with many comparisons: it grows with their number, and loses nothing."""

import itertools
from collections.abc import Callable
from math import cos, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cellmap import PointMap, Status
from cellmap._compiled.codegen import filippov, switching
from cellmap._compiled.codegen.evaluation import evaluated
from cellmap._compiled.codegen.expression import in_order
from cellmap._compiled.codegen.filippov import SwitchingTrace, switching_trace
from cellmap._compiled.codegen.kernel import traced_switching
from cellmap._compiled.kernels.blocks import LANES
from cellmap.maps import ToleranceWarning
from cellmap.maps.point_map import warn_of_tolerance

NAMES = ("F",)


def seven(t, x, p):
    v0 = x[0] if -0.3 < x[1] < 0.9 else 0.1
    v1 = (x[0] > 0.2) * x[1] + (x[1] + 0.3 * v0 < 0) * 0.3
    if x[0] + 0.1 * v1 > 0.5:
        v2 = x[1]
    elif x[0] > -0.5:
        v2 = sin(t)
    else:
        v2 = 0.3
    return x[1], -x[0] - 0.2 * x[1] + p.F * cos(t) + 0.4 * v1 - 0.3 * v2


def tangled(t, x, p):
    """Seven comparisons, which depend on one another: 21 switches."""
    v0 = x[1] if -0.5 < x[0] + 0.2 * x[1] < 0.7 else sin(t)
    v1 = (x[0] + 0.1 * v0 > 0.2) * x[1] + (x[1] + 0.3 * v0 < 0) * v0
    v2 = x[0] * v1 if x[0] + 0.2 * v1 > 0.3 or x[1] > 0.6 else 0.3 * v0
    v3 = x[1] * x[0] if x[1] + 0.1 * v2 > 0.5 else v1
    return x[1] + 0.1 * v3, -x[0] - 0.2 * x[1] + p.F * cos(t) + 0.4 * v2 - 0.3 * v3


def chopped(t, x, p):
    """Relays and whole parts at once, with jumps that depend on one another."""
    push = np.sign(x[1] + 0.2 * x[0]) * (1.5 if x[0] > 0.1 else 0.7)
    return x[1], -x[0] - push - 0.2 * np.floor(3.0 * x[0] - x[1]) - (x[0] - x[1] > 0.4) * x[0] + p.F * cos(t)


def relays(number: int) -> Callable[..., Any]:
    def rhs(t, x, p):
        force = 0.0
        for k in range(number):
            force = force + (x[0] * cos(k) + x[1] * sin(k) > 0.3 + 0.02 * k) * sin(t + k)
        return x[1], -x[0] - 0.2 * x[1] + p.F * cos(t) - force

    return rhs


def instructions(rhs: Callable[..., Any]) -> int:
    traced = switching_trace(rhs, None, 2, NAMES)
    bodies = switching.switching_functions(traced, 10, 1, 1e-9, 8)
    return sum(len(body.lines) for body in bodies.values())


@pytest.mark.parametrize(("rhs", "most"), [(seven, 16_000), pytest.param(tangled, 45_000, marks=pytest.mark.thorough)])
def test_instructions_are_few_where_comparisons_depend_on_one_another(rhs, most) -> None:
    """Equations for all switches at once would be 60,000 instructions for the first, and 490,000 for the second."""
    assert instructions(rhs) < most


def test_instructions_grow_with_the_number_of_comparisons() -> None:
    few, many = (instructions(relays(number)) for number in (6, 12))
    assert many < 3 * few


def motion_and_events(traced: SwitchingTrace, at_once: int) -> NDArray[np.float64]:
    """Return both at random states, where nothing slides, and each of the switches, up to so many at once."""
    count, rng = len(traced.surfaces), np.random.default_rng(5)
    can = [k for k in range(count) if not traced.gains[k][k].vanishes]
    sets = [chosen for number in range(at_once + 1) for chosen in itertools.combinations(can, number)]
    slides = np.repeat([[float(k in chosen) for k in range(count)] for chosen in sets], 20, axis=0)
    number = len(slides)
    inputs = {("time", None): rng.uniform(0, 6, number), ("parameter", 0): rng.uniform(0, 1, number)}
    inputs |= {("state", j): rng.uniform(-1, 1, number) for j in range(2)}
    for k, counts in enumerate(traced.counts):
        sides = rng.choice([-1.0, 1.0], number)
        inputs["sign", k] = 2.0 * sides if counts else np.where(slides[:, k] > 0.0, 0.0, sides)
        inputs["slide", k] = slides[:, k]
    outputs = [*traced.motion.outputs, *traced.events]
    nodes = in_order(outputs)
    given = {e: inputs[e.operation, e.value] for e in nodes if not e.arguments and e.operation != "constant"}
    return np.stack(np.broadcast_arrays(*evaluated(outputs, given)))


@pytest.mark.parametrize(("rhs", "at_once"), [(chopped, 2), (seven, 1)])  # of seven, most pairs are parallel
def test_places_and_equations_for_all_switches_are_the_same_motion(rhs, at_once, monkeypatch) -> None:
    found, sizes = [], []
    for most in (0, 10**9):
        monkeypatch.setattr(filippov, "_MANY", most)
        traced = switching_trace(rhs, None, 2, NAMES)
        found.append(motion_and_events(traced, at_once))
        sizes.append(len(in_order([*traced.motion.outputs, *traced.events])))
    regular = np.isfinite(found[1]).all(axis=0) & (np.abs(found[1]).max(axis=0) < 1e4)
    assert sizes[0] < sizes[1]
    assert regular.sum() > 50  # some surfaces matter on one side of others alone
    np.testing.assert_allclose(found[0][:, regular], found[1][:, regular], rtol=1e-9, atol=1e-9)


def test_functions_that_are_compiled_quickly_give_the_same_images(monkeypatch) -> None:
    """Values are kept in registers or in memory; operations differ in which of two products is fused with their sum."""
    traced = switching_trace(chopped, None, 2, NAMES)
    places = np.random.default_rng(1).uniform(-1.5, 1.5, (1, 2, LANES))
    images = []
    for large in (10**9, 0):
        monkeypatch.setattr(switching, "_LARGE", large)
        advance = switching.compiled_switching(traced, 10, 1, 1e-9)
        x, errors = places.copy(), np.zeros((1, 2, LANES))
        advance(x, np.array([40]), 0.0, 2 * np.pi, np.array([0.8]), errors)
        images.append((x, errors))
    assert np.isfinite(images[0][0]).all()
    np.testing.assert_allclose(images[0][0], images[1][0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(images[0][1], images[1][1], rtol=1e-3, atol=1e-15)


def test_too_many_comparisons_say_what_to_do() -> None:
    why = traced_switching((relays(25), None), 2, NAMES)
    assert isinstance(why, str)
    assert "more than 24 comparisons" in why
    with pytest.warns(ToleranceWarning, match=r"not located, for it makes more than 24 comparisons.*switches"):
        warn_of_tolerance(np.array([Status.INACCURATE]), PointMap("relays", (), {}, print, unknown_formulas=why))
