"""Basins: counts that two independent programs agree on, published shares, symmetry, verification, determinism."""

from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from known_basins import LINE, circle_grid, two_wells

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    Label,
    certify,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    load_basins,
    save_basins,
    stroboscopic_map,
)
from cellmap._lib.stopping import Stop
from cellmap.attractors import search
from cellmap.basins import finding
from cellmap.basins.label_store import basins_memory
from cellmap.exchange import from_xarray
from cellmap.maps import ToleranceWarning
from cellmap.maps.coordinates import difference

FURTHER = [pytest.param(p, marks=pytest.mark.thorough) for p in ((-0.1, 0.545, 0.2), (0.1, 0.545, 0.08))]


@pytest.mark.parametrize("parameters", [(0.5, 0.1, 0.03), *FURTHER])
def test_vertically_driven_pendulum_has_mirrored_basins(parameters):
    """(theta, v) -> (-theta, -v) maps the system to itself, and the centres of a symmetric grid to one another.

    All of this holds to the last bit, so that even orbits next to a fractal boundary are mirror images.
    """
    basins = find_basins(stroboscopic_map(systems.dimensionless_pendulum(*parameters)), circle_grid(4.0, 100))
    partner = [mirror_image(a, basins.attractors) for a in basins.attractors]
    mirrored = np.append(partner, Label.UNDECIDED)[basins.labels][::-1, ::-1]
    assert np.array_equal(mirrored, basins.labels)


def mirror_image(a, attractors) -> int:
    for k, b in enumerate(attractors):
        apart = np.abs(difference(-a.points[0], b.points, a.coordinates)).max(axis=-1)
        if b.period == a.period and apart.min() < 1e-6:
            return k
    raise AssertionError(f"{a} has no mirror image")


# --- what the record says


def test_fractions_add_up_and_have_standard_errors():
    basins = find_basins(systems.henon_map(), CellGrid((-2.0, -2.0), (2.0, 2.0), (60, 60)), max_periods=300)
    fractions = basins.fractions
    assert sum(f.fraction for f in fractions.values()) == pytest.approx(1.0, abs=1e-12)
    assert sum(f.count for f in fractions.values()) == 3600
    for f in fractions.values():
        assert f.fraction == f.count / 3600
        assert f.standard_error == pytest.approx(sqrt(f.fraction * (1 - f.fraction) / 3600), rel=1e-12)


# --- codes


def test_orbits_that_leave_the_window_keep_their_own_code():
    exact = stroboscopic_map(systems.driven_pendulum())
    icm = interpolated_map(exact, circle_grid(100.0, 128), outside="escape")
    lost = find_basins(icm, circle_grid(100.0, 100), max_periods=700, longest_period=16)
    kept = find_basins(exact, circle_grid(100.0, 100))
    escaped = lost.labels == Label.ESCAPED
    leaves = exact.orbit(lost.grid.centres(), 60).points[..., 1]
    assert 0 < escaped.mean() < 0.5
    assert np.array_equal(lost.labels[~escaped], kept.labels[~escaped])
    assert (np.abs(leaves) > 100.0).any(axis=0)[escaped].all()
    assert lost.label_name(Label.ESCAPED) == "escaped"
    assert (lost.settings["max_periods"], lost.settings["longest_period"]) == (700, 16)
    assert (lost.settings["map"], lost.point_map is icm) == (icm.recipe, True)
    assert (lost.name, lost.coordinates, lost.params) == (icm.name, icm.coordinates, icm.params)
    assert min(lost.cost.seconds, lost.cost.steps) > lost.inaccurate == 0
    check = lost.verify(500)
    assert (check.compared + check.excluded, check.wrong) == (500, 0)
    assert check.excluded / 500 == pytest.approx(lost.fractions[Label.ESCAPED].fraction, abs=0.05)


def test_an_attractor_outside_the_window_of_a_table_keeps_its_basin():
    """x -> tanh 2x has attractors at +-0.9575; the table ends at -0.5, between the left one and the boundary at 0."""
    exact = discrete_map(two_wells, {}, ("x",))
    window = CellGrid((-0.5,), (1.5,), (40,))
    kept = find_basins(interpolated_map(exact, window), window)
    lost = find_basins(interpolated_map(exact, window, outside="escape"), window)
    left = window.centres()[..., 0] < 0.0
    assert Label.ESCAPED not in kept.labels
    assert np.array_equal(lost.labels == Label.ESCAPED, left)
    for basins, initial_conditions in ((kept, np.ones_like(left)), (lost, ~left)):
        places = np.array([a.points[0, 0] for a in basins.attractors])
        assert places[basins.labels[initial_conditions]] == pytest.approx(
            np.where(left, -0.957504, 0.957504)[initial_conditions], abs=1e-6
        )
    assert np.array_equal(certify(kept).basins.labels, kept.labels)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("far", [100.0, 1000.0, 1e8, 1e200])
def test_far_initial_conditions_change_nothing_for_the_others(far):
    """In a list, and in a wide window."""
    ic = [[0.5], [-0.5], [far], [-far]]
    for places in (np.array(ic), CellGrid((-far,), (far,), (1000,)) if far <= 1e3 else np.array(ic[::-1])):
        basins = find_basins(LINE, places)
        ends = np.array([a.points[0, 0] for a in basins.attractors])[basins.labels]
        ic = places.centres() if isinstance(places, CellGrid) else places
        assert ends == pytest.approx(0.957504 * np.sign(ic[:, 0]), abs=1e-6)


# --- warnings, memory, bad input


def test_inaccurate_orbits_count_once_however_many_sweeps_there_are():
    """Chaotic orbits that 16 steps a period do not resolve are undecided to the end of the last of four sweeps."""
    system = ForcedSystem(
        lambda t, x, p: (x[1], x[0] - x[0] ** 3 + 0.3 * np.cos(t) - 0.02 * x[1]), {}, 2 * np.pi, ("x", "v")
    )
    with pytest.warns(ToleranceWarning, match="missed its tolerance along 25 of 25 orbits"):
        basins = find_basins(
            stroboscopic_map(system, max_steps=16), CellGrid((-1.0, -1.0), (1.0, 1.0), (5, 5)), max_periods=1100
        )
    assert basins.inaccurate == 25 and basins.cost.steps == 25 * 1100


def test_memory_is_what_was_stated(monkeypatch):
    needed = basins_memory(100_000)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: needed - 1)
    with pytest.raises(MemoryError, match="labels of 100,000 initial conditions"):
        find_basins(LINE, CellGrid((-1.0,), (1.0,), (100_000,)))


STROBE = stroboscopic_map(systems.driven_pendulum())
REFUSED = {
    "initial_conditions has 1 axis and the system 2": lambda: find_basins(STROBE, CellGrid((0.0,), (1.0,), (4,))),
    "more than one period": lambda: find_basins(STROBE, CellGrid((0.0, 0.0), (7.0, 1.0), (4, 4))),
    "last axis must hold the 2 state variables": lambda: find_basins(STROBE, [[0.0]]),
    "last axis": lambda: find_basins(STROBE, 1.0),
    "initial_conditions is empty": lambda: find_basins(STROBE, np.empty((0, 2))),
    "remove points that are not finite": lambda: find_basins(STROBE, [[0.0, np.nan]]),
    "real numbers": lambda: find_basins(STROBE, [["a", "b"]]),
    "attractors": lambda: find_basins(STROBE, [[0.0, 0.0]], attractors=find_attractors(LINE, [[0.1]])),
    "rebuild_map": lambda: replace(find_basins(LINE, [[0.5]]), point_map=None).verify(),
    "labels of 100,000,000,000,000 initial .* TB .*: take fewer initial": lambda: find_basins(
        LINE, CellGrid((-1.0,), (1.0,), (10**14,))
    ),
}
"""What does not fit together; what is wrong by itself is in `tests/_lib/bad_input/`."""


@pytest.mark.parametrize("message", REFUSED)
def test_bad_arguments(message):
    with pytest.raises((TypeError, ValueError, MemoryError), match=message):
        REFUSED[message]()


# --- the cost that maps and basins report, counted in other ways

TABLE = CellGrid((-3.0, -3.0), (3.0, 3.0), (40, 40))
INITIAL_CONDITIONS = CellGrid((-1.5, -1.5), (1.5, 1.5), (30, 30))


def counted(calls):
    """Return a contraction whose applications to single points are counted."""
    exact = discrete_map(lambda x, p: (0.5 * x[0] - 0.1 * x[0] ** 3, 0.4 * x[1]), {}, ("x", "y"))

    def advance(orbits, periods):
        calls.append(int(orbits.alive.sum()) * periods)
        exact.advance(orbits, periods)

    return replace(exact, advance=advance)


def test_every_step_is_a_look_up_or_an_image():
    calls = []
    exact = counted(calls)
    direct = find_basins(exact, INITIAL_CONDITIONS)
    assert direct.cost.evaluations == direct.cost.steps > 0
    calls.clear()
    icm = interpolated_map(exact, TABLE, order=1, outside="integrate")  # coarse: some cells are left to the map
    assert icm.cost.evaluations == icm.cost.steps == sum(calls)
    assert icm.cost.look_ups == 0 < icm.cost.tabulation == icm.cost.seconds
    basins = find_basins(icm, CellGrid((-3.6, -3.6), (3.6, 3.6), (50, 50)))
    assert basins.cost.look_ups > 0
    assert basins.cost.evaluations > 0
    assert basins.cost.look_ups + basins.cost.evaluations == basins.cost.steps
    assert basins.cost.tabulation == icm.cost.tabulation
    assert 0 < basins.cost.iteration < basins.cost.seconds


@pytest.mark.parametrize(("method", "stages"), [("RK45", 7), ("DOP853", 12), ("Taylor", 1)])
def test_right_hand_sides_of_methods(method, stages):
    exact = stroboscopic_map(systems.two_well_duffing(), method=method)
    basins = find_basins(exact, CellGrid((-1.5, -1.5), (1.5, 1.5), (12, 12)))
    cost = basins.cost
    assert cost.evaluations % stages == 0
    assert cost.evaluations > 4 * stages * cost.steps
    assert cost.look_ups == cost.tabulation == 0


def test_names_of_labels(tmp_path: Path) -> None:
    """Names given to labels and those of ends follow one rule, in fractions, files, tables and statistics."""
    cubic = discrete_map(
        lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",), ends={"out": lambda x, p: x[0] - 1.7}
    )
    basins = find_basins(cubic, [[-0.5], [0.3], [0.4], [2.3]]).named({0: "right"}).named({1: "left", -8: "lost"})
    save_basins(basins, tmp_path / "named.h5")
    for same in (basins, load_basins(tmp_path / "named.h5"), from_xarray(basins.to_xarray())):
        assert "right 50 %; left 25 %; lost 25 %" in repr(same)
        assert same.to_dataframe()["name"].tolist() == ["right", "left"]
    assert basins.named({1: ""}).label_name(1) == "fixed point (-1)"
    with pytest.raises(ValueError, match="'right' would name 2 labels"):
        basins.named({1: "right"})


def test_a_search_that_ends_early_keeps_what_it_has_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Labels decided until then are those of the whole call."""
    doubled = discrete_map(lambda x, p: (1.002 * x[0] - 0.002 * x[0] ** 3,), {}, ("x",))
    grid = CellGrid((-1.5,), (1.5,), (300,))
    whole, late = find_basins(doubled, grid), []

    class Late(Stop):
        requested = property(lambda _: bool(late))

    def many_settle(before: int, left: int) -> bool:
        late.extend([True] * (0 < left < before))
        return 2 * left <= before

    monkeypatch.setattr(finding, "Stop", Late)
    monkeypatch.setattr(search, "_many_settle", many_settle)
    with pytest.warns(UserWarning, match="unlabelled: the call ended in the search for attractors, with 2 found"):
        found = find_basins(doubled, grid)
    decided = found.labels >= 0
    assert len(found.attractors) == 2
    assert 0 < decided.sum() < decided.size
    assert (found.labels[decided] == whole.labels[decided]).all()
    assert (found.labels[~decided] == Label.UNLABELLED).all()
