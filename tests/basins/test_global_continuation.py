"""Basins against a parameter: reference counts, births and deaths of attractors, labels that persist, interruption."""

import pickle
from dataclasses import replace
from math import cos, pi, sin, sqrt, tanh

import matplotlib as mpl
import numpy as np
import pytest

import systems
from cellmap import CellGrid, Label, discrete_map, plot, stroboscopic_map
from cellmap.basins import ContinuationInterrupt, continue_basins
from cellmap.basins import continuation as global_continuation
from cellmap.orbits import Kind

mpl.use("Agg")

PENDULUM = stroboscopic_map(systems.driven_pendulum())
WINDOW = (-pi, -500.0), (pi, 500.0)
BIRTH = 1.731758671939e-3  # of the rotations, in m (REFERENCES.md)
REFERENCE = np.array([25484, 6152, 4182, 4182])  # at 3 mm, of 40,000 cells (REFERENCES.md)


def wells(x, p):
    return (tanh(p.a * x[0]),)


def tilted(x, p):
    """Steps downhill in x^4/4 - x^2/2 - t x with t = 0.6 - c^2: two wells where abs(t) < 2/sqrt(27)."""
    return (x[0] + 0.2 * (x[0] - x[0] ** 3 + 0.6 - p.c * p.c),)


def parabola(x, p):
    return (x[0] * x[0] + p.c,)


TILTED = discrete_map(tilted, {"c": 0.0}, ("x",), "tilted wells")
LINE = CellGrid((-2.0,), (2.0,), (100,))
SWEEP = np.linspace(-1.0, 1.0, 21)


# --- the report's pendulum


@pytest.fixture(scope="module")
def pendulum():
    """Downwards from 3 mm, past the births of the inverted state and of the rotations."""
    values = np.array([3e-3, 2.4e-3, 2.2e-3, 1.8e-3, BIRTH * (1 + 1e-5), BIRTH * (1 - 1e-5)])
    return continue_basins(PENDULUM, "amplitude", values, CellGrid(*WINDOW, (50, 50)))


def test_fractions_are_those_of_the_reference(pendulum):
    """The reference counts are of other, finer cells: within four standard errors."""
    expected = REFERENCE / REFERENCE.sum()
    assert 0 < pendulum.cost.seconds < 600
    assert pendulum.labels == (0, 1, 2, 3)
    assert (np.abs(pendulum.fractions[0] - expected) < 4 * pendulum.standard_errors[0]).all()
    assert pendulum.standard_errors[0] == pytest.approx(np.sqrt(expected * (1 - expected) / 2500), rel=0.05)
    assert (pendulum.counts.sum(axis=1) == 2500).all()


def test_attractors_are_there_between_birth_and_death(pendulum):
    """The inverted state is stable from 2.329021135978 mm, the rotations are born at BIRTH (REFERENCES.md)."""
    assert pendulum.present[:, 0].all()
    assert (pendulum.present[:, 1] == (pendulum.values > 2.329021135978e-3)).all()
    for label in (2, 3):
        assert (pendulum.present[:, label] == (pendulum.values > BIRTH)).all()
    assert (pendulum.counts[:, 2] == pendulum.counts[:, 3]).all()
    # Close to their birth the rotations own 2 cells in 40,000, and at most one of these 3,600.
    k = np.argmin(np.abs(pendulum.values - BIRTH * (1 + 1e-5)))
    assert (pendulum.counts[k, 2:] <= 1).all() and pendulum.present[k, 2:].all()
    for found in pendulum.attractors:
        assert all(found[label].rotations == ((0, 0, 1, -1)[label], 0) for label in found)
    assert [pendulum.label_name(k) for k in pendulum.labels] == [
        "fixed point (0, 0)",
        "fixed point (π, 0)",
        "rotating, period 1, winding number +1",
        "rotating, period 1, winding number -1",
    ]


# --- labels


@pytest.fixture(scope="module")
def tilted_sweep():
    return continue_basins(TILTED, "c", SWEEP, LINE)


def test_attractor_that_comes_back_has_its_old_label(tilted_sweep):
    """The left well is there where 0.6 - c^2 < 2/sqrt(27), the right one where it is above -2/sqrt(27)."""
    tilt = 0.6 - SWEEP**2
    edge = 2 / sqrt(27)
    assert tilted_sweep.labels == (0, 1)
    assert (tilted_sweep.present[:, 0] == (tilt < edge)).all()
    assert (tilted_sweep.present[:, 1] == (tilt > -edge)).all()
    assert not tilted_sweep.present[:, 0].all()
    for found in tilted_sweep.attractors:
        assert all(np.sign(a.points[0, 0]) == (-1, 1)[label] for label, a in found.items())


def test_fractions_of_wells(tilted_sweep):
    """The ridge between the wells is the middle root of x - x^3 + t."""
    for c, fractions, found in zip(SWEEP, tilted_sweep.fractions, tilted_sweep.attractors, strict=True):
        if len(found) == 2:
            ridge = np.sort(np.roots([-1.0, 0.0, 1.0, 0.6 - c * c]).real)[1]
            assert fractions == pytest.approx([(ridge + 2) / 4, (2 - ridge) / 4], abs=0.5 / 100 + 1e-9)


@pytest.mark.parametrize("direction", [1, -1])
def test_pitchfork(direction):
    """tanh(a x): 0 up to a = 1, then two wells, which in one step are farther from 0 than the threshold."""
    values = np.array([0.5, 0.8, 1.5, 2.0])[::direction]
    sweep = continue_basins(discrete_map(wells, {"a": 1.0}, ("x",)), "a", values, CellGrid((-1,), (1,), (100,)))
    assert (sweep.counts.sum(axis=1) == 100).all()
    assert sweep.labels == (0, 1, 2)
    one = np.array([[100, 0, 0], [0, 50, 50]]) if direction == 1 else np.array([[50, 50, 0], [0, 0, 100]])
    assert sweep.counts.tolist() == np.repeat(one, 2, axis=0).tolist()


def test_cascade_to_chaos_is_one_attractor():
    """Logistic map: doublings change no label, nor does chaos in a band that the cycle grew into."""
    sweep = continue_basins(
        systems.logistic_map(), "mu", [3.3, 3.4, 3.5, 3.55, 3.59], CellGrid((0.0,), (1.0,), (50,)), max_periods=500
    )
    assert sweep.labels == (0,)
    assert (sweep.fractions == 1.0).all()
    assert [found[0].period for found in sweep.attractors] == [2, 2, 4, 8, 0]
    assert sweep.attractors[-1][0].kind is Kind.CHAOTIC
    assert len(sweep.attractors[-1][0].points) <= 1024


# --- orbits without an attractor


def test_initial_conditions_without_an_attractor_have_their_own_labels():
    """x^2 + c has bounded orbits in abs(x) < (1 + sqrt(1 - 4 c))/2, for c from -2 to 1/4."""
    values = np.array([-0.5, 0.0, 0.2, 0.5])
    sweep = continue_basins(discrete_map(parabola, {"c": 0.0}, ("x",)), "c", values, LINE)
    assert sweep.labels == (0, Label.DIVERGED)
    assert sweep.label_name(Label.DIVERGED) == "diverged"
    bounded = np.where(values < 0.25, (1 + np.sqrt(np.maximum(1 - 4 * values, 0))) / 4, 0.0)
    assert sweep.fractions[:, 0] == pytest.approx(bounded, abs=1 / 100 + 1e-9)
    assert (sweep.counts.sum(axis=1) == 100).all()
    assert sweep.present.tolist() == [[True, True]] * 3 + [[False, True]]


def test_undecided_initial_conditions_are_counted():
    """A turned plane that shrinks to its fixed point, and one that keeps its circles, of which none attracts."""

    def rotated(x, p):
        return p.rate * (cos(1.0) * x[0] - sin(1.0) * x[1]), p.rate * (sin(1.0) * x[0] + cos(1.0) * x[1])

    maps = discrete_map(rotated, {"rate": 0.0}, ("x", "y"))
    sweep = continue_basins(maps, "rate", [0.5, 1.0], CellGrid((-1, -1), (1, 1), (6, 6)), max_periods=200)
    assert sweep.labels == (0, Label.UNDECIDED)
    assert sweep.counts.tolist() == [[36, 0], [0, 36]]


# --- tables, threads, interruption


def test_interruption_keeps_what_is_done(monkeypatch, tilted_sweep):
    whole, calls = global_continuation.find_basins, []

    def interrupted(*arguments, **options):
        calls.append(1)
        if len(calls) == 8:
            raise KeyboardInterrupt
        return whole(*arguments, **options)

    monkeypatch.setattr(global_continuation, "find_basins", interrupted)
    with pytest.raises(KeyboardInterrupt) as stop:
        continue_basins(TILTED, "c", SWEEP, LINE)
    assert isinstance(stop.value, ContinuationInterrupt)
    partial = pickle.loads(pickle.dumps(stop.value.partial))
    assert partial.values.tolist() == SWEEP[:7].tolist()
    assert (partial.counts == tilted_sweep.counts[:7]).all()
    rest = continue_basins(TILTED, "c", SWEEP, LINE, resume=partial)
    assert len(calls) == 8 + len(SWEEP) - 7
    assert rest.labels == tilted_sweep.labels and (rest.counts == tilted_sweep.counts).all()
    for found, expected in zip(rest.attractors, tilted_sweep.attractors, strict=True):
        assert {k: a.points.tolist() for k, a in found.items()} == {k: a.points.tolist() for k, a in expected.items()}
    assert rest.cost.steps == tilted_sweep.cost.steps


MORE = discrete_map(tilted, {"c": 0.0, "d": 0.0}, ("x",), "tilted wells")
UNFIT = {
    "other parameters": {"parameter": "d"},
    "other initial_conditions": {"initial_conditions": [[0.1]]},
    "other settings": {"max_periods": 7},
    "other values": {"values": SWEEP[1:]},
    "other system": {"point_map": discrete_map(tilted, {"c": 0.0, "d": 0.0}, ("x",), "wells")},
    "values goes up and down": {"values": [0.0, 1.0, 0.5]},
    "give a list of at least one value": {"values": 0.5},
    "initial_conditions has shape": {"initial_conditions": [0.1, 0.2]},
    "initial_conditions has 2 axes": {"initial_conditions": CellGrid((0, 0), (1, 1), (2, 2))},
    "take fewer initial conditions": {"initial_conditions": CellGrid((-2.0,), (2.0,), (10**13,))},
}


@pytest.mark.parametrize("message", UNFIT)
def test_arguments_and_a_result_to_resume_have_to_fit(tilted_sweep, message):
    given = {"point_map": MORE, "parameter": "c", "values": SWEEP, "initial_conditions": LINE}
    with pytest.raises((TypeError, ValueError, MemoryError), match=message):
        continue_basins(**(given | {"resume": replace(tilted_sweep, params={"d": 0.0})} | UNFIT[message]))


def test_figure(tilted_sweep):
    upper, lower = plot.basin_continuation(tilted_sweep)
    assert len(upper.collections) == 2
    assert [line.get_xdata().size for line in lower.get_lines()] == tilted_sweep.present.sum(axis=0).tolist()
    assert (lower.get_xlabel(), lower.get_ylabel()) == ("$c$", "$x$")
    with pytest.raises(ValueError, match="coordinate='y'"):
        plot.basin_continuation(tilted_sweep, coordinate="y")
    with pytest.raises(ValueError, match="no values"):
        plot.basin_continuation(
            replace(tilted_sweep, values=np.empty(0), counts=np.empty((0, 2), np.int64), attractors=())
        )
