"""Films of turning rods, and how far tracks are from the truth."""

from math import pi
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from cellmap import ForcedSystem, angle
from cellmap.maps import Trajectory
from systems.lab import Camera, MarkerStatus, Recording

SEEN, PARTIAL, MERGED, LOST = MarkerStatus.SEEN, MarkerStatus.PARTIAL, MarkerStatus.MERGED, MarkerStatus.LOST
CAMERA = Camera(scale=1000.0, origin=(80.0, 80.0), shape=(160, 160))
CENTRE = (80.0, 80.0)


def rotating_rods(lengths, initial_angles, rates, swing=0.0):
    """Rods (m) that turn evenly (rad, rad/s), the pivot at the height swing cos(2 pi 9 t), for 1 s."""

    def positions(t: float, x: Any, p: Any) -> tuple[float, ...]:
        places = [0.0, p.swing * np.cos(2.0 * pi * 9.0 * t)]
        for k, length in enumerate(lengths):
            places += [places[-2] + length * np.sin(x[k]), places[-1] - length * np.cos(x[k])]
        return tuple(places)

    coordinates = tuple(angle(f"theta{k}") for k in range(len(lengths)))
    outputs = {"positions": positions}
    system = ForcedSystem(lambda t, x, p: rates, {"swing": swing}, 1.0, coordinates, outputs=outputs)
    times = np.linspace(0.0, 1.0, 2001)
    return Trajectory(system, times, np.array(initial_angles) + np.outer(times, rates), np.zeros((), np.uint8), 2000)


def times_at(rate: float, count: int) -> Any:
    return 0.01 + np.arange(count) / rate


def errors(recording: Recording, found: Any) -> Any:
    return np.linalg.norm(found.positions - recording.truth, axis=-1)


def frame_with(*places: tuple[float, float], radius: float = 5.0, shape: tuple[int, int] = (80, 100)) -> Any:
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    frame = np.full(shape, 40.0)
    for column, row in places:
        frame += 160.0 * np.clip(radius + 0.5 - np.hypot(columns - column, rows - row), 0.0, 1.0)
    return gaussian_filter(frame, 0.8)


def steady(speed: float = 0.0, length: float = 0.05) -> Trajectory:
    """A rod that turns evenly about the origin: its end is at length (sin, -cos) of 1 + speed t."""
    system = ForcedSystem(
        lambda t, x, p: (p.speed,),
        {"speed": speed, "length": length},
        1.0,
        (angle("theta"),),
        outputs={"positions": lambda t, x, p: (0.0, 0.0, p.length * np.sin(x[0]), -p.length * np.cos(x[0]))},
    )
    times = np.linspace(0.0, 1.0, 401)
    return Trajectory(system, times, (1.0 + speed * times)[:, None], np.zeros((), np.uint8), 400)
