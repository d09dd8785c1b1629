"""Proved labels against exact basins, other labels, orbits, and another program."""

from math import cos, pi, sin

import numpy as np
import pytest
from mpmath import iv

import cellmap
from cellmap import CellGrid, angle, certify, discrete_map, find_basins, interpolated_map
from cellmap.basins import Evidence, Proof, prove
from cellmap.basins.proofs import orbits_of_sets, passes
from cellmap.basins.proofs.checking import _inverse, _matrix
from cellmap.basins.proofs.regions import ProvedCells, Region, alike

NO_ANGLES = (False, False)


def newton(x, p):
    """z - (z**3 - 1) / (3 z**2), with a pole at 0."""
    a, b = x
    u, v = a * a - b * b, 2 * a * b
    d = u * u + v * v
    return (2 * a + u / d) / 3, (2 * b - v / d) / 3


def damped(x, p):
    """A dissipative standard map, with rotating solutions beside the fixed point."""
    v = 0.7 * x[1] - 0.9 * sin(x[0])
    return x[0] + v, v


@pytest.fixture(scope="module")
def roots():
    return find_basins(discrete_map(newton, {}, ("x", "y")), CellGrid((-2, -2), (2, 2), (120, 120)))


@pytest.fixture(scope="module")
def proof(roots):
    return prove(roots, splits=1)


def differing(proof, basins):
    known = proof.labels >= 0
    return int(np.count_nonzero(proof.labels[known] != basins.labels[known]))


def test_newton_basins(roots, proof):
    sure = alike(roots.labels, NO_ANGLES)
    assert differing(proof, roots) == 0
    assert (proof.labels[sure] >= 0).mean() > 0.9
    assert sorted(proof.attractors) == [0, 1, 2]
    assert sum(proof.areas.values()) == pytest.approx(16.0 * proof.share, rel=1e-9)
    # Conjugate roots have mirror images for basins, to the last cell.
    assert (proof.labels[:, ::-1] == np.array([0, 2, 1, *5 * [-5]])[proof.labels]).all()


def test_points_of_proved_cells_converge(roots, proof):
    """At corners as well, which belong to the cell."""
    random, cells = np.random.default_rng(5), proof.cells
    index = np.stack(np.nonzero(cells.labels > 0), axis=-1)
    index = index[random.integers(0, len(index), 4000)]
    edges = [cells.region.edges(j) for j in range(2)]
    share = np.where(random.random((4000, 2)) < 0.3, random.integers(0, 2, (4000, 2)), random.random((4000, 2)))
    low, high = (np.stack([e[index[:, j] + k] for j, e in enumerate(edges)], axis=-1) for k in (0, 1))
    points = low + share * (high - low)
    points = np.where(share == 1.0, high, points)
    ends = roots.point_map.iterate(points, 200).points
    targets = np.array([a.points[0] for a in roots.attractors])[cells.labels[tuple(index.T)] - 1]
    assert np.abs(ends - targets).max() < 1e-9


def test_another_program_confirms(proof):
    found = proof.check(12, rng=3)
    assert (found.confirmed, found.contracting) == (found.cells, found.boxes) == (12, 12)
    lie = ProvedCells(proof.cells.region, proof.cells.labels, np.zeros_like(proof.cells.ranks))
    false = Proof(proof.basins, proof.attractors, lie, {}, 1, 1).check(6)
    assert false.confirmed < 6 and len(false.unconfirmed) == 6 - false.confirmed
    inverse = _inverse(iv, _matrix(iv, np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 1.0], [0.0, 1.0, 5.0]])))
    assert float(inverse[0][0].mid) == pytest.approx(-19 / 11) and float(inverse[2][1].mid) == pytest.approx(1 / 11)


def test_rotating_solutions_on_the_circle():
    """Angles of images make several full rotations; the branch cut is proved like any other place."""
    grid = CellGrid((-pi, -2.0), (pi, 2.0), (120, 120))
    basins = find_basins(discrete_map(damped, {}, (angle("theta"), "v")), grid)
    found = prove(basins, splits=0)
    assert differing(found, basins) == 0
    assert found.share > 0.9
    cut = found.labels[[0, -1]]
    assert (cut >= 0).mean() > 0.9


@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_linear_map_is_proved_everywhere(d):
    """Its only fixed point attracts all of space, so that the area of the basin is that of the window."""
    names = ("x", "y", "z")[:d]
    linear = discrete_map(lambda x, p: tuple(0.6 * x[j] - 0.3 * x[j - 1] for j in range(d)), {}, names)
    grid = CellGrid(d * (-1.0,), d * (2.0,), d * (12,))
    found = prove(find_basins(linear, grid))
    assert found.share == 1.0
    assert 3.0**d * (1 - 1e-11) < found.areas[0] <= 3.0**d
    assert "26.99" in repr(found) or d < 3


def test_slices_are_proved_by_orbits():
    """Where y begins at 0.7 alone, images lie elsewhere than the cells."""
    cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3 + 0.1 * x[1], 0.5 * x[1]), {}, ("x", "y"))
    basins = find_basins(cubic, CellGrid((-1.4, 0.7), (1.4, 0.7), (400, 1)))
    found = prove(basins, splits=2)
    assert differing(found, basins) == 0
    assert found.share > 0.97
    assert sum(found.areas.values()) <= 2.8


def test_intervals_of_parameters():
    """Cells proved for all values are proved with the same labels for some."""

    def bistable(x, p):
        return (p.a * x[0] - 0.5 * x[0] ** 3,)

    def basins(a):
        return find_basins(discrete_map(bistable, {"a": a}, ("x",)), CellGrid((-1.9,), (1.9,), (300,)))

    wide = prove(basins(1.5), parameters={"a": (1.45, 1.55)})
    assert 0.5 < wide.share < prove(basins(1.5)).share
    for a in (1.45, 1.52, 1.55):
        assert differing(wide, basins(a)) == 0
    with pytest.raises(ValueError, match="lowest value first"):
        prove(basins(1.5), parameters={"a": (1.6, 1.4)})


def test_same_bits_for_any_number_of_threads_and_after_a_kill(roots, proof, tmp_path, monkeypatch):
    monkeypatch.setattr(passes, "_ROWS", 5000)
    monkeypatch.setattr(orbits_of_sets, "_TASK", 700)
    path, orbits = tmp_path / "proof.h5", passes.Machine.claim_orbits

    def killed(self, proved, *arguments):
        if proved.region.level:
            raise KeyboardInterrupt
        return orbits(self, proved, *arguments)

    monkeypatch.setattr(passes.Machine, "claim_orbits", killed)
    cellmap.set_threads(2)
    try:
        with pytest.raises(KeyboardInterrupt):
            prove(roots, splits=1, checkpoint=path)
        monkeypatch.setattr(passes.Machine, "claim_orbits", orbits)
        again = prove(roots, splits=1, checkpoint=path)
    finally:
        cellmap.set_threads(None)
    for name in ("labels", "ranks"):
        assert np.array_equal(getattr(again.cells, name), getattr(proof.cells, name))
    assert again.cost.evaluations == proof.cost.evaluations
    with pytest.raises(ValueError, match="belongs to another run"):
        prove(roots, splits=2, checkpoint=path)


def test_files_and_labelled_arrays(proof, tmp_path):
    again = Proof.load(proof.save(tmp_path / "proof.h5"))
    assert repr(again) == repr(proof)
    assert np.array_equal(again.cells.ranks, proof.cells.ranks)
    assert np.array_equal(cellmap.load_basins(tmp_path / "proof.h5").labels, proof.basins.labels)
    assert again.attractors[1].rate == proof.attractors[1].rate
    assert np.array_equal(proof.to_xarray()["labels"], proof.labels)
    with pytest.raises(ValueError, match="no map"):
        again.check(1)
    cellmap.save_basins(proof.basins, tmp_path / "basins.h5")
    with pytest.raises(cellmap.basins.StoreError, match="without a proof"):
        Proof.load(tmp_path / "basins.h5")


def test_certificates_take_proved_labels(roots):
    icm = interpolated_map(roots.point_map, CellGrid((-2.5, -2.5), (2.5, 2.5), (100, 100)))
    basins = find_basins(icm, CellGrid((-2, -2), (2, 2), (60, 60)))
    found = prove(basins, splits=0)
    certificate = certify(basins, proof=found, max_cost=float("inf"))
    proved = found.labels >= 0
    assert ((certificate.evidence == Evidence.PROVED) == proved).all()
    assert (certificate.basins.labels[proved] == found.labels[proved]).all()
    assert certificate.redone == np.count_nonzero(
        (certificate.evidence >= Evidence.EXACT) & (certificate.evidence < Evidence.PROVED)
    )


def test_certificates_take_no_proof_of_another_map():
    """Of the same name, grid and numbers; or for other values of a parameter."""

    def basins(sign):
        cubic = discrete_map(
            lambda x, p: (p.a * x[0] - 0.5 * x[0] ** 3 + 0.01 * sign,), {"a": 1.4}, ("x",), name="cubic"
        )
        icm = interpolated_map(cubic, CellGrid((-2.0,), (2.0,), (64,)))
        return find_basins(icm, CellGrid((-1.5,), (1.5,), (50,)))

    mine, others = basins(1.0), basins(-1.0)
    for proof in (prove(mine, splits=0), prove(mine, splits=0, parameters={"a": (1.4, 1.4)})):
        assert certify(mine, proof=proof).evidence.max() == Evidence.PROVED
    for proof in (prove(others, splits=0), prove(mine, splits=0, parameters={"a": (1.45, 1.46)})):
        with pytest.raises(ValueError, match="other basins"):
            certify(mine, proof=proof)


def test_windows_a_little_longer_than_the_circle_overlap():
    turning = discrete_map(damped, {}, (angle("theta"), "v"))
    grid = find_basins(turning, CellGrid((-pi, -2.0), (pi + 4e-9, 2.0), (8, 8))).grid
    assert grid.wraps[0]
    place = ProvedCells.none(Region(grid, turning.coordinates, (0, 0), (0, 0))).region.place()
    last = place.first[0] + 7
    assert place.mids[0, last] + place.half[0] >= grid.upper[0]
    assert place.middle == pytest.approx([0.0, 0.0], abs=1e-8)


def test_cells_are_alike_along_circles_all_round():
    labels = np.array([1, 1, 0, 0])
    assert alike(labels, (False,)).tolist() == [True, False, False, True]
    assert not alike(labels, (True,)).any() and alike(np.zeros(4), (True,)).all()


def test_balls_reach_nearly_as_far_as_the_basin():
    """To the repelling points at which 0.03 is 4 x^2, but for less than the factor by which balls grow."""
    slow = discrete_map(lambda x, p: (x[0] * (0.97 + 4.0 * x[0] ** 2),), {}, ("x",))
    found = prove(find_basins(slow, CellGrid((-0.08,), (0.08,), (2,))), splits=0, max_periods=100)
    balls = found.attractors[0]
    end, size = (0.03 / 4.0) ** 0.5, abs(balls.frames[0, 0, 0])
    assert 0.6 * end < balls.reach / size < end
    assert balls.radius / size < (0.03 / 12.0) ** 0.5 * (1 + 1e-9)  # where the derivative is 1
    # With cells wider than its ball an attractor is proved and no label.
    none = prove(found.basins, splits=0, max_periods=0)
    assert none.share == 0.0
    assert "no label is proved, though 1 of 1 attractors are" in repr(none)


def spiral(x, p):
    """Turn about two axes, and multiply by 0.4 + 0.6 r^2, with r in units of 0.5, which is 1 at r = 1 exactly."""
    a, b, c = x
    r = p.least + (1.0 - p.least) * (a * a + b * b + c * c) / 0.25
    u, v = cos(0.7) * a - sin(0.7) * b, sin(0.7) * a + cos(0.7) * b
    return r * u, r * (cos(0.4) * v - sin(0.4) * c), r * (sin(0.4) * v + cos(0.4) * c)


def test_no_ball_in_three_dimensions_grows_beyond_the_basin():
    """The witness is r -> r (0.4 + 0.6 r^2): it decreases exactly where r < 1."""
    image = discrete_map(spiral, {"least": 0.4}, ("a", "b", "c"))
    proof = prove(find_basins(image, CellGrid((-1.5, -1.5, -1.5), (1.5, 1.5, 1.5), (6, 6, 6))), splits=0)
    balls = next(iter(proof.attractors.values()))
    surface = np.random.default_rng(0).normal(size=(4000, 3))
    surface *= balls.reach / np.linalg.norm(surface, axis=1, keepdims=True)
    points = balls.centres[0] + np.linalg.solve(balls.frames[0], surface.T).T
    distances = np.linalg.norm(points, axis=1)
    assert balls.reach > 1.4 * balls.radius  # it has grown
    assert distances.min() > 0.4 * 0.5 and distances.max() < 0.5


def test_what_cannot_be_proved_says_so(roots):
    with pytest.raises(ValueError, match="CellGrid"):
        prove(find_basins(roots.point_map, np.array([[1.0, 0.1], [-1.0, 0.4]])))
    chaotic = discrete_map(lambda x, p: (3.9 * x[0] * (1 - x[0]),), {}, ("x",))
    found = prove(find_basins(chaotic, CellGrid((0.1,), (0.9,), (20,))))
    assert found.share == 0.0 and "none that is periodic was found" in repr(found)
    folded = discrete_map(lambda x, p: (1.9 * abs(x[0] - 0.5),), {}, ("x",))
    with pytest.raises(ValueError, match="fabs is not enclosed"):
        prove(find_basins(folded, CellGrid((0.1,), (0.9,), (20,))))
    rounded = discrete_map(damped, {}, (angle("theta", period=6.2832), "v"))
    with pytest.raises(ValueError, match=r"do not repeat after the period 6\.2832 of theta"):
        prove(find_basins(rounded, CellGrid((-3.0, -2.0), (3.0, 2.0), (12, 12))))
