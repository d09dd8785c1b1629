"""Figure 11 of the report: a rod that settles beside the vertical, which is the work of the bearing's friction.

The report tracks a rod that comes to rest beside the vertical.  How far beside, and whether it hangs or is held upright
by the drive, is not known; so both are shown for the rod of 3.1 cm with the dry friction of 2.5 rad/s^2 of the report's
simulations, and drive and releases are assumed.

A hanging rod without a drive stays wherever gravity is weaker than friction, up to asin(friction l/g); where it stops
depends on the release.  On the drive an inverted rod stays where friction is stronger than gravity and the drive at
their largest, asin(friction l/(g + A w^2)), which is far less; but releases end mostly on a stick-slip cycle outside of
that set, on either side of upright.

Must come out: angles of rest of the hanging rod as they follow from energy alone, to 1e-9 rad; for the rod of figure 19
at 3 mm with 10 rad/s^2 a set within 0.000889214 rad and a cycle at 0.00182768 rad.  So the friction alone leaves a
hanging rod at most 0.45 degrees beside the vertical and an inverted one a fraction of a milliradian: a rod that is seen
farther from upright has a bearing with more friction, or its drive or camera is tilted.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cellmap import ForcedSystem, trajectory
from cellmap.maps import Trajectory
from systems import SHORT_ROD, driven_pendulum
from systems.lab.free_swings.damping_fits import free_pendulum

from ._dry_friction import GRAVITY, resting_bound, turning_angles

FRICTION = 2.5  # rad/s^2
AMPLITUDE, FREQUENCY = 0.005, 40.0  # of the drive (m, Hz)
FURTHEST = 0.2  # release of an inverted rod (rad)
KNOWN = (0.000889214, 0.00182768)  # rod of figure 19: bound of the set, and the cycle (rad)


@dataclass(frozen=True, eq=False)
class Settled:
    """Where releases of the inverted rod end.

    `releases` and `ends` are angles from upright (rad) once a period, `moving` says which rods still slip in each
    period, `bound` is that of the set in which they stay.
    """

    motion: Trajectory
    releases: NDArray[np.float64]
    ends: NDArray[np.float64]
    moving: NDArray[np.bool_]
    bound: float

    @property
    def cycle(self) -> float:
        """Angle of the stick-slip cycle from upright (rad)."""
        return float(np.median(np.abs(self.ends[self.moving])))


@dataclass(frozen=True, eq=False)
class Result:
    """Releases of the hanging rod with their angles of rest, simulated and by energy, and inverted rods."""

    releases: NDArray[np.float64]
    rest: NDArray[np.float64]
    by_energy: NDArray[np.float64]
    inverted: Settled
    known: Settled


def compute(releases: int, periods: int) -> Result:
    """Release hanging and inverted rods from many angles."""
    angles = np.linspace(0.01, 1.28, releases)
    system = free_pendulum(SHORT_ROD, {"friction": FRICTION}, GRAVITY)
    halts = [turning_angles(a, FRICTION, SHORT_ROD) for a in angles.tolist()]
    swings = ceil(0.6 * max(map(len, halts))) + 2  # a half swing of 1.28 rad takes 0.56 periods of a small one
    rest = trajectory(system, np.stack([angles, 0.0 * angles], axis=-1), swings, 4).states[-1]
    if rest[:, 1].any():
        raise RuntimeError("some rods have not come to rest")
    held = driven_pendulum(SHORT_ROD, AMPLITUDE, FREQUENCY, damping=0.0, friction=FRICTION)
    return Result(
        angles,
        rest[:, 0],
        np.array([h[-1] for h in halts]),
        settle(held, releases, periods),
        settle(driven_pendulum(damping=0.0, friction=10.0), releases, periods),
    )


def settle(system: ForcedSystem, releases: int, periods: int) -> Settled:
    """Release inverted rods at rest from angles on both sides, and follow them until they have settled."""
    angles = np.linspace(-FURTHEST, FURTHEST, releases)
    motion = trajectory(system, np.stack([pi + angles, 0.0 * angles], axis=-1), periods, 16)
    ends = motion.states[-17:, :, 0] - pi
    p = system.params
    bound = resting_bound(p["friction"], p["length"], p["amplitude"] * (2.0 * pi * p["frequency"]) ** 2)
    return Settled(motion, angles, ends[-1], np.ptp(ends, axis=0) > 0.0, bound)


def report(result: Result) -> None:
    """Print where rods settle, beside what must come out."""
    far = np.abs(result.rest - result.by_energy).max()
    widest = np.abs(result.rest).max()
    print(
        f"hanging, {FRICTION:g} rad/s^2: {len(result.rest)} releases end within {widest:.6f} rad; bound "
        f"{resting_bound(FRICTION, SHORT_ROD):.6f}; angles by energy differ by at most {far:.1e} rad"
    )
    for name, found in (("rod of 3.1 cm", result.inverted), ("rod of figure 19, 10 rad/s^2", result.known)):
        inside = np.abs(found.ends[~found.moving]).max(initial=0.0)
        slipping = f"{np.count_nonzero(found.moving)} of {len(found.ends)} releases"
        print(
            f"inverted, {name}: {slipping} on a stick-slip cycle at "
            f"{found.cycle:.8f} rad, the others at rest within {inside:.9f} rad; bound {found.bound:.9f}"
        )
    print(f"known for the rod of figure 19: cycle {KNOWN[1]} rad, bound {KNOWN[0]} rad")


def draw(result: Result) -> Figure:
    """Draw angles of rest of the hanging rod, and the way of inverted ones to theirs."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13.0, 5.0), layout="constrained")
    left.plot(result.releases, 1e3 * result.rest, "o", ms=2.5, color="#0072B2", label="simulated")
    left.plot(result.releases, 1e3 * result.by_energy, "x", ms=4.0, color="#D55E00", label="by energy")
    for side in (-1, 1):
        left.axhline(side * 1e3 * resting_bound(FRICTION, SHORT_ROD), color="0.6", lw=0.8, ls="--")
    left.set(xlabel="angle of release (rad)", ylabel="angle of rest (mrad)", title="Hanging, without a drive")
    left.legend(fontsize="small")
    found = result.inverted
    samples = found.motion.samples
    ways = 1e3 * (found.motion.states[::samples, :, 0] - pi)
    right.plot(found.motion.times[::samples], ways, lw=0.6, color="#0072B2", alpha=0.5)
    for angle, style in ((found.bound, "--"), (found.cycle, ":")):
        for side in (-1, 1):
            right.axhline(side * 1e3 * angle, color="0.4", lw=0.8, ls=style)
    right.set(xlabel="time (s)", ylabel="angle from upright, once a period (mrad)")
    right.set_title("Inverted, on the drive; dashed: bound of rest, dotted: stick-slip cycle")
    right.set_yscale("symlog", linthresh=1.0)
    return figure


def main(quick: bool, output: Path) -> None:
    """Compute, tell and draw."""
    result = compute(40 if quick else 200, 300)
    report(result)
    figure = draw(result)
    figure.savefig(output / "figure_11.png", dpi=100)
    plt.close(figure)
