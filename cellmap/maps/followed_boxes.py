"""Boxes of flows, enclosed from period to period without being wrapped in other boxes in between."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._compiled.codegen.enclosures import BoxLayout, CompiledEnclosure
from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from .._lib.threads import run_over, slices
from .enclosed_periods import best_order, period_of, sample, times_of_steps, units_of, with_steps
from .stroboscopic import Stroboscopic

_COARSE = 0.15  # spread relative to half-widths, beyond which second derivatives are worth their work
_MANY = 0.25  # fraction of a sample of boxes above which second derivatives are taken
_FEW = 3  # states, up to which they are compiled
_WIDEST = 8  # lanes of a vector
_TOGETHER = 1024  # boxes of a task; what depends on time alone is computed once for them


class FollowedBoxes:
    """Boxes of a flow, whose images after one, two, ... periods are enclosed.

    Parameters
    ----------
    spec : Stroboscopic
        The map of a period.
    centres, half_widths : ndarray, shape (n, d)
        Boxes.
    parameters : ndarray, shape (m, 2) or (2 m,)
        Midpoints and radii.
    exact : bool
        Whether they are numbers that the map has.
    far : bool
        Whether many periods follow, so that second derivatives are worth their work in any case.

    Attributes
    ----------
    kernel : CompiledEnclosure
        What encloses a period.
    rows : ndarray, shape (n, rows)
        What is known of the images of the boxes, as its :class:`BoxLayout` say; not finite where there is no enclosure.
    """

    def __init__(
        self,
        spec: Stroboscopic,
        centres: Floats,
        half_widths: Floats,
        parameters: Floats,
        exact: bool,
        far: bool = False,
    ) -> None:
        self._spec, self._order, self._steps = spec, best_order(centres, half_widths), 0
        self._period = period_of(spec.system, spec.phase, parameters, exact)
        self._p = np.concatenate([parameters, units_of(centres, half_widths)])
        few, some = spec.system.dimension <= _FEW, sample(np.arange(len(centres)))
        second = few and far
        if few and not far:
            self._start(centres[some], half_widths[some], second=False)
            second = self._is_coarse()
            self._steps = 0 if second else self._steps
        self._start(centres, half_widths, second)

    def _start(self, centres: Floats, half_widths: Floats, second: bool) -> None:
        self.kernel = self._spec.enclosure(self._order, second)
        self.rows = started(self.kernel.rows, centres, half_widths)

    def _is_coarse(self) -> bool:
        """Tell whether many boxes are known too coarsely after a period, or not at all."""
        w = self.rows[:, self.kernel.rows.half_widths]
        self.advance()
        spreads = self.rows[:, self.kernel.rows.spreads]
        coarse = ~(spreads <= _COARSE * w) & (w > 0.0)
        return len(w) > 0 and float(np.mean(coarse.any(axis=1))) > _MANY

    def advance(self) -> None:
        """Enclose the next period."""
        kernel, before = self.kernel, self.rows
        before[:, kernel.rows.remainder] = 0.0

        def pass_over(some: Ints, steps: int) -> Floats:
            return carried(kernel, before[some], self._p, *times_of_steps(*self._period, steps))

        self.rows, self._steps = with_steps(pass_over, len(before), kernel.rows.count, self._order, self._steps)

    def keep(self, some: Bools) -> None:
        """Forget all others."""
        self.rows = self.rows[some]


def started(rows: BoxLayout, centres: Floats, half_widths: Floats) -> Floats:
    """Return the enclosures of boxes at the beginning, shape (n, rows)."""
    found = np.zeros((len(centres), rows.count))
    found[:, rows.images], found[:, rows.half_widths] = centres, np.where(half_widths >= 0.0, half_widths, np.nan)
    for identity in (rows.derivatives, rows.frame):
        found[:, list(identity)[:: rows.d + 1]] = 1.0
    return found


def carried(kernel: CompiledEnclosure, before: Floats, p: Floats, *steps: Any) -> Floats:
    """Return the enclosures of boxes (n, rows) after a period, or after a step of a discrete map."""
    found = np.empty_like(before)

    def enclose(part: slice) -> None:
        check_stop()
        some = before[part]
        count = len(some)
        # Vectors are filled up with copies of the first box.
        state = np.empty((before.shape[1], count + -count % _WIDEST))
        state[:, :count] = some.T
        state[:, count:] = state[:, :1]
        kernel(state, count, p, *steps)
        found[part] = state.T[:count]

    run_over(slices(len(before), _TOGETHER), enclose)
    return found
