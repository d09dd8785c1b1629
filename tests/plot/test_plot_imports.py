"""What is loaded when: nothing heavy with the library, and figures, files and servers when they are used first."""

from __future__ import annotations

import subprocess
import sys

import pytest

import cellmap

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
