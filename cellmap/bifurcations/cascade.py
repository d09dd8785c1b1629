"""Period-doubling cascades."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._lib.arrays import Floats, Ints
from .._lib.checks import finite_number, whole_number
from .._lib.signatures import checked
from ..maps.point_map import PointMap
from ..orbits.arclength import corrected
from ..orbits.attractor import Attractor
from ..orbits.orbit_equations import begin_orbit, orbit_problem
from ..orbits.orbit_kinds import PeriodicOrbit
from .branch import Bifurcation, Branch
from .branch_tracer import BranchTracer, born_orbit
from .kinds import BifurcationKind

_STEP = 0.02  # step, as a fraction of the interval of the parameter
_AHEAD = 2.0  # gaps between doublings that are looked through for the next one
_SHRINKING = 2.5  # ratio of an orbit's parts from doubling to doubling (Feigenbaum's alpha)
_POINTS = 2000


@dataclass(frozen=True, eq=False)
class Cascade:
    """Period-doubling cascade of an orbit.

    Parameters
    ----------
    parameter : str
        Name of the parameter.
    bifurcations : tuple of Bifurcation
        Bifurcations at which each orbit loses its stability: period doublings, and pitchforks at which symmetric
        orbits, whose period cannot double, lose their symmetry first.
    branches : tuple of Branch
        Branches from each bifurcation to the next one.
    end : str
        Reason why the cascade ends.
    """

    parameter: str
    bifurcations: tuple[Bifurcation, ...]
    branches: tuple[Branch, ...]
    end: str

    def __repr__(self) -> str:
        ratio = f", last ratio {self.ratios[-1]:.6g}" if len(self.ratios) else ""
        found = f"{len(self.values)} doublings of {self.parameter}"
        return f"Cascade({found}, to period {self.periods[-1]}{ratio}; {self.end})"

    @property
    def values(self) -> Floats:
        """Parameter values of the period doublings."""
        return np.array([b.value for b in self.bifurcations if b.kind is BifurcationKind.PERIOD_DOUBLING])

    @property
    def periods(self) -> Ints:
        """Periods of the orbits that bifurcate at the doublings; without a doubling, the period of the orbit."""
        both = zip(self.branches, self.bifurcations, strict=False)
        doubled = [2 * branch.period for branch, b in both if b.kind is BifurcationKind.PERIOD_DOUBLING]
        return np.array(doubled or [self.branches[0].period])

    @property
    def ratios(self) -> Floats:
        """Ratios of successive parameter intervals, which converge to Feigenbaum's delta = 4.669201609."""
        gaps = np.diff(self.values)
        return gaps[:-1] / gaps[1:]

    @property
    def accumulation(self) -> float:
        """Accumulation point of the doublings, extrapolated from the last three (Aitken); NaN with fewer."""
        if len(self.values) < 3:
            return float("nan")
        return float(self.values[-1] + (self.values[-1] - self.values[-2]) / (self.ratios[-1] - 1.0))


@checked
def period_doubling_cascade(
    point_map: PointMap, orbit: PeriodicOrbit | Attractor, parameter: str, limit: float, doublings: int = 6
) -> Cascade:
    """Compute the period-doubling cascade of a stable periodic orbit.

    Parameters
    ----------
    point_map : PointMap
        The map at the parameters of the orbit; for an interpolated map, its exact map is used.
    orbit : PeriodicOrbit or Attractor
        A stable orbit.
    parameter : str
        Name of the parameter.
    limit : float
        Parameter value up to, or down to, which orbits are continued, in its unit.
    doublings : int, optional
        Largest number of period doublings.  Parameter intervals shrink by 4.67 from one to the next, so that double
        precision resolves 8 to 10.

    Returns
    -------
    Cascade
        Period doublings, branches and ratios.

    Raises
    ------
    TypeError, ValueError
        As :func:`continue_orbit`; also for a limit equal to the present value, or an orbit that is not stable.

    References
    ----------
    Feigenbaum, Journal of Statistical Physics 19 (1978) 25.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 2.8}, ("x",))
    >>> cascade = period_doubling_cascade(logistic, periodic_orbit(logistic, [0.5]), "r", 4.0)
    >>> cascade.values.round(6)
    array([3.      , 3.44949 , 3.54409 , 3.564407, 3.568759, 3.569692])
    >>> round(cascade.accumulation, 5)
    3.56995
    """
    most = whole_number("doublings", doublings, at_least=1)
    last = finite_number("limit", limit)
    exact, state, period = begin_orbit(point_map, orbit, parameter)
    value = float(exact.params[parameter])
    if last == value:
        raise ValueError(f"limit={limit!r}: give another value than the present {parameter}={value:g}")
    problem = orbit_problem(exact, state, period, (parameter,), (abs(last - value),))
    start = corrected(problem, np.append(state, value) / problem.scale, problem.parameter_direction)
    ends = frozenset({BifurcationKind.PERIOD_DOUBLING, BifurcationKind.PITCHFORK, BifurcationKind.NEIMARK_SACKER})
    interval = (min(value, last), max(value, last))
    tracer = BranchTracer(exact, parameter, problem, interval, _STEP, _POINTS, None, ends)
    if start is None or tracer.detector.unstable(start):
        raise ValueError(f"orbit={orbit!r}: give a stable orbit of this map")
    start = replace(start, tangent=start.tangent * np.sign((last - value) * start.tangent[-1]))
    found: list[Bifurcation] = []
    branches: list[Branch] = []
    while True:
        segment = tracer.trace(start)
        branches.append(tracer.branch(segment))
        if segment.end != "bifurcation":
            return Cascade(parameter, tuple(found), tuple(branches), f"then the branch {segment.end}")
        found.append(segment.found[-1])
        if found[-1].kind is BifurcationKind.NEIMARK_SACKER:
            return Cascade(parameter, tuple(found), tuple(branches), "then Neimark-Sacker")
        values = [b.value for b in found if b.kind is BifurcationKind.PERIOD_DOUBLING]
        if len(values) == most:
            return Cascade(parameter, tuple(found), tuple(branches), "as many as asked for")
        before = found[-2].value if len(found) > 1 else value
        span = min(_AHEAD * abs(found[-1].value - before), abs(last - value))
        born = born_orbit(tracer, found[-1], span, 1.0 / _SHRINKING)
        if born is None:
            return Cascade(parameter, tuple(found), tuple(branches), "then no orbit is found")
        tracer, start = born
