"""Figures of atlases: images, curves, names of classes."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pytest

from cellmap import periodic_orbit, plot
from cellmap.bifurcations import (
    AttractorAtlas,
    attractor_atlas,
    connecting_orbits,
    continue_connection,
    continue_tangency,
)
from systems import henon_map


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def atlas() -> AttractorAtlas:
    axes = ("a", np.linspace(0.0, 0.7, 15)), ("b", np.linspace(0.1, 0.4, 7))
    return attractor_atlas(henon_map(0.2, 0.3), *axes, [[0.0, 0.0]])


def test_the_classes_and_curves(atlas: AttractorAtlas) -> None:
    ax = plot.attractor_atlas(atlas)
    (image,) = ax.collections
    assert image.get_array().shape == (7, 15)
    np.testing.assert_array_equal(np.asarray(image.get_array()).astype(int), atlas.classes[0])
    (line,) = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), atlas.curves[0].values[:, atlas.curves[0].parameters.index("a")])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["1", "2", "period doubling"]


def test_a_family(atlas: AttractorAtlas) -> None:
    (image,) = plot.attractor_atlas(atlas, show=1, curves=False).collections
    np.testing.assert_array_equal(np.asarray(image.get_array()), atlas.fraction(1))


def test_further_curves(atlas: AttractorAtlas) -> None:
    exact = henon_map(1.5, 0.3)
    orbit = connecting_orbits(exact, periodic_orbit(exact, [-1.1, -0.3]), max_steps=20, n_samples=2048)[0]
    branch = continue_connection(orbit, "a", 1.3, 1.6)
    curve = continue_tangency(branch.tangencies[0], ("a", "b"), (1.3, 1.6), (0.2, 0.4), step=0.2)
    assert len(plot.attractor_atlas(atlas, extra_curves=[curve]).lines) == 2


@pytest.mark.parametrize("show", ["fractions", True])
def test_what_cannot_be_shown(atlas: AttractorAtlas, show: object) -> None:
    with pytest.raises((TypeError, ValueError), match="show="):
        plot.attractor_atlas(atlas, show=show)  # type: ignore[arg-type]
