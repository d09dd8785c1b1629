"""Search for attractors: end points of orbits are refined by Newton's method, and the other orbits tested for chaos."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Bools, Floats, Ints
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
from .kinds.chaos import examine
from .kinds.continua import joined_continua
from .kinds.cycles import LOOKED_AT
from .kinds.ends import MATURE, Ends
from .kinds.examined import Examined
from .kinds.limit_cycles import cycles_ahead
from .kinds.transients import REMEDIES, Late, Reason, UnsettledWarning, regular
from .settling.escape import far_bound
from .settling.labels import Label, label_names
from .settling.quotients import Quotient, quotient_of
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
        search = Search.begun(point_map, states, states, longest_period)
        found = search.by_sample(states, with_full_residence(attractors), max_periods)
        ordered = tuple(sorted(joined_continua(point_map, found.attractors)[0], key=sort_key))
    if not ordered:
        warn_caller(_nothing_found(point_map, found, max_periods), UnsettledWarning)
    if repeated := warning_of_translates(ordered, point_map):
        warn_caller(repeated)
    return ordered


class SearchResult(NamedTuple):
    """Attractors that are known, and those that a search has found after them.

    ``labels``, ``times`` (n,): on which of them each of some orbits ends, and in which period it came there at the
    latest; ``reasons``: why some of those that are on none are undecided.
    """

    attractors: Sequence[Attractor]
    labels: Ints
    times: Ints
    reasons: Sequence[Reason] = ()


@dataclass(eq=False)
class Search:
    """A search for the attractors of a map, and what has been tried in it.

    Where the map ``of`` commutes with shifts of all states it is made in the ``quotient`` that is left without them, in
    which ``point_map`` moves, and to which ``examined`` belongs.  States and attractors that are handed in and returned
    are those of the map.  ``sampled``: what is tried for a sample.
    """

    of: PointMap
    point_map: PointMap
    quotient: Quotient | None
    examined: Examined
    longest_period: int
    sampled: Examined | None = None

    @classmethod
    def begun(cls, point_map: PointMap, region: Floats, states: Floats, longest_period: int) -> Search:
        """Begin a search in a region, shown by some of its points, from some states (n, dimension)."""
        quotient, inner = quotient_of(point_map, states), point_map
        if quotient is not None:
            inner, states = quotient.point_map, quotient.projected(states)
            region = states
        return cls(point_map, inner, quotient, Examined.of_region(inner, region, states), longest_period)

    def by_sample(
        self,
        states: Floats,
        known: Sequence[Attractor],
        max_periods: int,
        stop: Stop | None = None,
        horizon: int = 0,
        to_the_end: bool = True,
    ) -> SearchResult:
        """Follow orbits of some states (n, dimension), and look again and again for attractors by those that are left.

        Chaotic ones are found where all orbits that are left seem to be on one, and at the end.

        ``horizon``: periods after which orbits would be seen to be on no chaotic attractor, where these are more than
        are followed here; ``to_the_end``: whether orbits that are left are tested for being on one.
        """
        point_map, states = self.point_map, self._places(states)
        examined = self.examined.of_sample(point_map, states)
        self.sampled, attractors = examined, self._lowered(known)
        attractors += cycles_ahead(point_map, states, examined.extent, attractors, examined.afford)
        orbits = Orbits.starting(wrap(states, point_map.coordinates))
        rows, labels, times = np.arange(len(states)), np.full(len(states), Label.UNDECIDED), np.full(len(states), -1)
        age, time_limit, wandering, untrapped = 0, _FIRST_LOOK, False, False
        past = far_bound(point_map, states)

        def late() -> Late:
            """Those that came last to attractors that are not chaotic."""
            chosen = Late.latest(np.where(regular(labels, attractors), times, -1))
            return Late(wrap(states[chosen], point_map.coordinates), times[chosen])

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
                    wandering = are_chaotic(point_map, orbits.points, examined.extent)
                ends = Ends(
                    point_map, orbits.points, age, attractors, examined, self.longest_period, not last, last, wandering
                )
                orbits, attractors, owners = sort_out(ends, orbits)
                ends = replace(ends, points=orbits.points, known=attractors)
                labels[rows], times[rows] = owners, np.where(owners >= 0, age, -1)
                examined.so_far = attractors, labels, times
                rows = rows[owners == Label.UNDECIDED]
                if wandering and not known_to_wander and len(rows) >= FEWEST:
                    only, untrapped = only_attractor(ends, late(), max(horizon, max_periods))
                    attractors += [] if only is None else [only]
                if wandering and age >= _WANDERING and not last and len(rows) >= FEWEST:
                    kept = representatives(point_map, orbits.points, examined.extent)
                    rows, orbits = rows[kept], orbits[kept]
            if last:
                break
        reasons: Sequence[Reason] = ()
        if to_the_end and len(orbits):
            ends = Ends(point_map, orbits.points, age, attractors, examined, self.longest_period)
            strange, reasons = examine(ends, late(), trapped=not untrapped)
            attractors = [*attractors, *strange]
        self.examined.bound = examined.bound
        return SearchResult(self._with(known, attractors), labels, times, reasons)

    def so_far(self, known: Sequence[Attractor]) -> SearchResult | None:
        """Return what a sample that was interrupted has led to."""
        if self.sampled is None or self.sampled.so_far is None:
            return None
        attractors, labels, times = self.sampled.so_far
        more = [a for a in self.sampled.verified if all(a is not b for b in attractors)]
        return SearchResult(self._with(known, [*attractors, *more]), labels, times)

    def among(
        self, orbits: Orbits, known: Sequence[Attractor], age: int, last: bool, late: Callable[[Bools], Late]
    ) -> tuple[tuple[Attractor, ...], Sequence[Reason]]:
        """Return the attractors known and those on which some orbits of an age are; why others are undecided at last.

        ``late``: returns the initial conditions of orbits that came last to an attractor that is not chaotic, once it
        is known which of these orbits have.
        """
        states = orbits if self.quotient is None else self.quotient.of_orbits(orbits)
        ends = Ends(
            self.point_map, states.points, age, self._lowered(known), self.examined, self.longest_period, last=last
        )
        rest, attractors, owners = sort_out(ends, states)
        reasons: Sequence[Reason] = ()
        if last and len(rest):
            came = late(owners != Label.UNDECIDED)
            came = replace(came, points=self._places(came.points))
            left = replace(ends, points=rest.points, known=attractors)
            strange, reasons = examine(left, came)
            attractors = [*attractors, *strange]
        return self._with(known, attractors), reasons

    def _places(self, states: Floats) -> Floats:
        return states if self.quotient is None else self.quotient.projected(states)

    def _lowered(self, known: Sequence[Attractor]) -> list[Attractor]:
        return list(known) if self.quotient is None else [self.quotient.lowered(a) for a in known]

    def _with(self, known: Sequence[Attractor], found: Sequence[Attractor]) -> tuple[Attractor, ...]:
        """Return attractors that are known, and those that were found after them as attractors of the map."""
        q, fresh = self.quotient, found[len(known) :]
        return (*known, *(fresh if q is None else (q.lifted(a, self.of) for a in fresh)))


def _nothing_found(point_map: PointMap, found: SearchResult, max_periods: int) -> str:
    """Tell why orbits came to no attractor: how they ended, and why those that did not are undecided."""
    labels, reasons = found.labels, found.reasons
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
