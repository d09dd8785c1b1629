"""
From a film to basins
=====================

A rod swings freely in front of a camera. This tutorial measures its length and its damping from the film, and draws the
basins that the same rod has on a driven pivot. The film is rendered here, so that the true parameters are known and the
errors can be seen. With a camera of your own, ``systems.lab.read_film`` reads a stack of images.
"""

# %%
# The film
# --------
#
# A rod of 6.9 cm with viscous damping of 0.8 /s, 200 frames a second, with a blurred lens, sensor noise and four lost
# frames.

import matplotlib.pyplot as plt
import numpy as np

from cellmap import trajectory
from systems import Gravity, Pendulum, VerticalDrive, ViscousDamping, scene
from systems.lab import Camera, Look, render_film

rod = scene(Pendulum(length=0.069), Gravity(9.8), ViscousDamping(0.8), period=0.5)
swing = trajectory(rod, [1.2, 0.0], periods=6, samples_per_period=200)
camera = Camera(scale=1000.0, origin=(80.0, 20.0), shape=(110, 160))  # 1000 pixels to the metre
recording = render_film(
    swing,
    camera,
    times=0.0025 + np.arange(560) / 200,
    look=Look(marker_radius=5.0, blur=1.0, read_noise=2.0),
    exposure=0.002,
    dropped=range(300, 304),
    rng=1,
)
print(recording)

# %%
# Tracking
# --------
#
# The marker is found in each frame as the centroid of the bright pixels near its predicted position. The pivot is known,
# and the rod keeps the marker on a circle about it.

from systems.lab import Rod, joint_angles, track_markers

tracks = track_markers(recording.film, recording.truth[0], rods=[Rod(marker=0, pivot=camera.origin, length=69.0)])
errors = tracks.positions - recording.truth
print(f"error of a position: {np.sqrt(np.nanmean(errors**2)):.3f} pixels")

fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
left.imshow(recording.film.frames[40], cmap="gray")
left.plot(*tracks.positions[:, 0].T, ".", markersize=2)
left.set(title="one frame, and all positions", xlabel="column", ylabel="row")
motion = joint_angles(tracks, pivots=[camera.origin])
times, angles = motion.times, motion.angles[:, 0]
right.plot(times, angles)
right.set(xlabel="t (s)", ylabel="angle (rad)", title="angle of the rod")
# sphinx_gallery_alt = "A frame with the tracked positions along an arc, and the decaying oscillation of the angle"
# sphinx_gallery_thumbnail_number = 1

# %%
# Length and damping
# ------------------
#
# The extremes of the oscillation are its decay profile, and their shape identifies the kind of damping:

from systems.lab import compare_decays, fit_damping, swing_envelope

envelope = swing_envelope(times, angles)
profile = compare_decays(envelope)
print(f"rms residuals: viscous {profile['viscous'].rmse:.4f} rad, dry friction {profile['dry'].rmse:.4f} rad")

# %%
# The damping is viscous. Fitting the motion itself gives length and damping with their confidence intervals:

best = fit_damping(times, angles, kinds=["viscous"]).best
for name in ("length", "damping"):
    low, high = best.interval(name)
    print(f"{name}: {best.estimates[name]:.6f}, 95 %: {low:.6f} to {high:.6f}")

plt.figure(figsize=(6.4, 3), layout="constrained")
plt.plot(envelope.times, np.abs(envelope.amplitudes), "o", label="extremes")
plt.plot(times, np.abs(angles), linewidth=0.7, label="measured angle")
plt.gca().set(xlabel="t (s)", ylabel="|angle| (rad)", title="Free decay")
plt.legend()
# sphinx_gallery_alt = "Absolute angle against time with the extremes marked, which decay exponentially"

# %%
# Basins of the measured rod
# --------------------------
#
# The same rod on a pivot that is driven with 10 mm at 50 Hz:

from cellmap import CellGrid, find_basins, interpolated_map, plot, stroboscopic_map

driven = scene(
    Pendulum(length=best.estimates["length"]),
    Gravity(9.8),
    VerticalDrive(0.010, 50.0),
    ViscousDamping(best.estimates["damping"]),
    name="the measured rod",
)
window = CellGrid((-np.pi, -100.0), (np.pi, 100.0), (150, 150))
basins = find_basins(interpolated_map(stroboscopic_map(driven), window), window)
plot.basins(basins)
for label, fraction in basins.fractions.items():
    if fraction.fraction > 0.01:
        print(f"{basins.label_name(label)}: {100 * fraction.fraction:.0f} %")
# sphinx_gallery_alt = "Basins of the measured rod: hanging, inverted and thin bands between rotations"

# %%
# :doc:`/laboratory` has the details: hidden markers, dry friction, double pendulums, accelerometers.
