"""Basin images against small reference images, by the fraction of cells that differ.

Each smooth reference equals, cell by cell, the labels of `tests/reference/basin_images.py`: a plain RK4 with 256 steps
a period (Henon: the map in NumPy).

``pytest --update-reference`` redraws the images in tests/reference/ on purpose.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from known_basins import DUFFING, circle_grid
from PIL import Image

import systems
from cellmap import Basins, CellGrid, Label, PointMap, find_basins, interpolated_map, stroboscopic_map

REFERENCE = Path(__file__).parents[1] / "reference"
CODES = {Label.ESCAPED: 253, Label.DIVERGED: 254, Label.UNDECIDED: 255}
PALETTE = {
    **dict(enumerate([(0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (213, 94, 0)])),
    CODES[Label.ESCAPED]: (184, 184, 184),
    CODES[Label.DIVERGED]: (115, 115, 115),
    CODES[Label.UNDECIDED]: (0, 0, 0),
}


@dataclass(frozen=True)
class BasinImage:
    """A basin image, and the fraction of its cells that may differ, with the reason why."""

    make: Callable[[], PointMap]
    grid: CellGrid
    allowed: float
    reason: str

    def basins(self) -> Basins:
        return find_basins(self.make(), self.grid)


def driven(amplitude: float) -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(amplitude=amplitude))


def inverted() -> PointMap:
    return stroboscopic_map(systems.dimensionless_pendulum(-0.1, 0.545, 0.2))


SMOOTH = "smooth boundary: one cell in a thousand may lie on it to the last digit"
FRACTAL = "fractal boundary: cells near it depend on the last digits"
BASIN_IMAGES = {
    "pendulum_3mm": BasinImage(lambda: driven(0.003), circle_grid(100.0, 80), 0.001, SMOOTH),
    "pendulum_3mm_wide": BasinImage(lambda: driven(0.003), circle_grid(500.0, 100), 0.001, SMOOTH),
    "pendulum_3mm_table": BasinImage(
        lambda: interpolated_map(driven(0.003), circle_grid(100.0, 128), outside="escape"),
        circle_grid(100.0, 80),
        0.001,
        SMOOTH,
    ),
    "pendulum_10mm": BasinImage(lambda: driven(0.010), circle_grid(100.0, 80), 0.02, FRACTAL),
    "inverted": BasinImage(inverted, circle_grid(4.0, 80), 0.001, SMOOTH),
    "duffing": BasinImage(lambda: DUFFING, CellGrid((-2.2, -2.2), (2.2, 2.2), (80, 80)), 0.1, FRACTAL),
    "henon": BasinImage(systems.henon_map, CellGrid((-2.0, -2.0), (2.0, 2.0), (100, 100)), 0.001, SMOOTH),
}


def drawn(basins: Basins) -> Image.Image:
    """Labels as a palette image, the second axis upwards."""
    labels = basins.labels.astype(int)
    numbers = labels.copy()
    for code, number in CODES.items():
        numbers[labels == code] = number
    image = Image.fromarray(np.ascontiguousarray(numbers.T[::-1].astype(np.uint8)))
    image.putpalette([c for k in range(256) for c in PALETTE.get(k, (255, 255, 255))])
    return image


def differing_fraction(image: Image.Image, reference: Path) -> float:
    with Image.open(reference) as other:
        assert other.mode == "P", f"{reference} is not a palette image"
        if other.size != image.size:
            return 1.0
        return float((np.array(other) != np.array(image)).mean())


@pytest.mark.parametrize("name", BASIN_IMAGES)
def test_basins_look_as_before(name, request, tmp_path):
    """Where single cells may differ, the fractions of the colours may not, by more than 1.5 points on so few cells."""
    image, reference = drawn(BASIN_IMAGES[name].basins()), REFERENCE / f"{name}.png"
    if request.config.getoption("--update-reference"):
        image.save(reference, optimize=True)
        pytest.skip(f"{reference} is redrawn")
    image.save(tmp_path / reference.name, optimize=True)
    with Image.open(reference) as other:
        assert other.mode == "P" and reference.stat().st_size < 8000
        new, old = np.array(image), np.array(other)
    assert (new != old).mean() <= BASIN_IMAGES[name].allowed, (
        f"{BASIN_IMAGES[name].reason}. The new image is {tmp_path / reference.name}; if it is right, redraw the "
        "reference with pytest --update-reference"
    )
    for colour in np.union1d(new, old):
        assert (new == colour).mean() == pytest.approx((old == colour).mean(), abs=0.015)


def independent() -> ModuleType:
    """Return the program that labels the cells of the reference images without cellmap."""
    spec = importlib.util.spec_from_file_location("reference_basin_images", REFERENCE / "basin_images.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["henon", "pendulum_3mm_table"])
def test_reference_images_are_those_of_an_independent_program(name):
    assert independent().differing(name, every=1 if name == "henon" else 61) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", BASIN_IMAGES)
def test_every_cell_of_a_reference_image_is_that_of_an_independent_program(name):
    allowed = BASIN_IMAGES[name].allowed if BASIN_IMAGES[name].reason == FRACTAL else 0.0
    assert independent().differing(name) <= allowed


def test_reference_images_are_all_in_use():
    assert {path.stem for path in REFERENCE.glob("*.png")} == {*BASIN_IMAGES}
