"""Basin images: what is drawn where, in which colour, under which name."""

import itertools
import re
from dataclasses import replace
from math import pi, tanh

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

import systems
from cellmap import Basins, CellGrid, Label, angle, discrete_map, find_basins, interpolated_map, plot, stroboscopic_map
from cellmap.analysis.resilience import basin_stability, settling_statistics
from cellmap.maps import Coordinate
from cellmap.plot._axes import multiple_of_pi
from cellmap.plot._colours import CODE_COLOURS, COLOURS, label_colours

EXACT = stroboscopic_map(systems.driven_pendulum())


@pytest.fixture(scope="module")
def pendulum() -> Basins:
    return find_basins(EXACT, CellGrid((-pi, -500.0), (pi, 500.0), (40, 30)))


@pytest.fixture(scope="module")
def lost() -> Basins:
    icm = interpolated_map(EXACT, CellGrid((-pi, -100.0), (pi, 100.0), (64, 64)), outside="escape")
    return find_basins(icm, CellGrid((-pi, -100.0), (pi, 100.0), (40, 30)))


def two_wells(shape=(6, 4)) -> Basins:
    exact = discrete_map(lambda x, p: (tanh(2 * x[0]), x[1] / 2), {}, (Coordinate("x", "m"), "y"), name="two wells")
    return find_basins(exact, CellGrid((-1.0, -2.0), (1.0, 2.0), shape))


def image_of(ax) -> np.ndarray:
    """Colours of the cells, the first row at the bottom."""
    (image,) = ax.get_images()
    assert image.origin == "lower"
    return np.asarray(image.get_array())[..., :3]


def test_axes_have_names_units_and_angles_in_multiples_of_pi(pendulum):
    ax = plot.basins(pendulum)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$\theta$ (rad)", r"$\dot{\theta}$ (rad/s)")
    assert ax.get_title() == "driven pendulum"
    assert ax.get_xlim() == pytest.approx((-pi, pi))
    assert ax.get_ylim() == pytest.approx((-500.0, 500.0))
    ax.figure.canvas.draw()
    labels = [t.get_text() for t in ax.get_xticklabels()]
    inside = [t for t, x in zip(labels, ax.get_xticks(), strict=True) if -pi - 1e-9 <= x <= pi + 1e-9]
    assert inside == [r"$-\pi$", r"$-\pi/2$", "0", r"$\pi/2$", r"$\pi$"]
    assert "pi" not in ax.get_yticklabels()[0].get_text()


def test_multiples_of_pi():
    written = [multiple_of_pi(x) for x in (0, pi, -pi, 2 * pi, -3 * pi / 4, pi / 12)]
    assert written == ["0", r"$\pi$", r"$-\pi$", r"$2\pi$", r"$-3\pi/4$", r"$\pi/12$"]
    exact = discrete_map(lambda x, p: (x[0] / 2, x[1] / 2), {}, (angle("phi", "deg", 360.0), "y"))
    ax = plot.basins(find_basins(exact, CellGrid((-180, -1), (180, 1), (8, 8))))
    ax.figure.canvas.draw()
    assert ax.get_xlabel() == r"$\phi$ (deg)"
    assert not any("pi" in t.get_text() for t in ax.get_xticklabels())


def test_every_cell_has_the_colour_of_its_label():
    """Left well to the left; the first coordinate runs to the right, the second one upwards."""
    basins = two_wells()
    labels = basins.labels.copy()
    labels[0, 3] = Label.UNDECIDED  # left, top
    basins = replace(basins, labels=labels)
    palette = label_colours(basins.fractions)
    cells = image_of(plot.basins(basins))
    assert cells.shape == (4, 6, 3)
    for i, j in itertools.product(range(6), range(4)):
        assert cells[j, i] == pytest.approx(palette[int(labels[i, j])], abs=1e-6)
    # Axes of one cell are left out; the others keep their names and their places.
    exact = discrete_map(lambda x, p: (x[0] / 2, tanh(2 * x[1]), x[2] / 2, x[3] / 2), {}, tuple("abcd"))
    basins = find_basins(exact, CellGrid((-1,) * 4, (1,) * 4, (1, 6, 1, 3)))
    ax = plot.basins(basins)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$b$", "$d$")
    assert np.array_equal(np.unique(image_of(ax), axis=0).shape, (1, 6, 3))


@pytest.mark.parametrize(
    ("shape", "options", "message"),
    [
        ((1,), {}, "basins of shrink: a figure needs a grid with two axes"),
        ((4, 4, 4), {}, "basins of shrink: a figure needs a grid with two axes"),
        ((4,), {"plane": (0, 1)}, "plane="),
        ((4,), {"reference": "a"}, "no attractor of these basins has a continuous symmetry"),
    ],
)
def test_what_cannot_be_drawn_leaves_no_figure(shape, options, message):
    d = len(shape)
    exact = discrete_map(lambda x, p: tuple(v / 2 for v in x), {}, tuple("abc"[:d]), name="shrink")
    basins = find_basins(exact, CellGrid((-1.0,) * d, (1.0,) * d, shape))
    with pytest.raises(ValueError, match=message):
        plot.basins(basins, **options)
    assert plt.get_fignums() == []


def test_colours_of_codes_and_attractors_are_all_different(pendulum):
    assert CODE_COLOURS.keys() == set(Label)
    for a, b in itertools.combinations(map(to_rgb, [*CODE_COLOURS.values(), *COLOURS]), 2):
        assert np.abs(np.subtract(a, b)).max() > 0.15
    # Twice through the set of twenty.
    labels = np.arange(1200, dtype=np.int16).reshape(40, 30) % 40
    many = replace(pendulum, attractors=pendulum.attractors[:1] * 40, labels=labels)
    for a, b in itertools.combinations(label_colours(many.fractions).values(), 2):
        assert np.abs(np.subtract(a, b)).max() > 0.02


def test_colours_of_attractors_differ_for_all_eyes():
    """Distances in Oklab (Ottosson 2020) as large as among the first seven; 0.02 is a difference that is just seen.

    Machado, Oliveira, Fernandes 2009, severity 1: matrices on linear RGB.
    """
    matrices = {
        "normal": np.eye(3),
        "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    }
    # fmt: off
    to_lms = [[0.41222147, 0.53633254, 0.05144599], [0.2119035, 0.6806995, 0.10739696],
              [0.08830246, 0.28171884, 0.6299787]]
    to_lab = [[0.21045426, 0.79361779, -0.00407205], [1.9779985, -2.42859221, 0.45059371],
              [0.0259040, 0.7827718, -0.8086758]]
    # fmt: on
    colours = np.array([to_rgb(c) for c in COLOURS])
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    for eyes, matrix in matrices.items():
        seen = np.clip(linear @ np.transpose(matrix), 0.0, 1.0)
        lab = np.cbrt(seen @ np.transpose(to_lms)) @ np.transpose(to_lab)
        nearest = min(np.linalg.norm(a - b) for a, b in itertools.combinations(lab, 2))
        assert nearest > (0.1 if eyes == "normal" else 0.07), eyes


def test_shade_makes_late_cells_paler_and_keeps_codes(lost):
    flat, shaded = image_of(plot.basins(lost)), image_of(plot.basins(lost, shade=True))
    times, escaped = lost.settling_time.T, (lost.labels == Label.ESCAPED).T
    assert np.array_equal(shaded[escaped], flat[escaped])
    assert (shaded >= flat - 1e-12).all()
    assert np.array_equal(shaded[times == 0], flat[times == 0])
    latest = times == times.max()
    assert (shaded[latest] > flat[latest]).any(axis=-1).all()
    assert shaded.max() <= 1.0
    in_one_basin = (lost.labels == 0).T
    order = np.argsort(times[in_one_basin])
    assert (np.diff(shaded[in_one_basin][order].sum(axis=-1)) >= -1e-9).all()
    labels, times = np.full_like(lost.labels, Label.UNDECIDED), np.full_like(lost.settling_time, -1)
    undecided = replace(lost, labels=labels, settling_time=times)
    assert np.array_equal(image_of(plot.basins(undecided, shade=True)), image_of(plot.basins(undecided)))


def test_fractions_that_have_not_settled_fall_to_the_last_step():
    statistics = settling_statistics(two_wells((20, 4)))
    for line, basin in zip(plot.settling_times(statistics).lines, statistics.basins.values(), strict=True):
        *falling, last = line.get_ydata()
        assert falling == pytest.approx((1.0 - np.cumsum(basin.times) / basin.count)[:-1]) and np.isnan(last)


def test_figure_can_be_written(pendulum, tmp_path):
    for suffix, begins in (("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")):
        path = tmp_path / f"basins.{suffix}"
        plot.basins(pendulum, shade=suffix != "png").figure.savefig(path)
        assert path.read_bytes().startswith(begins)
    seen = np.asarray(Image.open(tmp_path / "basins.png").convert("RGB")).reshape(-1, 3)
    for colour in COLOURS[: len(pendulum.attractors)]:  # covers more than a legend does
        near = np.abs(seen - 255 * np.array(to_rgb(colour))).max(axis=1) < 2
        assert near.sum() > 200


def test_attractors_with_many_coordinates_have_room_in_legends_and_at_bars():
    """Of two that differ in the first coordinate and in the last one; titles of slices have units."""
    coordinates = [*(f"x{k}" for k in range(7)), Coordinate("x7", "V")]

    def rhs(x, p):
        return tuple(1.5 * v - 0.5 * v**3 + 0.0123 for v in x)

    system = discrete_map(rhs, {}, coordinates)
    ends = (1.2, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 1.2)
    grid = CellGrid((-1.2, *ends[1:7], -1.2), ends, (8, 1, 1, 1, 1, 1, 1, 8))
    found = find_basins(system, grid)
    legend = plot.basins(found).get_legend()
    legend.figure.draw_without_rendering()
    inside, figure = legend.get_window_extent(), legend.figure.bbox
    assert figure.x0 < inside.x0 and inside.x1 < figure.x1 and inside.y0 > figure.y0
    assert len({t.get_text() for t in legend.get_texts()}) == 4
    ax = plot.basin_stability(basin_stability(found, n_samples=20))
    ax.figure.draw_without_rendering()
    assert ax.get_window_extent().width > 0.75 * ax.figure.bbox.width
    assert min(t.get_window_extent().x0 for t in ax.get_xticklabels()) > 0.0
    halves = discrete_map(lambda x, p: tuple(v / 2 for v in x), {}, ("x", "y", Coordinate("U", "V")))
    ax = plot.basins(find_basins(halves, CellGrid((-1, -1, 0.5), (1, 1, 0.5), (4, 4, 1))))
    assert ax.get_title().endswith(", $U$ = 0.5 V")
    names = [f"x{k}" for k in range(12)]
    system = discrete_map(lambda x, p: tuple(1.5 * v - 0.5 * v**3 for v in x), {}, names)
    found = find_basins(system, np.random.default_rng(0).choice([-0.9, 0.9], (60, 12)))
    ax = plot.fractions(found, largest=5)
    ax.figure.draw_without_rendering()  # no room would be a warning
    labels = [text.get_text() for text in ax.get_yticklabels()]
    assert all(re.fullmatch(r"\d+: fixed point \((-?1, ){1,}\.\.\.\)", label) for label in labels[:5])
    assert len(set(labels)) == len(labels)
