"""Numbers of attractors in the page, by which they have their colours: those of an address, where they are the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import finite_points, is_sequence, shown, whole_number
from ..basins.live import LiveFrame
from ..maps.coordinates import difference
from ..orbits.attractor import Attractor

_MOST = 256  # attractors of an address
_LARGEST = 10_000
_NEAR, _NEAR_CLOUD = (
    0.01,
    0.05,
)  # distances of a point from a periodic and from another attractor, in sizes of the window


def anchors_of(given: Any, dimension: int) -> dict[int, Floats]:
    """Return points by the numbers of their attractors, from a list of pairs.

    Raises
    ------
    TypeError, ValueError
        For anything else.
    """
    if given is None:
        return {}
    if not is_sequence(given) or len(given) > _MOST or not all(is_sequence(a) and len(a) == 2 for a in given):
        raise TypeError(f"anchors={shown(given)}: give at most {_MOST} pairs of a number and a point")
    return {
        whole_number("anchors", number, at_most=_LARGEST): finite_points("anchors", point, dimension).reshape(-1)
        for number, point in given
    }


class Numbering:
    """Numbers of the attractors of live basins.

    Parameters
    ----------
    anchors : mapping of int to ndarray, shape (dimension,)
        A point of each attractor that has a number already.
    extent : ndarray, shape (dimension,)
        Size of the window in which distances are small or large.
    """

    def __init__(self, anchors: Mapping[int, Floats], extent: Floats) -> None:
        self._anchors, self._extent = anchors, extent
        self._numbers: dict[int, int] = {}

    def numbered(self, frame: LiveFrame) -> LiveFrame:
        """Return a frame with these numbers in the place of identities."""
        if not self._anchors:
            return frame
        self._take({k: a for k, a in frame.attractors.items() if k not in self._numbers})

        def numbers(identities: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(self._numbers.get(k, k) for k in identities)

        return replace(
            frame,
            identities=numbers(frame.identities),
            attractors={self._numbers[k]: a for k, a in frame.attractors.items()},
            born=numbers(frame.born),
            gone=numbers(frame.gone),
        )

    def _take(self, fresh: Mapping[int, Attractor]) -> None:
        """Give attractors their numbers: those of the nearest points that are near, then numbers that are free."""
        free = {n: point for n, point in self._anchors.items() if n not in self._numbers.values()}
        pairs = sorted((_distance(a, p, self._extent), k, n) for k, a in fresh.items() for n, p in free.items())
        for distance, k, n in pairs:
            near = _NEAR if fresh[k].period else _NEAR_CLOUD
            if distance < near and k not in self._numbers and n not in self._numbers.values():
                self._numbers[k] = n
        for k in fresh:
            if k not in self._numbers:
                taken = {*self._anchors, *self._numbers.values()}
                self._numbers[k] = k if k not in taken else max(taken) + 1


def _distance(attractor: Attractor, point: Floats, extent: Floats) -> float:
    shift = difference(attractor.points, point, attractor.coordinates) / extent
    return float(np.sqrt((shift**2).sum(axis=-1)).min())
