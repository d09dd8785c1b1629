"""Basin stability on a cluster and with a checkpoint: the same labels, whoever does the work."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_basins
from cellmap.analysis.resilience import basin_stability
from cellmap.basins import finding
from cellmap.basins.label_file import OnDisk


def cubic(x, p):
    return (1.5 * x[0] - 0.5 * x[0] ** 3,)


@pytest.fixture(scope="module")
def basins():
    return find_basins(discrete_map(cubic, {}, ("x",)), CellGrid((-1.5,), (1.5,), (60,)))


def same(one, other):
    assert np.array_equal(one.labels, other.labels)
    assert np.array_equal(one.settling_time, other.settling_time)
    assert [vars(s) for s in one.fractions.values()] == [vars(s) for s in other.fractions.values()]


def test_a_run_that_is_interrupted_goes_on(basins, tmp_path, monkeypatch):
    window = CellGrid((-2.5,), (2.5,), (1,))
    whole = basin_stability(basins, window, 40_000)
    # Beyond sqrt(5) orbits diverge.
    assert whole.fractions[-2].fraction == pytest.approx(
        1.0 - np.sqrt(5.0) / 2.5, abs=4 * whole.fractions[-2].standard_error
    )
    put, done = OnDisk.put, []

    def stopped(self, number, rows, settled):
        if done:
            raise KeyboardInterrupt
        done.append(number)
        put(self, number, rows, settled)

    with monkeypatch.context() as patched:
        patched.setattr(OnDisk, "put", stopped)
        with pytest.raises(KeyboardInterrupt):
            basin_stability(basins, window, 40_000, checkpoint=tmp_path / "run.h5")
    left = []
    again = OnDisk.put

    def counted(self, number, rows, settled):
        left.append(number)
        again(self, number, rows, settled)

    monkeypatch.setattr(OnDisk, "put", counted)
    same(basin_stability(basins, window, 40_000, checkpoint=tmp_path / "run.h5"), whole)
    assert len(left) == 2  # of three tiles
    monkeypatch.setattr(finding, "Run", None)  # the file has it all
    same(basin_stability(basins, window, 40_000, checkpoint=tmp_path / "run.h5"), whole)


def test_a_cluster_gives_the_same_labels(basins):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        here, there = (basin_stability(basins, n_samples=20_000, client=c) for c in (None, client))
    same(here, there)
