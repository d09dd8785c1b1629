"""Random functions in the language of loops, and what is found where they and plain Python differ.

A function is made of statements that Python runs without an exception: divisors of whole numbers are odd, numbers are
brought back to some thousands wherever they are kept, and indices are remainders.  What it leaves in its arrays and
what it returns is compared in every bit; numbers that are not (NaN) are equal.
"""

from __future__ import annotations

import ast
import importlib.util
import math
import random
import signal
import sys
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import cellmap._compiled.loops as loops
from cellmap._compiled.loops import Loop
from cellmap._compiled.translation.grammar import LanguageError

AWKWARD = [0.0, -0.0, 1.0, -1.0, 0.5, -2.5, 3.75, 7.0, -7.0, 1e300, -1e-300, math.inf, -math.inf, math.nan]
HEAD = """import math
import numpy as np
from cellmap._compiled.loops import inlined, loop

THREE, SCALE, WEIGHTS = 3, -0.75, (0.5, -2.0, 3.0)
"""
ARGUMENTS = "x, y, n, m, a, b, c, k, pair, out, whole"


class Pair(NamedTuple):
    """A named tuple, as kernels are given them."""

    factor: Any
    count: Any


class Writer:
    """Random source text; ``known`` are the names that have a value, by their kinds."""

    def __init__(self, seed: int, size: int = 4) -> None:
        self.size = size
        self.random = random.Random(seed)
        self.known = {"float": ["x", "y", "pair.factor", "SCALE"], "int": ["n", "m", "THREE", "pair[1]"], "bool": []}
        self.count = 0
        self.depth = 0

    def text(self) -> str:
        """Return a module with three functions."""
        self.known = {"float": ["x", "SCALE"], "int": ["n", "THREE"], "bool": []}
        self.helps = False
        first = self.body(1, 2, arrays=False)
        helper = [
            "@inlined(contract=False)",
            "def helper(x, n):",
            *first,
            f"    return x - {self.f(2)}, n - {self.i(2)}",
        ]
        self.known = {"float": ["x", "SCALE"], "int": ["THREE"], "bool": []}
        second = ["", "@inlined(contract=False)", "def total(x, values):"]
        second += [
            "    for v in values:",
            f"        if {self.b(1)}:",
            "            continue",
            "        x = x * 0.5 + v",
        ]
        second += ["    return x", ""]
        self.known = {"float": ["x", "y", "pair.factor", "SCALE"], "int": ["n", "m", "THREE", "pair[1]"], "bool": []}
        self.helps = True
        main = ["@loop(contract=False)", f"def function({ARGUMENTS}):", *self.body(1, self.size)]
        main += ["    " + self.choice(["return", f"return {self.f(2)}", f"return {self.i(2)}", f"return {self.b(2)}"])]
        return "\n".join([HEAD, *helper, *second, *main, ""])

    def choice(self, one_of: list[str]) -> str:
        return self.random.choice(one_of)

    def name(self, kind: str) -> str:
        self.count += 1
        return f"{kind[0]}{self.count}"

    def f(self, depth: int) -> str:
        """Return an expression of a float."""
        if depth <= 0 or self.random.random() < 0.2:
            return self.choice([*self.known["float"], "0.1", "1e5", "2.0"])
        f, i, b = (lambda: self.f(depth - 1)), (lambda: self.i(depth - 1)), (lambda: self.b(depth - 1))
        kinds = [
            lambda: f"({f()} {self.choice(['+', '-', '*', '/', '%'])} np.float64({f()}))",
            lambda: f"(np.float64({f()}) {self.choice(['+', '-', '*'])} {i()})",
            lambda: f"-{f()}",
            lambda: f"abs({f()})",
            lambda: f"{self.choice(['min', 'max'])}({f()}, {f()}, {f()})",
            lambda: f"({f()} if {b()} else {f()})",
            lambda: f"np.float64({i()})",
            lambda: f"np.sqrt(abs({f()}))",
            lambda: f"np.floor({f()})",
            lambda: f"np.copysign({f()}, {f()})",
            lambda: f"abs({f()}) ** 1.5",
            lambda: f"np.float64({i()}) / np.float64({i()})",
        ]
        if self.helps:
            kinds += [
                lambda: f"a[{i()} % a.size]",
                lambda: f"b[{i()} % b.shape[0], {i()} % b.shape[1]]",
                lambda: f"out[{i()} % len(out)]",
                lambda: f"WEIGHTS[{i()} % 3]",
                lambda: f"total({f()}, a[{i()} % len(a) :])",
                lambda: f"helper({f()}, {i()})[0]",
                lambda: f"total({f()}, b[{i()} % len(b)])",
                lambda: f"b[:, {i()} % b.shape[1]][-1]",
            ]
        return str(self.random.choice(kinds)())

    def i(self, depth: int) -> str:
        """Return an expression of a whole number."""
        if depth <= 0 or self.random.random() < 0.2:
            return self.choice([*self.known["int"], "7", "-8", "1000"])
        i, b = (lambda: self.i(depth - 1)), (lambda: self.b(depth - 1))
        kinds = [
            lambda: f"({i()} {self.choice(['+', '-', '&', '|', '^'])} {i()})",
            lambda: f"({i()} * {i()} % {self.choice(['32749', '-127', '64'])})",
            lambda: f"({i()} {self.choice(['//', '%'])} {self.choice(['4', '-4', '7', '-1', f'({i()} | 1)'])})",
            lambda: f"(({i()} & 1023) << ({i()} & {self.choice(['3', '15'])}))",
            lambda: f"({i()} >> ({i()} + n & 127))",
            lambda: f"2 ** ({i()} & 7)",
            lambda: f"-{i()}",
            lambda: f"abs({i()})",
            lambda: f"{self.choice(['min', 'max'])}({i()}, {i()})",
            lambda: f"({i()} if {b()} else {i()})",
            lambda: f"int({b()})",
            lambda: f"int(np.float64({i()}) * 0.37)",
        ]
        if self.helps:
            kinds += [
                lambda: f"int(k[{i()} % len(k)])",
                lambda: f"int(c[{i()} % c.shape[0], {i()} % 2, -1])",
                lambda: f"int(whole[{i()} % whole.size])",
                lambda: f"helper(np.float64({i()}), {i()})[1]",
                lambda: "len(b)",
                lambda: "b.shape[1]",
                lambda: "c.size",
            ]
        return str(self.random.choice(kinds)())

    def b(self, depth: int) -> str:
        """Return a condition."""
        if depth <= 0:
            return self.choice([*self.known["bool"], f"{self.i(0)} > {self.i(0)}", f"{self.f(0)} <= {self.f(0)}"])
        f, i, b = (lambda: self.f(depth - 1)), (lambda: self.i(depth - 1)), (lambda: self.b(depth - 1))
        order = lambda: self.choice(["<", "<=", ">", ">=", "==", "!="])  # noqa: E731
        kinds = [
            lambda: f"({f()} {order()} {f()})",
            lambda: f"({f()} {order()} {f()} {order()} {i()})",
            lambda: f"({i()} {order()} {i()} {order()} {i()} {order()} {f()})",
            lambda: f"({b()} {self.choice(['and', 'or'])} {b()})",
            lambda: f"({b()} and {b()} or {b()})",
            lambda: f"(not {b()})",
            lambda: f"(not {self.choice([i(), f()])})",
        ]
        return str(self.random.choice(kinds)())

    def body(self, level: int, size: int, arrays: bool = True) -> list[str]:
        """Return statements."""
        lines: list[str] = []
        for _ in range(self.random.randint(1, size)):
            lines += self.statement(level, arrays)
        return lines

    def inner(self, level: int, arrays: bool, **more: list[str]) -> list[str]:
        """Return statements of a block, whose own names are forgotten after it."""
        before = {kind: list(names) for kind, names in self.known.items()}
        for kind, names in more.items():
            self.known[kind] += names
        lines = self.body(level + 1, 2, arrays)
        self.known = before
        return lines

    def statement(self, level: int, arrays: bool) -> list[str]:
        """Return a random statement."""
        pad, kinds = "    " * level, ["new", "new", "again", "if", "range", "while", "tuple", "mixed"]
        if arrays:
            kinds += ["over", "flat", "element", "element", "fill", "copy", "unpack", "view", "memory", "constants"]
        if level > 3:
            kinds = ["new", "again"]
        kind = self.choice(kinds)
        own = [name for name in self.known["float"] + self.known["int"] if name[1:].isdigit()]
        if kind == "again" and own:
            name = self.choice(own)
            if name[0] == "f":
                return [pad + self.choice([f"{name} = {self.f(3)}", f"{name} {self.choice('+-*')}= {self.f(2)}"])]
            return [f"{pad}{name} = ({self.i(3)}) % 30011 - 15000"]
        if kind == "if":
            lines = [f"{pad}if {self.b(2)}:", *self.inner(level, arrays)]
            if self.random.random() < 0.3:
                lines += [f"{pad}elif {self.b(2)}:", *self.inner(level, arrays)]
            if self.random.random() < 0.5:
                lines += [f"{pad}else:", *self.inner(level, arrays)]
            return lines
        leave = [f"{pad}    if {self.b(1)}:", f"{pad}        {self.choice(['break', 'continue'])}"]
        leave = leave if self.random.random() < 0.5 else []
        if kind == "range":
            name = self.name("j")
            end = self.choice(["n & 3", "3", "4, -1, -1", "-2, (m & 7), (n & 3) + 1", "5, n, -2"])
            end = end if arrays or "m" not in end else "3"
            end = end.replace("5, n", "5, n & 3")
            return [f"{pad}for {name} in range({end}):", *self.inner(level, arrays, int=[name]), *leave]
        if kind == "while":
            name = self.name("w")
            head = [f"{pad}{name} = {self.i(1)} & 3", f"{pad}while {self.choice(['', 'not '])}{name} > 0:"]
            if "not" in head[1]:
                head = [f"{pad}{name} = 0", f"{pad}while True:", f"{pad}    {name} += 1", f"{pad}    if {name} > 3:"]
                return [*head, f"{pad}        break", *self.inner(level, arrays, int=[name]), *leave]
            return [*head, f"{pad}    {name} -= 1", *self.inner(level, arrays, int=[name]), *leave]
        if kind == "tuple":
            one, other = self.name("f"), self.name("i")
            if self.helps:
                lines = [f"{pad}{one}, {other} = helper({self.f(2)}, ({self.i(2)}) % 999)"]
            else:
                lines = [f"{pad}{one}, {other} = {self.f(2)}, {self.i(2)}"]
            lines += [f"{pad}{other} = {other} % 7919"]
            self.known["float"].append(one)
            self.known["int"].append(other)
            floats = [name for name in self.known["float"] if name[1:].isdigit()]
            two = self.choice(floats)
            return [*lines, f"{pad}{one}, {two} = {two}, {one}"]
        if kind == "mixed":  # a whole number first, a float later
            name = self.name("f")
            lines = [f"{pad}{name} = {self.random.randint(-3, 3)}", f"{pad}if {self.b(1)}:"]
            lines += [f"{pad}    {name} = {self.f(2)}", f"{pad}{name} = {name} + 0.5"]
            self.known["float"].append(name)
            return lines
        if kind in ("over", "flat", "constants"):
            name = self.name("f")
            over = {"over": self.choice(["a", "a[1:]", "b[0]", "b[:, 0]", "out[2:5]"]), "flat": "b.flat"}
            lines = [f"{pad}for {name} in {over.get(kind, self.choice(['WEIGHTS', '(0.25, 4.0)']))}:"]
            return [*lines, *self.inner(level, arrays, float=[name]), *leave]
        if kind == "element":
            change = self.choice(["=", "+=", "-=", "*="])
            target = self.choice([f"out[{self.i(1)} % 8]", f"b[{self.i(1)} % b.shape[0], -1]", "a[0]"])
            if self.random.random() < 0.3:
                return [f"{pad}whole[{self.i(2)} % len(whole)] = ({self.i(3)}) % 9973"]
            return [f"{pad}{target} {change} {self.f(3)}"]
        if kind == "fill":
            target = self.choice(["out[2:4]", f"out[{self.i(1)} % 9 :]", "b[0]", "b[:, 0]", "b[:]", "a[1:3]"])
            return [f"{pad}{target} = {self.f(2)}"]
        if kind == "copy":
            one, other = self.random.randint(0, 5), self.random.randint(0, 5)
            return [
                pad + self.choice([f"out[{one} : {one} + 3] = out[{other} : {other} + 3]", "b[0] = b[1]", "b[:] = b"])
            ]
        if kind == "unpack":
            one, other = self.name("f"), self.name("f")
            self.known["float"] += [one, other]
            return [f"{pad}{one}, {other} = out[{self.random.randint(0, 5)}:][:2]"]
        if kind == "view":
            view, name = self.name("v"), self.name("f")
            chosen = self.choice([f"a[{self.i(1)} % 3 :]", f"b[{self.i(1)} % 2, :]", "b[1:, 0]", "out[1:][2:7]"])
            lines = [f"{pad}{view} = {chosen}", f"{pad}{name} = 0.0", f"{pad}if {view}.size > 1:"]
            lines += [f"{pad}    {view}[0] = {self.f(1)}", f"{pad}    {name} = {view}[1] + {view}[-1]"]
            self.known["float"].append(name)
            return lines
        if kind == "memory":
            memory, name = self.name("z"), self.name("f")
            made = self.choice(["np.zeros(3)", "np.ones((3,))", "np.empty_like(out)", "np.empty(4, np.float64)"])
            lines = [f"{pad}{memory} = {made}", f"{pad}{memory}[:] = {self.f(2)}"]
            lines.append(f"{pad}{name} = {memory}[({self.i(1)}) % 3]")
            self.known["float"].append(name)
            return lines
        new = self.random.choice(["float", "int", "bool"])
        name = self.name(new)
        made = {"float": self.f, "int": lambda d: f"({self.i(d)}) % 30011 - 15000", "bool": self.b}[new](3)
        if new == "bool":
            name = f"t{self.count}"
        self.known[new].append(name)
        return [f"{pad}{name} = {made}"]


def arguments(seed: int) -> tuple[Any, ...]:
    """Return arguments of a random function."""
    chosen = random.Random(seed)
    numbers = np.random.default_rng(seed)
    float_of = lambda: np.float64(chosen.choice([*AWKWARD, chosen.gauss(0.0, 3.0)]))  # noqa: E731
    b = numbers.normal(size=(3, 4))
    b = chosen.choice([b, np.asfortranarray(b), np.repeat(b, 2, 1)[:, ::2], b[::-1]])
    a = np.array([float_of() for _ in range(chosen.randint(2, 6))])
    c, k = numbers.integers(-9, 9, (2, 2, 3)), numbers.integers(-99, 99, 4)
    pair = Pair(float_of(), chosen.randint(-5, 5))
    n, m = chosen.randint(-20, 20), chosen.choice([0, 1, -1, 5, -30000, 29999])
    return float_of(), float_of(), n, m, a, b, c, k, pair, np.arange(8.0), np.arange(5)


def copied(given: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return arguments with arrays of their own, in the same layouts."""

    def copy(array: Any) -> Any:
        whole = np.empty((*array.shape, 2), array.dtype) if not array.flags.forc else np.empty_like(array)
        found = whole[..., 0] if not array.flags.forc else whole
        found[...] = array
        return found

    return tuple(copy(one) if isinstance(one, np.ndarray) else one for one in given)


def same(one: Any, other: Any) -> bool:
    """Tell whether two results are equal: arrays in every bit, numbers in value and sign."""
    if one is None or other is None:
        return one is other
    one, other = np.asarray(one, np.float64), np.asarray(other, np.float64)
    if not np.array_equal(one, other, equal_nan=True):
        return False
    numbers = ~np.isnan(one) & (one != 0)
    return np.array_equal(np.signbit(one[numbers]), np.signbit(other[numbers]))


def imported(text: str, path: Path, name: str) -> Any:
    """Return the module of a text."""
    file = path / f"{name}.py"
    file.write_text(text)
    specification = importlib.util.spec_from_file_location(name, file)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


class TooLong(Exception):
    """A function does not end."""


def _stop(*_: Any) -> None:
    raise TooLong


def run(function: Any, given: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Return what a function returns or raises, and its arguments after that."""
    own = copied(given)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return function(*own), own
        except Exception as error:
            return error, own


def differences(text: str, path: Path, name: str, seeds: range, mild: bool = False) -> tuple[str, list[str]]:
    """Return what became of a function ("equal", "refused", "raises"), and where it and Python differ.

    Where indices are checked, ``mild`` lets compiled code refuse those that count from the end, which Python takes.
    """
    function: Loop = imported(text, path, name).function
    kinds, wrong = set(), []
    for seed in seeds:
        given = arguments(seed)
        signal.signal(signal.SIGALRM, _stop)
        signal.setitimer(signal.ITIMER_REAL, 2.0)
        try:
            expected, expected_arrays = run(function.function, given)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        if isinstance(expected, TooLong):
            continue
        found, arrays = run(function, given)
        kind, what = judged(found, arrays, expected, expected_arrays, str(path / f"{name}.py"))
        if mild and isinstance(found, IndexError):
            kind, what = "raises", ""
        kinds.add(kind)
        wrong += [f"{name} seed {seed}: {what}"] if what else []
        if kind == "refused":
            break
    return "refused" if "refused" in kinds else "raises" if "raises" in kinds else "equal", wrong


AS_NUMPY = (ZeroDivisionError, OverflowError, FloatingPointError)
"""Where Python raises these, compiled code goes on as NumPy does: the table of the language says so."""


def judged(found: Any, arrays: Any, expected: Any, expected_arrays: Any, file: str) -> tuple[str, str]:
    """Return what became of a call, and what is wrong with it."""
    if isinstance(found, LanguageError):
        place = str(found).split(": ", 1)[0]
        known = place.rsplit(":", 1)[0] == file and place.rsplit(":", 1)[1].isdigit()
        return "refused", "" if known else f"refused without its place: {found}"
    if isinstance(expected, Exception):
        domain = isinstance(expected, ValueError) and any(
            said in str(expected)
            for said in ("math domain", "negative shift", "convert float NaN", "negative integer p")
        )
        if isinstance(expected, AS_NUMPY) or domain or isinstance(found, Exception):
            return "raises", ""
        return "raises", f"Python raises {expected!r}, compiled gives {found!r}"
    if isinstance(found, Exception):
        return "raises", f"compiled raises {found!r}, Python gives {expected!r}"
    if not same(found, expected):
        return "equal", f"{found!r} is not {expected!r}"
    for place, (one, other) in enumerate(zip(arrays, expected_arrays, strict=True)):
        if isinstance(one, np.ndarray) and not same(one, other):
            return "equal", f"argument {place}: {one.tolist()} is not {other.tolist()}"
    return "equal", ""


EXPRESSIONS = """
+{0}|~{0}|-{0}|not {0}|{0} and {1}|{0} or {1}|{0} is {1}|{0} is not {1}|{0} in {1}|{0} not in {1}|{0} @ {1}
abs({0}) ** {1}
{0} // {1}|{0} % {1}|{0} / {1}|{0} << {1}|{0} >> {1}|{0} & {1}|{0} ^ {1}|{0} << 65|{0} >> 64|{0} << -1|1 << {0}
{0} + 2**63|{0} - 2**63|{0} * 2**62|{0} + (1 << 65)|-2**63 // {0}|-2**63 % {0}|2 ** abs({0})|3 ** {0}|{0} ** 2|{0} ** -1
[{0}, {1}]|({0}, {1})|({0}, {1})[0]|({0}, {1})[-1]|({0}, {1})[1:]|{{{0}, {1}}}|{{{0}: {1}}}|[v for v in ({0}, {1})]
None|...
(lambda v: v)({0})|(late := {0})|f"{{{0}}}"|"text"|"text" + {0}|b"1"|1j * {0}|sum(v for v in ({0}, {1}))|print({0})
a[::2][0]|a[::-1][0]|a[-1]|a[-9]|a[9]|a[True]|a[{0} > 0]|a[None]|a[...]|a[{0}]|a[1.0]|a[:{0}].size|a[{0}:].size
a[-2:][0]
a[0:99].size|a[:-1].size|b[0, 1, 2]|b[0][1]|b[:, 0][0]|b[0]|c[0, 1]|pair[-1]|pair[2]|pair[:1]|pair.count|pair.other
pair[n]
a.sum()|a.T|a.ndim|a.dtype|a.shape|a.size|len(a)|len(pair)|len(b[0])|np.sum(a)|a.copy()[0]|a.astype(int)[0]|b.flat[0]
int({0})|int({0}, 2)|int(x={0})|float({0})|bool({0})|np.int64({0})|np.uint64({0})|np.float64({0})|np.int32({0})
complex({0})
np.uint64({0} & 7) // 3|np.uint64(5) > {0}|-np.uint64(7)|np.uint64(2**63 + 5) // np.uint64(3)|np.uint64(3) + 0.5
np.float64(np.uint64(2**63 + 9))|np.uint64(3) > -1|np.uint64(3) + {0}|abs(np.uint64(2**63 + 1))
int(np.uint64(2**63 + 1) >> np.uint64(3))
np.zeros(3)[0]|np.zeros(3, dtype=np.int64)[0] / 2|np.zeros(3, np.int64)[0] / 2|np.zeros(3, ">f8")[0]|np.zeros({0})[0]
np.zeros((2, 2))[1, 1]|np.full(3, {0})[0]|np.array([{0}])[0]|np.ones(3, complex)[0]|np.ones((2, 2), np.int8)[1][1]
math.sqrt({0})|math.log({0}, 2)|math.gamma({0})|math.floor({0})|math.copysign({0}, {1})|math.copysign({0})
np.sqrt({0}, {1})
min({0})|min({0}, {1})|max({0}, {1}, 2)|min(a)|max(*pair)|abs({0}, {1})|round({0})|divmod({0}, {1})|pow({0}, {1})
sorted(a)[0]
total({0}, a)|total({0}, values=a)|total({0})|total({0}, a, {1})|helper({0}, {1})|helper({0}, {1})[0]|helper(*pair)
function
0 <= {0} < a.size|0 < n < a[n]|{0} < {1} < total(x, out)|1 < 2 < {0}|{0} == {1} != {0}|({0} > 0) + ({1} > 0)
({0} > 0) / 2
-(n > 0)|abs(n > 0)|(n > 0) << 3|(n > 0) // 2|(n > 0) & (m > 0)|True + n|True and n > 0|n > 0 or 1|0 or n > 0|len("abc")
math.pi|math.tau * {0}|np.inf - {0}|np.nothing|unknown|__name__|SCALE|WEIGHTS|WEIGHTS[n]|WEIGHTS[1:]|WEIGHTS[-1]
THREE[0]
0 / 1|1 // 0|1 % 0.0|1 / 0|(-1) ** 0.5|2.0 ** 5000|(1, 2) < (1, 3)|"a" < "b"|1 if {0} else {1}|{0} if a else {1}
"""
STATEMENTS = """
assert {0}|raise ValueError|del n|del a[0]|global unset|nonlocal unset|import math|from math import pi|late: int = {0}
late: int
late = other = {0}|late, other = {0}, {1}|late, *other = a|[late, other] = {0}, {1}|(late, other), third = ({0}, {1}), n
late, other = out|late, other = pair|late, other, third = pair|late, other = a[:2]|a.flat = {0}|a.shape = (1,)
a.size += 1
try:;    late = {0};except ValueError:;    pass|try:;    late = {0};finally:;    n = 1|with open("x") as f:;    pass
def inner():;    return {0}|class Inner:;    pass|lambda: {0}|{0}|"text"|...|yield {0}|await n|return|return {0}
return {0}, {1}
return a|return a[1:]|return None|return np.zeros(3)|pass|break|continue|print(n)|match n:;    case 1:;        pass
for v in a[::2]:;    out[0] += v|for v in range(3):;    pass;else:;    out[1] += 100
while n > 10**9:;    pass;else:;    out[1] = 7
for v in range(0, 3, 0):;    pass|for v in range(0, 3, n & 1):;    out[0] += 1|for v in range(5.5):;    pass
for v in range(3, -3, -2):;    out[0] += v
for v in (1, 2.5):;    out[0] += v|for v in pair:;    out[0] += v|for v in b:;    out[0] += 1|for u, v in b:;    pass
for v in "ab":;    pass
for v in 3:;    pass|for v in range(n > 0):;    out[0] += 1|for v in enumerate(a):;    pass
for v in range(n & 7):;    last = v
for v in range(2):;    n = v;    v = 7|for out[0] in a:;    pass|for v in a.flat:;    a[0] = 1.0
for v in range(2, 5, 2, 1):;    pass
if {0} > 5:;    late = 1;out[0] = late|if {0} > 5:;    late = 1;else:;    late = 2;out[0] = late|out[0] = late;late = 3
for v in range(n & 3):;    late = v;out[0] = late|while True:;    late = 2;    break;out[0] = late
for v in a:;    pass;out[0] = v
while True:;    if n > 0:;        late = 1;        break;    break;out[0] = late|if n > 0:;    return;out[3] = late
SCALE = 2.0
out[1:] = out[:-1]|out[1:] = out[:7]|out[:7] = out[1:]|out[0:4] = a|out[0:2] = a[:2]|out[2:] = {0}|out[:] = b
b[:, :] = out[:4]
b[:, :] = a|b[:] = b[0]|b[0] = b[1]|b[1:] = b[:2]|b[:, 1:] = b[:, :3]|out[::2] = 1.0|out[[0, 1]] = 1.0
out[n > 0] = 2.0|out[...] = 1.0
out[-1] = {0}|out[n] = {0}|out[0] = a|out[0], out[1] = out[1], out[0]|out[0] += total(x, out)|out[1:3] += 1.0|out += 1
a *= 2
whole[0] = {0}|whole[0] = 2**63|whole[0] = 2.5|whole[0] = int({0})|whole[1:] = whole[:4]|whole[:3] = k[:3]
whole[0] /= 2|whole[0] //= 3
n += 0.5|n /= 2|n //= 2.0|n **= 2|n <<= 70|n @= 2|n = a|a = n|a = b[0]|a = out[1:]|n, x = x, n|pair = (1, 2)
pair = pair|n = n > 0
fresh = np.zeros(3);fresh[n & 1] = {0};out[0] = fresh[0]|fresh = np.zeros(3, dtype=int);out[0] = fresh[0]
fresh = np.zeros(-n);out[0] = 1
for v in range(3):;    fresh = np.zeros(4);    if v == 0:;        first = fresh;    out[0] += fresh[0]
first = out;for v in range(3):;    fresh = np.zeros(4);    if v == 0:;        first = fresh;out[1] = first[0]
fresh = np.zeros(4);for v in range(3):;    fresh, old = np.ones(4), fresh[0];    fresh[0] = v;    out[2] += old
for v in range(3):;    fresh = other = np.zeros(4);    fresh[0] = 5.0;    out[3] += other[0]
for v in range(2):;    out[v] += np.ones(3)[v]|one = out;one[0] = 3.0;two = one[1:];two[0] = 4.0|a, out = out, a
out = out[1:]
"""


class Inserted(ast.NodeTransformer):
    """Puts one random construct of Python's grammar into a function."""

    def __init__(self, chosen: random.Random, tree: ast.Module) -> None:
        self.chosen = chosen
        self.function = next(one for one in tree.body if isinstance(one, ast.FunctionDef) and one.name == "function")
        loads = (ast.BinOp, ast.UnaryOp, ast.Compare, ast.IfExp, ast.Call, ast.Subscript, ast.Name, ast.Constant)
        places = [node for statement in self.function.body for node in ast.walk(statement)]
        self.places = [
            node for node in places if isinstance(node, loads) and not isinstance(getattr(node, "ctx", None), ast.Store)
        ]
        self.target: ast.AST | None = None

    def piece(self) -> str:
        """Return a piece of text to be put into a construct."""
        names = ["n", "m", "x", "y", "a[0]", "pair.factor", "pair[1]", "-2", "0", "1.5", "n > 0", "np.int64(m)", "3"]
        return self.chosen.choice(names)

    def filled(self, pattern: str) -> str:
        """Return the text of a construct."""
        return pattern.format(self.piece(), self.piece())

    def insert(self) -> None:
        """Change the function."""
        if self.chosen.random() < 0.5 and self.places:
            self.target = self.chosen.choice(self.places)
            self.visit(self.function)
            return
        lines = self.filled(
            self.chosen.choice([one for line in STATEMENTS.split("\n") if line for one in line.split("|")])
        )
        blocks = [node.body for node in ast.walk(self.function) if isinstance(node, ast.If | ast.For | ast.While)]
        block = self.chosen.choice([self.function.body, self.function.body, *blocks])
        place = self.chosen.randint(0, len(block))
        block[place:place] = ast.parse(lines.replace(";", "\n")).body

    def visit(self, node: ast.AST) -> Any:
        """Replace the chosen expression by another."""
        if node is not self.target:
            return self.generic_visit(node)
        patterns = [one for line in EXPRESSIONS.split("\n") if line for one in line.split("|")]
        return ast.parse(self.filled(self.chosen.choice(patterns)), mode="eval").body


def mutated(seed: int) -> str:
    """Return a random module into whose function a random construct of Python is put."""
    tree = ast.parse(Writer(seed, 2).text())
    Inserted(random.Random(f"inserted {seed}"), tree).insert()
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


def main(first: int, last: int, path: str) -> None:
    """Try mutated functions, and print what became of them: in a process of its own, for it may end."""
    counts = {"equal": 0, "refused": 0, "raises": 0, "no Python": 0}
    loops.CHECKED = True
    for seed in range(first, last):
        print(f"trying {seed}", flush=True)
        text = mutated(seed)
        try:
            kind, wrong = differences(text, Path(path), f"mutated{seed}", range(4), mild=True)
        except (SyntaxError, NameError) as error:
            kind, wrong = "no Python", [] if isinstance(error, SyntaxError) else [f"{seed}: {error}"]
        counts[kind] += 1
        for one in wrong:
            print(f"wrong {one}", flush=True)
    print(f"counts {counts}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
