"""Sets, cells and balls of proofs against exact arithmetic, with each term of their rounding left out in turn.

A case is made so that the exact result lies beyond a limit by less than a unit in the last place.
"""

from fractions import Fraction
from itertools import product
from math import inf, nextafter, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap._compiled.kernels.cell_covers import Forms, Place, cells_in_balls, list_met
from cellmap._compiled.kernels.parallelepipeds import FAILED, Sets, carry_sets, find_sets
from cellmap._lib.midpoint_radius import ROUNDING, Rounding

TURN = 2 * Fraction("3.14159265358979323846264338327950288419716939937510")
TERMS = {"unit": {"unit": 0.0}, "wider": {"wider": 1.0}, "tiny": {"tiny": 0.0}}


def exact(numbers: Any) -> Any:
    """Return an array of fractions."""
    return np.array([Fraction(float(x)) for x in np.ravel(numbers)], object).reshape(np.shape(numbers))


def beside(x: Fraction, direction: float) -> float:
    """Return the number next to another one, below it or above."""
    found = float(x)
    return found if (Fraction(found) - x) * Fraction(direction) > 0 else nextafter(found, direction * inf)


def two_cells(edges: Any, width: Any) -> Place:
    """Return two cells along each axis, on either side of an edge."""
    d, none = len(edges), np.zeros(len(edges))
    lines = np.stack([edges - width, edges, edges + width], axis=-1)
    mids = 0.5 * (lines[:, :-1] + lines[:, 1:])
    half = np.maximum(lines[:, 1:] - mids, mids - lines[:, :-1]).max(axis=-1)
    whole = np.zeros(d, np.int64)
    return Place(lines, mids, whole, whole + 2, whole, none, none, half, np.abs(lines).max(axis=-1))


def cells_left_out(rounding: Rounding) -> int:
    """Return how often a point of a set lies in a cell that it is not said to meet.  Edges are beside the point."""
    rng, missed, told = np.random.default_rng(1), 0, 0
    for trial in range(900):
        d, kind = 1 + trial % 3, ("far", "near", "thin", "small", "sums", "angles")[trial // 3 % 6]
        size = {"near": 1.0, "sums": 1.0, "small": 1e-200}.get(kind, 2.0**-33)
        derivatives, half = rng.normal(size=(d, d)), rng.uniform(0.5, 1.0, d) * size
        radii = rng.random(d) * size * (kind in ("near", "far"))
        turns = rng.integers(-9, 9, d) * (kind == "angles")
        image = rng.uniform(1.0, 2.0, d) * (kind in ("far", "thin", "angles")) + turns * float(TURN)
        if kind == "thin":  # all generators are parallel
            derivatives = np.outer(rng.normal(size=d), rng.normal(size=d))
        if kind == "small":
            derivatives *= 1e-200
        if kind == "sums":  # all but the first of their terms are less than half a unit in the last place
            radii, derivatives = np.ones(d), np.full((d, d), 2.0**-53)
        share = -np.sign(derivatives[0]) * (rng.random() if kind == "thin" else 1.0)
        centre = exact(image) - turns * TURN
        point = centre - exact(radii) + exact(derivatives) @ (exact(half) * exact(share))
        side = np.where(np.arange(d) == 0, 1, rng.integers(0, 2, d))  # 0 where the edge is below the point
        edges = np.array([beside(x, 2.0 * s - 1.0) for x, s in zip(point, side, strict=True)])
        place = two_cells(edges, 2.0**-29 if size < 0.1 else 32.0)
        place = place._replace(turn=np.full(d, float(TURN) * (kind == "angles")), middle=np.full(d, 1.5))
        forms = Forms(*(a[None] for a in (image, derivatives, radii)))
        met, counts = np.zeros((1, 16), np.int32), np.zeros(1, np.int64)
        list_met(forms, half, place, rounding, np.zeros(2**d, np.int16), met, counts, 0, 1)
        flat = int(sum((1 - s) * 2 ** (d - 1 - i) for i, s in enumerate(side)))
        told += counts[0] > 0
        missed += bool(counts[0] > 0 and flat not in met[0, : counts[0]])
    assert told > 800
    return missed


def cells_beyond_balls(rounding: Rounding) -> int:
    """Return how many cells are said to lie in a ball, though a corner does not.  The radius is below its distance."""
    rng, false = np.random.default_rng(2), 0
    for trial in range(400):
        d, kind = 1 + trial % 3, ("near", "far", "small")[trial // 3 % 3]
        centre = rng.uniform(1.0, 2.0, d) * (kind == "far")
        target, half = rng.uniform(-2.0, -1.0, d) * (kind == "far"), rng.random(d)
        form = rng.random((d, d))
        if kind == "far" and d > 1:  # what is far cancels
            form[0, -1] = -form[0, :-1] @ (centre - target)[:-1] / (centre - target)[-1]
            form[1:], half = 0.0, half * 1e-18
        if kind == "small":
            half, form = 2.0**-537 * half, np.eye(d)
        corners = (exact(centre) + exact(half) * exact(s) - exact(target) for s in product((-1.0, 1.0), repeat=d))
        distance = max(sum((exact(form) @ gap) ** 2) for gap in corners)
        scale = Fraction(2) ** 540 if kind == "small" else 1
        radius = float(Fraction(sqrt(distance * scale * scale)) / scale)
        while Fraction(radius) ** 2 >= distance:
            radius = nextafter(radius, 0.0)
        place = two_cells(np.zeros(d), np.ones(d))
        place = place._replace(mids=centre[:, None], cells=np.ones(d, np.int64), half=half)
        balls, labels = (target[None], form[None], np.array([radius])), np.zeros(1, np.int16)
        cells_in_balls(place, balls, np.array([1]), rounding, labels, np.zeros(1, np.int32))
        false += int(labels[0] != 0)
    return false


def generators_of(sets: Sets) -> Any:
    """Return the vectors, exact, whose sums with factors between -1 and 1 are the first set less its centre."""
    sides = exact(sets.shapes[0]) * exact(sets.sizes[0]), exact(sets.frames[0]) * exact(sets.spreads[0])
    return np.concatenate(sides, axis=1)


def images_beyond_sets(rounding: Rounding) -> int:
    """Return how many sets have a point whose image lies beyond the box around the next one."""
    rng, beyond = np.random.default_rng(3), 0
    for trial in range(400):
        d, kind = 1 + trial % 3, ("any", "thin", "flat", "small")[trial // 3 % 4]
        derivatives, shape = rng.normal(size=(d, d)), rng.normal(size=(d, d)) * (kind != "flat")
        frame, spread = np.linalg.qr(rng.normal(size=(d, d)))[0], rng.random(d) * (kind in ("any", "flat"))
        radii, sizes = rng.random(d) * (kind == "any"), rng.uniform(0.5, 1.0, d)
        if kind == "thin" and d > 1:  # a row of the product is next to nothing
            shape[-1] = -(derivatives[0, :-1] @ shape[:-1]) / derivatives[0, -1]
        if kind == "small":
            derivatives, shape = 1e-200 * derivatives, 1e-200 * shape
        sets = Sets(*(np.array(a[None]) for a in (np.zeros(d), shape, sizes, frame, spread, spread)))
        worst = np.abs(exact(derivatives) @ generators_of(sets)).sum(axis=1) + exact(radii)
        forms, known = Forms(*(a[None] for a in (np.zeros(d), derivatives, radii))), np.zeros(1, bool)
        carry_sets(sets, forms, rounding, known, 0, 1)
        assert known[0]
        beyond += bool((worst > np.abs(generators_of(sets)).sum(axis=1)).any())
    return beyond


def sets_beyond_hulls(rounding: Rounding) -> int:
    """Return how many sets are said to lie in a box that does not hold them."""
    rng, beyond = np.random.default_rng(4), 0
    for trial in range(90):
        d, kind = 1 + trial % 3, ("any", "small", "sums")[trial // 3 % 3]
        shape, frame = rng.normal(size=(d, d + 1)), rng.normal(size=(d, d))
        sizes, spread = rng.random(d + 1), rng.random(d)
        if kind == "small":
            shape, sizes = 1e-200 * shape, 1e-200 * sizes
            spread = 0.0 * spread
        if kind == "sums":  # all but the first of their terms are less than half a unit in the last place
            shape, frame = np.full((d, d + 1), 2.0**-53), np.full((d, d), 2.0**-53)
            shape[:, 0], sizes, spread = 1.0, np.ones(d + 1), np.ones(d)
        sets = Sets(*(np.array(a[None]) for a in (np.zeros(d), shape, sizes, frame, spread, np.zeros(d))))
        balls = np.zeros((0, d)), np.zeros((0, d, d)), np.zeros(0)
        outcome, none = np.zeros(1, np.int64), np.zeros(0, np.int64)
        where = two_cells(np.zeros(d), np.ones(d)), balls, none, np.full(d, 1e300)
        few = np.zeros(0, np.int16), np.zeros(0, np.int32)
        find_sets(sets, np.ones(1, bool), *where, *few, rounding, outcome, np.zeros(1, np.int64), 0, 1)
        assert outcome[0] != FAILED
        hulls = np.abs(generators_of(sets)).sum(axis=1)
        beyond += any(x > Fraction(h) for x, h in zip(hulls, sets.hulls[0], strict=True))
    return beyond


WRONG = [cells_left_out, cells_beyond_balls, images_beyond_sets, sets_beyond_hulls]
UNSEEN = [(images_beyond_sets, "wider"), (sets_beyond_hulls, "unit")]
"""The images of sets lose at most 4 d + 7 units where all operations round down, of which the bound of how far frames
are from orthogonal ones holds 2 (d + 2): no random case needs the rest.  Hulls have no unit."""
NOTICED = [(wrong, term) for wrong in WRONG for term in TERMS if (wrong, term) not in UNSEEN]


@pytest.mark.parametrize("wrong", WRONG)
def test_nothing_is_wrong_in_exact_arithmetic(wrong):
    assert wrong(ROUNDING) == 0


@pytest.mark.parametrize(("wrong", "term"), NOTICED)
def test_a_term_that_is_left_out_is_noticed(wrong, term):
    assert wrong(ROUNDING._replace(**TERMS[term])) > 0
