"""Multiple shooting: periodic orbits in segments, for multipliers of any size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from .._lib.arrays import Complexes, Floats
from ..maps.coordinates import shortest, wrap
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from .arclength import SolutionPoint
from .multipliers import factors_beside, multipliers_of_product, products_of_pairs
from .orbit_equations import OrbitProblem
from .orbit_kinds import PeriodicOrbit

DIVISIONS = (1, 4, 16, 64)
"""Parts of a step of the map in segments of an orbit, tried one after the other."""

_SAMPLES = 32  # samples of a step of the map, in which the size of an orbit shows

LARGEST_GROWTH = 1e3
"""Growth of deviations between two nodes from which there should be more of them.

A tangent as long as usual steps, 0.01, misses the next orbit by its square: multiplied by this, by a tenth of an
orbit, from where on Newton's method asks for shorter steps.
"""

TangentMap = Callable[[Floats], tuple[Floats, Floats]]


@dataclass(frozen=True, eq=False)
class ShootingProblem(OrbitProblem):
    """The equations of a periodic orbit known at n nodes, at equal distances in time, each the image of the one before.

    Unknowns are (x_1, ..., x_n, q) in units of `scale`, of which those of states are larger by the square root of n, so
    that lengths are means over the nodes.  Deviations grow from a node to the next one only, however large the
    multipliers are; these follow from products of QR decompositions.

    References
    ----------
    Ascher, Mattheij, Russell, *Numerical Solution of Boundary Value Problems for Ordinary Differential Equations*
    (1995), chapter 4.
    """

    parts: tuple[TangentMap, ...] = field(repr=False)

    @classmethod
    def can_divide(cls, single: OrbitProblem, count: int) -> bool:
        """Return whether an orbit has more than one node if each step of the map is divided into parts."""
        spec = single.swept.spec
        return spec is not None and single.period * count > 1 and spec.parts(count) is not None

    @classmethod
    def of(cls, single: OrbitProblem, count: int, place: Floats, sized: bool) -> ShootingProblem:
        """Return the equations with each step of the map in `count` parts, near the orbit through a place (d + m,).

        The natural size of a coordinate that is no angle is the largest on the orbit, unless sizes are given.
        """
        d, nodes = single.dimension, single.period * count
        sizes = single.scale[:d] if sized else _largest_on(single, place)
        parts = single.swept.specified.parts(count)
        assert parts is not None, "asked for before"
        scale = np.append(np.tile(sizes * np.sqrt(nodes), nodes), single.scale[d:])
        return cls(single.point_map, single.swept, single.period, scale, parts)

    @property
    def divisions(self) -> int:
        """Number of parts into which each step of the map is divided."""
        return len(self.parts)

    def through(self, state: Floats) -> Floats:
        """Return the unknowns of the orbit through a state and parameters (d + m,), by integration."""
        nodes = _nodes(self, self.parts, state)
        return np.append(nodes.ravel(), state[self.dimension :]) / self.scale

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals (..., n d) and their derivatives (..., n d, n d + m) at unknowns (..., n d + m)."""
        d, n, count = self.dimension, self.nodes, len(self.parts)
        batch, states = unknowns.shape[:-1], self.cycle(unknowns)
        nodes = states[..., :d].copy()
        states[..., :d] = wrap(nodes, self.point_map.coordinates)
        images = np.empty_like(states)
        matrices = np.empty((*states.shape, states.shape[-1]))
        for k, part in enumerate(self.parts):
            rows = np.s_[..., k::count, :]
            images[rows], matrices[..., k::count, :, :] = part(states[rows])
        moved = shortest(images[..., :d] - np.roll(nodes, -1, axis=-2), self.around)
        slopes = np.zeros((*batch, n, d, len(self.scale)))
        for k in range(n):
            slopes[..., k, :, k * d : (k + 1) * d] = matrices[..., k, :d, :d]
            following = (k + 1) % n
            slopes[..., k, :, following * d : (following + 1) * d] -= np.eye(d)
            slopes[..., k, :, n * d :] = matrices[..., k, :d, d:]
        own = self.scale[: n * d]
        residual = moved.reshape(*batch, n * d) / own
        return residual, slopes.reshape(*batch, n * d, len(self.scale)) * self.scale / own[:, None]

    def with_parameters(self, exact: PointMap, names: tuple[str, ...], spans: tuple[float, ...]) -> ShootingProblem:
        """Return the equations with the parameters of a map, in units of their spans, in place of their own."""
        parts = swept_map(exact, *names).specified.parts(len(self.parts))
        assert parts is not None, "the orbit is in segments"
        other = super().with_parameters(exact, names, spans)
        assert isinstance(other, ShootingProblem)
        return replace(other, parts=parts)

    def over(self, rounds: int, shrinking: float, span: float) -> ShootingProblem:
        """Return the equations of orbits of some times the period, in units of their own."""
        sizes = np.tile(np.sqrt(rounds) * shrinking * self.scale[:-1], rounds)
        return replace(self, period=rounds * self.period, scale=np.append(sizes, span))

    def repeated(self, unknowns: Floats, rounds: int, sign: float = 1.0) -> Floats:
        """Return unknowns, in their units, of an orbit that is followed several times, with a sign after each."""
        states = self.states
        copies = [sign**k * unknowns[:states] for k in range(rounds)]
        return np.concatenate([*copies, unknowns[states:]])

    def opened(self, born: OrbitProblem, unknowns: Floats) -> float:
        """Return by how much an orbit of twice the period, a solution of other equations, fails to close after one."""
        first, second = unknowns[: born.states].reshape(2, -1)
        return float(np.linalg.norm(second - first))

    def orbit_at(self, unknowns: Floats) -> PeriodicOrbit:
        """Return the orbit of a solution, with its parameters."""
        exact, place = self.map_at(unknowns), SolutionPoint(unknowns, self(unknowns)[1], unknowns)
        d, n, count, axes = self.dimension, self.nodes, len(self.parts), exact.coordinates
        given = unknowns * self.scale
        nodes, values = wrap(given[: n * d].reshape(n, d), axes), given[n * d :]
        turn, full = np.where(self.around > 0, self.around, 1.0), np.zeros(d)
        for k in range(n):
            image = self.parts[k % count](np.append(nodes[k], values)[None])[0][0, :d]
            full += np.round((image - nodes[(k + 1) % n]) / turn)
        rotations = tuple(int(r) if t else 0 for r, t in zip(full, self.around, strict=True))
        units = self.scale[:d]
        matrix = self.matrix(place) * units[:, None] / units
        points, multipliers = nodes[::count], self.multipliers(place)
        return PeriodicOrbit(self.period, points, rotations, matrix, multipliers, axes, exact.params)

    def multipliers(self, place: SolutionPoint) -> Complexes:
        """Return the multipliers, by decreasing modulus."""
        return multipliers_of_product(self.factors(place.derivatives))

    def bordered(self, place: SolutionPoint) -> float:
        """Return a function that changes its sign where curves cross."""
        rows = np.vstack([place.derivatives, place.tangent])
        return float(np.linalg.det(rows / np.linalg.norm(rows, axis=1, keepdims=True) * np.sqrt(2.0)))

    def doublings(self, place: SolutionPoint) -> float:
        """Return a function that changes its sign where a multiplier passes -1."""
        return float(np.prod(factors_beside(self.multipliers(place), -1.0)).real)

    def pairs(self, place: SolutionPoint) -> float:
        """Return a function that changes its sign where a pair of multipliers has the product 1."""
        return float(np.prod(factors_beside(products_of_pairs(self.multipliers(place)), 1.0)).real)


def _nodes(problem: OrbitProblem, parts: tuple[TangentMap, ...], state: Floats) -> Floats:
    """Return the nodes (n, d) of the orbit through a state and parameters (d + m,), by integration."""
    d, place = problem.dimension, state.copy()
    nodes = np.empty((problem.period * len(parts), d))
    for k in range(len(nodes)):
        nodes[k] = place[:d] = wrap(place[:d], problem.point_map.coordinates)
        place = parts[k % len(parts)](place[None])[0][0]
    return nodes


def _largest_on(single: OrbitProblem, state: Floats) -> Floats:
    """Return natural sizes (d,): for coordinates that are no angles at least the largest value on the orbit."""
    spec, sizes = single.swept.specified, single.scale[: single.dimension]
    parts = spec.parts(_SAMPLES) or spec.parts(1)
    assert parts is not None, "asked for before"
    largest = np.abs(_nodes(single, parts, state)).max(axis=0)
    return np.where(single.around > 0, sizes, np.maximum(sizes, largest))
