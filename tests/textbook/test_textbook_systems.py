"""Systems of textbooks as they stand there: attractors and basins against SciPy, closed forms and published numbers."""

import functools
import warnings
from math import exp, sqrt

import numpy as np
import pytest
from right_hand_sides import dry_friction, van_der_pol
from scipy.integrate import odeint, solve_ivp
from textbook_systems import BRANCHING, IMPACTS, QV, SMOOTH, STIFF, TAU, forced

from cellmap import CellGrid, Label, find_basins, stroboscopic_map
from cellmap.maps.coordinates import difference
from cellmap.maps.point_map import ToleranceWarning
from cellmap.orbits import Kind

SAMPLE = ("inverted pendulum", "forced Chua", "dry friction", "boost converter", "hard impact", "kicked rotor")
"""Systems of the first tier: smooth, of straight pieces, sticking, switched by time, with impacts and with kicks."""

ALL = {**SMOOTH, **BRANCHING, **STIFF, **IMPACTS}
# Several seconds each; maps of the last three are in test_stiff.py.
LONG = {"bubble", "SIR", "van der Pol, mu 20", "van der Pol, mu 100"}
BLOW_UP = {"Helmholtz", "MEMS"}  # orbits leave the well, or reach the electrode
NOT_BY_SCIPY = {"dry friction", "stick and slip on a belt", "ball on a table", "kicked rotor"}


@functools.cache
def map_of(name: str):
    return stroboscopic_map(ALL[name][0])


@functools.cache
def basins_of(name: str, number: int = 100):
    """Basins of the cells of a grid and, behind them, of random initial conditions, from one search."""
    grid = ALL[name][1]
    random = np.random.default_rng(0).uniform(grid.lower, grid.upper, (number, grid.dimension))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)  # counted below
        return find_basins(map_of(name), np.concatenate([cells_of(name), random]), max_periods=600)


def cells_of(name: str):
    grid = ALL[name][1]
    return grid.centres().reshape(-1, grid.dimension)


def by_scipy(system, place, periods: int):
    """Integrate by SciPy: by ODEPACK where states do not jump, else with an event at each impact."""
    p, t, x, end = system.parameters, 0.0, np.array(place, float), periods * system.length
    limits = {"rtol": 1e-9, "atol": 1e-11}
    if not system.impacts:
        times = np.linspace(0.0, end, periods + 1)
        step = system.length / 50 if system in [s for s, _ in BRANCHING.values()] else 0.0
        found, said = odeint(
            system.rhs, x, times, (p,), tfirst=True, full_output=True, hmax=step, mxstep=10**6, **limits
        )
        assert said["message"] == "Integration successful."
        return found[-1]
    events = []
    for impact in system.impacts:
        events.append(lambda t, x, p, guard=impact.guard: guard(t, x, p))
        events[-1].terminal, events[-1].direction = True, impact.direction
    while True:
        part = solve_ivp(
            system.rhs, (t, end), x, "DOP853", events=events, args=(p,), max_step=system.length / 50, **limits
        )
        t, x = part.t[-1], part.y[:, -1]
        if part.status == 0:
            return x
        which = next(k for k, times in enumerate(part.t_events) if len(times))
        x = np.array(system.impacts[which].reset(t, x, p))


CAMPAIGN = {name: 0 if name in LONG else 2_000 for name in ALL}
"""Random initial conditions of each system in the second tier."""


@pytest.mark.parametrize(
    ("name", "number"),
    [
        *((n, 100) for n in SAMPLE),
        *(
            pytest.param(name, number, marks=pytest.mark.slow if name == "Hodgkin-Huxley" else pytest.mark.thorough)
            for name, number in CAMPAIGN.items()
        ),
    ],
)
def test_attractors_are_those_of_scipy(name, number):
    """Periodic points close by SciPy as well, and nothing is undecided, inaccurate or out of steps without a reason.

    Of 2,000 random initial conditions less than 1 % are undecided, or inaccurate.
    """
    system, _ = ALL[name]
    basins, cells = basins_of(name, number), len(cells_of(name))
    assert basins.attractors
    if name in BLOW_UP:
        assert find_basins(map_of(name), cells_of(name), attractors=basins.attractors).inaccurate == 0
        assert basins.inaccurate <= 0.01 * number
    else:
        assert basins.inaccurate == 0
    assert not (basins.labels[:cells] == Label.UNDECIDED).any()
    assert (basins.labels[:cells] >= 0).all() or name in BLOW_UP
    assert basins.labels.size == cells + number
    assert np.count_nonzero(basins.labels[cells:] == Label.UNDECIDED) <= 0.01 * number
    if name in NOT_BY_SCIPY:
        return
    for attractor in basins.attractors[:3]:
        if 0 < attractor.period <= 3:
            end = by_scipy(system, attractor.points[0], attractor.period)
            apart = np.abs(difference(end, attractor.points[0], system.axes))
            assert (apart <= 2e-5 * (1.0 + np.abs(attractor.points[0]))).all()


BY_SCIPY = ["two-well Duffing", "soft impact", "inverted pendulum", "forced Chua", "hard impact"]


@pytest.mark.parametrize(
    ("name", "number", "late", "allowed"),
    [
        *((n, 3, 12, 0) for n in BY_SCIPY[2:]),
        *(pytest.param(n, 24, 60, 1, marks=pytest.mark.thorough) for n in BY_SCIPY),
    ],
)
def test_labels_are_those_of_scipy(name, number, late, allowed):
    """Orbits that settle early, integrated further by SciPy: of 24 at most one, near a boundary, ends elsewhere."""
    system, grid = ALL[name]
    basins = basins_of(name)
    cells, span = cells_of(name), np.array(grid.upper) - np.array(grid.lower)
    times = basins.settling_time[: len(cells)]
    rows = [r for r in np.random.default_rng(1).permutation(times.size) if 0 <= times[r] < late][:number]
    elsewhere = 0
    for row in rows:
        end = by_scipy(system, cells[row], int(times[row]) + 15)
        apart = [np.abs(difference(a.points, end, system.axes) / span).max(axis=1).min() for a in basins.attractors]
        elsewhere += int(np.argmin(apart)) != basins.labels[row] or min(apart) > 0.1
    assert len(rows) == number and elsewhere <= allowed


# --- closed forms and published numbers


def test_boost_converter_in_closed_form():
    """A linear system in either position of the switch: the fixed point of the product of both flows."""
    system, _ = ALL["boost converter"]
    p = system.parameters
    on, off = np.array([[-0.5, 0.0], [0.0, 0.0]]), np.array([[-0.5, 2.0], [-1.0, 0.0]])
    source = np.array([0.0, p.supply])

    def flow(matrix, time):
        """Affine flow x -> A x + b, by the exponential of the matrix with one more row."""
        from scipy.linalg import expm

        whole = expm(time * np.block([[matrix, source[:, None]], [np.zeros((1, 3))]]))
        return whole[:2, :2], whole[:2, 2]

    (a, b), (c, d) = flow(on, p.duty), flow(off, 1.0 - p.duty)
    fixed = np.linalg.solve(np.eye(2) - c @ a, c @ b + d)
    (attractor,) = basins_of("boost converter").attractors
    assert attractor.points[0] == pytest.approx(fixed, abs=1e-7)


def test_sticking_needs_a_force_above_friction():
    """Below the largest friction force the block sticks for ever; above, it moves with the period of the force."""
    moving = basins_of("dry friction").attractors
    assert [a.kind for a in moving] == [Kind.FIXED_POINT]
    held = forced(dry_friction, QV, 0.6, friction=0.3, force=0.2)
    basins = find_basins(stroboscopic_map(held), CellGrid((-1, -1), (1, 1), (8, 8)))
    assert Kind.EQUILIBRIA in [a.kind for a in basins.attractors]


@pytest.mark.thorough
def test_stick_slip_is_a_limit_cycle_with_its_period():
    """Sticking at the speed of the belt, slipping by a smooth flow: SciPy takes the pieces in turn."""
    system, _ = ALL["stick and slip on a belt"]
    p = system.parameters
    (cycle,) = (a for a in basins_of("stick and slip on a belt").attractors if a.kind is Kind.QUASIPERIODIC)

    def slipping(t, y):
        return y[1], -y[0] + p.friction / (1 + p.belt - y[1])  # slower than the belt

    def stuck_again(t, y):
        return y[1] - p.belt if t > 1e-3 else -1.0

    stuck_again.terminal, stuck_again.direction = True, 1
    begin = p.friction, p.belt - 1e-9
    slip = solve_ivp(slipping, (0, 100), begin, "DOP853", events=stuck_again, rtol=1e-11, atol=1e-12)
    sticking = (p.friction - slip.y[0, -1]) / p.belt
    assert cycle.circle.cycle_period == pytest.approx(slip.t[-1] + sticking, rel=1e-5)


def test_kicked_rotor_in_closed_form():
    """v -> (v + k sin theta) exp(-damping), theta -> theta + (1 - exp(-damping)) / damping (v + k sin theta)."""
    system, _ = ALL["kicked rotor"]
    p, exact = system.parameters, stroboscopic_map(system, rtol=1e-11, atol=1e-11)
    theta, v = 0.7, -0.4
    after = v + p.kick * np.sin(theta)
    expected = theta + (1 - exp(-p.damping)) / p.damping * after, after * exp(-p.damping)
    assert exact([theta, v]) == pytest.approx(expected, abs=1e-10)


def test_van_der_pol_for_small_mu():
    """Without force the amplitude tends to 2, and the period to 2 pi (1 + mu^2/16)."""
    system = forced(van_der_pol, omega=1.0, mu=0.1, force=0.0)
    (cycle,) = find_basins(stroboscopic_map(system), CellGrid((-3, -3), (3, 3), (6, 6))).attractors
    assert cycle.circle.cycle_period == pytest.approx(TAU * (1 + 0.1**2 / 16), rel=1e-5)
    assert cycle.points[:, 0].max() == pytest.approx(2.0, abs=2e-3)
    assert sqrt(np.abs(cycle.points**2).sum(axis=1).max()) < 2.2
