"""Edge states on basin boundaries, computed with straddle orbits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.arrays import Floats
from ..._lib.checks import affordable_number, finite_number, whole_number
from ..._lib.fit import Fit, fit_line
from ..._lib.signatures import checked
from ...attractors.settling.labels import Label
from ...basins.classification import Labeller, Outcome, labeller, own_label, places_of, scale_of, span_of
from ...basins.record import Basins
from ...maps.coordinates import Coordinate, difference, state_points, wrap
from ...maps.point_map import PointMap, follow
from ...orbits.orbit_kinds import PeriodicOrbit
from ...orbits.periodic_search import periodic_orbit
from ..resilience.shock_search import nearest_foreign

_SECTIONS = 32  # sections of a segment whose ends are labelled together
_TILT = 1e-3  # one point of the first pair is moved out of line by this fraction of their distance
_BLOCKS = 8  # blocks of an orbit whose mean growths are compared
_SAME = 1e-2  # scaled distance of a saddle from the straddle orbit that led to it


@dataclass(frozen=True, eq=False)
class EdgeOrbit:
    """Straddle orbit: pairs of close states on the two sides of a basin boundary.

    Parameters
    ----------
    points : ndarray, shape (n, dimension)
        Midpoints of the pairs at each step of the map, angles within their period.
    widths : ndarray, shape (n,)
        Distances of the pairs, in units of `scale`.
    sides : ndarray of int16, shape (n, 2)
        Labels of the two states: first that of the basin whose boundary is followed, then the one beyond it.
    orbit : PeriodicOrbit or None
        Periodic orbit to which the straddle orbit converges, found by Newton's method from its end; None if the end is
        not periodic (a chaotic edge state, or an orbit too short to have converged).
    returns : int
        Number of steps after which the end of the orbit returns, 0 if it does not.
    growth : Fit
        Fit of the logarithm of the separation of pairs against the step, over the second half; its slope is the largest
        Lyapunov exponent of the edge state: for a saddle that across the boundary, for a chaotic edge state possibly
        another.
    scale : ndarray, shape (dimension,)
        Unit of length along each coordinate.
    coordinates : tuple of Coordinate
        State variables.
    """

    points: Floats
    widths: Floats
    sides: NDArray[np.int16]
    orbit: PeriodicOrbit | None
    returns: int
    growth: Fit
    scale: Floats
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        what = "no periodic orbit" if self.orbit is None else repr(self.orbit)
        return f"EdgeOrbit({len(self.points)} steps, exponent {self.growth.slope:.4g}; {what})"


@checked
def edge_orbit(
    basins: Basins,
    inside: int | ArrayLike = 0,
    outside: int | ArrayLike = 1,
    periods: int = 200,
    min_separation: float = 1e-9,
    max_separation: float = 1e-6,
    longest_period: int = 8,
    scale: ArrayLike | None = None,
    point_map: PointMap | None = None,
    max_periods: int | None = None,
    outcome: Outcome | None = None,
) -> EdgeOrbit:
    r"""Compute the edge state of a basin boundary by alternating bisection and iteration (edge tracking).

    It is the set to which orbits on the boundary :math:`\partial B` of a basin B converge.  Its exponent is the mean of
    :math:`\ln \frac{|f(y_n) - f(x_n)|}{|y_n - x_n|}` over the steps n of the map f, for states :math:`x_n \in B` and
    :math:`y_n \notin B` of a pair.

    A segment between a state in the basin and one outside it is bisected until it is shorter than `min_separation`;
    both ends are iterated until they are more than `max_separation` apart; and so on.  The pairs stay within
    `max_separation` of an orbit on the boundary, and approach an attractor of the dynamics restricted to the boundary:
    often a saddle, whose unstable direction leads to the two sides.

    Parameters
    ----------
    basins : Basins
        Basins with their map.
    inside, outside : int or array_like, shape (dimension,)
        Two labels, of which two neighbouring initial conditions are taken, or two states.  Every other label than the
        first counts as outside; the label on that side may change along the orbit, see `sides`.
    periods : int, optional
        Steps of the map.
    min_separation, max_separation : float, optional
        Distance of a pair after bisection, and distance at which it is bisected again, in units of `scale`.
    longest_period : int, optional
        Longest period of an edge state that is detected.
    scale : array_like, optional
        Unit of length along each coordinate, by default the sizes of the window.
    point_map : PointMap, optional
        Map to use instead of the exact one.
    max_periods : int, optional
        Periods after which a state is undecided.
    outcome : callable, optional
        What tells final states, where no attractor is verified, or others are of interest: ``outcome(points)``
        returns for each of the points (n, dimension) the number of the final state in which it is, -1 while it is in
        none.  Labels are these numbers.

    Returns
    -------
    EdgeOrbit
        The straddle orbit, with the periodic orbit at its end if there is one.

    Raises
    ------
    ValueError
        If the two states are not on different sides, if no two initial conditions with these labels are neighbours, if
        a state along the orbit is undecided, or if the orbits of both ends have terminated.

    References
    ----------
    Battelino, Grebogi, Ott, Yorke, Yorke, Physica D 32 (1988) 296; Skufca, Yorke, Eckhardt, Physical Review Letters
    96 (2006) 174101.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> edge_orbit(find_basins(cubic, CellGrid((-1.5, -1), (1.5, 1), (60, 40)))).orbit.multipliers.real
    array([1.5, 0.5])
    """
    total = affordable_number("periods", periods, 8 * (3 * len(basins.coordinates) + 6), at_least=3)
    longest = whole_number("longest_period", longest_period, at_least=1)
    close = finite_number("min_separation", min_separation, above=1e-15)
    apart = finite_number("max_separation", max_separation, above=close, at_most=0.1)
    label = labeller(basins, point_map=point_map, max_periods=max_periods, name="basins", outcome=outcome)
    unit = scale_of(scale, basins.coordinates, span_of(basins))
    side, pair = _first_pair(basins, label, inside, outside, unit)
    pair, found = _bisected(label, pair, side, close, unit)
    d = label.point_map.dimension
    points, widths = np.empty((total, d)), np.empty(total)
    sides, grown = np.empty((total, 2), np.int16), np.empty(total)
    separation = 0.0
    for k in range(total):
        shift = difference(pair[1], pair[0], basins.coordinates)
        width = float(np.linalg.norm(shift / unit))
        points[k], widths[k] = wrap(pair[0] + 0.5 * shift, basins.coordinates), width
        sides[k], grown[k] = found, separation
        after = follow(label.point_map, pair, 1).points
        if not np.isfinite(after).all():
            raise ValueError(
                f"a state next to {points[k].tolist()} has no image: follow the boundary with the exact map"
            )
        pair = after
        now = float(np.linalg.norm(difference(pair[1], pair[0], basins.coordinates) / unit))
        separation += np.log(now / width)
        if now > apart:
            pair, found = _bisected(label, pair, side, close, unit)
    growth = _growth(grown)
    returns = _period(points, basins, longest, unit)
    orbit = _refined(label.point_map, points[-1], returns, unit, basins) if returns else None
    return EdgeOrbit(points, widths, sides, orbit, returns, growth, unit, basins.coordinates)


def _growth(grown: Floats) -> Fit:
    """Fit the second half of a growing logarithm; by the time of the first one the orbit is to have settled."""
    last = len(grown) - 1
    fit = fit_line(np.arange(len(grown)), grown, fit_range=(last // 2, last), labels=("step", "ln separation"))
    # A sum of random growths strays from its line slowly, which the scatter about the line does not show.
    means = np.array([np.mean(part) for part in np.array_split(np.diff(grown[last // 2 :]), _BLOCKS) if len(part)])
    apart = float(means.std(ddof=1) / np.sqrt(len(means))) if len(means) > 1 else 0.0
    return replace(fit, standard_error=max(fit.standard_error, apart))


def _first_pair(
    basins: Basins, label: Labeller, inside: int | ArrayLike, outside: int | ArrayLike, unit: Floats
) -> tuple[int, Floats]:
    if isinstance(inside, int | np.integer) != isinstance(outside, int | np.integer):
        raise TypeError(f"inside={inside!r}, outside={outside!r}: give two labels, or two states")
    if isinstance(inside, int | np.integer) and isinstance(outside, int | np.integer):
        side = int(inside) if label.rule else own_label(basins, int(inside), "inside")
        other = int(outside)
        if other in (side, Label.UNDECIDED):
            raise ValueError(f"outside={outside!r}: give the label of what lies beside basin {side}")
        return side, _neighbours(basins, label, side, other, unit)
    pair = np.stack([state_points(n, v, basins.coordinates) for n, v in (("inside", inside), ("outside", outside))])
    ends = label(pair)
    if ends[0] < 0 or ends[0] == ends[1] or ends[1] == Label.UNDECIDED:
        raise ValueError(
            f"inside, outside have the labels {ends.tolist()}: give a state in a basin and one that is not in it"
        )
    return int(ends[0]), pair


def _neighbours(basins: Basins, label: Labeller, side: int, other: int, unit: Floats) -> Floats:
    """Return the two closest initial conditions of different labels, confirmed by the map.

    The second one is moved a little, in all coordinates: of two mirror images in a system with that symmetry the
    separation would never leave one direction.
    """
    places = places_of(basins)
    labels = label(places) if label.rule else basins.labels.ravel()
    mine, theirs = places[labels == side], places[labels == other]
    if not (len(mine) and len(theirs)):
        raise ValueError(
            f"inside={side}, outside={other}: no initial condition has the label {side if not len(mine) else other}"
        )
    distance, nearest = nearest_foreign(theirs, mine, unit, basins.coordinates)
    golden = np.mod(np.arange(1, len(unit) + 1) * 0.6180339887498949, 1.0) - 0.5  # none of the axes, and no diagonal
    for row in np.argsort(distance, kind="stable")[:64]:
        shift = difference(theirs[nearest[row]], mine[row], basins.coordinates)
        moved = theirs[nearest[row]] + _TILT * np.linalg.norm(shift / unit) * unit * golden
        for beyond in (moved, theirs[nearest[row]]):
            pair = np.stack([mine[row], beyond])
            ends = label(pair)
            if ends[0] == side and ends[1] not in (side, Label.UNDECIDED):
                return pair
    raise ValueError(
        f"inside={side}, outside={other}: the map does not confirm the labels; give a larger "
        "max_periods, or recompute the basins"
    )


def _bisected(label: Labeller, pair: Floats, side: int, narrow: float, unit: Floats) -> tuple[Floats, tuple[int, int]]:
    """Return a closer pair on the segment, `narrow` apart at most and still on two sides, and its labels."""
    coordinates = label.point_map.coordinates
    fractions = np.linspace(0.0, 1.0, _SECTIONS + 1)[:, None]
    for _ in range(40):
        shift = difference(pair[1], pair[0], coordinates)
        places = pair[0] + fractions * shift
        found = label(places)
        if (found == Label.UNDECIDED).any():
            # So close to the boundary that it takes too long: it lies between its neighbours.
            places, found = places[found != Label.UNDECIDED], found[found != Label.UNDECIDED]
        if not len(found) or found[0] != side or found[-1] == side:
            raise ValueError(
                f"min_separation={narrow!r}: the sides of the boundary at {pair[0].tolist()} are not distinguished; "
                "give a larger max_periods, or a larger `min_separation`"
            )
        last = int(np.flatnonzero(found[:-1] == side)[np.argmax((found[1:] != side)[found[:-1] == side])])
        before = float(np.linalg.norm(shift / unit))
        pair = places[last : last + 2]
        now = float(np.linalg.norm((pair[1] - pair[0]) / unit))
        if now <= narrow:
            return pair, (side, int(found[last + 1]))
        if now > 0.9 * before:
            raise ValueError(
                f"min_separation={narrow!r}: undecided states fill the boundary at {pair[0].tolist()}; "
                "give a larger max_periods, or a larger `min_separation`"
            )
    raise ValueError(
        f"min_separation={narrow!r}: numbers are too coarse for it at {pair[0].tolist()}; give a larger one"
    )


def _period(points: Floats, basins: Basins, longest: int, unit: Floats) -> int:
    """Return the steps after which the end of an orbit has come back for some rounds, 0 where it does not."""
    for q in range(1, min(longest, (len(points) - 1) // 3) + 1):
        tail = points[-3 * q - 1 :]
        shift = difference(tail[q:], tail[:-q], basins.coordinates) / unit
        if np.linalg.norm(shift, axis=1).max() <= 1e-3:
            return q
    return 0


def _refined(point_map: PointMap, guess: Floats, period: int, unit: Floats, basins: Basins) -> PeriodicOrbit | None:
    """Return the periodic orbit near a place; None where Newton's method finds none, or one far away."""
    try:
        orbit = periodic_orbit(point_map, guess, period)
    except ValueError:
        return None
    apart = np.linalg.norm(difference(orbit.points, guess, basins.coordinates) / unit, axis=1)
    return orbit if apart.min() <= _SAME else None
