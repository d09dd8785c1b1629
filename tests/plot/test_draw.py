"""One function for the figures of all results, and one contract for what they return; what is loaded when."""

import importlib
import inspect
import subprocess
import sys
from collections.abc import Callable
from typing import Any, get_type_hints

import matplotlib.pyplot as plt
import pytest
from matplotlib.axes import Axes

import cellmap
from cellmap import CellGrid, discrete_map, find_basins, plot
from cellmap._lib.signatures import makers
from cellmap.analysis.resilience import largest_ball, minimal_fatal_shock
from cellmap.plot._draw import FIGURES

PANELS = {"time_series", "bifurcation_diagram", "basin_continuation"}
NO_FIGURE = {
    *("Attractor", "Bifurcation", "CodimensionTwo", "ConnectingOrbit", "FunctionZero", "OrbitFunction"),
    *("PeriodicOrbit", "PointMap", "Refinement", "Tangency", "FloquetResult", "Iterate", "NormalForm"),
    *("BranchSearch", "Cascade", "CodimensionTwoCurve", "CodimensionTwoForm", "Coordinate", "CriticalValue"),
    *("OrbitClusters", "ProvedOrbit", "RandomStates", "SectionMap", "SubdivisionSearch", "TangencyCurve"),
}
"""Records that functions return, and that have no figure."""

FITTED = {"BoxCount", "CorrelationSum", "EscapeRate"}
"""Records that are drawn by the fit that they have."""

ROOMS = (
    *("maps", "orbits", "bifurcations", "attractors", "basins", "sets"),
    *("analysis.fractal", "analysis.resilience", "analysis.boundary"),
)


def room_of(name: str) -> Any:
    return importlib.import_module(f"cellmap.{name}")


def figures() -> dict[str, Callable[..., Any]]:
    """Return the figures of all records, by the names of these."""
    assert all(getattr(plot, name) for name in plot.__all__)
    return {kind.__name__: function for kind, function in FIGURES.items()}


@pytest.fixture(scope="module")
def results():
    wells = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3, 0.5 * x[1]), {"r": 1.5}, ("x", "y"))
    basins = find_basins(wells, CellGrid((-1.2, -1.0), (1.2, 1.0), (24, 20)))
    return {"Basins": basins, "Ball": largest_ball(basins, 0), "FatalShock": minimal_fatal_shock(basins, 0)}


def test_every_record_with_a_figure_is_drawn_by_it():
    """Each function of `plot` but `draw` and `animate` draws what `draw` hands to it, and no record is forgotten."""
    known = figures()
    second = {"phase_portrait", "invariant_measure", "eigenvector", "fractions"}  # of records that have another figure
    assert {function.__name__ for function in known.values()} | second == set(plot.__all__) - {"draw", "animate"}
    public = {name: getattr(room, name) for room in map(room_of, ROOMS) for name in room.__all__}
    records = {name for name, member in public.items() if inspect.isclass(member) and makers(member)}
    assert records - NO_FIGURE - FITTED <= set(known)
    for record, function in known.items():
        assert getattr(plot, function.__name__) is function, record


def test_what_a_figure_returns_is_what_its_signature_says():
    for name in set(plot.__all__) - {"draw", "animate"}:
        parameters = inspect.signature(getattr(plot, name)).parameters
        first, *rest = parameters.values()
        assert first.kind is first.POSITIONAL_OR_KEYWORD
        assert all(p.kind in (p.KEYWORD_ONLY, p.VAR_KEYWORD) for p in rest), name
        assert parameters["ax"].default is None
        hint = get_type_hints(inspect.unwrap(getattr(plot, name)))["return"]
        assert hint == (tuple[Axes, ...] if name in PANELS else Axes), name


def test_what_is_drawn_on_basins_asks_for_them(results):
    for record in ("Ball", "FatalShock"):
        with pytest.raises(TypeError, match=f"basins is missing: a {record} is drawn on basins"):
            plot.draw(results[record])
        assert isinstance(plot.draw(results[record], basins=results["Basins"]), Axes)


@pytest.mark.parametrize("result", [3, None, [1.0], CellGrid((0,), (1,), (4,)), type("Basins", (), {})()])
def test_what_has_no_figure_is_refused(result):
    message = r"result=.*: there is no figure of it; give one of ArnoldTongue, AttractorAtlas, Ball, .*Wada"
    with pytest.raises(TypeError, match=message):
        plot.draw(result)
    assert plt.get_fignums() == []


PROGRAM = """
import sys
import cellmap, cellmap.explorer
from cellmap.explorer import Explored, explore

def loaded(names):
    return sorted(set(names.split()) & set(sys.modules))

assert not loaded("starlette uvicorn websockets asyncio systems")
import systems
heavy = "matplotlib sklearn h5py scipy.integrate scipy.ndimage pandas xarray numba"
assert not loaded(heavy), loaded(heavy)
assert "plot" in dir(cellmap) and "save_basins" in cellmap.__all__
cellmap.discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))
assert not loaded("matplotlib")
cellmap.discrete_map(lambda x, p: (x[0] / 2,), {}, ("$x$",))
assert loaded("matplotlib")
from cellmap.plot import draw
assert not [m for m in sys.modules if m.startswith("cellmap.analysis.") or m == "numba"]
assert not loaded("cellmap.plot._basins h5py")
cellmap.plot.basins, cellmap.basins.StoreError
assert loaded("cellmap.plot._basins h5py matplotlib") == ["cellmap.plot._basins", "h5py", "matplotlib"]
"""


def test_what_is_loaded_when():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_public_name_exists_and_no_other():
    for name in cellmap.__all__:
        assert getattr(cellmap, name).__doc__
    with pytest.raises(AttributeError, match="No cellmap attribute plot_basin"):
        cellmap.plot_basin  # noqa: B018
