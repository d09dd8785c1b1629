"""
Dry friction: sticking and slipping
===================================

A block on a moving belt, held by a spring, sticks until the spring pulls harder than friction holds, and then slips.
The right-hand side is discontinuous (Filippov); every stop and every slip is located.
"""

from cellmap import plot, trajectory
from systems import stick_slip_oscillator

belt = stick_slip_oscillator()
motion = trajectory(belt, [[0.0, 0.0], [2.0, 0.0]], periods=10, samples_per_period=200)
print(belt)
plot.phase_portrait(motion, labels=["from rest", "from 2"])
# sphinx_gallery_alt = "Velocity against displacement: two orbits that reach a cycle with a straight sticking phase"
