"""Random programs with up to ten comparisons, which use one another's results: no image that is good is wrong."""

from __future__ import annotations

import time

import numpy as np
import pytest
from branch_programs import GivenUpError, drawn
from two_tiers import at_once

from cellmap import ForcedSystem, Status, stroboscopic_map

TOLERANCE = 1e-9
STEPS = (0.04, 0.01, 0.0025)  # of the reference: shorter ones where both differ


def compared(seed: int, orbits: int) -> tuple[list[float], int, float]:
    """Return errors of good images in tolerances, how many only the reference has, and the CPU seconds of compiling."""
    rng = np.random.default_rng(seed)
    program = drawn(rng)
    begin = time.process_time()
    system = ForcedSystem(program.function(), {}, program.period, tuple("abc"[: program.dimension]))
    strobe = stroboscopic_map(system, rtol=TOLERANCE, atol=TOLERANCE)
    strobe.iterate(np.zeros((1, program.dimension)), 1)
    seconds = time.process_time() - begin
    places, found, missed = rng.uniform(-2.0, 2.0, (orbits, program.dimension)), [], 0
    images = strobe.iterate(places, 1)
    for place, image, status in zip(places, images.points, images.status, strict=True):
        error = None
        for step in STEPS:
            try:
                exact = program.image(place, step)
            except GivenUpError:
                continue
            error = float(np.max(np.abs(image - exact) / (TOLERANCE * (1.0 + np.abs(exact)))))
            if error < 1.0:
                break
        if error is not None and status == Status.OK:
            found.append(error)
        missed += error is not None and status != Status.OK
    return found, missed, seconds


@pytest.mark.parametrize("seed", at_once([19], later=[1, 8, 27]))
def test_programs(seed: int) -> None:
    found, missed, _ = compared(seed, 3)
    assert missed == 0
    assert len(found) == 3
    assert max(found) < 1.0


@pytest.mark.slow  # 200 programs, ten minutes: pytest tests/maps/test_branch_programs.py -m slow -s
@pytest.mark.parametrize("part", range(10))
def test_two_hundred_programs(part: int) -> None:
    errors, missed, seconds = [], 0, []
    for seed in range(20 * part, 20 * (part + 1)):
        found, only, compiling = compared(seed, 8)
        errors += found
        missed += only
        seconds.append(compiling)
    print(
        f"{len(seconds)} programs, {len(errors)} images, largest error {max(errors):.3g} tolerances, {missed} by the "
        f"reference alone; compiled in {np.median(seconds):.2g} CPU s as a median, {max(seconds):.2g} at most"
    )
    assert missed < 0.02 * len(errors)
    assert len(errors) > 0.9 * 160
    assert max(errors) < 10.0
