"""
A run that survives interruption
================================

With a checkpoint, labels are stored as they are computed. A run that was interrupted, here by a time limit, continues
when the same call is repeated.
"""

import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

from cellmap import CellGrid, find_basins, plot, stroboscopic_map
from systems import moon_li_duffing

strobe = stroboscopic_map(moon_li_duffing(0.15, 0.095, 0.8333))
window = CellGrid(lower=(-2, -1.2), upper=(2, 1.2), shape=(250, 150))
with TemporaryDirectory() as folder:
    checkpoint = Path(folder) / "run.h5"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that labels are missing
        find_basins(strobe, window, checkpoint=checkpoint, max_seconds=0.05)
    basins = find_basins(strobe, window, checkpoint=checkpoint)
    plot.basins(basins)
    print(basins)
# sphinx_gallery_alt = "Basins of the two wells of Moon and Li's oscillator, complete after the second call"
