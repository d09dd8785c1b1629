"""Covariant Lyapunov vectors: exact directions, invariance under the derivative, and independent iterations."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import systems
from cellmap import angle, discrete_map, lyapunov_spectrum, plot, stroboscopic_map
from cellmap.maps import jacobian
from cellmap.orbits import covariant_vectors

HENON = systems.henon_map()


def parallel(a, b):
    """Sine of the angle between vectors along the last axis."""
    a, b = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (a, b))
    return np.asarray(np.linalg.norm(a - (a * b).sum(axis=-1, keepdims=True) * b, axis=-1))


@pytest.mark.parametrize(
    "matrix",
    [
        [[0.5, 1.0], [0.0, 2.0]],  # keeps the axis that shrinks
        [[0.3, 0.0, 0.0], [1.0, 1.7, 0.0], [2.0, -1.0, 3.0]],
        [[-2.0, 1.0, 0.5, 0.0], [0.0, 1.1, 1.0, 3.0], [0.0, 0.0, 0.6, 1.0], [0.0, 0.0, 0.0, 0.1]],
    ],
)
def test_directions_of_a_linear_map_are_its_eigenvectors(linear, matrix):
    given = np.array(matrix)
    found = covariant_vectors(linear(matrix), np.zeros(len(given)), periods=30)
    values, vectors = np.linalg.eig(given)
    order = np.argsort(-np.abs(values))
    assert found.exponents == pytest.approx(np.log(np.abs(values[order])), abs=1e-10)
    assert parallel(found.vectors.swapaxes(-1, -2), vectors[:, order].T).max() < 1e-9
    assert found.standard_errors.max() < 1e-10


@pytest.mark.parametrize(
    ("matrix", "exponents", "dimensions"),
    [
        ([[0.9, 1.0], [0.0, 0.9]], [np.log(0.9)] * 2, (2,)),  # one eigenvector
        ([[0.5, -0.7], [0.7, 0.5]], [np.log(0.74) / 2] * 2, (2,)),  # a complex pair
        ([[1.2, 0.3, 0.0], [0.0, 0.5, -2.1], [0.0, 0.2, 0.5]], [np.log(1.2)] + [np.log(0.67) / 2] * 2, (1, 2)),
        ([[0.9, 1.0, 0.0], [0.0, 0.9, 1.0], [0.0, 0.0, 0.9]], [np.log(0.9)] * 3, (3,)),
        ([[0.3, 0.0, 2.0], [0.0, 0.8, 5.0], [0.0, 0.0, 0.8]], [np.log(0.8)] * 2 + [np.log(0.3)], (2, 1)),
    ],
)
def test_equal_exponents_have_one_subspace(linear, matrix, exponents, dimensions):
    """Errors cover the exact logarithms, and the derivative maps the subspace to itself."""
    periods = 100
    found = covariant_vectors(linear(matrix), np.zeros(len(matrix)), periods=periods)
    assert found.dimensions == dimensions
    assert (np.abs(found.exponents - exponents) <= 2.0 * found.standard_errors + 1e-12).all()
    assert (found.standard_errors < 10.0 / periods).all()
    begin = dimensions.index(max(dimensions))
    part = slice(begin, begin + max(dimensions))
    images = np.array(matrix) @ found.vectors[:-1][..., part]
    basis = found.vectors[1:][..., part]
    assert np.abs(images - basis @ (basis.swapaxes(-1, -2) @ images)).max() < 1e-9
    assert f"(one subspace of dimension {max(dimensions)})" in repr(found)
    with pytest.raises(ValueError, match="divides a subspace"):
        found.angles(begin + 1)


def test_henon():
    """Exponents are those of the spectrum; the derivative maps directions to each other.

    Independent witnesses: iteration of any vector onwards gives the first direction, and with the inverse derivatives
    backwards the second.  Tangencies of manifolds bring the angle near to 0 (Ginelli et al. 2007).
    """
    found = covariant_vectors(HENON, [0.1, 0.1], periods=3000)
    assert found.exponents.sum() == pytest.approx(np.log(0.3), abs=2e-3)
    assert found.exponents[0] == pytest.approx(0.419, abs=4 * found.standard_errors[0])
    spectrum = lyapunov_spectrum(HENON, [0.1, 0.1], periods=3000, transient=200)
    apart = np.abs(found.exponents - spectrum.exponents)  # rounding has led to two orbits
    assert (apart < 3 * np.hypot(found.standard_errors, spectrum.standard_errors)).all()
    matrices = jacobian(HENON, found.points)
    images = matrices[:-1] @ found.vectors[:-1]
    for j in range(2):
        assert parallel(images[..., j], found.vectors[1:, :, j]).max() < 1e-8
        assert np.log(np.linalg.norm(images[..., j], axis=1)) == pytest.approx(found.growth[:-1, j], abs=1e-8)
    onwards, backwards = np.array([1.0, 0.3]), np.array([0.2, 1.0])
    for k in range(1000):
        onwards = matrices[k] @ onwards
        backwards = np.linalg.solve(matrices[1999 - k], backwards)
        onwards, backwards = onwards / np.linalg.norm(onwards), backwards / np.linalg.norm(backwards)
    assert parallel(onwards, found.vectors[1000, :, 0]) < 1e-9
    assert parallel(backwards, found.vectors[1000, :, 1]) < 1e-9
    assert found.angles().min() < 0.02
    assert found.angles(1) == pytest.approx(np.arcsin(parallel(found.vectors[..., 0], found.vectors[..., 1])))


def test_a_flow_and_spaces_of_several_directions():
    """Volumes shrink by exp(-damping * period); of two systems side by side the directions of each are its own."""
    pendulum = stroboscopic_map(systems.dimensionless_pendulum(0.25, 0.55, 0.05))
    found = covariant_vectors(pendulum, [0.5, 0.1], periods=100, transient=100)
    assert found.expanding == 1
    sines = np.abs(np.linalg.det(found.vectors))
    # The sum of the growth is that of volumes but for the change of the parallelogram of the directions.
    volumes = found.growth[:-1].sum(axis=1) + np.diff(np.log(sines))
    assert volumes == pytest.approx(np.full(99, -0.05 * pendulum.period), abs=1e-6)
    pair = discrete_map(
        lambda x, p: (1 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0], 2 * x[2] + x[3], x[2] + x[3]),
        {},
        ("a", "b", angle("c", "", 1.0), angle("d", "", 1.0)),
    )
    both = covariant_vectors(pair, [0.1, 0.1, 0.1, 0.3], periods=300)
    assert both.expanding == 2
    assert np.abs(both.vectors[:, :2, [0, 2]]).max() < 1e-8
    assert np.abs(both.vectors[:, 2:, [1, 3]]).max() < 1e-8
    assert (both.angles() <= both.angles(1) + 1e-12).all()


def test_the_figure():
    found = covariant_vectors(HENON, [0.1, 0.1], periods=200)
    assert sum(p.get_height() for p in plot.covariant_vectors(found).patches) == 200
    plt.close("all")
    with pytest.raises(ValueError, match="first=2"):
        plot.covariant_vectors(found, first=2)
