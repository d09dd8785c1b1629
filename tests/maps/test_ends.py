"""Ends: orbits that end where a guard becomes positive, with a name."""

from collections.abc import Callable, Sequence
from functools import partial
from math import cos, log, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import (
    CellGrid,
    ForcedSystem,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    plot,
    save_basins,
    stroboscopic_map,
)
from cellmap.analysis.boundary import edge_orbit
from cellmap.analysis.resilience import basin_stability, largest_ball, tipping_probabilities
from cellmap.attractors import Label
from cellmap.basins import certify, continue_basins, prove
from cellmap.maps import Impact, Status, section_map, swept_map, trajectory


def roll(t: float, x: Any, p: Any) -> tuple[float, float]:
    """Roll of a ship that capsizes beyond |y| = 1, where nothing rights it."""
    return x[1], -0.1 * x[1] - 0.05 * x[1] ** 3 - x[0] + x[0] ** 3 + p.F * sin(0.85 * t)


SHIP = ForcedSystem(
    roll,
    {"F": 0.06},
    2 * pi / 0.85,
    ("y", "v"),
    ends={"port": lambda t, x, p: -1.5 - x[0], "starboard": lambda t, x, p: x[0] - 1.5},
)
GRID = CellGrid((-1.5, -1.2), (1.5, 1.2), (16, 16))


def crossed(
    rhs: Callable[..., Any], guards: Sequence[Callable[[Any], float]], point: Any, longest: float
) -> tuple[int, float]:
    """Return which guard SciPy sees an orbit come to first, and when; -1 for none."""
    events = [lambda t, z, g=g: g(z) for g in guards]
    for event in events:
        event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
    found = solve_ivp(rhs, (0.0, longest), point, "DOP853", rtol=1e-9, atol=1e-9, events=events)
    return next((k for k, times in enumerate(found.t_events) if len(times)), -1), found.t[-1]


def test_a_ship_capsizes_to_the_side_and_in_the_period_that_scipy_sees() -> None:
    basins = find_basins(stroboscopic_map(SHIP), GRID)
    assert [basins.label_name(k) for k in (Label.ENDED, Label.ENDED - 1)] == ["port", "starboard"]
    points, labels = GRID.centres().reshape(-1, 2), basins.labels.ravel()
    for k in range(0, len(points), 13):
        side, when = crossed(
            lambda t, z: roll(t, z, SHIP.parameters),
            (lambda z: -1.5 - z[0], lambda z: z[0] - 1.5),
            points[k],
            25.0 * SHIP.length,
        )
        assert (Label.ENDED - labels[k] if labels[k] <= Label.ENDED else -1) == side
        if side >= 0:
            assert basins.settling_time.ravel()[k] == int(np.ceil(when / SHIP.length))
    assert sum(f.fraction for f in basins.fractions.values()) == pytest.approx(1.0)
    assert {"port", "starboard"} <= set(repr(basins).replace(",", ";").replace("; ", " ").split())


def test_one_guard_of_both_sides_gives_the_same_basins_and_tables_keep_ends() -> None:
    both = ForcedSystem(roll, SHIP.params, SHIP.length, ("y", "v"), ends={"capsized": lambda t, x, p: abs(x[0]) - 1.5})
    apart, one = (find_basins(stroboscopic_map(s), GRID).labels for s in (SHIP, both))
    assert np.array_equal(np.maximum(apart, Label.ENDED), one)
    with pytest.warns(UserWarning, match="fallback"):
        table = interpolated_map(stroboscopic_map(SHIP), CellGrid((-1.6, -1.3), (1.6, 1.3), (40, 40)))
    assert table.ends == ("port", "starboard")
    found = find_basins(table, GRID)
    assert np.mean(found.labels != apart) < 0.01
    certificate = certify(found, 200)
    assert certificate.basins.label_name(Label.ENDED) == "port" and np.array_equal(certificate.basins.labels, apart)


def test_ends_are_labels_in_files_figures_continuations_and_statistics(tmp_path: Path) -> None:
    strobe = stroboscopic_map(SHIP)
    basins = find_basins(strobe, GRID)
    save_basins(basins, tmp_path / "ship.h5")
    again = load_basins(tmp_path / "ship.h5")
    assert np.array_equal(again.labels, basins.labels)
    assert again.label_name(Label.ENDED - 1) == "starboard"
    axes = plot.basins(again)
    assert any("starboard" in text.get_text() for text in axes.get_legend().get_texts())
    assert {"port", "starboard"} <= set(basin_stability(basins, GRID, 200).names.values())
    sweep = continue_basins(strobe, "F", [0.0, 0.06], GRID)
    assert sweep.label_name(Label.ENDED) == "port"
    assert sweep.label_name(Label.ENDED) in {sweep.label_name(k) for k in sweep.labels}
    tipped = tipping_probabilities(basins, find_basins(strobe.with_params(F=0.07), GRID))
    assert {"port", "starboard"} <= set(tipped.names[1])
    assert edge_orbit(basins, 0, Label.ENDED).orbit is not None
    for refused, words in ((prove, r"end \(port, starboard\)"), (partial(largest_ball, label=-8), "'port' is an end")):
        with pytest.raises(ValueError, match=words):
            refused(basins)


def test_blow_up_ends_where_and_when_its_closed_form_says() -> None:
    """x' = x^2 is at 10 at the time 1/x - 1/10; beyond the end, and on it moving on, an orbit ends at once."""
    bursting = ForcedSystem(lambda t, x, p: (x[0] ** 2,), {}, 1.0, ("x",), ends={"burst": lambda t, x, p: x[0] - 10.0})
    found = stroboscopic_map(bursting).iterate([[0.5], [1.0 / 1.1001], [1.0 / 1.0999], [10.0], [20.0], [-3.0]], 1)
    assert (found.status == Status.ENDED).tolist() == [False, False, True, True, True, False]
    assert found.points[[0, 1, 5], 0] == pytest.approx([1.0, 1.0 / 0.1001, -0.75], rel=1e-8)
    motion = trajectory(bursting, [0.5], 3, samples_per_period=100)
    last = motion.times[np.isfinite(motion.states[:, 0])][-1]
    assert 0.0 <= (2.0 - 0.1) - last < 0.01


def test_ends_beside_friction_and_impacts() -> None:
    """A ball thrown up at 2 bounces with restitution 1/2: it is at 1.8 before the impact, and never after it."""
    ball = ForcedSystem(
        lambda t, x, p, s: (x[1], -1.0 - 0.0 * s[0]),
        {},
        1.0,
        ("z", "v"),
        switches=lambda t, x, p: (x[1],),
        impacts=[Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -0.5 * x[1]))],
        ends={"high": lambda t, x, p: x[0] - p_height(p)},
    )
    found = stroboscopic_map(ball).iterate([[0.5, 1.5], [0.5, 1.7], [1.7, -3.0], [0.0, 4.0]], 20)
    assert (found.status == Status.ENDED).tolist() == [False, True, False, True]
    assert found.points[0] == pytest.approx([0.0, 0.0], abs=1e-6)


def p_height(p: Any) -> float:
    return 1.8


def henon(x: Any, p: Any) -> tuple[float, float]:
    return 1.0 - p.a * x[0] ** 2 + x[1], 0.3 * x[0]


def test_a_discrete_map_ends_as_a_plain_loop_does() -> None:
    ends = {"left": lambda x, p: -2.0 - x[0], "right": lambda x, p: x[0] - p.right}
    mapped = discrete_map(henon, {"a": 1.4, "right": 2.0}, ("x", "y"), ends=ends)
    grid = CellGrid((-2.5, -2.0), (2.5, 2.0), (40, 40))
    basins = find_basins(mapped, grid)
    x, y = grid.centres().reshape(-1, 2).T
    exits, times = np.zeros(x.size, int), np.zeros(x.size, int)
    for k in range(200):
        for number, beyond in enumerate((x < -2.0, x > 2.0), 1):
            new = (exits == 0) & beyond
            exits[new], times[new] = number, max(k, 1)
        x, y = np.where(exits, 0.0, 1.0 - 1.4 * x * x + y), np.where(exits, 0.0, 0.3 * x)
    found = np.where(basins.labels <= Label.ENDED, Label.ENDED - basins.labels + 1, 0).ravel()
    assert np.array_equal(found, exits)
    assert np.array_equal(basins.settling_time.ravel()[exits > 0], times[exits > 0])
    swept = swept_map(mapped, "right")
    assert swept.ends == ("left", "right")
    assert swept.iterate([[0.9, 0.0, 2.0], [0.9, 0.0, 0.5]], 1).status.tolist() == [Status.OK, Status.ENDED + 1]


def test_a_section_map_ends_at_the_exits_that_scipy_finds() -> None:
    """Hénon and Heiles beyond the energy of escape."""
    root = 0.75**0.5
    guards = (
        lambda z: z[1] - 1.5,
        lambda z: -0.5 * z[1] - root * z[0] - 1.5,
        lambda z: -0.5 * z[1] + root * z[0] - 1.5,
    )

    def rhs(t: float, z: Any, p: Any) -> tuple[float, ...]:
        x, y, u, v = z
        return u, v, -x - 2 * x * y, -y - x * x + y * y

    names = ("up", "left", "right")
    ends = {name: lambda t, z, p, g=g: g(z) for name, g in zip(names, guards, strict=True)}
    system = ForcedSystem(rhs, {}, 1.0, ("x", "y", "u", "v"), ends=ends)
    points = np.column_stack([np.linspace(-0.4, 0.4, 12), np.full(12, 0.6), np.linspace(0.3, -0.3, 12)])
    found = section_map(system, ("x", 0.0, 1), max_time=100.0).iterate(points, 40)
    for point, status in zip(points, found.status, strict=True):
        exit_, _ = crossed(lambda t, z: rhs(t, z, None), guards, [0.0, *point], 150.0)
        assert status == (Status.ENDED + exit_ if exit_ >= 0 else Status.OK)


def test_an_ended_orbit_costs_nothing_and_is_no_dearer_for_those_that_stay() -> None:
    """What follows an end is not integrated: its right-hand side may have a pole there."""
    mems = ForcedSystem(
        lambda t, x, p: (x[1], -0.1 * x[1] - x[0] + 0.1 * (1.0 + 0.3 * cos(0.9 * t)) ** 2 / (1.0 - x[0]) ** 2),
        {},
        2 * pi / 0.9,
        ("x", "v"),
        ends={"pulled in": lambda t, x, p: x[0] - 0.9},
    )
    found = stroboscopic_map(mems).iterate(CellGrid((-1.0, -1.2), (0.9, 1.2), (12, 12)).centres(), 100)
    assert set(found.status.ravel().tolist()) <= {Status.OK, Status.ENDED}
    assert (found.status == Status.ENDED).any()


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ({"a": 3}, r"ends\['a'\]=3: give a function"),
        ([1], "ends=.1.: give a mapping"),
        ({"a": lambda t, x, p: x}, "return a number that is positive"),
        ({"a": lambda t, x, p: x[0] > 0.0}, "such as x.0. - 2.0"),
        ({"a": lambda t, x: x[0]}, r"ends\['a'\] fails"),
        ({"a": lambda t, x, p: x[0] - t}, "one period later"),
        ({str(k): lambda t, x, p: x[0] - log(9.0) for k in range(17)}, "at most 16"),
    ],
)
def test_guards_are_checked(ends: Any, words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        ForcedSystem(lambda t, x, p: (-x[0],), {}, 1.0, ("x",), ends=ends)
