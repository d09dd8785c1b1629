"""Figures of basins, and of the evidence for labels, with matplotlib; small images of basins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from typing import Any

import matplotlib.image
import numpy as np
from matplotlib.axes import Axes

from .._lib.arrays import Floats
from .._lib.checks import shown
from ..basins.by_features import FeatureBasins
from ..basins.certification.certificate import Certificate, Evidence
from ..basins.record import Basins
from ..maps.grid import CellGrid
from ..orbits.attractor import Kind
from ._axes import axes_or_new, label_axis, legend_below, name_axes, pair_of, plane_of, short_name, show_cells, symbol
from ._colours import label_colours
from ._draw import figure
from ._reduced import SymmetryReduction, reduction_of


@figure
def basins(
    basins: Basins | FeatureBasins,
    *,
    ax: Axes | None = None,
    colours: Mapping[int, Any] | None = None,
    shade: bool = False,
    show_attractors: bool = True,
    legend: bool = True,
    plane: tuple[int | str, int | str] | None = None,
    reference: int | str | Sequence[int | str] | None = None,
) -> Axes:
    """Draw basins of attraction.

    Parameters
    ----------
    basins : Basins or FeatureBasins
        Basins on a grid with one or two axes of more than one cell, further axes of one cell make it a slice; or of any
        list of initial conditions, which is drawn as points.  A grid with one such axis is drawn as a strip.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    colours : mapping of int to colour, optional
        Colours of some labels; others keep the default ones.
    shade : bool, optional
        Draw initial conditions with long settling times in lighter colours; FeatureBasins have none.
    show_attractors : bool, optional
        Mark the attractors' points.
    legend : bool, optional
        Name each attractor with the fraction of its basin.
    plane : tuple of int or str, optional
        Coordinates across and up of initial conditions that are no grid; by default the first two.
    reference : int, str or sequence of them, optional
        Of attractors with a continuous symmetry, a coordinate for each of its directions that states are shifted to
        0 in: others are drawn as differences to it, as angles where all may turn together.  On a grid, which has to
        hold it, attractors are drawn where it has the grid's value.

    Returns
    -------
    matplotlib Axes
        The axes; angles are in multiples of pi.

    Raises
    ------
    ValueError
        For basins on a grid with three or more axes of more than one cell, and for a `reference` that the symmetry does
        not shift, or that is on an axis.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> halves = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
    >>> plot.basins(find_basins(halves, CellGrid((-1, -1), (1, 1), (8, 8)))).get_xlabel()
    '$x$'
    """
    wide = _coordinates_of_axes(basins, plane)
    reduced = None if reference is None else reduction_of(basins, reference)
    if reduced is not None and {*reduced.references} & {*wide}:
        raise ValueError(f"reference={shown(reference)}: it is on an axis; give another one, or another plane")
    ax = axes_or_new(ax, (7.0, 5.5))
    palette = label_colours(basins.fractions, colours)
    if basins.grid is None:
        _show_points(ax, basins, palette, wide, reduced)
    elif len(wide) == 1:
        _show_strip(ax, basins, painted(basins, palette, shade), basins.grid, wide[0])
    else:
        show_cells(ax, painted(basins, palette, shade), basins.grid, basins.coordinates)
    if show_attractors:
        _mark_attractors(ax, basins, wide, reduced)
    if legend:
        fractions = {k: _percent(f.fraction) for k, f in basins.fractions.items()}
        legend_below(
            ax, [(palette[k], f"{short_name(basins.label_name(k), k, lines=2)}: {s}") for k, s in fractions.items()]
        )
    ax.set_title(basins.name + _where(basins))
    return ax


def _where(basins: Basins | FeatureBasins) -> str:
    """Return the part of a title that names the coordinates that a slice holds, where there are few."""
    grid = basins.grid
    fixed = [j for j, n in enumerate(grid.shape) if n == 1] if grid is not None else []
    if grid is None or not 0 < len(fixed) <= 2:
        return ""
    held = ((basins.coordinates[j], grid.axis(j)[0] + 0.0) for j in fixed)
    return f", {', '.join(f'{symbol(c.name)} = {value:.4g} {c.unit}'.rstrip() for c, value in held)}"


def _coordinates_of_axes(basins: Basins | FeatureBasins, plane: tuple[int | str, int | str] | None) -> list[int]:
    """Return the one or two coordinates along the axes of a figure."""
    if basins.grid is None:
        one = len(basins.coordinates) == 1
        return [0] if one else list(pair_of("plane", (0, 1) if plane is None else plane, basins.coordinates))
    if plane is not None:
        raise ValueError(f"plane={plane!r}: a grid has its own axes; leave plane= to lists of initial conditions")
    wide = [j for j, n in enumerate(basins.grid.shape) if n > 1]
    if len(wide) != 1:
        plane_of(basins)
    return wide


def _show_points(
    ax: Axes,
    basins: Basins | FeatureBasins,
    palette: Mapping[int, Any],
    wide: list[int],
    reduced: SymmetryReduction | None,
) -> None:
    """Draw initial conditions as points."""
    points = np.asarray(basins.initial_conditions).reshape(-1, len(basins.coordinates))
    points, axes = (points, basins.coordinates) if reduced is None else (reduced.shifted(points), reduced.axes())
    labels = basins.labels.ravel()
    size = float(np.clip(250.0 / np.sqrt(len(labels)), 1.5, 8.0))
    for label, colour in palette.items():
        ax.plot(*_across(points[labels == label], wide), ".", markersize=size, color=colour)
    name_axes(ax, [axes[j] for j in wide], np.ptp(points[:, wide], axis=0).tolist())
    if len(wide) == 1:
        ax.set_yticks([])


def _show_strip(ax: Axes, basins: Basins | FeatureBasins, colours: Floats, grid: CellGrid, j: int) -> None:
    """Draw a line of cells along one coordinate as a strip of colours."""
    ends = (grid.lower[j], grid.upper[j])
    ax.imshow(colours.reshape(1, -1, 3), extent=(*ends, -0.5, 0.5), aspect="auto", interpolation="nearest")
    label_axis(ax.xaxis, basins.coordinates[j], ends[1] - ends[0])
    ax.set_yticks([])


def painted(basins: Basins | FeatureBasins, palette: Mapping[int, Any], shade: bool) -> Floats:
    """Colours of all cells, rows from bottom to top."""
    labels = np.squeeze(basins.labels).T
    image = np.empty((*labels.shape, 3))
    for label, colour in palette.items():
        image[labels == label] = colour
    if shade and isinstance(basins, Basins) and (basins.settling_time > 0).any():
        times = np.squeeze(basins.settling_time).T
        lateness = np.log1p(np.maximum(times, 0)) / np.log1p(times.max())
        image += (1.0 - image) * (0.7 * np.where(times >= 0, lateness, 0.0))[..., None]
    return image


def _mark_attractors(
    ax: Axes, basins: Basins | FeatureBasins, wide: list[int], reduced: SymmetryReduction | None
) -> None:
    """Draw the points of attractors that lie in the window; a chaotic, quasi-periodic or unknown one as a cloud."""
    if isinstance(basins, FeatureBasins):
        for points in basins.representatives:
            ax.plot(*_across(points, wide), ".", markersize=3, color="black", scalex=False, scaley=False)
        return
    grid = basins.grid
    held = 0.0 if grid is None or reduced is None else np.array([grid.axis(j)[0] for j in reduced.references])
    for attractor in basins.attractors:
        points = attractor.points if reduced is None else reduced.shifted(attractor.points, held)
        places = np.stack(_across(points, wide), axis=-1)
        if attractor.kind in (Kind.CHAOTIC, Kind.QUASIPERIODIC):
            alpha = 0.5 if attractor.kind is Kind.CHAOTIC else 1.0
            ax.plot(*places.T, ",", color="black", alpha=alpha, scalex=False, scaley=False)
            continue
        for k, j in enumerate(wide):
            turn = basins.coordinates[j].period
            if turn is not None:  # a point on the branch cut is seen at both ends
                places = np.concatenate([places + n * turn * np.eye(2)[k] for n in (-1, 0, 1)])
        style = {"marker": "o", "markersize": 5, "markerfacecolor": "white", "markeredgecolor": "black"}
        ax.plot(*places.T, linestyle="none", scalex=False, scaley=False, **style)  # type: ignore[arg-type]


def _across(points: Floats, wide: list[int]) -> tuple[Floats, Floats]:
    """Return where points lie on the axes; a single axis runs through the middle of a strip."""
    return points[:, wide[0]], points[:, wide[1]] if len(wide) == 2 else np.zeros(len(points))


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2f} %" if fraction > 0.0005 or fraction == 0 else f"{100 * fraction:.2g} %"


EVIDENCE_COLOURS = {
    Evidence.CELL: (0.90, 0.93, 0.97),
    Evidence.ORBIT: (0.62, 0.75, 0.88),
    Evidence.EXACT: (0.98, 0.75, 0.35),
    Evidence.OPEN: (0.75, 0.15, 0.15),
    Evidence.DIRECT: (0.55, 0.55, 0.55),
    Evidence.PROVED: (0.45, 0.72, 0.50),
}
_EVIDENCE_NAMES = {
    Evidence.CELL: "by the cell of the interpolation grid",
    Evidence.ORBIT: "by the orbit and its error",
    Evidence.EXACT: "recomputed exactly",
    Evidence.OPEN: "recomputed, undecided",
    Evidence.DIRECT: "integrated without bounds of errors",
    Evidence.PROVED: "proved by interval arithmetic",
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
    '$x$'
    """
    basins = certificate.basins
    grid = plane_of(basins)
    ax = axes_or_new(ax, (7.0, 5.5))
    palette = np.array([EVIDENCE_COLOURS[evidence] for evidence in Evidence])
    show_cells(ax, palette[np.squeeze(certificate.evidence).T], grid, basins.coordinates)
    fractions = np.bincount(certificate.evidence.ravel(), minlength=len(Evidence)) / certificate.evidence.size
    legend_below(ax, [(EVIDENCE_COLOURS[e], f"{_EVIDENCE_NAMES[e]}: {100 * fractions[e]:.3g} %") for e in Evidence])
    ax.set_title(f"{basins.name}: evidence for labels")
    return ax


_PIXELS = 128  # pixels along the longer side of a small image


def thumbnail(basins: Basins) -> bytes | None:
    """Return a PNG of at most 128 x 128 initial conditions, evenly spread; None for basins that are no plane.

    No figure is made, so that those of pyplot stay as they are.
    """
    if basins.grid is None or sum(n > 1 for n in basins.grid.shape) != 2:
        return None
    few = tuple(slice((n % step) // 2, None, step) for n, step in ((n, -(-n // _PIXELS)) for n in basins.labels.shape))
    small = replace(basins, labels=basins.labels[few], settling_time=basins.settling_time[few])
    image = painted(small, label_colours(basins.fractions), shade=False)
    file = BytesIO()
    matplotlib.image.imsave(file, np.ascontiguousarray(image[::-1]), format="png")
    return file.getvalue()
