"""Markers followed through a film, by centroids in windows that move with them.

This is the scheme of the report (section IV C) with what it lacks: centres weighted by grey values, windows around the
foreseen place, a distinct blob for each marker, flags where a marker is hidden or merged, and a search along the circle
that a rod allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from math import hypot, sqrt

import numpy as np
from numpy.typing import ArrayLike

from cellmap.utils import finite_number, progress_bar, whole_number

from .blobs import Blob, Box, otsu_threshold
from .film import Film
from .marker_search import Marker, Search, Setup, box_around
from .outliers import flag_areas, flag_repeats, flag_standing, widen_errors
from .pixel_noise import pixel_noise
from .tracks import MarkerStatus, Rail, Rod, Tracks

_ROUND = 1.5  # a disc that travels by twice its radius while it is exposed
_STANDS_OUT = 5.0  # standard deviations of dark pixels; normal noise does by 2.6, an even slope by 3.5
_OTHER_AREA = 0.06  # the first frame is no measure of the area where the usual one is larger by more


def track_markers(
    film: Film,
    initial_positions: ArrayLike,
    rods: Sequence[Rod] = (),
    rails: Sequence[Rail] = (),
    threshold: float | None = None,
    search_radius: float | None = None,
    tolerance: float = 3.0,
    weighted: bool = True,
    progress: bool = False,
) -> Tracks:
    """Follow bright markers through a film; dark ones through its negative, of frames such as 255 - frames.

    In each frame a marker is looked for around the place to which its velocity takes it, or the rate at which it turns
    about its pivot.  Blobs above the threshold are matched to markers, one to one, at the least sum of distances and
    differences of area; where there are rods they must fit.  The window grows while a marker is lost; a bright object
    that stood at a place before the marker was lost is not taken for it, and what is found again and stands, where the
    marker moved before and never stood a third as long, is LOST in the end.

    A blob is the marker's only where its area is what it should be, with the smear of its motion during the exposure.
    With less than 0.9 of it the status is PARTIAL, with more than 1.15 MERGED; so it is, in the end, where the area
    differs by more than 0.04 (or 4.5 standard deviations) from the marker's usual one, and next to flagged frames by
    more than 0.02 (or 2.5).  So a centre can be off by about 0.04 radii where something hides the rim of a marker.  The
    area of the first frame is the measure, unless the usual one is larger: a marker may be hidden in part there, but
    not merged with something.

    A frame that repeats the one before to the last bit, while markers move before and after it, is one that the
    recorder lost: its status is NO_FRAME.

    Two markers that look alike and are hidden at the same time may be exchanged, unless they have rods of their own.

    Parameters
    ----------
    film : Film
        The film.
    initial_positions : array_like, shape (markers, 2)
        About where the markers are in the first frame that is not missing: pixels (column, row).
    rods : sequence of Rod, optional
        Rods that hold markers at known distances.
    rails : sequence of Rail, optional
        Markers that move only vertically.
    threshold : float, optional
        Grey value above which pixels belong to markers; by default from the windows of the first frame, by Otsu's
        method.
    search_radius : float, optional
        How far from its foreseen place a marker may be (pixels); by default a tenth of the smaller side of the image,
        12 at least.  It is doubled as long as the velocity is not known, and grows while the marker is lost.
    tolerance : float, optional
        How far a marker may be from the circle of its rod or from its rail (pixels).
    weighted : bool, optional
        Weight pixels by their grey values; without, centroids are those of all pixels above the threshold alike, as in
        the report, and have no standard errors.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Tracks
        Places, their standard errors, and what was seen in every frame.

    Raises
    ------
    TypeError, ValueError
        For arguments that do not fit, a film without frames, a constant image, a threshold that nothing or everything
        exceeds, an initial position where no marker is, or the same as another's, and a marker that is not on its rod
        or rail in the first frame.

    References
    ----------
    Crocker, Grier, Journal of Colloid and Interface Science 179 (1996) 298 (weighted centroids, linking).

    Examples
    --------
    >>> from systems.lab import film_at_rate
    >>> rows, columns = np.mgrid[:48, :64]
    >>> frames = [200.0 * np.clip(4.5 - np.hypot(columns - 20 - 3 * k, rows - 24), 0.0, 1.0) for k in range(8)]
    >>> tracks = track_markers(film_at_rate(np.array(frames), 100.0), [(20, 24)])
    >>> tracks
    Tracks(8 frames, 1 markers seen whole in 8 of them)
    >>> bool(abs(tracks.positions[4, 0] - [32.0, 24.0]).max() < 1e-9)
    True
    """
    tolerance = finite_number("tolerance", tolerance, above=0.0)
    setup, markers = read_first_frame(film, initial_positions, threshold, search_radius, weighted)
    _hold(markers, rods, Rod, "rod", "hangs", "Rod(marker, pivot, length)")
    _hold(markers, rails, Rail, "rail", "moves", "Rail(marker, column)")
    _check_fit(markers, tolerance)
    tracks = _followed(Search(film, setup, tolerance, deepcopy(markers)), progress)
    usual = np.array([np.median(a[np.isfinite(a)]) for a in tracks.areas.T])
    if (usual > 1.0 + _OTHER_AREA).any():
        for marker, factor in zip(markers, usual.tolist(), strict=True):
            marker.radius *= sqrt(max(factor, 1.0))
        tracks = _followed(Search(film, setup, tolerance, deepcopy(markers)), progress)
    flag_repeats(tracks)
    flag_areas(tracks)
    flag_standing(tracks, [marker.radius for marker in markers])
    seen = (tracks.status == MarkerStatus.SEEN)[..., None]
    positions, errors = np.where(seen, tracks.centroids, np.nan), np.where(seen, tracks.errors, np.nan)
    widen_errors(film.times, positions, errors)
    return replace(tracks, positions=positions, errors=errors)


def _followed(search: Search, progress: bool) -> Tracks:
    """Return status, centroids, their errors and areas over the expected ones, in all frames."""
    film, shape = search.film, (len(search.film), len(search.markers))
    status, areas = np.full(shape, MarkerStatus.NO_FRAME, np.uint8), np.full(shape, np.nan)
    centroids, errors = np.full((2, *shape, 2), np.nan)
    with progress_bar(len(film), "frames" if progress else None) as tick:
        for k, missing in enumerate(film.missing):
            tick(1)
            for marker, sight in enumerate([] if missing else search.look(k)):
                status[k, marker] = sight.status
                if sight.blob is not None:
                    centroids[k, marker] = sight.blob.column, sight.blob.row
                    errors[k, marker] = sight.blob.column_error, sight.blob.row_error
                    areas[k, marker] = sight.ratio
    return Tracks(film.times, centroids, errors, status, centroids, areas, search.setup.threshold)


def _hold(markers: list[Marker], holds: Sequence[Rod | Rail], kind: type, name: str, verb: str, form: str) -> None:
    """Hold markers by rods or rails, at most one of them for each."""
    for hold in holds:
        if not isinstance(hold, kind):
            raise TypeError(f"{name}s hold {hold!r}: give {form}")
        marker = markers[whole_number(f"{name}.marker", hold.marker, 0, len(markers) - 1)]
        if getattr(marker, name) is not None:
            raise ValueError(f"{name}s: marker {hold.marker} {verb} on two of them; give one for each marker")
        setattr(marker, name, hold)


def _check_fit(markers: list[Marker], tolerance: float) -> None:
    """Refuse rods and rails that the markers of the first frame are not on."""
    for marker in markers:
        place, rod, rail = marker.place, marker.rod, marker.rail
        if rod is not None:
            pivot = markers[rod.pivot].place if isinstance(rod.pivot, int) else complex(*rod.pivot)
            if marker.misfit(place, pivot) > tolerance:
                raise ValueError(
                    f"rods: marker {marker.number} begins {abs(place - pivot):.1f} pixels from its pivot, and its rod "
                    f"has {rod.length:g}: measure both again, with fit_circle say, or give more than "
                    f"tolerance={tolerance:g}"
                )
        if rail is not None and abs(place.real - rail.column) > tolerance:
            raise ValueError(
                f"rails: marker {marker.number} begins at the column {place.real:.1f}, and its rail is at "
                f"{rail.column:g}: measure it again, or give more than tolerance={tolerance:g}"
            )


def read_first_frame(
    film: Film, initial: ArrayLike, threshold: float | None, window: float | None, weighted: bool
) -> tuple[Setup, list[Marker]]:
    """Return the setup, and the markers in the first frame that is not missing."""
    present = np.flatnonzero(~film.missing)
    if not present.size:
        raise ValueError("film: all frames are missing; give one with frames")
    frame = int(present[0])
    image, shape = film.frames[frame], film.shape
    places = np.array(initial, np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or not len(places):
        raise ValueError(f"initial_positions has the shape {places.shape}: give a pixel (column, row) for each marker")
    for k, (column, row) in enumerate(places):
        if not (-0.5 <= column < shape[1] - 0.5 and -0.5 <= row < shape[0] - 0.5):
            raise ValueError(
                f"initial_positions[{k}]=({column:g}, {row:g}): give a pixel (column, row) in the image of "
                f"{shape[1]} x {shape[0]} pixels"
            )
    reach = max(12.0, 0.1 * min(shape)) if window is None else finite_number("search_radius", window, at_least=2.0)
    positions = [complex(column, row) for column, row in places]
    limit = _threshold(image, [box_around(place, max(12.0, 0.5 * reach), 0.0, shape) for place in positions], threshold)
    interval = float(np.median(np.diff(film.times))) if len(film) > 1 else 1.0
    setup, time = Setup(limit, reach, interval, pixel_noise(film), weighted), float(film.times[frame])
    blobs = [_blob_at(image, place, k, setup) for k, place in enumerate(positions)]
    for k, blob in enumerate(blobs):
        for j in range(k):
            if abs(blob.centre - blobs[j].centre) < 1.0:
                raise ValueError(f"initial_positions[{j}] and [{k}] are at the same marker: give each its own")
    return setup, [Marker(k, b.radius, b.centre, time, b.centre, time) for k, b in enumerate(blobs)]


def _threshold(image: np.ndarray, windows: list[Box | None], given: float | None) -> float:
    pixels = np.concatenate([image[box[0] : box[1], box[2] : box[3]].ravel() for box in windows if box is not None])
    low, high = float(pixels.min()), float(pixels.max())
    if low == high:
        raise ValueError(f"film: all pixels of the first windows are {low:g}; give positions of markers, in a lit film")
    if given is None:
        limit = otsu_threshold(pixels)[0]
        dark, bright = pixels[pixels <= limit], pixels[pixels > limit]
        rounding = 0.0 if pixels.dtype.kind == "f" else sqrt(1.0 / 12.0)
        contrast, spread = float(bright.mean() - dark.mean()), hypot(float(dark.std()), rounding)
        if contrast < _STANDS_OUT * spread:
            raise ValueError(
                f"initial_positions: nothing bright stands out there (by {contrast / spread:.1f} deviations of the "
                f"dark); give places of markers, or a threshold between {low:g} and {high:g}; for markers filling the "
                "surroundings, a larger search_radius=; of dark markers, the negative of the film"
            )
        return limit
    limit = finite_number("threshold", given)
    if limit >= high:
        raise ValueError(f"threshold={given!r}: no pixel at the initial positions exceeds it; give one below {high:g}")
    if limit < low:
        raise ValueError(
            f"threshold={given!r}: all pixels at the initial positions exceed it; give one of at least {low:g}"
        )
    return limit


def _blob_at(image: np.ndarray, place: complex, number: int, setup: Setup) -> Blob:
    """Return the blob nearest to an initial position, which must be whole."""
    threshold, reach = setup.threshold, setup.window
    blobs = setup.blobs(image, box_around(place, reach, 0.0, image.shape), (3.0, np.inf))
    near = sorted((abs(blob.centre - place), k) for k, blob in enumerate(blobs))
    name = f"initial_positions[{number}]=({place.real:g}, {place.imag:g})"
    if not near or near[0][0] > max(0.5 * reach, blobs[near[0][1]].radius):
        raise ValueError(
            f"{name}: no marker is above the grey value {threshold:g} within {0.5 * reach:g} pixels; give a place "
            "at one, or another threshold; of dark markers, the negative of the film"
        )
    blob = blobs[near[0][1]]
    here = float(image[round(place.imag), round(place.real)])
    if (blob.clipped or blob.cut) and here <= threshold < blob.plateau:
        raise ValueError(
            f"{name}: it is dark there, {here:g}, and what is above the grey value {threshold:g} around it goes beyond "
            "the window; give a place at a bright marker, or of dark markers the negative of the film"
        )
    if blob.clipped:
        raise ValueError(f"{name}: the marker touches the border of the image; begin with a frame that shows it")
    if blob.cut:
        raise ValueError(f"{name}: the marker is cut off {reach:g} pixels away; give a larger search_radius=")
    if blob.stretch > _ROUND:
        raise ValueError(
            f"{name}: the marker is {blob.stretch:.2f} times as long as wide, so it is merged with something or moves "
            "fast; begin with a frame that shows it alone"
        )
    return blob
