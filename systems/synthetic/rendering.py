"""Synthetic films of scenes, with the faults of real ones, and the truth about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter

from cellmap.maps import Trajectory
from cellmap.utils import Rng, claim_memory, finite_number, progress_bar, random_numbers, whole_number

from ..lab.films.film import Film
from .appearance import Bar, Camera, Look, Spot

Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Recording:
    """A synthetic film and the truth about it.

    Parameters
    ----------
    film : Film
        What the camera gives.
    truth : ndarray, shape (n, markers, 2)
        Pixels (column, row) of the markers' centres in the middle of each exposure.
    visible : ndarray, shape (n, markers)
        Fraction of each marker's disc, there, that is in the image and not behind a bar.
    """

    film: Film
    truth: NDArray[np.float64]
    visible: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"Recording({self.film!r}, {self.truth.shape[1]} markers)"


def render_film(
    motion: Trajectory,
    camera: Camera,
    times: ArrayLike,
    look: Look | None = None,
    exposure: float = 0.0,
    bars: Sequence[Bar] = (),
    spots: Sequence[Spot] = (),
    dropped: Sequence[int] = (),
    *,
    rng: Rng = 0,
    progress: bool = False,
) -> Recording:
    """Film a scene: bright markers on its parts and grey rods, before a dark and unevenly lit background.

    Markers are round and anti-aliased.  Each frame is the average of sub-exposures between which no marker moves by
    more than half a pixel (but of 64 at most), spread by the optics, and given normal noise with the variance of shot
    and read noise.  Grey values are rounded to 8 bits.  Places between the samples of the motion are those of a cubic
    spline through them.

    Parameters
    ----------
    motion : Trajectory
        Motion of a scene from one initial condition, with the output "positions", sampled at least as densely as it is
        filmed.
    camera : Camera
        Where it is filmed from.
    times : array_like, shape (n,)
        Times of the middles of the exposures (s), within those of the motion.
    look : Look, optional
        How things look.
    exposure : float, optional
        Time for which each frame is exposed (s).
    bars : sequence of Bar, optional
        What hides things.
    spots : sequence of Spot, optional
        Bright objects that are no markers.
    dropped : sequence of int, optional
        Numbers of frames that are lost: black, and flagged as dropped.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the noise.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Recording
        The film and the truth.  Markers are counted from the pivot, if it has one, outwards.

    Raises
    ------
    TypeError, ValueError
        For motions from several initial conditions, and one without positions, that ended or does not cover the
        exposures.
    MemoryError
        Where the frames need more memory than is free.

    Examples
    --------
    >>> from cellmap import trajectory
    >>> from systems import Gravity
    >>> from systems import Pendulum
    >>> from systems import scene
    >>> pendulum = scene(Pendulum(0.069), Gravity(9.8), period=0.1)
    >>> motion = trajectory(pendulum, [1.0, 0.0], periods=2, samples_per_period=20)
    >>> camera = Camera(scale=600.0, origin=(64.0, 40.0), shape=(96, 128))
    >>> recording = render_film(motion, camera, times=[0.01, 0.05, 0.1])
    >>> recording
    Recording(Film(3 frames of 128 x 96 pixels, uint8, 0.01 to 0.1 s), 1 markers)
    """
    look = look or Look()
    moments = np.array(times, np.float64)
    exposure = finite_number("exposure", exposure, at_least=0.0)
    places = _places_of(motion, moments, exposure)
    height, width = camera.shape
    claim_memory(f"{moments.size:,} frames", moments.size * height * width, "take fewer or smaller frames")
    frames = np.zeros((moments.size, height, width), np.uint8)
    flags = np.zeros(moments.size, bool)
    flags[[whole_number(f"dropped[{j}]", k, 0, moments.size - 1) for j, k in enumerate(dropped)]] = True
    film = Film(frames, moments, flags, exposure)

    joints = camera.pixels(places(moments))
    first = 0 if look.pivot_marker else 1
    radii = np.broadcast_to(look.marker_radius, joints.shape[1] - first).astype(float)
    visible = _visible(joints[:, first:], radii, moments, bars, camera.shape)
    rng, light = random_numbers(rng), _light(camera.shape, look.shade)
    still = np.full(camera.shape, look.background, np.float32)
    for spot in spots:
        _disc(still, np.array([spot.column, spot.row]), spot.radius, spot.grey)
    with progress_bar(moments.size, "frames" if progress else None) as tick:
        for k, moment in enumerate(moments):
            tick(1)
            if flags[k]:
                continue
            within = _sub_exposures(camera, places, moment, exposure)
            image = sum(_scene(still, each, radii, look, first) for each in within) / np.float32(len(within))
            for bar in bars:
                if bar.start <= moment <= bar.end:
                    cover = _bar_cover(camera.shape, bar)
                    image += cover * (bar.grey - image)
            lit = gaussian_filter(image * light, look.blur, mode="nearest")
            variance = np.clip(lit, 0.0, None) * (255.0 / look.full_well) + look.read_noise**2
            noisy = lit + np.sqrt(variance) * rng.standard_normal(camera.shape, np.float32)
            frames[k] = np.clip(np.rint(noisy), 0, 255)
    return Recording(film, joints[:, first:], visible)


def _places_of(motion: Trajectory, moments: NDArray[np.float64], exposure: float) -> Any:
    """Return the function of time whose values are places of the joints, shape (..., joints, 2)."""
    if not isinstance(motion, Trajectory):
        raise TypeError(f"motion={motion!r}: give a Trajectory, as cellmap.trajectory returns it")
    if motion.states.ndim != 2:
        raise ValueError(f"motion has the initial conditions {motion.states.shape[1:-1]}: give the trajectory of one")
    positions = motion.output("positions")
    if not np.isfinite(positions).all():
        raise ValueError("motion ends before its last sample: give one that stays finite")
    if moments.ndim != 1 or not moments.size or not np.isfinite(moments).all():
        raise ValueError(f"times have the shape {moments.shape}: give a list of finite times")
    first, last = moments.min() - 0.5 * exposure, moments.max() + 0.5 * exposure
    slack = 1e-9 * (motion.times[-1] - motion.times[0])
    if first < motion.times[0] - slack or last > motion.times[-1] + slack:
        raise ValueError(
            f"times: the exposures reach from {first:g} to {last:g} s and the motion from {motion.times[0]:g} to "
            f"{motion.times[-1]:g} s; film less, or integrate longer"
        )
    step = motion.times[1] - motion.times[0]
    if moments.size > 1 and step > 1.000001 * np.abs(np.diff(moments)).min():
        raise ValueError(f"motion has a sample every {step:g} s, and frames are closer; take more samples a period")
    return CubicSpline(motion.times, positions.reshape(len(positions), -1, 2))


def _sub_exposures(camera: Camera, places: Any, moment: float, exposure: float) -> NDArray[np.float64]:
    """Return the pixels of the joints at the middles of the sub-exposures, shape (count, joints, 2)."""
    ends = camera.pixels(places(moment + exposure * np.linspace(-0.5, 0.5, 9)))
    travel = np.linalg.norm(np.diff(ends, axis=0), axis=-1).sum(axis=0).max()
    count = int(np.clip(np.ceil(2.0 * travel), 1, 64))
    return camera.pixels(places(moment + exposure * ((np.arange(count) + 0.5) / count - 0.5)))


def _scene(still: Image, joints: NDArray[np.float64], radii: NDArray[np.float64], look: Look, first: int) -> Image:
    image = still.copy()
    for a, b in pairwise(joints):
        _rod(image, a, b, look.rod_width, look.rod)
    for centre, radius in zip(joints[first:], radii, strict=True):
        _disc(image, centre, radius, look.marker)
    return image


def _around(shape: tuple[int, ...], low: NDArray[Any], high: NDArray[Any]) -> tuple[slice, slice] | None:
    """Rows and columns from `low` to `high`, both (column, row); None where they are outside the image."""
    c0, r0 = np.maximum(np.floor(low).astype(int), 0)
    c1, r1 = np.minimum(np.ceil(high).astype(int) + 1, [shape[1], shape[0]])
    return (slice(r0, r1), slice(c0, c1)) if r1 > r0 and c1 > c0 else None


def _disc(image: Image, centre: NDArray[np.float64], radius: float, grey: float) -> None:
    """Draw a disc whose edge pixels are covered in part, by the mean over 4 x 4 points of each pixel."""
    box = _around(image.shape, centre - radius - 1.5, centre + radius + 1.5)
    if box is None:
        return
    fine = (np.arange(4) - 1.5) / 4.0
    rows = (np.arange(box[0].start, box[0].stop)[:, None] + fine - centre[1]).ravel()
    columns = (np.arange(box[1].start, box[1].stop)[:, None] + fine - centre[0]).ravel()
    inside = np.clip(4.0 * (radius - np.hypot(rows[:, None], columns)) + 0.5, 0.0, 1.0)
    cover = inside.reshape(rows.size // 4, 4, columns.size // 4, 4).mean(axis=(1, 3), dtype=np.float32)
    image[box] += cover * (np.float32(grey) - image[box])


def _rod(image: Image, a: NDArray[np.float64], b: NDArray[np.float64], width: float, grey: float) -> None:
    box = _around(image.shape, np.minimum(a, b) - width, np.maximum(a, b) + width)
    if box is None or width == 0.0:
        return
    along, squared = b - a, float(((b - a) ** 2).sum())
    columns = np.arange(box[1].start, box[1].stop, dtype=np.float32) - a[0]
    rows = (np.arange(box[0].start, box[0].stop, dtype=np.float32) - a[1])[:, None]
    fraction = np.clip((columns * along[0] + rows * along[1]) / max(squared, 1e-12), 0.0, 1.0)
    away = np.hypot(columns - fraction * along[0], rows - fraction * along[1])
    image[box] += np.clip(0.5 * width + 0.5 - away, 0.0, 1.0) * (np.float32(grey) - image[box])


def _bar_cover(shape: tuple[int, int], bar: Bar) -> Image:
    rows, columns = np.arange(shape[0], dtype=np.float32), np.arange(shape[1], dtype=np.float32)
    across = np.clip(np.minimum(columns - bar.left, bar.right - columns) + 0.5, 0.0, 1.0)
    down = np.clip(np.minimum(rows - bar.top, bar.bottom - rows) + 0.5, 0.0, 1.0)
    return np.outer(down, across)


def _light(shape: tuple[int, int], shade: float) -> Image:
    """Light that falls off from a point left above the middle, to 1 - `shade` in the darkest corner."""
    rows, columns = np.linspace(-0.8, 1.0, shape[0]), np.linspace(-0.7, 1.0, shape[1])
    away = rows[:, None] ** 2 + columns**2
    return (1.0 - shade * away / 2.0).astype(np.float32)


def _visible(
    centres: NDArray[np.float64],
    radii: NDArray[np.float64],
    moments: NDArray[np.float64],
    bars: Sequence[Bar],
    shape: tuple[int, int],
) -> NDArray[np.float64]:
    """Return the fraction of each disc that is in the image and behind no bar, by 812 points in it."""
    grid = np.stack(np.meshgrid(*[(np.arange(32) - 15.5) / 16.0] * 2), axis=-1).reshape(-1, 2)
    points = grid[(grid**2).sum(axis=1) < 1.0]
    fractions = np.empty(centres.shape[:2])
    for marker, radius in enumerate(radii):
        places = centres[:, marker, None, :] + radius * points
        seen = ((places > -0.5) & (places < np.array([shape[1], shape[0]]) - 0.5)).all(axis=-1)
        for bar in bars:
            within = (moments >= bar.start) & (moments <= bar.end)
            inside = (places > [bar.left, bar.top]) & (places < [bar.right, bar.bottom])
            seen &= ~(inside.all(axis=-1) & within[:, None])
        fractions[:, marker] = seen.mean(axis=1)
    return fractions
