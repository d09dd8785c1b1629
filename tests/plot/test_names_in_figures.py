"""Names that figures cannot show are refused where they are given, by argument, value and remedy."""

from __future__ import annotations

import subprocess
import sys
from math import cos
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import systems
from cellmap import CellGrid, Coordinate, ForcedSystem, angle, continue_orbit, discrete_map, periodic_orbit, plot
from cellmap import trajectory as trajectory_of
from cellmap.analysis import fit_line
from cellmap.bifurcations import OrbitFunction
from cellmap.explorer import Explored, export_html
from cellmap.explorer.serving import serve

GRID = CellGrid((-1, -1), (1, 1), (8, 8))


def half(x: Any, p: Any) -> Any:
    return p.a * x[0], x[1] / 3


def swing(t: float, x: Any, p: Any) -> Any:
    return x[1], -x[0] + p.a * cos(t)


def mapped(name: str = "", coordinates: Any = ("x", "y")) -> Any:
    return discrete_map(half, {"a": 0.5}, coordinates, name)


def forced(**given: Any) -> ForcedSystem:
    return ForcedSystem(swing, {"a": 0.5}, 2 * np.pi, **{"coordinates": ("q", "v"), **given})


def branch() -> Any:
    return continue_orbit(mapped(), periodic_orbit(mapped(), [0.0, 0.0]), "a", 0.4, 0.6)


TAKERS: dict[str, Any] = {
    "name=": mapped,
    "name= ": lambda name: mapped(coordinates=(name, "y")),
    "name=  ": lambda name: forced(name=name),
    "name=   ": lambda name: angle(name),
    "name=    ": lambda name: systems.scene(
        systems.Pendulum(1.0), systems.VerticalDrive(0.1, frequency=2.0), name=name
    ),
    "name=     ": lambda name: systems.chain_pendulum(lengths=(0.1, 0.1), masses=(1.0, 1.0), name=name),
    "unit=": lambda name: Coordinate("x", name),
    "outputs=": lambda name: forced(outputs={name: lambda t, x, p: (x[0],)}),
    r"parameter_units\['a'\]=": lambda name: forced(parameter_units={"a": name}),
    "functions=": lambda name: branch().with_zeros({name: OrbitFunction(0, value=0.5)}),
    "labels=": lambda name: fit_line([0, 1, 2], [0, 1, 2.5], (0, 2), labels=("x", name)),
    r"labels\[0\]=": lambda name: plot.time_series(
        trajectory_of(forced(), [0.1, 0.2], periods=1, samples_per_period=4), labels=[name]
    ),
}


@pytest.mark.parametrize("taker", TAKERS)
@pytest.mark.parametrize(
    "name", [r"a $\foo$ b", r"$\frac{a$", "$x^$", r"US$ \foo", "\ud800", "a\udfff", "$" + "{" * 3000 + "$"]
)
def test_names_that_cannot_be_shown_are_refused(taker: str, name: str) -> None:
    dollars = "$" in name
    remedy = r"correct it, or write \\\$ for the sign itself" if dollars else "give whole characters"
    with pytest.raises(ValueError, match=rf"^{taker.strip()}['\"].*{remedy}") as found:
        TAKERS[taker](name)
    assert len(str(found.value)) < 500


@pytest.mark.parametrize("name", ["a", r"$\theta$ and \$", "cost in $", "x' α 相", r"\foo", r"\$\foo\$"])
def test_names_that_can_be_shown_are_taken(name: str) -> None:
    """Matplotlib itself draws them, two of them in a title."""
    for taker in TAKERS.values():
        taker(name)
    figure = Figure()
    figure.suptitle(f"{name}, {name}".replace("相", ""))
    figure.draw_without_rendering()


@pytest.mark.parametrize("words", ["title", "about"])
def test_texts_of_pages_are_whole_characters(words: str, tmp_path: Any) -> None:
    """On a page dollar signs are themselves."""
    how = {"region": GRID, "progress": False, words: "\ud800"}
    with pytest.raises(ValueError, match=rf"{words}='\\ud800': give whole characters"):
        export_html(tmp_path / "a.html", mapped(), {"a": [0.5]}, **how)
    with pytest.raises(ValueError, match=r"about='\\ud800': give whole characters"):
        serve([Explored("half", mapped, GRID, about="\ud800")], open_page=False)
    assert list(tmp_path.iterdir()) == []


def test_names_without_mathematics_load_no_matplotlib() -> None:
    program = "import sys, cellmap\ncellmap.discrete_map(lambda x, p: (x[0] / 2,), {}, (sys.argv[1],))\n"
    program += "print('matplotlib' in sys.modules)"
    for name, loaded in (("x", "False"), ("$x$", "True")):
        done = subprocess.run([sys.executable, "-c", program, name], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == loaded
