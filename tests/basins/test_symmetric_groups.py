"""Groups of attractors under symmetries: necklaces of wells, half a period, clouds, and what is no symmetry."""

from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from cellmap import Basins, CellGrid, discrete_map, find_basins, plot
from cellmap.basins import symmetric_groups

mpl.use("Agg")


def _ring(x: Any, p: Any) -> tuple[float, ...]:
    n = len(x)
    return tuple(1.5 * x[k] - 0.5 * x[k] ** 3 + 0.02 * (x[k - 1] - 2.0 * x[k] + x[(k + 1) % n]) for k in range(n))


def ring(n: int) -> Basins:
    places = np.random.default_rng(0).uniform(-1.0, 1.0, (60 * 2**n, n))
    return find_basins(discrete_map(_ring, {}, tuple(f"x{k}" for k in range(n))), places)


def test_wells_on_a_ring_are_necklaces() -> None:
    """Bracelets of 4 beads of 2 colours are 6, and 4 where colours may be exchanged (OEIS A000029, A000011)."""
    basins = ring(4)
    assert len(basins.attractors) == 16
    found = symmetric_groups(basins)
    assert {"all signs", "shift of 4", "reversal of 4"} <= {*found.symmetries}
    assert "exchange of 4" not in found.symmetries
    assert sorted(found.sizes) == [2, 2, 4, 8]
    assert found.missing == ()
    assert found.fractions.sum() == pytest.approx(1.0 - sum(f.fraction for k, f in basins.fractions.items() if k < 0))
    assert (np.diff(found.fractions) <= 0.0).all()
    for number, labels in enumerate(found.groups):
        signs = {abs(int(np.sign(basins.attractors[k].points[0]).sum())) for k in labels}
        assert len(signs) == 1
        assert {found.group_of(k) for k in labels} == {number}
    turned = symmetric_groups(basins, {"turn": lambda x: np.roll(x, 1, axis=1), "back": lambda x: x[:, ::-1]})
    assert sorted(turned.sizes) == [1, 1, 2, 4, 4, 4]
    plt.close(plot.symmetric_groups(found, largest=2).figure)
    ax = plot.fractions(basins, largest=5)
    widths = [bar.get_width() for bar in ax.patches]
    assert widths[:5] == sorted((basins.fractions[k].fraction for k in range(16)), reverse=True)[:5]
    assert ax.get_yticklabels()[5].get_text() == "11 smaller"
    assert sum(widths) == pytest.approx(1.0)
    plt.close(ax.figure)
    assert found.to_dataframe()["sizes"].tolist() == found.sizes.tolist()


def test_chaotic_attractors_are_matched_as_clouds() -> None:
    """The odd cubic map has two chaotic attractors, one on each side, for a slope below 3 sqrt(3)/2."""
    cubic = discrete_map(lambda x, p: (2.55 * x[0] - x[0] ** 3,), {}, ("x",))
    basins = find_basins(cubic, CellGrid((-1.5,), (1.5,), (64,)))
    assert [a.period for a in basins.attractors] == [0, 0]
    assert symmetric_groups(basins).groups == ((0, 1),)


def test_what_is_no_symmetry_is_refused_and_an_image_that_was_not_found_is_missing() -> None:
    basins = find_basins(discrete_map(_ring, {}, ("x0", "x1")), np.random.default_rng(0).uniform(0.2, 1.0, (50, 2)))
    assert len(basins.attractors) == 1
    assert (0, "all signs") in symmetric_groups(basins).missing
    with pytest.raises(ValueError, match=r"symmetries\['half'\]: images of the map change"):
        symmetric_groups(basins, {"half": lambda x: 0.5 * x})
    with pytest.raises(ValueError, match="return states"):
        symmetric_groups(basins, {"less": lambda x: x[:, 0]})
    with pytest.raises(ValueError, match="label=7"):
        symmetric_groups(basins).group_of(7)
