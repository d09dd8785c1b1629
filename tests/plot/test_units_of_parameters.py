"""Units of parameters on axes: declared by a system, carried by its maps and by what is computed from them."""

from __future__ import annotations

from dataclasses import replace

import matplotlib as mpl
import pytest

from cellmap import (
    CellGrid,
    ForcedSystem,
    bifurcation_diagram,
    continue_orbit,
    interpolated_map,
    periodic_orbit,
    plot,
    stability_map,
    stroboscopic_map,
)
from cellmap.basins import continue_basins
from cellmap.bifurcations import attractor_atlas
from cellmap.exchange import from_xarray

mpl.use("Agg")


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
    mpl.pyplot.close("all")


def test_maps_have_the_units_of_their_system(damped: ForcedSystem) -> None:
    table = interpolated_map(stroboscopic_map(damped), CellGrid((-1, -1), (1, 1), (8, 8)))
    assert table.with_params(loss=0.3).parameter_units == {"stiffness": "N/m"}
    assert stroboscopic_map(replace(damped, parameter_units={})).parameter_units == {}
    with pytest.raises(ValueError, match="parameter_units='length': this system has the parameters"):
        replace(damped, parameter_units={"length": "m"})
    with pytest.raises(TypeError, match="'loss'"):
        replace(damped, parameter_units={"loss": 1})
