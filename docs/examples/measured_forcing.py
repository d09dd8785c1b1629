"""
Forcing from a measurement
==========================

One period of an accelerometer's record becomes the drive of a pendulum. Keeping five harmonics suppresses the noise.
"""

import matplotlib.pyplot as plt
import numpy as np

from cellmap import find_attractors, stroboscopic_map
from systems import Gravity, Pendulum, ViscousDamping, sampled_drive, scene

phase = np.arange(200) / 200
clean = -300 * np.cos(2 * np.pi * phase) + 40 * np.sin(6 * np.pi * phase)  # m/s^2
record = clean + np.random.default_rng(0).normal(0.0, 15.0, phase.size)
drive = sampled_drive(record, frequency=50.0, harmonics=5)
print("amplitudes in mm:", 1e3 * np.round(drive.amplitudes, 5))

pendulum = scene(Pendulum(length=0.0272), Gravity(9.8), drive, ViscousDamping(10.0))
for attractor in find_attractors(stroboscopic_map(pendulum), [[0.5, 0.0], [3.0, 0.0]]):
    print(f"period {attractor.period}, angle {abs(attractor.points[0, 0]):.3f}")

w = 2 * np.pi * np.arange(1, 6)[:, None]
kept = -(np.array(drive.amplitudes) @ ((50 * w) ** 2 * np.cos(w * phase + np.array(drive.phases)[:, None])))
plt.plot(phase, record, ".", markersize=3, label="record")
plt.plot(phase, kept, label="five harmonics")
plt.gca().set(xlabel="phase", ylabel="acceleration (m/s²)", title="Drive of the pendulum")
plt.legend()
# sphinx_gallery_alt = "Acceleration against phase: noisy record and the smooth curve of five harmonics through it"
