"""Many dimensions and many attractors: basins in times of iterating all initial conditions for 300 periods."""

from __future__ import annotations

import resource
import time
import warnings
from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from peers import heyoka
from scipy.spatial import KDTree

from cellmap import ForcedSystem, find_basins, stroboscopic_map
from cellmap.maps import jacobian
from systems import power_grid, ring_of_wells

Say = Callable[[str], None]


def swing(machines: int, bus: bool) -> ForcedSystem:
    """Machines on a ring, generators and consumers in turn, the first of which is forced; a bus at one or two."""
    powers = [1.0 - 2.0 * (k % 2) for k in range(machines)]
    powers[-1] -= 0.0 if bus else sum(powers)
    lines = [(k, k + 1) for k in range(1, machines)] + [(1, machines)]
    far = [(0, machines // 2 + 1)] if machines > 4 else []
    return power_grid(powers, lines + ([(0, 1), *far] if bus else []), forcing=0.5)


ROWS = {
    "ring of 10, coupling 0.5": (lambda: ring_of_wells(10, coupling=0.5), 1000),
    "ring of 10, coupling 0.1": (lambda: ring_of_wells(10, coupling=0.1), 1000),
    "ring of 40, coupling 1": (lambda: ring_of_wells(40, coupling=1.0), 600),
    "2 machines at a bus": (power_grid, 2000),
    **{f"{n} machines at a bus": (lambda n=n: swing(n, bus=True), 600) for n in (3, 5, 15)},
    **{f"{n} machines without a bus": (lambda n=n: swing(n, bus=False), 600) for n in (3, 5, 15)},
}


def random_states(system: ForcedSystem, number: int) -> np.ndarray:
    """Draw angles from whole circles, angular velocities up to 5, and other coordinates up to 2."""
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (number, system.dimension))
    turning = any(c.is_angle for c in system.axes)
    return drawn * [pi if c.is_angle else 5.0 if turning else 2.0 for c in system.axes]


def processor_time(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


@pytest.mark.parametrize("row", ROWS)
def test_basins_in_many_dimensions(say: Say, one_thread: None, row: str) -> None:
    made, number = ROWS[row]
    system = made()
    states, exact = random_states(system, number), stroboscopic_map(system)
    exact(states[:2])
    jacobian(exact, states[:1])
    found: list[object] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        find_basins(exact, states[:20], max_periods=40)  # compiles
        iterated = processor_time(lambda: exact.iterate(states, 300))
        used = processor_time(lambda: found.append(find_basins(exact, states, max_periods=500)))
    basins = found[0]
    verified = [k for k, a in enumerate(basins.attractors) if a.verified]
    say(
        f"{row}: {used:.1f} s, {used / iterated:.1f} times 300 periods; {len(basins.attractors)} attractors, "
        f"{len(verified)} verified with {np.isin(basins.labels, verified).mean():.1%} of the initial conditions; "
        f"{(basins.labels < 0).mean():.2%} undecided"
    )


def test_a_hundred_machines(say: Say) -> None:
    """200 states: time and memory of the basins of 10^4 initial conditions, and of 200 periods of each."""
    powers = [1.0 if k % 2 else -1.0 for k in range(100)]
    lines = [(k, k + 1) for k in range(1, 100)] + [(1, 100)] + [(k, (k + 46) % 100 + 1) for k in range(1, 100, 3)]
    system = power_grid(powers, [(0, 1), *lines], forcing=0.1)
    exact, found = stroboscopic_map(system), []
    states = np.random.default_rng(0).uniform(-1.0, 1.0, (10_000, 200)) * np.repeat([pi, 1.0], 100)
    exact(states[:2])
    begin = time.perf_counter()
    exact.iterate(states, 200)
    orbits = time.perf_counter() - begin
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        begin = time.perf_counter()
        found.append(find_basins(exact, states, max_periods=200))
    taken, memory = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    say(
        f"100 machines, 10,000 initial conditions: 200 periods of each {orbits:.0f} s, basins {taken:.0f} s, "
        f"{memory:.2f} GB; {len(found[0].attractors)} attractors, {(found[0].labels < 0).mean():.2%} undecided"
    )


@pytest.mark.parametrize("number", [10_000])
def test_all_attractors_that_heyoka_finds(say: Say, number: int) -> None:
    """Ring of 10 wells at coupling 0.1: where heyoka's orbits end, and which of our attractors is there."""
    system = ring_of_wells(10, coupling=0.1)
    states, exact = random_states(system, number), stroboscopic_map(system)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        basins = find_basins(exact, states, max_periods=500)
    ends = heyoka(system, 1e-10, 500)(states)
    points = np.concatenate([a.points for a in basins.attractors])
    owners = np.repeat(np.arange(len(basins.attractors)), [len(a.points) for a in basins.attractors])
    apart, nearest = KDTree(points).query(ends)
    twice = len(KDTree(points).query_pairs(1e-4))
    here = apart < 1e-4
    settled = np.linalg.norm(heyoka(system, 1e-10, 12)(ends) - ends, axis=1) < 1e-6
    say(
        f"ring of 10 at coupling 0.1, {number:,} initial conditions: {len(basins.attractors)} attractors, "
        f"{len(np.unique(owners[nearest[here]]))} of them where heyoka's orbits end; ends that have closed within 12 "
        f"periods and are on none: {np.count_nonzero(settled & ~here)}; points of attractors in one place: {twice}; "
        f"other labels: {np.count_nonzero((owners[nearest] != basins.labels)[here & (basins.labels >= 0)])}; "
        f"undecided {np.count_nonzero(basins.labels < 0)}"
    )
