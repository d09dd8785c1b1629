"""The first frame of a film: the threshold, and the markers where they are said to be."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import ArrayLike

from cellmap.utils import finite_number

from .blobs import Blob, Box, find_blobs, otsu_threshold
from .film import Film
from .pixel_noise import PixelNoise, pixel_noise
from .prediction import Memory, apart, box_around

_ROUND = 1.5  # a disc that travels by twice its radius while it is exposed
_STANDS_OUT = 5.0  # standard deviations of dark pixels; normal noise does by 2.6, an even slope by 3.5


@dataclass(frozen=True)
class Setup:
    """What does not change while markers are followed.

    Parameters
    ----------
    threshold : float
        Grey value above which pixels belong to markers.
    window : float
        How far from its foreseen place a marker may be (pixels).
    interval : float
        Usual time between two frames (s).
    noise : PixelNoise
        Noise of the pixels.
    weighted : bool
        Whether pixels are weighted by their grey values.
    """

    threshold: float
    window: float
    interval: float
    noise: PixelNoise
    weighted: bool


def read_first_frame(
    film: Film, initial: ArrayLike, threshold: float | None, window: float | None, weighted: bool
) -> tuple[Setup, list[Memory]]:
    """Return the setup, and what is known of each marker from the first frame that is not missing."""
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
    boxes = [box_around((float(c), float(r)), reach, 0.0, shape, None) for c, r in places]
    windows = [box for box in boxes if box is not None]
    near = [box_around((float(c), float(r)), max(12.0, 0.5 * reach), 0.0, shape, None) for c, r in places]
    limit = _threshold(image, [box for box in near if box is not None], threshold)
    noise = pixel_noise(film)
    blobs = [_blob_at(image, box, places[k], k, limit, reach, noise, weighted) for k, box in enumerate(windows)]
    for k, blob in enumerate(blobs):
        for j in range(k):
            if apart(blob, (blobs[j].column, blobs[j].row)) < 1.0:
                raise ValueError(f"initial_positions[{j}] and [{k}] are at the same marker: give each its own")
    time = float(film.times[frame])
    interval = float(np.median(np.diff(film.times))) if len(film) > 1 else 1.0
    memories = [Memory(b.radius, (b.column, b.row), time, (b.column, b.row), time) for b in blobs]
    return Setup(limit, reach, interval, noise, weighted), memories


def _threshold(image: np.ndarray, windows: list[Box], given: float | None) -> float:
    pixels = np.concatenate([image[a:b, c:d].ravel() for a, b, c, d in windows])
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


def _blob_at(
    image: np.ndarray,
    box: Box,
    start: np.ndarray,
    number: int,
    threshold: float,
    reach: float,
    noise: PixelNoise,
    weighted: bool,
) -> Blob:
    """Return the blob nearest to an initial position, which must be whole."""
    place = float(start[0]), float(start[1])
    blobs = find_blobs(image, box, threshold, (3.0, np.inf), noise, weighted)
    near = sorted((apart(blob, place), k) for k, blob in enumerate(blobs))
    name = f"initial_positions[{number}]=({place[0]:g}, {place[1]:g})"
    if not near or near[0][0] > max(0.5 * reach, blobs[near[0][1]].radius):
        raise ValueError(
            f"{name}: no marker is above the grey value {threshold:g} within {0.5 * reach:g} pixels; give a place "
            "at one, or another threshold; of dark markers, the negative of the film"
        )
    blob = blobs[near[0][1]]
    here = float(image[round(place[1]), round(place[0])])
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
