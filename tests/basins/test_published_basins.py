"""Basins with published or independently recomputed numbers (REFERENCES.md), and images of them.

Each smooth image equals, cell by cell, the labels of `tests/reference/basin_images.py`: a plain RK4 with 256 steps a
period (Henon: the map in NumPy).  ``pytest --update-reference`` redraws those in tests/reference/ on purpose.
"""

import runpy
from math import pi
from pathlib import Path

import numpy as np
import pytest
from known_basins import DUFFING, GOY, circle_grid, counts, fractions
from PIL import Image

import systems
from cellmap import CellGrid, Label, find_basins, interpolated_map, stroboscopic_map
from cellmap.maps.coordinates import difference
from cellmap.orbits import Kind

INVERTED = systems.dimensionless_pendulum(-0.1, 0.545, 0.2)

# --- the report's pendulum: counts on 200 x 200 cells (REFERENCES.md)

PENDULUM = {
    "2 mm, 100 rad/s": (0.002, 100.0, [40000]),
    "3 mm, 100 rad/s": (0.003, 100.0, [32896, 7104]),
    "3 mm, 500 rad/s": (0.003, 500.0, [25484, 6152, 4182, 4182]),
}


@pytest.fixture(
    scope="module", params=[pytest.param(p, marks=pytest.mark.thorough if "100" in p else []) for p in PENDULUM]
)
def pendulum(request):
    amplitude, speed, expected = PENDULUM[request.param]
    exact = stroboscopic_map(systems.driven_pendulum(amplitude=amplitude))
    return exact, find_basins(exact, circle_grid(speed, 200)), speed, expected


def test_counts_of_the_pendulum(pendulum):
    """At most 5 cells off, for the boundary is smooth."""
    _, basins, _, expected = pendulum
    assert [a.kind for a in basins.attractors] == [Kind.FIXED_POINT] * min(len(expected), 2) + [Kind.ROTATING] * (
        len(expected) - 2
    )
    assert counts(basins) == pytest.approx(expected, abs=5)
    assert basins.labels.min() == 0
    check = basins.verify(300)
    assert (check.compared, check.wrong, check.fraction, check.low, check.excluded) == (300, 0, 0.0, 0.0, 0)
    assert check.high < 0.013


@pytest.mark.parametrize("order", [pytest.param(3, marks=pytest.mark.thorough), 5])
def test_counts_by_interpolated_cell_mapping(pendulum, order):
    exact, basins, speed, expected = pendulum
    icm = interpolated_map(exact, circle_grid(1.1 * speed, 256), order, outside="integrate")
    by_table = find_basins(icm, circle_grid(speed, 200))
    assert counts(by_table) == pytest.approx(expected, abs=5)
    assert np.count_nonzero(by_table.labels != basins.labels) <= 5


# --- published or independently recomputed shares (REFERENCES.md)


# Map, initial conditions, points of the attractors, fractions, and the largest difference allowed (0.003 unless said).
PUBLISHED = {
    "forced pendulum": (
        stroboscopic_map(systems.forced_pendulum()),
        circle_grid(4.0, 200),
        [(-0.4782, -0.6082), (-0.4728, 2.0371)],
        [0.478, 0.522],
        0.003,
    ),
    "vertically driven": (
        stroboscopic_map(systems.dimensionless_pendulum(0.5, 0.1, 0.03)),
        circle_grid(4.0, 200),
        [(0, 0), (0.67083, 1.15836), (2.65934, 0.67711), (-2.65934, -0.67711)],
        [0.701, 0.212, 0.0435, 0.0435],
        0.003,
    ),
    "inverted": (
        stroboscopic_map(INVERTED),
        circle_grid(4.0, 200),
        [(0, 0), (2.18475, 1.18826), (-2.18475, -1.18826)],
        [0.6438, 0.1781, 0.1781],
        0.003,
    ),
    "two-well Duffing": (
        DUFFING,
        CellGrid((-2.2, -2.2), (2.2, 2.2), (200, 200)),
        [(-0.77905493, 0.02741682), (1.21009083, 0.05529497)],
        [0.5, 0.5],
        0.01,
    ),
    "Grebogi, Ott, Yorke": (
        GOY,
        CellGrid((0.0, -0.5), (2 * pi, 0.5), (200, 200)),
        [(0.0, -0.3), (pi, 0.3)],
        [0.5, 0.5],
        0.003,
    ),
}


QUICK = "Grebogi, Ott, Yorke"


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n == QUICK else pytest.mark.thorough) for n in PUBLISHED])
def test_published_fractions(name):
    point_map, grid, points, expected, allowed = PUBLISHED[name]
    basins = find_basins(point_map, grid)
    assert len(basins.attractors) == len(points)
    for a, point in zip(basins.attractors, points, strict=True):
        assert difference(a.points[0], np.array(point), a.coordinates) == pytest.approx(0.0, abs=1e-4)
    assert fractions(basins) == pytest.approx(expected, abs=allowed)
    assert basins.labels.min() == 0


# --- images

REFERENCE = Path(__file__).parents[1] / "reference"
CODES = {Label.ESCAPED: 253, Label.DIVERGED: 254, Label.UNDECIDED: 255}
PALETTE = {
    **dict(enumerate([(0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (213, 94, 0)])),
    CODES[Label.ESCAPED]: (184, 184, 184),
    CODES[Label.DIVERGED]: (115, 115, 115),
    CODES[Label.UNDECIDED]: (0, 0, 0),
}
MILLIMETRES = {n: stroboscopic_map(systems.driven_pendulum(amplitude=1e-3 * n)) for n in (3, 10)}
# Where a boundary is smooth, one cell in a thousand may lie on it to the last digit; where it is fractal, cells near it
# depend on the last digits.
IMAGES = {
    "pendulum_3mm": (lambda: MILLIMETRES[3], circle_grid(100.0, 80), 0.001),
    "pendulum_3mm_wide": (lambda: MILLIMETRES[3], circle_grid(500.0, 100), 0.001),
    "pendulum_3mm_table": (
        lambda: interpolated_map(MILLIMETRES[3], circle_grid(100.0, 128), outside="escape"),
        circle_grid(100.0, 80),
        0.001,
    ),
    "pendulum_10mm": (lambda: MILLIMETRES[10], circle_grid(100.0, 80), 0.02),
    "inverted": (lambda: stroboscopic_map(INVERTED), circle_grid(4.0, 80), 0.001),
    "duffing": (lambda: DUFFING, CellGrid((-2.2, -2.2), (2.2, 2.2), (80, 80)), 0.1),
    "henon": (systems.henon_map, CellGrid((-2.0, -2.0), (2.0, 2.0), (100, 100)), 0.001),
}


FURTHER = ("pendulum_3mm", "pendulum_10mm", "pendulum_3mm_table")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.thorough if n in FURTHER else []) for n in IMAGES])
def test_basins_look_as_before(name, request, tmp_path):
    """Where single cells may differ, the fractions of the colours may not, by more than 1.5 points on so few cells."""
    make, grid, allowed = IMAGES[name]
    labels = find_basins(make(), grid).labels.astype(int)
    numbers = np.select([labels == code for code in CODES], list(CODES.values()), labels)
    image = Image.fromarray(np.ascontiguousarray(numbers.T[::-1].astype(np.uint8)))  # the second axis upwards
    image.putpalette([c for k in range(256) for c in PALETTE.get(k, (255, 255, 255))])
    new, reference = tmp_path / f"{name}.png", REFERENCE / f"{name}.png"
    image.save(new, optimize=True)
    if request.config.getoption("--update-reference"):
        reference.write_bytes(new.read_bytes())
        pytest.skip(f"{reference} is redrawn")
    with Image.open(reference) as other:
        assert other.mode == "P" and reference.stat().st_size < 8000
        ours, theirs = np.array(image), np.array(other)
    assert (ours != theirs).mean() <= allowed, f"if {new} is right, redraw the reference with pytest --update-reference"
    for colour in np.union1d(ours, theirs):
        assert (ours == colour).mean() == pytest.approx((theirs == colour).mean(), abs=0.015)


def test_images_are_all_in_use_and_those_of_an_independent_program():
    assert {path.stem for path in REFERENCE.glob("*.png")} == {*IMAGES}
    differing = runpy.run_path(str(REFERENCE / "basin_images.py"))["differing"]
    assert [differing("henon", every=1), differing("pendulum_3mm_table", every=61)] == [0.0, 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("name", IMAGES)
def test_every_cell_of_an_image_is_that_of_an_independent_program(name):
    allowed = IMAGES[name][2]
    assert runpy.run_path(str(REFERENCE / "basin_images.py"))["differing"](name) <= (
        allowed if allowed > 0.001 else 0.0
    )
