"""The limits of the language of loops, as its table in docs/loop-language.md states them."""

import ast
import math
import re
from pathlib import Path

import numpy as np
import pytest

import cellmap._compiled.loops as loops
from cellmap._compiled.loops import Loop, loop
from cellmap._compiled.translation.grammar import LanguageError
from tests._compiled.random_loops import imported
from tests._compiled.test_translation import differences

PAGE = Path(__file__).parents[2] / "docs" / "loop-language.md"
HEAD = "import math\nimport numpy as np\nfrom cellmap._compiled.loops import inlined, loop\n"


def rows() -> list[tuple[list[str], str]]:
    """Return what is written in loops, and what becomes of it."""
    table = PAGE.read_text().split("| written in a loop | what becomes of it |\n|---|---|\n")[1].split("\n\n")[0]
    cells = [line.strip("| ").split(" | ") for line in table.splitlines()]
    return [(re.findall(r"`([^`]+)`", written), becomes) for written, becomes in cells]


def made(lines: list[str], path: Path, name: str, head: str = HEAD) -> Loop:
    """Return a function of the language with these lines."""
    body = "".join(f"    {line}\n" for line in lines)
    function: Loop = imported(f"{head}@loop(contract=False)\ndef function(x, n, a, u):\n{body}", path, name).function
    return function


def run(function: Loop) -> object:
    result: object = function(2.5, 3, np.arange(4.0), np.array([5, 2**63 + 5], np.uint64))
    return result


def refused(function: Loop) -> str:
    """Return the message of an error with file and line."""
    with pytest.raises(LanguageError, match=rf"{re.escape(function.function.__code__.co_filename)}:\d+: ") as caught:
        run(function)
    return str(caught.value)


def test_the_table_of_limits_is_the_compiler_s(tmp_path: Path) -> None:
    seen = 0
    for row, (written, becomes) in enumerate(rows()):
        for place, one in enumerate(written):
            is_expression = isinstance(ast.parse(one).body[0], ast.Expr)
            lines = [f"return {one}"] if is_expression and "yield" not in one else [one]
            if one.startswith("range"):
                lines = [f"for k in {one}:", "    pass"]
            function = made(lines, tmp_path, f"row_{row}_{place}")
            seen += 1
            if becomes.startswith("refused"):
                refused(function)
            else:
                expected = eval(becomes.split("`")[1], {"inf": math.inf, "nan": math.nan})
                assert run(function) == pytest.approx(expected, abs=0.0, rel=0.0, nan_ok=True), one
    assert seen > 60


CASES = {
    "a name that only some runs set": ["if n > 5:", "    late = 1", "return late"],
    "such a name beside one of two kinds": ["if n > 5:", "    late = 1", "k = n", "k = x", "return late"],
    "a name of a loop after it": ["for late in range(n):", "    pass", "return late"],
    "a name set beside a break": ["while True:", "    if n > 2:", "        break", "    late = 1", "return late"],
    "a name of the module that is set later": ["found = THREE", "THREE = 1", "return found"],
    "an end without a result": ["if n > 5:", "    return 1.0"],
    "else of a for": ["for v in a:", "    x += v", "else:", "    x = 0.0", "return x"],
    "else of a while": ["while n > 5:", "    pass", "else:", "    x = 0.0", "return x"],
    "try": ["try:", "    return x", "except ValueError:", "    return 0.0"],
    "an array of a loop under two names": [
        "first = a", "for v in range(3):", "    fresh = np.zeros(4)", "    first = fresh", "return first[0]",
    ],
    "an array of a loop that is read while it is made": [
        "b = np.zeros(4)", "for v in range(3):", "    b, x = np.ones(4), b[0]", "return x",
    ],
    "an array that does not last": ["return view(x)[0]"],
    "a function that calls itself": ["return again(n)"],
    "too many arguments": ["return math.sqrt(x, x)"],
    "too few arguments": ["return view()"],
    "positions that are ignored": ["return np.empty_like(a, np.int64)[0]"],
    "a module without that": ["return math.nothing"],
    "constants that raise": ["return n + 1 // 0"],
    "constants that are written to": ["WEIGHTS[n - 3] = 1.0"],
    "a place in a tuple that is no constant": ["return (x, n)[n]"],
    "a number that does not fit": ["b = np.zeros(2, np.int8)", "b[0] = 128"],
}  # fmt: skip
BESIDE = (
    HEAD
    + """
THREE, WEIGHTS = 3, (0.5, 2.0)
@inlined
def view(x):
    made = np.zeros(3)
    made[:] = x
    return made[1:]
@inlined
def again(n):
    return again(n - 1)
"""
)


@pytest.mark.parametrize("case", CASES)
def test_what_differs_in_silence_is_refused(case: str, tmp_path: Path) -> None:
    refused(made(CASES[case], tmp_path, "case", BESIDE))


def test_the_head_of_a_function_is_looked_at_too(tmp_path: Path) -> None:
    for k, head in enumerate(("x=1.0", "*x", "x, /", "*, x", "**x")):
        function = imported(f"{HEAD}@loop\ndef function({head}):\n    return 1.0\n", tmp_path, f"head{k}").function
        with pytest.raises(LanguageError, match=rf"head{k}\.py:\d+: arguments with"):
            function(2.0)
    with pytest.raises(LanguageError, match="no function made with def"):
        Loop(lambda x: x)(2.0)


@loop(contract=False)
def overlapping(out):
    out[1:] = out[: len(out) - 1]
    out[0:3] = out[2:5]


@loop(contract=False)
def divided(a, b, out):
    out[0], out[1], out[2], out[3] = a // b, a % b, a >> b, (a & 255) << (b & 63)


@loop(contract=False)
def chained(a, n):
    return 0 <= n < a.size > a[n]


@loop(contract=False)
def counted(n, step):
    total = 0
    for k in range(0, n, step):
        total += k
    return total


def test_slices_that_overlap_are_copied_whole() -> None:
    assert differences(overlapping, (np.arange(6.0),)) == []


def test_divisions_that_the_processor_refuses_wrap_as_those_of_numpy() -> None:
    for a in (-(2**63), -(2**63) + 1, -7, 0, 5, 2**63 - 1):
        for b in (-1, 0, 1, 2**62, -(2**63), 63, 64, 1000):
            found, expected = np.zeros(4, np.int64), np.zeros(4, np.int64)
            divided(a, b, found)
            with np.errstate(all="ignore"):
                divided.function(np.int64(a), np.int64(b), expected)
            assert found.tolist() == expected.tolist(), (a, b)


def test_what_follows_a_comparison_that_fails_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loops, "CHECKED", True)
    checked = Loop(chained.function, contract=False)
    for n in (-1, 0, 2, 3, 2**60):
        assert checked(np.array([0.0, 9.0, 1.0]), n) is bool(0 <= n < 3 and [0.0, 9.0, 1.0][n] < 3)


def test_a_step_of_zero_is_an_error() -> None:
    assert [counted(9, 2), counted(-9, -2), counted(5, -1)] == [20, -20, 0]
    with pytest.raises(ValueError, match="step 0"):
        counted(9, 0)


@pytest.mark.parametrize("line", ["a[0:4] = np.ones(2)", "one, other = a[:3]", "return a[-n:].size"])
def test_lengths_that_differ_are_seen_where_indices_are_checked(line, tmp_path, monkeypatch):
    monkeypatch.setattr(loops, "CHECKED", True)
    with pytest.raises(IndexError, match="index outside of its array"):
        run(made([line], tmp_path, "checked"))


def factors(one, other):
    @loop
    def product(x):
        return one(x) - other(x)

    return product


def test_functions_around_a_loop_belong_to_it() -> None:
    assert factors(math.sqrt, abs)(4.0) == -2.0
    assert factors(abs, math.sqrt)(4.0) == 2.0
