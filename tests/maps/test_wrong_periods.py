"""Periods that are slightly wrong are refused, right ones are not: also where a forcing rests between its jumps."""

from math import copysign, cos, exp, floor, fmod, pi, sin, tanh

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, find_basins, stroboscopic_map
from cellmap.maps import Impact, flow_map, section_map


def forced(force, period, **more) -> ForcedSystem:
    return ForcedSystem(
        lambda t, x, p: (x[1], force(t + 0.0) - x[0] - p.d * x[1]), {"d": 0.2}, period, ("x", "v"), **more
    )


def square(t):
    return 1.0 if t % 1.0 < 0.25 else -1.0


def sawtooth(t):
    t -= floor(t)  # of an array: in place
    return t


VALUES = [1.0, 3.0, 2.0, 5.0, 5.0, 0.0, 1.0]
TERMS = ((7, 100), (116, 200), (252, 300), (308, 356))

# Each with period 1.
FORCES = {
    "square": square,
    "square, by signs": lambda t: copysign(1.0, sin(2 * pi * t)),
    "small square in a large cosine": lambda t: 5.0 * cos(2 * pi * t) + 0.2 * square(t),
    "school terms": lambda t: 1.29 if any(a <= 365 * (t % 1) < b for a, b in TERMS) else 0.95,
    "shorter pulse, with numpy": lambda t: np.where(t % 1.0 < 0.002, 1.0, 0.0),
    "smooth pulse": lambda t: exp(-2000.0 * sin(pi * t - 0.3) ** 2),
    "steep": lambda t: tanh(200.0 * sin(2 * pi * t)),
    "staircase of a list": lambda t: VALUES[int((t % 1.0) * 7)],
    "modulated pulses": lambda t: 1.0 if (20 * t) % 1.0 < 0.5 + 0.3 * sin(2 * pi * t) else 0.0,
    "sawtooth": sawtooth,
}


@pytest.mark.parametrize("force", FORCES.values(), ids=FORCES)
def test_a_slightly_wrong_period_is_refused(force) -> None:
    for period in (1.0, 3.0, 1.0 + 1e-11):
        assert forced(force, period).length == period
    for period in (0.999, 1.001, 1.0 + 1e-5, 3.003):
        with pytest.raises(ValueError, match=r"period=.*: rhs at t = .* and one period later"):
            forced(force, period)


def test_right_periods_of_any_size_are_not_refused() -> None:
    """Rounding moves a switch by some 1e-16 of the time, and no more."""
    rng = np.random.default_rng(0)
    for period, on, phase in zip(
        10 ** rng.uniform(-8, 8, 12), rng.uniform(0.05, 0.95, 12), rng.random(12), strict=True
    ):
        for force in (
            lambda t: 1.0 if (t / period + phase) % 1.0 < on else 0.0,  # noqa: B023
            lambda t: 1.0 if fmod(t, period) < on * period else 0.0,  # noqa: B023
            lambda t: np.where(sin(2 * pi / period * t) > on, 1.0, -1.0),  # noqa: B023
            lambda t: floor(t / period + phase) - t / period,  # noqa: B023
        ):
            forced(force, 2 * period)


@pytest.mark.parametrize("frequency", [1.3, 1.0 + 1e-4])
def test_impacts_with_another_period_are_refused(frequency) -> None:
    def wall(t, x, p):
        return x[0] - 2.0 - 0.1 * cos(frequency * t)

    def bounce(t, x, p):
        return x[0], -0.8 * x[1] + 0.1 * sin(frequency * t)

    still = Impact(lambda t, x, p: x[0] - 2.0, lambda t, x, p: (x[0], -0.8 * x[1]))
    for guard, reset, name in ((wall, still.reset, "guard"), (still.guard, bounce, "reset")):
        with pytest.raises(ValueError, match=rf"period=6.28.*: impacts\[0\].{name} at t = (.*) and one period later"):
            forced(cos, 2 * pi, impacts=[Impact(guard, reset)])
    square_wall = Impact(lambda t, x, p: x[0] - (2.0 if t % (2.001 * pi) < 3.0 else 1.0), still.reset)
    with pytest.raises(ValueError, match=r"impacts\[0\].guard at t = 3"):
        forced(cos, 2 * pi, impacts=[square_wall])
    together = 20 * pi if frequency == 1.3 else 20000 * pi
    assert forced(cos, together, impacts=[Impact(wall, bounce)]).length == together


def test_short_pulses_and_moving_walls_are_no_autonomous_systems() -> None:
    """Neither is at the few times at which one looks first."""
    pulses = forced(lambda t: 1.0 if 0.3 < t % 1.0 < 0.35 else 0.0, 1.0)
    moving = Impact(lambda t, x, p: x[0] - 2.0 - 0.1 * sin(2 * pi * t), lambda t, x, p: (x[0], -x[1]))
    walls = forced(lambda t: 0.0, 1.0, impacts=[moving])
    for make in (lambda: section_map(pulses, ("x", 0.0, 1)), lambda: flow_map(walls, 2.0)):
        with pytest.raises(ValueError, match="depends on time"):
            make()


def test_values_that_are_infinite_for_a_while_bring_no_warning() -> None:
    """Times are looked at that no orbit needs to reach; a warning is an error here."""
    for force in (lambda t: np.inf if t % 1.0 < 0.4 else 1.0, lambda t: float(np.log(np.cos(2 * pi * t)))):
        assert forced(force, 1.0).length == 1.0


CASES = {
    "5 Hz as a period": (lambda t: cos(2 * pi * 5 * t), 5.0, 25),
    "two frequencies": (lambda t: cos(t) + 0.01 * cos(3 * t), 2 * pi, 1),
    "a subharmonic": (lambda t: cos(6 * t) + 1e-4 * sin(2 * t), 2 * pi, 2),
    "a thousand": (lambda t: sin(2000 * pi * t), 1.0, 1000),
    "a pulse": (lambda t: exp(-200.0 * sin(t / 2) ** 2), 6 * pi, 3),
    "a square wave": (square, 1.0, 1),
    "a short rectangular pulse": (lambda t: 1.0 if t % 1.0 < 0.002 else 0.0, 1.0, 1),
    "rest between half waves": (lambda t: max(0.0, sin(2 * pi * t) - 0.999), 1.0, 1),
    "one pulse in a fast drive": (lambda t: cos(10 * t) + exp(-50.0 * sin(t / 2) ** 2), 2 * pi, 1),
}


@pytest.mark.parametrize(("force", "period", "number"), CASES.values(), ids=CASES)
def test_the_shortest_period_that_is_seen(force, period, number) -> None:
    system = forced(force, period)
    assert system.shortest_period == pytest.approx(period / number, rel=1e-15)
    assert (f"{number} times the shortest" in repr(system)) == (number > 1)
    assert (f"repeats {number} times in period=" in system.cycles) == (number > 1)
    if number > 1:
        times = np.random.default_rng(0).uniform(0.0, period, 50)
        assert [force(t + period / number) for t in times] == pytest.approx([force(t) for t in times], abs=1e-6)


def test_time_that_plays_no_part_has_no_shortest_period() -> None:
    system = forced(lambda t: 0.0, 3.0)
    assert (system.shortest_period, system.cycles) == (0.0, "") and "shortest" not in repr(system)
    kicked = forced(lambda t: 0.0, 2.0, impacts=[Impact(lambda t, x, p: sin(pi * t), lambda t, x, p: (x[0], x[1] + 1))])
    assert kicked.shortest_period == 2.0
    assert forced(lambda t: cos(2 * t), lambda p: 2 * pi).with_params(d=0.3).shortest_period == pytest.approx(pi)


def test_a_warning_of_slow_images_names_the_period(recwarn) -> None:
    """A thousand cycles need more steps than there are; three that are wanted bring no warning."""
    find_basins(stroboscopic_map(forced(lambda t: cos(t), 6 * pi)), CellGrid((-1, -1), (1, 1), (4, 4)))
    assert not recwarn.list
    fast = forced(lambda t: cos(2 * pi * 500 * t), 2.0)
    exact = stroboscopic_map(fast, method="DOP853", max_steps=64)
    with pytest.warns(UserWarning) as caught:
        find_basins(exact, CellGrid((-1, -1), (1, 1), (4, 4)), max_periods=4)
    assert any("rhs repeats 1000 times in period=2: give 0.002" in str(w.message) for w in caught)
