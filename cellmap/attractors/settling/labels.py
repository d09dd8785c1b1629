"""Labels of initial conditions that belong to no attractor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._compiled.kernels.periods import MOST_ENDS
from ..._lib.arrays import Ints
from ...maps.orbit_batch import Status


class Label(IntEnum):
    """Label of an initial condition without attractor; attractors have the labels 0, 1, ...."""

    ESCAPED = -1
    """The orbit left the window of an interpolated map."""
    DIVERGED = -2
    """It grew beyond all bounds, or the map has no image of one of its points; or it is a million times as far as the
    region is large, and goes a million times farther in as many periods again."""
    UNDECIDED = -3
    """It has not settled within the periods that were allowed."""
    NO_RETURN = -4
    """It did not return to the Poincaré section."""
    UNLABELLED = -5
    """The call ended before the initial condition was labelled, as its limit of time or a cancellation asked for."""
    OUT_OF_STEPS = -6
    """The integrator did not reach the end of a period, or any correct digit, with the largest number of steps."""
    DOUBTFUL = -7
    """Features of its orbit are those of no group, or of different ones in time."""
    ENDED = -8
    """The orbit came to the first of the ends of its system; that of the next one is one less, and so on."""


LABEL_NAMES = {int(k): "did not return" if k is Label.NO_RETURN else k.name.lower().replace("_", " ") for k in Label}
LABEL_NAMES |= {Label.ENDED - k: f"end {k + 1}" for k in range(MOST_ENDS)}
"""Names of the labels that are not attractors."""


def label_names(ends: Sequence[str]) -> dict[int, str]:
    """Return the names of labels that are not attractors, with those of the ends of a system."""
    return LABEL_NAMES | {Label.ENDED - k: name for k, name in enumerate(ends)}


def stored_names(settings: Mapping[str, Any]) -> dict[int, str]:
    """Return the names of labels among settings: those of ends in the recipe of a map, and those that were given."""
    given = {int(label): name for label, name in settings.get("names", {}).items()}
    return label_names(settings.get("map", {}).get("end_names", ())) | given


LABELS_OF = np.full(Status.ENDED + MOST_ENDS, Label.UNDECIDED, np.int64)
"""Labels of orbits that have come to no attractor, by their status."""
for _name in ("ESCAPED", "DIVERGED", "NO_RETURN", "OUT_OF_STEPS"):
    LABELS_OF[Status[_name]] = Label[_name]
LABELS_OF[Status.ENDED :] = Label.ENDED - np.arange(MOST_ENDS)


_MOST = int(np.iinfo(np.int16).max)


def label_type(attractors: int) -> Any:
    """Return the type of arrays of labels of a number of attractors: int16, or int32 for more than 32,767."""
    return np.int16 if attractors <= _MOST else np.int32


def label_of(status: ArrayLike) -> Ints:
    """Return the labels of orbits that have come to no attractor, by how each stands: a :class:`Status`."""
    return np.asarray(LABELS_OF[np.asarray(status)])
