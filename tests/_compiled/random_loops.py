"""Random functions in the language of loops, and what is found where they and plain Python differ.

A function is made of statements that Python runs without an exception: divisors of whole numbers are odd, numbers are
brought back to some thousands wherever they are kept, and indices are remainders.  What it leaves in its arrays and
what it returns is compared in every bit; numbers that are not (NaN) are equal.
"""

import ast
import importlib.util
import math
import random
import re
import signal
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import cellmap._compiled.loops as loops
from cellmap._compiled.loops import Loop
from cellmap._compiled.translation.grammar import LanguageError

AWKWARD = [0.0, -0.0, 1.0, -1.0, 0.5, -2.5, 3.75, 7.0, -7.0, 1e300, -1e-300, math.inf, -math.inf, math.nan]


class Pair(NamedTuple):
    """A named tuple, as kernels are given them."""

    factor: Any
    count: Any


# Patterns: {f}, {i} and {b} stand for expressions of a float, a whole number and a truth value, {f2} for one of that
# depth, a name in capitals for one of NAMED, and words for one of them.
EXPRESSION = {
    "f": """({f} {+ - * / %} np.float64({f}))|(np.float64({f}) {+ - *} {i})|-{f}|abs({f})|{min max}({f}, {f}, {f})
({f} if {b} else {f})|np.float64({i})|np.sqrt(abs({f}))|np.floor({f})|np.copysign({f}, {f})|abs({f}) ** 1.5
np.float64({i}) / np.float64({i})""",
    "i": """({i} {+ - & | ^} {i})|({i} * {i} % {32749 -127 64})|({i} {// %} {4 -4 7 -1})|({i} {// %} ({i} | 1))|-{i}
(({i} & 1023) << ({i} & {3 15}))|({i} >> ({i} + n & 127))|2 ** ({i} & 7)|abs({i})|{min max}({i}, {i})|int({b})
({i} if {b} else {i})|int(np.float64({i}) * 0.37)""",
    "b": """({f} {ORDER} {f})|({f} {ORDER} {f} {ORDER} {i})|({i} {ORDER} {i} {ORDER} {i} {ORDER} {f})|(not {i})
({b} {and or} {b})|({b} and {b} or {b})|(not {b})|(not {f})""",
}
OF_ARRAYS = {
    "f": """a[{i} % a.size]|b[{i} % b.shape[0], {i} % b.shape[1]]|out[{i} % len(out)]|WEIGHTS[{i} % 3]
total({f}, a[{i} % len(a) :])|helper({f}, {i})[0]|total({f}, b[{i} % len(b)])|b[:, {i} % b.shape[1]][-1]""",
    "i": """int(k[{i} % len(k)])|int(c[{i} % c.shape[0], {i} % 2, -1])|int(whole[{i} % whole.size])|len(b)|b.shape[1]
helper(np.float64({i}), {i})[1]|c.size""",
    "b": "",
}
LEAF = {"f": "0.1|1e5|2.0", "i": "7|-8|1000", "b": "{i0} > {i0}|{f0} <= {f0}"}
NAMED = {
    "ORDER": "{< <= > >= == !=}",
    "RANGE": "range({i0} & 3)|range(3)|range(4, -1, -1)|range(-2, {i0} & 7, ({i0} & 3) + 1)|range(5, {i0} & 3, -2)",
    "OVER": "a|a[1:]|b[0]|b[:, 0]|out[2:5]|b.flat|b.flat|b.flat|WEIGHTS|(0.25, 4.0)",
    "ELEMENT": "out[{i1} % 8]|b[{i1} % b.shape[0], -1]|a[0]",
    "FILLED": "out[2:4]|out[{i1} % 9 :]|b[0]|b[:, 0]|b[:]|a[1:3]",
    "COPIED": "out[0:3] = out[1:4]|out[2:5] = out[0:3]|out[5:8] = out[3:6]|out[4:7] = out[4:7]|b[0] = b[1]|b[:] = b",
    "VIEW": "a[{i1} % 3 :]|b[{i1} % 2, :]|b[1:, 0]|out[1:][2:7]",
    "MEMORY": "np.zeros(3)|np.ones((3,))|np.empty_like(out)|np.empty(4, np.float64)",
    "LEAVE": "pass|if {b1}: {break continue}",
    "RETURN": "return|return {f2}|return {i2}|return {b2}",
}
# Semicolons end lines of statements.  {F}, {G}, {I} and {B} are new names of these kinds, which later lines may use,
# {V} and {W} such as others do not change; {own f} is a name that a statement has made, {block} one or two statements.
SIMPLE = """{F} = {f3}|{I} = ({i3}) % 30011 - 15000|{B} = {b3}|{own f} = {f3}|{own f} {+ - *}= {f2}
{own i} = ({i3}) % 30011 - 15000"""
BLOCKS = """
if {b2}:;    {block}|if {b2}:;    {block};else:;    {block}
if {b2}:;    {block};elif {b2}:;    {block};else:;    {block}
for {I} in {RANGE}:;    {block};    {LEAVE}
{W} = {i1} & 3;while {W} > 0:;    {W} -= 1;    {block};    {LEAVE}
{W} = 0;while True:;    {W} += 1;    if {W} > 3:;        break;    {block};    {LEAVE}
{V} = {-3 -1 0 2};if {b1}:;    {V} = {f2};{F} = {V} + 0.5
{F}, {I} = {f2}, ({i2}) % 7919;{F}, {own f} = {own f}, {F}"""
BLOCKS_OF_ARRAYS = """{F}, {I} = helper({f2}, ({i2}) % 999);{I} = {I} % 7919
for {F} in {OVER}:;    {block};    {LEAVE}|for {F} in {OVER}:;    {block}
{ELEMENT} {= += -= *=} {f3}|whole[{i2} % len(whole)] = ({i3}) % 9973|{FILLED} = {f2}|{COPIED}
{F}, {G} = out[{0 1 2 3 4 5}:][:2]
{V} = {VIEW};{F} = 0.0;if {V}.size > 1:;    {V}[0] = {f1};    {F} = {V}[1] + {V}[-1]
{V} = {MEMORY};{V}[:] = {f2};{F} = {V}[({i1}) % 3]"""
HELPER = """import math
import numpy as np
from cellmap._compiled.loops import inlined, loop

THREE, SCALE, WEIGHTS = 3, -0.75, (0.5, -2.0, 3.0)
@inlined(contract=False)
def helper(x, n):
    {body}
    return x - {f2}, n - {i2}
"""
TOTAL = """@inlined(contract=False)
def total(x, values):
    for v in values:
        if {b1}:
            continue
        x = x * 0.5 + v
    return x
"""
FUNCTION = """@loop(contract=False)
def function(x, y, n, m, a, b, c, k, pair, out, whole):
    {body}
    {RETURN}
"""


def parts(patterns: str) -> list[str]:
    """Return patterns, between which are lines or strokes without spaces."""
    return [one for one in re.split(r"(?<! )\|(?! )|\n", patterns) if one]


class Writer:
    """Random source text; ``known`` are the names that have a value, by their kinds."""

    def __init__(self, seed: int, size: int = 4) -> None:
        self.random, self.size, self.count = random.Random(seed), size, 0

    def text(self) -> str:
        """Return a module with three functions."""
        modules = [
            self.function(HELPER, {"f": ["x", "SCALE"], "i": ["n", "THREE"], "b": []}, 2, False),
            self.function(TOTAL, {"f": ["x", "SCALE"], "i": ["THREE"], "b": []}, 2, False),
        ]
        known = {"f": ["x", "y", "pair.factor", "SCALE"], "i": ["n", "m", "THREE", "pair[1]"], "b": []}
        return "\n".join([*modules, self.function(FUNCTION, known, self.size, True)])

    def function(self, pattern: str, known: dict[str, list[str]], size: int, arrays: bool) -> str:
        self.known, self.arrays, self.level = known, arrays, 0
        return "\n".join([*self.lines(pattern, size), ""])

    def lines(self, pattern: str, size: int = 2) -> list[str]:
        """Return the lines of a statement."""
        lines: list[str] = []
        before, names = self.copied(), {}
        for line in pattern.splitlines():
            pad = line[: len(line) - len(line.lstrip())]
            if line.strip() in ("{block}", "{body}"):
                outside = self.copied()
                self.level += 1
                for _ in range(self.random.randint(1, size)):
                    lines += [pad + one for one in self.statement()]
                self.level -= 1
                self.known = self.known if "body" in line else outside
            else:
                lines.append(self.filled(line, 0, names))
                for what, name in names.items():
                    kind = {"G": "f", "W": "i"}.get(what, what.lower())
                    if kind in self.known and name not in self.known[kind]:
                        self.known[kind].append(name)
        self.known = before if "{block}" in pattern else self.known
        return lines

    def copied(self) -> dict[str, list[str]]:
        return {kind: list(names) for kind, names in self.known.items()}

    def own(self, kind: str) -> list[str]:
        return [name for name in self.known[kind] if name[1:].isdigit()]

    def statement(self) -> list[str]:
        """Return a random statement."""
        groups = [SIMPLE] if self.level > 3 else [SIMPLE, BLOCKS, *self.arrays * [BLOCKS_OF_ARRAYS]]
        pattern = self.random.choice([one for group in groups for one in parts(group)])
        missing = pattern.startswith("{own") and not self.own(pattern[5])
        return self.lines("{F} = {f3}" if missing else pattern.replace(";", "\n"))

    def filled(self, pattern: str, depth: int, names: dict[str, str]) -> str:
        return re.sub(r"\{([^{}]+)\}", lambda found: self.piece(found[1], depth, names), pattern)

    def piece(self, what: str, depth: int, names: dict[str, str]) -> str:
        """Return what stands for a piece of a pattern."""
        if what[:-1] == "own ":
            return self.random.choice(self.own(what[-1]))
        if what in NAMED:
            return self.filled(self.random.choice(parts(NAMED[what])), depth, names)
        if what.isupper():
            self.count += what not in names
            return names.setdefault(what, f"{what.lower()}{self.count}" + "_" * (what in "VW"))
        if what[0] not in LEAF or what[1:] not in ("", "0", "1", "2", "3"):
            return self.random.choice(what.split())
        return self.expression(what[0], int(what[1:] or depth), names)

    def expression(self, kind: str, depth: int, names: dict[str, str]) -> str:
        if depth <= 0 or (kind != "b" and self.random.random() < 0.2):
            pattern = self.random.choice([*self.known[kind], *parts(LEAF[kind])])
        else:
            pattern = self.random.choice(parts(EXPRESSION[kind]) + self.arrays * parts(OF_ARRAYS[kind]))
        return self.filled(pattern, depth - 1, names)


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
        lines = self.filled(self.chosen.choice(parts(STATEMENTS)))
        blocks = [node.body for node in ast.walk(self.function) if isinstance(node, ast.If | ast.For | ast.While)]
        block = self.chosen.choice([self.function.body, self.function.body, *blocks])
        place = self.chosen.randint(0, len(block))
        block[place:place] = ast.parse(lines.replace(";", "\n")).body

    def visit(self, node: ast.AST) -> Any:
        """Replace the chosen expression by another."""
        if node is not self.target:
            return self.generic_visit(node)
        return ast.parse(self.filled(self.chosen.choice(parts(EXPRESSIONS))), mode="eval").body


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
