"""Transition probabilities between cells, from sample points and noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Floats, Ints
from .._lib.checks import claim_memory, finite_number, is_sequence, of_the_user, real_array, whole_number
from .._lib.threads import run_over, slices
from ..maps.grid import CellGrid
from ..maps.orbit_batch import CHUNK, Status
from ..maps.point_map import PointMap
from .box_images import middles, tallied
from .cell_images import DIVERGED, LEFT, cells_of, centres_of, images_of
from .markov import Sparse

Noise = Callable[[np.random.Generator, int], Floats]
"""Returns the noise that is added to n points, shape (n, dimension), drawn from a generator."""


def checked_samples(samples: Sequence[int] | int, grid: CellGrid) -> tuple[int, ...] | int:
    """Return the samples of a cell, as many at a time as a map takes."""
    if isinstance(samples, int | np.integer):
        return whole_number("samples", samples, at_least=1, at_most=CHUNK)
    if not isinstance(samples, Sequence) or len(samples) != grid.dimension:
        raise ValueError(
            f"samples={samples!r}: give {grid.dimension} numbers, one for each axis, or one number of random points"
        )
    counts = tuple(whole_number("samples", n, at_least=1) for n in samples)
    if np.prod(counts, dtype=object) > CHUNK:
        raise ValueError(f"samples={samples!r}: give at most {CHUNK:,} points of a cell")
    return counts


def checked_noise(noise: float | Sequence[float] | Noise | None, grid: CellGrid) -> Noise | None:
    """Return noise as a function."""
    if noise is None or callable(noise):
        return noise
    d = grid.dimension
    given: Any = noise if is_sequence(noise) else (noise,) * d
    deviation = np.array([finite_number("noise", v, at_least=0.0) for v in given])
    if len(deviation) != d:
        raise ValueError(f"noise={noise!r}: give one standard deviation, or {d}, one for each coordinate")
    return lambda rng, n: rng.normal(0.0, deviation, (n, d))


def transitions(
    point_map: PointMap,
    grid: CellGrid,
    samples: tuple[int, ...] | int,
    periods: int,
    noise: Noise | None,
    seed: int,
    progress: bool,
) -> tuple[Sparse, int, int]:
    """Return the matrix of a chain, how many samples missed a tolerance, and how many there are."""
    from scipy.sparse import csr_array

    each = samples if isinstance(samples, int) else int(np.prod(samples))
    taken, states = grid.size * each, grid.size + 2
    claim_memory(f"a chain of {grid.size:,} cells with {each} samples", 26 * taken + 64 * states, "take fewer of them")
    parts = slices(grid.size, max(1, CHUNK // each))
    rows: dict[int, tuple[Ints, NDArray[Any], Floats]] = {}
    missed = np.zeros(len(parts), np.int64)
    lattice = None if isinstance(samples, int) else middles(samples)
    index = np.int32 if max(taken, states) < 2**31 else np.int64

    def work(number: int) -> None:
        part = parts[number]
        rng = np.random.default_rng([seed, part.start])
        cells = np.arange(part.start, part.stop)
        places = rng.uniform(-0.5, 0.5, (len(cells), each, grid.dimension)) if lattice is None else lattice
        points = (centres_of(grid, cells)[:, None, :] + places * grid.widths).reshape(-1, grid.dimension)
        orbits = images_of(point_map, points, periods, None if noise is None else _kick(noise, rng, grid.dimension))
        found = cells_of(point_map, grid, orbits)
        hits = tallied(np.where(found < 0, states + found, found), np.arange(len(cells)), each)
        counts = np.bincount(hits.rows, minlength=len(cells))
        rows[number] = counts, hits.targets.astype(index), hits.counts / each
        missed[number] = np.count_nonzero(orbits.status == Status.INACCURATE)

    run_over(range(len(parts)), work, f"chain of cells of {point_map.name}" if progress else None)
    counts = np.concatenate([[0], *(rows[k][0] for k in range(len(parts))), [1, 1]])
    sinks = np.array([states + DIVERGED, states + LEFT], index)
    targets = np.concatenate([*(rows[k][1] for k in range(len(parts))), sinks])
    probabilities = np.concatenate([*(rows[k][2] for k in range(len(parts))), np.ones(2)])
    matrix = csr_array((probabilities, targets, np.cumsum(counts).astype(index)), shape=(states, states))
    return matrix, int(missed.sum()), taken


def _kick(noise: Noise, rng: np.random.Generator, dimension: int) -> Callable[[int], Floats]:
    """Return noise that is drawn from a generator, and checked."""

    def kick(n: int) -> Floats:
        drawn = real_array("noise", of_the_user("noise", noise, rng, n))
        if drawn.shape != (n, dimension):
            raise ValueError(f"noise returned the shape {drawn.shape}: return one of ({n}, {dimension})")
        if not np.isfinite(drawn).all():
            raise ValueError(f"noise returned {drawn[~np.isfinite(drawn)][0]}: return finite numbers")
        return drawn

    return kick
