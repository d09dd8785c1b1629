"""Orbits of boxes as parallelepipeds with remainders: of flows as their enclosures carry them, of maps step by step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..._compiled.codegen.enclosing_steps import pairs_of
from ..._compiled.kernels.cell_covers import Forms
from ..._compiled.kernels.parallelepipeds import Sets, carry_sets
from ..._lib.arrays import Bools, Floats
from ..._lib.midpoint_radius import ROUNDING
from ..._lib.threads import run_over, slices
from ...maps.enclosures import enclosed_images, followed_boxes
from ...maps.followed_boxes import FollowedBoxes
from ...maps.point_map import PointMap

_TASK = 4096  # rows in a task of a thread


def orbits_of(
    point_map: PointMap, centres: Floats, half: Floats, parameters: Mapping[str, Any] | None
) -> OrbitsOfFlow | OrbitsOfMap:
    """Return the orbits of boxes (n, d)."""
    boxes = followed_boxes(point_map, centres, half, parameters)
    return OrbitsOfMap(point_map, centres, half, parameters) if boxes is None else OrbitsOfFlow(boxes)


class OrbitsOfFlow:
    """Sets that enclosures of a flow carry along."""

    def __init__(self, boxes: FollowedBoxes) -> None:
        self.boxes = boxes

    def next(self) -> tuple[Sets, Bools]:
        """Return the sets after another period, and which are known."""
        boxes = self.boxes
        boxes.advance()
        return sets_of(boxes), np.asarray(np.isfinite(boxes.rows).all(axis=1))

    def keep(self, some: Bools) -> None:
        """Forget all others."""
        self.boxes.keep(some)


def sets_of(boxes: FollowedBoxes) -> Sets:
    """Return the sets that enclosures of a flow know.

    A point is off the image of the centre by the derivative there, the bends, and the errors of all three.
    """
    rows, known = boxes.kernel.rows, boxes.rows
    n, d = len(known), rows.d
    pairs = pairs_of(d) if len(rows.curvatures) else []
    w = known[:, rows.half_widths]
    halves = [(0.5 if j == k else 1.0) * w[:, j] * w[:, k] * ROUNDING.wider + ROUNDING.tiny for j, k in pairs]
    sizes = np.column_stack([w, *halves])

    def matrices(*parts: range) -> Floats:
        return np.concatenate([known[:, part].reshape(n, d, -1) for part in parts], axis=2)

    shapes = matrices(rows.derivatives, rows.curvatures)
    errors = matrices(rows.derivative_errors, rows.curvature_errors)
    spreads = known[:, rows.image_errors] + (errors * sizes[:, None, :]).sum(axis=2)
    spreads = spreads * ROUNDING.wider + ROUNDING.tiny
    return Sets(known[:, rows.images].copy(), shapes, sizes, matrices(rows.frame), spreads, np.empty((n, d)))


class OrbitsOfMap:
    """Sets that mean-value forms over the boxes around them carry along."""

    def __init__(
        self, point_map: PointMap, centres: Floats, half: Floats, parameters: Mapping[str, Any] | None
    ) -> None:
        n, d = centres.shape
        unit = np.broadcast_to(np.eye(d), (n, d, d))
        self.map, self.parameters = point_map, parameters
        self.sets = Sets(centres.copy(), unit.copy(), half.copy(), unit.copy(), np.zeros((n, d)), half.copy())

    def next(self) -> tuple[Sets, Bools]:
        """Return the sets after another step, and which are known."""
        sets, known = self.sets, np.empty(len(self.sets.centres), bool)
        forms = forms_of(self.map, sets.centres, sets.hulls, self.parameters)
        on_threads(len(known), carry_sets, sets, forms, ROUNDING, known)
        return sets, known

    def keep(self, some: Bools) -> None:
        """Forget all others."""
        self.sets = Sets(*(a[some] for a in self.sets))


def forms_of(point_map: PointMap, centres: Floats, half: Floats, parameters: Mapping[str, Any] | None) -> Forms:
    """Return mean-value forms of boxes, as kernels take them."""
    f = enclosed_images(point_map, centres, half, parameters=parameters)
    return Forms(f.images, f.derivatives, f.spreads)


def on_threads(total: int, loop: Callable[..., Any], *arguments: Any) -> None:
    """Run a loop over rows in tasks of one size."""

    def work(part: slice) -> None:
        loop(*arguments, part.start, part.stop)

    run_over(slices(total, _TASK), work)
