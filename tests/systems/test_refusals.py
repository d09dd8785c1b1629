"""What the systems and the laboratory refuse: a call, and the words of its error, a line each."""

import math
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filmed_markers import steady

import systems
import systems.dimensionless
import systems.lab
from cellmap import ForcedSystem, angle, trajectory
from systems import ANGULAR_ACCELERATION, Effect, Terms, quantity
from systems.lab import time_series


def effect(**terms: Any) -> Effect:
    """An effect of a user's own."""
    body = {"terms": property(lambda _: Terms(**terms)), "vanishes": property(lambda _: False)}
    made: Effect = type("Own", (Effect,), body)()
    return made


@dataclass(frozen=True)
class Bare(Effect):
    strength: float


@dataclass(frozen=True)
class Gusts(Effect):
    """An effect with a number for each joint that also acts on the pivot."""

    gust: float = quantity(ANGULAR_ACCELERATION, per_joint=True)
    terms = property(lambda _: Terms(joint=lambda t, angle, rate, p: p.gust, torque=lambda t, p: 1.0))
    vanishes = property(lambda _: False)


def oscillator(*rates: Any, axes: tuple[Any, ...] = ("q", "v"), **outputs: Any) -> ForcedSystem:
    return ForcedSystem(lambda t, x, p: tuple(rate(x) for rate in rates), {}, 1.0, axes, outputs=outputs)


ONE, CHAIN = systems.Pendulum(1.0), systems.Chain((0.11, 0.07), (0.3, 0.5))
G, SHAKER, STILL = systems.Gravity(9.8), systems.VerticalDrive(0.003, 50.0), systems.VerticalDrive(0.0, 50.0)
DAMPED, AT_REST = systems.driven_pendulum(), systems.scene(systems.Pendulum(0.0272), G, STILL)
PUSHED = systems.scene(ONE, STILL, systems.ConstantTorque(1.0))
PUSH = effect(vertical=lambda t, p: 3.0 + cos(2.0 * pi * t), period=lambda p: 1.0)
COG = effect(joint=lambda t, angle, rate, p: -5.0 * sin(4.0 * angle))
SPRING, ENERGY = (lambda x: x[1], lambda x: -x[0]), lambda t, x, p: (0.5 * x[1] ** 2, abs(x[0]))
PLAIN, BENT = oscillator(*SPRING), oscillator(*reversed(SPRING), energy=ENERGY)
CORNERED = oscillator(lambda x: x[1], lambda x: -1.0, axes=(angle("q"), "v"), energy=ENERGY)
T = np.arange(0.0, 8.0, 0.005)
SWING = np.exp(-0.2 * T) * np.cos(12.0 * T)
ROD, CAMERA = systems.lab.free_pendulum(0.069, {"damping": 0.4}), systems.lab.Camera(500.0, (32.25, 20.5), (64, 80))

MOTION, FRAMES = steady(), np.zeros((6, 12, 16), np.uint8)
FILM, UNEVEN = systems.lab.film_at_rate(FRAMES, 25.0), systems.lab.Film(FRAMES, np.array([0.0, 1, 2, 3, 5, 6]))
POINTS = systems.lab.StabilityPoints(np.array([15.0, 25.0, 35.0]), np.array([8.25e-3, 4.95e-3, 3.5e-3]))


@cache
def names() -> dict[str, Any]:
    """What the calls below are made of."""
    offered = {name: getattr(package, name) for package in (systems, systems.lab) for name in package.__all__}
    offered |= {**vars(math), **vars(systems.dimensionless), **vars(time_series)}
    results = {"moved": trajectory(PLAIN, [[0.0, 1.0]], 1), "envelope": systems.lab.swing_envelope(T, SWING)}
    return {**offered, **globals(), **results}


VALUES = r"""
Chain((1.0, 0.0), (1.0, 1.0))                       | length_2=0.0: give a number above 0
Chain((1.0, 1.0), (1.0, -1.0))                      | mass_2=-1.0: give a number above 0
Chain((1.0, 1.0), (1.0,))                           | masses=\(1.0,\): give one for each of the 2 lengths
Chain((), ())                                       | lengths=\(\): give at least one number
Pendulum(0.0)                                       | length=0.0: give a number above 0
CompoundPendulum(0.0, 1.0, 1.0)                     | mass=0.0: give a number above 0
CompoundPendulum(1.0, 1.0, 2.0)                     | inertia=1.0: about the pivot it is at least mass x distance
Gravity(inf)                                        | gravity=inf: give a finite number
VerticalDrive(-0.003, 50.0)                         | amplitude=-0.003: give a number of at least 0
VerticalDrive(0.003, -50.0)                         | frequency=-50.0: give a number above 0
VerticalDrive(0.003, 50.0, nan)                     | phase=nan: give a finite number
TorqueDrive(1.0, 0.0)                               | frequency=0.0: give a number above 0
TiltedDrive(1.0, 3.0, nan)                          | tilt=nan: give a finite number
HarmonicDrive((0.1, -0.1), (0.0, 0.0), 3.0)         | amplitude_2=-0.1: give a number of at least 0
HarmonicDrive((0.1,), (0.0, 0.0), 3.0)              | phases=.*: give one for each of the 1 amplitudes
HarmonicDrive((), (), 3.0)                          | amplitudes=\(\): give at least one number
SquareDrive(-1.0, 3.0)                              | acceleration=-1.0: give a number of at least 0
TriangleDrive(1.0, 3.0, smoothing=-0.1)             | smoothing=-0.1: give a number of at least 0
sampled_drive([1.0, 2.0], 3.0)                      | samples=.*: give at least 3 numbers
sampled_drive([1.0, 2.0, inf], 3.0)                 | samples\[2\]=inf: give a finite number
sampled_drive([1.0] * 8, 3.0, 5)                    | harmonics=5: give a whole number of at most 4
ViscousDamping(-1.0)                                | damping=-1.0: give a number of at least 0
ViscousDamping((1.0, -2.0))                         | damping_2=-2.0: give a number of at least 0
DryFriction(-1.0)                                   | friction=-1.0: give a number of at least 0
DryFriction(())                                     | friction=\(\): give at least one number
QuadraticDrag(-1.0)                                 | drag=-1.0: give a number of at least 0
TorsionSpring(inf)                                  | stiffness=inf: give a finite number
ScaledDamping(-1e-9)                                | gamma=-1e-09: give a number of at least 0
ScaledGravity(nan)                                  | alpha=nan: give a finite number
ScaledVerticalDrive(-inf)                           | beta=-inf: give a finite number
driven_pendulum(friction=-1.0)                      | friction=-1.0: give a number of at least 0
scene(ONE, G)                                       | period=None: .* there are none. Give period=
scene(ONE, SHAKER, VerticalDrive(0.1, pi))          | periods 0.02, 0.31831, .* Give frequencies
scene(ONE, SHAKER, TorqueDrive(1.0, 50 * 2**0.5))   | no common period .* or period=
scene(ONE, VerticalDrive(0.1, 1.0), TorqueDrive(1.0, 1e-5)) | no common period
scene(ONE, G, SHAKER, period=0.017)                 | give the period of the forcing
scene(CHAIN, ViscousDamping((1.0, 2.0, 3.0)), period=1.0) | damping=\(1.0, 2.0, 3.0\): .* 2 joints
scene(CHAIN, Gusts((1.0, 2.0)), period=1.0)         | gust=.*: give one number, as the effect acts on the pivot
Units(length=0.0)                                   | length=0.0: give a number above 0
Units(time=-1.0)                                    | time=-1.0: give a number above 0
dimensionless_parameters(0.0272, 0.003, 50.0, -1.0)      | damping=-1.0: give a number of at least 0
power_grid((1.0, nan))                              | powers\[1\]=nan: give a finite number
power_grid(lines=((0, 1), (1, 3)))                  | lines\[1\]=3: give a whole number of at most 2
power_grid(lines=((1, 1),))                         | lines\[0\]=\(1, 1\): give two different nodes
power_grid(lines=((1, 2), (2, 1)))                  | lines\[1\]=\(2, 1\): .* each line once
effective_potential(PLAIN)                          | give a scene
effective_potential(BENT)                           | with the angles and angular velocities of joints
effective_potential(scene(ONE, G, PUSH))             | a drive without a mean
effective_potential(scene(ONE, G, SHAKER, COG))     | the term `stored`
effective_potential(scene(ONE, G, SquareDrive(300.0, 50.0, smoothing=1e-4))) | give its waves more smoothing
effective_potential(DAMPED)([0.0, nan])             | give finite numbers
effective_potential(double_pendulum())(0.0)         | give 2, one array for each joint, and not 1
find_well(effective_potential(double_pendulum()))   | give one of a single joint
slow_equilibrium(effective_potential(AT_REST), pi).frequencies | does not swing in every direction
slow_equilibrium(effective_potential(PUSHED), 0.0)  | begin nearer to one
release_limits(driven_pendulum(damping=0.0), angles=4, max_periods=10) | ends on no attractor
release_limits(double_pendulum())                   | give a pendulum of one joint
displacement_amplitude(-1.0, 15.0)                  | peak_to_peak_volts=-1.0: .* at least 0
displacement_amplitude(1.0, 0.0)                    | frequency=0.0: give finite numbers above 0
displacement_amplitude(1.0, [15.0, -2.0])           | frequency=-2.0
displacement_amplitude(nan, 15.0)                   | peak_to_peak_volts=nan
displacement_amplitude(1.0, 15.0, 0.0)              | volts_per_g=0.0: give a number above 0
displacement_amplitude(1.0, 15.0, standard_gravity=-9.8) | standard_gravity=-9.8
displacement_amplitude([1.0, 2.0], [1.0, 2.0, 3.0]) | shapes do not go together
displacement_error(1.0, 15.0, volts_error=-0.1)     | volts_error=-0.1
displacement_error(1.0, 15.0, volts_per_g_error=-0.1) | volts_per_g_error=-0.1
displacement_error(1.0, 15.0, frequency_error=inf)  | frequency_error=inf
peak_to_peak_volts(-1.0, 15.0)                      | amplitude=-1.0
quadratic_decay(swing_envelope(T[:260], SWING[:260])) | has 4 extremes: give at least 5
quadratic_decay(envelope, start_time=nan)           | start_time=nan
quadratic_decay(envelope).half_widths(95)           | confidence=95
compare_decays(envelope, kinds=["cubic"])           | kinds has 'cubic': choose among 'viscous'
compare_decays(envelope, kinds=[])                  | name at least one
quadratic_decay(swing_envelope(T, SWING[::-1]))     | that is no decay
compare_decays(swing_envelope(T, SWING[::-1]))      | that is no decay
effective_length(Estimate(0.0, 0.1))                | frequency=0\.0: give a number above 0
fit_motion(ROD, T, SWING, ["mass"])                 | vary has 'mass': the parameters of free pendulum are length
fit_motion(ROD, T, SWING, [])                       | give names of parameters, each once
fit_motion(ROD, T[:5], SWING[:5], ["length", "damping"]) | has 5 numbers: give at least 8
fit_motion(ROD, T, SWING, ["damping"], bounds={"damping": (2, 1)}) | bounds\['damping'\]=\(2, 1\): give the smaller
fit_motion(ROD, T, SWING, ["damping"], bounds={"length": (0.0, 1.0)}) | bounds has 'length'
fit_motion(ROD, T, np.stack([SWING] * 3, axis=-1), ["damping"]) | measured has 3 columns
fit_motion(ROD, T, np.full(T.size, 0.3), ["damping"]) | measured\[:, 0\] is constant, 0.3
fit_motion(ROD, T, np.stack([SWING] * 2, axis=-1), ["damping"]) | give a first guess of the state
fit_damping(T, SWING, kinds=[])                     | kinds=\[\]: name at least one of 'viscous'
fit_damping(T, SWING, kinds="viscous")              | kinds='viscous': name at least one of .*, in a list
fit_damping(T, SWING, kinds=["sticky"])             | kinds has 'sticky'
fit_damping(T, SWING, ["viscous"], length=0.069, guess={"damping": 0}) | guess\['damping'\]=0: give a number above 0
fit_damping(T, SWING, ["viscous"], length=0.069, guess={"length": 0.07}) | guess has 'length': what is fitted is damping
free_pendulum(0.069, {"stickiness": 1.0})           | coefficients has 'stickiness': choose among damping, friction
Camera(0.0, (0.0, 0.0), (4, 4))                     | scale=0\.0: give a number above 0
CAMERA.pixels([1.0, 2.0, 3.0])                      | give pairs
render_film(MOTION, CAMERA, [0.0, 0.5], exposure=0.02) | the exposures reach from -0.01 to 0.51 s .* film less
render_film(MOTION, CAMERA, [0.1, 0.101])           | a sample every 0.0025 s, and frames are closer
render_film(MOTION, CAMERA, [0.2, 0.1])             | strictly increase
render_film(moved, CAMERA, [0.1])                    | give the trajectory of one
write_film(FILM, "film.doc")                        | choose the suffix
write_film(UNEVEN, "film.gif")                      | film has uneven times
write_film(film_at_rate(FRAMES / 2.0, 25.0), "film.gif") | film has grey values of float64
StabilityPoints(np.array([15.0]), np.array([-1.0])) | amplitudes hold -1.0
StabilityPoints(np.array([nan]), np.array([1.0]))   | frequencies hold nan
StabilityPoints(np.array([]), np.array([]))         | at least one
StabilityPoints(np.array([1.0]), np.array([1, 2.0])) | amplitudes have the shape \(2,\)
StabilityPoints(*np.ones((2, 1)), np.array([0.0]))  | amplitude_errors hold
compare_with_boundary(POINTS, [10, 30], [1.0])      | boundary_amplitudes have the shape
compare_with_boundary(POINTS, [10, 30, 20], [1, 1, 1]) | goes up and down
compare_with_boundary(POINTS, [10, 30], [1.0, -1])  | numbers above 0, or NaN
compare_with_boundary(POINTS, [0.0, 30.0], [1, 1])  | numbers above 0
stability_points_from_volts([15.0], [-1.0])         | peak_to_peak_volts=-1.0
Rod(0, 0, 5.0)                                      | count markers from the pivot outwards
"""

TYPES = r"""
Chain(1.0, 1.0)                                     | lengths=1.0: give a sequence of numbers
Chain("12", "12")                                   | lengths='12': give a sequence of numbers
Gravity(None)                                       | gravity=None: give one real number
VerticalDrive("1", 50.0)                            | amplitude='1': give one real number
ViscousDamping([[1.0]])                             | damping_1=.*: give one real number
ScaledVerticalDrive(1j)                             | beta=1j: give one real number
in_units(Bare(1.0), Units(length=2.0))              | Bare.strength has no dimension: declare it with quantity
power_grid(lines=(1, 2))                            | lines\[0\]=1: give the two nodes
effective_potential(driven_pendulum(friction=1.0))  | leave out dry friction and drag, and smooth its waves
effective_potential(scene(ONE, QuadraticDrag(0.1), SHAKER)) | right-hand side is discontinuous
effective_potential(stick_slip_oscillator())        | discontinuous
effective_potential(CORNERED)                       | not analytic
effective_potential(DAMPED)("up")                   | give real numbers
find_well(DAMPED)                                   | give an EffectivePotential
displacement_amplitude("one", 15.0)                 | peak_to_peak_volts='one': give real numbers
acceleration_from_volts("one")                      | volts='one'
quadratic_decay([1.0, 0.9])                         | give an Envelope
fit_motion("rod", T, SWING, ["damping"])            | give a ForcedSystem
fit_motion(ROD, T, ["a"] * T.size, ["damping"])     | measured: give real numbers
measured_series(["a", "b"], [1.0, 2.0])             | times: give real numbers
measured_series([1.0, 2.0], ["a", "b"], "volts")    | volts: give real numbers
render_film(3, CAMERA, [0.1])                       | give a Trajectory
StabilityPoints("f", np.array([1.0]))               | frequencies='f'
compare_with_boundary(3, [1.0], [1.0])              | points=3
compare_with_boundary(POINTS, [10.0, 30.0], "ab")   | boundary_amplitudes
Camera(1.0, 3, (4, 4))                              | origin=3: give a tuple of two numbers
"""


FILES = r"""
write_film(FILM, "no/such/folder/film.gif")         | make it first
write_film(FILM, "no/such/folder")                  | make it first
write_film(FILM, ".")                               | is there already
"""

KEYS = r"""
compare_decays(envelope, kinds=["dry"])["viscous"]  | the kinds that were compared are dry
"""

KINDS = (ValueError, VALUES), (TypeError, TYPES), (OSError, FILES), (KeyError, KEYS)
ROWS = [(error, row) for error, rows in KINDS for row in rows.split("\n")[1:-1]]


@pytest.mark.parametrize(("error", "row"), ROWS, ids=range(len(ROWS)))
def test_what_is_refused(error: type[Exception], row: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    call, _, message = row.partition("|")
    with pytest.raises(error, match=message.strip()):
        eval(call, names())
    assert not list(tmp_path.iterdir())
