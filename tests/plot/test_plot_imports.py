"""The plotting room is loaded when it is used first, and its public names exist."""

from __future__ import annotations

import subprocess
import sys

import matplotlib as mpl
import pytest

mpl.use("Agg")


@pytest.mark.parametrize("module", ["cellmap", "systems"])
def test_import_loads_no_heavy_library(module):
    program = (
        f"import {module}, sys; "
        "heavy = ('matplotlib', 'sklearn', 'h5py', 'scipy.integrate', 'scipy.ndimage', 'pandas', 'xarray'); "
        "print([m for m in heavy if m in sys.modules])"
    )
    output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert output.strip() == "[]"


def test_late_names_are_listed_and_load_on_use():
    program = (
        "import cellmap, sys; assert 'plot' in dir(cellmap) and 'save_basins' in cellmap.__all__;"
        "assert 'matplotlib' not in sys.modules; cellmap.plot.basins; assert 'matplotlib' in sys.modules;"
        "assert 'h5py' not in sys.modules; cellmap.basins.StoreError; assert 'h5py' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
    import cellmap

    with pytest.raises(AttributeError, match="No cellmap attribute plot_basin"):
        cellmap.plot_basin  # noqa: B018


def test_every_public_name_exists():
    import cellmap

    for name in cellmap.__all__:
        assert getattr(cellmap, name).__doc__
