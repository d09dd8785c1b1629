"""The language of loops: whatever Python makes of a function, compiled code makes of it too."""

import importlib
import itertools
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cellmap._compiled.loops as loops
from cellmap._compiled.loops import Loop, inlined, loop
from tests._compiled.random_loops import AWKWARD, copied, imported

NUMBERS = [0, 1, -1, 2, 3, -3, 7, -8, 2**40, -(2**62)]


FLOATS = """x + y|x - y|x * y|min(x, y)|max(x, y, 0.0)|abs(x)|-x|1.0 if x < y <= 2.0 else 2|x < y or x != x
not (x > 0.0 and y > 0.0)|np.copysign(x, y)|1.0 if x else 2.0 if y == y else 0.0"""
WHOLE = """x // y if y != 0 else 0|x % y if y != 0 else 0|x // 4 + x % 4|(x & y) | (x ^ 5)|x >> 3|(x & 255) << 7|abs(x)
min(x, y) + max(x, 3)|-(-x // 8)|2 ** (x & 7)|np.int64(np.uint64(x & 1023) >> np.uint64(2))|(x > 0) + (y > 0)"""
MATHEMATICS = "x % y|math.floor(x)|np.sqrt(abs(x))|np.log(abs(x) + 1.0)|abs(x) ** 1.5"
MODERATE = [x for x in AWKWARD if math.isfinite(x) and abs(x) < 1e200]
OPERATORS: list[tuple[str, Any, list[Any], list[Any], float]] = [
    (FLOATS, float, AWKWARD, AWKWARD, 0.0),
    (WHOLE, np.int64, NUMBERS, NUMBERS, 0.0),
    (MATHEMATICS, float, MODERATE, [2.0, -2.0, 0.3], 4e-16),
]


def differences(function: Loop, given: tuple[Any, ...], rtol: float = 0.0) -> list[tuple[Any, Any]]:
    """Return results and arguments of compiled code that are not those of Python: without a tolerance, in any bit."""
    own = copied(given)
    returned = function(*own)
    with np.errstate(all="ignore"):
        expected = function.function(*given)
    return [
        (one, other)
        for one, other in zip([returned, *own], [expected, *given], strict=True)
        if one is not other and not (np.allclose(one, other, rtol=rtol, atol=0.0) if rtol else same(one, other))
    ]


def same(one: Any, other: Any) -> bool:
    return np.array_equal(one, other, equal_nan=True) and np.array_equal(np.signbit(1.0 * one), np.signbit(1.0 * other))


@pytest.mark.parametrize(("texts", "kind", "first", "second", "rtol"), OPERATORS, ids=["floats", "whole", "functions"])
def test_operators(texts: str, kind: Any, first: Any, second: Any, rtol: float, tmp_path: Path) -> None:
    expressions = re.split(r"(?<! )\|(?! )|\n", texts)
    lines = [f"    out[{place}] = {one}" for place, one in enumerate(expressions)]
    head = "import math\nimport numpy as np\nfrom cellmap._compiled.loops import loop\n@loop\ndef function(x, y, out):"
    function = imported("\n".join([head, *lines]), tmp_path, "operators").function
    for x, y in itertools.product(first, second):
        assert differences(function, (x, y, np.zeros(len(lines), kind)), rtol) == [], (x, y)


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


@loop
def stored(small, signed, truths, unsigned, single):
    for i in range(small.size):
        small[i] += i
        signed[i] = signed[i] - 3
        truths[i] = not truths[i]
        unsigned[i] |= np.uint64(1) << np.uint64(i + 60)
        single[i] = 0.5 * single[i]
    return small[0] + signed[1] + truths[2]


@loop
def newton(x):
    root, steps = 1, 0
    while True:
        better = 0.5 * (root + x / root)
        steps += 1
        if abs(better - root) < 1e-15 * better or steps > 60:
            return better
        root = better


@loop
def swapped(n):
    one, other = np.zeros(n), np.ones(n, np.float64)
    for _ in range(3):
        fresh = np.empty_like(one)
        fresh[:] = 2.0
        one, other = other, one
        one[0] += fresh[n - 1]
    return 100.0 * one[0] + other[0]


NINE = np.arange(9.0).reshape(3, 3)
KINDS = (np.uint8, np.int16, bool, np.uint64, np.float32)
CALLS: list[tuple[Loop, tuple[Any, ...]]] = [
    *((views, (a, np.zeros(11))) for a in (NINE, np.asfortranarray(NINE), np.repeat(NINE, 2, 1)[:, ::2])),
    (stored, tuple(np.array([0, 1, 1, 0]).astype(kind) for kind in KINDS)),
    *((newton, (x,)) for x in (2.0, 9.0, 1e10)),
    (swapped, (4,)),
]


@pytest.mark.parametrize(("function", "given"), CALLS)
def test_functions(function: Loop, given: tuple[Any, ...]) -> None:
    assert differences(function, given) == []


def test_values_that_are_known() -> None:
    assert swapped(4) == 502.0
    assert [newton(x) for x in (2.0, 9.0, 1e10)] == pytest.approx([math.sqrt(2.0), 3.0, 1e5], rel=1e-15)
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


READ_ONLY = np.zeros(2)
READ_ONLY.flags.writeable = False
REFUSED = [
    (mixed, 3, r"test_translation\.py:\d+: .*say which of them is to be converted"),
    (filled, np.zeros(2, np.int64), r"test_translation\.py:\d+: .*say how it is to be converted"),
    (unknown, np.zeros(2), r"test_translation\.py:\d+: .*sorted is not in the language"),
    (changing, np.zeros(2), r"test_translation\.py:\d+: .*one variable receives values of the kinds"),
    (filled, READ_ONLY, "read-only"),
]


@pytest.mark.parametrize(("function", "given", "said"), REFUSED)
def test_what_is_not_in_the_language_is_refused_with_its_line(function: Any, given: Any, said: str) -> None:
    with pytest.raises(TypeError, match=said):
        Loop(function)(given)


def test_a_file_that_was_changed_after_it_was_imported_is_not_compiled(tmp_path, monkeypatch):
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
