"""Generalized cell mapping: transition probabilities from each cell to several cells (Hsu 1981)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Floats, Ints
from .._lib.checks import claim_memory, finite_number, is_sequence, of_the_user, real_array, whole_number
from .._lib.randomness import Rng, random_seed
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..maps.grid import CellGrid
from ..maps.orbit_batch import CHUNK, Cost, Status
from ..maps.point_map import PointMap
from .box_images import DIVERGED, LEFT, cells_of, centres_of, images_of, middles, tallied, warn_of_inaccurate
from .cell_chain import CellChain
from .markov import Sparse, components_of

Noise = Callable[[np.random.Generator, int], Floats]
"""Returns the noise that is added to n points, shape (n, dimension), drawn from a generator."""


@checked
def generalized_cell_mapping(
    point_map: PointMap,
    grid: CellGrid,
    samples: Sequence[int] | int | None = None,
    periods: int = 1,
    noise: float | Sequence[float] | Noise | None = None,
    *,
    rng: Rng = 0,
    progress: bool = False,
) -> CellChain:
    """Compute a generalized cell mapping: a Markov chain whose states are the cells of a window.

    The transition probabilities are the fractions of the sample points of a cell that are mapped into each other cell.
    Closed classes of the chain contain the attractors, other classes the saddles; cells from which several closed
    classes can be reached lie along basin boundaries, and their absorption probabilities show how near.  The chain
    contains more information than a simple cell mapping but diffuses more: a step spreads every cell over others, so
    that small attractors are lost unless a step takes several periods.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map.
    grid : CellGrid
        Cells of a window.  An axis that covers one period of an angle is periodic.
    samples : sequence of int, or int, optional
        Sample points in each cell: the numbers along each axis of a regular lattice, or a number of random points.  By
        default 5 along each axis.
    periods : int, optional
        Steps of the map in one step of the chain.
    noise : float, sequence of float, or callable, optional
        Noise that is added after each step of the map: normally distributed with this standard deviation, one for all
        coordinates or one for each; or the values that ``noise(rng, n)`` returns, of shape (n, dimension).
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of random samples and noise.
    progress : bool, optional
        Show a progress bar on a terminal if the work takes more than two seconds.

    Returns
    -------
    CellChain
        The chain; its classes, measures, probabilities, times and basins are computed on demand.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.
    MemoryError
        If the chain does not fit into memory.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance for some samples.

    References
    ----------
    Hsu, Journal of Applied Mechanics 48 (1981) 634; Hsu, Guttalu, Zhu, the same 49 (1982) 885; Hsu, *Cell-to-Cell
    Mapping* (1987), chapters 10 to 13.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> newton = discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]),), {}, ("x",))
    >>> chain = generalized_cell_mapping(newton, CellGrid((-3,), (3,), (60,)))
    >>> chain.closed
    (CellClass(closed, 1 cells, period 1), CellClass(closed, 1 cells, period 1))
    >>> [f.fraction for f in chain.basins().fractions.values()]
    [0.467, 0.467, 0.0667]
    """
    grid = grid.on(point_map.coordinates)
    samples = _checked_samples((5,) * grid.dimension if samples is None else samples, grid)
    periods = whole_number("periods", periods, at_least=1)
    kick = _checked_noise(noise, grid)
    seed = random_seed(rng)
    began = time.perf_counter()
    matrix, inaccurate, taken = _transitions(point_map, grid, samples, periods, kick, seed, progress)
    diverge = bool((matrix.indices[: matrix.indptr[grid.size]] == grid.size + 2 + DIVERGED).any())
    warn_of_inaccurate(inaccurate, taken, diverge)
    components = components_of(matrix)
    cost = Cost(time.perf_counter() - began, taken * periods)
    return CellChain(matrix, grid, point_map, samples, periods, kick is not None, components, inaccurate, cost)


def _checked_samples(samples: Sequence[int] | int, grid: CellGrid) -> tuple[int, ...] | int:
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


def _checked_noise(noise: float | Sequence[float] | Noise | None, grid: CellGrid) -> Noise | None:
    """Return noise as a function."""
    if noise is None or callable(noise):
        return noise
    d = grid.dimension
    given: Any = noise if is_sequence(noise) else (noise,) * d
    deviation = np.array([finite_number("noise", v, at_least=0.0) for v in given])
    if len(deviation) != d:
        raise ValueError(f"noise={noise!r}: give one standard deviation, or {d}, one for each coordinate")
    return lambda rng, n: rng.normal(0.0, deviation, (n, d))


def _transitions(
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
    lattice = None if isinstance(samples, int) else middles(samples)
    index = np.int32 if max(taken, states) < 2**31 else np.int64

    def work(part: slice) -> tuple[Ints, NDArray[Any], Floats, int]:
        rng = np.random.default_rng([seed, part.start])
        cells = np.arange(part.start, part.stop)
        places = rng.uniform(-0.5, 0.5, (len(cells), each, grid.dimension)) if lattice is None else lattice
        points = (centres_of(grid, cells)[:, None, :] + places * grid.widths).reshape(-1, grid.dimension)
        orbits = images_of(point_map, points, periods, None if noise is None else _kick(noise, rng, grid.dimension))
        found = cells_of(point_map, grid, orbits)
        hits = tallied(np.where(found < 0, states + found, found), np.arange(len(cells)), each)
        counts = np.bincount(hits.rows, minlength=len(cells)).astype(np.int64)
        missed = int(np.count_nonzero(orbits.status == Status.INACCURATE))
        return counts, hits.targets.astype(index), hits.counts / each, missed

    parts = slices(grid.size, max(1, CHUNK // each))
    rows = run_over(parts, work, f"chain of cells of {point_map.name}" if progress else None)
    counts, targets, probabilities, missed = zip(*rows, strict=True)
    begin = np.cumsum(np.concatenate([[0], *counts, [1, 1]])).astype(index)
    sinks = np.array([states + DIVERGED, states + LEFT], index)
    entries = np.concatenate([*probabilities, np.ones(2)]), np.concatenate([*targets, sinks])
    return csr_array((*entries, begin), shape=(states, states)), sum(missed), taken


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
