"""Atlas of attractors: closed forms, labels of verified basins, the same numbers on any number of threads."""

from math import pi, sin

import numpy as np
import pytest
from cases import thorough

from cellmap import angle, discrete_map, find_basins, set_threads
from cellmap.bifurcations import AtlasKind, BifurcationKind, attractor_atlas
from cellmap.bifurcations.coexistence import AttractorSearch
from systems import henon_map

SIDE = (np.arange(6) + 0.5) / 6.0
STATES = np.stack(np.meshgrid(-pi + 2.0 * pi * SIDE, -8.0 + 16.0 * SIDE), axis=-1).reshape(-1, 2)


def scaled_logistic():
    """The logistic map in the variable s x, whatever s is."""
    return discrete_map(lambda x, p: (p.r * x[0] * (1.0 - p.s * x[0]),), {"r": 3.0, "s": 1.0}, ("x",), "logistic")


def test_fixed_points_and_cycles_of_henon():
    atlas = attractor_atlas(
        henon_map(0.2, 0.3),
        ("a", np.linspace(-0.1, 0.9, 21)),
        ("b", np.linspace(0.1, 0.4, 7)),
        [[0.0, 0.0], [0.3, 0.1]],
    )
    a, b = np.meshgrid(atlas.x, atlas.y)
    flip, doubled = 0.75 * (1.0 - b) ** 2, (1.0 - b) ** 2 + 0.25 * (1.0 + b) ** 2
    for period, exists in ((1, (a > -0.25 * (1.0 - b) ** 2) & (a < flip)), (2, (a > flip) & (a < doubled))):
        (family,) = (k for k, f in enumerate(atlas.families) if f.period == period)
        found = np.zeros(a.shape, bool)
        found[atlas.rows[atlas.family == family], atlas.columns[atlas.family == family]] = True
        away = (np.abs(a - flip) > 1e-6) & (np.abs(a - doubled) > 1e-6)
        np.testing.assert_array_equal(found[away], exists[away])
        np.testing.assert_array_equal((atlas.fraction(family) + atlas.undecided / 2.0)[found & away], 1.0)
        slow = atlas.undecided[atlas.rows, atlas.columns] > 0
        assert (atlas.modulus[slow] > 0.99).all()
    assert atlas.explained == 1.0
    closed = ((0.75, 0.0), (1.0, 0.25), (-0.25, 0.0))  # flips of periods 1 and 2, fold
    kinds = {0: BifurcationKind.PERIOD_DOUBLING, 1: BifurcationKind.PERIOD_DOUBLING, 2: BifurcationKind.FOLD}
    for curve in atlas.curves:
        along, up = curve.values[:, curve.parameters.index("a")], curve.values[:, curve.parameters.index("b")]
        errors = [np.abs(along - (p * (1.0 - up) ** 2 + q * (1.0 + up) ** 2)).max() for p, q in closed]
        assert min(errors) < 1e-10
        assert curve.kind is kinds[int(np.argmin(errors))]
    assert len(atlas.curves) == 3


@pytest.mark.parametrize(("max_periods", "count"), [(12, 1), (20, 9), (48, 17), (60, 70)])
def test_orbits_that_go_ahead_are_counted_once(max_periods, count):
    states = np.linspace(0.05, 0.95, count)[:, None]
    axes = ("r", np.array([1.5, 2.5, 3.3, 3.9, 4.5])), ("s", [0.5, 1.0])
    atlas = attractor_atlas(scaled_logistic(), *axes, states, max_periods, curves=0)
    total = atlas.escaped + atlas.undecided
    np.add.at(total, (atlas.rows, atlas.columns), atlas.counts)
    np.testing.assert_array_equal(total, count)
    assert (atlas.escaped[:, 4] == count).all() or max_periods == 12
    if max_periods > 20:
        for k, period in enumerate((1, 1, 2)):
            assert (atlas.period[atlas.columns == k] == period).all()
            assert not atlas.undecided[:, k].any()


def test_kinds():
    # Period 3 between 1 + sqrt 8 and 3.8415; at 4 chaos; above, all orbits diverge.
    r = np.array([0.5, 2.5, 3.2, 3.5, 3.835, 4.0, 4.5])
    atlas = attractor_atlas(scaled_logistic(), ("r", r), ("s", [0.5, 1.0]), [[0.3], [0.55]], curves=0)
    columns = [atlas.columns == k for k in range(len(r))]
    assert [atlas.period[c].tolist() for c in columns] == [[1, 1], [1, 1], [2, 2], [4, 4], [3, 3], [0, 0], []]
    assert (atlas.kind[columns[5]] == AtlasKind.CHAOTIC).all()
    np.testing.assert_allclose(np.log(atlas.modulus[columns[5]]), np.log(2.0), atol=0.05)
    np.testing.assert_array_equal(atlas.escaped[:, 6], 2)
    assert not atlas.escaped[:, :6].any()
    assert not atlas.undecided.any()
    assert np.isnan(atlas.explained) or atlas.explained == 0.0


def test_a_neimark_sacker_border():
    delayed = discrete_map(lambda x, p: (p.r * x[0] * (1 - p.s * x[1]), x[0]), {"r": 1.9, "s": 1.0}, ("x", "y"))
    axes = ("r", np.linspace(1.905, 2.105, 9)), ("s", np.linspace(0.8, 1.2, 5))
    atlas = attractor_atlas(delayed, *axes, [[0.4, 0.5]])
    (curve,) = atlas.curves
    assert curve.kind is BifurcationKind.NEIMARK_SACKER
    np.testing.assert_allclose(curve.values[:, curve.parameters.index("r")], 2.0, rtol=1e-10)
    quasi = atlas.kind == AtlasKind.QUASIPERIODIC
    assert quasi.any()
    assert (atlas.x[atlas.columns[quasi]] > 2.0).all()


def cubic_map():
    return discrete_map(lambda x, p: (x[0] + p.q * x[0] - x[0] ** 3 + p.e,), {"q": 0.3, "e": 0.0}, ("x",), "cubic")


@pytest.mark.parametrize("e", [thorough(np.linspace(-0.2, 0.2, 9)), np.linspace(-0.19, 0.21, 10)])
def test_folds_around_a_cusp(e):
    """Both sheets are one family, with folds at 27 e^2 = 4 q^3; one grid has a line on e = 0, the other one none."""
    axes = ("q", np.linspace(-0.2, 0.6, 13)), ("e", e)
    atlas = attractor_atlas(cubic_map(), *axes, np.linspace(-1.2, 1.2, 8)[:, None])
    (folds,) = atlas.curves
    assert folds.kind is BifurcationKind.FOLD
    q, up = (folds.values[:, folds.parameters.index(name)] for name in ("q", "e"))
    np.testing.assert_allclose(27.0 * up**2, 4.0 * q**3, atol=1e-10)
    assert min(up) < -0.17
    assert max(up) > 0.17
    (cusp,) = folds.codimension_two()
    np.testing.assert_allclose(cusp.values, 0.0, atol=1e-6)
    assert atlas.explained == 1.0


def test_slow_convergence_is_undecided():
    """At r = 1 and 2 the map r x - x^3 has a pitchfork and a flip; at (2.1, 0.1) the exponent of period 4 is -0.005."""
    cubic = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3 + p.e,), {"r": 1.5, "e": 0.0}, ("x",))
    atlas = attractor_atlas(cubic, ("r", [1.0, 2.0, 2.1]), ("e", [0.0, 0.1]), np.linspace(-1.2, 1.2, 16)[:, None])
    assert not (atlas.kind == AtlasKind.QUASIPERIODIC).any()
    assert atlas.undecided[0].tolist()[:2] == [16, 16]
    assert atlas.undecided[1, 2] > 0
    # In the plane, exactly at both flips of the Henon map.
    flips = [0.75 * 0.7**2, 0.7**2 + 0.25 * 1.3**2]
    atlas = attractor_atlas(henon_map(0.2, 0.3), ("a", flips), ("b", [0.3, 0.31]), [[0.0, 0.0], [0.3, 0.1]])
    assert not (atlas.kind == AtlasKind.QUASIPERIODIC).any()
    assert atlas.undecided[0].tolist() == [2, 2]


def test_orbits_that_rest_on_unstable_points_are_undecided():
    """The logistic map has a repelling point at 0, to which 0.5 comes in two steps at 4, and no second attractor."""
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]) + p.e,), {"r": 3.5, "e": 0.0}, ("x",))
    atlas = attractor_atlas(logistic, ("r", [3.2, 3.9, 4.0]), ("e", [0.0, 0.001]), [[0.3], [0.5], [0.0]], curves=0)
    assert atlas.number[0].tolist() == [1, 1, 1]
    assert atlas.undecided[0].tolist() == [1, 1, 2]
    assert atlas.kind[atlas.rows == 0].tolist() == [AtlasKind.PERIODIC, AtlasKind.CHAOTIC, AtlasKind.CHAOTIC]


def test_a_circle_of_one_dimension():
    """Without coupling a rotation by 2 radians is quasi-periodic; with it, one by pi is locked."""
    circle = discrete_map(lambda x, p: (x[0] + p.o - p.k * sin(x[0]),), {"o": 1.0, "k": 0.5}, (angle("q"),))
    atlas = attractor_atlas(circle, ("o", [2.0, pi]), ("k", [0.0, 0.8]), [[0.1], [2.0]], curves=0)
    kinds = dict(zip(zip(atlas.rows.tolist(), atlas.columns.tolist(), strict=True), atlas.kind.tolist(), strict=True))
    assert kinds[0, 0] == AtlasKind.QUASIPERIODIC
    assert kinds[1, 1] == AtlasKind.ROTATING


def test_the_longest_period_is_8_unless_another_is_given():
    """The fixed points of nine steps attract with the multiplier (1 - 9 k)^9."""
    nine = discrete_map(
        lambda x, p: (x[0] + 2 * pi / 9 - p.k * sin(9.0 * x[0]) + p.e,), {"k": 0.05, "e": 0.0}, (angle("q"),)
    )
    axes = ("k", [0.05, 0.06]), ("e", [0.0, 1e-4])
    assert attractor_atlas(nine, *axes, [[0.1], [2.0]], curves=0).period.size == 0
    assert (attractor_atlas(nine, *axes, [[0.1], [2.0]], longest_period=9, curves=0).period == 9).all()


@pytest.fixture(scope="module")
def rotor():
    """A damped rotor with kicks, whose orbits hang, swing or rotate, and its atlas."""

    def kicked(x, p):
        y = p.b * x[1] - p.k * sin(x[0])
        return x[0] + y, y

    exact = discrete_map(kicked, {"k": 0.9, "b": 0.85}, (angle("q"), "v"))
    return exact, attractor_atlas(exact, ("k", [0.5, 1.5, 2.0]), ("b", [0.8, 0.85, 0.9]), STATES, curves=0)


@pytest.mark.parametrize("place", [(0, 1), (2, 1)])
def test_counts_of_verified_basins(rotor, place):
    exact, atlas = rotor
    row, column = place
    here = exact.with_params(k=float(atlas.x[column]), b=float(atlas.y[row]))
    basins = find_basins(here, STATES)
    mine = np.flatnonzero((atlas.rows == row) & (atlas.columns == column) & (atlas.counts > 0))
    theirs = sorted((a.period, a.rotations, basins.fractions[k].count) for k, a in enumerate(basins.attractors))
    ours = sorted(
        (int(atlas.period[k]), tuple(atlas.rotations[k].tolist()), int(atlas.counts[k])) for k in mine.tolist()
    )
    assert ours == theirs and len(ours) > 1


def test_any_number_of_threads():
    axes, states = ("r", np.linspace(2.5, 3.9, 40)), np.repeat(np.linspace(0.1, 0.9, 8), 60)[:, None]

    def numbers():
        atlas = attractor_atlas(scaled_logistic(), axes, ("s", [0.5, 1.0]), states, max_periods=40, curves=0)
        return atlas.points.tobytes(), atlas.counts.tobytes(), atlas.family.tobytes()

    several = numbers()
    set_threads(1)
    assert numbers() == several


def test_an_interrupted_run_goes_on(tmp_path, monkeypatch):
    axes = ("r", np.linspace(2.5, 3.8, 16)), ("s", np.linspace(0.5, 1.0, 8))
    states = np.linspace(0.1, 0.9, 600)[:, None]
    whole = attractor_atlas(scaled_logistic(), *axes, states, max_periods=60, curves=0)
    folder, done, original = tmp_path / "atlas", [0], AttractorSearch.__call__

    def failing(job, values):
        done[0] += 1
        if done[0] == 2:
            raise KeyboardInterrupt
        return original(job, values)

    set_threads(1)
    try:
        with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
            patched.setattr(AttractorSearch, "__call__", failing)
            attractor_atlas(scaled_logistic(), *axes, states, max_periods=60, curves=0, checkpoint=folder)
        kept = sorted(folder.glob("tile-*.npz"))
        assert len(kept) == 1
        before = kept[0].stat().st_mtime_ns
        again = attractor_atlas(scaled_logistic(), *axes, states, max_periods=60, curves=0, checkpoint=folder)
    finally:
        set_threads(None)
    assert kept[0].stat().st_mtime_ns == before
    for name in ("rows", "columns", "kind", "period", "points", "counts", "family", "undecided"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    kept[0].write_bytes(b"damaged")
    repaired = attractor_atlas(scaled_logistic(), *axes, states, max_periods=60, curves=0, checkpoint=folder)
    np.testing.assert_array_equal(repaired.counts, whole.counts)
    with pytest.raises(ValueError, match="belongs to another run, with max_periods=60"):
        attractor_atlas(scaled_logistic(), *axes, states, max_periods=61, curves=0, checkpoint=folder)
