"""Images from coarse to fine, and calls of bounded time: the same bits as a whole call, in any order, or a warning."""

import gc
import threading
import time
import warnings
import weakref
from collections.abc import Iterator
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest
from known_basins import CONSERVATIVE, RUNS, WINDOW, assert_same, duffing

from cellmap import CellGrid, Label, find_basins, interpolated_map, load_basins, set_threads
from cellmap.attractors.search import Search
from cellmap.basins import refine_basins
from cellmap.basins.strides import strided_tiles

TABLE = CellGrid((-2.5, -2.5), (2.5, 2.5), (96, 96))
THOROUGH = ("table", "small basins", "undecided", "chaotic", "multi-period steps")
CASES = RUNS | {"table": (lambda: interpolated_map(duffing(), TABLE, tolerance=1e-2), WINDOW, {})}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.thorough] if name in THOROUGH else []) for name in CASES]
)
def test_the_last_frame_has_the_bits_of_a_whole_call(name: str) -> None:
    make, places, settings = CASES[name]
    whole = find_basins(make(), places, **settings)
    for threads in (1, 2):
        set_threads(threads)
        frames = list(refine_basins(make(), places, **settings))
        assert_same(frames[-1].basins, whole)
        assert [f.complete for f in frames] == [False] * (len(frames) - 1) + [True]
        strides = [f.stride for f in frames]
        # Tiles of several threads may be completed in another order.
        assert strides[:4] == [8, 4, 2, 1] if threads == 1 else strides == sorted(strides, reverse=True)
        for frame in frames:
            coarse = frame.basins.labels[tuple(slice(None, None, frame.stride) for _ in whole.labels.shape)]
            assert not (coarse == Label.UNLABELLED).any()


def test_frames_are_images_of_what_is_known() -> None:
    """What has an attractor keeps it; an image has no holes, and each finer one is nearer to the last."""
    set_threads(1)
    frames = list(refine_basins(duffing(), WINDOW))
    last, wrong = frames[-1].image, []
    assert last is frames[-1].basins.labels
    for frame in frames:
        known = frame.basins.labels >= 0
        assert (frame.basins.labels[known] == last[known]).all()
        assert np.array_equal(frame.image[known], last[known])
        assert (frame.image >= 0).all()
        wrong.append(int(np.count_nonzero(frame.image != last)))
    assert wrong == sorted(wrong, reverse=True)
    first = frames[0].image
    assert np.array_equal(first[4:12, 4:12], np.full((8, 8), last[8, 8]))
    assert wrong[0] < 0.2 * last.size
    assert wrong[-1] == 0


def test_a_map_with_known_attractors_is_drawn_before_others_are_sought(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = find_basins(duffing(), WINDOW)
    sought: list[int] = []

    def seeking(*given: object) -> None:
        sought.append(len(given))
        raise KeyboardInterrupt

    monkeypatch.setattr(Search, "by_sample", seeking)
    frames = refine_basins(duffing(), WINDOW, attractors=whole.attractors)
    first = next(frames)
    assert first.stride == 8
    assert not sought
    assert np.array_equal(first.basins.labels[::8, ::8], whole.labels[::8, ::8])
    with pytest.raises(KeyboardInterrupt):
        next(frames)


@pytest.mark.parametrize("shape", [(1,), (7,), (2000,), (5, 300), (100, 90), (4, 5, 6), (200, 30, 40), (3, 4, 5, 6)])
@pytest.mark.parametrize("stride", [1, 2, 8])
def test_tiles_hold_every_place_once(shape: tuple[int, ...], stride: int) -> None:
    groups, seen = strided_tiles(shape, stride, None), np.zeros(int(np.prod(shape)), int)
    step = stride
    for group in groups:
        for tile in group:
            assert len(tile) == len(tile.rows) <= 8192
            assert (np.diff(tile.rows) > 0).all()
            seen[tile.rows] += 1
        coarse = seen.reshape(shape)[tuple(slice(None, None, step) for _ in shape)]
        assert (coarse == 1).all()
        assert seen.sum() == coarse.size
        step //= 2
    assert (seen == 1).all()


def test_tiles_near_a_point_come_first() -> None:
    set_threads(1)
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (300, 300))
    frames = refine_basins(duffing(), grid, stride=1, near=(2.0, -2.0), interval=0.0)
    known = next(frames).basins.labels != Label.UNLABELLED
    assert known.sum() == 44 * 64
    assert known[256:, :64].all()
    far = next(refine_basins(duffing(), grid.centres(), stride=1, near=(-2.0, 2.0), interval=0.0))
    assert (far.basins.labels[:64, 256:] != Label.UNLABELLED).all()
    assert (far.basins.labels == Label.UNLABELLED).sum() == 300 * 300 - 44 * 64


def test_an_iteration_is_cancelled_from_another_thread() -> None:
    """Nothing settles for a million periods: without an end from outside this takes minutes."""
    slow = refine_basins(CONSERVATIVE, CellGrid((-0.4, -0.4), (0.4, 0.4), (500, 500)), 10**6)
    ended: list[float] = []
    threading.Timer(0.3, lambda: (ended.append(time.perf_counter()), slow.cancel())).start()
    frames = list(slow)
    assert time.perf_counter() - ended[0] < 1.0
    assert not any(frame.complete for frame in frames)
    assert list(slow) == []


def test_what_is_dropped_ends_at_once_and_waits_for_no_garbage_collector() -> None:
    """It would close the threads of an iteration at any moment, perhaps while their locks are held."""
    set_threads(2)
    gc.collect()
    gc.disable()
    try:
        frames = refine_basins(duffing(), WINDOW)
        run = weakref.ref(frames._run)
        next(frames)
        del frames
        assert run() is None
    finally:
        gc.enable()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Hundredths of a second that deadlines have seen: one for each look at the clock, on a machine of any speed."""
    looks = count()
    monkeypatch.setattr("cellmap._lib.stopping.time", SimpleNamespace(monotonic=lambda: 0.01 * next(looks)))
    return looks


def test_a_call_ends_in_time_with_what_is_decided(clock: Iterator[int]) -> None:
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (700, 700))
    whole = find_basins(duffing(), WINDOW)
    began = next(clock)
    with pytest.warns(UserWarning, match=r"of 490,000 initial conditions are unlabelled.* max_seconds"):
        some = find_basins(duffing(), grid, attractors=whole.attractors, max_seconds=0.4)
    assert next(clock) - began < 100
    unlabelled = some.labels == Label.UNLABELLED
    assert 0 < unlabelled.sum() < grid.size
    assert some.fractions[Label.UNLABELLED].count == unlabelled.sum()
    assert some.label_name(Label.UNLABELLED) == "unlabelled"
    assert not (some.labels == Label.UNDECIDED).any()
    assert (some.settling_time[unlabelled] == -1).all()
    flat, rows = grid.centres().reshape(-1, 2), np.flatnonzero(~unlabelled.ravel())[::97]
    assert np.array_equal(find_basins(duffing(), flat[rows]).labels, some.labels.ravel()[rows])
    verified = some.verify(500)
    assert verified.wrong == 0
    assert verified.excluded > 0


@pytest.mark.usefixtures("clock")
def test_a_checkpoint_goes_on_where_the_time_was_over(tmp_path) -> None:
    grid, path, calls = CellGrid((-2.2, -2.2), (2.2, 2.2), (100, 100)), tmp_path / "basins.h5", 0
    whole = find_basins(duffing(), grid)
    open_ = True
    while open_:
        calls += 1
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            found = find_basins(duffing(), grid, checkpoint=path, max_seconds=0.1 * calls)
        open_ = bool((found.labels == Label.UNLABELLED).any())
        assert len(told) == open_
    assert calls > 1
    assert_same(found, whole)
    assert np.array_equal(load_basins(path).labels, whole.labels)


def test_a_single_initial_condition_is_an_image_of_one_place() -> None:
    *_, last = refine_basins(duffing(), (1.0, 0.0), max_seconds=600.0)
    assert last.complete
    assert_same(last.basins, find_basins(duffing(), (1.0, 0.0)))
    with pytest.raises(ValueError, match="stride=6: give a power of two"):
        refine_basins(CONSERVATIVE, WINDOW, stride=6)
    with pytest.raises(ValueError, match=r"near has shape \(1,\)"):
        refine_basins(CONSERVATIVE, WINDOW, near=(1.0,))
