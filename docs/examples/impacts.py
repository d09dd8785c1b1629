"""
Impacts: a ball on a vibrating table
====================================

The state jumps where a guard reaches zero. The ball bounces with a coefficient of restitution of 0.5 and comes to rest
on the table between flights.
"""

from math import cos, pi, sin

import matplotlib.pyplot as plt

from cellmap import ForcedSystem, trajectory
from cellmap.maps import Impact


def fall(t, x, p):
    return x[1], -p.g


def clearance(t, x, p):
    return x[0] - p.amplitude * cos(p.omega * t)


def bounce(t, x, p):
    table = -p.amplitude * p.omega * sin(p.omega * t)
    return x[0], table - p.e * (x[1] - table)


parameters = {"g": 1.0, "e": 0.5, "amplitude": 2.0, "omega": 1.0}
ball = ForcedSystem(fall, parameters, 2 * pi, ("h", "v"), impacts=[Impact(clearance, bounce)])
motion = trajectory(ball, [6.0, 0.0], periods=5, samples_per_period=400)
plt.plot(motion.times, motion.states[:, 0], label="ball")
plt.plot(motion.times, [parameters["amplitude"] * cos(t) for t in motion.times], label="table")
plt.gca().set(xlabel="t", ylabel="height", title="A ball on a vibrating table")
plt.legend()
print(motion.states[-1].round(3))
# sphinx_gallery_alt = "Heights of ball and table against time: flights, bounces of decreasing height, and motion together"
