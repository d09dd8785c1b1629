"""Equations of a periodic orbit, in state variables and parameters."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from .._lib.arrays import Bools, Complexes, Floats, Ints
from .._lib.checks import known_parameter
from .._lib.computed import computed_once
from ..maps.coordinates import difference, shortest, turns_of, wrap
from ..maps.parameters_as_states import Swept, swept_map
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .arclength import SolutionPoint, corrected
from .attractor import Attractor
from .multipliers import multipliers_of, pairs_beside_one
from .newton import ROUNDING, closed_orbit
from .orbit_kinds import PeriodicOrbit

_UNCOUPLED = 1e-8  # part of the largest entry of a balanced derivative below which there is no coupling
_SMALL_DRIFT = 1e-3  # singular value, relative to those of I - M and M, along which the drift is not known
_AT_REST = 1e-9  # size from which a state is not 0, whatever its error, and a drift is one
_TANGENT = 1e-12  # absolute tolerance of images that come with derivatives, or that of the map
_CLEAR = 10.0  # errors of a state beyond which its size is known
_FARTHEST = 100.0  # largest factor by which a drift may enlarge a coordinate's unit


@dataclass(frozen=True, eq=False)
class OrbitProblem:
    """The equations P^period(x; q) = x, up to full rotations of angles, for unknowns (x, q) in units of `scale`."""

    point_map: PointMap
    swept: PointMap
    period: int
    scale: Floats

    @property
    def dimension(self) -> int:
        """Number of state variables."""
        return self.point_map.dimension

    @property
    def states(self) -> int:
        """Number of unknowns that are state variables."""
        return len(self.scale) - (self.swept.dimension - self.dimension)

    @property
    def divisions(self) -> int:
        """Number of parts into which each step of the map is divided."""
        return 1

    @property
    def nodes(self) -> int:
        """Number of states that are unknown."""
        return self.states // self.dimension

    @computed_once
    def around(self) -> Floats:
        """Periods of the state variables that are angles, 0 for the others."""
        return turns_of(self.point_map.coordinates)[1]

    @computed_once
    def circles(self) -> Floats:
        """Periods of the unknowns in their units, 0 for those that are not angles."""
        turns = np.tile(self.around, self.states // self.dimension)
        return np.append(turns, np.zeros(len(self.scale) - self.states)) / self.scale

    @property
    def growing(self) -> Bools:
        """State variables on the line: their natural size is theirs along the branch."""
        return np.append(
            np.tile(self.around, self.states // self.dimension) == 0, np.zeros(len(self.scale) - self.states, bool)
        )

    @property
    def parameter_direction(self) -> Floats:
        """Unit vector along the last parameter."""
        return np.eye(len(self.scale))[-1]

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals (..., d) and their derivatives (..., d, d + m) at unknowns (..., d + m)."""
        d = self.dimension
        state = unknowns * self.scale
        images, matrices = tangent(self.swept, state, self.period)
        moved = images[..., :d] - state[..., :d]
        # Where an angle that enters other images crosses its branch cut, these jump by full rotations.
        residual = shortest(moved, self.around) / self.scale[:d]
        slopes = (matrices[..., :d, :] - np.eye(d, len(self.scale))) * self.scale / self.scale[:d, None]
        return residual, slopes

    def cycle(self, unknowns: Floats) -> Floats:
        """Return the states at the nodes, with the parameters (..., n, d + m), of unknowns (..., n d + m)."""
        given = unknowns * self.scale
        nodes = given[..., : self.states].reshape(*given.shape[:-1], self.nodes, self.dimension)
        q = given[..., None, self.states :]
        return np.concatenate([nodes, np.broadcast_to(q, (*nodes.shape[:-1], q.shape[-1]))], axis=-1)

    def factors(self, slopes: Floats) -> Floats:
        """Return the derivatives (..., n, d, d) from each node to the next one, from those of the equations."""
        d, n = self.dimension, self.nodes
        blocks = np.stack([slopes[..., k * d : (k + 1) * d, k * d : (k + 1) * d] for k in range(n)], axis=-3)
        return blocks + np.eye(d) if n == 1 else blocks

    def matrix(self, place: SolutionPoint) -> Floats:
        """Return the monodromy matrix, in units of `scale`; its small eigenvalues are lost beside large ones."""
        return functools.reduce(lambda product, factor: factor @ product, self.factors(place.derivatives))

    def multipliers(self, place: SolutionPoint) -> Complexes:
        """Return the multipliers, by decreasing modulus."""
        return multipliers_of(self.matrix(place))

    def bordered(self, place: SolutionPoint) -> float:
        """Return a function that changes its sign where curves cross."""
        return place.bordered

    def doublings(self, place: SolutionPoint) -> float:
        """Return a function that changes its sign where a multiplier passes -1."""
        return float(np.linalg.det(self.matrix(place) + np.eye(self.dimension)))

    def pairs(self, place: SolutionPoint) -> float:
        """Return a function that changes its sign where a pair of multipliers has the product 1."""
        return float(pairs_beside_one(self.multipliers(place)))

    def growth(self, place: SolutionPoint) -> float:
        """Return the largest factor by which a deviation grows between two places at which the orbit is known."""
        return float(np.linalg.norm(self.factors(place.derivatives), axis=(1, 2)).max())

    def twisted(self, slopes: Floats) -> Floats:
        """Return derivatives by the states with the sign of the last node's image changed: singular at a doubling."""
        block, d = slopes[:, : self.states].copy(), self.dimension
        block[-d:, :d] += 2.0 * np.eye(d)
        return block

    def flipped(self, place: SolutionPoint) -> Floats:
        """Return the direction, in all unknowns, in which an orbit of twice the period leaves a period doubling."""
        null = np.linalg.svd(self.twisted(place.derivatives))[2][-1]
        return np.append(null, np.zeros(len(self.scale) - self.states))

    def enlarged(self, factor: float) -> OrbitProblem:
        """Return the equations in larger units of the state variables on the line."""
        return replace(self, scale=self.scale * np.where(self.growing, factor, 1.0))

    def with_parameters(self, exact: PointMap, names: tuple[str, ...], spans: tuple[float, ...]) -> OrbitProblem:
        """Return the equations with the parameters of a map, in units of their spans, in place of their own."""
        scale = np.append(self.scale[: self.states], spans)
        return replace(self, point_map=exact, swept=swept_map(exact, *names), scale=scale)

    def over(self, rounds: int, shrinking: float, span: float) -> OrbitProblem:
        """Return the equations of orbits of some times the period, in units of their own."""
        return replace(self, period=rounds * self.period, scale=np.append(shrinking * self.scale[:-1], span))

    def repeated(self, unknowns: Floats, rounds: int, sign: float = 1.0) -> Floats:
        """Return unknowns, in their units, of an orbit that is followed several times, with a sign after each."""
        return unknowns

    def once(self, unknowns: Floats) -> Floats:
        """Return the first state and the parameters (d + m,) of unknowns in their units."""
        return np.append(unknowns[: self.dimension], unknowns[self.states :])

    def through(self, state: Floats) -> Floats:
        """Return the unknowns of the orbit through a state and parameters (d + m,)."""
        return state / self.scale

    def opened(self, born: OrbitProblem, unknowns: Floats) -> float:
        """Return by how much an orbit of twice the period, a solution of other equations, fails to close after one."""
        gap = self(unknowns * born.scale / self.scale)[0]
        return float(np.linalg.norm(gap * self.scale[:-1] / born.scale[:-1]))

    def orbit_between(self, first: Floats, second: Floats, share: float, value: float) -> PeriodicOrbit | None:
        """Return the orbit at a value of the parameter, between neighbours given by their unknowns in their units."""
        apart, turns = second - first, self.circles * self.scale
        guess = np.append((first + share * shortest(apart, turns))[:-1], value) / self.scale
        place = corrected(self, guess, self.parameter_direction)
        return None if place is None else self.orbit_at(place.unknowns)

    def map_at(self, unknowns: Floats) -> PointMap:
        """Return the map with the parameters of a solution."""
        spec, values = self.swept.specified, (unknowns * self.scale)[self.states :]
        assert isinstance(spec, Swept)
        return self.point_map.with_params(**dict(zip(spec.names, values.tolist(), strict=True)))

    def orbit_at(self, unknowns: Floats) -> PeriodicOrbit:
        """Return the orbit of a solution, with its parameters."""
        sizes, exact = self.scale[: self.dimension], self.map_at(unknowns)
        state = wrap(unknowns[: self.dimension] * sizes, exact.coordinates)
        return closed_orbit(exact, state, self.period, sizes)


def begin_orbit(
    point_map: PointMap, orbit: PeriodicOrbit | Attractor, name: str, argument: str = "orbit"
) -> tuple[PointMap, Floats, int]:
    """Return the exact map, a point of the orbit and its period; refuse what is no periodic orbit of the map."""
    if not isinstance(point_map, PointMap):
        raise TypeError(f"point_map={point_map!r}: give a PointMap, such as stroboscopic_map returns")
    if not isinstance(orbit, PeriodicOrbit | Attractor):
        raise TypeError(f"{argument}={orbit!r}: give a PeriodicOrbit or an Attractor")
    exact = point_map.without_table
    known_parameter("parameter", name, exact.params)
    if not orbit.period:
        raise ValueError(f"{argument}={orbit!r}: give a periodic orbit")
    if orbit.coordinates != exact.coordinates:
        raise ValueError(f"{argument}={orbit!r}: its coordinates are not those of {exact!r}")
    return exact, np.array(orbit.points[0]), orbit.period


def orbit_problem(
    exact: PointMap,
    state: Floats,
    period: int,
    names: tuple[str, ...],
    spans: tuple[float, ...],
    sizes: Floats | None = None,
) -> OrbitProblem:
    """Return the equations of a periodic orbit near a state, scaled by coordinates' natural sizes and by the spans."""
    swept = swept_map(exact, *names)
    d = exact.dimension
    values = [exact.params[name] for name in names]
    images, matrices = tangent(swept, np.append(state, values), period)
    moved = difference(images[:d], state, exact.coordinates)
    if not (np.abs(moved) <= 1e-4 * (1.0 + np.abs(state))).all():
        raise ValueError(
            f"orbit through {state.tolist()} is no orbit of period {period} of {exact!r}: it moves by "
            f"{moved.tolist()}; take it from this map with its present parameters"
        )
    if sizes is None:
        sizes = _sizes(state, matrices, turns_of(exact.coordinates)[1], spans, _error(exact, moved))
    return OrbitProblem(exact, swept, period, np.append(sizes, spans))


def natural_sizes(exact: PointMap, state: Floats, period: int) -> Floats:
    """Return the natural sizes of displacements (d,) at a state: a radian, or the size of the state, or 1."""
    matrix = tangent(exact, state, period)[1]
    still = np.column_stack([matrix, np.zeros(len(state))])
    return _sizes(state, still, turns_of(exact.coordinates)[1], (1.0,), _error(exact, np.zeros(1)))


def _error(exact: PointMap, moved: Floats) -> float:
    """Return the error of the image of a point that is nearly fixed, and is moved."""
    return min(exact.tolerance[1], _TANGENT) + ROUNDING + float(np.abs(moved).max())


def _sizes(state: Floats, matrices: Floats, turn: Floats, spans: tuple[float, ...], error: float) -> Floats:
    """Return the natural sizes of displacements (d,), where those of coupled coordinates have given ratios.

    A radian for an angle; else the size of the state, if it is more than an error of its image makes of it, or what it
    drifts by over the spans of the parameters.
    """
    d = len(state)
    matrix = matrices[:d, :d]
    shifted = np.eye(d) - matrix
    # At a fold the state drifts without end: small singular values are left out, of one coordinate too.
    whole, part = float(np.linalg.norm(matrix, 2)), float(np.linalg.norm(shifted, 2))
    cut = _SMALL_DRIFT * max(1.0, whole / max(part, 1e-300))
    drift = np.linalg.pinv(shifted, cut) @ (matrices[:d, d:] * spans)
    furthest = np.abs(drift).max(axis=1)
    ratios, group = _coupled(matrix)
    least = float(np.linalg.svd(shifted, compute_uv=False)[-1])
    known = min(_AT_REST, _CLEAR * error / max(least, 1e-300))
    sizes = np.empty(d)
    for number in range(int(group.max()) + 1):
        mine = group == number
        own = ratios[mine] if mine.all() else ratios[mine] / ratios[mine].min()
        sizes[mine] = _sizes_together(state[mine], furthest[mine], turn[mine], own, known)
    return sizes


def _coupled(matrix: Floats) -> tuple[Floats, Ints]:
    """Return ratios (d,) of displacements that go together, and the group (d,) of coordinates in which they do.

    Balancing the derivative makes its entries comparable where coordinates act on each other.  Where one acts on
    another that does nothing to it, there is nothing to compare.
    """
    from scipy.linalg import matrix_balance
    from scipy.sparse.csgraph import connected_components

    if len(matrix) == 1:
        return np.ones(1), np.zeros(1, np.int64)
    balanced, (ratios, _) = matrix_balance(matrix, permute=False, separate=True)
    linked = np.abs(balanced) > _UNCOUPLED * np.abs(balanced).max()
    return ratios, connected_components(linked, connection="strong")[1]


def _sizes_together(state: Floats, furthest: Floats, turn: Floats, ratios: Floats, known: float) -> Floats:
    """Return the natural sizes of coordinates that are coupled; states below a size are 0."""
    angles = turn > 0
    if angles.any():
        size = float(np.exp(np.mean(np.log(turn[angles] / (2.0 * np.pi * ratios[angles])))))
        return np.where(angles, size * ratios, np.clip(furthest, size * ratios, _FARTHEST * size * ratios))
    size, longest = float(np.abs(state / ratios).max()), float((furthest / ratios).max())
    if size > known:
        return max(size, min(longest, 10.0 * size)) * ratios
    return (longest if longest > _AT_REST else 1.0) * ratios
