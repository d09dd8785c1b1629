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
from math import pi
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
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


def circle_grid(speed: float, cells: int) -> CellGrid:
    return CellGrid((-pi, -speed), (pi, speed), (cells, cells))


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
    "duffing": BasinImage(
        lambda: stroboscopic_map(systems.two_well_duffing()), CellGrid((-2.2, -2.2), (2.2, 2.2), (80, 80)), 0.1, FRACTAL
    ),
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


def compare(image: Image.Image, reference: Path, allowed: float, reason: str, output: Path) -> None:
    """Fail where too many cells differ from the reference; leave the new image."""
    new = output / reference.name
    image.save(new, optimize=True)
    advice = f"The new image is {new}; if it is right, redraw the reference with pytest --update-reference"
    if not reference.exists():
        pytest.fail(f"there is no reference image {reference}. {advice}", pytrace=False)
    fraction = differing_fraction(image, reference)
    if fraction > allowed:
        pytest.fail(
            f"{100 * fraction:.3g} % of the cells differ from {reference}, and {100 * allowed:g} % may ({reason}). "
            f"{advice}",
            pytrace=False,
        )


@pytest.mark.parametrize("name", BASIN_IMAGES)
def test_basins_look_as_before(name, request, tmp_path):
    basin_image = BASIN_IMAGES[name]
    image = drawn(basin_image.basins())
    reference = REFERENCE / f"{name}.png"
    if request.config.getoption("--update-reference"):
        image.save(reference, optimize=True)
        pytest.skip(f"{reference} is redrawn")
    compare(image, reference, basin_image.allowed, basin_image.reason, tmp_path)


@pytest.mark.parametrize("name", ["duffing", "pendulum_10mm"])
def test_fractions_of_fractal_images(name):
    """Where single cells may differ, the fractions of the colours may not, by more than 1.5 points on so few cells."""
    image = np.array(drawn(BASIN_IMAGES[name].basins()))
    with Image.open(REFERENCE / f"{name}.png") as other:
        reference = np.array(other)
    for colour in np.union1d(image, reference):
        assert (image == colour).mean() == pytest.approx((reference == colour).mean(), abs=0.015)


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
    allowed = {"pendulum_10mm": BASIN_IMAGES[name].allowed, "duffing": BASIN_IMAGES[name].allowed}.get(
        name, 0.0
    )  # fractal
    assert independent().differing(name) <= allowed


@pytest.mark.parametrize("path", sorted(REFERENCE.glob("*.png")), ids=lambda p: p.stem)
def test_reference_images_are_small_and_all_in_use(path):
    assert path.stem in BASIN_IMAGES
    assert path.stat().st_size < 8000


# --- the comparison itself


@pytest.fixture
def halves() -> Image.Image:
    image = Image.fromarray(np.repeat(np.array([[0, 1]], np.uint8), 50, axis=0).repeat(50, axis=1))
    image.putpalette([c for k in range(256) for c in PALETTE.get(k, (255, 255, 255))])
    return image


def test_equal_images_pass(halves, tmp_path):
    halves.save(tmp_path / "reference.png")
    (tmp_path / "output").mkdir()
    compare(halves, tmp_path / "reference.png", 0.0, "equal", tmp_path / "output")


def test_failure_says_the_fraction_and_leaves_the_image(halves, tmp_path):
    halves.save(tmp_path / "reference.png")
    (tmp_path / "output").mkdir()
    changed = halves.copy()
    changed.paste(1, (0, 0, 10, 25))  # 250 of 5000 cells
    with pytest.raises(pytest.fail.Exception, match=r"5 % of the cells differ .* and 1 % may") as failure:
        compare(changed, tmp_path / "reference.png", 0.01, "a reason", tmp_path / "output")
    left = tmp_path / "output" / "reference.png"
    assert str(left) in str(failure.value)
    assert "--update-reference" in str(failure.value)
    assert differing_fraction(changed, left) == 0.0


def test_missing_reference_is_a_failure(halves, tmp_path):
    (tmp_path / "output").mkdir()
    with pytest.raises(pytest.fail.Exception, match="no reference image"):
        compare(halves, tmp_path / "none.png", 0.0, "", tmp_path / "output")


def test_image_of_another_size_differs_altogether(halves, tmp_path):
    halves.crop((0, 0, 50, 50)).save(tmp_path / "reference.png")
    assert differing_fraction(halves, tmp_path / "reference.png") == 1.0


def test_codes_have_colours_of_their_own():
    assert len(set(PALETTE.values())) == len(PALETTE)
