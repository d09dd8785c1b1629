"""Random numbers of public functions: what `rng` may be, and what is made of it."""

from __future__ import annotations

import numpy as np

from .checks import shown, whole_number

Rng = int | np.random.Generator | None
"""A seed, with which each call draws the same; a generator, which goes on; or None, for a seed from the system."""


def random_numbers(rng: Rng) -> np.random.Generator:
    """Return the generator that an argument `rng` stands for."""
    if rng is None or isinstance(rng, np.random.Generator):
        return np.random.default_rng(rng)
    return np.random.default_rng(_seed(rng))


def random_seed(rng: Rng) -> int:
    """Return a seed for work that is cut into parts with random numbers of their own: an int as it is."""
    if rng is None or isinstance(rng, np.random.Generator):
        return int(np.random.default_rng(rng).integers(2**62))
    return _seed(rng)


def _seed(rng: object) -> int:
    try:
        return whole_number("rng", rng)
    except TypeError:
        remedy = "give a whole number as seed, a numpy.random.Generator, or None"
        raise TypeError(f"rng={shown(rng)}: {remedy}") from None
