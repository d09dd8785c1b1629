"""Measured points of a stability curve, least amplitudes over frequency: in files, from volts, against a curve."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from cellmap.utils import as_target, monotone_values, written_whole

from ..arrays import Floats
from ..time_series import real_numbers
from .voltage_conversion import STANDARD_GRAVITY, VOLTS_PER_G, displacement_amplitude, displacement_error

HEADING = ("frequency_hz", "amplitude_mm", "amplitude_error_mm")


@dataclass(frozen=True, eq=False)
class StabilityPoints:
    """Least amplitudes at which one rod stays up, as measured.

    Parameters
    ----------
    frequencies : ndarray, shape (n,)
        Frequencies of the drive (Hz), above 0.
    amplitudes : ndarray, shape (n,)
        Amplitudes of the pivot (m), above 0.
    amplitude_errors : ndarray, shape (n,), or None
        Standard errors of the amplitudes (m), above 0, if they are known.
    rod : str, optional
        Name of the rod.

    Raises
    ------
    TypeError, ValueError
        For arrays of other shapes, and numbers that are not finite and above 0.

    Examples
    --------
    >>> StabilityPoints(np.array([15.0, 35.0]), np.array([8.3e-3, 3.5e-3]), None, "3.1 cm")
    StabilityPoints(3.1 cm: 2 points, 15 to 35 Hz)
    """

    frequencies: Floats
    amplitudes: Floats
    amplitude_errors: Floats | None = None
    rod: str = ""

    def __post_init__(self) -> None:
        count = np.size(self.frequencies)
        for name in ("frequencies", "amplitudes", "amplitude_errors"):
            given = getattr(self, name)
            if given is None and name == "amplitude_errors":
                continue
            values = real_numbers(f"{name}={given!r}", given)
            if values.shape != (count,) or not count:
                raise ValueError(f"{name} have the shape {values.shape}: give one number for each point, at least one")
            if not (np.isfinite(values) & (values > 0.0)).all():
                raise ValueError(
                    f"{name} hold {values[~(np.isfinite(values) & (values > 0.0))][0]}: give positive numbers alone"
                )
            object.__setattr__(self, name, values)

    def __repr__(self) -> str:
        errors = "" if self.amplitude_errors is None else " with errors"
        return (
            f"StabilityPoints({self.rod + ': ' if self.rod else ''}{len(self.frequencies)} points{errors}, "
            f"{self.frequencies.min():g} to {self.frequencies.max():g} Hz)"
        )

    @property
    def table(self) -> Floats:
        """Rows of frequency (Hz), amplitude (m) and, if known, its error (m): what a stability map draws."""
        columns = [self.frequencies, self.amplitudes]
        return np.stack(columns if self.amplitude_errors is None else [*columns, self.amplitude_errors], axis=-1)


def read_stability_points(path: str | Path, rod: str = "") -> StabilityPoints:
    """Read points from a table with the heading frequency_hz,amplitude_mm or, with errors, ...,amplitude_error_mm.

    Parameters
    ----------
    path : str or Path
        File of comma-separated values, a row for each point.
    rod : str, optional
        Name of the rod.

    Returns
    -------
    StabilityPoints
        Points in the order of the rows.

    Raises
    ------
    ValueError
        For another heading, rows of another length, no rows, and fields that are not positive numbers.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "points.csv"
    ...     write_stability_points(StabilityPoints(np.array([15.0]), np.array([8.25e-3])), path)
    ...     print(path.read_text().split(), read_stability_points(path))
    ['frequency_hz,amplitude_mm', '15.0,8.25'] StabilityPoints(1 points, 15 to 15 Hz)
    """
    try:
        lines = [line for line in Path(path).read_text(encoding="utf-8-sig").splitlines() if line.strip(", \t")]
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: it is no text in UTF-8 with comma-separated values: {error}") from None
    heading = tuple(name.strip(' "') for name in lines[0].split(",")) if lines else ()
    if heading not in (HEADING[:2], HEADING):
        raise ValueError(f"{path}: its heading must be {','.join(HEADING[:2])}, or {','.join(HEADING)}")
    wrong = f"{path}: give positive numbers alone, in rows of {len(heading)}"
    try:
        table = np.array(list(csv.reader(lines[1:])), dtype=float)
    except (ValueError, csv.Error):
        raise ValueError(wrong) from None
    if table.ndim != 2 or table.shape[1] != len(heading) or not (np.isfinite(table) & (table > 0.0)).all():
        raise ValueError(wrong)
    errors = 1e-3 * table[:, 2] if len(heading) == 3 else None
    return StabilityPoints(table[:, 0], 1e-3 * table[:, 1], errors, rod)


def write_stability_points(points: StabilityPoints, path: str | Path) -> None:
    """Write points to a table, with errors if they are known.

    Parameters
    ----------
    points : StabilityPoints
        What to write.
    path : str or Path
        File; an old one is replaced, by a whole one or not at all.

    Raises
    ------
    TypeError, OSError
        For a path that is none, or in no folder.
    """
    table = points.table * np.array([1.0, 1e3, 1e3][: points.table.shape[1]])
    with written_whole(as_target("path", path)) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADING[: table.shape[1]])
        # Ten digits are more than any sensor has, and free of the rounding of the change of units.
        writer.writerows([[repr(float(f"{value:.10g}")) for value in row] for row in table.tolist()])


def stability_points_from_volts(
    frequencies: ArrayLike,
    peak_to_peak_volts: ArrayLike,
    volts_error: ArrayLike | None = None,
    frequency_error: ArrayLike = 0.0,
    volts_per_g: float = VOLTS_PER_G,
    standard_gravity: float = STANDARD_GRAVITY,
    rod: str = "",
) -> StabilityPoints:
    """Return points from what an oscilloscope showed, by the report's (21).

    Parameters
    ----------
    frequencies : array_like, shape (n,)
        Frequencies (Hz).
    peak_to_peak_volts : array_like, shape (n,)
        Volts of the accelerometer, peak to peak, where the rod first stayed up.
    volts_error : array_like, shape (n,) or (), optional
        Standard errors of the volts; without them the points have none.
    frequency_error : array_like, shape (n,) or (), optional
        Standard errors of the frequencies (Hz); used only with those of the volts.
    volts_per_g, standard_gravity, rod : optional
        As for :func:`systems.lab.shaker.voltage_conversion.displacement_amplitude` and :class:`StabilityPoints`.

    Returns
    -------
    StabilityPoints
        Points.

    Raises
    ------
    TypeError, ValueError
        As :func:`systems.lab.shaker.voltage_conversion.displacement_amplitude` and :class:`StabilityPoints`.

    Examples
    --------
    >>> stability_points_from_volts([15.0, 35.0], [1.5, 3.5], volts_error=0.02).amplitudes
    array([0.00827..., 0.00354...])
    """
    amplitudes = displacement_amplitude(peak_to_peak_volts, frequencies, volts_per_g, standard_gravity)
    errors = None
    if volts_error is not None:
        errors = displacement_error(
            peak_to_peak_volts, frequencies, volts_error, frequency_error, volts_per_g, 0.0, standard_gravity
        )
    return StabilityPoints(np.asarray(frequencies, dtype=float), amplitudes, errors, rod)


@dataclass(frozen=True, eq=False)
class BoundaryComparison:
    """Measured points against a computed curve; NaN for points where there is no curve.

    Parameters
    ----------
    expected : ndarray, shape (n,)
        Amplitudes of the curve at the measured frequencies (m).
    residuals, ratios : ndarray, shape (n,)
        Measured less expected (m), and measured over expected.
    compared : int
        Number of points within the curve.
    rms : float
        Root mean square of the residuals (m); NaN if nothing was compared.
    chi_square, p_value : float
        Sum of squares in units of the standard errors, and the probability of a greater one if the curve is true and
        errors are normal and independent (Pearson 1900); NaN without errors.  Nothing is fitted, so that there are as
        many degrees of freedom as points compared.
    """

    expected: Floats
    residuals: Floats
    ratios: Floats
    compared: int
    rms: float
    chi_square: float
    p_value: float

    def __repr__(self) -> str:
        return (
            f"BoundaryComparison({self.compared} of {len(self.expected)} points, rms {self.rms:.3g} m, "
            f"chi-square {self.chi_square:.4g}, p {self.p_value:.2g})"
        )


def compare_with_boundary(
    points: StabilityPoints, frequencies: ArrayLike, boundary_amplitudes: ArrayLike
) -> BoundaryComparison:
    """Compare measured points with a computed curve, which is interpolated as a power law from node to node.

    Parameters
    ----------
    points : StabilityPoints
        Measured points.
    frequencies : array_like, shape (m,)
        Frequencies of the curve (Hz), above 0, increasing or decreasing.
    boundary_amplitudes : array_like, shape (m,)
        Its amplitudes (m), above 0; NaN where there is none.

    Returns
    -------
    BoundaryComparison
        Residuals, ratios, and how likely they are.

    Raises
    ------
    TypeError, ValueError
        For a curve of another shape, or numbers out of bounds.

    References
    ----------
    Pearson, Philosophical Magazine 50 (1900) 157.

    Examples
    --------
    >>> points = StabilityPoints(np.array([15.0, 20.0, 50.0]), np.array([4.1, 2.9, 1.0]), np.array([0.1, 0.1, 0.1]))
    >>> compare_with_boundary(points, [10.0, 30.0], [6.0, 2.0]).residuals.round(12)
    array([ 0.1, -0.1,  nan])
    """
    if not isinstance(points, StabilityPoints):
        raise TypeError(f"points={points!r}: give StabilityPoints")
    nodes = monotone_values("frequencies", frequencies)
    curve = real_numbers("boundary_amplitudes", boundary_amplitudes)
    if curve.shape != nodes.shape:
        raise ValueError(
            f"boundary_amplitudes have the shape {curve.shape}: give one for each of {len(nodes)} frequencies"
        )
    if not (nodes > 0.0).all() or (curve <= 0.0).any() or np.isinf(curve).any():
        raise ValueError("frequencies and boundary_amplitudes: give numbers above 0, or NaN where there is no boundary")
    order = np.argsort(nodes)
    at, heights = np.log(nodes[order]), np.log(curve[order])
    expected = np.exp(np.interp(np.log(points.frequencies), at, heights, left=np.nan, right=np.nan))
    residuals = points.amplitudes - expected
    there = np.isfinite(expected)
    compared = int(there.sum())
    chi_square = p_value = np.nan
    if points.amplitude_errors is not None and compared:
        chi_square = float(((residuals / points.amplitude_errors)[there] ** 2).sum())
        p_value = float(stats.chi2.sf(chi_square, compared))
    rms = sqrt(float((residuals[there] ** 2).mean())) if compared else np.nan
    return BoundaryComparison(expected, residuals, points.amplitudes / expected, compared, rms, chi_square, p_value)
