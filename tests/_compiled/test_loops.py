"""Loops that are compiled once: their arguments, their errors, and processes that find them compiled."""

import threading
from collections import namedtuple
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from cellmap._compiled.kernels.calls import array_at
from cellmap._compiled.loops import Loop, _source_of, inlined, loop
from tests._compiled.processes import printed

Whole = np.ndarray[Any, np.dtype[Any]]


class Scaled(NamedTuple):
    """A factor, and numbers to be multiplied by it."""

    factor: float
    numbers: Whole


@inlined
def twice(x):
    return x + x


@loop
def double(values, out):
    n, d = values.shape
    memory = np.zeros(d)
    for i in range(n):
        for j in range(d):
            memory[j] = twice(values[i, j])
        for j in range(d):
            out[i, j] = memory[j]
    return n * d


@loop
def scale(scaled, by, out):
    for i in range(len(scaled.numbers)):
        out[i] = scaled.factor * scaled.numbers[i] + by
    return by > 1


@loop
def table(size):
    return np.zeros(size)[0]


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CELLMAP_CACHE_DIR", str(tmp_path))
    return tmp_path


def arrays() -> list[Whole]:
    numbers = np.arange(12.0)
    read_only = numbers.reshape(3, 4).copy()
    read_only.flags.writeable = False
    return [
        numbers.reshape(3, 4),
        np.asfortranarray(numbers.reshape(3, 4)),
        numbers.reshape(2, 3, 2)[:, :, 0],
        numbers.reshape(3, 4).astype(np.int64),
        numbers.reshape(3, 4).view(np.dtype("f8", metadata={"from": "a file"})),
        read_only,
        np.zeros((0, 4)),
    ]


def test_arrays_of_every_layout_and_type_of_numbers_one_after_the_other() -> None:
    """No array is taken for one of another type, whatever came before."""
    for values in 2 * arrays():
        out = np.full(values.shape, -1.0)
        assert double(values, out) == values.size
        assert np.array_equal(out, 2 * values)


def test_tuples_and_numbers_of_every_kind() -> None:
    numbers = np.arange(3.0)
    for by in (1, 2.5, np.float64(0.5), np.int32(3), True):
        for numbers in (np.arange(3.0), np.arange(6.0)[::2]):
            out = np.empty(3)
            assert scale(Scaled(2.0, numbers), by, out) is bool(by > 1)
            assert np.array_equal(out, 2.0 * numbers + by)


def test_errors_of_a_loop_come_to_its_caller() -> None:
    assert table(3) == 0.0
    errors = [(-3, ValueError), (2**58, MemoryError), (2**70, OverflowError), (np.uint64(2**63), OverflowError)]
    errors += [(number, TypeError) for number in ("3", 1j, None, [1.0], np.longdouble(1.0))]
    for size, error in errors:
        with pytest.raises(error, match="negative dimensions" if error is ValueError else None):
            table(size)


def counted(step: int) -> Loop:
    @loop
    def count(out):
        for i in range(len(out)):
            out[i] = step * i

    return count


def test_values_around_a_loop_belong_to_it(fresh: Path) -> None:
    first, second = np.zeros(3), np.zeros(3)
    counted(2)(first)
    counted(3)(second)
    assert first.tolist() == [0.0, 2.0, 4.0]
    assert second.tolist() == [0.0, 3.0, 6.0]
    assert len(list(fresh.glob("*.object"))) == 2
    counted(2)(first)
    assert len(list(fresh.glob("*.object"))) == 2


LIBRARY = """
from cellmap._compiled.loops import inlined, loop
from numbers_beside import OFFSET

@inlined
def shifted(x):
    return x + OFFSET

@loop
def answer(x):
    return 2.0 * shifted(x)

@loop
def other(x):
    return 3.0 * x
"""


def test_a_loop_is_compiled_again_after_a_change_of_what_it_is_compiled_from(tmp_path: Path) -> None:
    (tmp_path / "library.py").write_text(LIBRARY)

    def run(offset: float) -> str:
        (tmp_path / "numbers_beside.py").write_text(f"OFFSET = {offset}")
        program = "import sys, library; print(library.answer(1.0), library.other(1.0), 'numba' in sys.modules)"
        return printed(program, tmp_path / "kept", str(tmp_path))

    assert run(1.0) == "4.0 3.0 False\n"
    assert run(1.0) == "4.0 3.0 False\n"
    assert run(25.0) == "52.0 3.0 False\n"
    assert len(list((tmp_path / "kept").glob("*.object"))) == 3


def test_threads_that_come_first_together_share_one_machine_code(fresh):
    """Code that a thread is running stays where it is, whoever else has compiled the same."""

    @loop
    def tripled(values):
        return values[0] * 3

    entries, together = [], threading.Barrier(4)

    def work():
        together.wait()
        assert tripled(np.array([2.0])) == 6.0
        entries.append(tripled._entry)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(entries) == 4
    assert len(set(map(id, entries))) == 1


@loop(contract=False)
def added(a):
    total = 0.0
    for v in a.flat:
        total += v
    return total


@loop
def factor_of(scaled):
    return scaled.factor


def test_arrays_of_any_kind_are_right_or_refused() -> None:
    kinds = np.zeros((0, 3)), np.array(2.0), np.arange(9)[::-2], np.broadcast_to(1.5, (2, 2)), np.array([1, 0], bool)
    for one in kinds:
        assert added(one) == one.sum()
    misaligned = np.zeros(17, np.uint8)[1:].view(np.float64)
    foreign = [np.arange(3).astype(kind) for kind in (">f8", ">i8", object, complex, np.float16, np.longdouble, "U2")]
    foreign += [misaligned, np.zeros(1).view(np.recarray), np.ma.masked_array([1.0]), np.zeros(2, [("a", "f8")])]
    for one in foreign:
        with pytest.raises(TypeError, match=r"convert it|make an ndarray"):
            added(one)


def test_tuples_of_two_classes_of_one_name_and_equal_fields() -> None:
    classes = [namedtuple("Twin", ["numbers", "factor"]) for _ in range(2)]
    assert [factor_of(one(1, factor)) for factor, one in enumerate(classes)] == [0, 1]
    assert factor_of(namedtuple("Twin", ["factor", "numbers"])(3.0, 1)) == 3.0


@loop
def first_at(address):
    return array_at(address, 2)[0]


def test_a_loop_is_told_from_others_alike_in_every_process() -> None:
    """Else each compiles it again: the operation that it uses lies elsewhere in memory."""
    value = np.array([2.5, 1.0])
    assert first_at(value.ctypes.data) == 2.5
    said = _source_of(first_at.function)
    assert "marks.ArrayAt" in said
    assert " at 0x" not in said
