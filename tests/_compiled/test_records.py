"""Named tuples in the language of loops: made, nested, handed on, returned and changed as in Python."""

import ctypes
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from cellmap._compiled.loops import by_address, inlined, loop
from cellmap._compiled.translation.marks import Deferred
from tests._compiled.random_loops import imported
from tests._compiled.test_language import HEAD, made, refused, run
from tests._compiled.test_translation import differences


class Point(NamedTuple):
    x: float
    y: float = 0.5


class Walk(NamedTuple):
    places: Any
    ends: Point
    steps: int = 0


ORIGIN = Point(0.25)


@inlined
def moved(point, by):
    return point._replace(x=point.x + by.x, y=point.y + by.y)


@Deferred
def longer(path, by):
    """Return a path with one more place, counted."""
    path.places[path.steps, 0], path.places[path.steps, 1] = path.ends
    return path._replace(ends=moved(path.ends, by), steps=path.steps + 1)


@loop
def walked(places, out):
    by = Point(y=1.5, x=0.125)
    path = Walk(places, ORIGIN)
    for k in range(len(places)):
        step = Point(by.x * k, by.y)
        path = longer(path, step)
        if k % 2 == 1:
            path = Walk(steps=path.steps, places=path.places, ends=Point(path.ends.y, path.ends.x))
    out[0], out[1] = path.ends
    out[2], out[3] = path.ends[1], ORIGIN.y
    last = places[1:]
    out[4] = Walk(last, by).places[0, 1]
    return path.steps


@loop
def widened(n):
    """A field that is a whole number first, and a record that only a later turn makes one of floats."""
    sums = Point(0, n)
    for k in range(n):
        sums = sums._replace(x=sums.x + 0.5)
        sums = Point(sums.x, sums.y + k)
    return sums.x / 2 + sums.y


def test_records_are_those_of_python() -> None:
    places = np.zeros((5, 2))
    assert differences(walked, (places, np.zeros(5))) == []
    assert places[0].tolist() == [0.25, 0.5]
    assert differences(widened, (5,)) == []
    assert widened(5) == 16.25


@by_address
def call_by_parts(address, path):
    """Hand over a number, and all parts of a record one by one."""


class Three(NamedTuple):
    numbers: Any
    sums: Point


@loop
def by_parts(address, numbers):
    call_by_parts(address, Three(numbers, Point(2.0, 0.75)))


def test_a_record_is_handed_to_an_address_field_by_field() -> None:
    seen: list[tuple[float, ...]] = []
    kind = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_double), ctypes.c_double, ctypes.c_double)
    called = kind(lambda place, x, y: seen.append((place[0], place[1], x, y)))
    address = ctypes.cast(called, ctypes.c_void_p).value
    by_parts(address, np.array([1.5, -3.0]))
    assert seen == [(1.5, -3.0, 2.0, 0.75)]


BESIDE = (
    HEAD
    + """
from typing import NamedTuple
class Pair(NamedTuple):
    a: float
    b: float = 2.0
@inlined
def kept(x):
    return Pair(np.zeros(3), x)
"""
)
WRONG = {
    "a field that is not there": (["k = x", "return Pair(k, c=1.0).a"], 2, "Pair has no field c"),
    "no value for a field": (["return Pair(b=x).a"], 1, "Pair is not given a"),
    "two values for a field": (["return Pair(x, a=x).a"], 1, "Pair is given a twice"),
    "more values than fields": (["return Pair(x, x, x).a"], 1, "Pair has 2 fields, not 3"),
    "fields of another tuple": (["return Pair(**x).a"], 1, "Pair has no field **"),
    "another field is replaced": (["p = Pair(x)", "n = 1", "return p._replace(c=x).a"], 3, "p._replace has no field c"),
    "what is no record is replaced": (["return (x, n)._replace(a=x)[0]"], 1, "has no field a"),
    "a field is read that is not there": (["return Pair(x).c"], 1, "no such field"),
    "memory that does not last": (["return kept(x).b"], None, "does not last"),
    "memory of a loop": (
        ["for k in range(n):", "    m = np.zeros(2)", "    p = Pair(m)", "return x"], 3, "made in a loop",
    ),
    "a record for Python": (["return Pair(x, x)"], None, "is returned to Python"),
    "records of one name with other kinds": (["p = Pair(x)", "p = Pair(a)", "return p.b"], 2, "one variable receives"),
    "a field is set": (["p = Pair(x)", "p.a = x", "return p.a"], None, "p.a"),
    "names of arguments of a function": (["return math.sqrt(x=x)"], 1, "by name are not in the language"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_records_are_refused_with_their_line(case: str, tmp_path: Path) -> None:
    lines, line, message = WRONG[case]
    function = made(lines, tmp_path, "case", BESIDE)
    said = refused(function)
    assert message in said
    if line is not None:
        assert f"case.py:{function.function.__code__.co_firstlineno + 1 + line}: " in said


def test_a_record_with_other_fields_is_another_loop(tmp_path: Path) -> None:
    """The class is in another file than the function, which stays as it is."""
    body = (
        "from cellmap._compiled.loops import loop\nPair = None\n@loop\ndef made(x):\n    return Pair(x).a - Pair(x).b\n"
    )
    results: list[float] = []
    for order in ("a: float\n    b: float = 3.0\n", "b: float\n    a: float = 5.0\n"):
        name = f"record_{len(results)}"
        pair = imported(f"from typing import NamedTuple\nclass Pair(NamedTuple):\n    {order}", tmp_path, name).Pair
        module = imported(body, tmp_path, "same")
        module.Pair, pair.__module__ = pair, "same"
        results.append(module.made(1.0))
    assert results == [-2.0, 4.0]


def test_constants_are_records_too(tmp_path: Path) -> None:
    head = BESIDE + "ONE = Pair(0.5)\n"
    of_one = ["p = ONE", "q = p._replace(b=x)", "return p.b + q.b + ONE._replace(a=x).a"]
    assert run(made(of_one, tmp_path, "one", head)) == 7.0
    pairs = ["pair = 1, 2.5", "k, m = pair", "return k + m + pair[0]"]
    assert run(made(pairs, tmp_path, "two", head)) == 4.5
    assert run(made(["return WEIGHTS[n - 2]"], tmp_path, "three", head + "WEIGHTS = 0.5, -2.0\n")) == -2.0
