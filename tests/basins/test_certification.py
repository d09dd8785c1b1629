"""Certified basin images against direct integration and closed forms."""

from dataclasses import replace
from math import exp, inf, pi, sin

import numpy as np
import pytest

import cellmap
from cellmap import (
    CellGrid,
    Label,
    angle,
    certify,
    discrete_map,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap._compiled.loops import Loop
from cellmap.attractors.kinds.transients import Reason
from cellmap.attractors.settling.settle import Catalogue, settle
from cellmap.basins import Evidence
from cellmap.basins.certification.cell_owners import within
from cellmap.maps.orbit_batch import Orbits
from systems import two_well_duffing

COARSE = 1e6  # a tolerance that leaves no cell to the exact map
EDGE = 0.1234567  # of the basins of the map below


def threshold(x, p):
    """Fixed points -1 and 1 attract; between their basins lies that at p.edge."""
    return (x[0] - 0.3 * (x[0] - p.edge) * (x[0] - 1.0) * (x[0] + 1.0),)


def certified(system, table, window, order=5, outside="integrate", **settings):
    exact = stroboscopic_map(system)
    icm = interpolated_map(exact, table, order=order, outside=outside)
    basins = find_basins(icm, window)
    certificate = certify(basins, **{"max_cost": inf, **settings})
    direct = find_basins(exact, window, attractors=basins.attractors)
    return certificate, basins, direct


@pytest.fixture(scope="module")
def fractal():
    """Basins of which a coarse interpolated map gets a tenth wrong."""
    side = CellGrid((-2.9, -2.9), (2.9, 2.9), (160, 160)), CellGrid((-2.2, -2.2), (2.2, 2.2), (100, 100))
    return certified(two_well_duffing(), *side)


def test_every_label_of_a_fractal_image_is_that_of_direct_integration(fractal):
    certificate, basins, direct = fractal
    assert (basins.labels != direct.labels).mean() > 0.02
    np.testing.assert_array_equal(certificate.basins.labels, direct.labels)
    assert certificate.changed == np.count_nonzero(basins.labels != direct.labels)
    assert certificate.audit.wrong == 0
    counts = np.bincount(certificate.evidence.ravel(), minlength=4)
    assert counts.sum() == basins.labels.size
    assert counts[Evidence.EXACT] + counts[Evidence.OPEN] == certificate.redone
    assert counts[Evidence.OPEN] == certificate.open
    assert counts[Evidence.CELL] > 0 and counts[Evidence.ORBIT] > 0
    # Of kept labels the audit finds a fraction; recomputed ones are right.
    kept, z2 = 1.0 - certificate.redone / basins.labels.size, 1.959963984540054**2
    assert certificate.wrong == (0.0, pytest.approx(kept * z2 / (1000 + z2)))
    assert "recomputed" in repr(certificate)
    for other in (direct, replace(basins, point_map=replace(basins.point_map, exact=None))):
        with pytest.raises(ValueError, match="not an interpolated map"):
            certify(other)
    with pytest.raises(ValueError, match=r"max_cost=0\.9: give a number from 1 on"):
        certify(basins, max_cost=0.9)


def test_labels_that_cost_too_much_to_certify_are_integrated(fractal):
    """After some that were certified, or at once where the cells cost too much; labels are those of the exact map."""
    certificate, basins, direct = fractal
    for most, first in ((1.2, 0), (1.55, 64)):
        less = certify(basins, max_cost=most)
        counts = np.bincount(less.evidence.ravel(), minlength=5)
        assert counts[Evidence.DIRECT] > 5_000
        assert counts[: Evidence.DIRECT].sum() >= first
        assert (counts[Evidence.DIRECT] == counts.sum()) == (first == 0)
        assert less.redone == counts[Evidence.EXACT :].sum()
        assert less.open == counts[Evidence.OPEN :].sum()
        np.testing.assert_array_equal(less.basins.labels, direct.labels)
        others = less.evidence != Evidence.DIRECT
        np.testing.assert_array_equal(less.evidence[others], certificate.evidence[others])
        assert less.cost.evaluations < 1.3 * direct.cost.evaluations


@pytest.mark.parametrize("order", [1, 3, 5])
def test_boundary_in_closed_form(order):
    exact = discrete_map(threshold, {"edge": EDGE}, ("x",))
    table = CellGrid((-1.6,), (1.6,), (24,))
    window = CellGrid((-1.5,), (1.5,), (20_001,))
    basins = find_basins(interpolated_map(exact, table, order=order, tolerance=0.1), window)
    certificate = certify(basins)
    right = np.where(window.axis(0) > EDGE, 0, 1)  # the attractor at 1 comes first
    assert (basins.labels != right).any() == (order == 1)
    np.testing.assert_array_equal(certificate.basins.labels, right)
    assert certificate.redone < 5_000
    spoilt = certify(replace(basins, labels=(1 - basins.labels).astype(np.int16)), audit=50)
    np.testing.assert_array_equal(spoilt.basins.labels, right)
    assert (spoilt.basins.settling_time[spoilt.evidence == Evidence.CELL] == 0).all()


def test_orbits_that_leave_the_window():
    def henon(x, p):
        return 1.0 - p.a * x[0] * x[0] + x[1], p.b * x[0]

    exact = discrete_map(henon, {"a": 0.2, "b": 0.3}, ("x", "y"))
    table, window = CellGrid((-9.0, -9.0), (9.0, 9.0), (90, 90)), CellGrid((-8.0, -8.0), (8.0, 8.0), (150, 150))
    basins = find_basins(interpolated_map(exact, table, order=1, outside="escape", tolerance=0.05), window)
    certificate = certify(basins)
    # By hand, with the window of the table.
    x, y = np.moveaxis(window.centres(), -1, 0)
    inside = np.ones(x.shape, bool)
    for _ in range(400):
        inside &= (np.abs(x) <= 9.0) & (np.abs(y) <= 9.0)
        x, y = np.where(inside, 1.0 - 0.2 * x * x + y, 0.0), np.where(inside, 0.3 * x, 0.0)
    np.testing.assert_array_equal(certificate.basins.labels, np.where(inside, 0, -1))
    assert 0 < (certificate.basins.labels == -1).sum() < window.size
    assert (certificate.evidence[certificate.basins.labels == -1] == Evidence.CELL).any()


def labels_within(basins):
    """Labels of the exact map with the window of the table, by iteration alone."""
    exact, initial_conditions = basins.point_map.exact, basins.grid.centres().reshape(-1, basins.grid.dimension)
    windowed = within(basins.point_map.table.grid, exact)
    catalogue = Catalogue.of(basins.attractors, exact)
    settled = settle(windowed, Orbits.starting(initial_conditions), catalogue, basins.settings["max_periods"])
    return settled.labels.reshape(basins.labels.shape)


@pytest.mark.parametrize("gap", [1e-3, 0.05])
def test_attractors_that_hold_no_cell_as_a_whole(gap):
    """Paths of cells lead past these attractors and out of the window; orbits stay, or cross the gap to its other side.

    One period takes the angle as far as across the gap, so that it may come to either edge of the window.
    """
    exact = discrete_map(
        lambda x, p: (0.5 * x[0] + 3.0 * sin(x[0]), 0.4 * x[1] + 0.3 * sin(x[0])), {}, (angle("theta"), "y")
    )
    icm = interpolated_map(exact, CellGrid((-pi, -2.0), (pi - gap, 2.0), (60, 40)), 3, "escape", tolerance=0.2)
    basins = find_basins(icm, CellGrid((-pi, -2.0), (pi, 2.0), (40, 40)), max_periods=300)
    assert len(basins.attractors) > 0
    certificate = certify(basins, audit=50)
    np.testing.assert_array_equal(certificate.basins.labels, labels_within(basins))


@pytest.mark.parametrize("contraction", [0.9, pytest.param(0.98, marks=pytest.mark.thorough)])
def test_initial_conditions_that_settle_late_or_never(contraction):
    """Cells around a weak attractor touch others that lead out of the window.

    Labels are those after the periods that were allowed.
    """

    def henon(x, p):
        y = x[1] - x[0] * x[0]
        return p.c * (0.3 * x[0] - 0.954 * y), p.c * (0.954 * x[0] + 0.3 * y)

    exact = discrete_map(henon, {"c": contraction}, ("x", "y"))
    icm = interpolated_map(exact, CellGrid((-2.0, -2.0), (2.0, 2.0), (60, 60)), outside="escape")
    basins = find_basins(icm, CellGrid((-1.2, -1.2), (1.2, 1.2), (40, 40)), max_periods=20)
    certificate = certify(basins, audit=50)
    assert (certificate.basins.labels == Label.UNDECIDED).any()
    np.testing.assert_array_equal(certificate.basins.labels, labels_within(basins))
    assert (certificate.evidence[certificate.basins.labels == Label.UNDECIDED] == Evidence.OPEN).all()
    assert certificate.basins.undecided == {Reason.LATE: min(certificate.undecided, 32)}
    undecided = (certificate.basins.labels == Label.UNDECIDED).mean()
    assert certificate.undecided == round(undecided * certificate.evidence.size)
    assert certificate.wrong[0] == 0.0
    assert undecided < certificate.wrong[1] < undecided + 0.1  # none of these labels counts as right


def test_attractors_that_the_table_has_not_shown():
    """x -> 2.9 sin x is chaotic on either side of 0; straight lines between seven nodes have no attractor."""
    exact = discrete_map(lambda x, p: (p.r * sin(x[0]),), {"r": 2.9}, ("x",))
    window = CellGrid((-3.1,), (3.1,), (100,))
    icm = interpolated_map(exact, CellGrid((-pi,), (pi,), (6,)), 1, "integrate", tolerance=COARSE)
    basins = find_basins(icm, window, max_periods=300)
    assert (basins.labels == Label.UNDECIDED).all()
    assert sum(basins.undecided.values()) > 0
    certificate = certify(basins, audit=50)
    assert certificate.basins.undecided == {}
    direct = find_basins(exact, window, max_periods=300)
    assert [a.kind for a in certificate.basins.attractors] == ["chaotic", "chaotic"]
    assert (certificate.undecided, certificate.changed) == (0, window.size)
    np.testing.assert_array_equal(certificate.basins.labels, direct.labels)
    assert (certificate.basins.settling_time >= 0).all()


def test_given_initial_conditions_and_three_dimensions():
    def contraction(x, p):
        return x[0] - 0.2 * x[0] * (x[0] * x[0] - 1.0), 0.5 * x[1] + 0.1 * x[0], 0.6 * x[2] + 0.1 * x[1]

    exact = discrete_map(contraction, {}, ("x", "y", "z"))
    icm = interpolated_map(exact, CellGrid((-1.6,) * 3, (1.6,) * 3, (24,) * 3), order=3)
    initial_conditions = np.random.default_rng(0).uniform(-1.5, 1.5, (5, 400, 3))
    certificate = certify(find_basins(icm, initial_conditions), audit=50)
    np.testing.assert_array_equal(certificate.basins.labels, (initial_conditions[..., 0] < 0).astype(int))


def test_same_bits_for_any_number_of_threads(fractal, monkeypatch):
    """An argument of another type than before, an enum or a bool, would cost a look at all of them in each period."""
    certificate, basins, _ = fractal
    monkeypatch.setattr(Loop, "_other_types", lambda self, _: pytest.fail(f"{self.function.__name__} looks again"))
    cellmap.set_threads(3)
    again = certify(basins, max_cost=inf)
    np.testing.assert_array_equal(again.evidence, certificate.evidence)
    np.testing.assert_array_equal(again.basins.labels, certificate.basins.labels)


@pytest.mark.parametrize(("place", "width"), [(0.1, 0.1), (0.25, 0.15)])
def test_peak_that_is_narrower_than_a_cell(place, width):
    """The cells beside it are resolved badly as well; none of them may say where an orbit ends."""
    side = 4.0 / 64
    parameters = {"c": -2.0 + (41.0 + place) * side, "w": width * side}
    exact = discrete_map(
        lambda x, p: (1.4 * x[0] - 0.4 * x[0] ** 3 - (p.c + 0.8) * exp(-(((x[0] - p.c) / p.w) ** 2)),),
        parameters, ("x",), "peak",
    )  # fmt: skip
    line = CellGrid((-1.7,), (1.7,), (4001,))
    certificate = certify(find_basins(interpolated_map(exact, CellGrid((-2,), (2,), (64,))), line))
    direct = find_basins(exact, line, attractors=certificate.basins.attractors)
    assert np.count_nonzero((certificate.basins.labels != direct.labels) & (certificate.evidence != Evidence.OPEN)) == 0


def test_labels_that_the_audit_finds_wrong_are_reported():
    """Where errors are taken for nothing, labels are kept that are wrong."""
    exact = stroboscopic_map(two_well_duffing())
    icm = interpolated_map(exact, CellGrid((-2.5, -2.5), (2.5, 2.5), (48, 48)), tolerance=1e3)
    basins = find_basins(icm, CellGrid((-2, -2), (2, 2), (60, 60)))
    none = replace(icm.table, indicator=np.zeros_like(icm.table.indicator), fallback=np.zeros_like(icm.table.fallback))
    with pytest.warns(UserWarning, match="labels that were kept are wrong"):
        certify(replace(basins, point_map=replace(icm, table=none)))
