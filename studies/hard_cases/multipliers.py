"""Multipliers next to the unit circle, and transients that last."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi, sqrt
from typing import Any

import numpy as np

from cellmap import PointMap, discrete_map, find_attractors, stroboscopic_map
from cellmap.maps import jacobian
from cellmap.orbits import Kind
from systems import dimensionless_pendulum, driven_pendulum

from .._unsettled import unsettled_basins
from .case import TIGHT, Finding, agrees, at_most, hard_case, is_so

GAINS_STABILITY = 2.329021135978e-3
"""Amplitude (m) from which the inverted state is stable."""

LOSES_STABILITY = 0.050027335537
"""Amplitude beta at which the hanging state of (alpha, gamma) = (0.25, 0.05) is lost to a motion of period 2."""


@hard_case(
    "A multiplier within 1e-6 of 1",
    why="A distance shrinks by a tenth in 100,000 periods: nothing settles, and everything near looks settled.",
    expected="The multiplier to 1e-9, on both sides of 1, where the amplitude is 1.6 nm from its critical value; "
    "stable above and unstable below, orbits next to it undecided, none assigned to what is merely near. (A "
    "neighbourhood that contracts by a millionth can only be verified on a map whose tolerance is tighter "
    "than the default.)",
)
def next_to_one() -> Iterator[Finding]:
    def largest(amplitude: float) -> float:
        exact = stroboscopic_map(driven_pendulum(amplitude=amplitude), **TIGHT)
        return float(np.linalg.eigvals(jacobian(exact, [pi, 0.0])).real.max())

    slope = (largest(GAINS_STABILITY + 1e-6) - largest(GAINS_STABILITY - 1e-6)) / 2e-6
    for distance, stable in ((1e-6 / slope, False), (-1e-6 / slope, True)):
        amplitude = GAINS_STABILITY + distance
        value = largest(amplitude)
        yield agrees(f"multiplier at {1e3 * amplitude:.9f} mm, less 1", value - 1.0, slope * distance, 1e-9)
        exact = stroboscopic_map(driven_pendulum(amplitude=amplitude), **TIGHT)
        found = find_attractors(exact, [[pi, 0.0], [pi - 1e-3, 0.0]], max_periods=500)
        upright = any(abs(abs(a.points[0, 0]) - pi) < 1e-6 for a in found)
        yield is_so("it attracts" if stable else "it is no attractor", upright == stable)
        labels = unsettled_basins(exact, [[pi - 0.01, 0.0]], max_periods=500).labels.tolist()
        yield is_so("an orbit from 0.01 rad away is undecided after 500 periods", labels == [-3])


@hard_case(
    "A multiplier within 1e-6 of -1",
    why="The orbit jumps from one side to the other and comes closer by a millionth of the distance: it passes "
    "for period 2.",
    expected="The multiplier to 1e-9; below the critical amplitude a fixed point, above it none, and at a larger "
    "distance a motion of period 2.",
)
def next_to_minus_one() -> Iterator[Finding]:
    def at(beta: float) -> PointMap:
        return stroboscopic_map(dimensionless_pendulum(0.25, beta, 0.05))

    def smallest(beta: float) -> float:
        return float(np.linalg.eigvals(jacobian(at(beta), [0.0, 0.0])).real.min())

    slope = (smallest(LOSES_STABILITY + 1e-6) - smallest(LOSES_STABILITY - 1e-6)) / 2e-6
    for distance, stable in ((1e-6 / slope, True), (-1e-6 / slope, False)):
        beta = LOSES_STABILITY + distance
        yield agrees(f"multiplier at beta = {beta:.12f}, plus 1", smallest(beta) + 1.0, slope * distance, 1e-9)
        exact = stroboscopic_map(dimensionless_pendulum(0.25, beta, 0.05), rtol=1e-14, atol=1e-14)
        found = find_attractors(exact, [[0.0, 0.0]], max_periods=200)
        kinds = [(a.kind, a.period) for a in found]
        yield is_so(
            "it is a fixed point that attracts" if stable else "it is no attractor",
            kinds == [(Kind.FIXED_POINT, 1)] * stable,
        )
    (a,) = find_attractors(at(0.052), [[0.5, 0.0], [1.0, 0.3]])
    yield is_so("at beta = 0.052 the only attractor found has period 2", (a.kind, a.period) == (Kind.PERIODIC, 2))


@hard_case(
    "Chaotic transients of 10,000 periods",
    why="Orbits are chaotic for 10,000 periods on the average before they find the only attractor; an exponent "
    "measured on the way is that of chaos.",
    expected="No chaotic attractor. Of initial conditions spread evenly over a stretched tent map of slope 2.0002 the "
    "exact fraction 1.0001^-n has not escaped after n periods.",
)
def long_transients() -> Iterator[Finding]:
    def tent(x: Sequence[float], p: Any) -> tuple[float]:
        up = 1.0 - abs(2.0 * x[0] - 1.0)
        return ((1.0 + p.gap) * up if x[0] >= 0.0 and x[0] <= 1.0 else -0.5 + 0.5 * x[0] / (1.0 + abs(x[0])),)

    exact = discrete_map(tent, {"gap": 1e-4}, ("x",))
    initial_conditions = now = np.random.default_rng(0).uniform(0.0, 1.0, (5_000, 1))
    for before, periods in ((0, 2_000), (2_000, 10_000)):
        now = exact.iterate(now, periods - before).points
        fraction = float((now >= 0.0).mean())
        expected = 1.0001**-periods
        yield agrees(
            f"fraction not escaped after {periods:,} periods",
            fraction,
            expected,
            4.0 * sqrt(expected * (1 - expected) / len(initial_conditions)),
        )
    basins = unsettled_basins(exact, initial_conditions[:500])
    yield is_so(
        f"attractors: {', '.join(a.name for a in basins.attractors)}",
        [a.kind for a in basins.attractors] == [Kind.FIXED_POINT],
    )
    undecided = float((basins.labels == -3).mean())
    yield agrees("undecided fraction of 500 orbits after 2,000 periods", undecided, 1.0001**-2000, 0.07)


@hard_case(
    "A chaotic attractor",
    why="It has no periodic point for Newton's method; only averages along it are known.",
    expected="One attractor, called chaotic (alpha 0.25, beta 0.55, gamma 0.05); by Liouville's theorem its exponents "
    "add up to -0.05 times 2 pi.",
)
def chaos() -> Iterator[Finding]:
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 2))
    found = find_attractors(
        stroboscopic_map(dimensionless_pendulum(0.25, 0.55, 0.05)), initial_conditions, max_periods=300
    )
    yield is_so("one attractor, chaotic", [a.kind for a in found] == [Kind.CHAOTIC])
    yield at_most("error of the sum of its exponents", float(abs(found[0].exponents.sum() + 0.05 * 2 * pi)), 1e-6)
    yield is_so(f"largest exponent {found[0].exponents[0]:.3f}", bool(found[0].exponents[0] > 0.1))
