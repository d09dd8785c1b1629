"""Branches and curves in the format of AUTO's bifurcation diagram files, `b.NAME` or `fort.7`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import is_sequence, shown
from .._lib.files import as_target, write_whole
from .._lib.signatures import checked
from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.branch import Bifurcation, Branch
from ..bifurcations.connecting_branches import TangencyCurve
from ..bifurcations.function_zeros import FunctionZero
from ..bifurcations.kinds import BifurcationKind
from ..bifurcations.period_measures import measured
from ..maps.coordinates import Coordinate
from ..maps.point_map import PointMap
from ..orbits.multipliers import unstable_count

TYPES = {
    BifurcationKind.TRANSCRITICAL: 1,
    BifurcationKind.PITCHFORK: 1,
    BifurcationKind.FOLD: 2,
    BifurcationKind.PERIOD_DOUBLING: 7,
    BifurcationKind.NEIMARK_SACKER: 8,
}
"""AUTO's numbers of types of points: BP, LP, PD, TR."""

_END, _FAILED, _USER = 9, -9, -4  # EP, MX, UZ
_LARGEST = 9999  # number of a point, which has four digits


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of a file: values (n, columns) by names, whether each is stable, and its type."""

    names: list[str]
    values: Floats
    stable: Bools
    types: Ints
    heading: str


@checked
def save_auto(
    result: Branch | BifurcationCurve | TangencyCurve | Sequence[Branch | BifurcationCurve | TangencyCurve],
    path: str | PathLike[str],
    measures: bool = False,
) -> Path:
    """Write branches and curves to a file in the format of AUTO's bifurcation diagrams.

    Each is a branch of the file.  Its columns are the first parameter, the Euclidean norm of the state, the state
    variables of one point of the orbit and, for a curve, the second parameter.  As in AUTO, the number of a point is
    negative where the orbit is stable, and points have the types BP (pitchfork and transcritical), LP (fold), PD, TR
    (Neimark-Sacker), UZ (zero of a function), EP and MX (an end without convergence), with labels.  Bifurcations and
    zeros of a branch are rows of their own.

    Parameters
    ----------
    result : Branch, BifurcationCurve or TangencyCurve, or sequence of them
        What is written, in this order.  For tangencies the state is the middle point of the orbit.
    path : str or path
        Name of the file, for example ``"b.pendulum"``; one that exists is replaced.
    measures : bool, optional
        Write what AUTO writes of periodic solutions, in place of norm and state at one point: the norm over the period,
        the square root of the mean of the squares of all state variables, and the maxima, called ``MAX_x``.  NaN for
        angles that make full rotations.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    TypeError
        For anything else.
    OSError
        If the file cannot be written.

    References
    ----------
    Doedel, Oldeman et al., *AUTO-07P: Continuation and Bifurcation Software for Ordinary Differential Equations*
    (2012), section 3.5 (user-readable output files).

    Examples
    --------
    >>> import tempfile
    >>> from cellmap import continue_orbit, discrete_map, periodic_orbit
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 2.0}, ("x",))
    >>> branch = continue_orbit(logistic, periodic_orbit(logistic, [0.5]), "r", 1.5, 3.5, step=0.1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lines = save_auto(branch, f"{folder}/b.logistic").read_text().splitlines()
    >>> [line[:38] for line in lines if line[10:14] == "   7"]
    ['   1   -12   7    2   3.0000000000E+00']
    """
    target = as_target("path", path)
    given: tuple[Any, ...] = tuple(result) if is_sequence(result) else (result,)  # type: ignore[arg-type]
    if not given or not all(isinstance(item, Branch | BifurcationCurve | TangencyCurve) for item in given):
        raise TypeError(f"result={shown(result)}: give a Branch, a BifurcationCurve, a TangencyCurve, or several")
    lines, label = [], 0
    for number, item in enumerate(given, 1):
        rows = _of_tangencies(item) if isinstance(item, TangencyCurve) else _of_orbits(item, measures)
        lines += [f"   0    {rows.heading}", "   0    PT  TY  LAB " + "".join(f"{name:<19s}" for name in rows.names)]
        for k, values in enumerate(rows.values):
            label += int(rows.types[k] != 0)
            point = (k % _LARGEST + 1) * (-1 if rows.stable[k] else 1)
            start = f"{number:4d}{point:6d}{rows.types[k]:4d}{label if rows.types[k] else 0:5d}"
            lines.append(start + "".join(f"{value:19.10E}" for value in values))
    write_whole(target, ("\n".join(lines) + "\n").encode())
    return target


def _of_orbits(result: Branch | BifurcationCurve, measures: bool) -> _Rows:
    names: tuple[str, ...]
    found: tuple[Bifurcation | FunctionZero, ...]
    if isinstance(result, Branch):
        names, found, heading = (result.parameter,), result.special_points, f"period {result.period} orbits"
    else:
        names, found = result.parameters, result.zeros
        heading = f"curve of {result.kind}, period {result.period}"
    exact, places = result.point_map, np.array([b.place for b in found], np.int64) + 1
    here = np.array([np.append(b.point, b.value if isinstance(b, Bifurcation) else b.values) for b in found])
    states = np.column_stack([result.points, result.values])
    states = np.insert(states, places, here.reshape(-1, states.shape[1]), axis=0)
    points, values = states[:, : exact.dimension], states[:, exact.dimension :]
    types, stable = np.zeros(len(result.values), np.int64), unstable_count(result.multipliers) == 0
    types[[0, -1]] = [_end(end) for end in result.ends]
    kinds = [TYPES.get(b.kind, 0) if isinstance(b, Bifurcation) else _USER for b in found]
    before = [b.before if isinstance(b, Bifurcation) else b.unstable for b in found]
    columns = (
        _measured(exact, tuple(names), values, points, result.period)
        if measures
        else _columns(names, values, points, exact.coordinates)
    )
    types, stable = np.insert(types, places, kinds), np.insert(stable, places, np.equal(before, 0))
    return _Rows([*columns], np.column_stack([*columns.values()]), stable, types, heading)


def _of_tangencies(curve: TangencyCurve) -> _Rows:
    types = np.zeros(len(curve.values), np.int64)
    types[[0, -1]] = [_end(end) for end in curve.ends]
    points = curve.points[:, curve.points.shape[1] // 2]
    columns = _columns(curve.parameters, curve.values, points, curve.coordinates)
    return _Rows([*columns], np.column_stack([*columns.values()]), np.zeros(len(types), bool), types, "tangencies")


def _columns(
    names: Sequence[str],
    values: Floats,
    states: Floats,
    coordinates: Sequence[Coordinate],
    norm: Floats | None = None,
    before: str = "",
) -> dict[str, Floats]:
    first, *others = zip(names, values.T, strict=True)
    size = np.linalg.norm(states, axis=1) if norm is None else norm
    shown_as = [f"{before}{c.name}" for c in coordinates]
    columns = [first, ("L2-NORM", size), *zip(shown_as, states.T, strict=True), *others]
    return {re.sub(r"\s", "_", name)[:18]: column for name, column in columns}


def _measured(exact: PointMap, names: Sequence[str], values: Floats, points: Floats, period: int) -> dict[str, Floats]:
    """Return the columns that AUTO has for periodic solutions."""
    norms, largest = (
        np.column_stack([measured(exact, tuple(names), values, points, period, j, m) for j in range(exact.dimension)])
        for m in ("norm", "maximum")
    )
    return _columns(names, values, largest, exact.coordinates, np.linalg.norm(norms, axis=1), "MAX_")


def _end(reason: str) -> int:
    return _FAILED if reason == "no convergence" else _END
