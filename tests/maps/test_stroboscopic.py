"""Stroboscopic maps: the tolerance is met, and the bits depend on nothing else."""

from collections.abc import Mapping
from math import pi

import numpy as np
import pytest
from numpy.typing import NDArray
from test_impacts import STRUCK
from two_tiers import at_once

from cellmap import ForcedSystem, Status, angle, set_threads, stroboscopic_map
from cellmap._compiled.kernels.blocks import LANES
from cellmap._compiled.machine_code import machine_code
from cellmap.maps.integration import steps_of_harmonics
from cellmap.maps.orbit_batch import CHUNK
from systems import dimensionless_pendulum

SPANS: dict[str, tuple[float, ...]] = {
    "pendulum, 3 mm": (pi, 500.0),
    "pendulum, 10 mm": (pi, 500.0),
    "vertically driven": (pi, 4.0),
    "Duffing": (2.2, 2.2),
    "forced pendulum": (pi, 4.0),
    "double pendulum": (pi, pi, 1.0, 1.0),
}
AT_ONCE = "pendulum, 3 mm", "Duffing"


def initial_conditions_of(name: str, count: int, seed: int = 0) -> NDArray[np.float64]:
    span = SPANS[name]
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, len(span))) * span


@pytest.mark.parametrize(
    ("method", "tolerance"),
    [
        ("auto", 1e-9),
        ("auto", 1e-12),
        ("DOP853", 1e-6),
        ("DOP853", 1e-9),
        ("DOP853", 1e-12),
        ("RK45", 1e-6),
        ("RK45", 1e-9),
    ],
)
@pytest.mark.parametrize("name", at_once(AT_ONCE, later=SPANS))
def test_the_tolerance_is_met_at_precise_images(problems, precise_images, allowance, name, method, tolerance):
    """Against mpmath's images, fast rotations included."""
    rows = [r for r in precise_images if r["problem"] == name]
    initial_conditions, exact = (np.array([r[key] for r in rows]) for key in ("start", "image"))
    strobe = stroboscopic_map(problems[name], rtol=tolerance, atol=tolerance, method=method)
    images = strobe.iterate(initial_conditions, 1)
    assert (images.status == Status.OK).all()
    assert (np.abs(images.unwrapped - exact) <= allowance(problems[name], exact, tolerance, tolerance)).all()


@pytest.mark.slow
def test_the_table_of_precise_images_is_reproduced(problems, precise_images, precise_image):
    for name in SPANS:
        row = next(r for r in precise_images if r["problem"] == name)
        assert precise_image(problems[name], row["start"]) == pytest.approx(row["image"], rel=1e-15)


@pytest.mark.parametrize("phase", [0.25, -3.4])
def test_the_section_lies_at_the_phase(problems, scipy_images, phase):
    for name in ("Duffing", "pendulum, 3 mm"):
        initial_conditions = initial_conditions_of(name, 4, seed=5)
        images = stroboscopic_map(problems[name], phase=phase).iterate(initial_conditions, 1).unwrapped
        exact = scipy_images(problems[name], initial_conditions, phase=phase)
        assert images == pytest.approx(exact, rel=1e-8, abs=1e-8)


def test_free_rotation_loses_nothing_over_many_periods() -> None:
    """A rotor at 7.25 rotations a period: after 2,000 periods the angle is exact to rounding of each."""
    rotor = ForcedSystem(
        lambda t, x, p: (x[1], 0.0 * x[0]), {}, 1.0, (angle("x", "turns", period=1.0, lower=0.0), "rate")
    )
    images = stroboscopic_map(rotor).iterate([0.125, 7.25], 2000)
    assert images.points == pytest.approx([0.125, 7.25], abs=1e-11)
    assert images.rotations.tolist() == [14500, 0]


@pytest.mark.parametrize(
    ("name", "method"),
    at_once(
        [("Duffing", "DOP853"), ("impacts", "auto")],
        later=[("double pendulum", "auto"), ("dry friction", "auto"), ("vertically driven", "auto")],
    ),
)
def test_an_image_does_not_depend_on_its_neighbours(problems, name, method):
    """Bit by bit, whether or not others stick: order, number and kind of the orbits, and the number of threads."""
    events = {"dry friction": (dimensionless_pendulum(0.5, 0.3, 0.03, 0.4), (pi, 3.0)), "impacts": (STRUCK, (1.5, 1.5))}
    system, span = events.get(name) or (problems[name], SPANS[name])
    strobe = stroboscopic_map(system, method=method)
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (CHUNK + 777, len(span))) * span
    set_threads(1)
    images = strobe.iterate(initial_conditions, 2).points
    set_threads(None)
    order = np.random.default_rng(1).permutation(len(initial_conditions))
    assert np.array_equal(strobe.iterate(initial_conditions[order], 2).points, images[order])
    for count in (1, 2, LANES - 1, LANES, LANES + 1, 3 * LANES + 5):
        for first in range(1000, 1000 + 3 * LANES, 29):
            part = slice(first, first + count)
            assert np.array_equal(strobe.iterate(initial_conditions[part], 2).points, images[part])
    for threads in (2, 3):
        set_threads(threads)
        assert np.array_equal(strobe.iterate(initial_conditions, 2).points, images)


def test_a_sweep_compiles_nothing(problems: Mapping[str, ForcedSystem]) -> None:
    system = problems["Duffing"]
    stroboscopic_map(system)([0.1, 0.1])
    compiled = machine_code.cache_info().misses
    swept = [system.with_params(forcing=f, frequency=w) for f in np.linspace(0.1, 0.3, 5) for w in (0.9, 1.0)]
    images = [stroboscopic_map(one)([0.1, 0.1]) for one in swept]
    assert machine_code.cache_info().misses == compiled
    assert len(np.unique(images, axis=0)) == 10


def test_steps_are_half_the_number_of_the_highest_harmonic_or_one():
    strengths = np.array([1.0, 0.0, 0.0, 1.0, 0.1])
    assert [steps_of_harmonics(strengths[:n]) for n in (1, 4, 5)] == [1, 2, 3]
    assert [steps_of_harmonics(strengths, least) for least in (0.1, 1.0)] == [2, 1]
