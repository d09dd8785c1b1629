"""Labels of arbitrary points from known basins, final states by rules, and basins recomputed from their settings."""

import pickle
import re
from dataclasses import replace
from math import tanh

import numpy as np
import pytest

from cellmap import (
    Attractor,
    CellGrid,
    Label,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    save_basins,
)
from cellmap.analysis.resilience import basin_stability, settling_statistics
from cellmap.basins import classify_by_features, recompute_basins
from cellmap.basins.classification import chosen_coordinates, labeller, own_label, places_of, scale_of, span_of
from cellmap.basins.final_states import _coarse, final_states
from cellmap.orbits import InvariantTorus, Kind
from cellmap.orbits.attractor import distinct_names

WELLS = discrete_map(lambda x, p: (tanh(p.a * x[0]), 0.5 * x[1]), {"a": 1.5}, ("x", "y"))
GRID = CellGrid((-2.0, -1.0), (2.0, 1.0), (20, 6))


@pytest.fixture(scope="module")
def basins():
    return find_basins(WELLS, GRID, max_periods=300)


# --- keys and windows that are none


def test_a_key_that_is_missing_is_an_error_that_names_all(basins):
    second = distinct_names(basins.attractors)[1]
    told = pickle.loads(pickle.dumps(basins.fractions))
    grouped = classify_by_features(WELLS, np.linspace(-1.0, 1.0, 24).repeat(2).reshape(-1, 2), lambda o: o.points[-1])
    stability = basin_stability(basins, n_samples=20)
    settled = settling_statistics(basins)
    for name, keyed in {
        "fractions": told,
        "fractions ": stability.fractions,
        "exponents": stability.exponents,
        "basins": settled.basins,
    }.items():
        with pytest.raises(
            KeyError, match=rf"{name.strip()}\['sink'\]: choose one of 0 \(.*, 1 \({re.escape(second)}\)"
        ):
            keyed["sink"]
        assert keyed == {0: keyed[0], 1: keyed[1]}
    for name, keyed in {"params": basins.params, "params ": WELLS.params, "others": settled.others}.items():
        with pytest.raises(KeyError, match=rf"{name.strip()}\['sink'\]: choose one of '(a|escaped)'"):
            keyed["sink"]
    with pytest.raises(KeyError, match=r"fractions\[7\]: choose one of 0 \(group 0\)"):
        grouped.fractions[7]


# --- labels of points


def test_points_have_the_label_of_the_well_on_their_side(basins):
    label = labeller(basins)
    points = np.array([[0.7, 0.3], [-0.01, 5.0], [1e-3, 0.0], [-9.0, 0.0]])
    side = [np.sign(basins.attractors[k].points[0, 0]) for k in label(points)]
    assert side == [1, -1, 1, -1]
    assert label.max_periods == 300
    assert labeller(basins, max_periods=7).max_periods == 7
    assert labeller(WELLS, basins.attractors).max_periods == 2000
    assert labeller(basins, max_periods=1)(np.array([[1e-9, 0.0]])).tolist() == [Label.UNDECIDED]
    assert label.settle(points).times[0] < label.settle(points).times[2]


def test_the_exact_map_labels_unless_another_is_given(basins):
    table = interpolated_map(WELLS, CellGrid((-2.0, -1.0), (2.0, 1.0), (32, 16)))
    coarse = replace(basins, point_map=table)
    assert labeller(coarse).point_map is WELLS
    assert labeller(coarse, point_map=table).point_map is table
    assert labeller(WELLS, basins.attractors, point_map=table).point_map is table
    assert labeller(replace(basins, point_map=None), point_map=WELLS).attractors == basins.attractors


def test_labels_of_basins(basins):
    assert [own_label(basins, k) for k in (0, 1, np.int16(1))] == [0, 1, 1]
    for bad in (-1, 2, np.int64(-3)):
        with pytest.raises(ValueError, match=f"label={bad!r}".replace("(", r"\(").replace(")", r"\)")):
            own_label(basins, bad)
    with pytest.raises(TypeError, match=r"which=0\.5"):
        own_label(basins, 0.5, "which")


def test_units_of_length_and_coordinates():
    axes = WELLS.coordinates
    assert [chosen_coordinates("along", given, axes).tolist() for given in (None, "y", ("y", 0))] == [
        [0, 1],
        [1],
        [0, 1],
    ]
    with pytest.raises(ValueError, match="along='z': the coordinates are"):
        chosen_coordinates("along", "z", axes)
    span = np.array([4.0, 2.0])
    assert scale_of(None, axes, span).tolist() == [4.0, 2.0]
    assert scale_of(3, axes, span).tolist() == [3.0, 3.0]
    assert scale_of([1.0, 2.0], axes, None).tolist() == [1.0, 2.0]
    for bad in (0.0, -1.0, [1.0], [1.0, 1e-151], [1.0, 1e151]):
        with pytest.raises(ValueError, match="scale="):
            scale_of(bad, axes, span)
    assert scale_of(1e-149, axes, span)[0] == 1e-149 and scale_of(1e149, axes, span)[0] == 1e149
    with pytest.raises(ValueError, match="scale is missing"):
        scale_of(None, axes, None)


def test_places_of_initial_conditions(basins):
    assert np.array_equal(places_of(basins), GRID.centres().reshape(-1, 2))
    assert span_of(basins).tolist() == [4.0, 2.0]
    given = find_basins(WELLS, np.arange(12.0).reshape(2, 3, 2) / 12)
    assert np.array_equal(places_of(given), np.arange(12.0).reshape(6, 2) / 12)
    assert span_of(given) is None


# --- final states


def test_final_states_are_those_of_basins_or_of_a_search(basins):
    own = final_states(basins, None, (), None, 200)
    assert own.region == GRID and own.attractors == basins.attractors and own.point_map is WELLS
    assert own.label.max_periods == 200
    found = final_states(WELLS, GRID, (), None, 200)
    assert [a.points[0, 0] for a in found.attractors] == pytest.approx([a.points[0, 0] for a in basins.attractors])
    smaller = CellGrid((0.0, 0.0), (1.0, 1.0), (4, 1))
    one = final_states(basins, smaller, basins.attractors[:1], None, 9)
    assert one.region == smaller and one.attractors == basins.attractors[:1]


def test_a_rule_takes_the_place_of_attractors():
    rule = final_states(WELLS, GRID, (), lambda x: np.where(x[:, 0] > 0.5, 7, -1), 100)
    assert rule.attractors == ()
    assert rule.label(np.array([[0.6, 0.0], [0.1, 0.0], [-0.1, 0.0]])).tolist() == [7, 7, Label.UNDECIDED]
    for bad in (lambda x: x, lambda x: x[:, 0], lambda x: np.zeros(len(x) + 1, int)):
        with pytest.raises(ValueError, match="return one whole number for each"):
            final_states(WELLS, GRID, (), bad, 100).label(np.zeros((3, 2)))


def test_attractors_are_sought_from_some_four_thousand_cells():
    """Along the axes that a region spans, in equal parts: 4096, 64 x 64."""
    assert _coarse(CellGrid((0.0, 1.0), (1.0, 2.0), (500, 1))).shape == (4096, 1)
    assert _coarse(CellGrid((0.0, 1.0), (1.0, 2.0), (5, 2))) == CellGrid((0.0, 1.0), (1.0, 2.0), (64, 64))
    assert _coarse(CellGrid((0.0,) * 13, (1.0,) * 13, (3,) * 13)).shape == (2,) * 13


@pytest.mark.parametrize("given", [GRID, np.random.default_rng(0).uniform(-1, 1, (3, 5, 2))], ids=["grid", "points"])
@pytest.mark.parametrize("by_table", [False, True])
def test_basins_are_recomputed_from_a_file(given, by_table, tmp_path):
    window = CellGrid((-2.0, -1.0), (2.0, 1.0), (32, 16))
    point_map = interpolated_map(WELLS, window) if by_table else WELLS
    first = find_basins(point_map, given, max_periods=77, longest_period=3)
    again = recompute_basins(load_basins(save_basins(first, tmp_path / "first.h5")), WELLS)
    assert np.array_equal(again.labels, first.labels) and np.array_equal(again.settling_time, first.settling_time)
    assert dict(again.settings) == dict(first.settings)
    assert (again.point_map.table is not None) == by_table


RENAMED = discrete_map(lambda x, p: (tanh(p.a * x[0]), 0.5 * x[1]), {"a": 1.5}, ("x", "z"))
DOUBLING = discrete_map(lambda x, p: (2.0 * x[0] + 1.0,), {}, ("x",))
REFUSED = {
    "recompute_basins": lambda basins: labeller(replace(basins, point_map=None)),
    "attractors is empty": lambda _: labeller(WELLS),
    "leave them out": lambda basins: labeller(basins, basins.attractors),
    "source=3": lambda _: labeller(3),
    "source=[3]": lambda _: final_states(3, GRID, (), None, 100),
    "region=None": lambda _: final_states(WELLS, None, (), None, 100),
    "outcome=3": lambda _: final_states(WELLS, GRID, (), 3, 100),
    "is one cell": lambda _: final_states(WELLS, CellGrid((0.0, 0.0), (1.0, 1.0), (1, 1)), (), None, 100),
    "define the final states with outcome=": lambda _: final_states(DOUBLING, CellGrid((0,), (1,), (4,)), (), None, 50),
    "basins have no map": lambda basins: final_states(replace(basins, point_map=None), None, (), None, 50),
    r"source has params \{'a': 1.4\} and the basins \{'a': 1.5\}": lambda basins: recompute_basins(
        basins, WELLS.with_params(a=1.4)
    ),
    r"source has the coordinates \(.*z.*\) and the basins": lambda basins: recompute_basins(basins, RENAMED),
    "are from a simple cell mapping": lambda basins: recompute_basins(
        replace(basins, settings={**basins.settings, "method": "simple cell mapping"}), WELLS
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_does_not_fit_together(message, basins):
    with pytest.raises((TypeError, ValueError), match=message):
        REFUSED[message](basins)


def test_tori_in_files(basins, tmp_path):
    rng = np.random.default_rng(1)
    numbers = (rng.uniform(size=2) for _ in range(4))
    torus = InvariantTorus(*numbers, rng.normal(size=(2, 5, 5)) + 1j * rng.normal(size=(2, 5, 5)), 1e-7)
    record = basins.attractors[0]
    quasi = Attractor(
        *(Kind.QUASIPERIODIC, 0, rng.normal(size=(9, 2)), (0, 0), np.empty(0, complex), np.zeros(2)),
        record.coordinates,
        torus=torus,
    )
    saved = save_basins(replace(basins, attractors=(quasi, *basins.attractors[1:])), tmp_path / "torus.h5")
    read = load_basins(saved).attractors[0].torus
    for name in ("frequencies", "frequency_errors", "rotation_numbers", "rotation_errors", "coefficients"):
        assert np.array_equal(getattr(read, name), getattr(torus, name)), name
    assert read.invariance_error == 1e-7
    for bad in (torus.coefficients[:, :4, :4], torus.coefficients[:, :3]):
        wrong = replace(quasi, torus=replace(torus, coefficients=bad))
        path = save_basins(replace(basins, attractors=(wrong, *basins.attractors[1:])), tmp_path / "bad.h5")
        with pytest.raises((ValueError, OSError), match=r"Fourier coefficients of shape \(2, [43], [45]\)"):
            load_basins(path)
