"""Basins in which many initial conditions have no attractor: how many, why, and what to change."""

from math import cos, pi, sin

import pytest

from cellmap import (
    CellGrid,
    ForcedSystem,
    Label,
    angle,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    plot,
    save_basins,
    stroboscopic_map,
)
from cellmap.basins import UnsettledWarning, doubts
from cellmap.maps import Status, ToleranceWarning


def van_der_pol(t, x, p):
    return x[1], p.mu * (1 - x[0] ** 2) * x[1] - x[0] + p.force * cos(p.omega * t)


STIFF = ForcedSystem(
    van_der_pol, {"mu": 100.0, "force": 50.0, "omega": 0.05}, lambda p: 2 * pi / p.omega, ("x", "v"), name="stiff"
)
GRID = CellGrid((-2, -2), (2, 2), (4, 4))


@pytest.mark.thorough
@pytest.mark.parametrize("steps", [64, 16384])
def test_out_of_steps_with_an_explicit_method(steps):
    """The remedy is seen to help before it is given."""
    exact = stroboscopic_map(STIFF, method="DOP853", max_steps=steps, rtol=1e-6, atol=1e-6)
    with pytest.warns(UnsettledWarning, match=r"100.0% .* 8 of 8 tried reach the end .* with method='Rosenbrock'"):
        basins = find_basins(exact, GRID, max_periods=4)
    assert (basins.labels == Label.OUT_OF_STEPS).all()


def test_out_of_steps_is_not_divergence(tmp_path):
    """A fast forcing needs more steps than are allowed; the label is kept in files and has a colour."""

    def rhs(t, x, p):
        return x[1], -x[0] - 0.1 * x[1] + sin(x[0] * 40) * 300

    system = ForcedSystem(rhs, {}, 20.0, ("x", "v"))
    exact = stroboscopic_map(system, method="DOP853", max_steps=32)
    with pytest.warns(ToleranceWarning, match="2 of 2 orbits of rhs are out of steps"):
        assert (exact.iterate([[0.5, 0.1], [1.0, 3.0]], 1).status == Status.OUT_OF_STEPS).all()
    with pytest.warns(UnsettledWarning, match=r"100.0% .* are out of steps: 8 of 8 tried .* max_steps=16384"):
        basins = find_basins(exact, GRID, max_periods=4)
    assert (basins.labels == Label.OUT_OF_STEPS).all()
    assert "out of steps 100 %" in repr(basins)
    assert (load_basins(save_basins(basins, tmp_path / "b.h5")).labels == Label.OUT_OF_STEPS).all()
    assert plot.basins(basins) is not None


def test_true_divergence_brings_no_warning(recwarn):
    """x' = x^2 from x > 1 reaches infinity within a period, with any method."""
    system = ForcedSystem(lambda t, x, p: (x[0] ** 2 - x[0],), {}, 1.0, ("x",))
    basins = find_basins(stroboscopic_map(system), CellGrid((1.0,), (9.0,), (20,)), max_periods=200)
    assert basins.fractions[Label.DIVERGED].fraction > 0.9
    assert not [w for w in recwarn if w.category is UnsettledWarning]


UNBOUNDED = {
    "negative damping": (lambda t, x, p: (x[1], 0.1 * x[1] - x[0] + cos(t)), "x and v"),  # exp(0.05 t) exactly
    "a well of fourth order": (lambda t, x, p: (x[1], 0.1 * x[1] + x[0] - x[0] ** 3 + 0.3 * cos(t)), "x and v"),
    "resonance": (lambda t, x, p: (x[1], -x[0] + cos(t)), "v"),  # x = t sin(t) / 2 is 0 after each period
    "a saddle": (lambda t, x, p: (0.05 * x[0] + cos(t), -x[1]), "x"),
}


@pytest.mark.parametrize(
    "name", ["resonance", *(pytest.param(k, marks=pytest.mark.thorough) for k in UNBOUNDED if k != "resonance")]
)
def test_orbits_that_nothing_bounds(name):
    """No method and no number of periods helps where the solutions grow for ever."""
    rhs, names = UNBOUNDED[name]
    exact = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("x", "v")))
    with pytest.warns(UserWarning) as caught:
        basins = find_basins(exact, GRID, max_periods=1100)
    assert not basins.attractors
    (said,) = [str(w.message) for w in caught if w.category is UnsettledWarning]
    assert f"nothing bounds the orbits: 8 of 8 tried grow ever farther in {names}, to " in said
    assert "Rosenbrock" not in said and "max_periods" not in said


def test_a_map_whose_orbits_grow():
    with pytest.warns(UnsettledWarning, match=r"nothing bounds the orbits: 8 of 8 .* in x, to .* check the signs"):
        find_basins(discrete_map(lambda x, p: (1.01 * x[0], 0.5 * x[1]), {}, ("x", "y")), GRID, max_periods=1100)


def test_a_remedy_that_was_tried_led_to_an_attractor(monkeypatch):
    """y follows cos(t) at once: x' = -x + y has one stable solution of period 2 pi."""
    system = ForcedSystem(lambda t, x, p: (x[1] - x[0], 1e5 * (cos(t) - x[1])), {}, 2 * pi, ("x", "y"))
    exact = stroboscopic_map(system, method="DOP853", max_steps=64)
    with pytest.warns(UnsettledWarning, match=r"8 of 8 tried reach .* with method='Rosenbrock', and 8 of them an attr"):
        find_basins(exact, GRID)
    monkeypatch.setattr(doubts, "_AFFORDED", 0)
    with pytest.warns(UnsettledWarning, match=r"8 of 8 tried reach .*; whether they come to an attractor was not tri"):
        find_basins(exact, GRID)


@pytest.mark.parametrize("coordinate", ["theta", angle("theta")], ids=str)
def test_rotations_of_what_is_no_angle(coordinate, recwarn):
    """A rotor under a constant torque turns without end; -1 <= sin < 1.5, so that there is nothing else."""

    def rhs(t, x, p):
        return x[1], 1.5 - sin(x[0]) - 0.5 * x[1] + 0.1 * cos(t)

    rotor = ForcedSystem(rhs, {}, 2 * pi, (coordinate, "w"))
    find_basins(stroboscopic_map(rotor), CellGrid((-pi, -1), (pi, 1), (4, 4)), max_periods=200)
    found = [str(w.message) for w in recwarn if w.category is UnsettledWarning]
    assert [m.endswith("if orbits may turn, give angle('theta')") for m in found] == [True] * (coordinate == "theta")


def test_orbits_beside_a_neutral_point_ask_for_other_parameters():
    """x - x^3 comes to 0 like 1/sqrt(n): no number of periods is enough."""
    with pytest.warns(UnsettledWarning, match=r"like n\^-0.5; move the parameters away"):
        find_basins(discrete_map(lambda x, p: (x[0] - x[0] ** 3,), {}, ("x",)), [[0.3], [0.2]], max_periods=300)


def test_escaped_orbits_ask_for_a_larger_window():
    doubling = discrete_map(lambda x, p: (1.5 * x[0] - 0.2 * x[0] ** 3,), {}, ("x",))
    table = interpolated_map(doubling, CellGrid((-1,), (1,), (64,)), outside="escape")
    with pytest.warns(UnsettledWarning, match=r"escaped .* outside='integrate'"):
        find_basins(table, CellGrid((-1,), (1,), (64,)))


def test_few_without_attractor_bring_no_warning(recwarn):
    """Two of 100 initial conditions diverge."""
    cubic = discrete_map(lambda x, p: (x[0] ** 3,), {}, ("x",))
    find_basins(cubic, CellGrid((-1.02,), (1.02,), (102,)))
    assert not recwarn.list
