"""What certificates cost besides the work of compiled loops."""

from __future__ import annotations

from math import pi

from cellmap import CellGrid, certify, find_basins, interpolated_map, stroboscopic_map
from cellmap._compiled.loops import Loop
from systems import driven_pendulum


def test_loops_take_what_they_are_given_as_it_is(monkeypatch) -> None:
    """An argument of another type than before, an enum or a bool, costs a look at all of them in each period."""
    exact = stroboscopic_map(driven_pendulum(amplitude=0.002))
    icm = interpolated_map(exact, CellGrid((-pi, -300), (pi, 300), (96, 96)))
    basins = find_basins(icm, CellGrid((-pi, -200), (pi, 200), (20, 20)))
    certify(basins)
    looks: list[str] = []
    other_types = Loop._other_types

    def counted(self, arguments):
        looks.append(self.function.__name__)
        return other_types(self, arguments)

    monkeypatch.setattr(Loop, "_other_types", counted)
    certify(basins)
    assert looks == []
