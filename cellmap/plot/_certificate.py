"""Figures of the evidence for labels, with matplotlib."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..basins.certification.certificate import Certificate, Evidence
from ._axes import axes_or_new, legend_below, plane_of, show_cells
from ._draw import figure

_COLOURS = {
    Evidence.CELL: (0.90, 0.93, 0.97),
    Evidence.ORBIT: (0.62, 0.75, 0.88),
    Evidence.EXACT: (0.98, 0.75, 0.35),
    Evidence.OPEN: (0.75, 0.15, 0.15),
}
_NAMES = {
    Evidence.CELL: "by the cell of the interpolation grid",
    Evidence.ORBIT: "by the orbit and its error",
    Evidence.EXACT: "recomputed exactly",
    Evidence.OPEN: "recomputed, undecided",
}


@figure
def certificate(certificate: Certificate, *, ax: Axes | None = None) -> Axes:
    """Draw the evidence for each label of a basin image.

    Parameters
    ----------
    certificate : Certificate
        Certificate of basins on a grid with two axes of more than one cell.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes.

    Raises
    ------
    ValueError
        For basins that are not on a grid with two axes.

    Examples
    --------
    >>> from cellmap import CellGrid, certify, discrete_map, find_basins, interpolated_map, plot
    >>> exact = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
    >>> grid = CellGrid((-1, -1), (1, 1), (8, 8))
    >>> plot.certificate(certify(find_basins(interpolated_map(exact, grid), grid))).get_xlabel()
    'x'
    """
    basins = certificate.basins
    grid = plane_of(basins)
    ax = axes_or_new(ax, (7.0, 5.5))
    palette = np.array([_COLOURS[evidence] for evidence in Evidence])
    show_cells(ax, palette[np.squeeze(certificate.evidence).T], grid, basins.coordinates)
    fractions = np.bincount(certificate.evidence.ravel(), minlength=len(Evidence)) / certificate.evidence.size
    legend_below(ax, [(_COLOURS[e], f"{_NAMES[e]}: {100 * fractions[e]:.3g} %") for e in Evidence])
    ax.set_title(f"{basins.name}: evidence for labels")
    return ax
