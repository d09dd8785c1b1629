"""Basins of attraction of a grid or an array of initial conditions, in sweeps over them."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Floats, evenly
from .._lib.checks import finite_number, whole_number
from .._lib.files import as_checkpoint, locked
from .._lib.signatures import checked
from .._lib.stopping import Stop
from .._lib.tiles import check_client
from ..attractors.given import check_attractors
from ..attractors.search import affordable_period
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..maps.small_states import ORBITS, warn_of_small_states_ahead
from ..orbits.attractor import Attractor
from .doubts import warn_of_doubts
from .initial_conditions import InitialConditions
from .record import Basins
from .run import Run, label_store, new_numbers


def largest_number_of_periods(max_periods: int | None) -> int | None:
    """Return the argument `max_periods`, once it is a whole number or None."""
    return None if max_periods is None else whole_number("max_periods", max_periods, at_least=1)


def labelled(
    point_map: PointMap,
    points: Floats,
    attractors: Sequence[Attractor],
    max_periods: int,
    client: Any = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> tuple[NDArray[Any], NDArray[np.int32]]:
    """Return labels and settling times of points (n, dimension) by known attractors, and by no others.

    On a cluster and with a checkpoint, as for :func:`find_basins`.
    """
    check_client(client)
    places = InitialConditions.of(points, point_map)
    settings = {"max_periods": max_periods, "longest_period": 0, "map": dict(point_map.recipe)}
    path = as_checkpoint(checkpoint)
    with locked(path):
        store = label_store(point_map, places, settings, attractors, path)
        if (found := store.finished()) is None:
            run = Run(point_map, places, store, max_periods, 0, client, searching=False)
            run.to_the_end(attractors)
            every = list(range(len(attractors)))
            found = replace(run.described(settings, 0.0), attractors=tuple(attractors))
            found = store.finish(found, new_numbers(every, np.array(every, np.int64)))
    return np.array(found.labels), np.array(found.settling_time)


@checked
def find_basins(
    point_map: PointMap,
    initial_conditions: CellGrid | ArrayLike,
    max_periods: int | None = None,
    longest_period: int = 32,
    attractors: Sequence[Attractor] = (),
    progress: bool = False,
    client: Any = None,
    checkpoint: str | os.PathLike[str] | None = None,
    max_seconds: float | None = None,
) -> Basins:
    """Find the attractors of a map and label each initial condition by the attractor to which its orbit converges.

    Every initial condition is iterated until its orbit enters a verified trapping region of an attractor; see
    :func:`find_attractors` for the search for attractors.  Initial conditions that have not converged after many
    periods are searched for further attractors, so that small basins are found too.  Those that never converge are
    undecided: chaotic transients, for instance, and orbits that did not stay among the boxes of a chaotic attractor for
    64 periods, or so long that of up to 2048 initial conditions hardly any is expected to stay and leave again, or in
    one that lies in a neighbourhood which no orbit leaves.  In more than four dimensions there are attractors that are
    not verified, of which a warning tells.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map.
    initial_conditions : CellGrid or array_like, shape (..., dimension)
        Grid of cells whose centres are the initial conditions, or the initial conditions themselves.
    max_periods : int, optional
        Periods after which an initial condition whose orbit has not settled is undecided.  By default these are 2000
        periods, and twice as many again and again as long as the orbits that are left take at most half of the periods
        that all have taken so far; ``settings["max_periods"]`` says how many it were.
    longest_period : int, optional
        Longest period of a periodic attractor that is tried first.  Where orbits do not settle, longer ones are tried,
        up to twice as many steps as they have made, at least 512 and at most 8192.
    attractors : sequence of Attractor, optional
        Attractors that are known already, with their trapping regions.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.
    client : distributed.Client, optional
        Dask cluster that labels the initial conditions; by default the threads of this process do.
    checkpoint : path-like, optional
        File in which labels are stored as they are computed.  Repeating a call that was interrupted or killed resumes
        it, with the same result.  At the end the file is one of basins, for :func:`load_basins`, and repeating the call
        reads it.  Labels are kept in the file, so that they need not fit into memory.
    max_seconds : float, optional
        Time after which the call ends with what is decided by then: attractors found so far, and labels; other initial
        conditions are labelled -5 (unlabelled).  Compiled loops that are under way are not interrupted, so that the
        call may last somewhat longer.  With a checkpoint the same call goes on from there.

    Returns
    -------
    Basins
        Labels, attractors, fractions and settling times.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a checkpoint of another run.
    MemoryError
        If the labels do not fit into memory.
    OSError
        If a checkpoint does not fit on the disk.
    StoreError
        For a checkpoint that is damaged or in use by another run, or a file of another kind.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance along some orbits, or a coordinate falls below its `atol` and grows again
        on one of the first orbits.
    UnsettledWarning
        If more than 5 % of the initial conditions are undecided, escaped or out of steps, or diverge with an explicit
        method but not with the one for stiff systems: with the cause, as seen in a few orbits, and a remedy.  Also if
        nothing is found but orbits that grow without bound over many periods.
    UserWarning
        If `max_seconds` were over before all initial conditions were labelled, or if `initial_conditions` are two
        tuples ``(low, high)`` in two dimensions: these are two states, and no window.  If attractors are others again,
        a multiple of 2 pi further on in an angle that was not declared.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> def newton(x, p):
    ...     return x[0] / 2 + 1 / (2 * x[0]),
    >>> signs = find_basins(discrete_map(newton, {}, ("x",)), CellGrid((-3,), (3,), (100,)))
    >>> signs.attractors[0].points.round(12), signs.fractions[0].fraction
    (array([[1.]]), 0.5)
    """
    max_periods = largest_number_of_periods(max_periods)
    longest_period = affordable_period(longest_period)
    check_attractors(attractors, point_map, "attractors")
    check_client(client)
    limit = None if max_seconds is None else finite_number("max_seconds", max_seconds, above=0.0)
    began = time.perf_counter()
    places = InitialConditions.of(initial_conditions, point_map)
    settings = {"max_periods": max_periods, "longest_period": longest_period, "map": dict(point_map.recipe)}
    path = as_checkpoint(checkpoint)
    with locked(path):
        store = label_store(point_map, places, settings, attractors, path)
        if (finished := store.finished()) is not None:
            return replace(finished, point_map=point_map)
        warn_of_small_states_ahead(point_map, places.points(evenly(len(places), ORBITS)))
        run = Run(point_map, places, store, max_periods, longest_period, client, progress, Stop(limit))
        run.to_the_end(attractors)
        basins = run.result(settings, time.perf_counter() - began)
    warn_of_doubts(basins, store.release)
    return basins
