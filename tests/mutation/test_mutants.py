"""What is changed in mutants, and what stays as it is."""

from __future__ import annotations

from pathlib import Path

import pytest
from mutants import Places, chosen

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("y = a ** 2", {"y = a * 2", "y = a ** 3"}),
        ("y = circle - apart", {"y = circle + apart"}),
        ("y = (a) < b", {"y = (a) <= b", "y = (a) >= b"}),
        ("if not x: pass", {"if  x: pass", "if not (not x): pass"}),
        ("y = a and b or c", {"y = a or b or c", "y = a and b and c"}),
        ("y -= np.floor(α)", {"y += np.floor(α)", "y -= np.ceil(α)"}),
        ("def f(a: int = 1, *, b=True) -> 'x': ...", {
            "def f(a: int = 2, *, b=True) -> 'x': ...", "def f(a: int = 1, *, b=False) -> 'x': ...",
        }),
        ("x: Literal[3] = -a", {"x: Literal[3] = a"}),
        ("for a in (b for b in c if d): break", {
            "for a in (b for b in c if not (d)): break", "for a in (b for b in c if d): continue",
        }),
        ("'''1 + 2'''\n@cache(3)\ndef __repr__(self): return f'{1 + 2}' + str(3)", set()),
        ("raise ValueError(f'{a + 1}' if b else 3)", set()),
        ("warnings.warn('x', stacklevel=3)", set()),
    ],
)  # fmt: skip
def test_all_changes_of_a_line(source, expected):
    found = Places("x.py", source.encode()).found
    assert {mutant.of(source.encode()).decode() for mutant in found} == expected


def test_a_choice_is_repeatable_and_larger_ones_hold_smaller_ones():
    few, many = (list(chosen(ROOT, "_lib", number, seed=1)) for number in (5, 20))
    assert many[:5] == few
    assert len({(mutant.path, mutant.line) for mutant in many}) == 20
    assert list(chosen(ROOT, "_lib", 5, seed=2)) != few


def test_mutants_compile():
    for mutant in chosen(ROOT, "_lib", 60, seed=0):
        compile(mutant.of((ROOT / mutant.path).read_bytes()), mutant.path, "exec")


def test_functions_return_constants_in_place_of_what_they_compute():
    source = (
        'def f(x: int) -> bool:\n    """Doc."""\n    y = x\n    return y > 0\n\ndef g() -> list[int]:\n    return []\n'
    )
    found = [mutant.of(source.encode()).decode() for mutant in Places("x.py", source.encode()).constant]
    assert found == [source.replace("y = x", f"return {value}\n    y = x") for value in (True, False)]
