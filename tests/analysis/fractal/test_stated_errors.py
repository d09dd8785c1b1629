"""Stated errors of box counting hold known dimensions, or boxes of other shapes tell another dimension.

Exact dimensions: of carpets with s occupied rows and N parts, contracted by n and m < n, ln s/ln m + ln(N/s)/ln n
(McMullen, Nagoya Mathematical Journal 96 (1984) 1); of self-similar sets ln N/ln n (Falconer, Fractal Geometry, 2003);
of the graph of Takagi's function with the weights 2**(-k/2) 3/2 (Ledrappier, Contemporary Mathematics 135 (1992) 285).
"""

import tracemalloc
from collections.abc import Callable
from itertools import product
from math import log, pi

import numpy as np
import pytest

from cellmap import plot
from cellmap.analysis.fractal import BoxCount, box_dimension

SELF_AFFINE = ("McMullen", "Takagi")
Points = np.ndarray
Sample = Callable[[np.random.Generator, int], Points]


def copies(contractions: tuple[int, ...], parts: list[tuple[int, ...]]) -> Sample:
    """Points whose digits are drawn at random among those of the parts of a set."""

    def sample(rng: np.random.Generator, n: int) -> Points:
        x, scale = np.zeros((n, len(contractions))), np.ones(len(contractions))
        for _ in range(40):
            scale = scale / contractions
            x += np.array(parts, float)[rng.integers(len(parts), size=n)] * scale
        return x

    return sample


def carpet(n: int, m: int, parts: list[tuple[int, int]]) -> tuple[Sample, float]:
    rows = len({row for _, row in parts})
    return copies((n, m), parts), log(rows) / log(m) + log(len(parts) / rows) / log(n)


def sphere(rng: np.random.Generator, n: int) -> Points:
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def helix(rng: np.random.Generator, n: int) -> Points:
    t = rng.uniform(0.0, 2.0 * pi, n)
    return np.stack([np.cos(9.0 * t), np.sin(9.0 * t), t], axis=1)


def takagi(rng: np.random.Generator, n: int) -> Points:
    x = rng.random(n)
    sawteeth = [2.0 ** (-0.5 * k) * np.abs(x * 2.0**k - np.round(x * 2.0**k)) for k in range(40)]
    return np.stack([x, np.sum(sawteeth, axis=0)], axis=1)


SETS: dict[str, tuple[Sample, float]] = {
    "McMullen 3 x 2": carpet(3, 2, [(0, 0), (2, 0), (1, 1)]),
    "McMullen 4 x 2": carpet(4, 2, [(0, 0), (2, 0), (3, 0), (1, 1)]),
    "McMullen 5 x 3": carpet(5, 3, [(0, 0), (2, 0), (4, 0), (1, 1), (3, 2)]),
    "McMullen 4 x 3": carpet(4, 3, [(0, 0), (3, 0), (1, 1), (0, 2), (2, 2), (3, 2)]),
    "Sierpinski carpet": (
        copies((3, 3), [p for p in product(range(3), repeat=2) if p != (1, 1)]),
        log(8) / log(3),
    ),
    "Vicsek": (copies((3, 3), [(0, 0), (2, 0), (1, 1), (0, 2), (2, 2)]), log(5) / log(3)),
    "Menger": (copies((3, 3, 3), [p for p in product(range(3), repeat=3) if p.count(1) < 2]), log(20) / log(3)),
    "Cantor squared": (copies((3, 3), list(product((0, 2), repeat=2))), 2.0 * log(2) / log(3)),
    "Cantor, 3 by 4": (copies((3, 4), list(product((0, 2), (0, 3)))), log(2) / log(3) + 0.5),
    "sphere": (sphere, 2.0),
    "cube": (lambda rng, n: rng.random((n, 3)), 3.0),
    "helix": (helix, 1.0),
    "Takagi": (takagi, 1.5),
}


def found(name: str, seed: int, points: int = 50_000) -> tuple[BoxCount, float]:
    """Return what is found in a sample, and by how many stated errors it is off."""
    sample, exact = SETS[name]
    count = box_dimension(sample(np.random.default_rng(seed), points), rng=seed)
    return count, (count.dimension - exact) / count.standard_error


@pytest.mark.parametrize("name", ["McMullen 4 x 3", "sphere"])
def test_stated_errors(name: str) -> None:
    assert max(abs(found(name, seed, 20_000)[1]) for seed in range(2)) < 2.5


@pytest.mark.parametrize(
    "samples", [pytest.param(12, marks=pytest.mark.thorough), pytest.param(100, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", SETS)
def test_stated_errors_of_many_samples(name: str, samples: int) -> None:
    """The error holds the truth or the scales disagree, which on self-similar and smooth sets they do not."""
    counts = [found(name, seed) for seed in range(samples)]
    disagree = np.array([count.scales_agree is False for count, _ in counts])
    held = np.array([abs(off) <= 2.0 for _, off in counts])
    assert np.mean(held | disagree) >= 0.9
    assert name.startswith(SELF_AFFINE) or np.mean(disagree) <= 0.05


def test_boxes_of_other_shapes_disagree_on_a_self_affine_set() -> None:
    """Of the carpet, whose dimension is known, and of a Cantor set of the same kind, which is self-similar."""
    carpet, similar = found("McMullen 5 x 3", 1, 20_000)[0], found("Vicsek", 1, 20_000)[0]
    assert carpet.scales_agree is False and repr(carpet).endswith(", scales do not agree)")
    assert similar.scales_agree is True and "agree" not in repr(similar)
    assert "scales do not agree" in plot.fit(carpet).get_legend().get_texts()[0].get_text()


def test_shapes_of_boxes_are_compared_where_there_are_any() -> None:
    points = np.random.default_rng(0).random((20_000, 2))
    assert box_dimension(points[:, :1]).scales_agree is None
    assert box_dimension(points, origin=(0.0, 0.0)).scales_agree is None
    few = box_dimension(points, 0.5 ** np.arange(1, 7))
    assert len(few.stretched) == 2 and few.scales_agree


def test_memory_does_not_grow_with_the_offsets() -> None:
    points = np.random.default_rng(0).random((50, 1))
    peaks = []
    for offsets in (20, 200):
        tracemalloc.start()
        box_dimension(points, [0.1, 0.05, 0.025, 0.0125], n_offsets=offsets, fit_range=(0.02, 0.2))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0]
