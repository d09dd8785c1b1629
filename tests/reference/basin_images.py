"""Labels of the reference images by a program that shares nothing with cellmap: RK4 with 256 steps a period, NumPy.
Duffing's oscillator, whose boundary has the dimension 1.9, takes 1024 steps.

``python -m tests.reference.basin_images`` compares every image in this folder with its labels, cell by cell.
Attractors are listed in the order of their colours; an orbit has the label of the one on which
it is after many periods.
"""

from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

STEPS = 256
ESCAPED, DIVERGED = 253, 254
FOLDER = Path(__file__).parent
Array = NDArray[np.float64]


class BasinImage(NamedTuple):
    """Map of one period, window, cells a side, attractors as points of the map, and their tolerance along each axis."""

    period: Callable[[Array], Array]
    lower: tuple[float, float]
    upper: tuple[float, float]
    cells: int
    attractors: tuple[tuple[tuple[float, float], ...], ...]
    near: tuple[float, float]
    periods: int = 400
    escape: float = np.inf


def runge_kutta(
    acceleration: Callable[[float, Array, Array], Array], length: float, steps: int = STEPS
) -> Callable[[Array], Array]:
    """Return the map of one period of x'' = acceleration(t, x, x') by the classical method of order four."""
    h = length / steps

    def period(z: Array) -> Array:
        x, v = z
        for k in range(steps):
            t = k * h
            a1 = acceleration(t, x, v)
            a2 = acceleration(t + h / 2, x + h / 2 * v, v + h / 2 * a1)
            a3 = acceleration(t + h / 2, x + h / 2 * v + h * h / 4 * a1, v + h / 2 * a2)
            a4 = acceleration(t + h, x + h * v + h * h / 2 * a2, v + h * a3)
            x, v = x + h * v + h * h / 6 * (a1 + a2 + a3), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        return np.stack([x, v])

    return period


def on_the_circle(period: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return the map with its first coordinate between -pi and pi."""

    def wrapped(z: Array) -> Array:
        x, v = period(z)
        return np.stack([np.remainder(x + pi, 2 * pi) - pi, v])

    return wrapped


def shaken(amplitude: float) -> Callable[[Array], Array]:
    """The report's pendulum: 2.72 cm, 50 Hz, 10 /s, g = 9.8 m/s^2, pivot at `amplitude` cos(w t)."""
    w = 2 * pi * 50.0

    def acceleration(t: float, x: Array, v: Array) -> Array:
        return -10.0 * v - (9.8 - amplitude * w * w * np.cos(w * t)) / 0.0272 * np.sin(x)

    return on_the_circle(runge_kutta(acceleration, 0.02))


def inverted(t: float, x: Array, v: Array) -> Array:
    """Return the acceleration of the pendulum of figure "inverted", counted from the upright position."""
    return -0.2 * v - (-0.1 - 0.545 * np.cos(t)) * np.sin(x)


def duffing(t: float, x: Array, v: Array) -> Array:
    """Return the acceleration of the oscillator with two wells."""
    return -0.15 * v + x - x**3 + 0.2 * np.cos(t)


def henon(z: Array) -> Array:
    """Return the image under Henon's map."""
    x, y = z
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([1.0 - 1.4 * x * x + y, 0.3 * x])


HANGING, UPRIGHT = ((0.0, 0.0),), ((-pi, 0.0),)
CYCLE = ((0.53605, -10.73125), (-0.10031, -88.85086), (-0.53605, 10.73125), (0.10031, 88.85086))
SLOW, WIDE = ((-pi, -100.0), (pi, 100.0)), ((-pi, -500.0), (pi, 500.0))
BASIN_IMAGES = {
    "pendulum_3mm": BasinImage(shaken(0.003), *SLOW, 80, (HANGING, UPRIGHT), (0.05, 5.0)),
    "pendulum_3mm_wide": BasinImage(
        shaken(0.003), *WIDE, 100, (HANGING, UPRIGHT, ((2.52034, 320.42147),), ((-2.52034, -320.42147),)), (0.05, 5.0)
    ),
    "pendulum_3mm_table": BasinImage(shaken(0.003), *SLOW, 80, (HANGING, UPRIGHT), (0.05, 5.0), escape=100.0),
    "pendulum_10mm": BasinImage(shaken(0.010), *SLOW, 80, (HANGING, UPRIGHT, CYCLE), (0.01, 1.0), 800),
    "inverted": BasinImage(
        on_the_circle(runge_kutta(inverted, 2 * pi)),
        (-pi, -4.0),
        (pi, 4.0),
        80,
        (HANGING, ((2.18475, 1.18826),), ((-2.18475, -1.18826),)),
        (0.01, 0.01),
    ),
    "duffing": BasinImage(
        runge_kutta(duffing, 2 * pi, 4 * STEPS),
        (-2.2, -2.2),
        (2.2, 2.2),
        80,
        (((-0.77905, 0.02742),), ((1.21009, 0.05529),)),
        (1e-3, 1e-3),
    ),
    "henon": BasinImage(henon, (-2.0, -2.0), (2.0, 2.0), 100, (), (0.0, 0.0), 100),
}


def labels(basin_image: BasinImage, every: int = 1) -> NDArray[np.uint8]:
    """Return the colours of the cells of an image, or of each so many of them, the first axis varying slowest."""
    edges = [
        np.linspace(a, b, basin_image.cells + 1) for a, b in zip(basin_image.lower, basin_image.upper, strict=True)
    ]
    centres = np.meshgrid(*[(e[1:] + e[:-1]) / 2 for e in edges], indexing="ij")
    z: Any = np.stack([c.ravel()[::every] for c in centres])
    colours = np.full(z.shape[1], 255, np.uint8)
    active = np.arange(z.shape[1])
    for number in range(1, basin_image.periods + 1):
        z = basin_image.period(z)
        with np.errstate(invalid="ignore"):
            gone = ~(np.abs(z) < 1e6).all(axis=0)
            left = ~gone & (np.abs(z[1]) > basin_image.escape)
        colours[active[gone]], colours[active[left]] = DIVERGED, ESCAPED
        stays = ~gone & ~left
        if number % 10 == 0:
            stays &= ~coloured(basin_image, z, colours, active)
        active, z = active[stays], z[:, stays]
        if not active.size:
            break
    if not basin_image.attractors:
        colours[active] = 0
    return colours


def coloured(
    basin_image: BasinImage, z: Array, colours: NDArray[np.uint8], active: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Colour the orbits that are on an attractor, and return which they are."""
    done = np.zeros(len(active), bool)
    for colour, points in enumerate(basin_image.attractors):
        for x, y in points:
            apart = np.abs(z[0] - x)
            apart = np.minimum(apart, np.abs(2 * pi - apart)) if basin_image.upper[0] == pi else apart
            there = (apart < basin_image.near[0]) & (np.abs(z[1] - y) < basin_image.near[1])
            colours[active[there]] = colour
            done |= there
    return done


def differing(name: str, every: int = 1) -> float:
    """Return the fraction of the cells in which an image differs from its labels."""
    from PIL import Image

    with Image.open(FOLDER / f"{name}.png") as image:
        cells = np.array(image)[::-1].T.ravel()[::every]
    return float((cells != labels(BASIN_IMAGES[name], every)).mean())


if __name__ == "__main__":
    for name in BASIN_IMAGES:
        print(f"{name}: {100 * differing(name):.3f} % of the cells differ")
