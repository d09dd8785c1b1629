"""Maps from their recipes, and basins from what is stored of them."""

from __future__ import annotations

import json
from math import pi

import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    save_basins,
    stroboscopic_map,
)
from cellmap.basins import recompute_basins
from cellmap.maps import rebuild_map
from cellmap.sets import simple_cell_mapping

PENDULUM = systems.driven_pendulum()
WINDOW = CellGrid((-pi, -300.0), (pi, 300.0), (48, 40))
INITIAL_CONDITIONS = np.random.default_rng(0).uniform([-pi, -300.0], [pi, 300.0], (200, 2))


def strobe(**options):
    return stroboscopic_map(PENDULUM, **options)


MAPS = {
    "stroboscopic": (PENDULUM, strobe),
    "phase and tolerance": (PENDULUM, lambda: strobe(phase=0.3, rtol=1e-6, atol=1e-7)),
    "DOP853": (PENDULUM, lambda: strobe(method="DOP853")),
    "RK45, few steps": (PENDULUM, lambda: strobe(method="RK45", rtol=1e-5, atol=1e-5, max_steps=500)),
    "table": (PENDULUM, lambda: interpolated_map(strobe(), WINDOW, outside="escape")),
    "table, integrate": (PENDULUM, lambda: interpolated_map(strobe(phase=0.5), WINDOW, 3, "integrate", 0.01)),
    "bilinear": (PENDULUM, lambda: interpolated_map(strobe(rtol=1e-5), WINDOW, 1, "escape")),
    "discrete": (systems.henon_map(), systems.henon_map),
    "table of a discrete map": (
        systems.henon_map(),
        lambda: interpolated_map(systems.henon_map(), CellGrid((-2, -2), (2, 2), (30, 30)), outside="escape"),
    ),
}


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("name", MAPS)
def test_map_from_its_recipe_has_the_same_bits(name):
    source, make = MAPS[name]
    original = make()
    recipe = json.loads(json.dumps(original.recipe))  # as it comes from a file
    again = rebuild_map(source, recipe)
    initial_conditions = INITIAL_CONDITIONS * ([1.0, 1.0] if source is PENDULUM else [0.3, 0.003])
    ours, theirs = again.iterate(initial_conditions, 3), original.iterate(initial_conditions, 3)
    assert np.array_equal(ours.points, theirs.points, equal_nan=True)
    assert np.array_equal(ours.rotations, theirs.rotations)
    assert np.array_equal(ours.status, theirs.status)
    assert json.loads(json.dumps(again.recipe)) == recipe
    if original.table is not None:
        assert np.array_equal(again.table.coefficients, original.table.coefficients)
        assert np.array_equal(again.table.fallback, original.table.fallback)


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
@pytest.mark.parametrize("initial_conditions", ["grid", "points"])
@pytest.mark.parametrize("name", ["stroboscopic", "table", "table, integrate", "discrete"])
def test_stored_basins_and_their_system_give_the_same_labels_again(name, initial_conditions, tmp_path):
    source, make = MAPS[name]
    window = WINDOW if source is PENDULUM else CellGrid((-2.0, -2.0), (2.0, 2.0), (48, 40))
    basins = find_basins(
        make(), window if initial_conditions == "grid" else window.centres()[::3], max_periods=1500, longest_period=8
    )
    stored = load_basins(save_basins(basins, tmp_path / "b.h5"))
    again = recompute_basins(stored, source)
    assert np.array_equal(again.labels, stored.labels)
    assert np.array_equal(again.settling_time, stored.settling_time)
    assert [a.name for a in again.attractors] == [a.name for a in stored.attractors]
    assert all(np.array_equal(a.points, b.points) for a, b in zip(again.attractors, stored.attractors, strict=True))
    assert again.point_map is not None
    assert (again.settings["max_periods"], again.settings["longest_period"]) == (1500, 8)


def test_rebuilt_map_verifies_stored_basins(tmp_path):
    basins = find_basins(interpolated_map(strobe(), WINDOW, outside="integrate"), WINDOW)
    again = recompute_basins(load_basins(save_basins(basins, tmp_path / "b.h5")), PENDULUM)
    assert again.verify(100).wrong == 0


def test_period_that_follows_a_parameter():
    system = systems.driven_pendulum(frequency=40.0)
    original = stroboscopic_map(system)
    assert rebuild_map(system, original.recipe)([1.0, 2.0]) == pytest.approx(original([1.0, 2.0]), abs=0)


# --- a source that is not the one of the recipe


def test_other_parameters_are_refused(tmp_path):
    basins = find_basins(strobe(), INITIAL_CONDITIONS[:5])
    with pytest.raises(ValueError, match=r"source has params .*0\.004.* and the basins .*0\.003"):
        recompute_basins(basins, systems.driven_pendulum(amplitude=0.004))


def test_other_period_is_refused():
    with pytest.raises(ValueError, match=r"source has the period 0\.025.*: give the same parameters"):
        rebuild_map(systems.driven_pendulum(frequency=40.0), strobe().recipe)


def test_other_coordinates_are_refused():
    """The same parameters, but an angle that is none, or another dimension."""
    basins = find_basins(strobe(), INITIAL_CONDITIONS[:5])
    line = ForcedSystem(PENDULUM.rhs, PENDULUM.params, PENDULUM.period, ("theta", "theta'"))
    with pytest.raises(ValueError, match="coordinates"):
        recompute_basins(basins, line)


@pytest.mark.parametrize(
    ("source", "recipe"),
    [
        (systems.henon_map(), {"kind": "stroboscopic", "phase": 0.0}),
        (PENDULUM, {"kind": "discrete"}),
        (PENDULUM, {"kind": "a map of the future"}),
        (PENDULUM, {}),
        (strobe(), {"kind": "stroboscopic", "period": 0.02}),
    ],
)
def test_recipe_that_does_not_fit_the_source(source, recipe):
    with pytest.raises(ValueError, match=r"cannot be rebuilt from .*: give its system"):
        rebuild_map(source, recipe)


@pytest.mark.parametrize("source", [None, "pendulum"])
def test_source_that_is_neither_system_nor_map(source):
    with pytest.raises(TypeError, match=f"source={source!r}: give a ForcedSystem or a PointMap"):
        rebuild_map(source, {"kind": "discrete"})


@pytest.mark.parametrize("missing", ["rtol", "method", "phase", "period"])
def test_incomplete_recipe_names_what_is_missing(missing):
    recipe = {k: v for k, v in strobe().recipe.items() if k != missing}
    with pytest.raises((ValueError, KeyError), match=missing):
        rebuild_map(PENDULUM, recipe)


def test_discrete_map_of_another_dimension_is_refused():
    basins = find_basins(systems.henon_map(), [[0.1, 0.1]])
    line = discrete_map(lambda x, p: (p.a * x[0] + p.b,), {"a": 1.4, "b": 0.3}, ("x",))
    with pytest.raises(ValueError, match=r"coordinates|dimension|state variables"):
        recompute_basins(basins, line)


def test_basins_of_other_methods_are_not_found_again():
    contraction = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))
    basins = simple_cell_mapping(contraction, CellGrid((-1,), (1,), (9,))).basins()
    with pytest.raises(ValueError, match="simple cell mapping"):
        recompute_basins(basins, contraction)
