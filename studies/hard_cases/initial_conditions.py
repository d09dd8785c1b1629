"""Initial conditions in awkward places."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from math import cos, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cellmap import (
    CellGrid,
    ForcedSystem,
    PointMap,
    Status,
    find_attractors,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap.maps import ToleranceWarning, jacobian
from systems import double_pendulum, driven_pendulum

from .case import TIGHT, Finding, agrees, at_most, hard_case, is_so, refused
from .frozen import NO_DRIVE

UNDECIDED, DIVERGED = -3, -2


def two_wells(t: float, x: Any, p: Any) -> tuple[float, float]:
    return x[1], x[0] - x[0] ** 3 - p.damping * x[1]


@hard_case(
    "An initial condition exactly on a saddle",
    why="It rests there for ever in exact arithmetic, and in rounded arithmetic for hundreds of periods.",
    expected="The saddle between two wells stays put bit for bit; the inverted state at 2 mm is left at the rate of "
    "its multiplier 1.126883285335. Neither is an attractor; the start belongs to no basin.",
)
def saddle() -> Iterator[Finding]:
    wells = stroboscopic_map(ForcedSystem(two_wells, {"damping": 0.2}, 2.0 * pi, ("x", "v")), **TIGHT)
    yield is_so("between two wells: bit for bit at rest for 10,000 periods", _rests(wells, [0.0, 0.0], 10_000))
    basins = find_basins(wells, CellGrid((-1.5, -1.5), (1.5, 1.5), (15, 15)))
    places = sorted(float(a.points[0, 0]) for a in basins.attractors)
    yield at_most("error of the attractors at -1 and 1", float(np.abs(np.subtract(places, [-1.0, 1.0])).max()), 1e-9)
    undecided = np.argwhere(basins.labels == UNDECIDED).tolist()
    yield is_so("the start on the saddle is undecided, and no other one of 225", undecided == [[7, 7]])
    pendulum = stroboscopic_map(driven_pendulum(amplitude=0.002), **TIGHT)
    near = pendulum.orbit([pi - 1e-9, 0.0], 60).unwrapped[:, 0] - pi
    yield agrees("growth a period of a distance of 1e-9 from upright", near[60] / near[59], 1.126883285335, 1e-7)
    found = find_attractors(pendulum, [[pi, 0.0], [-pi, 0.0], [1.0, 1.0]])
    yield is_so("only the hanging state attracts", [a.name for a in found] == ["fixed point (0, 0)"])


def _rests(point_map: PointMap, start: list[float], periods: int) -> bool:
    return bool((point_map.iterate(start, periods).points == start).all())


@hard_case(
    "An initial condition on the stable manifold of a saddle",
    why="It takes for ever to arrive, and any error grows e-fold in every unit of time once it is near.",
    expected="x = sqrt(2) sech t, the homoclinic orbit of the undamped two-well oscillator, until errors of 1e-12 have"
    " grown.",
)
def homoclinic() -> Iterator[Finding]:
    wells = ForcedSystem(two_wells, {"damping": 0.0}, 1.0, ("x", "v"))
    orbit = stroboscopic_map(wells, **TIGHT).orbit([sqrt(2.0), 0.0], 12).points[:, 0]
    t = np.arange(13.0)
    yield at_most("largest error of x until t = 12, in units of 1e-12 exp(t)", _worst(orbit, t), 10.0)


def _worst(orbit: np.ndarray, t: np.ndarray) -> float:
    return float((np.abs(orbit - sqrt(2.0) / np.cosh(t)) / (1e-12 * np.exp(t))).max())


@hard_case(
    "An initial condition on a basin boundary",
    why="Two numbers next to each other in double precision belong to different basins.",
    expected="Bisection between hanging and inverted (3 mm, at rest) ends on two neighbouring numbers of different "
    "label; both orbits first come to an unstable orbit on the boundary, with one multiplier inside and one "
    "outside the unit circle, near Kapitza's angle.",
)
def boundary() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum(), **TIGHT)
    attractors = find_attractors(exact, [[0.1, 0.0], [pi - 0.1, 0.0]])
    yield is_so("two attractors, hanging and inverted", [a.kind.name for a in attractors] == ["FIXED_POINT"] * 2)
    low, high = 0.1, pi - 0.1
    while np.nextafter(low, high) < high:
        angles = np.unique(np.concatenate([[low, high], low + (high - low) * np.arange(1, 64) / 64.0]))
        labels = find_basins(exact, np.stack([angles, 0.0 * angles], axis=-1), attractors=attractors).labels
        k = int(np.flatnonzero(np.diff(labels))[0])
        low, high = angles[k], angles[k + 1]
    yield is_so(
        f"the boundary is between {float(low)!r} and the next number", bool(labels[k] >= 0 and labels[k + 1] >= 0)
    )
    orbit = exact.orbit([[low, 0.0], [high, 0.0]], 200).points
    apart = np.abs(np.diff(orbit, axis=0)).max(axis=-1)
    nearest = int(apart[:, 0].argmin())
    yield at_most(f"they come to rest up to (period {nearest})", float(apart[nearest].max()), 1e-6)
    point = orbit[nearest, 0]
    for _ in range(3):
        step = np.linalg.solve(jacobian(exact, point) - np.eye(2), point - exact(point))
        point = point + step
    sizes = np.abs(np.linalg.eigvals(jacobian(exact, point)))
    yield is_so(f"multipliers there: {sizes.min():.4f} and {sizes.max():.4f}", bool(sizes.min() < 1.0 < sizes.max()))
    # In the mean over the period the fast motion drops out.
    yield at_most("its distance from Kapitza's angle, 0.9271 rad (rad)", float(abs(pi - point[0] - 0.927068123)), 0.2)


@hard_case(
    "An initial condition on the branch cut",
    why="Upright is where the angle jumps from pi to -pi: what is attracted there lies on both sides.",
    expected="The same image, bit for bit, of pi, -pi and 3 pi; one inverted attractor, whose basin is its own mirror "
    "image; 7104 of 40,000 starts at 3 mm.",
)
def branch_cut() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum())
    images = exact([[pi, 2.0], [-pi, 2.0]])
    yield is_so("pi and -pi have the same image", bool((images[0] == images[1]).all()))
    rotated = exact.iterate([3.0 * pi, 2.0], 1)
    yield at_most("distance of the image of 3 pi", float(np.abs(rotated.points - images[0]).max()), 1e-12)
    table = interpolated_map(exact, CellGrid((-pi, -100.0), (pi, 100.0), (128, 128)), outside="integrate")
    basins = find_basins(table, CellGrid((-pi, -100.0), (pi, 100.0), (200, 200)))
    yield is_so("two attractors", len(basins.attractors) == 2)
    inverted: NDArray[np.bool_] = basins.labels == 1
    yield is_so(
        f"{np.count_nonzero(inverted)} orbits converge to the inverted state",
        abs(int(np.count_nonzero(inverted)) - 7104) <= 5,
    )
    yield at_most("of them without mirror image", int(np.count_nonzero(inverted != inverted[::-1, ::-1])), 4)


@hard_case(
    "Numbers that are not finite in a right-hand side",
    why="Orbits are integrated side by side; one that is not a number must not touch its neighbours.",
    expected="Where x leaves the domain of a square root the status DIVERGED and NaN; all others as without them, bit "
    "for bit.",
)
def not_finite() -> Iterator[Finding]:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return 0.01 * sqrt(1.0 - x[0] ** 2) - 0.1 * x[0], -x[1] + cos(t)

    exact = stroboscopic_map(ForcedSystem(rhs, {}, 2.0 * pi, ("x", "v")))
    initial_conditions = np.random.default_rng(2).uniform(-0.9, 0.9, (1000, 2))
    bad = [3, 4, 500, 998, 999]
    mixed = initial_conditions.copy()
    mixed[bad, 0] = [1.5, -2.0, 1e300, 7.0, 1.0000001]
    alone, among = exact.iterate(initial_conditions, 1), exact.iterate(mixed, 1)
    good = np.setdiff1d(np.arange(1000), bad)
    yield is_so(
        "5 of 1,000 have the status DIVERGED", bool(np.flatnonzero(among.status == Status.DIVERGED).tolist() == bad)
    )
    yield is_so("they are NaN", bool(np.isnan(among.points[bad]).all()))
    yield is_so("995 keep every bit", bool((alone.points[good] == among.points[good]).all()))
    labels = find_basins(exact, mixed[:10]).labels
    yield is_so(
        "basins: -2 for two of the first ten orbits, 0 for eight",
        np.flatnonzero(labels).tolist() == [3, 4] and bool((labels[3:5] == DIVERGED).all()),
    )


@hard_case(
    "Numbers beyond all bounds",
    why="An angle that turns by 1e200 rad a period has no digits left.",
    expected="A label of its own for 1e20 to 1e308 rad/s, and the right one for their neighbours; initial conditions "
    "that are not finite are refused by name.",
)
def beyond_bounds() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum())
    initial_conditions = [[0.1, 1.0], [0.0, 1e20], [0.0, 1e100], [0.0, -1e200], [0.0, 1e308]]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        labels = find_basins(exact, initial_conditions, max_periods=60).labels.tolist()
    yield is_so(f"labels {labels}", labels == [0, -2, -2, -2, -2])
    for bad in (np.nan, np.inf):
        yield refused(str(bad), lambda bad=bad: find_basins(exact, [[bad, 0.0]]), ValueError, "remove points")  # type: ignore[misc]


@hard_case(
    "Double pendulum near its singular configurations",
    why="With the inner mass a thousandth of the outer one, the equations divide by m1 + m2 sin² D, which all but"
    " vanishes where the rods lie in one line; there the angles turn a thousand times as fast.",
    expected="Liouville's determinant (m1 + m2 sin² D)/(m1 + m2 sin² D') and the energy, undriven, for states in and "
    "next to stretched and folded positions.",
)
def double_pendulum_in_line() -> Iterator[Finding]:
    system = double_pendulum(mass_1=0.001, mass_2=1.0, damping=0.0, amplitude=NO_DRIVE)
    exact = stroboscopic_map(system)
    first = np.array([0.3, 1.0, 2.0, 3.0])
    offsets = np.array([0.0, 1e-12, 1e-3, pi - 1e-3, pi - 1e-12, pi])
    angles = np.stack(np.meshgrid(first, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
    initial_conditions = np.concatenate(
        [angles[:, :1], angles.sum(axis=-1, keepdims=True), np.full((24, 2), [1.0, -2.0])], axis=-1
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        ends = exact.iterate(initial_conditions, 1)
    good = ends.status == Status.OK
    yield is_so(
        f"{np.count_nonzero(good)} of 24 orbits have the status OK",
        bool(good.all()),
    )
    energies = [system.output("energy", 0.0, x).sum(axis=-1) for x in (initial_conditions[good], ends.points[good])]
    yield at_most("relative change of the energy where OK", float(np.abs(energies[1] / energies[0] - 1.0).max()), 1e-9)
    inertia, later = (0.001 + np.sin(x[good, 0] - x[good, 1]) ** 2 for x in (initial_conditions, ends.unwrapped))
    matrices = jacobian(exact, initial_conditions[good])
    terms = np.prod(np.linalg.norm(matrices, axis=-1), axis=-1)
    error = np.abs(np.linalg.det(matrices) - inertia / later) / terms
    yield at_most("error of the determinant, by the size of its terms", float(error.max()), 1e-9)
    spread = float(np.ptp(np.log10(inertia / later)))
    yield is_so(f"the exact determinants differ by {spread:.1f} powers of ten", spread > 2.0)
