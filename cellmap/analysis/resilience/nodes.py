"""Single-node basin stability: which node of a network a disturbance may hit without its leaving the basin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import check_mapping, shown, whole_number
from ..._lib.randomness import Rng, random_numbers
from ..._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Layout
from ..._lib.signatures import checked
from ...attractors.settling.labels import Label
from ...basins.classification import labeller
from ...basins.record import Basins
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, distinct_names
from .basin_statistics import basin_stability
from .random_states import random_box


@dataclass(frozen=True, eq=False)
class NodeStability(ConvertsToXarray, ConvertsToDataFrame):
    """Single-node basin stability of an attractor, with its linear stability.

    Parameters
    ----------
    attractor : str
        Name of the attractor.
    nodes : tuple of str
        Names of the nodes.
    fractions, standard_errors, low, high : ndarray, shape (nodes,)
        Fraction of the disturbances of each node after which the orbit returns to the attractor, its standard error and
        its confidence interval; the interval is valid wherever undecided orbits converge.
    undecided : ndarray of int, shape (nodes,)
        Number of disturbances after which the orbit had not converged; they count as not returning.
    n_samples : int
        Number of disturbances of each node.
    exponent : float
        Largest Lyapunov exponent of the attractor per step of the map, its linear stability: below 0, and small
        disturbances decay by its exponential in each step.
    confidence : float
        Confidence level of each interval.
    """

    _layout: ClassVar = Layout(
        "Single-node basin stability of {0.attractor}",
        {"nodes": Array("node", "node")},
        {name: Array("node") for name in ("fractions", "standard_errors", "low", "high", "undecided")},
    )

    attractor: str
    nodes: tuple[str, ...]
    fractions: Floats
    standard_errors: Floats
    low: Floats
    high: Floats
    undecided: Ints
    n_samples: int
    exponent: float
    confidence: float

    def __repr__(self) -> str:
        rows = zip(self.nodes, self.fractions, self.standard_errors, strict=True)
        parts = "; ".join(f"{node} {fraction:.4g} +- {error:.2g}" for node, fraction, error in rows)
        return f"NodeStability({self.attractor}, exponent {self.exponent:.4g}: {parts})"


@checked
def node_stability(
    source: Basins | PointMap,
    label: int,
    nodes: Mapping[str, Any],
    n_samples: int = 1000,
    attractors: Sequence[Attractor] = (),
    *,
    rng: Rng = 0,
    confidence: float = 0.95,
    method: str = "exact",
    point_map: PointMap | None = None,
    max_periods: int | None = None,
) -> NodeStability:
    r"""Compute single-node basin stability: how probably an attractor survives a disturbance of one node of a network.

    For a node k it is :math:`S_k = \int_B \rho(x_k) \prod_{j \ne k} \delta(x_j - a_j) \, dx` for a state a of the
    attractor with the basin B.

    For each node, states are drawn in which the coordinates of this node are random and all others are those of the
    attractor; the fraction that returns is :func:`basin_stability` of that distribution.

    Parameters
    ----------
    source : Basins or PointMap
        Basins with their map, or a map with its `attractors`.
    label : int
        Label of the attractor.
    nodes : mapping of str to mapping or callable
        For each node, by name, the ranges of its coordinates as for :func:`random_box`, or a distribution, such as one
        of :func:`random_ball`.
    n_samples : int, optional
        Number of disturbances of each node.
    attractors : sequence of Attractor, optional
        Attractors of a map.  Where only the one of interest is given, orbits to all others are followed for
        `max_periods` and are undecided.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the draws.
    confidence : float, optional
        Confidence level of each interval separately.
    method : {"exact", "Wilson"}, optional
        Method of the interval, see :func:`binomial_interval`.
    point_map : PointMap, optional
        Map to use instead of the exact one of the basins, such as an interpolated map.
    max_periods : int, optional
        Number of periods after which a state is undecided.

    Returns
    -------
    NodeStability
        Fractions with their errors, and the linear stability of the attractor.

    Raises
    ------
    TypeError, ValueError
        For basins without their map, no such attractor, or ranges of what is no coordinate.

    References
    ----------
    Menck, Heitzig, Marwan, Kurths, Nature Physics 9 (2013) 89; Menck, Heitzig, Kurths, Schellnhuber, Nature
    Communications 5 (2014) 3969.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> two = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> basins = find_basins(two, CellGrid((-1.5, -1), (1.5, 1), (20, 20)))
    >>> node_stability(basins, 0, {"first": {"x": (-1.5, 1.5)}, "second": {"y": (-1, 1)}})
    NodeStability(fixed point (1, 0), exponent -0.6931: first 0.527 +- 0.016; second 1 +- 0)
    """
    known = labeller(source, attractors, point_map, max_periods).attractors
    own = known[whole_number("label", label, at_most=len(known) - 1)]
    check_mapping("nodes", nodes, "of names of nodes to their coordinates")
    if not nodes:
        raise ValueError("nodes is empty: give the coordinates of at least one node")
    numbers, found = random_numbers(rng), []
    for node, given in nodes.items():
        if not isinstance(given, Mapping) and not callable(given):
            raise TypeError(f"nodes[{node!r}]={shown(given)}: give ranges of coordinates by name, or a distribution")
        states = random_box(own, given) if isinstance(given, Mapping) else given
        found.append(
            basin_stability(
                source,
                states,
                n_samples,
                attractors,
                rng=numbers,
                confidence=confidence,
                method=method,
                point_map=point_map,
                max_periods=max_periods,
            )
        )
    fractions = [each.fractions[label] for each in found]
    return NodeStability(
        distinct_names(known)[label],
        tuple(map(str, nodes)),
        np.array([s.fraction for s in fractions]),
        np.array([s.standard_error for s in fractions]),
        np.array([s.low for s in fractions]),
        np.array([s.high for s in fractions]),
        np.array([np.count_nonzero(each.labels == Label.UNDECIDED) for each in found]),
        len(found[0].labels),
        float(own.exponents[0]),
        confidence,
    )
