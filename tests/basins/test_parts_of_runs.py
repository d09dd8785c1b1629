"""Parts of the ways to basins: rows, extents, memory, creeping orbits; late and resting orbits in certificates."""

import inspect
from dataclasses import replace
from math import cos, log, pi
from types import SimpleNamespace

import numpy as np
import pytest

from cellmap import CellGrid, Label, angle, certify, discrete_map, find_attractors, find_basins, interpolated_map
from cellmap.attractors.search import MAX_PERIODS
from cellmap.basins import Evidence, continue_basins, refine_basins
from cellmap.basins.certification import certified_labels
from cellmap.basins.continuation import _outermost, _seeds
from cellmap.basins.initial_conditions import InitialConditions, Rows
from cellmap.basins.label_store import InMemory, LabelStore
from cellmap.basins.planning.predictions import Labelling, TableProbe, slower
from cellmap.maps.interpolation.interpolated import table_memory

CREEPS = discrete_map(lambda x, p: (x[0] - x[0] ** 3,), {}, ("x",))


def test_points_of_the_same_extent_as_all():
    points = np.random.default_rng(0).normal(size=(50, 3))
    few = _outermost(points)
    assert len(few) <= 6
    assert np.array_equal(few.min(axis=0), points.min(axis=0)) and np.array_equal(few.max(axis=0), points.max(axis=0))
    grid = CellGrid((0.0, 0.0), (1.0, 4.0), (4, 8))
    assert _outermost(grid).tolist() == [[0.125, 0.25], [0.875, 3.75]]


def square(n, m=None):
    return CellGrid((0.0, 0.0), (1.0, 1.0), (n, m or n))


def test_look_ups_of_larger_tables_are_slower():
    """Linear in the logarithm of the memory, and never faster than those of a smaller one."""
    sizes = [log(table_memory(grid, 3)) for grid in (square(32), square(128), square(512))]
    known = {"order": 3, "cells": (32,), "errors": (1e-3,), "raw": (1e-3,), "surplus": 0.0}
    lookups = tuple(zip(np.exp(sizes).tolist(), (2e-8, 1e-8, 6e-8), strict=True))
    probe = TableProbe(**known, labelling=Labelling(0.0, 1.0), lookups=lookups)
    assert slower(probe, square(64)) == pytest.approx(1.0)
    assert log(table_memory(square(32, 16), 3)) < sizes[0], "where look-ups take 2e-8 s"
    for grid in (square(256), square(256, 128)):
        part = (log(table_memory(grid, 3)) - sizes[1]) / (sizes[2] - sizes[1])
        assert slower(probe, grid) == pytest.approx(1.0 + 2.0 * part)
    assert slower(replace(probe, lookups=()), square(256)) == 1.0


# --- certificates


def test_labels_that_change_take_the_times_of_the_exact_map():
    """Two chaotic attractors, in boxes, and labels beside the boundary that a coarse interpolation grid gives wrong."""
    exact = discrete_map(lambda x, p: (2.5 * x[0] * (1.0 - x[0] * x[0]) + 1e-3 * cos(30 * x[0]),), {}, ("x",))
    table = interpolated_map(exact, CellGrid((-1.2,), (1.2,), (25,)), 1, tolerance=1e6)
    basins = find_basins(table, np.linspace(-1e-3, -4e-4, 60)[:, None], max_periods=500)
    certificate = certify(basins, audit=20)
    found = certificate.basins
    direct = find_basins(exact, basins.initial_conditions, max_periods=500, attractors=found.attractors)
    assert np.array_equal(found.labels, direct.labels)
    changed = found.labels != basins.labels
    assert np.count_nonzero(changed) == certificate.changed > 10
    assert (certificate.evidence[changed] == Evidence.OPEN).all()
    assert np.array_equal(found.settling_time[changed], direct.settling_time[changed])


def test_late_orbits_are_given_in_parts(monkeypatch):
    monkeypatch.setattr(certified_labels, "CHUNK", 64)
    points = np.random.default_rng(0).uniform(-1, 1, (200, 1))
    slow = np.random.default_rng(1).uniform(size=200) < 0.3
    run = SimpleNamespace(
        slow=slow, initial_conditions=InitialConditions(None, points), setting=SimpleNamespace(direct=CREEPS)
    )
    parts = list(certified_labels.CertifiedLabels._late(run))
    assert len(parts) == 4
    assert np.array_equal(np.concatenate(parts), points[slow])


def test_an_orbit_rests_if_all_ends_of_its_errors_do(monkeypatch):
    """A sticking set abs(x) <= 1, abs(y) <= 2; errors reach 0.1 cells of 0.5 x 2 to both sides of both axes."""
    points = np.array(
        [[0, 0], [0.94, 0], [0.96, 0], [-0.94, 0], [-0.96, 0], [0, 1.79], [0, 1.81], [0, -1.81], [3, 3.0]]
    )

    def settled(point_map, orbits, catalogue, periods):
        assert periods == 4
        rests = (np.abs(orbits.points) <= [1.0, 2.0]).all(axis=1)
        return SimpleNamespace(labels=np.where(rests, 5, Label.UNDECIDED))

    monkeypatch.setattr(certified_labels, "settle", settled)
    monkeypatch.setattr(certified_labels, "inside_cover", lambda cover, x, point_map, keys: np.abs(x[:, 0]) <= 1.0)
    plane = discrete_map(lambda x, p: (x[0], x[1]), {}, ("x", "y"))
    covers = ((4, SimpleNamespace(certain=None), None), (5, SimpleNamespace(certain=True), None))
    setting = SimpleNamespace(
        catalogue=SimpleNamespace(covers=covers), grid=SimpleNamespace(widths=np.array([0.5, 2.0]))
    )
    setting.direct = plane
    found = np.full(len(points), certified_labels.NONE)
    orbits = SimpleNamespace(points=points, alive=np.arange(len(points)) != 0)
    spread = np.broadcast_to(0.01 * np.eye(2), (len(points), 2, 2))
    certified_labels.CertifiedLabels._stopped(SimpleNamespace(setting=setting), orbits, spread, found)
    # The first orbit has ended; 0.94 + 0.05 rests, and 0.96 + 0.05 does not; 1.79 + 0.2, and not 1.81 + 0.2.
    assert (found == 5).tolist() == [False, True, False, True, False, True, False, False, False]


def test_what_is_undecided_where_a_run_ends_has_no_label():
    store = InMemory((2, 3))
    store.labels[:] = [0, Label.UNDECIDED, 1, Label.ESCAPED, Label.UNDECIDED, Label.DIVERGED]
    store.times[:] = [3, -1, 5, -1, -1, -1]
    none = Label.UNLABELLED
    now = SimpleNamespace(rows=Rows.where(6, lambda part: np.ones(6, bool)))
    for kept in (LabelStore.cut_short(store, now), store.cut_short(now)):  # of a file, and in memory
        assert kept.labels.tolist() == [0, none, 1, Label.ESCAPED, none, Label.DIVERGED]
        assert kept.times.tolist() == [3, -1, 5, -1, -1, -1]
    assert (LabelStore.cut_short(store, None).labels == none).all()


def test_attractors_are_sought_on_and_beside_where_they_were():
    """Four points of each, and as many a thousandth of the extent beside these; angles are wrapped."""
    halves = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1]), {}, (angle("a"), "y"))
    (sink,) = find_attractors(halves, [[0.1, 0.1]])
    points = np.column_stack([np.full(100, pi - 1e-6), np.arange(100.0)])
    places = _seeds({3: replace(sink, points=points), 5: sink}, np.array([2 * pi, 1000.0]))
    assert len(places) == 10
    on, beside = places[:5], places[5:]
    assert all(place in points.tolist() for place in on[:4].tolist()) and np.abs(on[4]).max() < 1e-9
    apart = beside - on
    apart[:, 0] = (apart[:, 0] + pi) % (2 * pi) - pi
    assert 0.1 < np.abs(apart[:, 1]).mean() < 3.0 and 6e-4 < np.abs(apart[:, 0]).mean() < 2e-2
    assert np.abs(places[:, 0]).max() <= pi


@pytest.mark.parametrize("name", ["max_periods", "longest_period"])
def test_searches_have_the_same_limits_everywhere(name):
    """An image, a continuation, a refinement and a search of attractors alone are compared with one another."""
    functions = (find_basins, continue_basins, refine_basins, find_attractors)
    defaults = [inspect.signature(f).parameters[name].default for f in functions]
    assert len({MAX_PERIODS if limit is None else limit for limit in defaults}) == 1
