"""The page of known fractals."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

from studies import known_fractals

mpl.use("Agg")


def test_snowflake_is_filled_as_points_in_a_polygon():
    from matplotlib.path import Path as Polygon

    outline = np.array([[2.3, 1.2], [17.1, 4.4], [12.2, 18.7], [8.8, 7.1]])
    places = np.stack(np.meshgrid(*[np.arange(20)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = Polygon(outline).contains_points(places).reshape(20, 20)
    np.testing.assert_array_equal(known_fractals.filled(outline, 20), inside)


def test_snowflake_has_its_area():
    """The triangle's times (8 - 3 (4/9)**level) / 5, on an image of 1.3 sides."""
    fraction = known_fractals.snowflake_labels(800, 6).mean()
    assert fraction * 1.3**2 == pytest.approx(0.25 * np.sqrt(3.0) * (8.0 - 3.0 * (4.0 / 9.0) ** 6) / 5.0, rel=1e-3)


@pytest.mark.slow
def test_all_within_a_hundredth(tmp_path, capsys):
    known_fractals.main(quick=False, output=tmp_path)
    assert (tmp_path / "known_fractals.png").exists()
    table = (tmp_path / "known_fractals.md").read_text()
    errors = [abs(float(line.split("|")[5])) for line in table.splitlines()[2:]]
    assert len(errors) > 25
    assert max(errors) < 0.01
    assert "largest error" in capsys.readouterr().out
