"""The first frame of a film: the threshold, and the markers where they are said to be."""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np
from numpy.typing import ArrayLike

from cellmap.utils import finite_number

from .blobs import Blob, Box, otsu_threshold
from .film import Film
from .marker_search import Marker, Setup, box_around
from .pixel_noise import pixel_noise

_ROUND = 1.5  # a disc that travels by twice its radius while it is exposed
_STANDS_OUT = 5.0  # standard deviations of dark pixels; normal noise does by 2.6, an even slope by 3.5


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
    starts = [complex(column, row) for column, row in places]
    limit = _threshold(image, [box_around(start, max(12.0, 0.5 * reach), 0.0, shape) for start in starts], threshold)
    interval = float(np.median(np.diff(film.times))) if len(film) > 1 else 1.0
    setup, time = Setup(limit, reach, interval, pixel_noise(film), weighted), float(film.times[frame])
    blobs = [_blob_at(image, start, k, setup) for k, start in enumerate(starts)]
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
