"""Attractors and basin fractions as functions of a parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import one_of
from .._lib.records import Array, ConvertsToXarray, Layout
from .._lib.signatures import checked
from ..attractors.settling.labels import LABEL_NAMES, stored_names
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost
from ..orbits.attractor import Attractor, distinct_names


class ContinuationInterrupt(KeyboardInterrupt):
    """Interruption of :func:`continue_basins` by Ctrl-C; `partial` holds the values computed so far.

    Parameters
    ----------
    partial : BasinContinuation
        Result for the values computed so far; give it as ``resume`` to continue.
    """

    def __init__(self, partial: BasinContinuation) -> None:
        super().__init__(f"interrupted after {len(partial.values)} values; `partial` holds them")
        self.partial = partial


@dataclass(frozen=True, eq=False)
class BasinContinuation(ConvertsToXarray):
    """Attractors and basin fractions as functions of a parameter.

    Parameters
    ----------
    system, parameter : str
        Name of the system and of its parameter.
    values : ndarray, shape (n,)
        Values of the parameter in the order in which they were taken, in its unit.
    labels : tuple of int, length m
        Labels of all attractors that were found, from 0 in the order of their first appearance, then the negative
        labels that occur: -1 (escaped), -2 (diverged), -3 (undecided), -4 (did not return), -6 (out of
        steps).
    counts : ndarray of int, shape (n, m)
        Number of initial conditions with each label, at each value.
    attractors : tuple of mapping of int to Attractor, length n
        Attractors by label, at each value.  An attractor to which no initial condition converges has a count of 0; of a
        chaotic attractor at most 1024 points are kept.
    inaccurate : ndarray of int, shape (n,)
        Initial conditions along whose orbits the integrator missed its tolerance.
    initial_conditions : CellGrid or ndarray, shape (..., dimension)
        Initial conditions, the same at each value.
    coordinates : tuple of Coordinate
        State variables.
    params : mapping of str to float
        The other parameters.
    settings : mapping
        Arguments of :func:`continue_basins`.
    cost : Cost
        Wall time and steps of the map.
    audited : ndarray of int, shape (n, 2)
        Where labels are found from states that are interpolated over the parameter: the number of initial conditions
        that are labelled from their beginning as well, and how many of these differ.  If any does, all labels of the
        value are found from the beginning, as they are where both numbers are 0.
    parameter_units : mapping of str to str
        Units of parameters, as far as the system declares them.
    """

    _layout: ClassVar = Layout(
        "Basin fractions of {0.system}",
        {
            "values": Array("{parameter}", "{0.parameter}", "{parameter}"),
            "_codes": Array("label", name="label", flags="_meanings"),
        },
        {
            "counts": Array("{parameter} label", "initial conditions with the label", unit="1"),
            "fractions": Array("{parameter} label", "fraction of the initial conditions", unit="1"),
            "standard_errors": Array("{parameter} label", "standard error of the fraction"),
            "present": Array("{parameter} label", "the attractor exists, or the label occurs"),
            "inaccurate": Array("{parameter}", "orbits that missed the tolerance"),
            "audited": Array("{parameter} audit", "initial conditions labelled twice, and those that differ"),
        },
        {"labels": ""},
    )

    system: str
    parameter: str
    values: Floats
    labels: tuple[int, ...]
    counts: Ints
    attractors: tuple[Mapping[int, Attractor], ...]
    inaccurate: Ints
    initial_conditions: CellGrid | Floats
    coordinates: tuple[Coordinate, ...]
    params: Mapping[str, float]
    settings: Mapping[str, Any]
    cost: Cost = Cost()
    audited: Ints | None = None
    parameter_units: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        number = sum(label >= 0 for label in self.labels)
        span = f" from {self.values[0]:g} to {self.values[-1]:g}" if len(self.values) else ""
        found = f"{len(self.values)} values, {number} attractors"
        return f"BasinContinuation({self.system}, {self.parameter}{span}: {found})"

    @property
    def fractions(self) -> Floats:
        """Fractions of the initial conditions with each label, shape (n, m)."""
        return self.counts / self.total

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of the fractions, shape (n, m), for random initial conditions; upper bounds for a grid.

        The initial conditions are the same at each value, so that differences between values are more accurate.
        """
        return np.asarray(np.sqrt(self.fractions * (1.0 - self.fractions) / self.total))

    @property
    def total(self) -> int:
        """Number of initial conditions."""
        return count_initial_conditions(self.initial_conditions)

    @property
    def present(self) -> Bools:
        """Whether each attractor exists at each value, shape (n, m); for negative labels, whether they occur."""
        there = np.array([[k in found for k in self.labels] for found in self.attractors], bool)
        return there.reshape(self.counts.shape) | (self.counts > 0)

    @property
    def _codes(self) -> NDArray[np.int16]:
        return np.array(self.labels, np.int16)

    @property
    def _meanings(self) -> dict[int, str]:
        return {label: self.label_name(label) for label in self.labels}

    @checked
    def label_name(self, label: int) -> str:
        """Return the meaning of a label: for an attractor its name at the value where it first appears."""
        one_of("label", label, (*self.labels, *LABEL_NAMES))
        if label < 0:
            return stored_names(self.settings)[label]
        return distinct_names([_first(self.attractors, k) for k in self.labels if k >= 0])[label]


def count_initial_conditions(initial_conditions: CellGrid | Floats) -> int:
    """Return how many initial conditions a grid or an array has."""
    return (
        initial_conditions.size
        if isinstance(initial_conditions, CellGrid)
        else initial_conditions.size // initial_conditions.shape[-1]
    )


def _first(attractors: Sequence[Mapping[int, Attractor]], label: int) -> Attractor:
    return next(found[label] for found in attractors if label in found)
