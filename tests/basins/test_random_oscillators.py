"""Random oscillators over wide ranges: searches end, no attractor is listed twice, tables agree with exact maps."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from cellmap import (
    Basins,
    CellGrid,
    ForcedSystem,
    Label,
    PointMap,
    angle,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap.attractors.labels import LABEL_NAMES
from cellmap.attractors.regions.boxes import inside_cover
from cellmap.attractors.regions.extents import region_extent
from cellmap.attractors.settling.settle import Catalogue
from cellmap.maps.coordinates import difference
from cellmap.orbits import Kind

PERIODS = 300
QUICK = [2, 4, 5, 6, 8, 10, 12, 13, 17, 18, 19, 20, 22, 24, 25, 27, 29, 30, 33, 35, 39, 44, 45, 48]


def duffing(t, x, p):
    return x[1], p.a * x[0] - p.b * x[0] ** 3 - p.d * x[1] + p.g * cos(p.w * t)


def pendulum(t, x, p):
    return x[1], -(1.0 + p.a * cos(p.w * t)) * sin(x[0]) - p.d * x[1] + p.g * cos(p.w * t) + p.c


def period(p):
    return 2 * pi / p.w


# One right-hand side of each kind, so that nothing is compiled for further parameters.
DUFFING = ForcedSystem(duffing, {"a": 0.5, "b": 0.8, "d": 0.2, "g": 0.1, "w": 0.8}, period, ("q", "v"))
PENDULUM = ForcedSystem(pendulum, {"a": 0.5, "d": 0.8, "g": 0.2, "c": 0.1, "w": 0.8}, period, (angle("q"), "v"))


def drawn(seed: int) -> tuple[PointMap, CellGrid, CellGrid]:
    """A random oscillator, its initial conditions, and the window of its table; even seeds are Duffing's."""
    rng = np.random.default_rng(seed)
    if seed % 2 == 0:
        parameters = {"a": rng.uniform(-1, 1)}
        for name, limits in {"b": (-1, 0.3), "d": (-1.7, -0.2), "g": (-2, 0.3), "w": (-0.5, 0.4)}.items():
            parameters[name] = 10 ** rng.uniform(*limits)
        strobe = stroboscopic_map(DUFFING.with_params(**parameters))
        return strobe, CellGrid((-1.8, -1.8), (1.8, 1.8), (12, 12)), CellGrid((-2.5, -2.5), (2.5, 2.5), (64, 64))
    parameters = {
        "a": rng.choice([0.0, 10 ** rng.uniform(-1, 0.3)]),
        "d": 10 ** rng.uniform(-1.7, -0.2),
        "g": rng.choice([0.0, 10 ** rng.uniform(-1, 0.3)]),
        "c": rng.choice([0.0, rng.uniform(0, 0.5)]),
        "w": 10 ** rng.uniform(-0.5, 0.4),
    }
    strobe = stroboscopic_map(PENDULUM.with_params(**parameters))
    return strobe, CellGrid((-pi, -3.0), (pi, 3.0), (12, 12)), CellGrid((-pi, -4.5), (pi, 4.5), (64, 64))


def repeated(basins: Basins) -> list[tuple[int, int]]:
    """Pairs of attractors that are one: a point of either is in the neighbourhood, or the boxes, of the other."""
    point_map, found = basins.point_map, basins.attractors
    assert point_map is not None
    catalogue = Catalogue.of(found, point_map)
    pairs = []
    several = sum(a.kind is Kind.CHAOTIC for a in found) > 1
    for k, a in enumerate(found):
        owners = catalogue.owners_of(a.points)
        pairs += [(k, int(j)) for j in np.unique(owners[(owners >= 0) & (owners != k)])]
        if several and a.kind is Kind.CHAOTIC:
            later = point_map.iterate(a.points[:: max(len(a.points) // 8, 1)], 10 * PERIODS).points
            for j, b in enumerate(found):
                if j != k and b.cover is not None and inside_cover(b.cover, later, point_map).any():
                    pairs.append((k, j))
    return pairs


def matched_labels(exact: Basins, table: Basins) -> tuple[np.ndarray, np.ndarray]:
    """Return the labels of an exact map, and those of a table by the same numbers; 1000 and more for other attractors.

    Attractors are the same if they are of one kind and one has a point within 1e-4 of the extent of a point of the
    other, or 0.05 of it where both are samples of a chaotic attractor.
    """
    extent = region_extent(exact.point_map, np.array([exact.grid.lower, exact.grid.upper]))
    codes = np.arange(min(LABEL_NAMES), len(table.attractors))
    numbers = np.where(codes < 0, codes, codes + 1000)
    for k, b in enumerate(table.attractors):
        for j, a in enumerate(exact.attractors):
            apart = np.abs(difference(a.points[:, None], b.points[:1], a.coordinates) / extent).max(axis=-1).min()
            if a.kind is b.kind and a.rotations == b.rotations and apart < (0.05 if a.kind is Kind.CHAOTIC else 1e-4):
                numbers[k - codes[0]] = j
                break
    return exact.labels.ravel(), numbers[table.labels.ravel() - codes[0]]


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*are fallback cells:UserWarning")
@pytest.mark.parametrize("seed", QUICK)
def test_labels_of_random_oscillators_by_the_map_and_by_a_table_are_the_same(seed: int) -> None:
    exact_map, grid, window = drawn(seed)
    exact, table = find_basins(exact_map, grid, PERIODS), interpolated_map(exact_map, window, 5, outside="integrate")
    by_table = find_basins(table, grid, PERIODS)
    for basins in (exact, by_table):
        assert repeated(basins) == [], f"seed {seed}: {basins.attractors}"
        assert bool(basins.undecided) == bool((basins.labels == Label.UNDECIDED).any())
    assert np.array_equal(*matched_labels(exact, by_table))
