"""What systems on networks share: nodes that are counted from 1, lines between them, a harmonic force, a period."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi
from typing import Any

from cellmap.utils import check_length, shown, whole_number

from .quantities import is_iterable, sized_number

Lines = tuple[tuple[int, int], ...]


def numbers_of_nodes(name: str, values: Any, **bounds: float) -> tuple[float, ...]:
    """Return one finite number for each node.

    Parameters
    ----------
    name : str
        Name of the argument, for errors.
    values : sequence of float
        Numbers, at least one.
    **bounds : float
        Bounds of each number, as for :func:`cellmap.utils.finite_number`.

    Returns
    -------
    tuple of float
        The numbers.

    Raises
    ------
    TypeError, ValueError
        For no sequence, an empty one, or numbers that are not finite or out of their bounds.

    Examples
    --------
    >>> numbers_of_nodes("powers", [1, -0.5])
    (1.0, -0.5)
    """
    check_length(name, values)
    if not is_iterable(values) or not (given := tuple(values)):
        raise TypeError(f"{name}={shown(values)}: give a sequence with one number for each node")
    return tuple(sized_number(f"{name}[{k}]", v, **bounds) for k, v in enumerate(given))


def lines_between(lines: Iterable[Any], nodes: int) -> Lines:
    """Return lines of a network, the smaller node first, sorted; node 0 is a bus, others are counted from 1.

    Parameters
    ----------
    lines : iterable of pairs of int
        The two nodes of each line.
    nodes : int
        Number of nodes without the bus.

    Returns
    -------
    tuple of pairs of int
        The lines.

    Raises
    ------
    TypeError, ValueError
        For what is no pair of two different nodes, and for lines that are given twice.

    Examples
    --------
    >>> lines_between([(2, 1), (0, 1)], 2)
    ((0, 1), (1, 2))
    """
    check_length("lines", lines)
    if not is_iterable(lines):
        raise TypeError(f"lines={shown(lines)}: give pairs of nodes")
    found = []
    for k, line in enumerate(lines):
        ends = tuple(line) if is_iterable(line) else ()
        if len(ends) != 2:
            raise TypeError(f"lines[{k}]={shown(line)}: give the two nodes of the line")
        a, b = sorted(whole_number(f"lines[{k}]", end, at_most=nodes) for end in ends)
        if a == b or (a, b) in found:
            raise ValueError(f"lines[{k}]={shown(line)}: give two different nodes, and each line once")
        found.append((a, b))
    return tuple(sorted(found))


def forcing_period(p: Any) -> float:
    """Return 2 pi / frequency.

    Parameters
    ----------
    p : record
        Parameters with `frequency`.

    Returns
    -------
    float
        The period.
    """
    return 2.0 * pi / p.frequency
