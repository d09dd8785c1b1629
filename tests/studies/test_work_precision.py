"""The frozen images are those of the problems, and every part of the study returns what it says."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from cellmap import stroboscopic_map
from studies.work_precision import basin_images, measures
from studies.work_precision.chart import Chart, Run
from studies.work_precision.peers import PEERS, installed
from studies.work_precision.problems import PROBLEMS, TABLE

FROZEN = json.loads(TABLE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda p: p.name)
def test_frozen_images(problem):
    frozen = FROZEN[problem.name]
    assert frozen["params"] == dict(problem.system.params)
    assert frozen["period"] == problem.system.length
    exact = stroboscopic_map(problem.system, rtol=1e-13, atol=1e-13)
    errors = np.abs(exact.iterate(problem.initial_conditions, 1).unwrapped - problem.images)
    # Rounding, magnified by the double pendulum, is as large as the tolerance.
    assert (errors / (1.0 + np.abs(problem.images))).max() < 1e-12


@pytest.mark.parametrize("name", installed())
def test_other_programs_compute_the_same_map(name):
    make, _, most = PEERS[name]
    for problem in PROBLEMS[:2]:
        images = make(problem.system, 1e-10)(problem.initial_conditions[: min(most, 50)])
        np.testing.assert_allclose(images, problem.images[: min(most, 50)], atol=1e-7)


def test_labels_are_compared_by_attractors():
    from cellmap import find_basins

    scene = basin_images.scenes(12)[1]
    exact = stroboscopic_map(scene.system)
    reference = find_basins(exact, scene.grid)
    rotated = replace(reference, attractors=reference.attractors[::-1], labels=_exchanged(reference.labels))
    same = basin_images._run("direct", "", 1.0, rotated, reference)
    assert same.error == 0.0
    assert "2 of 2 attractors" in same.more
    wrong = rotated.labels.copy()
    wrong.flat[[0, 50, 100]] = _exchanged(wrong.flat[[0, 50, 100]])
    assert basin_images._run("direct", "", 1.0, replace(rotated, labels=wrong), reference).error == 3 / wrong.size


def _exchanged(labels):
    """The labels of two attractors in the other order."""
    return np.choose(labels + 1, [-1, 1, 0]).astype(labels.dtype)


def test_tables_and_charts():
    chart = Chart("title", "seconds", "error", (Run("a", "x", 1.5, 1e-3), Run("b", "y", 0.25, 0.0, "more")))
    assert chart.table().splitlines()[2:] == ["| a | x | 1.5 | 0.001 |  |", "| b | y | 0.25 | 0 | more |"]


@pytest.mark.slow
def test_known_values_come_out():
    charts = measures.compare(quick=True)
    assert len(charts) == 3
    for chart in charts:
        for run in chart.runs:
            ((value, error, exact),) = re.findall(r"([\d.]+) ± ([\d.]+), exactly ([\d.]+)", run.more)
            assert abs(float(value) - float(exact)) < 4.0 * float(error) + 1e-4, (chart.title, run)
        spreads = [float(re.findall(r"± ([\d.]+),", run.more)[0]) for run in chart.runs]
        assert spreads[-1] < 0.06  # so that the comparison says something
