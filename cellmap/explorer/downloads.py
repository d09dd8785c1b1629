"""Downloads: a script that computes the image again, and files with the basins."""

from __future__ import annotations

import hashlib
import tempfile
from pathlib import Path
from typing import Any

from ..basins.live import LiveFrame
from ..basins.store import save_basins
from ..exchange.datasets import to_xarray
from ..maps.system import ForcedSystem
from .explored import MOST_STEPS, Explored
from .view import View

_SEEDS = 2  # points of an attractor from which a script finds it again


def script(explored: Explored, view: View, frame: LiveFrame) -> str:
    """Return a program whose labels are those of a complete image, to the bit.

    It finds the attractors from points on them, so that those without an initial condition in the window have their
    numbers too, and compares its labels with those of the image.
    """
    basins = frame.basins
    digest = hashlib.sha256(basins.labels.tobytes()).hexdigest()
    settings = {"max_periods": basins.settings["max_periods"], "longest_period": basins.settings["longest_period"]}
    options = ", ".join(f"{name}={value}" for name, value in settings.items())
    seeds = [p for a in basins.attractors for p in a.points[:_SEEDS].tolist()]
    params = ", ".join(f"{name}={value!r}" for name, value in view.params.items())
    lines = ['"""Basins of attraction, as the explorer of cellmap has shown them."""', "", "import hashlib", ""]
    lines += ["import numpy as np" if len(view.axes) < len(view.others) else "", _source(explored)]
    if isinstance(explored.system, ForcedSystem):
        exact = f"stroboscopic_map(system.with_params({params}), phase={view.phase!r}, "
        exact += f"rtol={view.tolerance!r}, atol={view.tolerance!r}, max_steps={MOST_STEPS})"
    else:
        exact = f"system.with_params({params})" if params else "system"
    used = ["find_basins", "plot", *(["find_attractors"] if seeds else [])]
    used += ["stroboscopic_map"] if "stroboscopic" in exact else []
    body = [f"point_map = {exact}"]
    if view.nodes:
        used.append("interpolated_map")
        grid = explored.table_grid(view.nodes)
        body.append(f"point_map = interpolated_map(point_map, CellGrid({grid.lower}, {grid.upper}, {grid.shape}))")
    body += _initial_conditions(view, basins.grid)
    if seeds:
        body.append(f"attractors = find_attractors(point_map, {seeds}, {options})")
        options += ", attractors=attractors"
    body.append(f"basins = find_basins(point_map, initial_conditions, {options})")
    used += ["CellGrid"] if any("CellGrid" in line for line in body) else []
    lines += [f"from cellmap import {', '.join(sorted(used, key=str.lower))}", "", *body, ""]
    lines += [
        f'same = hashlib.sha256(basins.labels.tobytes()).hexdigest() == "{digest}"',
        "print(basins)",
        'print("the labels are those of the explorer" + (", bit by bit" if same else " no longer"))',
        "",
        'if __name__ == "__main__":',
        "    import matplotlib.pyplot as plt",
        "",
        "    plot.basins(basins)" if len(view.axes) == 2 == len(view.others) else "    plot.draw(basins)",
        '    plt.savefig("basins.png", dpi=200)',
    ]
    return "\n".join(line for k, line in enumerate(lines) if line or lines[k - 1]) + "\n"


def _source(explored: Explored) -> str:
    if explored.source:
        return explored.source
    return "from my_module import system  # the system that was given to cellmap.explore"


def _initial_conditions(view: View, grid: Any) -> list[str]:
    if grid is not None:
        return [f"initial_conditions = CellGrid({grid.lower}, {grid.upper}, {grid.shape})"]
    lines = [
        f"plane = CellGrid({view.lower}, {view.upper}, {view.cells})",
        f"initial_conditions = np.empty((*plane.shape, {len(view.others)}))",
        f"initial_conditions[:] = {view.others}",
    ]
    return [*lines, f"initial_conditions[..., {list(view.axes)}] = plane.centres()"]


def hdf5(frame: LiveFrame) -> tuple[dict[str, Any], bytes]:
    """Return a file of the basins, for :func:`load_basins`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "basins.h5"
        save_basins(frame.basins, path)
        return {"name": "basins.h5", "media": "application/x-hdf5"}, path.read_bytes()


def netcdf(frame: LiveFrame) -> tuple[dict[str, Any], bytes]:
    """Return a netCDF file of the basins, for other programs; it needs xarray and h5netcdf."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "basins.nc"
        to_xarray(frame.basins).to_netcdf(path, engine="h5netcdf")
        return {"name": "basins.nc", "media": "application/x-netcdf"}, path.read_bytes()
