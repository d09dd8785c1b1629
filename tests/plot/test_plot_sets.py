"""Figures of box sets, Morse graphs, transfer operators, cell mappings, fits, dimensions and certificates."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb

import systems
from cellmap import CellGrid, certify, discrete_map, find_basins, interpolated_map, plot, stroboscopic_map
from cellmap.analysis import fit_line
from cellmap.analysis.boundary import chaotic_saddle
from cellmap.analysis.fractal import box_dimension, generalized_dimensions, kaplan_yorke_dimension
from cellmap.basins import Evidence, prove
from cellmap.orbits import finite_time_exponents
from cellmap.plot._basins import EVIDENCE_COLOURS
from cellmap.sets import BoxSet, generalized_cell_mapping, morse_graph, simple_cell_mapping, transfer_operator
from studies.known_fractals import cascade, koch

CUBIC = discrete_map(
    lambda x, p: (1.5 * x[0] - x[0] ** 3 / 2, 1.5 * x[1] - x[1] ** 3 / 2), {}, ("x", "y"), name="two cubics"
)
TENT = discrete_map(lambda x, p: (1 - abs(2 * x[0] - 1),), {}, ("x",))


def test_boxes_are_drawn_where_they_are():
    some = BoxSet(CellGrid((0, 0), (4, 2), (4, 2)), [1, 6])
    ax = plot.boxes(some, names=("q", "v"), facecolor="red")
    corners = [path.vertices[:4] for path in ax.collections[0].get_paths()]
    np.testing.assert_allclose(corners[0], [[0, 1], [1, 1], [1, 2], [0, 2]])
    np.testing.assert_allclose(corners[1], [[3, 0], [4, 0], [4, 1], [3, 1]])
    assert (ax.get_xlim(), ax.get_ylim(), ax.get_xlabel()) == ((0, 4), (0, 2), "$q$")


def test_values_are_colours_and_heights():
    some = BoxSet(CellGrid((0, 0, 0), (1, 1, 1), (2, 2, 2)), [1, 6])
    ax = plot.boxes(some, values=[3.0, 5.0], coordinates=(2, 0))
    assert ax.collections[0].get_array().tolist() == [3.0, 5.0]
    line = plot.boxes(BoxSet(CellGrid((0,), (1,), (4,)), [1, 3]), values=[2.0, 7.0])
    assert [patch.get_height() for patch in line.patches] == [2.0, 7.0]
    with pytest.raises(ValueError, match="one for each of the 2 boxes"):
        plot.boxes(some, values=[1.0])


def test_morse_sets_have_colours_and_arrows():
    graph = morse_graph(CUBIC, CellGrid((-1.7, -1.7), (1.6, 1.6), (2, 2)), 5, periods=3)
    ax = plot.morse_graph(graph)
    assert len(ax.collections) == 9 and len(ax.texts) == 12
    assert sum("attracting" in t.get_text() for t in ax.get_legend().get_texts()) == 4


def test_operators():
    operator = transfer_operator(BoxSet.full(CellGrid((0,), (1,), (32,))), TENT)
    ax = plot.eigenvector(operator)
    np.testing.assert_allclose([patch.get_height() for patch in ax.patches], 1.0)
    plot.eigenvector(operator, index=1)
    ax = plot.eigenvalues(operator, n_eigenvalues=4)
    assert ax.lines[1].get_xdata()[0] == pytest.approx(1.0) and len(ax.lines[1].get_xdata()) == 4
    plane = transfer_operator(BoxSet.full(CellGrid((-1, -1), (1, 1), (9, 9))), CUBIC, 5)
    assert plot.eigenvector(plane, index=1).collections


@pytest.fixture(scope="module")
def wells():
    return stroboscopic_map(systems.two_well_duffing()), CellGrid((-2, -2.5), (2, 2), (40, 45))


def test_groups_have_colours_periodic_cells_are_black_and_steps_are_counted(wells):
    mapping = simple_cell_mapping(*wells)
    ax = plot.cell_mapping(mapping)
    (image,) = ax.get_images()
    assert image.get_extent() == [-2.0, 2.0, -2.5, 2.0]
    drawn = np.asarray(image.get_array())
    assert drawn.shape == (45, 40, 3)
    black = np.argwhere((drawn == 0).all(axis=-1))
    periodic = np.argwhere(((mapping.steps == 0) & (mapping.groups >= 0)).T)
    np.testing.assert_array_equal(black, periodic)
    mapping = simple_cell_mapping(*wells, periods=3)
    ax = plot.cell_mapping(mapping, ax=plt.figure().add_subplot(), show_steps=True)
    drawn = np.ma.filled(np.ma.asarray(ax.get_images()[0].get_array(), float), np.nan)
    expected = np.where(mapping.groups >= 0, 3.0 * mapping.steps, np.nan).T
    np.testing.assert_array_equal(drawn, expected)


@pytest.fixture(scope="module")
def chain(wells):
    return generalized_cell_mapping(*wells, samples=(2, 2))


def test_probabilities_domiciles_and_measures(chain):
    for number in (0, -1):
        image = plot.absorption(chain, group=number).get_images()[0]
        assert image.get_clim() == (0.0, 1.0)
        np.testing.assert_array_equal(np.asarray(image.get_array()), chain.absorption[..., number].T)
    image = plot.absorption(chain).get_images()[0]
    np.testing.assert_array_equal(np.asarray(image.get_array()), chain.domiciles.T)
    drawn = np.ma.asarray(plot.invariant_measure(chain).get_images()[0].get_array())
    assert np.count_nonzero(np.isfinite(np.ma.filled(drawn, np.nan))) == len(chain.closed[0].cells)
    line = generalized_cell_mapping(systems.logistic_map(4.0), CellGrid((0,), (1 + 1e-9,), (100,)))
    (curve,) = plot.invariant_measure(line).get_lines()
    np.testing.assert_array_equal(curve.get_ydata(), line.density())


def test_what_cannot_be_shown(wells, chain):
    with pytest.raises(TypeError, match="CellMapping"):
        plot.cell_mapping(chain)
    with pytest.raises(ValueError, match="group=99"):
        plot.absorption(chain, group=99)
    with pytest.raises(ValueError, match="two axes"):
        plot.cell_mapping(simple_cell_mapping(systems.logistic_map(4.0), CellGrid((0,), (1,), (100,))))


def test_a_fit_is_drawn_with_its_window_and_its_slope():
    found = box_dimension(koch(7))
    ax = plot.fit(found)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("1/size", "boxes")
    assert f"{found.dimension:.4g}" in ax.get_legend().get_texts()[0].get_text()
    (band,) = ax.patches
    sizes = found.sizes[found.fit.inside]
    left = band.get_x()
    assert (left, left + band.get_width()) == pytest.approx((1.0 / sizes.max(), 1.0 / sizes.min()))
    drawn = np.concatenate([np.asarray(c[0].get_xdata()) for c in ax.containers])
    np.testing.assert_allclose(np.sort(drawn), np.sort(1.0 / found.sizes))
    line = ax.get_lines()[-1]
    np.testing.assert_allclose(np.log(line.get_ydata()), found.fit(np.log(line.get_xdata())))


def test_plain_quantities_are_on_plain_axes():
    fit = fit_line([0, 1, 2, 3], [0, 1, 2, 3.1], errors=[0.1] * 4, labels=("time", "ln distance"))
    ax = plot.fit(fit, label="growth", shade=False)
    assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "log")
    assert not ax.patches
    assert ax.get_legend().get_texts()[0].get_text().startswith("growth: 1")

    with pytest.raises(TypeError, match=r"carries one as \.fit"):
        plot.fit(3.0)


def test_dimensions_of_all_orders_and_sums_of_exponents():
    places, weights = cascade(10)
    found = generalized_dimensions(places, (0, 1, 2), weights=weights)
    ax = plot.generalized_dimensions(found)
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), found.dimensions)
    assert plot.fit(found[2]).get_ylabel() == "information of order 2"
    ax = plot.kaplan_yorke(kaplan_yorke_dimension([0.4, -1.6], [0.01, 0.01]))
    assert "1.25" in ax.get_legend().get_texts()[0].get_text()


def test_proved_cells_and_balls_do_not_widen_the_window():
    """The attractor (10, 0) of a contraction may be outside of the window, a slice of three dimensions."""
    shift = discrete_map(lambda x, p: (x[0] / 2 + 5, x[1] / 2, x[2] / 2), {}, ("x", "y", "z"))
    for window, cells in (((-1.0, 1.0, -1.0, 1.0), (6, 4, 1)), ((9.0, 11.0, 3.0, 5.0), (6, 2, 1))):
        left, right, bottom, top = window
        grid = CellGrid((left, bottom, 0), (right, top, 0), cells)
        ax = plot.proof(prove(find_basins(shift, grid), splits=0))
        assert (*ax.get_xlim(), *ax.get_ylim()) == window
        assert ax.get_lines()[0].get_xydata() == pytest.approx(np.array([[10.0, 0.0]]), abs=1e-9)


def test_chaotic_saddles_are_drawn_in_a_plane_or_against_their_images():
    tent = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",))
    (drawn,) = plot.chaotic_saddle(chaotic_saddle(tent, CellGrid((0,), (1,), (1,)), n_points=50)).get_lines()
    x, after = drawn.get_xydata().T
    assert after == pytest.approx(1.5 - 3 * np.abs(x - 0.5), abs=1e-6)
    plane = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5), x[1] / 4), {}, ("x", "y"))
    ax = plot.chaotic_saddle(chaotic_saddle(plane, CellGrid((0, -1), (1, 1), (2, 2)), n_points=50))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$", "$y$")


def test_fields_of_exponents_are_per_step_unless_asked_for():
    half_time = stroboscopic_map(systems.two_well_duffing())
    field = finite_time_exponents(half_time, CellGrid((-1, -1), (1, 1), (3, 2)), 2)
    assert np.asarray(plot.exponent_field(field).collections[0].get_array()).reshape(2, 3) == pytest.approx(
        field.forward.T
    )


@pytest.fixture(scope="module")
def certificate():
    """Two wells whose boundary x = 0 lies between cells, on an interpolated map that is wrong by a thousandth."""
    wells = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"))
    grid = CellGrid((-1.5, -1.0), (1.5, 1.0), (30, 20))
    return certify(find_basins(interpolated_map(wells, grid, order=1, tolerance=0.1), grid))


def test_cells_have_the_colours_of_their_evidence(certificate):
    ax = plot.certificate(certificate)
    (image,) = ax.get_images()
    drawn = np.asarray(image.get_array())
    assert drawn.shape[:2] == (20, 30)
    assert len(np.unique(certificate.evidence)) > 1
    for evidence in Evidence:
        places = evidence == certificate.evidence.T
        assert np.allclose(drawn[places][:, :3], to_rgb(EVIDENCE_COLOURS[evidence]), atol=1e-6)
    assert image.get_extent() == pytest.approx([-1.5, 1.5, -1.0, 1.0])


def test_the_legend_counts_the_cells(certificate):
    texts = [text.get_text() for text in plot.certificate(certificate).get_legend().get_texts()]
    counts = np.bincount(certificate.evidence.ravel(), minlength=len(Evidence))
    assert len(texts) == len(Evidence)
    for text, count in zip(texts, counts, strict=True):
        assert text.endswith(f": {100 * count / 600:.3g} %")
    assert len(set(EVIDENCE_COLOURS.values())) == len(Evidence)
