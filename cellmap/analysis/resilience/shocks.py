"""Minimal fatal shocks: smallest displacements from an attractor that leave its basin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Floats
from ..._lib.binomial import binomial_interval
from ..._lib.checks import affordable_number, shown
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ...basins.classification import chosen_coordinates, labeller, own_label, scale_of, span_of
from ...basins.record import Basins
from ...maps.coordinates import Coordinate, state_points, wrap
from ...maps.point_map import PointMap
from .shock_search import FINE, Trials, bracketed, candidates_of, fatal_inside, shortened, shortest_of

_ROUNDS = 12  # searches for smaller shocks elsewhere


@dataclass(frozen=True, eq=False)
class FatalShock:
    """Minimal fatal shock: the smallest displacement found that leaves the basin of an attractor.

    The shock is fatal, so that its size is an upper bound of the minimum; that no smaller one exists is the result of a
    search, not a proof.

    Parameters
    ----------
    label : int
        Label of the attractor.
    point : ndarray, shape (dimension,)
        Point of the attractor to which the shock is applied.
    shock : ndarray, shape (dimension,)
        Displacement, in the units of the coordinates.
    size : float
        Length of the shock, each coordinate in units of `scale`.
    bracket : tuple of float
        Sizes in its direction that enclose the basin boundary: a shock of the first size returns to the attractor, one
        of the second does not.
    reached : int
        Label after the shock: another attractor, -1 or -2; never -3.
    scale : ndarray, shape (dimension,)
        Unit of length along each coordinate.
    from_image : float
        Distance from `point` to the nearest labelled initial condition outside the basin.
    tested, inside_fatal, inside_high : int, int, float
        Number of random shocks that were tried inside the ball of this size, number of fatal ones among them (0, unless
        the search ended early), and upper end of the 95 % interval of their fraction.  A thinner tongue of another
        basin may extend into the ball.
    undecided : int
        Number of tried shocks whose orbits did not settle; these count as not fatal.
    coordinates : tuple of Coordinate
        State variables.
    """

    label: int
    point: Floats
    shock: Floats
    size: float
    bracket: tuple[float, float]
    reached: int
    scale: Floats
    from_image: float
    tested: int
    inside_fatal: int
    inside_high: float
    undecided: int
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        kick = ", ".join(f"{v:.6g}" for v in self.shock)
        return f"FatalShock(size {self.size:.8g}, ({kick}) from attractor {self.label} to {self.reached})"

    @property
    def end(self) -> Floats:
        """State after the shock, angles within their period."""
        return wrap(self.point + self.shock, self.coordinates)


@checked
def minimal_fatal_shock(
    basins: Basins,
    label: int,
    point: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    along: Sequence[int | str] | None = None,
    n_trials: int = 4096,
    *,
    rng: Rng = 0,
    point_map: PointMap | None = None,
    max_periods: int | None = None,
) -> FatalShock:
    r"""Find the minimal fatal shock: the smallest displacement from an attractor that leaves its basin.

    Its length is :math:`\min_{a \in A, x \notin B} \lvert x - a \rvert` for the attractor A and its basin B.

    Labelled initial conditions outside the basin are the first candidates, by their distance with periodic angles.
    From the nearest of these in different directions on, the map is used: shorter shocks are tried on rays around the
    best shock so far, and the spread of the rays is halved if none is fatal.  Finally random shocks inside the ball are
    tried; if one is fatal, the search is restarted from it.

    Parameters
    ----------
    basins : Basins
        Basins on a grid, or of single initial conditions.
    label : int
        Label of the attractor.
    point : array_like, shape (dimension,), optional
        State to which the shock is applied; by default the point of the attractor that is most at risk.
    scale : array_like, optional
        Unit of length along each coordinate; the size of a shock is its Euclidean length in these.  By default the
        sizes of the window.
    along : sequence of int or str, optional
        Coordinates that a shock may change, by number or name; by default all.
    n_trials : int, optional
        Number of random shocks inside the ball.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of rays and random shocks.
    point_map : PointMap, optional
        Map to use instead of the exact one.
    max_periods : int, optional
        Number of periods after which a state is undecided, by default that of the basins.

    Returns
    -------
    FatalShock
        The shock with its bracket.  It is a local minimum: its size is an upper bound of the global minimum.

    Raises
    ------
    TypeError, ValueError
        For basins without their map, a label without a basin, or if no initial condition lies outside the basin.

    References
    ----------
    Halekotte, Feudel, Scientific Reports 10 (2020) 11783.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> basins = find_basins(cubic, CellGrid((-1.5,), (1.5,), (60,)))
    >>> minimal_fatal_shock(basins, 0, scale=1.0)  # beyond sqrt(3), orbits are thrown to the other side
    FatalShock(size 0.73205081, (0.732051) from attractor 0 to 1)
    """
    k = own_label(basins, label)
    labels_of = labeller(basins, point_map=point_map, max_periods=max_periods, name="basins")
    coordinates = basins.coordinates
    d = len(coordinates)
    unit = scale_of(scale, coordinates, span_of(basins))
    tried = affordable_number("n_trials", n_trials, 8 * (7 * d + 4), at_least=1)
    free = chosen_coordinates("along", along, coordinates)
    origins = basins.attractors[k].points if point is None else state_points("point", point, coordinates)[None]
    if origins.ndim != 2:
        raise ValueError(f"point={shown(point)}: give one state")
    trials = Trials(labels_of, k, unit, free)
    home = labels_of(origins)
    if (home != k).any():
        place, own = origins[np.argmax(home != k)].tolist(), int(home[home != k][0])
        raise ValueError(f"point: the state {place} has the label {own}, not {k}; give a state in the basin")
    rng = random_numbers(rng)
    nearest, row, shock = shortest_of(trials, origins, candidates_of(basins, k, origins, unit, free), rng)
    rows = np.array([row])
    for _ in range(_ROUNDS):
        shock = shortened(trials.at(origins[row]), shock, FINE, rng)
        others = [row] if point is not None else rng.choice(len(origins), min(len(origins), 8), replace=False)
        rows = np.unique(np.append(others, row))
        each = tried // len(rows) + 1
        inside = [(r, hit) for r in rows for hit in fatal_inside(trials.at(origins[r]), shock, each, rng)]
        if not inside:
            break
        row, shock = min(inside, key=lambda found: float(np.linalg.norm(found[1])))
    shock, bracket = bracketed(trials.at(origins[row]), shock)
    full = trials.displacements(shock[None])[0]
    return FatalShock(
        label=k,
        point=origins[row].copy(),
        shock=full,
        size=bracket[1],
        bracket=bracket,
        reached=int(labels_of((origins[row] + full)[None])[0]),
        scale=unit,
        from_image=nearest,
        tested=each * len(rows),
        inside_fatal=len(inside),
        inside_high=float(binomial_interval(len(inside), each * len(rows))[1]),
        undecided=sum(trials.undecided),
        coordinates=coordinates,
    )
