"""Names and units in figures: of attractors, parameters and axes; those that cannot be shown are refused."""

from dataclasses import replace
from functools import cache
from math import cos, pi, tanh
from typing import Any

import numpy as np
import pytest
from legends import legend_of
from matplotlib.figure import Figure

import systems
from cellmap import Attractor, CellGrid, Coordinate, ForcedSystem, angle, discrete_map, find_basins, plot
from cellmap import trajectory as trajectory_of
from cellmap.analysis import fit_line
from cellmap.basins import continue_basins
from cellmap.bifurcations import OrbitFunction, attractor_atlas, bifurcation_diagram, continue_orbit, stability_map
from cellmap.exchange import from_xarray
from cellmap.explorer import Explored, export_html
from cellmap.explorer.serving import serve
from cellmap.maps import interpolated_map, stroboscopic_map
from cellmap.orbits import Kind, periodic_orbit
from cellmap.orbits.attractor import distinct_names


def test_mirror_images_have_names_of_their_own():
    """In each half of the plane x stays and y goes to and fro, on the right from -1.31 to 1.69."""

    def rhs(x, p):
        return 2.0 * tanh(2.0 * x[0]), -1.5 * tanh(3.0 * x[1]) + 0.2 * tanh(x[0])

    basins = find_basins(discrete_map(rhs, {}, ("x", "y")), CellGrid((-3, -3), (3, 3), (20, 20)))
    assert [a.name for a in basins.attractors] == ["periodic, period 2"] * 2
    names = [entry.rpartition(":")[0] for entry in legend_of(plot.basins(basins))]
    assert names == ["periodic, period 2, through (2, -1.31)", "periodic, period 2, through (-2, 1.31)"]


CYLINDER = (angle("theta"), Coordinate("v"))


def fixed_point(*place, coordinates=CYLINDER):
    points = np.array([place])
    return Attractor(Kind.FIXED_POINT, 1, points, (0, 0), np.zeros(2, complex), np.zeros(2), coordinates)


def test_angles_of_fixed_points_are_readable_and_close_ones_have_more_digits():
    from_zero, degrees = (angle("theta", lower=0.0), Coordinate("v")), (angle("theta", "deg", 360.0), Coordinate("v"))
    for attractor, place in (
        (fixed_point(-pi, 0.0), "π, 0"),
        (fixed_point(pi - 1e-9, 1e-12), "π, 0"),
        (fixed_point(1e-12, -1.5), "0, -1.5"),
        (fixed_point(3.14, pi), "3.14, 3.14"),
        (fixed_point(1e-9, 0.0, coordinates=from_zero), "0, 0"),
        (fixed_point(pi, 0.0, coordinates=from_zero), "π, 0"),
        (fixed_point(-180.0, 0.0, coordinates=degrees), "180, 0"),
    ):
        assert attractor.name == f"fixed point ({place})"
    close = [fixed_point(1.0001, 0.0), fixed_point(1.0002, 0.0), fixed_point(0.5, 0.0)]
    assert [a.name for a in close[:2]] == ["fixed point (1, 0)"] * 2
    assert distinct_names(close) == ("fixed point (1.0001, 0)", "fixed point (1.0002, 0)", "fixed point (0.5, 0)")
    assert distinct_names(close[:1] * 2) == ("fixed point (1.0001, 0)",) * 2


@pytest.fixture(scope="module")
def damped() -> ForcedSystem:
    """An oscillator in SI units, the loss of which is a pure number."""
    return ForcedSystem(
        lambda t, x, p: (x[1], -p.stiffness * x[0] - p.loss * x[1]),
        {"stiffness": 1.0, "loss": 0.2},
        period=1.0,
        coordinates=("q", "v"),
        parameter_units={"stiffness": "N/m"},
    )


def test_axes_of_parameters_have_the_units_that_a_system_declares(damped: ForcedSystem) -> None:
    exact = stroboscopic_map(damped.with_params(loss=0.3))
    classes = stability_map(damped, [0.0, 0.0], ("loss", [-0.1, 0.1, 0.2]), ("stiffness", [1.0, 1.1, 1.2]))
    diagram = bifurcation_diagram(exact, "stiffness", [1.0, 1.2], [0.1, 0.0], transient=4, periods=64)
    atlas = attractor_atlas(exact, ("stiffness", [1.0, 1.1]), ("loss", [0.3, 0.4]), [[0.1, 0.0]], max_periods=200)
    branch = continue_orbit(exact, periodic_orbit(exact, [0.0, 0.0]), "stiffness", 0.9, 1.2)
    sweep = continue_basins(exact, "stiffness", [1.0, 1.1], CellGrid((-1, -1), (1, 1), (4, 4)))
    for result in (classes, from_xarray(classes.to_xarray())):
        ax = plot.stability_map(result)
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("loss", "stiffness (N/m)")
    assert plot.attractor_atlas(atlas).get_xlabel() == "stiffness (N/m)"
    assert plot.bifurcation_diagram(from_xarray(diagram.to_xarray()))[-1].get_xlabel() == "stiffness (N/m)"
    assert plot.basin_continuation(from_xarray(sweep.to_xarray()))[-1].get_xlabel() == "stiffness (N/m)"
    assert plot.branches(branch).get_xlabel() == "stiffness (N/m)"


def test_maps_have_the_units_of_their_system(damped: ForcedSystem) -> None:
    table = interpolated_map(stroboscopic_map(damped), CellGrid((-1, -1), (1, 1), (8, 8)))
    assert table.with_params(loss=0.3).parameter_units == {"stiffness": "N/m"}
    assert stroboscopic_map(replace(damped, parameter_units={})).parameter_units == {}
    with pytest.raises(ValueError, match="parameter_units='length': this system has the parameters"):
        replace(damped, parameter_units={"length": "m"})
    with pytest.raises(TypeError, match="'loss'"):
        replace(damped, parameter_units={"loss": 1})


GRID = CellGrid((-1, -1), (1, 1), (8, 8))


def half(x: Any, p: Any) -> Any:
    return p.a * x[0], x[1] / 3


def swing(t: float, x: Any, p: Any) -> Any:
    return x[1], -x[0] + p.a * cos(t)


def mapped(name: str = "", coordinates: Any = ("x", "y")) -> Any:
    return discrete_map(half, {"a": 0.5}, coordinates, name)


def forced(**given: Any) -> ForcedSystem:
    return ForcedSystem(swing, {"a": 0.5}, 2 * np.pi, **{"coordinates": ("q", "v"), **given})


@cache
def branch() -> Any:
    return continue_orbit(mapped(), periodic_orbit(mapped(), [0.0, 0.0]), "a", 0.4, 0.6)


@cache
def trajectory() -> Any:
    return trajectory_of(forced(), [0.1, 0.2], periods=1, samples_per_period=4)


PENDULUM = systems.Pendulum(1.0)
TAKERS: dict[str, Any] = {
    "name=": mapped,
    "name= ": lambda name: mapped(coordinates=(name, "y")),
    "name=  ": lambda name: forced(name=name),
    "name=   ": lambda name: angle(name),
    "name=    ": lambda name: systems.scene(PENDULUM, systems.VerticalDrive(0.1, frequency=2.0), name=name),
    "name=     ": lambda name: systems.chain_pendulum(lengths=(0.1, 0.1), masses=(1.0, 1.0), name=name),
    "unit=": lambda name: Coordinate("x", name),
    "outputs=": lambda name: forced(outputs={name: lambda t, x, p: (x[0],)}),
    r"parameter_units\['a'\]=": lambda name: forced(parameter_units={"a": name}),
    "functions=": lambda name: branch().with_zeros({name: OrbitFunction(0, value=0.5)}),
    "labels=": lambda name: fit_line([0, 1, 2], [0, 1, 2.5], (0, 2), labels=("x", name)),
    r"labels\[0\]=": lambda name: plot.time_series(trajectory(), labels=[name]),
}
UNFIT = (r"a $\foo$ b", r"$\frac{a$", "$x^$", r"US$ \foo", "\ud800", "a\udfff", "$" + "{" * 3000 + "$")


@pytest.mark.parametrize("taker", TAKERS)
def test_names_that_cannot_be_shown_are_refused(taker: str) -> None:
    for name in UNFIT:
        remedy = r"correct it, or write \\\$ for the sign itself" if "$" in name else "give whole characters"
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


def test_texts_of_pages_are_whole_characters(tmp_path: Any) -> None:
    """On a page dollar signs are themselves."""
    for words in ("title", "about"):
        how = {"region": GRID, "progress": False, words: "\ud800"}
        with pytest.raises(ValueError, match=rf"{words}='\\ud800': give whole characters"):
            export_html(tmp_path / "a.html", mapped(), {"a": [0.5]}, **how)
    with pytest.raises(ValueError, match=r"about='\\ud800': give whole characters"):
        serve([Explored("half", mapped, GRID, about="\ud800")], open_page=False)
    assert list(tmp_path.iterdir()) == []
