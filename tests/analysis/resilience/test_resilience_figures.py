"""Figures and summaries of resilience."""

from __future__ import annotations

from math import pi, sin
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import (
    Basins,
    CellGrid,
    angle,
    discrete_map,
    find_basins,
    plot,
)
from cellmap.analysis.resilience import (
    FatalShock,
    basin_stability,
    largest_ball,
    local_integrity,
    minimal_fatal_shock,
    settling_statistics,
    tipping_probabilities,
)

mpl.use("Agg")


def full_rotations_off(apart: Any, basins: Basins) -> Any:
    for j, c in enumerate(basins.coordinates):
        if c.period is not None:
            apart[:, j] -= c.period * np.round(apart[:, j] / c.period)
    return apart


def test_figures(disc: Basins, pendulum: Basins, line: Basins, shocks: list[FatalShock], disc_function: Any) -> None:
    assert len(plot.basin_stability(basin_stability(disc, n_samples=50)).patches) == 2
    assert len(plot.settling_times(settling_statistics(pendulum)).get_lines()) == 4
    for ball, basins in ((local_integrity(pendulum, 1, refine=False), pendulum), (largest_ball(disc, 0), disc)):
        lines = [line.get_xydata() for line in plot.ball(ball, basins=basins).get_lines()]
        circles = [line[np.isfinite(line).all(axis=1)] - ball.centre for line in lines if len(line) > 300]
        away = [np.hypot(*(full_rotations_off(d, basins) / ball.scale).T) for d in circles]
        assert any(np.allclose(d, ball.radius, rtol=1e-6) for d in away)
        assert any(np.allclose(line, ball.centre) for line in lines)
    ax = plot.fatal_shock(shocks[1], basins=pendulum)
    (cross,) = (line for line in ax.get_lines() if line.get_marker() == "X")
    assert cross.get_xydata()[0] == pytest.approx(shocks[1].end)
    assert ax.get_xlim() == pytest.approx((-pi, pi))
    assert plot.tipping(tipping_probabilities(line, line)).get_ylabel() == "before"
    solid = find_basins(discrete_map(disc_function, {}, ("x", "y", "z")), CellGrid((-1.3,) * 3, (1.3,) * 3, (6,) * 3))
    with pytest.raises(ValueError, match="two axes"):
        plot.ball(largest_ball(solid, 0), basins=solid)
    for draw in (plot.basin_stability, plot.settling_times, plot.tipping):
        with pytest.raises(TypeError, match=r"=3: give .*, made by"):
            draw(3)  # type: ignore[operator]


def test_figures_of_one_coordinate(line: Basins) -> None:
    """A strip in the colours of the basins: the shock ends where they change, the ball within one of them."""
    shock = minimal_fatal_shock(line, 0, scale=1.0, n_trials=64)
    ax = plot.fatal_shock(shock, basins=line)
    assert len(ax.patches) == 2
    arrow = ax.get_lines()[1].get_xydata()
    assert arrow == pytest.approx(np.array([[shock.point[0], 0.0], [shock.point[0] + shock.shock[0], 0.0]]))
    ball = local_integrity(line, 1, scale=1.0, refine=False)
    round_ = np.asarray(plot.ball(ball, basins=line).get_lines()[0].get_xydata())
    assert [round_[:, 0].min(), round_[:, 0].max()] == pytest.approx(ball.centre[0] + ball.radius * np.array([-1, 1]))
    rotating = discrete_map(lambda x, p: (x[0] - 0.4 * sin(2.0 * x[0]),), {}, (angle("a"),))
    circle = find_basins(rotating, CellGrid((-pi,), (pi,), (64,)))
    cut = plot.fatal_shock(minimal_fatal_shock(circle, 1, scale=1.0), basins=circle)  # about pi, the branch cut
    assert np.nanmax(np.abs(np.asarray(cut.get_lines()[0].get_xydata())[:, 0])) <= pi + 1e-12


def test_records_say_what_they_are_in_one_line(disc: Basins, line: Basins) -> None:
    records = [
        basin_stability(disc, n_samples=50),
        settling_statistics(disc),
        settling_statistics(disc).basins[0],
        minimal_fatal_shock(disc, 0, n_trials=64),
        local_integrity(disc, 0, refine=False),
        tipping_probabilities(line, line),
    ]
    for record in records:
        assert "\n" not in repr(record)
        assert len(repr(record)) < 250
