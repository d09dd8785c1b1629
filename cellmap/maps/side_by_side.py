"""Orbits of one batch on all threads, where that is worth it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from .._lib.threads import run_over, slices, thread_count
from .orbit_batch import CHUNK, Orbits, Work

Result = TypeVar("Result")

_TRIED = 16  # orbits that are moved on first, for the time that they take
_WORTH = 4e-3  # seconds that the others have to take
_FEWEST = 16  # orbits in a part
_PARTS = 4  # parts for each thread
_LONG = 1 << 12  # periods of all orbits above which few orbits are cut, too
_COSTLY = 1 << 16  # numbers of all images above which orbits are cut for threads
_FULL = 256  # orbits of a part that keep vectors filled


def parts_of(shape: tuple[int, ...], periods: int) -> list[slice]:
    """Cut orbits (n, d) that move by some periods into parts for all threads."""
    number, dimension = shape
    alone = thread_count() == 1 or number * dimension * periods < _COSTLY
    return slices(number, CHUNK if alone else min(CHUNK, _share(number, _FULL)))


def long_parts(number: int, periods: int) -> list[slice]:
    """Cut orbits whose periods are long work into one part for each thread, which keeps a vector filled."""
    alone = number * periods < _LONG
    return slices(max(number, 1), max(_FEWEST, number if alone else -(-number // thread_count())))


def over_parts(orbits: Orbits, cuts: Sequence[slice], work: Callable[[Orbits], Result]) -> list[Result]:
    """Return what is found for each part of a batch, which moves on in place, from all threads."""
    # Each part counts its own work: threads would lose some of what they add to one number.
    parts = [replace(orbits[cut], work=Work()) for cut in cuts]
    found = run_over(parts, work)
    for part in parts:
        orbits.work.add(part.work)
    return found


def _share(number: int, least: int) -> int:
    """Return how many orbits make a part, where there are several parts for each thread."""
    return max(least, -(-number // (_PARTS * thread_count())))


def advance_on_threads(advance: Callable[[Orbits, int], None], orbits: Orbits, periods: int) -> None:
    """Move a batch of orbits on by some periods, in place, on all threads if the first of them take long.

    An image does not depend on the orbits beside it, and so neither on where a batch is cut.
    """
    if len(orbits) < _TRIED + 2 * _FEWEST or thread_count() == 1:
        advance(orbits, periods)
        return
    began = time.perf_counter()
    advance(orbits[:_TRIED], periods)
    rest = slice(_TRIED, len(orbits))
    left = len(orbits) - _TRIED
    if (time.perf_counter() - began) * left < _WORTH * _TRIED:
        advance(orbits[rest], periods)
        return
    over_parts(orbits[rest], slices(left, _share(left, _FEWEST)), lambda part: advance(part, periods))
