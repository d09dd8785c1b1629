"""Chaotic attractors: recognised by their exponents, kept apart, held by boxes."""

from dataclasses import replace
from math import exp, log, pi, sin, sqrt

import numpy as np
import pytest
from small_maps import ends_of

import systems
from cellmap import CellGrid, Label, angle, discrete_map, find_basins, stroboscopic_map
from cellmap.attractors.kinds.chaos import examine
from cellmap.attractors.kinds.chaos import tested as exponents_of
from cellmap.attractors.kinds.exponents import Growing
from cellmap.attractors.kinds.transients import REMEDIES, Late, Reason
from cellmap.attractors.regions.boxes import full_residence, inside_cover
from cellmap.attractors.shortcuts.surrogate import only_attractor
from cellmap.orbits import Kind

DAMPED = systems.dimensionless_pendulum(0.25, 0.55, 0.05)


def linear(matrix) -> object:
    rows = tuple(map(tuple, matrix))

    def product(x, p):
        return tuple(sum(a * b for a, b in zip(row, x, strict=True)) for row in rows)

    return discrete_map(product, {}, tuple("abcd"[: len(rows)]))


def switched(x, p):
    """Henon's map with a = 0.8 + 0.6 s: chaotic where s tends to 1, at rest where it tends to -1."""
    return 1 - (0.8 + 0.6 * x[2]) * x[0] ** 2 + x[1], 0.3 * x[0], x[2] + 0.5 * (x[2] - x[2] ** 3)


# --- exponents


@pytest.mark.parametrize("diagonal", [(0.5,), (1.5, 0.2), (0.9, -1.1), (1.2, 0.5, -0.3)])
def test_exponents_of_a_linear_map(diagonal):
    """The logarithms of the eigenvalues, in the order of the axes of a triangular matrix."""
    matrix = np.diag(diagonal) + np.triu(np.full((len(diagonal),) * 2, 0.3), 1)
    growth = Growing.along(linear(matrix), np.zeros((2, len(diagonal))), 50)
    assert growth.exponents == pytest.approx(np.log(np.abs([diagonal, diagonal])), abs=1e-12)
    assert growth.errors == pytest.approx(np.zeros((2, len(diagonal))), abs=1e-12)


def test_exponents_of_henons_map():
    """0.419 and -1.623; their sum is ln 0.3, the logarithm of the map's determinant, exactly."""
    begin = np.random.default_rng(0).uniform(-0.1, 0.1, (200, 2))
    exponents = Growing.along(systems.henon_map(), begin, 4000).exponents
    assert exponents.mean(axis=0) == pytest.approx([0.419, -1.623], abs=0.002)
    assert exponents.sum(axis=-1) == pytest.approx(log(0.3), abs=1e-11)


def test_orbits_that_end_have_no_exponents():
    """x' = 4 x (1 - x) throws what is outside of [0, 1] out; the orbits beside it keep their bits."""
    logistic = discrete_map(lambda x, p: (4 * x[0] * (1 - x[0]),), {}, ("x",))
    alone = Growing.along(logistic, np.array([[0.3], [0.6]]), 100)
    beside = Growing.along(logistic, np.array([[0.3], [2.0], [0.6]]), 100)
    assert np.array_equal(beside.exponents[[0, 2]], alone.exponents)
    assert np.array_equal(np.isnan(beside.exponents), [[False], [True], [False]])
    assert np.array_equal(np.isnan(beside.errors), [[False], [True], [False]])


# --- attractors


@pytest.fixture(scope="module")
def pendulum():
    return find_basins(stroboscopic_map(DAMPED), CellGrid((-pi, -3.0), (pi, 3.0), (4, 4)), max_periods=500)


def test_chaotic_pendulum(pendulum):
    """Benettin's two orbits (RK4, 1024 steps, 20,000 periods) grow apart by 0.884 a period (REFERENCES.md)."""
    (a,) = pendulum.attractors
    assert a.kind is Kind.CHAOTIC
    assert (pendulum.labels == 0).all()
    assert a.exponents.sum() == pytest.approx(-0.05 * 2 * pi, abs=1e-9)
    assert a.exponents[0] == pytest.approx(0.884, abs=0.02)


def test_cover_holds_the_attractor_for_ever():
    henon = systems.henon_map()
    (a,) = examine(
        ends_of(henon, henon.iterate(np.zeros((32, 2)) + 0.01 * np.arange(32)[:, None], 500).points)
    ).attractors
    initial_conditions = henon.iterate(np.linspace(0.0, 0.2, 20)[:, None] * [1.0, 1.0], 100).points
    later = henon.orbit(initial_conditions, 5_000).points.reshape(-1, 2)
    assert inside_cover(a.cover, later, henon).mean() > 0.9999
    assert inside_cover(a.cover, a.points, henon).all()
    assert not inside_cover(a.cover, np.array([[0.0, 0.0], [1.0, 0.35]]), henon).any()


def test_chaos_beside_a_fixed_point():
    grid = CellGrid((-0.1, -0.1, -1.2), (0.1, 0.1, 1.2), (4, 4, 12))
    basins = find_basins(discrete_map(switched, {}, ("x", "y", "s")), grid, max_periods=300)
    assert [a.kind for a in basins.attractors] == [Kind.FIXED_POINT, Kind.CHAOTIC]
    assert np.array_equal(basins.labels == 0, grid.centres()[..., 2] < 0)
    assert (basins.labels >= 0).all()


# --- what is not a chaotic attractor


@pytest.mark.parametrize(
    ("function", "coordinates", "window"),
    [
        # Chaos that preserves areas, the standard map: nothing attracts.
        (
            lambda x, p: (x[0] + x[1] + 5.0 * sin(x[0]), x[1] + 5.0 * sin(x[0])),
            (angle("a"), angle("b")),
            ((-pi, -pi), (pi, pi)),
        ),
        # Convergence like 1/n to a fixed point with the multiplier 1.
        (lambda x, p: (x[0] - x[0] ** 3,), ("x",), ((-0.5,), (0.5,))),
    ],
)
def test_undecided_rather_than_chaotic(function, coordinates, window):
    grid = CellGrid(*window, (8,) * len(coordinates))
    basins = find_basins(discrete_map(function, {}, coordinates), grid, max_periods=300)
    assert basins.attractors == ()
    assert (basins.labels == Label.UNDECIDED).all()


@pytest.mark.parametrize(
    ("function", "coordinates", "window"),
    [
        # An invariant circle (delayed logistic map, Aronson et al. 1982): attracting, with the exponent 0.
        (lambda x, p: (2.05 * x[0] * (1 - x[1]), x[0]), ("x", "y"), ((0.3, 0.3), (0.6, 0.6))),
        # A rigid rotation: the whole circle.
        (lambda x, p: (x[0] + 1.0,), (angle("a"),), ((-pi,), (pi,))),
    ],
    ids=["invariant circle", "rotation"],
)
def test_quasi_periodic_rather_than_chaotic(function, coordinates, window):
    grid = CellGrid(*window, (8,) * len(coordinates))
    basins = find_basins(discrete_map(function, {}, coordinates), grid, max_periods=300)
    assert [a.kind for a in basins.attractors] == [Kind.QUASIPERIODIC]
    assert (basins.labels == 0).all()


def test_chaos_along_a_later_axis() -> None:
    """Two wells across, the logistic map upwards: frames stay on the axes, and the second one is stretched."""
    exact = discrete_map(lambda x, p: (1.4 * x[0] - 0.4 * x[0] ** 3, 3.9 * x[1] * (1.0 - x[1])), {}, ("x", "y"))
    basins = find_basins(exact, CellGrid((-1.5, 0.05), (1.5, 0.95), (30, 20)))
    assert [a.kind for a in basins.attractors] == [Kind.CHAOTIC, Kind.CHAOTIC]
    assert [f.fraction for f in basins.fractions.values()] == [0.5, 0.5]
    for attractor in basins.attractors:
        assert attractor.exponents[1] == pytest.approx(np.log(0.2), rel=1e-6)
        # 0.49615 +- 0.00018 from 3e6 iterates; of 16,000 the standard error is 0.0025.
        assert attractor.exponents[0] == pytest.approx(0.49615, abs=3 * 0.0025)


# --- weak chaos


def test_residence_where_chaos_is_weak() -> None:
    """log(64) Lyapunov times.  In Chen's map (0.0075 a step) orbits pass by for up to 376 steps (1,230 in NumPy)."""
    found = find_basins(
        discrete_map(lambda x, p: (3.9 * x[0] * (1 - x[0]),), {}, ("x",)), np.linspace(0.1, 0.9, 64)[:, None]
    ).attractors[0]
    assert full_residence(found) == 64
    assert full_residence(replace(found, exponents=np.array([0.0075]))) == 555


def dispersal(u, p):
    """Two competitors in two patches (Holt, McPeek 1996): slow and fast dispersers."""
    a, b, c, d = u
    e, f = exp(3.0 - 0.03 * (a + b)), exp(3.5 - 3.5 / 75.0 * (c + d))
    return (
        0.825 * a * e + 0.175 * c * f,
        0.998 * b * e + 0.002 * d * f,
        0.825 * c * f + 0.175 * a * e,
        0.998 * d * f + 0.002 * b * e,
    )


def test_the_sign_of_a_small_exponent_is_known_after_more_periods() -> None:
    """0.0166: 270 orbits of 128,000 steps in NumPy have 0.0160 to 0.0172, of the others b and d vanish."""
    patches = discrete_map(dispersal, {}, ("a", "b", "c", "d"))
    states = np.random.default_rng(0).uniform((0.01, 0.01, 0.5, 0.5), (2.0, 2.0, 0.5, 0.5), (60, 4))
    states = patches.iterate(states, 2000).points
    states = states[states[:, 1] > 10.0]
    assert (exponents_of(patches, states, np.ones(4), 300)[1] != Reason.TRANSIENT).mean() > 0.5
    (weak,) = examine(ends_of(patches, states, 2000)).attractors
    assert weak.exponents[0] == pytest.approx(0.0166, rel=0.2)  # five standard errors are less


def test_small_exponents_of_an_attractor_have_their_sign() -> None:
    """Across y = 0 the exponent is the mean of log(3.9 x), which is log(3.9 / 4)."""
    driven = discrete_map(
        lambda x, p: (4.0 * x[0] * (1.0 - x[0]), 3.9 * x[0] * x[1] * exp(-(x[1] ** 2))), {}, ("x", "y")
    )
    (attractor,) = find_basins(driven, CellGrid((0.001, -1.0), (0.999, 1.0), (8, 8))).attractors
    assert attractor.exponents == pytest.approx([log(2.0), log(3.9 / 4.0)], abs=3 * log(4.0 / 3.9) / 5)


def test_orbits_that_are_late_converge_after_more_periods() -> None:
    """The kicked rotor has cycles whose multipliers are 0.98 a step (Feudel and others 1996)."""
    rotor = discrete_map(lambda x, p: (x[0] + x[1], 0.98 * x[1] + 4.0 * sin(x[0] + x[1])), {}, (angle("x"), "y"))
    grid = CellGrid((-pi, -pi), (pi, pi), (6, 6))
    few = find_basins(rotor, grid, max_periods=600)
    assert few.undecided and max(few.undecided, key=few.undecided.get) == Reason.LATE
    assert "max_periods" in REMEDIES[Reason.LATE]
    assert (find_basins(rotor, grid, max_periods=6000).labels >= 0).all()


def test_orbits_on_a_line_of_symmetry_are_on_cycles_that_repel() -> None:
    """On y = -x Kapitaniak's pair of maps has a cycle of period 2, at abs(x) = 3.675, off which orbits go elsewhere."""
    a, d = sqrt(2.0), -0.935

    def h(x):
        return -a * x + a * (abs(x + 1.0 / a) - abs(x - 1.0 / a))

    pair = discrete_map(lambda x, p: (h(x[0]) + d * (x[1] - x[0]), h(x[1]) + d * (x[0] - x[1])), {}, ("x", "y"))
    grid = CellGrid((-2.0, -2.0), (2.0, 2.0), (6, 6))
    basins = find_basins(pair, grid, max_periods=20_000)
    assert set(basins.undecided) == {Reason.PERIODIC}
    assert np.array_equal(basins.labels == Label.UNDECIDED, np.eye(6, dtype=bool)[::-1])
    assert "lines of symmetry" in REMEDIES[Reason.PERIODIC]
    assert (find_basins(pair, [[-2.0, 2.1], [0.4, -0.3]], max_periods=20_000).labels >= 0).all()


# --- all orbits on one attractor, and an interpolated map in the place of the map


NONE_LATE = Late(np.empty((0, 2)), np.empty(0, np.int64))
FOLD = discrete_map(lambda x, p: (4.0 * p.a * x[0] * (1.0 - x[0]), 0.5 * x[1]), {"a": 0.95}, ("x", "y"))
CYCLE_OF_20 = 0.9491767575122371
"""x = 1/2, where the slope is zero, is on a cycle: it attracts a millionth of the interval at once."""


def only(a: float, periods: int):
    point_map = FOLD.with_params(a=a)
    begin = np.random.default_rng(0).uniform((0.2, -1e-3), (0.9, 1e-3), (1024, 2))
    points = point_map.iterate(begin, 64).points
    return only_attractor(ends_of(point_map, points, 64), NONE_LATE, periods)[0]


def test_cycle_inside_of_chaos_is_seen_by_the_surrogate():
    x = 0.5
    for _ in range(20):
        x = 4.0 * CYCLE_OF_20 * x * (1.0 - x)
    assert x == pytest.approx(0.5, abs=1e-9)
    assert only(CYCLE_OF_20, 64) is not None  # 32 orbits, followed for 1,000 periods, do not come to it
    assert only(CYCLE_OF_20, 2000) is None
    assert only(1.02, 2000) is None  # orbits leave
