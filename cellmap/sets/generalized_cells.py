"""Generalized cell mapping: transition probabilities from each cell to several cells (Hsu 1981)."""

from __future__ import annotations

import time
from collections.abc import Sequence

from .._lib.checks import whole_number
from .._lib.randomness import Rng, random_seed
from .._lib.signatures import checked
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost
from ..maps.point_map import PointMap
from .cell_chain import CellChain
from .cell_images import check_map_and_grid, warn_of_inaccurate
from .cell_transitions import Noise, checked_noise, checked_samples, transitions
from .markov import components_of


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
    grid = check_map_and_grid(point_map, grid)
    samples = checked_samples((5,) * grid.dimension if samples is None else samples, grid)
    periods = whole_number("periods", periods, at_least=1)
    kick = checked_noise(noise, grid)
    seed = random_seed(rng)
    began = time.perf_counter()
    matrix, inaccurate, taken = transitions(point_map, grid, samples, periods, kick, seed, progress)
    warn_of_inaccurate(inaccurate, taken)
    components = components_of(matrix)
    cost = Cost(time.perf_counter() - began, taken * periods)
    return CellChain(matrix, grid, point_map, samples, periods, kick is not None, components, inaccurate, cost)
