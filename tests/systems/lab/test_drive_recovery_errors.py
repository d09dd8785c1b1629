"""Standard errors of recovered drives, over seeds of the noise."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from recorded_drives import SHORT, SINE, TWO, Array, deviations

from systems import Effect, VerticalDrive
from systems.lab import RecoveredDrive, record_acceleration, recover_drive


def uneven(seed: int) -> tuple[Array, Array]:
    times = np.sort(np.random.default_rng(seed).uniform(0.0, 0.5, 500))
    return times, record_acceleration(SINE, times, 30.0, rng=seed)


RECORDS: dict[str, tuple[Effect, Callable[[int], tuple[Array, Array]]]] = {
    "white": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 30.0, offset=9.8, rng=s))),
    "two harmonics": (TWO, lambda s: (SHORT, record_acceleration(TWO, SHORT, 10.0, rng=s))),
    "coloured": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 30.0, 0.005, rng=s))),
    "uneven": (SINE, uneven),
    "lost": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 30.0, missing=0.5, rng=s))),
    "8 bits": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 2.0, full_scale=400.0, bits=8, rng=s))),
    "saturated": (SINE, lambda s: (SHORT, record_acceleration(SINE, SHORT, 10.0, full_scale=200.0, rng=s))),
}


@cache
def recovered(name: str) -> list[RecoveredDrive]:
    """The drives of sixty records."""
    return [recover_drive(*RECORDS[name][1](seed)) for seed in range(60)]


FEW = ("white", *(pytest.param(n, marks=pytest.mark.thorough) for n in RECORDS if n != "white"))


@pytest.mark.parametrize("name", FEW)
def test_error_bars_cover_the_truth(name: str) -> None:
    """95 % within 1.96; of 60 seeds times parameters a fraction of 88 % and less has a chance below 0.001."""
    drive, _ = RECORDS[name]
    found = recovered(name)
    right = [f for f in found if len(f.amplitudes) == (2 if drive is TWO else 1)]
    assert len(right) >= 56
    fraction = np.mean([np.abs(deviations(drive, f)) < 1.96 for f in right])
    assert 0.88 <= fraction <= 0.995
    if name == "saturated":
        assert all(f.clipped > 150 for f in found)


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDS)
def test_error_bars_cover_95_percent(name: str) -> None:
    drive, make = RECORDS[name]
    found = [recover_drive(*make(seed)) for seed in range(600)]
    right = [f for f in found if len(f.amplitudes) == (2 if drive is TWO else 1)]
    assert len(right) >= 570
    fractions = np.mean([np.abs(deviations(drive, f)) < 1.96 for f in right], axis=0)
    assert ((fractions > 0.92) & (fractions < 0.98)).all()


@pytest.mark.thorough
def test_noise_is_no_drive() -> None:
    """A chance of 0.001 each: two and more of 60 have one of 0.002."""
    found = 0
    for seed in range(60):
        memory = 0.02 * (seed % 2)
        try:
            recover_drive(SHORT, record_acceleration(VerticalDrive(1e-15, 50.0), SHORT, 1.0, memory, rng=seed))
            found += 1
        except ValueError as error:
            assert "no drive found" in str(error)
    assert found <= 1
