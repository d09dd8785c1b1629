"""Damping of a free swing: viscous, dry or both, by fits of the whole motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from cellmap import ForcedSystem
from cellmap.utils import finite_number

from ...effects import DryFriction, Effect, Gravity, QuadraticDrag, ViscousDamping
from ...pendulum import Pendulum
from ...scenes import scene
from ..time_series import akaike_weights, warn_of_undetermined
from .decay_models import FEWEST, KINDS, DecayComparison, checked_kinds, compared_decays
from .motion_fit import KNOWN_ALREADY, MotionFit, fitted_motion
from .natural_frequency import effective_length, natural_frequency
from .swing_extremes import continuous_angles, envelope_of

EFFECTS: Mapping[str, Callable[[float], Effect]] = {
    "damping": ViscousDamping,
    "friction": DryFriction,
    "drag": QuadraticDrag,
}
"""Effects by the name of their parameter."""

_LEAST = 0.02  # fraction of a coefficient alone with which it enters a mixture


@dataclass(frozen=True, eq=False)
class DampingFits:
    """Kinds of damping fitted to the motion of a rod, in the order of their information criterion.

    Parameters
    ----------
    fits : mapping of str to MotionFit
        The best first.
    profile : DecayComparison or None
        What the extremes alone say; None where all first guesses were given.
    """

    fits: Mapping[str, MotionFit]
    profile: DecayComparison | None

    def __repr__(self) -> str:
        return f"DampingFits({'; '.join(f'{kind} {w:.3g}' for kind, w in self.weights.items())}; best {self.best!r})"

    @property
    def kind(self) -> str:
        """The kind with the least criterion."""
        return next(iter(self.fits))

    @property
    def best(self) -> MotionFit:
        """Its fit."""
        return self.fits[self.kind]

    @property
    def weights(self) -> dict[str, float]:
        """Akaike weights: how likely each kind is the best of these, by the data, if residuals are independent."""
        return akaike_weights({kind: fit.aicc for kind, fit in self.fits.items()})


def fit_damping(
    times: ArrayLike,
    angles: ArrayLike,
    kinds: Sequence[str] = ("viscous", "dry", "viscous and dry"),
    length: float | None = None,
    gravity: float = 9.8,
    zero: bool = True,
    guess: Mapping[str, float] | None = None,
) -> DampingFits:
    """Fit length and damping of a pendulum to its free swing, for several kinds of damping.

    The profile of at least 6 extremes gives first guesses; then the motion itself is simulated, with its period at each
    amplitude, and fitted by least squares.  Where all guesses are given, any number of extremes will do.

    Parameters
    ----------
    times : array_like, shape (n,)
        Times (s), increasing; the rod is free from the first one on.
    angles : array_like, shape (n,)
        Angles from the downward vertical (rad), continuous; NaN marks a gap.
    kinds : sequence of str, optional
        Names of the laws of friction that are tried; by default all.
    length : float, optional
        Effective length (m), where it is known; by default it is fitted.
    gravity : float, optional
        Acceleration of free fall (m/s^2).
    zero : bool, optional
        Fit the zero of the angle, too: how far the camera's vertical is off.
    guess : mapping of str to float, optional
        First guesses, above 0: length (m), unless it is known, and the coefficients damping (1/s), friction (rad/s^2)
        and drag of the kinds.  Those that are missing are taken from the profile.

    Returns
    -------
    DampingFits
        A :class:`MotionFit` for each kind, and their weights.

    Raises
    ------
    TypeError, ValueError
        As :func:`swing_envelope`, :func:`compare_decays` and :func:`fit_motion`; for fewer than 6 extremes where a
        first guess is missing.

    Warns
    -----
    UserWarning
        For parameters of the best kind that are undetermined.

    Examples
    --------
    >>> from cellmap import trajectory
    >>> rod = free_pendulum(0.069, {"damping": 0.4})
    >>> film = trajectory(rod, [0.5, 0.0], periods=8, samples_per_period=50)
    >>> fit_damping(film.times, film.states[:, 0], ["viscous"]).best.estimates["damping"]
    0.4000
    """
    g = finite_number("gravity", gravity, above=0.0)
    named = checked_kinds(kinds)
    fixed = {} if length is None else {"length": finite_number("length", length, above=0.0)}
    free = list(dict.fromkeys(n for kind in named for n in ("length", *KINDS[kind]) if n not in fixed))
    known = fixed | _guesses(guess, free)
    t, x = continuous_angles(times, angles)
    profile = None
    if missing := [n for n in free if n not in known]:
        envelope = envelope_of(t, x, None, FEWEST, f"guess= of {', '.join(missing)}")
        w = natural_frequency(envelope)
        known = {"length": effective_length(w, g).value} | known
        singles = [kind for kind, names in KINDS.items() if len(names) == 1]
        profile = compared_decays(envelope, w.value, [*named, *singles])
        alone = {name: value for kind in singles for name, value in profile[kind].coefficients.items()}
    fits = {}
    for kind in named:
        found = {} if profile is None else profile[kind].coefficients
        begin = {n: known[n] if n in known else max(found[n], _LEAST * alone[n]) for n in KINDS[kind]}
        rod = free_pendulum(known["length"], begin, g)
        fits[kind] = fitted_motion(rod, t, x, [n for n in ("length", *KINDS[kind]) if n in free], zero=zero)
    ordered = sorted(fits, key=lambda kind: fits[kind].aicc)
    best = fits[ordered[0]]
    warn_of_undetermined(best.estimates, best.standard_errors, best.undetermined, KNOWN_ALREADY)
    return DampingFits({kind: fits[kind] for kind in ordered}, profile)


def _guesses(given: Mapping[str, float] | None, names: Sequence[str]) -> dict[str, float]:
    """Return first guesses, held to the names of what is fitted."""
    if given is not None and not isinstance(given, Mapping):
        raise TypeError(f"guess={given!r}: give first guesses by names, such as {{{names[0]!r}: 0.1}}")
    for name in given or {}:
        if name not in names:
            raise ValueError(f"guess has {name!r}: what is fitted is {', '.join(names)}")
    return {n: finite_number(f"guess[{n!r}]", value, above=0.0) for n, value in (given or {}).items()}


def free_pendulum(length: float, coefficients: Mapping[str, float], gravity: float = 9.8) -> ForcedSystem:
    """Return a pendulum that swings freely, with its own period at small amplitude as the period.

    Parameters
    ----------
    length : float
        Effective length (m), above 0.
    coefficients : mapping of str to float
        Damping by the name of its parameter: damping, friction, drag.
    gravity : float, optional
        Acceleration of free fall (m/s^2).

    Returns
    -------
    ForcedSystem
        The scene.

    Raises
    ------
    ValueError
        For names that are no damping, and numbers out of range.

    Examples
    --------
    >>> free_pendulum(0.069, {"damping": 0.4}).params
    {'length': 0.069, 'gravity': 9.8, 'damping': 0.4}
    """
    for name in coefficients:
        if name not in EFFECTS:
            raise ValueError(f"coefficients has {name!r}: choose among {', '.join(EFFECTS)}")
    effects = [EFFECTS[name](value) for name, value in coefficients.items()]
    period = 2.0 * pi * float(np.sqrt(length / gravity))
    return scene(Pendulum(length), Gravity(gravity), *effects, period=period, name="free pendulum")
