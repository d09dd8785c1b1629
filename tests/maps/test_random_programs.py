"""Random forced right-hand sides with branches that use one another's results: no image that is good is wrong."""

import numpy as np
import pytest

from cellmap import ForcedSystem, Status, stroboscopic_map

TOLERANCE = 1e-9
STEPS = (0.05, 0.01, 0.002, 0.0004)  # of the reference: shorter ones where both differ


def errors(seed: int, draws: int, orbits: int, compiled: bool = True) -> tuple[list[float], int]:
    """Return the errors of good images, in tolerances, and how many only the reference has, with several draws."""
    from frozen_branches import DONE
    from random_programs import drawn

    rng = np.random.default_rng(seed)
    right_hand_side = drawn(rng)
    dimension, period = len(right_hand_side.rates), right_hand_side.period
    parameters = right_hand_side.parameters(rng)
    system = ForcedSystem(right_hand_side.function(), parameters, period, tuple("abcd"[:dimension]))
    strobe, found, missed = stroboscopic_map(system, rtol=TOLERANCE, atol=TOLERANCE), [], 0
    for _ in range(draws):
        parameters = right_hand_side.parameters(rng)
        program = right_hand_side.program(parameters)
        places = rng.uniform(-2.0, 2.0, (orbits, dimension))
        images = strobe.with_params(**parameters).iterate(places, 1)
        for place, image, status in zip(places, images.points, images.status, strict=True):
            for step in STEPS:
                exact, outcome, _ = program.image(period, place, step, compiled)
                if status != Status.OK:
                    missed += outcome == DONE and not strobe.unknown_formulas  # too many branches are said to be so
                    break
                error = float(np.max(np.abs(image - exact) / (TOLERANCE * (1.0 + np.abs(exact)))))
                if outcome != DONE or error < 1.0:
                    break
            if outcome == DONE and status == Status.OK:
                found.append(error)
    return found, missed


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "compiled"), [(11, False), (7, True), (8, True), (13, True)])
def test_programs(seed: int, compiled: bool) -> None:
    found, missed = errors(seed, 2, 2, compiled)
    assert (missed, len(found)) == (0, 4)
    assert max(found) < 1.0


@pytest.mark.slow  # 10,000 right-hand sides, of which 1,250 are compiled: an hour
@pytest.mark.parametrize("part", range(25))
def test_ten_thousand_right_hand_sides(part: int) -> None:
    """What is not compared blows up, or meets events without end, by the reference as well."""
    found, missed = [], 0
    for seed in range(50 * part, 50 * (part + 1)):
        good, only = errors(seed, 8, 3)
        found += good
        missed += only
    print(f"{len(found)} images, largest error {max(found):.3g} tolerances, {missed} by the reference alone")
    assert missed < 0.01 * len(found)
    assert len(found) > 0.8 * 50 * 8 * 3
    assert max(found) < 10.0
