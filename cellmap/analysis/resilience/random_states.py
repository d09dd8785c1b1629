"""Random states in boxes and balls around an attractor, all coordinates or those of one node of a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import affordable_number, check_mapping, finite_number, pair_of, shown
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ...basins.classification import chosen_coordinates, scale_of
from ...orbits.attractor import Attractor


@dataclass(frozen=True, eq=False)
class RandomStates:
    """Distribution of states around an attractor, for :func:`basin_stability`; called with a seed it draws some.

    Parameters
    ----------
    centres : ndarray, shape (points, dimension)
        Points of the attractor, one of which is drawn for each state.
    columns : ndarray of int, shape (columns,)
        Coordinates that are random; the others are those of the attractor.
    lower, upper : ndarray, shape (columns,)
        Bounds of these coordinates in a box; half axes of a ball are `upper`, displacements from the attractor.
    ball : bool
        Whether states are uniform in a ball.
    """

    centres: Floats
    columns: Ints
    lower: Floats
    upper: Floats
    ball: bool

    def __repr__(self) -> str:
        kind = "ball" if self.ball else "box"
        return f"RandomStates({kind} of {len(self.columns)} of {self.centres.shape[1]} coordinates)"

    def __call__(self, rng: Rng = 0, n_samples: int = 1000) -> Floats:
        """Draw states.

        Parameters
        ----------
        rng : int, numpy.random.Generator or None, optional
            Seed or generator of the draw.
        n_samples : int, optional
            Number of states.

        Returns
        -------
        ndarray, shape (n_samples, dimension)
            States, for :func:`find_basins` and others that take initial conditions.
        """
        numbers = random_numbers(rng)
        n = affordable_number("n_samples", n_samples, 32 * self.centres.shape[1], at_least=1)
        states = self.centres[numbers.integers(len(self.centres), size=n)]
        shape = n, len(self.columns)
        if self.ball:
            away = numbers.standard_normal(shape)
            away *= (numbers.random((n, 1)) ** (1.0 / shape[1])) / np.linalg.norm(away, axis=1, keepdims=True)
            states[:, self.columns] += away * self.upper
        else:
            states[:, self.columns] = numbers.uniform(self.lower, self.upper, shape)
        return states


@checked
def random_box(attractor: Attractor, ranges: Mapping[str, Sequence[float]]) -> RandomStates:
    """Return the uniform distribution over ranges of some coordinates, with all others on an attractor.

    With the coordinates of one node of a network these are the states of single-node basin stability.

    Parameters
    ----------
    attractor : Attractor
        The attractor; of several points of it each state has one at random.
    ranges : mapping of str to pair of float
        Lower and upper bound of each random coordinate, by name: values, not displacements.

    Returns
    -------
    RandomStates
        A distribution for :func:`basin_stability`.  Called with a seed and a number it draws states.

    Raises
    ------
    TypeError, ValueError
        For names that are no coordinates, and bounds that are not finite or not in ascending order.

    References
    ----------
    Menck, Heitzig, Marwan, Kurths, Nature Physics 9 (2013) 89.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> two = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> basins = find_basins(two, CellGrid((-1.5, -1), (1.5, 1), (20, 20)))
    >>> random_box(basins.attractors[0], {"y": (-1, 1)})(rng=0, n_samples=2)
    array([[ 1.        ,  0.27392337],
           [ 1.        , -0.46042657]])
    """
    check_mapping("ranges", ranges, "of coordinates to their bounds, such as {'q': (-1, 1)}")
    columns = chosen_coordinates("ranges", list(ranges), attractor.coordinates)
    bounds = {}
    for name, given in ranges.items():
        low, high = (finite_number(f"ranges[{name!r}]", v) for v in pair_of(f"ranges[{name!r}]", given))
        if not low < high:
            raise ValueError(f"ranges[{name!r}]={shown(given)}: give the lower bound first")
        bounds[name] = low, high
    lower, upper = np.array([bounds[attractor.coordinates[j].name] for j in columns]).T
    return RandomStates(attractor.points, columns, lower, upper, ball=False)


@checked
def random_ball(
    attractor: Attractor, radius: float, along: Sequence[int | str] | None = None, scale: ArrayLike = 1.0
) -> RandomStates:
    """Return the uniform distribution over a ball around an attractor.

    Parameters
    ----------
    attractor : Attractor
        The attractor; of several points of it each state has one at random.
    radius : float
        Radius of the ball in units of `scale`, above 0.
    along : sequence of int or str, optional
        Coordinates that are random, by number or name; by default all.
    scale : array_like, optional
        Unit of length along each coordinate of the system.

    Returns
    -------
    RandomStates
        A distribution for :func:`basin_stability`.  Called with a seed and a number it draws states.

    Raises
    ------
    TypeError, ValueError
        For names that are no coordinates, or a radius or scale that is not positive.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> from cellmap.analysis.resilience import basin_stability
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> basins = find_basins(cubic, CellGrid((-1.5,), (1.5,), (60,)))
    >>> basin_stability(basins, random_ball(basins.attractors[0], 2.0), n_samples=1000).fractions[0].fraction
    0.487
    """
    columns = chosen_coordinates("along", along, attractor.coordinates)
    radius = finite_number("radius", radius, above=0.0)
    half_axes = radius * scale_of(scale, attractor.coordinates, None)[columns]
    return RandomStates(attractor.points, columns, -half_axes, half_axes, ball=True)
