"""A free pendulum with dry friction, from energy alone: no equation of motion is solved."""

from __future__ import annotations

from math import asin, pi, sin

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

GRAVITY = 9.8


def turning_angles(release: float, friction: float, length: float) -> NDArray[np.float64]:
    """Return the angles (rad) at which a pendulum, released at rest, comes to a halt; at the last one it stays.

    From one halt to the next, the potential energy decreases by the work of the friction: from the angle a on one side
    of the vertical to b on the other, (g/l) (cos b - cos a) = friction (a + b).  Divided by the way w = a + b, so that
    w = 0 is no solution, this is (g/l) sin(w/2)/(w/2) sin(a - w/2) = friction; b is negative for a swing that ends
    before the vertical.
    """
    found = [release]
    while GRAVITY / length * sin(abs(found[-1])) > friction:
        a = abs(found[-1])

        def excess(way: float, a: float = a) -> float:
            return float(GRAVITY / length * np.sinc(way / (2.0 * pi)) * sin(a - 0.5 * way) - friction)

        b = float(brentq(excess, 0.0, 2.0 * a, xtol=1e-16)) - a
        found.append(-b if found[-1] > 0.0 else b)
    return np.array(found)


def resting_bound(friction: float, length: float, drive: float = 0.0) -> float:
    """Return the angle (rad) up to which friction holds a rod beside the vertical.

    `drive` is the largest acceleration of the pivot (m/s^2), which an inverted rod must be held against as well.
    """
    return asin(friction * length / (GRAVITY + drive))
