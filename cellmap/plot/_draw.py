"""The figure of a result, whatever it is of."""

from __future__ import annotations

import importlib
from typing import Any

from matplotlib.axes import Axes

from .._lib.checks import shown

FIGURES = {
    "ArnoldTongue": "arnold_tongues",
    "AttractorAtlas": "attractor_atlas",
    "Basins": "basins",
    "BasinContinuation": "basin_continuation",
    "BasinEntropy": "basin_entropy",
    "BasinStability": "basin_stability",
    "BifurcationCurve": "bifurcation_curves",
    "BifurcationDiagram": "bifurcation_diagram",
    "BoundaryDistance": "boundary_distance",
    "BoxCount": "fit",
    "BoxSet": "boxes",
    "Branch": "branches",
    "CellChain": "absorption",
    "CellMapping": "cell_mapping",
    "Certificate": "certificate",
    "ChaosTest": "chaos_test",
    "ChaoticSaddle": "chaotic_saddle",
    "CircleBranch": "invariant_circles",
    "ConnectionBranch": "connections",
    "CorrelationSum": "fit",
    "CovariantVectors": "covariant_vectors",
    "EdgeOrbit": "edge_orbit",
    "EscapeRate": "fit",
    "ExponentField": "exponent_field",
    "FeatureBasins": "basins",
    "Fit": "fit",
    "FractalTest": "basin_entropy",
    "GeneralizedDimensions": "generalized_dimensions",
    "KaplanYorke": "kaplan_yorke",
    "LyapunovSpectrum": "lyapunov_spectrum",
    "Manifold": "manifolds",
    "MergingTest": "wada",
    "MorseGraph": "morse_graph",
    "Plan": "plan",
    "SettlingStatistics": "settling_times",
    "StabilityMap": "stability_map",
    "TippingProbabilities": "tipping",
    "Trajectory": "time_series",
    "TransferOperator": "eigenvalues",
    "UncertaintyExponent": "uncertainty_exponent",
    "WadaGrid": "wada",
}
"""The function that draws a record, by the name of its class, so that no class has to be imported."""

WITH_BASINS = {"Ball": "ball", "FatalShock": "fatal_shock"}
"""Records that are drawn on basins, which have to be given."""

_LIBRARY = __name__.split(".")[0]


def draw(result: Any, *, ax: Axes | None = None, **options: Any) -> Axes | tuple[Axes, ...]:
    """Draw a result by the function of `cellmap.plot` for its type.

    Parameters
    ----------
    result : record of cellmap
        Basins, Branch, BifurcationDiagram, StabilityMap, Trajectory, ...: anything for which there is a figure.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    **options
        Arguments of that function.  A Ball and a FatalShock need `basins`.

    Returns
    -------
    matplotlib Axes, or tuple of them
        What that function returns: its axes, or those of all panels where it draws several.

    Raises
    ------
    TypeError
        For anything that has no figure; the message lists what has one.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> halves = discrete_map(lambda x, p: (x[0] - 0.1 * x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"))
    >>> plot.draw(find_basins(halves, CellGrid((-1, -1), (1, 1), (8, 8)))).get_xlabel()
    'x'
    """
    known = {**FIGURES, **WITH_BASINS}
    for kind in type(result).__mro__:
        if kind.__module__.split(".")[0] == _LIBRARY and kind.__name__ in known:
            if kind.__name__ in WITH_BASINS and "basins" not in options:
                raise TypeError(f"basins is missing: a {kind.__name__} is drawn on basins, so give them as basins=")
            figure = getattr(importlib.import_module(_LIBRARY + ".plot"), known[kind.__name__])
            drawn: Axes | tuple[Axes, ...] = figure(result, ax=ax, **options)
            return drawn
    raise TypeError(f"result={shown(result)}: there is no figure of it; give one of {', '.join(sorted(known))}")
