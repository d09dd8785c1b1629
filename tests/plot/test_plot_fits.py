"""Figures of fits and of dimensions."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import plot
from cellmap.analysis import fit_line
from cellmap.analysis.fractal import box_dimension, generalized_dimensions, kaplan_yorke_dimension

mpl.use("Agg")
import matplotlib.pyplot as plt

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


def test_given_axes_are_used():
    _, axes = plt.subplots(1, 2)
    fit = fit_line([0, 1, 2], [0, 1, 2])
    assert plot.fit(fit, ax=axes[1]) is axes[1]
    assert len(plt.get_fignums()) == 1


def test_what_has_no_fit_is_refused():
    with pytest.raises(TypeError, match=r"carries one as \.fit"):
        plot.fit(3.0)
    with pytest.raises(TypeError, match="made by generalized_dimensions"):
        plot.generalized_dimensions(3.0)
    with pytest.raises(TypeError, match="made by kaplan_yorke_dimension"):
        plot.kaplan_yorke(3.0)
    assert plt.get_fignums() == []


def test_dimensions_of_all_orders():
    places, weights = cascade(10)
    found = generalized_dimensions(places, (0, 1, 2), weights=weights)
    ax = plot.generalized_dimensions(found)
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), found.dimensions)
    assert plot.fit(found[2]).get_ylabel() == "information of order 2"


def test_sums_of_exponents():
    ax = plot.kaplan_yorke(kaplan_yorke_dimension([0.4, -1.6], [0.01, 0.01]))
    assert "1.25" in ax.get_legend().get_texts()[0].get_text()
