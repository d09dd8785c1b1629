"""Labels to a tolerance of their own, with an audit by the map itself."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

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
from cellmap.basins import coarse_labels, recompute_basins

WELLS = ForcedSystem(lambda t, x, p: (x[1], x[0] - x[0] ** 3 - p.d * x[1]), {"d": 0.5}, 2 * pi, ("q", "v"))
EXACT = stroboscopic_map(WELLS)
GRID = CellGrid((-2.0, -2.0), (2.0, 2.0), (48, 48))


@pytest.fixture(scope="module")
def plain():
    return find_basins(EXACT, GRID)


def test_audited_labels_are_those_of_the_map(plain, tmp_path):
    """Half of the audit is beside a boundary; regions and attractors are not those of the coarser map."""
    basins = find_basins(EXACT, GRID, label_rtol=1e-5)
    assert np.array_equal(basins.labels, plain.labels) and basins.settings["audit"]["differing"] == 0
    assert 600 < basins.settings["audit"]["audited"] <= coarse_labels.AUDITED
    assert basins.cost.evaluations < plain.cost.evaluations and basins.settings["map"]["rtol"] == 1e-9
    assert [a.points.tolist() for a in basins.attractors] == [a.points.tolist() for a in plain.attractors]
    stored = load_basins(save_basins(basins, tmp_path / "labels.h5"))
    assert dict(stored.settings) == basins.settings and stored.settings["label_rtol"] == 1e-5
    again = recompute_basins(stored, WELLS)
    assert again.settings == basins.settings and np.array_equal(again.labels, basins.labels)


def faulty(monkeypatch, fraction):
    """Let the coarser map be one whose states are mirrored, so that labels are swapped, in a part of the plane."""

    def mirrored(point_map, rtol):
        def advance(orbits, periods):
            begun = np.abs(orbits.points[:, 1]) > 2.0 * (1.0 - fraction)
            orbits.points[begun] *= -1.0
            point_map.advance(orbits, periods)

        return replace(point_map, advance=advance)

    monkeypatch.setattr(coarse_labels, "coarser", mirrored)


def test_a_few_wrong_labels_are_mended_and_many_make_all_be_found_again(plain, monkeypatch):
    faulty(monkeypatch, 0.25)
    basins = find_basins(EXACT, GRID, label_rtol=1e-5)
    found = basins.settings["audit"]
    assert np.array_equal(basins.labels, plain.labels) and found["differing"] > 50
    assert found["wrong"] == pytest.approx(0.25, abs=0.05)
    monkeypatch.setattr(coarse_labels, "ALLOWED", 0.5)
    with pytest.warns(UserWarning, match="of all labels are wrong; leave out label_rtol"):
        basins = find_basins(EXACT, GRID, label_rtol=1e-5)
    differ = np.count_nonzero(basins.labels != plain.labels)
    assert 0 < differ < 0.25 * GRID.size
    monkeypatch.setattr(coarse_labels, "AUDITED", 2 * GRID.size)
    with pytest.warns(UserWarning, match="leave out label_rtol"):
        assert np.array_equal(find_basins(EXACT, GRID, label_rtol=1e-5).labels, plain.labels)


def test_maps_without_a_coarser_tolerance_are_refused(tmp_path):
    halving = discrete_map(lambda x, p: (x[0] / 2, x[1] / 2), {}, ("x", "y"))
    table = interpolated_map(halving, GRID, order=1)
    for point_map, rtol, remedy in (
        (halving, 1e-6, "have no tolerance"),
        (table, 1e-6, "have no tolerance"),
        (EXACT, 1e-9, "give a larger one"),
    ):
        with pytest.raises(ValueError, match=remedy):
            find_basins(point_map, GRID, label_rtol=rtol)
    with pytest.raises(ValueError, match="are not kept in a file"):
        find_basins(EXACT, GRID, label_rtol=1e-6, checkpoint=tmp_path / "no.h5")
