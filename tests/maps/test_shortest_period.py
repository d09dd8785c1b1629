"""Periods that are a whole multiple of that of the right-hand side."""

from __future__ import annotations

from math import cos, exp, pi, sin

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, find_basins, stroboscopic_map
from cellmap.maps import Impact
from cellmap.maps.coordinates import as_coordinates


def forced(force, period, **more) -> ForcedSystem:
    return ForcedSystem(lambda t, x, p: (x[1], force(t) - x[0] - p.d * x[1]), {"d": 0.2}, period, ("x", "v"), **more)


CASES = {
    "5 Hz as a period": (lambda t: cos(2 * pi * 5 * t), 5.0, 25),
    "50 Hz as a period": (lambda t: cos(100 * pi * t), 1.0, 50),
    "three periods": (lambda t: cos(t), 6 * pi, 3),
    "two frequencies": (lambda t: cos(t) + 0.01 * cos(3 * t), 2 * pi, 1),
    "a subharmonic": (lambda t: cos(6 * t) + 1e-4 * sin(2 * t), 2 * pi, 2),
    "a thousand": (lambda t: sin(2000 * pi * t), 1.0, 1000),
    "half a period of a square": (lambda t: cos(t) ** 2, 2 * pi, 2),
    "a pulse": (lambda t: exp(-200.0 * sin(t / 2) ** 2), 6 * pi, 3),
    "a square wave": (lambda t: 1.0 if t % 1.0 < 0.25 else -1.0, 1.0, 1),
    "three square waves": (lambda t: 1.0 if t % 1.0 < 0.25 else -1.0, 3.0, 3),
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


def test_a_warning_of_slow_images_names_the_period() -> None:
    """A thousand cycles need more steps than there are."""
    fast = forced(lambda t: cos(2 * pi * 500 * t), 2.0)
    exact = stroboscopic_map(fast, method="DOP853", max_steps=64)
    with pytest.warns(UserWarning) as caught:
        find_basins(exact, CellGrid((-1, -1), (1, 1), (4, 4)), max_periods=4)
    assert any("rhs repeats 1000 times in period=2: give 0.002" in str(w.message) for w in caught)


def test_three_cycles_that_are_wanted_bring_no_warning(recwarn) -> None:
    find_basins(stroboscopic_map(forced(lambda t: cos(t), 6 * pi)), CellGrid((-1, -1), (1, 1), (4, 4)))
    assert not recwarn.list


def test_grids_and_coordinates_of_another_kind_say_what_to_give() -> None:
    exact = stroboscopic_map(forced(lambda t: cos(t), 2 * pi))
    with pytest.raises(ValueError, match=r"has 1 axis and .*: x, v; initial_conditions=CellGrid.*: give one entry"):
        find_basins(exact, CellGrid((-2,), (2,), (40,)))
    with pytest.raises(TypeError, match=r"coordinates=2: give the names of the state variables"):
        as_coordinates(2)  # type: ignore[arg-type]
