"""Figures of fits, dimensions and certificates."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from cellmap import CellGrid, certify, discrete_map, find_basins, interpolated_map, plot
from cellmap.analysis import fit_line
from cellmap.analysis.fractal import box_dimension, generalized_dimensions, kaplan_yorke_dimension
from cellmap.basins import Evidence
from cellmap.plot._basins import EVIDENCE_COLOURS
from studies.known_fractals import cascade, koch


def test_a_fit_is_drawn_with_its_window_and_its_slope():
    found = box_dimension(koch(7))
    ax = plot.fit(found)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("1/size", "boxes")
    assert f"{found.dimension:.4g}" in ax.get_legend().get_texts()[0].get_text()
    (band,) = ax.patches
    sizes = found.sizes[found.fit.inside]
    left = band.get_x()
    assert (left, left + band.get_width()) == pytest.approx((1.0 / sizes.max(), 1.0 / sizes.min()))
    drawn = np.concatenate([np.asarray(c[0].get_xdata()) for c in ax.containers])
    np.testing.assert_allclose(np.sort(drawn), np.sort(1.0 / found.sizes))
    line = ax.get_lines()[-1]
    np.testing.assert_allclose(np.log(line.get_ydata()), found.fit(np.log(line.get_xdata())))


def test_plain_quantities_are_on_plain_axes():
    fit = fit_line([0, 1, 2, 3], [0, 1, 2, 3.1], errors=[0.1] * 4, labels=("time", "ln distance"))
    ax = plot.fit(fit, label="growth", shade=False)
    assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "log")
    assert not ax.patches
    assert ax.get_legend().get_texts()[0].get_text().startswith("growth: 1")

    with pytest.raises(TypeError, match=r"carries one as \.fit"):
        plot.fit(3.0)


def test_dimensions_of_all_orders_and_sums_of_exponents():
    places, weights = cascade(10)
    found = generalized_dimensions(places, (0, 1, 2), weights=weights)
    ax = plot.generalized_dimensions(found)
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), found.dimensions)
    assert plot.fit(found[2]).get_ylabel() == "information of order 2"
    ax = plot.kaplan_yorke(kaplan_yorke_dimension([0.4, -1.6], [0.01, 0.01]))
    assert "1.25" in ax.get_legend().get_texts()[0].get_text()


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
    assert len(set(EVIDENCE_COLOURS.values())) == len(Evidence)
