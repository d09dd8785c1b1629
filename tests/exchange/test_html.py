"""What notebooks show: short tables of escaped text, and of basins a small image."""

import base64
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from cellmap import CellGrid, discrete_map, find_basins
from cellmap.plot._colours import colour_of

WINDOW = CellGrid((-1.5, -1.0), (1.5, 1.0), (12, 8))
WELLS = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** 3, 0.5 * x[1]), {"r": 1.5}, ("x", "y"), "two wells")


@pytest.fixture(scope="module")
def basins():
    return find_basins(WELLS, CellGrid((-1.2, -1.0), (1.2, 1.0), (400, 40)))


class Page(HTMLParser):
    """Elements of a page, in their order, and whether each is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in ("br", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def image_of(text: str) -> np.ndarray:
    (source,) = (attributes["src"] for tag, attributes in Page(text).elements if tag == "img")
    data = source.removeprefix("data:image/png;base64,")
    return np.asarray(Image.open(BytesIO(base64.b64decode(data, validate=True))).convert("RGB"))


def test_the_image_of_basins_is_small_and_has_their_colours(basins):
    """Each fourth cell along x; rows from top to bottom are y from its upper end down."""
    left = basins.labels[0, 0]
    image = image_of(basins._repr_html_())
    assert image.shape == (40, 100, 3)
    colours = np.array([colour_of(k) for k in range(2)]) * 255
    np.testing.assert_allclose(image[:, :50], np.broadcast_to(colours[left], (40, 50, 3)), atol=1)
    np.testing.assert_allclose(image[:, 50:], np.broadcast_to(colours[1 - left], (40, 50, 3)), atol=1)
    upper = replace(basins, labels=np.where(np.arange(40) >= 20, 0, 1) * np.ones((400, 1), np.int16))
    image = image_of(upper._repr_html_())
    np.testing.assert_allclose(image[0, 0], colours[0], atol=1)
    np.testing.assert_allclose(image[-1, 0], colours[1], atol=1)


def test_basins_that_are_no_plane_have_no_image():
    plt.close("all")
    line = find_basins(discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",)), CellGrid((-1,), (1,), (8,)))
    states = find_basins(WELLS, [[0.1, 0.2], [-0.1, 0.3]])
    for other in (line, states):
        assert "<img" not in other._repr_html_()
        assert "50 %" in other._repr_html_() or "100 %" in other._repr_html_()
    assert plt.get_fignums() == []


def test_text_is_escaped_and_long_tables_are_cut(basins):
    named = replace(basins, name='<script>alert("1")</script>' + "x" * 500, params={"<b>": 1.0})
    text = named._repr_html_()
    assert "<script" not in text
    assert "<b>" not in text
    assert "x" * 200 not in text
    assert Page(text).text.count("<script>") == 1
    first = basins.attractors[0]
    many = replace(basins, attractors=tuple(replace(first, points=first.points + 0.01 * k) for k in range(40)))
    assert Page(many._repr_html_()).text.endswith("30 more")
