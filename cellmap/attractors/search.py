"""Search for attractors: end points of orbits are refined by Newton's method, and the other orbits tested for chaos."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats, Ints
from .._lib.checks import affordable_number, warn_caller, whole_number
from .._lib.signatures import checked
from .._lib.stopping import Stop
from .._lib.threads import linear_algebra_on_one_thread
from ..maps.coordinates import check_no_window, state_points, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.small_states import warn_of_small_states_ahead
from ..orbits.attractor import Attractor, sort_key
from .given import check_attractors
from .kinds import continua, creeping, cycles, equilibria, quasiperiodic
from .kinds.chaos import Examination, examine
from .kinds.continua import joined_continua
from .kinds.cycles import LOOKED_AT
from .kinds.ends import MATURE, Ends
from .kinds.examined import Examined
from .kinds.limit_cycles import cycles_ahead
from .kinds.transients import REMEDIES, Late, Reason, UnsettledWarning, regular
from .labels import Label, label_names
from .regions.trapping_boxes import is_trapped
from .settling.escape import far_bound
from .settling.quotients import quotient_of
from .settling.residence import with_full_residence
from .settling.settle import Catalogue, settle, settle_on_threads, without_escaped
from .shortcuts.surrogate import only_attractor
from .shortcuts.wandering import FEWEST, are_chaotic, representatives
from .translates import warning_of_translates

MAX_PERIODS = 2000
"""Periods for which orbits that do not settle are followed by default."""

_LOOKS = 256  # looks at the same orbits, at most
_FIRST_LOOK = 32  # periods before end points are refined for the first time
_WANDERING = 256  # periods from which on most of the orbits on a chaotic set are left out, where they take long

_KINDS = cycles.look, equilibria.look, quasiperiodic.look, continua.look, creeping.look
"""Looks for attractors of each kind, from those that are verified most easily; the first one that finds any counts."""


@checked
def find_attractors(
    point_map: PointMap,
    initial_conditions: ArrayLike,
    max_periods: int = MAX_PERIODS,
    longest_period: int = 32,
    attractors: Sequence[Attractor] = (),
) -> tuple[Attractor, ...]:
    """Find the attractors to which orbits of given initial conditions converge.

    The initial conditions are iterated.  End points that lie far apart are refined by Newton's method on the exact map,
    for the periods after which their orbits come closest to themselves.  A solution counts as an attractor if its
    Floquet multipliers lie inside the unit circle.  It gets a verified trapping region, and orbits that enter this
    region have converged.  Orbits that do not settle are compared with invariant curves, and those that never do are
    tested for chaos.  Limit cycles of autonomous systems are found first, as periodic orbits of the flow, whatever the
    period at which the map samples them.

    In more than four dimensions Newton's method, regions and the search for curves may take 1,500 images of the map for
    each initial condition, and at least 200,000.  Attractors that are not verified within them, and quasi-periodic
    ones, are found by recurrence: their `verified` is False, and orbits that enter their regions, or have their time
    averages in the end, count as converged.  Where the motion does not change when
    all states are shifted along a direction, as where all angles of a network may turn together, an attractor there is
    that of all shifts of its points, see the `symmetry` of :class:`Attractor`.

    Parameters
    ----------
    point_map : PointMap
        The map; periodic points are refined with the exact map behind it.
    initial_conditions : array_like, shape (..., dimension)
        Initial conditions of the orbits.
    max_periods : int, optional
        Longest orbit.
    longest_period : int, optional
        Longest period of a periodic attractor that is tried first.  Where orbits do not settle, longer ones are tried,
        up to twice as many steps as they have made, at least 512 and at most 8192.
    attractors : sequence of Attractor, optional
        Attractors that are known already, with their trapping regions.

    Returns
    -------
    tuple of Attractor
        Attractors in an order that does not depend on the initial conditions: fixed points, periodic, rotating,
        sticking sets, continua of cycles, quasi-periodic, chaotic.

    Warns
    -----
    ToleranceWarning
        If a coordinate falls below its `atol` and grows again on one of the first orbits.
    UnsettledWarning
        If none is found: with how orbits end, the cause as seen in a few of them, and a remedy.
    UserWarning
        If `initial_conditions` are two tuples ``(low, high)`` in two dimensions: these are two states, and no window.
        If attractors are others again, a multiple of 2 pi further on in an angle that was not declared.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], 0.3 * x[0]), {"a": 0.2}, ("x", "y"))
    >>> find_attractors(henon, [[0.0, 0.0], [0.5, 0.5]])
    (Attractor(fixed point (1.09, 0.327) at (1.08945, 0.326836), |multiplier| 0.8074),)
    """
    check_no_window("initial_conditions", initial_conditions, point_map.dimension)
    states = state_points("initial_conditions", initial_conditions, point_map.coordinates).reshape(
        -1, point_map.dimension
    )
    if not len(states):
        raise ValueError("initial_conditions is empty: give at least one initial condition")
    check_attractors(attractors, point_map, "attractors")
    max_periods = whole_number("max_periods", max_periods, at_least=1)
    longest_period = affordable_period(longest_period)
    warn_of_small_states_ahead(point_map, states)
    with linear_algebra_on_one_thread(point_map.dimension):
        quotient = quotient_of(point_map, states)
        if quotient is None:
            found, reasons, labels = _found_by_all(point_map, states, attractors, max_periods, longest_period)
        else:
            known = [quotient.lowered(a) for a in attractors]
            places = quotient.projected(states)
            found, reasons, labels = _found_by_all(quotient.point_map, places, known, max_periods, longest_period)
            found = [quotient.lifted(a, point_map) for a in found]
    if not found:
        warn_caller(_nothing_found(point_map, labels, reasons, max_periods), UnsettledWarning)
    ordered = tuple(sorted(found, key=sort_key))
    if repeated := warning_of_translates(ordered, point_map):
        warn_caller(repeated)
    return ordered


def _found_by_all(
    point_map: PointMap, states: Floats, known: Sequence[Attractor], max_periods: int, longest_period: int
) -> tuple[list[Attractor], Sequence[Reason], Ints]:
    """Return the attractors that orbits of some states come to, why others do not, and labels of all."""
    examined = Examined.of_region(point_map, states, states)
    found = search(point_map, states, with_full_residence(known), max_periods, longest_period, examined)
    attractors, reasons = found.attractors, tuple[Reason, ...]()
    if len(found.orbits):
        examination = found.examined(point_map, states, examined.extent)
        attractors, reasons = [*attractors, *examination.attractors], examination.reasons
    return list(joined_continua(point_map, attractors)[0]), reasons, found.labels


@dataclass(frozen=True, eq=False)
class Searched:
    """What has become of the orbits of some initial conditions.

    ``orbits``: those that are left, ``age``: their age; ``attractors``: those known and found; ``labels``, ``times``:
    on which attractor each initial condition ends, and in which period it came there at the latest; ``untrapped``:
    whether orbits that are left are on a chaotic set around which no boxes are trapped.
    """

    orbits: Orbits
    attractors: list[Attractor]
    age: int
    labels: Ints
    times: Ints
    untrapped: bool = False

    def examined(self, point_map: PointMap, states: Floats, extent: Floats) -> Examination:
        """Look for chaotic attractors on which the orbits that are left move."""
        late = _late(point_map, states, self.labels, self.times, self.attractors)
        return examine(
            point_map, self.orbits.points, extent, self.attractors, self.age, late, trapped=not self.untrapped
        )


def _late(point_map: PointMap, states: Floats, labels: Ints, times: Ints, attractors: Sequence[Attractor]) -> Late:
    """Return those of some initial conditions that came last to attractors that are not chaotic."""
    rows = Late.latest(np.where(regular(labels, attractors), times, -1))
    return Late(wrap(states[rows], point_map.coordinates), times[rows])


def search(
    point_map: PointMap,
    states: Floats,
    known: Sequence[Attractor],
    max_periods: int,
    longest_period: int,
    examined: Examined,
    stop: Stop | None = None,
    horizon: int = 0,
) -> Searched:
    """Follow orbits and find attractors, but no chaotic ones, unless all orbits that are left seem to be on one.

    ``horizon``: periods after which orbits would be seen not to be, where these are more than are followed here.
    """
    extent = examined.extent
    attractors = [*known, *cycles_ahead(point_map, states, extent, known, examined.afford)]
    orbits = Orbits.starting(wrap(states, point_map.coordinates))
    rows, labels, times = np.arange(len(states)), np.full(len(states), Label.UNDECIDED), np.full(len(states), -1)
    age, time_limit, wandering, untrapped = 0, _FIRST_LOOK, False, False
    past = far_bound(point_map, states)
    while len(orbits):
        examined.so_far = attractors, labels, times
        before = len(orbits)
        catalogue, periods = Catalogue.of(attractors, point_map), min(time_limit, max_periods - age)
        settled = settle_on_threads(point_map, orbits, catalogue, periods, age, stop, examined.bound)
        escaped = without_escaped(point_map, settled, past, age + periods)
        if escaped is not settled:
            settled, examined.bound = escaped, past
        labels[rows], times[rows] = settled.labels, settled.times
        rows, orbits, last = rows[settled.undecided], settled.orbits, age + time_limit >= max_periods
        age, time_limit = min(age + time_limit, max_periods), 2 * age if age else time_limit
        if last or not _many_settle(before, len(orbits)):
            known_to_wander = wandering
            if point_map.is_flow and age >= MATURE and (last if wandering else len(rows) >= FEWEST):
                wandering = are_chaotic(point_map, orbits.points, extent)
            ends = Ends(point_map, orbits.points, age, attractors, examined, longest_period, not last, last, wandering)
            orbits, attractors, owners = sort_out(ends, orbits)
            labels[rows], times[rows] = owners, np.where(owners >= 0, age, -1)
            examined.so_far = attractors, labels, times
            rows = rows[owners == Label.UNDECIDED]
            if wandering and not known_to_wander and len(rows) >= FEWEST:
                late = _late(point_map, states, labels, times, attractors)
                only = only_attractor(
                    point_map, orbits.points, extent, attractors, late, age, max(max_periods, horizon)
                )
                untrapped = only is not None and not is_trapped(only)
                attractors += [] if only is None or untrapped else [only]
            if wandering and age >= _WANDERING and not last and len(rows) >= FEWEST:
                kept = representatives(point_map, orbits.points, extent)
                rows, orbits = rows[kept], orbits[kept]
        if last:
            break
    return Searched(orbits, attractors, age, labels, times, untrapped)


def _nothing_found(point_map: PointMap, labels: Ints, reasons: Sequence[Reason], max_periods: int) -> str:
    """Tell why orbits came to no attractor: how they ended, and why those that did not are undecided."""
    ended = [
        f"{np.count_nonzero(labels == k)} {name}"
        for k, name in label_names(point_map.ends).items()
        if (labels == k).any()
    ]
    text = f"no attractor was found from {len(labels)} initial conditions: {', '.join(ended)}"
    if not reasons:
        return f"{text}; take initial conditions whose orbits stay"
    cause, count = Counter(reasons).most_common(1)[0]
    return f"{text}; {count} of {len(reasons)} examined: {cause}; {REMEDIES[cause].format(max_periods)}"


def sort_out(ends: Ends, orbits: Orbits) -> tuple[Orbits, list[Attractor], Ints]:
    """Look for new attractors by the ends of some orbits, until a look finds none.

    Returns the orbits that are left, all attractors, and on which of them each orbit is.  A patient search ends as soon
    as it finds attractors to which most of the orbits have come.
    """
    point_map, attractors = ends.point_map, list(ends.known)
    owners, rows = np.full(len(orbits), Label.UNDECIDED), np.arange(len(orbits))
    for _ in range(_LOOKS):
        now = replace(ends, points=orbits.points, known=attractors)
        fresh = next(filter(None, (look(now) for look in _KINDS)), None) if len(orbits) else None
        if fresh is None:
            break
        # None of these orbits is on an attractor that was known before.
        catalogue = Catalogue.of(fresh, point_map)
        settled = settle(
            point_map, orbits[np.arange(len(orbits))], catalogue, int(catalogue.regions.residence.max()), ends.age
        )
        owners[rows] = np.where(settled.labels >= 0, settled.labels + len(attractors), settled.labels)
        before, attractors = len(orbits), [*attractors, *fresh]
        rows, orbits = rows[settled.undecided], orbits[settled.undecided]
        if ends.patient and _many_settle(before, len(orbits)):
            break
    return orbits, attractors, owners


def _many_settle(before: int, left: int) -> bool:
    """Tell whether so many orbits have settled that those that are left may be on the way to the same attractors."""
    return 2 * left <= before


def affordable_period(longest_period: int) -> int:
    """Return the longest period of attractors that are searched for, once there is memory for the search."""
    return affordable_number("longest_period", longest_period, 2 * 8 * LOOKED_AT, at_least=1)
