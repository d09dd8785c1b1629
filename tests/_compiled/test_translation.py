"""The language of loops: whatever Python makes of a function, compiled code makes of it too."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cellmap._compiled.loops as loops
from cellmap._compiled.loops import Loop, inlined, loop

# mypy: disable-error-code="no-untyped-def"

AWKWARD = [0.0, -0.0, 1.0, -1.0, 0.5, -2.5, 3.75, 7.0, -7.0, 1e300, -1e-300, math.inf, -math.inf, math.nan]
NUMBERS = [0, 1, -1, 2, 3, -3, 7, -8, 2**40, -(2**62)]


@loop
def of_floats(x, y, out):
    out[0] = x + y
    out[1] = x - y
    out[2] = x * y
    out[3] = min(x, y)
    out[4] = max(x, y, 0.0)
    out[5] = abs(x)
    out[6] = -x
    out[7] = 1.0 if x < y <= 2.0 else 2
    out[8] = x < y or x != x
    out[9] = not (x > 0.0 and y > 0.0)
    out[10] = np.copysign(x, y)
    if x:
        out[11] = 1.0
    elif y == y:
        out[11] = 2.0


@loop
def of_whole_numbers(a, b, out):
    out[0] = a // b if b != 0 else 0
    out[1] = a % b if b != 0 else 0
    out[2] = a // 4 + a % 4
    out[3] = (a & b) | (a ^ 5)
    out[4] = a >> 3
    out[5] = (a & 255) << 7
    out[6] = min(a, b) + max(a, 3)
    out[7] = abs(a)
    out[8] = -(-a // 8)
    out[9] = 2 ** (a & 7)
    out[10] = np.int64(np.uint64(a & 1023) >> np.uint64(2))
    out[11] = (a > 0) + (b > 0)


def same(one: Any, other: Any) -> bool:
    return np.array_equal(one, other, equal_nan=True) and np.array_equal(np.signbit(one), np.signbit(other))


def test_operators_of_floats() -> None:
    for x in AWKWARD:
        for y in AWKWARD:
            found, expected = np.zeros(12), np.zeros(12)
            of_floats(x, y, found)
            with np.errstate(all="ignore"):
                of_floats.function(x, y, expected)
            assert same(found, expected), (x, y)


def test_operators_of_whole_numbers() -> None:
    for a in NUMBERS:
        for b in NUMBERS:
            found, expected = np.zeros(12, np.int64), np.zeros(12, np.int64)
            of_whole_numbers(a, b, found)
            of_whole_numbers.function(a, b, expected)
            assert found.tolist() == expected.tolist(), (a, b)


@loop
def remainders(x, y, out):
    out[0] = x % y
    out[1] = math.floor(x)
    out[2] = np.sqrt(abs(x))
    out[3] = np.log(abs(x) + 1.0)
    out[4] = abs(x) ** 1.5


def test_functions_of_mathematics() -> None:
    finite = [x for x in AWKWARD if math.isfinite(x) and abs(x) < 1e200]
    for x in finite:
        for y in (2.0, -2.0, 0.3):
            found, expected = np.zeros(5), np.zeros(5)
            remainders(x, y, found)
            remainders.function(x, y, expected)
            assert np.allclose(found, expected, rtol=4e-16, atol=0.0), (x, y)


@inlined
def halves(a, begin):
    return a[begin : begin + 2], begin + 2


@loop
def views(a, out):
    rows, columns = a.shape
    left, place = halves(out, 0)
    right, place = halves(out, place)
    left[:] = 1.5
    right[:] = a[0, 1:]
    first, second = a[:2]
    total = 0
    for value in a.flat:
        total += value
    out[4], out[5] = total, first[0] - second[-1]
    inner = a[:, 1:]
    for row in range(rows - 1, -1, -1):
        for column in range(inner.shape[1]):
            if row == 1:
                continue
            out[6] += inner[row, column]
            if column > 0:
                break
    out[7] = len(a[1:100]) + out[5:].size + columns
    for weight in (0.5, -2.0):
        out[8] += weight
    out[9:] = place


@pytest.mark.parametrize("layout", [np.ascontiguousarray, np.asfortranarray, lambda a: np.repeat(a, 2, 1)[:, ::2]])
def test_views(layout: Callable[[Any], Any]) -> None:
    a = layout(np.arange(9.0).reshape(3, 3))
    found, expected = np.zeros(11), np.zeros(11)
    views(a, found)
    views.function(a, expected)
    assert found.tolist() == expected.tolist()


@loop
def stored(small, signed, truths, unsigned, single):
    for i in range(small.size):
        small[i] += i
        signed[i] = signed[i] - 3
        truths[i] = not truths[i]
        unsigned[i] |= np.uint64(1) << np.uint64(i + 60)
        single[i] = 0.5 * single[i]
    return small[0] + signed[1] + truths[2]


def test_elements_of_every_size() -> None:
    def arrays() -> list[Any]:
        kinds = (np.uint8, np.int16, bool, np.uint64, np.float32)
        return [np.array([0, 1, 1, 0]).astype(kind) for kind in kinds]

    found, expected = arrays(), arrays()
    assert stored(*found) == stored.function(*expected)
    for one, other in zip(found, expected, strict=True):
        assert one.tolist() == other.tolist()


@loop
def newton(x):
    root, steps = 1, 0
    while True:
        better = 0.5 * (root + x / root)
        steps += 1
        if abs(better - root) < 1e-15 * better or steps > 60:
            return better
        root = better


def test_a_variable_that_begins_as_a_whole_number() -> None:
    for x in (2.0, 9.0, 1e10):
        assert newton(x) == pytest.approx(math.sqrt(x), rel=1e-15)


@loop
def swapped(n):
    one, other = np.zeros(n), np.ones(n, np.float64)
    for _ in range(3):
        fresh = np.empty_like(one)
        fresh[:] = 2.0
        one, other = other, one
        one[0] += fresh[n - 1]
    return 100.0 * one[0] + other[0]


def test_memory_of_a_loop() -> None:
    assert swapped(4) == swapped.function(4) == 502.0
    with pytest.raises(MemoryError):
        swapped(2**61)


@loop
def beyond(a, place):
    return a[place]


def test_bounds_are_checked_where_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loops, "CHECKED", True)
    checked = Loop(beyond.function)
    assert checked(np.arange(3.0), 2) == 2.0
    for place in (3, -4, 2**40):
        with pytest.raises(IndexError, match="index outside of its array"):
            checked(np.arange(3.0), place)


def written(function: Callable[..., Any]) -> Loop:
    return Loop(function)


def test_what_is_not_in_the_language_is_refused_with_its_line() -> None:
    def mixed(a):
        return np.uint64(3) + a

    def filled(a):
        a[0] = 1.5

    def unknown(a):
        return sorted(a)

    def changing(a):
        b = a
        if a[0] > 0.0:
            b = 1.0
        return b

    for function, given, said in [
        (mixed, 3, "say which of them is to be converted"),
        (filled, np.zeros(2, np.int64), "say how it is to be converted"),
        (unknown, np.zeros(2), "sorted is not in the language"),
        (changing, np.zeros(2), "one variable receives values of the kinds"),
    ]:
        with pytest.raises(TypeError, match=rf"test_translation\.py:\d+: .*{said}"):
            written(function)(given)
    read_only = np.zeros(2, np.int64)
    read_only.flags.writeable = False

    def write(a):
        a[0] = 1

    with pytest.raises(TypeError, match="read-only"):
        written(write)(read_only)


def test_a_file_that_was_changed_after_it_was_imported_is_not_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What would be compiled is not what was imported."""
    monkeypatch.setenv("CELLMAP_CACHE_DIR", str(tmp_path / "kernels"))  # an earlier test may have compiled it
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "changing_loops.py"
    file.write_text(text := "from cellmap._compiled.loops import loop\n@loop\ndef tripled(x):\n    return 3 * x\n")
    module = importlib.import_module("changing_loops")
    file.write_text(text.replace("3", "4"))
    with pytest.raises(RuntimeError, match=r"changing_loops\.py was changed after it had been imported"):
        module.tripled(2)
    file.write_text(text)
    assert module.tripled(2) == 6
