"""Basins come to an end: known chaotic attractors are recognised, sweeps are bounded, undecided orbits have reasons."""

import warnings
from dataclasses import replace
from math import cos, cosh, exp, pi, sin, sinh, sqrt

import numpy as np
import pytest
from known_basins import assert_same
from small_maps import ends_of

import systems
from cellmap import (
    CellGrid,
    Label,
    angle,
    discrete_map,
    find_attractors,
    find_basins,
    load_basins,
    save_basins,
)
from cellmap.attractors import search
from cellmap.attractors.kinds import chaos
from cellmap.attractors.kinds.chaos import examine
from cellmap.attractors.kinds.equilibria import sticking_sets
from cellmap.attractors.kinds.transients import Reason
from cellmap.attractors.regions.boxes import RESIDENCE
from cellmap.basins import UnsettledWarning, recompute_basins, refine_basins
from cellmap.basins.run import _REPEATS, Run
from cellmap.orbits import Kind

LOGISTIC = systems.logistic_map(3.9)
HENON = systems.henon_map()
LINE, PLANE = CellGrid((0.0,), (1.0,), (50,)), CellGrid((-0.5, -0.2), (0.5, 0.2), (20, 20))


@pytest.fixture
def sweeps(monkeypatch):
    """The sweeps of a run, as they are made."""
    made = []
    label = Run._label

    def counted(self, now, states):
        made.append(now)
        return label(self, now, states)

    monkeypatch.setattr(Run, "_label", counted)
    return made


def twofold(x, p):
    """Henon's map beside a coordinate that creeps to -1 or 1: two chaotic attractors after long chaotic transients."""
    return 1 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0], x[2] + p.rate * (x[2] - x[2] ** 3)


def fading(x, p):
    """Henon's map with a = above + range s, where s tends to 0."""
    return 1 - (p.above + p.range * x[2]) * x[0] ** 2 + x[1], 0.3 * x[0], p.keep * x[2]


TWOFOLD = discrete_map(twofold, {"rate": 0.004}, ("x", "y", "s"))


def tent(x, p):
    """Chaos on [0, 1], where exp(-1 / life) of all orbits are still after each step; the others rest at 3."""
    return (2.0 * exp(1.0 / p.life) * min(x[0], 1.0 - x[0]) if 0.0 <= x[0] <= 1.0 else 1.5 + 0.5 * x[0],)


FADING = discrete_map(fading, {"above": 1.4, "range": -0.3, "keep": 0.99}, ("x", "y", "s"))
CREEPING = CellGrid((-0.5, -0.1, -1.5), (0.5, 0.1, 1.5), (4, 4, 8))
FADING_FROM = np.random.default_rng(0).uniform([-0.1, -0.1, 1.0], [0.1, 0.1, 1.0], (20, 3))


# --- the search ends


@pytest.mark.parametrize("max_periods", [5, 64, 65])
@pytest.mark.parametrize(
    ("chaotic", "grid"), [(LOGISTIC, LINE), pytest.param(HENON, PLANE, marks=pytest.mark.thorough)]
)
def test_a_known_chaotic_attractor_is_recognised(chaotic, grid, max_periods, sweeps) -> None:
    """Nothing can stay for 64 periods within fewer; from 65 on everything is decided."""
    basins = find_basins(chaotic, grid, max_periods=max_periods)
    assert len(sweeps) <= 3
    assert len(basins.attractors) <= 1
    if max_periods < RESIDENCE - 1:
        assert (basins.labels == Label.UNDECIDED).all()
    if max_periods > RESIDENCE:
        assert (basins.labels == 0).all()
    assert set(basins.undecided) <= {Reason.KNOWN}
    assert sum(basins.undecided.values()) == min(np.count_nonzero(basins.labels == Label.UNDECIDED), 32)


def test_chaotic_transients_to_known_chaotic_attractors_are_no_attractors(sweeps) -> None:
    """From s = 0.19 an orbit is more than 0.1 away from 1 for 600 periods; none is assigned to the other side."""
    basins = find_basins(TWOFOLD, CREEPING, max_periods=300)
    assert len(sweeps) <= 4
    assert [a.kind for a in basins.attractors] == [Kind.CHAOTIC] * 2
    s = CREEPING.centres()[..., 2]
    decided = basins.labels >= 0
    side = np.array([np.sign(a.points[0, 2]) for a in basins.attractors])
    assert (side[basins.labels[decided]] == np.sign(s[decided])).all()
    assert (basins.labels[np.abs(s) < 0.5] == Label.UNDECIDED).all()
    assert set(basins.undecided) <= {Reason.TRANSIENT, Reason.KNOWN}
    assert basins.undecided[Reason.TRANSIENT] > 0


def test_sweeps_are_bounded_whatever_is_found(sweeps, monkeypatch) -> None:
    """A search that claims a new attractor each time: a pass that decides nothing new is the last."""
    real = search.examine
    monkeypatch.setattr(search, "examine", lambda ends, *late: real(replace(ends, known=()), *late))
    find_basins(LOGISTIC, LINE, max_periods=20)
    assert len(sweeps) == 2


def test_chaos_that_fades_is_no_attractor() -> None:
    """From a = 1.4 down to 0.2, where a fixed point attracts: chaotic for a while, and periodic later."""
    fades = FADING.with_params(above=0.2, range=1.2, keep=0.9995)
    found = examine(ends_of(fades, fades.iterate(FADING_FROM, 50).points, 50))
    assert found.attractors == ()
    assert len(found.reasons) == len(FADING_FROM)


# --- why orbits are undecided

# Of the standard map a few orbits are on islands; each of a rotation is on a circle of its own; the exponents of the
# torus are 0, 0, 0 and -log(2).
REASONS = {
    Reason.CONSERVATIVE: (
        lambda x, p: (x[0] + x[1] + 5.0 * sin(x[0]), x[1] + 5.0 * sin(x[0])),
        (angle("a"), angle("b")),
        pi,
    ),
    Reason.PRESERVED: (lambda x, p: (0.6 * x[0] - 0.8 * x[1], 0.8 * x[0] + 0.6 * x[1]), ("x", "y"), 1),
    Reason.TORUS: (
        lambda x, p: (x[0] + sqrt(2.0), x[1] + sqrt(3.0), x[2] + sqrt(5.0), 0.5 * x[3]),
        (angle("a"), angle("b"), angle("c"), "z"),
        1,
    ),
    Reason.PERIODIC: (lambda x, p: (x[0] + pi,), (angle("a"),), pi),
    Reason.CREEPING: (lambda x, p: (x[0] - x[0] ** 3,), ("x",), 0.5),
}


@pytest.mark.parametrize("reason", REASONS)
def test_reasons(reason) -> None:
    function, coordinates, half = REASONS[reason]
    d = len(coordinates)
    grid = CellGrid((-half,) * d, (half,) * d, (8, 8, 1, 1)[:d])
    basins = find_basins(discrete_map(function, {}, coordinates), grid, 300)
    assert sum(basins.undecided.values()) == min(8**d, 32)
    assert basins.undecided[reason] > 25 or basins.undecided == {reason: 8}


def test_a_chaotic_orbit_that_comes_back_by_chance_is_on_no_periodic_orbit() -> None:
    """Beside the fixed point 3/4 of 4 x (1 - x), where distances double: the first step is one of 3e-8."""
    _, found = chaos.tested(systems.logistic_map(4.0), np.array([[0.75], [0.75 + 1e-8]]), np.ones(1), 300)
    assert found.tolist() == [Reason.PERIODIC, Reason.TRANSIENT]


def test_reasons_are_kept_in_files(tmp_path) -> None:
    basins = find_basins(HENON, PLANE, max_periods=20, checkpoint=tmp_path / "kept.h5")
    assert basins.undecided == {Reason.KNOWN: 32}
    again = find_basins(HENON, PLANE, max_periods=20, checkpoint=tmp_path / "kept.h5")
    saved = load_basins(save_basins(basins, tmp_path / "saved.h5"))
    assert basins.undecided == again.undecided == saved.undecided == find_basins(HENON, PLANE, max_periods=20).undecided


# --- tiny windows near a Julia set, from which orbits go to sinks far away


def holomorphic(x, p):
    """z + c sin z: sinks at the odd multiples of pi, with the multiplier 1 - c, and a repelling fixed point at 0."""
    s, c = sin(x[0]) * cosh(x[1]), cos(x[0]) * sinh(x[1])
    return x[0] + p.re * s - p.im * c, x[1] + p.re * c + p.im * s


SINKS = discrete_map(holomorphic, {"re": 0.5 * cos(0.5), "im": 0.5 * sin(0.5)}, ("x", "y"))
TINY = 5.4e-12


def test_a_sink_is_no_sticking_set_in_a_tiny_window() -> None:
    """A step of 1e-18 is lost in rounding at pi, and not at 0: the point would rest along one axis only."""
    sinks = np.array([[k * pi, 0.0] for k in (1, -3, 7)])
    assert sticking_sets(SINKS, sinks, np.full(2, 2 * TINY)) == []


def test_a_sink_far_away_from_a_tiny_window() -> None:
    """Rounding at 1053 pi is a sixth of half the window."""
    ic = SINKS.iterate([[-1053 * pi + 0.3, 0.2]], 60).points
    (sink,) = find_attractors(SINKS, np.concatenate([ic, ic + TINY]), max_periods=300)
    assert sink.kind is Kind.FIXED_POINT
    assert sink.points[0] == pytest.approx([-1053 * pi, 0.0], abs=1e-11)
    assert np.abs(sink.multipliers) == pytest.approx([0.6102601397] * 2, abs=1e-9)


def test_sinks_of_a_tiny_window_are_listed_once(sweeps) -> None:
    """Around the repelling fixed point at 0 a 60 x 60 window reaches 24 sinks, all at odd multiples of pi."""
    with pytest.warns(UserWarning, match="23 of 24 attractors, .* moved by multiples of 2 pi in x"):
        basins = find_basins(SINKS, CellGrid((-TINY, -TINY), (TINY, TINY), (60, 60)))
    assert {a.kind for a in basins.attractors} == {Kind.FIXED_POINT}
    places = np.array([a.points[0, 0] for a in basins.attractors]) / pi
    assert places == pytest.approx(np.round(places), abs=1e-9)
    assert (np.round(places) % 2 == 1).all()
    assert len(set(np.round(places))) == len(places) == 24
    assert len(sweeps) <= 3 * (_REPEATS + 1)


def test_few_orbits_that_are_left_are_followed_on():
    """Of a transient with a lifetime of 600 steps exp(-2000 / 600) is left at the limit; one of 10,000 stays."""
    states = np.random.default_rng(3).random((4000, 1))
    short, long = (discrete_map(tent, {"life": life}, ("x",)) for life in (600.0, 1e4))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnsettledWarning)
        limited, basins = find_basins(short, states, 2000), find_basins(short, states)
        lasting = find_basins(long, states)
    left, share = limited.labels == Label.UNDECIDED, exp(-2000 / 600)
    assert abs(left.mean() - share) < 4.0 * sqrt(share / 4000)
    assert (basins.labels == 0).all() and basins.undecided == {} and basins.settings["max_periods"] == 8000
    assert np.array_equal(basins.settling_time[~left], limited.settling_time[~left])
    assert basins.settling_time[left].min() > 2000
    assert lasting.settings["max_periods"] == 2000 and (lasting.labels < 0).mean() > 0.75
    assert_same(recompute_basins(basins, short), basins)
    *_, last = refine_basins(short, states)
    assert_same(last.basins, basins)
