"""Figures of certificates: which evidence a cell has, in which colour, and how much of it there is."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from cellmap import CellGrid, certify, discrete_map, find_basins, interpolated_map, plot
from cellmap.basins import Evidence
from cellmap.plot._basins import EVIDENCE_COLOURS

mpl.use("Agg")


@pytest.fixture(scope="module")
def certificate():
    """Two wells whose boundary x = 0 lies between cells, on an interpolated map that is wrong by a thousandth."""
    wells = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"))
    grid = CellGrid((-1.5, -1.0), (1.5, 1.0), (30, 20))
    return certify(find_basins(interpolated_map(wells, grid, order=1, tolerance=0.1), grid))


def test_cells_have_the_colours_of_their_evidence(certificate):
    ax = plot.certificate(certificate)
    (image,) = ax.get_images()
    drawn = np.asarray(image.get_array())
    assert drawn.shape[:2] == (20, 30)
    assert len(np.unique(certificate.evidence)) > 1
    for evidence in Evidence:
        places = evidence == certificate.evidence.T
        assert np.allclose(drawn[places][:, :3], to_rgb(EVIDENCE_COLOURS[evidence]), atol=1e-6)
    assert image.get_extent() == pytest.approx([-1.5, 1.5, -1.0, 1.0])


def test_the_legend_counts_the_cells(certificate):
    texts = [text.get_text() for text in plot.certificate(certificate).get_legend().get_texts()]
    counts = np.bincount(certificate.evidence.ravel(), minlength=len(Evidence))
    assert len(texts) == len(Evidence)
    for text, count in zip(texts, counts, strict=True):
        assert text.endswith(f": {100 * count / 600:.3g} %")


def test_colours_are_told_apart():
    assert len(set(EVIDENCE_COLOURS.values())) == len(Evidence)
