"""Models in files of XPP, ``.ode``, as systems and maps."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from keyword import iskeyword
from os import PathLike
from typing import Any

import numpy as np

from .._compiled.codegen.functions import OF_MATH
from .._lib.checks import abridged
from .._lib.files import as_path
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, angle
from ..maps.discrete import discrete_map
from ..maps.impacts import Impact
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem

_PRECEDENCE = {"+": 4, "-": 4, "|": 4, "*": 6, "/": 6, "&": 6} | dict.fromkeys("^ ** > < == >= <= !=".split(), 7)
"""Those of XPP, where comparisons bind as powers do; operations of one precedence go from the left."""

_PYTHON = {"^": "**", "&": "and", "|": "or"}
_TOKEN = re.compile(r"\s*(\d+\.?\d*(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?|[a-z]\w*|\*\*|[<>=!]=|[-+*/^&|<>(),])")
_FUNCTIONS = {name: name for name in (*OF_MATH, *"abs max min sign heav mod not lgamma besselj".split())}
_FUNCTIONS |= {"ln": "log", "flr": "floor"}
_SCOPE: dict[str, Any] = {name: getattr(math, name) for name in _FUNCTIONS.values() if hasattr(math, name)} | {
    "__builtins__": {},
    "abs": abs,
    "max": max,
    "min": min,
    "sign": np.sign,
    "heav": lambda x: np.heaviside(x, 1.0),
    "mod": lambda x, y: x % y,
    "pi": math.pi,
}
_REFUSED = {
    **dict.fromkeys(("delay", "del_shft"), "delays"),
    **dict.fromkeys(("ran", "normal", "poisson", "wiener", "markov"), "random numbers"),
    **dict.fromkeys(("int", "volterra"), "integrals"),
    **dict.fromkeys(("sum", "of", "shift", "special"), "sums and networks by addresses of variables"),
    **dict.fromkeys(("hom_bcs", "solv"), "algebraic equations"),
    **dict.fromkeys(("export", "#include", "options"), "further files"),
    "tabular": "tables",
}
"""Words for what has no formula here."""

_IGNORED = {"aux", "set", "bndry", "bdry", "only"}
_KEYWORDS = ("parameters", "init", "number", "global", "done", *_IGNORED, *_REFUSED)
_ASSIGNED = re.compile(r"([a-z]\w*)(?:\s*=\s*([^\s,]+))?")


@dataclass(frozen=True, eq=False)
class OdeFile:
    """Model of a file of XPP.

    Parameters
    ----------
    system : ForcedSystem or PointMap
        The flow, or the map of a file with ``meth=discrete``.
    initial_condition : tuple of float
        State with which the file begins.
    options : dict
        Options of the file by name, as they stand behind ``@``.
    ignored : tuple of str
        Lines without a meaning for the system, such as those of ``aux``, and what has another name here.
    """

    system: ForcedSystem | PointMap
    initial_condition: tuple[float, ...]
    options: Mapping[str, str] = field(repr=False)
    ignored: tuple[str, ...] = field(repr=False)


class _Refusal(Exception):
    """A part of one line that cannot be read; then a pattern that finds the line, where the reason does not know it."""


@dataclass
class _Model:
    """Content of the lines of a file; formulas are text of Python."""

    rates: dict[str, str] = field(default_factory=dict)
    fixed: dict[str, str] = field(default_factory=dict)
    functions: dict[str, tuple[str, str]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    initial: dict[str, float] = field(default_factory=dict)
    events: list[tuple[int, str, dict[str, str]]] = field(default_factory=list)
    options: dict[str, str] = field(default_factory=dict)
    ignored: list[str] = field(default_factory=list)
    is_map: bool = False


@checked
def read_ode(path: str | PathLike[str], period: float | Callable[[Any], float] = 1.0) -> OdeFile:
    """Read a model from a file of XPP (XPPAUT).

    Names are in lower case, as XPP does not tell cases apart.  Events (``global``) are impacts, and a variable that is
    folded (``fold=``) is an angle.  Delays, noise, integral and algebraic equations, and tables are refused.

    Parameters
    ----------
    path : str or path
        The file.
    period : float or callable, optional
        Period of the forcing, or a function of the parameters that returns it; any number for an autonomous system.

    Returns
    -------
    OdeFile
        System or map, initial condition and options.

    Raises
    ------
    ValueError
        With the number and the text of each line that cannot be read, and why.

    References
    ----------
    Ermentrout, *Simulating, Analyzing, and Animating Dynamical Systems* (2002).
    """
    file, refused, model = as_path("path", path), [], _Model()
    if not file.is_file():
        raise FileNotFoundError(f"path={str(path)!r}: there is no such file")
    statements = list(_lines(file.read_text(encoding="utf-8", errors="replace")))
    for number, line in statements:
        try:
            if _read(model, line) == "done":
                break
        except _Refusal as refusal:
            refused.append(f"line {number}, {abridged(line)}: {refusal}")
    if refused:
        raise ValueError(f"path={str(path)!r}: {'; '.join(refused[:8])}")
    model.is_map |= model.options.get("meth", model.options.get("method", "")).startswith("d")
    renamed = {name: f"{name}_" for name in (*model.rates, *model.parameters) if iskeyword(name)}
    model.ignored += [f"{name} is called {new}" for name, new in renamed.items()]
    coordinates = [_coordinate(renamed.get(name, name), name, model.options) for name in model.rates]
    try:
        writer = _Functions(model, renamed)
        rate = writer.function(list(model.rates.values()))
        impacts = [
            Impact(writer.function([guard], single=True), writer.function(after), direction, solid=False)
            for sign, guard, reset in model.events
            for after in [[reset.get(name, f"v_{name}") for name in model.rates]]
            for direction in ((-1, 1) if sign == 0 else (sign,))
        ]
        if unknown := {name for _, _, reset in model.events for name in reset} - model.rates.keys():
            raise _Refusal(f"global sets {', '.join(sorted(unknown))}, which is no variable: make it one, with rate 0")
    except _Refusal as refusal:
        reason, *pattern = refusal.args
        places = [f"line {n}, {abridged(line)}: " for n, line in statements if pattern and re.search(pattern[0], line)]
        raise ValueError(f"path={str(path)!r}: {''.join(places[:1])}{reason}") from None
    parameters = {renamed.get(name, name): value for name, value in model.parameters.items()}
    name = file.stem
    system: ForcedSystem | PointMap
    if model.is_map:
        system = discrete_map(lambda x, p: rate(0.0, x, p), parameters, coordinates, name=name)
    else:
        system = ForcedSystem(rate, parameters, period, coordinates, name, impacts=impacts)
    initial = tuple(model.initial.get(name, 0.0) for name in model.rates)
    return OdeFile(system, initial, model.options, tuple(model.ignored))


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield the statements of a file with the numbers of their lines: continued ones joined, groups written out."""
    whole, first = "", 0
    group: list[tuple[int, str]] = []
    ends: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        first = first if whole else number
        whole += line
        if whole.endswith("\\"):
            whole = whole[:-1]
            continue
        statement, whole = whole.strip().lower(), ""
        if statement.startswith("%"):
            for j in range(int(ends[0]), int(ends[1]) + 1) if len(ends) == 2 else ():
                yield from ((n, _indexed(s, j)) for n, s in group)
            group, ends = [], re.findall(r"-?\d+", statement)
        elif len(ends) == 2:
            group.append((number, statement))
        elif statement.startswith("#include") or (statement and statement[0] not in '#"'):
            own = re.search(r"\[(-?\d+)\s*\.\.\s*(-?\d+)\]", statement)
            for j in range(int(own[1]), int(own[2]) + 1) if own else [0]:
                yield first, _indexed(statement, j) if own else re.sub(r"\[(\d+)\]", r"\1", statement)


def _indexed(statement: str, j: int) -> str:
    """Put a number in the place of the index of a group: ``[j]``, ``[j+1]``, ``[j-1]``, ``[j*2]``."""
    statement = re.sub(r"\[-?\d+\s*\.\.\s*-?\d+\]", str(j), statement)
    values = {"+": lambda k: j + k, "-": lambda k: j - k, "*": lambda k: j * k}
    statement = re.sub(r"\[j(?:([-+*])(\d+))?\]", lambda m: str(values[m[1]](int(m[2])) if m[1] else j), statement)
    return re.sub(r"\[(\d+)\]", r"\1", statement)


def _read(model: _Model, line: str) -> str:
    """Take one statement; return the keyword with which it begins."""
    if line.startswith("@"):
        model.options |= dict(_ASSIGNED.findall(line))
        return "@"
    word, _, rest = line.partition(" ")
    keyword = "" if rest.lstrip().startswith("=") else _keyword(word, bool(rest))
    if keyword in _REFUSED:
        raise _Refusal(f"{_REFUSED[keyword]} cannot be read")
    if keyword in _IGNORED:
        model.ignored.append(line)
    elif keyword == "parameters" or keyword == "number":
        model.parameters |= {name: _number(value) for name, value in _ASSIGNED.findall(rest)}
    elif keyword == "init":
        model.initial |= {name: _number(value) for name, value in _ASSIGNED.findall(rest)}
    elif keyword == "global":
        _read_event(model, rest)
    elif not keyword:
        _read_equation(model, line)
    return keyword


def _keyword(word: str, has_more: bool) -> str:
    """Return the keyword that a word, or its first letter, is; empty for others."""
    if not has_more:
        return "done" if word in {"d", "done"} else ""
    return next((k for k in _KEYWORDS if word in {k, k[0]} or (len(word) > 2 and word[:3] == k[:3])), "")


def _number(text: str) -> float:
    try:
        return float(text or 0.0)
    except ValueError:
        raise _Refusal(f"{text} is no number") from None


def _read_equation(model: _Model, line: str) -> None:
    """Take a derivative, an image, an initial value, a fixed quantity or a function."""
    left, _, right = line.partition("=")
    left = left.replace(" ", "").removeprefix("!")
    rate = re.fullmatch(r"d([a-z]\w*)/dt|([a-z]\w*)(?:'|(\(t\+1\)))", left)
    called = re.fullmatch(r"([a-z]\w*)\(([^()]*)\)", left)
    if not right:
        raise _Refusal("it is no statement")
    if left == "0":
        raise _Refusal(f"{_REFUSED['solv']} cannot be read")
    if rate:
        model.is_map |= bool(rate[3])
        model.rates[rate[1] or rate[2]] = _python(right)
    elif called and called[2] == "0":
        model.initial[called[1]] = _number(right.strip())
    elif called:
        arguments = [f"v_{name}" for name in called[2].split(",") if name]
        model.functions[called[1]] = (", ".join(arguments), _python(right))
    elif re.fullmatch(r"[a-z]\w*", left):
        model.fixed[left] = _python(right)
    else:
        raise _Refusal("its left side is no name, derivative or function")


def _read_event(model: _Model, rest: str) -> None:
    found = re.fullmatch(r"(-?[01])\s*(.*?)\s*\{([^{}]*)\}", rest.strip())
    if not found:
        raise _Refusal("write global sign {condition} {name=formula; ...}")
    reset = {}
    for part in found[3].split(";"):
        name, _, formula = part.partition("=")
        if formula:
            reset[name.strip()] = _python(formula)
    model.events.append((int(found[1]), _python(found[2].strip("{}")), reset))


def _python(formula: str) -> str:
    """Return a formula of XPP in Python, with names such as v_x, and f_x for functions of the file."""
    if refused := re.search(rf"\b({'|'.join(_REFUSED)})\s*[({{[]", formula):
        raise _Refusal(f"{_REFUSED[refused[1]]} cannot be read")
    text, place, tokens = re.sub(r"\)\s*(then|else)\s*\(", ",", formula), 0, []
    while text[place:].strip():
        found = _TOKEN.match(text, place)
        if not found:
            raise _Refusal(f"{text[place:].strip()[:12]} is not understood")
        tokens.append(found[1])
        place = found.end()
    tokens.append("")
    result = _expression(tokens, 0)
    if tokens != [""]:
        raise _Refusal(f"{tokens[0]} is not understood")
    return result


def _expression(tokens: list[str], binding: int) -> str:
    left = _operand(tokens)
    while _PRECEDENCE.get(tokens[0], 0) > binding:
        symbol = tokens.pop(0)
        right = _expression(tokens, _PRECEDENCE[symbol])
        if symbol in {"==", "!="}:
            left = f"({'not ' if symbol == '!=' else ''}({left} >= {right} and {left} <= {right}))"
        else:
            left = f"({left} {_PYTHON.get(symbol, symbol)} {right})"
    return left


def _operand(tokens: list[str]) -> str:
    token = tokens.pop(0)
    if token in {"-", "+"}:
        return f"({token}{_expression(tokens, _PRECEDENCE['*'])})"
    if token == "(":
        inside = _expression(tokens, 0)
        _expect(tokens, ")")
        return inside
    if token and token[0] in ".0123456789":
        return repr(float(token))
    if not token[:1].isalpha():
        raise _Refusal(f"{token or 'the end'} stands where a value is expected")
    if tokens[0] != "(":
        return {"t": "t", "pi": "pi"}.get(token, f"v_{token}")
    tokens.pop(0)
    arguments = [_expression(tokens, 0)]
    while tokens[0] == ",":
        tokens.pop(0)
        arguments.append(_expression(tokens, 0))
    _expect(tokens, ")")
    if token == "if" and len(arguments) == 3:
        return f"({arguments[1]} if {arguments[0]} else {arguments[2]})"
    if token == "not":
        return f"(not {arguments[0]})"
    return f"{_FUNCTIONS.get(token, f'f_{token}')}({', '.join(arguments)})"


def _expect(tokens: list[str], symbol: str) -> None:
    if tokens.pop(0) != symbol:
        raise _Refusal("its parentheses do not match")


def _coordinate(name: str, in_file: str, options: Mapping[str, str]) -> Coordinate:
    folded = options.get("fold", "") == in_file
    return angle(name, "", float(options.get("tor_per", 2.0 * math.pi)), 0.0) if folded else Coordinate(name)


class _Functions:
    """Writes functions of time, state and parameters that compute what their formulas need, and that alone."""

    def __init__(self, model: _Model, renamed: Mapping[str, str]) -> None:
        self._is_map = model.is_map
        self._states = "".join(f"v_{name}, " for name in model.rates)
        self._known = {"v_" + name for name in model.rates}
        self._lines = {f"v_{n}": ("", f"v_{n} = p.{renamed.get(n, n)}") for n in model.parameters}
        self._lines |= {f"v_{n}": (formula, f"v_{n} = {formula}") for n, formula in model.fixed.items()}
        for name, (arguments, formula) in model.functions.items():
            self._lines[f"f_{name}"] = (_without(formula, arguments), f"def f_{name}({arguments}): return {formula}")

    def function(self, formulas: list[str], single: bool = False) -> Callable[..., Any]:
        """Return the function ``f(t, x, p)`` of formulas."""
        lines: dict[str, str] = {}
        for formula in formulas:
            self._need(formula, lines, ())
        if self._is_map and re.search(r"\bt\b", " ".join([*formulas, *lines.values()])):
            raise _Refusal("the map depends on t, the number of the iterate: make that a state variable, n'=n+1")
        result = formulas[0] if single else f"{', '.join(formulas)},"
        text = "\n    ".join(["def formulas(t, x, p):", f"{self._states}= x", *lines.values(), f"return {result}"])
        scope = dict(_SCOPE)
        exec(text, scope)  # of names, numbers and operators that have been read one by one
        made: Callable[..., Any] = scope["formulas"]
        return made

    def _need(self, formula: str, lines: dict[str, str], above: tuple[str, ...]) -> None:
        for name in re.findall(r"\b[vf]_\w+", formula):
            if name in self._known or name in lines:
                continue
            if name in above:
                raise _Refusal(f"{name[2:]} is defined by itself", rf"^{name[2:]}\s*(\(.*\))?\s*=")
            if name not in self._lines:
                raise _Refusal(f"{name[2:]} is not defined in it", rf"\b{name[2:]}\b")
            needs, line = self._lines[name]
            self._need(needs, lines, (*above, name))
            lines[name] = line


def _without(formula: str, arguments: str) -> str:
    names = arguments.split(", ")
    return " ".join(name for name in re.findall(r"\b[vf]_\w+", formula) if name not in names)
