"""Maps of autonomous systems: time-T maps, and Poincaré maps of first returns to a section (Poincaré 1892)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._compiled.kernels.blocks import wrap_rows
from .._lib.arrays import Floats, Ints, evenly
from .._lib.checks import finite_number, one_of, shown
from .._lib.computed import computed_once
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from .compiled_advance import FlowAdvance
from .coordinates import Coordinate, state_points, turns_of
from .first_return import EXTRA, Trip, gated_system
from .formulas import Formulas, formulas
from .integration import Flow, flow, tangent_flow
from .orbit_batch import CHUNK, Orbits, Status
from .parameters_as_states import with_states
from .periodicity import InTime, sampled
from .point_map import PointMap, warn_of_small_states
from .small_states import ORBITS, exact_motion, regrown, seen
from .specification import MapSpec, no_source
from .stroboscopic import MAX_STEPS, check_tolerances, stroboscopic_map, with_further
from .system import ForcedSystem
from .tangent import derivatives_of

_LOOKS = 128  # places on the way to a return at which it is seen whether a coordinate is too small
_STRETCHES = 100  # periods of the system within which an orbit has to return by default
_TANGENT_TOLERANCE = 1e-12
_ORDER_FOR = (
    1e-9  # tolerance for which the order of the series is chosen: finer ones take more steps, not more compiling
)


@checked
def flow_map(
    system: ForcedSystem,
    time: float,
    rtol: float = 1e-9,
    atol: ArrayLike | Mapping[str, float] = 1e-9,
    method: str = "auto",
    max_steps: int = MAX_STEPS,
) -> PointMap:
    """Return the time-T map of an autonomous system, from a state to the state a fixed time later.

    This map is the stroboscopic map of the system with that time as its period.

    Parameters
    ----------
    system : ForcedSystem
        An autonomous system, whose right-hand side does not depend on time; its `period` is ignored.
    time : float
        Time of one step, above 0.
    rtol, atol, method, max_steps
        As for :func:`stroboscopic_map`.

    Returns
    -------
    PointMap
        The exact map.

    Raises
    ------
    TypeError, ValueError
        For a forced system, or arguments out of range.

    Examples
    --------
    >>> from math import pi
    >>> oscillator = ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 1.0, ("q", "v"))
    >>> flow_map(oscillator, pi / 2)([1.0, 0.0]).round(8) + 0.0
    array([ 0., -1.])
    """
    check_unforced(system)
    length = finite_number("time", time, above=0.0)
    return stroboscopic_map(replace(system, period=length), 0.0, rtol, atol, method, max_steps)


@dataclass(frozen=True, eq=False)
class Returns:
    """First returns to a Poincaré section.

    Parameters
    ----------
    points : ndarray, shape (..., dimension)
        Points of return, in the coordinates of the section; NaN for orbits that do not return.
    times : ndarray, shape (...)
        Return times.
    status : ndarray of uint8, shape (...)
        A :class:`Status` for each orbit; NO_RETURN for one that has not returned after the longest time.
    """

    points: Floats
    times: Floats
    status: NDArray[np.uint8]

    def __repr__(self) -> str:
        back = self.times[np.isfinite(self.times)]
        span = f", after {back.min():.6g} to {back.max():.6g}" if back.size else ""
        return f"Returns({back.size} of {self.times.size} orbits{span})"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SectionMap(PointMap):
    """A Poincaré map: the map of first returns to a section, with return times.

    Parameters
    ----------
    section : tuple
        Coordinate, value and direction.
    first_returns : callable
        ``first_returns(points)`` for at most CHUNK points (n, dimension): points, full rotations, times and status.
    """

    section: tuple[str, float, int]
    first_returns: Callable[[Floats], tuple[NDArray[Any], ...]] = field(repr=False)

    def __call__(self, points: ArrayLike) -> Floats:
        """Return the images of points after one return, shape (..., dimension); NaN where there is none."""
        images = super().__call__(points)
        warn_of_small_states(self)
        return images

    def returns(self, points: ArrayLike) -> Returns:
        """Return the points and times of the first returns of initial conditions on the section.

        Parameters
        ----------
        points : array_like, shape (..., dimension)
            Initial conditions on the section.
        """
        initial_conditions = state_points("points", points, self.coordinates)
        flat = initial_conditions.reshape(-1, self.dimension)
        images, times, status = np.empty_like(flat), np.empty(len(flat)), np.zeros(len(flat), np.uint8)

        def work(part: slice) -> None:
            images[part], _, times[part], status[part] = self.first_returns(flat[part])

        run_over(slices(len(flat), CHUNK), work)
        warn_of_small_states(self)
        shape = initial_conditions.shape[:-1]
        return Returns(images.reshape(initial_conditions.shape), times.reshape(shape), status.reshape(shape))


@dataclass(frozen=True, eq=False)
class SectionAdvance:
    """Returns of orbits to a section; ``lost`` are coordinates of the system that became too small, and grew again."""

    first_returns: Callable[[Floats], tuple[NDArray[Any], ...]]
    axes: Sequence[Coordinate]
    lost: set[int] = field(default_factory=set)
    hint: ClassVar[str] = (
        "; tolerances hold at the ends of periods of the system: give a shorter one than its falls take"
    )

    def take_lost(self) -> list[int]:
        """Return, once, the coordinates that were below their tolerance and then grew."""
        found = sorted(self.lost)
        self.lost.clear()
        return found

    def __call__(self, orbits: Orbits, periods: int) -> None:
        """Move a batch of orbits on by some returns, in place."""
        for _ in range(periods):
            for now in orbits.living():
                images, rotations, _, status = self.first_returns(now.points)
                now.points[:], now.status[:] = images, np.maximum(now.status, status)
                now.rotations += rotations


@checked
def section_map(
    system: ForcedSystem,
    section: tuple[str, float, int],
    max_time: float | None = None,
    rtol: float = 1e-9,
    atol: ArrayLike | Mapping[str, float] = 1e-9,
    max_steps: int = MAX_STEPS,
) -> SectionMap:
    """Return the Poincaré map of an autonomous system: the map of first returns to a section of its state space.

    An orbit returns when it crosses the section in the direction asked for.  The crossing is a root of the Taylor
    polynomial of the step that contains it, and therefore as accurate as the states are: the integrator's tolerance
    holds for each interval of time of one period of the system.

    Parameters
    ----------
    system : ForcedSystem
        An autonomous system of analytic functions, without `switches`.  Its `period` is the interval of time after
        which orbits are tested for their return; the best value is of the order of the return times.
    section : tuple (coordinate, value, direction)
        Name of a state variable and its value on the section; 1 for crossings at which it increases, -1 for those at
        which it decreases, 0 for both.  An angle meets the section once in each of its periods.
    max_time : float, optional
        Time after which an orbit that has not returned gets the status NO_RETURN; 100 periods by default.  An
        equilibrium on the section gets this status too.
    rtol, atol
        Relative and absolute tolerance, as for :func:`stroboscopic_map`: `atol` may be given for each coordinate of the
        system, that of the section among them.
    max_steps : int, optional
        Largest number of steps in one period of the system.

    Returns
    -------
    SectionMap
        A PointMap of the remaining state variables; :meth:`SectionMap.returns` also returns the times.

    Raises
    ------
    TypeError, ValueError
        For a system that is forced or cannot be compiled, or for arguments out of range.

    References
    ----------
    Hénon, Physica D 5 (1982) 412, on integrating up to a section; Filippov, *Differential Equations with Discontinuous
    Righthand Sides* (1988): here the motion is stopped at the section, by a discontinuous right-hand side that is zero
    beyond it.

    Examples
    --------
    >>> spiral = ForcedSystem(lambda t, x, p: (x[1], -x[0] - 0.2 * x[1]), {}, 6.0, ("q", "v"))
    >>> back = section_map(spiral, ("q", 0.0, 1))
    >>> frequency = (1.0 - 0.01) ** 0.5
    >>> returns = back.returns([[1.0]])
    >>> bool(abs(returns.times[0] - 2 * np.pi / frequency) < 1e-8)
    True
    >>> bool(abs(back([1.0])[0] - np.exp(-0.1 * 2 * np.pi / frequency)) < 1e-8)
    True
    """
    check_unforced(system)
    if system.switches is not None or system.impacts:
        raise ValueError(
            f"system={system!r} has switches or impacts, and its Poincaré map is not available: take "
            "flow_map(system, time)"
        )
    section = _section(system, section)
    longest = _STRETCHES * system.length if max_time is None else finite_number("max_time", max_time, above=0.0)
    return Section(system, section, longest, rtol, atol, max_steps).build()


@dataclass(frozen=True, eq=False)
class Section(MapSpec[SectionMap]):
    """Specification of a Poincaré map; see :func:`section_map`."""

    kind = "section"
    system: ForcedSystem
    section: tuple[str, float, int]
    max_time: float
    rtol: float
    atol: Any
    """A number, or a tuple of one for each coordinate of the system."""
    max_steps: int

    def __post_init__(self) -> None:
        check_tolerances(self)

    @property
    def place(self) -> int:
        """Number of the coordinate that is constant on the section."""
        return [c.name for c in self.system.axes].index(self.section[0])

    @computed_once
    def _gated(self) -> Formulas:
        return formulas(gated_system(self.system, self.place))

    @computed_once
    def _trip(self) -> Trip:
        system, (_, value, direction) = self.system, self.section
        stretch, loose = min(system.length, self.max_time), max(self.rtol, _ORDER_FOR)
        atol = with_further(self.atol, EXTRA)
        # With a side beyond -1 and 1 states would move faster than the system does, or backwards.
        bounds = np.where(np.arange(system.dimension + EXTRA) == system.dimension + 1, 1.0, np.inf)
        motion = flow(self._gated, 0.0, stretch, loose, atol, "auto", self.max_steps, bounds)
        return Trip(system, self.place, value, direction, self.max_time, stretch, replace(motion, rtol=self.rtol))

    @computed_once
    def _tangent_motion(self) -> Flow | None:
        tolerance = min(self.rtol, _TANGENT_TOLERANCE)
        atol = np.minimum(with_further(self.atol, EXTRA), tolerance)
        return tangent_flow(self._gated, 0.0, self._trip.stretch, tolerance, atol, tolerance, self.max_steps)

    @computed_once
    def _kept(self) -> Ints:
        """Coordinates of the system that stay zero where they are."""
        return np.flatnonzero(np.broadcast_to(self._trip.motion.keeps_zero, self.system.dimension + EXTRA)[:-EXTRA])

    @computed_once
    def _watched(self) -> Flow:
        """The motion of the system by which coordinates that become too small are noticed."""
        s = self.system
        motion = flow(formulas(s), 0.0, self._trip.stretch, self.rtol, self.atol, "auto", self.max_steps)
        return exact_motion(motion, self._kept)

    def make(self) -> SectionMap:
        """Return the map, without its specification."""
        system, trip = self.system, self._trip
        coordinates = tuple(c for j, c in enumerate(system.axes) if j != self.place)
        lower, turn = turns_of(coordinates)

        def first_returns(points: Floats) -> tuple[NDArray[Any], ...]:
            images, times, status, _ = trip(points)
            rotations = np.zeros(images.shape, np.int64)
            if wrap_rows(images, rotations, lower, turn):
                status[np.isnan(images).any(axis=1) & (status < Status.ESCAPED)] = Status.DIVERGED
                images[status >= Status.ESCAPED] = np.nan
            if len(self._kept):
                self._look(advance, points, times)
            return images, rotations, times, status

        advance = SectionAdvance(first_returns, system.axes)

        def tangent(points: Floats) -> tuple[Floats, Floats]:
            carried = replace(trip, motion=derivatives_of(system.name, self._tangent_motion))
            images, _, _, matrices = carried(points.reshape(-1, len(coordinates)))
            assert matrices is not None
            return images.reshape(points.shape), matrices.reshape(*points.shape, len(coordinates))

        return SectionMap(
            name=system.name,
            coordinates=coordinates,
            params=system.params,
            advance=advance,
            tolerance=(self.rtol, float(np.max(self.atol))),
            tangent=tangent,
            is_flow=True,
            no_image=Status.NO_RETURN,
            ends=tuple(system.ends),
            section=self.section,
            first_returns=first_returns,
        )

    def swept(self, names: tuple[str, ...]) -> Section | None:
        """Return the specification with some parameters appended to the state, where the formulas are known."""
        # Where the period is a function of parameters, time would be counted in periods.
        further = None if callable(self.system.period) else with_states(self.system, names)
        return None if further is None else replace(self, system=further, atol=with_further(self.atol, len(names)))

    def _look(self, advance: SectionAdvance, points: Floats, times: Floats) -> None:
        """Notice coordinates that become too small, and grow again, on the way of a few points back to the section.

        Too small is what is below its absolute tolerance, or within a stretch below the relative one at its end.
        """
        rows = np.flatnonzero(np.isfinite(times))
        rows = rows[evenly(len(rows), ORBITS)]
        if not len(rows):
            return
        step, stretch = float(times[rows].max()) / _LOOKS, self._trip.stretch
        places = np.insert(points[rows], self.place, self.section[1], axis=1)
        watching = FlowAdvance(replace(self._watched, length=step), *turns_of(self.system.axes))
        sizes = np.abs(seen(watching, places, _LOOKS)[:, :, self._kept])
        lost = regrown(sizes, self._trip.motion.atol[self._kept])
        for part in np.split(sizes, np.flatnonzero(np.diff(np.arange(_LOOKS + 1) * step // stretch)) + 1):
            lost |= regrown(part, self.rtol * part[-1])
        advance.lost.update(self._kept[lost].tolist())

    @property
    def recipe(self) -> dict[str, Any]:
        """Plain values for a file."""
        names = ("coordinate", "value", "direction")
        limits = {name: getattr(self, name) for name in ("max_time", "rtol", "atol", "max_steps")}
        section = dict(zip(names, self.section, strict=True))
        return {"kind": self.kind, **section, **limits, "period": self.system.length}

    @classmethod
    def from_recipe(cls, source: Any, recipe: Mapping[str, Any]) -> Section:
        """Return the specification of a recipe."""
        if not isinstance(source, ForcedSystem):
            raise no_source(source, recipe)
        system = replace(source, period=recipe["period"])
        section = _section(system, (recipe["coordinate"], recipe["value"], recipe["direction"]))
        return cls(system, section, **{name: recipe[name] for name in ("max_time", "rtol", "atol", "max_steps")})


def check_unforced(system: ForcedSystem) -> None:
    """Refuse a system whose right-hand side, or an impact of which, depends on time."""
    if not isinstance(system, ForcedSystem):
        raise TypeError(f"system={system!r}: give a ForcedSystem; an autonomous one takes any period")
    events = system.functions[2]
    for size in (0.1, 0.83):
        state = tuple(size + 0.37 * j for j in range(system.dimension))
        functions: list[InTime] = [lambda t: system.derivative(t, state)]  # noqa: B023
        if events is not None:
            functions.append(lambda t: events(t, state, system.parameters))  # noqa: B023
        samples = [sampled(f, system.length)[1] for f in functions]
        inside = [rows[np.isfinite(rows).all(axis=1)] for rows in samples]  # the domain of the function
        if not all(np.allclose(rows, rows[:1], rtol=1e-12, atol=1e-300) for rows in inside):
            raise ValueError(
                f"system={system!r} depends on time: its map is stroboscopic_map(system); Poincaré sections and time-T "
                "maps are for autonomous systems"
            )


def _section(system: ForcedSystem, section: tuple[str, float, int]) -> tuple[str, float, int]:
    """Return the name of the section's coordinate, its value and the direction, checked."""
    try:
        name, value, direction = section
    except (TypeError, ValueError):
        raise TypeError(
            f"section={shown(section)}: give a coordinate, its value and a direction, ('z', 27.0, -1)"
        ) from None
    names = [c.name for c in system.axes]
    if not isinstance(name, str) or name not in names:
        raise ValueError(f"section={shown(section)}: the coordinates are {names}")
    if len(names) < 2:
        raise ValueError(f"section={shown(section)}: a section needs a system of at least two state variables")
    direction = one_of("section[2]", direction, (-1, 0, 1))
    return name, finite_number("section[1]", value), int(direction)
