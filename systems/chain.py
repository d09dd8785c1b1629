"""Chains of pendulums on a driven pivot: single, double, triple and longer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Any

from cellmap import Coordinate, angle
from cellmap.maps import RightHandSide, StateFunction

from .forces import Forces
from .quantities import LENGTH, MASS, quantity
from .scenes import Body, TipsTerm

_UNLIKE = 1e9  # ratio of masses, at most


@dataclass(frozen=True)
class Chain(Body):
    """Point masses on massless rods, one hung from the other: M q'' = F with mu_k the sum of the masses n >= k.

    M_ij = mu_max(i,j) l_i l_j cos(theta_i - theta_j) and F_i = -sum_j mu_max(i,j) l_i l_j sin(theta_i - theta_j)
    theta_j'^2 - mu_i l_i (vertical sin theta_i + horizontal cos theta_i) + m_1 l_1^2 (joint_i - joint_(i+1)).

    The state is (theta1, ..., thetaN, theta1', ..., thetaN'): absolute angles from the downward vertical, inner link
    first.  Joint i has the relative angle theta_i - theta_(i-1) and the relative angular velocity theta_i' -
    theta_(i-1)', theta_0 being 0.  The right-hand side eliminates the tensions of the rods from the tip to the pivot: a
    number of operations in proportion to N, one sine and one cosine a link.  It must be traceable: terms of effects may
    not branch.

    Parameters
    ----------
    lengths : sequence of float
        Lengths of the rods (m), above 0, inner link first; parameters length_1, ...
    masses : sequence of float
        Masses (kg), above 0, as many; parameters mass_1, ...

    Raises
    ------
    TypeError, ValueError
        For numbers that are not finite and above 0, and for different numbers of masses and lengths.

    References
    ----------
    Featherstone, *Rigid Body Dynamics Algorithms* (2008), chapter 7 (the recursion from the tip).

    Examples
    --------
    >>> Chain(lengths=(0.032, 0.032), masses=(1.0, 0.25)).parameters
    {'length_1': 0.032, 'length_2': 0.032, 'mass_1': 1.0, 'mass_2': 0.25}
    """

    lengths: Sequence[float] = quantity(LENGTH, each="length", above=0.0)
    masses: Sequence[float] = quantity(MASS, each="mass", above=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.lengths) != len(self.masses):
            raise ValueError(f"masses={self.masses!r}: give one for each of the {len(self.lengths)} lengths")
        for i, mass in enumerate(self.masses, start=1):
            if mass > _UNLIKE * min(self.masses):
                raise ValueError(
                    f"mass_{i}={mass!r}: give masses that differ by a factor of at most {_UNLIKE:g}, for the motion of "
                    "others is lost in rounding"
                )

    @property
    def joints(self) -> int:
        """Number of links."""
        return len(self.lengths)

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Absolute angles, then their angular velocities."""
        links = range(1, self.joints + 1)
        return (*[angle(f"theta{i}") for i in links], *[Coordinate(f"theta{i}'", "rad/s") for i in links])

    @staticmethod
    def compose(forces: Forces) -> RightHandSide:
        """Return the right-hand side."""
        return _motion(forces)

    @staticmethod
    def tips(joints: int) -> TipsTerm:
        """Return the positions of the masses relative to the pivot."""

        def tips(x: Sequence[float], p: Any) -> tuple[float, ...]:
            right = up = 0.0
            places: list[float] = []
            for i in range(joints):
                length = getattr(p, f"length_{i + 1}")
                right, up = right + length * sin(x[i]), up - length * cos(x[i])
                places += [right, up]
            return tuple(places)

        return tips

    @staticmethod
    def energy(forces: Forces) -> StateFunction:
        """Return kinetic and potential energy."""
        joints, weight, stored = forces.joints, forces.weight, forces.stored

        def energy(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
            kinetic = potential = right = up = height = before = 0.0
            inertia = p.mass_1 * p.length_1 * p.length_1
            for i in range(joints):
                length, mass = getattr(p, f"length_{i + 1}"), getattr(p, f"mass_{i + 1}")
                speed = length * x[joints + i]
                right, up = right + speed * cos(x[i]), up + speed * sin(x[i])
                height = height - length * cos(x[i])
                kinetic = kinetic + 0.5 * mass * (right * right + up * up)
                if weight is not None:
                    potential = potential + weight(t, p) * mass * height
                if (spring := stored[i]) is not None:
                    potential = potential + inertia * spring(x[i] - before, p)
                before = x[i]
            return kinetic, potential

        return energy


def _motion(forces: Forces) -> RightHandSide:
    """Return the right-hand side of n links.  Absent terms are None, and whatever would be made of them.

    In the frame of a rod (across it, along it outwards) with acceleration (u, v) of its upper end, weight included, and
    l theta'^2 = turn, its lower end has (cross, v - turn).  The force that it takes there is tension along the rod and
    push across it, the torque per length; both are affine in (u, v), with the part of the tension in v being `heft` and
    that without `drag`.  Passing from the tip to the pivot gives these, and back the accelerations.
    """
    n, vertical, horizontal, torque = forces.joints, forces.vertical, forces.horizontal, forces.torque

    def motion(t: float, x: Sequence[float], p: Any, s: Sequence[float] = ()) -> tuple[float, ...]:
        angles, rates = x[:n], x[n:]
        lengths = [getattr(p, f"length_{i + 1}") for i in range(n)]
        masses = [getattr(p, f"mass_{i + 1}") for i in range(n)]
        sines, cosines = [sin(a) for a in angles], [cos(a) for a in angles]

        turning: list[Any] = [None] * (n + 1)
        for i, joint in enumerate(forces.joint):
            if joint is not None:
                angle = angles[i] - angles[i - 1] if i else angles[0]
                rate = rates[i] - rates[i - 1] if i else rates[0]
                turning[i] = joint(t, angle, rate, forces.sign_at(i, s), p)
        if torque is not None:
            turning[0] = _sum(turning[0], torque(t, p, s))
        inertia = masses[0] * lengths[0] * lengths[0]
        pushes = [_product(inertia / lengths[i], _difference(turning[i], turning[i + 1])) for i in range(n)]

        rotations = [lengths[i] * (rates[i] * rates[i]) for i in range(n)]
        heft = masses[-1]
        drag = -(masses[-1] * lengths[-1]) * (rates[-1] * rates[-1])
        across = [_product(1.0 / masses[-1], pushes[-1])]  # the tip crosses with this acceleration whatever (u, v) is
        leans: list[Any] = []
        bends: list[Any] = []
        for i in range(n - 2, -1, -1):
            sine = sines[i + 1] * cosines[i] - cosines[i + 1] * sines[i]
            cosine = cosines[i + 1] * cosines[i] + sines[i + 1] * sines[i]
            pulled = heft * sine
            inverse_mass = 1.0 / (masses[i] + pulled * sine)
            push = _sum(_difference(pushes[i], _product(cosine, pushes[i + 1])), -(sine * drag))
            lean = inverse_mass * (pulled * cosine)
            bends.insert(0, (sine, cosine))
            leans.insert(0, lean)
            across.insert(0, inverse_mass * push)
            if i > 0:
                drag = lean * push + _difference(cosine * drag, _product(sine, pushes[i + 1]))
                heft = (masses[i] * (masses[i] + heft)) * inverse_mass
                drag = drag - heft * rotations[i]

        u = v = None
        if vertical is not None:
            weight = vertical(t, p, s)
            u, v = weight * sines[0], -weight * cosines[0]
        if horizontal is not None:
            side = horizontal(t, p, s)
            u, v = _sum(u, side * cosines[0]), _sum(v, side * sines[0])
        accelerations: list[Any] = []
        for i in range(n):
            along = _difference(v, rotations[i])
            cross = across[i] if i == n - 1 else across[i] - leans[i] * along
            swung = _product(1.0 / lengths[i], _difference(cross, u))
            accelerations.append(0.0 if swung is None else swung)
            if i < n - 1:
                sine, cosine = bends[i]
                u, v = cosine * cross - sine * along, sine * cross + cosine * along
        return (*rates, *accelerations)

    return motion


def _sum(a: Any, b: Any) -> Any:
    if a is None or b is None:
        return a if b is None else b
    return a + b


def _difference(a: Any, b: Any) -> Any:
    if a is None or b is None:
        return a if b is None else -b
    return a - b


def _product(a: Any, b: Any) -> Any:
    return None if b is None else a * b
