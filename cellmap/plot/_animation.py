"""Animations of mechanical systems: rods, bobs and a fading trace of the last tip."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, overload

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from .._lib.arrays import Floats
from .._lib.checks import claim_memory, finite_number, shown, whole_number
from .._lib.files import as_target, written_whole
from .._lib.signatures import checked
from ..maps.trajectories import Trajectory
from ._colours import colour_of

_INCHES, _DOTS_PER_INCH = 6.0, 100


@overload
def animate(
    trajectory: Trajectory,
    path: None = None,
    *,
    output: str = "positions",
    trace: int | None = None,
    every: int = 1,
    frames_per_second: float = 30.0,
) -> FuncAnimation: ...


@overload
def animate(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    output: str = "positions",
    trace: int | None = None,
    every: int = 1,
    frames_per_second: float = 30.0,
) -> None: ...


@checked
def animate(
    trajectory: Trajectory,
    path: str | os.PathLike[str] | None = None,
    *,
    output: str = "positions",
    trace: int | None = None,
    every: int = 1,
    frames_per_second: float = 30.0,
) -> FuncAnimation | None:
    """Animate a motion as rods and bobs, with a fading trace of the last tip.

    Parameters
    ----------
    trajectory : Trajectory
        One orbit or many, which are superposed in different colours.
    path : path-like, optional
        File to write: a GIF or, where ffmpeg is installed, an MP4, by the suffix.  It is written whole or not at all.
    output : str, optional
        Output of the system with the positions of pivot and tips, ``(x0, y0, x1, y1, ...)`` in m.
    trace : int, optional
        Length of the trace in samples; by default one period.
    every : int, optional
        Number of samples from one frame to the next.
    frames_per_second : float, optional
        Frame rate of the animation.

    Returns
    -------
    matplotlib FuncAnimation or None
        The animation where there is no `path`: keep it in a variable while it is shown.

    Raises
    ------
    TypeError, ValueError
        For a system without that output, a path of another suffix, or numbers out of range.
    FileNotFoundError
        For a folder that does not exist.
    RuntimeError
        For an MP4 where ffmpeg is missing.
    MemoryError
        Where the frames of a GIF need more memory than is free.

    Examples
    --------
    >>> from cellmap import plot
    >>> import tempfile
    >>> from math import cos, pi, sin
    >>> from cellmap import ForcedSystem, angle, trajectory
    >>> pendulum = ForcedSystem(
    ...     lambda t, x, p: (x[1], -sin(x[0])), {}, 2 * pi, (angle("theta"), "v"),
    ...     outputs={"positions": lambda t, x, p: (0.0, 0.0, sin(x[0]), -cos(x[0]))},
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     motion = trajectory(pendulum, [2.0, 0.0], periods=1, samples_per_period=8)
    ...     plot.animate(motion, Path(folder) / "pendulum.gif")
    """
    every = whole_number("every", every, at_least=1)
    trace = trajectory.samples if trace is None else whole_number("trace", trace)
    frames_per_second = finite_number("frames_per_second", frames_per_second, above=0.0)
    joints = _joints(trajectory, output)
    moments = range(0, len(trajectory.times), every)
    target, writer = (None, None) if path is None else _writer(path, frames_per_second, len(moments))
    size = (_INCHES, _INCHES)
    # A figure of pyplot's is one that a person sees; a film needs none.
    figure = plt.figure(figsize=size) if target is None else Figure(figsize=size)
    draw = _scene(figure.add_subplot(), trajectory, joints, trace)
    interval = 1000.0 / frames_per_second
    film = FuncAnimation(figure, draw, moments, interval=interval, blit=False, cache_frame_data=False)
    if target is None:
        return film
    with written_whole(target) as part:
        film.save(part, writer=writer, dpi=_DOTS_PER_INCH)
    return None


def _joints(trajectory: Trajectory, output: str) -> Floats:
    """Return the positions of pivot and tips, shape (n, orbits, joints, 2)."""
    system = trajectory.system
    if not isinstance(output, str) or output not in system.outputs:
        raise ValueError(
            f"output={shown(output)}: the outputs of {system.name} are {sorted(system.outputs) or 'none'}; give the "
            f"ForcedSystem outputs={{{output!r}: f}}, where f(t, x, p) returns (x0, y0, x1, y1, ...) of pivot and tips"
        )
    places = trajectory.output(output)
    if places.shape[-1] < 4 or places.shape[-1] % 2:
        raise ValueError(
            f"output={output!r} has {places.shape[-1]} components: give x and y of a pivot and of at least one tip"
        )
    if not np.isfinite(places).any():
        raise ValueError(f"output={output!r} is nowhere finite: there is nothing to show")
    return places.reshape(len(places), -1, places.shape[-1] // 2, 2)


def _writer(path: str | os.PathLike[str], frames_per_second: float, frames: int) -> tuple[Path, AbstractMovieWriter]:
    """Check a path and choose what writes it."""
    target = as_target("path", path)
    match target.suffix.lower():
        case ".gif":
            needed = round(4 * frames * (_INCHES * _DOTS_PER_INCH) ** 2)
            claim_memory(f"a GIF of {frames:,} frames", needed, "take a larger every=, or write an MP4")
            return target, PillowWriter(fps=frames_per_second)  # type: ignore[arg-type]
        case ".mp4":
            if not FFMpegWriter.isAvailable():
                raise RuntimeError(
                    f"path={str(path)!r}: an MP4 needs the program ffmpeg, which is not there; install it, or give a "
                    "path that ends in .gif"
                )
            return target, FFMpegWriter(fps=frames_per_second)  # type: ignore[arg-type]
    raise ValueError(f"path={str(path)!r}: give the name of a file that ends in .gif or .mp4")


def _scene(ax: Axes, trajectory: Trajectory, joints: Floats, trace: int) -> Callable[[int], list[Any]]:
    """Set the stage; return the function that draws one moment on it."""
    low, high = np.nanmin(joints, axis=(0, 1, 2)), np.nanmax(joints, axis=(0, 1, 2))
    margin = 0.08 * float((high - low).max()) or 1.0
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    ax.set(aspect="equal", xlabel="$x$ (m)", ylabel="$y$ (m)")
    title = ax.set_title(trajectory.system.name)
    colours = [colour_of(k) for k in range(joints.shape[1])]
    fading = np.linspace(0.0, 1.0, trace + 1)[1:]
    trails = [LineCollection([], linewidths=1.5) for _ in colours]
    for trail in trails:
        ax.add_collection(trail)
    rods = [ax.plot([], [], "-", color="0.25", linewidth=2.0)[0] for _ in colours]
    bobs = [ax.plot([], [], "o", color=c, markeredgecolor="black", markersize=9)[0] for c in colours]
    pivots = [ax.plot([], [], "s", color="black", markersize=5)[0] for _ in colours]

    def draw(moment: int) -> list[Any]:
        for k, colour in enumerate(colours):
            body = joints[moment, k]
            rods[k].set_data(*body.T)
            bobs[k].set_data(*body[1:].T)
            pivots[k].set_data(*body[:1].T)
            tips = joints[max(moment - trace, 0) : moment + 1, k, -1]
            pieces = np.stack([tips[:-1], tips[1:]], axis=1)
            trails[k].set_segments(list(pieces))
            trails[k].set_color([(*colour, a) for a in fading[trace - len(pieces) :]])
        title.set_text(f"{trajectory.system.name}, t = {trajectory.times[moment]:.4g}")
        return [*trails, *rods, *bobs, *pivots, title]

    return draw
