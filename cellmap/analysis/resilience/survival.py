"""Survivability: the fraction of random states whose orbits stay where they may be."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..._lib.arrays import Bools, Floats
from ..._lib.binomial import binomial_interval
from ..._lib.checks import affordable_number, finite_number, of_the_user, pair_of, shown, whole_number
from ..._lib.randomness import Rng
from ..._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Layout
from ..._lib.signatures import checked
from ..._lib.threads import slices
from ...basins.classification import chosen_coordinates
from ...maps.coordinates import Coordinate, wrap
from ...maps.grid import CellGrid
from ...maps.point_map import PointMap
from ...maps.stroboscopic import Stroboscopic
from ...maps.trajectories import Sampler
from .basin_statistics import Distribution, drawn_states

_STATES = 2**22  # numbers that are kept of the orbits of one part

Allowed = Callable[[Floats], Bools]


@dataclass(frozen=True, eq=False)
class Survivability(ConvertsToXarray, ConvertsToDataFrame):
    """Survivability: fractions of random states whose orbits have stayed in a region up to each time.

    Parameters
    ----------
    times : ndarray, shape (times,)
        Times since the beginning, in the unit of the period; steps for a discrete map.
    fractions, standard_errors, low, high : ndarray, shape (times,)
        Fraction of the orbits that have not left the region by then, its standard error and its confidence interval.
    survival_times : ndarray, shape (n,)
        First of these times at which each orbit was outside; infinity if it was not.
    states : ndarray, shape (n, dimension)
        States that were drawn.
    confidence : float
        Confidence level of each interval.
    """

    _layout: ClassVar = Layout(
        "Survivability",
        {"times": Array("time", "time")},
        {name: Array("time") for name in ("fractions", "standard_errors", "low", "high")}
        | {"survival_times": Array("state"), "states": Array("state", name="initial_{state}")},
    )

    times: Floats
    fractions: Floats
    standard_errors: Floats
    low: Floats
    high: Floats
    survival_times: Floats
    states: Floats
    coordinates: tuple[Coordinate, ...]
    confidence: float

    def __repr__(self) -> str:
        last = f"{self.fractions[-1]:.4g} in [{self.low[-1]:.4g}, {self.high[-1]:.4g}]"
        return f"Survivability({last} until {self.times[-1]:.6g}, {len(self.states)} states)"


@checked
def survivability(
    point_map: PointMap,
    allowed: Mapping[str, Sequence[float]] | Allowed,
    distribution: CellGrid | Distribution,
    n_samples: int = 1000,
    periods: int = 100,
    samples_per_period: int = 16,
    *,
    rng: Rng = 0,
    confidence: float = 0.95,
    method: str = "exact",
) -> Survivability:
    r"""Compute survivability: the fraction of random states whose orbits do not leave a region of allowed states.

    It is the fraction of states x with :math:`\varphi_t(x) \in X^{+}` for all times t up to the horizon.

    Orbits of a stroboscopic map are examined at equally spaced times within the periods as well, those of other maps
    at each step.  An orbit that ends, because it diverges for instance, has left.

    Parameters
    ----------
    point_map : PointMap
        Exact or interpolated map; the exact one is used.
    allowed : mapping of str to pair of float, or callable
        Lower and upper bounds of coordinates by name, or a function that takes states (n, dimension), angles wrapped,
        and returns n truth values.  The interval of an angle goes from the first bound upwards to the second.
    distribution : CellGrid or callable
        Window in which states are uniform, a function ``distribution(rng, n)`` that draws n states, or what
        :func:`random_box` and :func:`random_ball` return.
    n_samples : int, optional
        Number of states.
    periods : int, optional
        Number of steps of the map.
    samples_per_period : int, optional
        Times at which an orbit is examined in each period.  What it does between them is not seen, so that the fraction
        is an upper bound that falls to its limit for many samples.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the draw.
    confidence : float, optional
        Confidence level of each interval separately.
    method : {"exact", "Wilson"}, optional
        Method of the interval, see :func:`binomial_interval`.

    Returns
    -------
    Survivability
        Fractions over time with their intervals.

    Raises
    ------
    TypeError, ValueError
        For bounds that are not in ascending order, names that are no coordinates, or a function of another result.

    References
    ----------
    Hellmann, Schultz, Grabow, Heitzig, Kurths, Scientific Reports 6 (2016) 29654.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> double = discrete_map(lambda x, p: (2 * x[0],), {}, ("x",))
    >>> survivability(double, {"x": (-1, 1)}, CellGrid((-1,), (1,), (1,)), periods=3).fractions
    array([1.   , 0.502, 0.264, 0.116])
    """
    exact = point_map.without_table
    inside = _region(allowed, exact.coordinates)
    steps = whole_number("periods", periods, at_least=1)
    samples = whole_number("samples_per_period", samples_per_period, at_least=1)
    number = affordable_number("n_samples", n_samples, 8 * (4 * exact.dimension + 6), at_least=1)
    states = drawn_states(distribution, exact.coordinates, number, rng)
    spec = exact.spec
    sampler = Sampler(spec, samples) if isinstance(spec, Stroboscopic) else None
    per_step, length = (samples, spec.system.length) if isinstance(spec, Stroboscopic) else (1, 1.0)
    times = np.arange(steps * per_step + 1) / per_step * length
    left = np.empty(number)
    for part in slices(number, max(1, _STATES // (len(times) * exact.dimension))):
        orbits = exact.orbit(states[part], steps).points if sampler is None else sampler.states(states[part], steps)[0]
        present = np.isfinite(orbits).all(axis=-1)
        stays = np.zeros(present.shape, bool)
        stays[present] = inside(wrap(orbits[present], exact.coordinates))
        left[part] = np.where(stays.all(axis=0), np.inf, times[np.argmin(stays, axis=0)])
    counts = np.count_nonzero(left[:, None] > times, axis=0)
    low, high = binomial_interval(counts, number, confidence, method)
    mean = counts / number
    errors = np.sqrt(mean * (1.0 - mean) / number)
    return Survivability(times, mean, errors, low, high, left, states, exact.coordinates, confidence)


def _region(allowed: object, coordinates: Sequence[Coordinate]) -> Allowed:
    """Return a function that tells which states (n, d) are allowed."""
    if isinstance(allowed, Mapping):
        bounds = []
        for name, given in allowed.items():
            (j,) = chosen_coordinates("allowed", name, coordinates)
            low, high = (finite_number(f"allowed[{name!r}]", v) for v in pair_of(f"allowed[{name!r}]", given))
            if not low < high:
                raise ValueError(f"allowed[{name!r}]={shown(given)}: give the lower bound first")
            bounds.append((j, low, high, coordinates[j].period))
        if not bounds:
            raise ValueError("allowed is empty: give the bounds of at least one coordinate")

        def within(states: Floats) -> Bools:
            above = [(states[:, j] - low, high - low, period) for j, low, high, period in bounds]
            every = [(a if turn is None else a % turn, width) for a, width, turn in above]
            return np.logical_and.reduce([(a >= 0.0) & (a <= width) for a, width in every])

        return within
    if not callable(allowed):
        raise TypeError(f"allowed={shown(allowed)}: give bounds of coordinates by name, or a function of states")
    function = allowed

    def told(states: Floats) -> Bools:
        found = np.asarray(of_the_user("allowed", function, states))
        if found.shape != (len(states),) or found.dtype != bool:
            raise ValueError(f"allowed returns the shape {found.shape} of {found.dtype}: return {len(states)} bools")
        return found

    return told
