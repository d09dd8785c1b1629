"""Files of basins, of runs that ended early, and how they are read."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py
from checkpointed_runs import interrupted
from known_basins import CONSERVATIVE

import cellmap
from cellmap import Basins, CellGrid, discrete_map, find_basins, interpolated_map, load_basins, save_basins

WINDOW = CellGrid((-0.6, -0.6), (0.6, 0.6), (140, 130))  # two tiles


def halves() -> Basins:
    return find_basins(
        discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y")), CellGrid((-1, -1), (1, 1), (60, 50))
    )


RUN = partial(find_basins, CONSERVATIVE, WINDOW, 260)
READERS: dict[str, Callable[[Path], bytes]] = {
    "picture": lambda path: load_basins(path).labels.tobytes(),
    "finished": lambda path: RUN(checkpoint=path).labels.tobytes(),
    "first pass": lambda path: RUN(checkpoint=path).labels.tobytes(),
    "later pass": lambda path: RUN(checkpoint=path).labels.tobytes(),
    "table": lambda path: interpolated_map(CONSERVATIVE, WINDOW, checkpoint=path).table.coefficients.tobytes(),
}


def make_files(folder: Path) -> None:
    cellmap.set_threads(1)
    save_basins(halves(), folder / "picture.h5")
    READERS["finished"](folder / "finished.h5")
    interrupted(RUN, folder / "first pass.h5", 1)
    interrupted(RUN, folder / "later pass.h5", 3)
    with h5py.File(folder / "later pass.h5", "r") as file:
        assert "rows" in file["pass"]
    interrupted(partial(interpolated_map, CONSERVATIVE, WINDOW), folder / "table.h5", 2)
