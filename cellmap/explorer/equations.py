"""Systems typed as text: formulas are parsed and translated, and nothing else that Python knows is executed.

Each line is one of these; a `#` begins a comment::

    theta'' = -sin(theta) - c theta' + f drive
    drive = cos(w t)                   an abbreviation: it contains t, a coordinate or another abbreviation
    c = 0.2                            a parameter: numbers alone
    f = 1.5
    w = 2/3
    period = 2*pi/w                    the period of the forcing
    angle theta                        a coordinate of period 2 pi

A derivative of higher order makes those below it coordinates: ``theta`` and ``theta'`` here.  A coordinate that is
called theta, phi or psi is an angle where all formulas have the period 2 pi in it.  With ``x -> formula`` in the place
of derivatives the system is a discrete map.  How formulas may be written is said in
:mod:`cellmap.explorer.handwriting`.
"""

from __future__ import annotations

import ast
import functools
import itertools
import os
import re
from collections.abc import Container
from copy import deepcopy
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.checks import parameter_values, shown
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem
from .explored import Explored
from .formulas import (
    BUILT_IN,
    COMPARISONS,
    FUNCTIONS,
    LONGEST_TEXT,
    MOST_WORK,
    OPERATORS,
    EquationError,
    PlainNumbers,
    is_number,
    too_long,
    value_of,
    work_of,
)
from .handwriting import Plain, identifier, plain

_LINE = re.compile(r"\s*(?:angle\s+(\w+)|(\w+)('*)\s*(->|=)\s*(.*?))\s*$")
_PROGRAM = re.compile(r"^(def|from|import|class|async|@)\b", re.MULTILINE)
_PRIMED = re.compile(r"\w+'+")
_ANGLES = re.compile(r"(theta|phi|psi)(_?\d+)?$")
_RATE = re.compile(r"\b(?:cos|sin)\((?:(\w+) \* t|t \* (\w+))\b")
_BARE = re.compile(  # a function whose argument has no brackets, or whose power stands before it
    rf"\b(?P<name>{'|'.join(FUNCTIONS)})(?:(?P<power>\*\*\d+)\*?\s*(?P<what>\w+|\([^()]*\))|\s+(?P<bare>\w+(?:\*\w+)*))"
)
_RESERVED = {"t", "pi", *FUNCTIONS, *BUILT_IN}


@dataclass(eq=False)
class _Text:
    """Formulas by what they define, each with its line; coordinates by names of programs, with those that are shown."""

    names: dict[str, str] = field(default_factory=dict)
    states: dict[str, ast.expr] = field(default_factory=dict)
    others: dict[str, ast.expr] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)
    angles: set[str] = field(default_factory=set)
    is_map: bool = False


def typed_system(text: str, title: str = "typed") -> Explored:
    """Return the system that a text describes as equations, under a name.

    Raises
    ------
    EquationError
        For text that is none, with the place.

    Examples
    --------
    >>> oscillator = typed_system("x'' = -x - c x' + cos(t); c = 0.5; period = 2 pi".replace(";", chr(10)))
    >>> oscillator.system.derivative(0.0, (0.0, 1.0))
    (1.0, 0.5)
    """
    if (program := _PROGRAM.search(text)) is not None:
        line = text[: program.start()].count("\n") + 1
        raise EquationError("this is a program: write equations, or call cellmap.explore(system) in it", line)
    found = _Text()
    try:
        found = _parsed(text)
        source = _source(found, title)
        system = _built(source)
        candidates = [n for n in found.states if _ANGLES.match(n) and n not in found.angles]
        if turning := [n for n in candidates if _turns(system, found, n)]:
            found.angles.update(turning)
            source = _source(found, title)
            system = _built(source)
    except RecursionError:
        raise EquationError(
            "a formula has too many parts within or after each other: give some of them names", 1
        ) from None
    except EquationError:
        raise
    except (ValueError, TypeError, ArithmeticError) as error:
        line = found.lines.get("period", 1) if str(error).startswith("period") else 1
        raise EquationError(str(error), line) from error
    return Explored(title, lambda: system, source=source)


@functools.lru_cache(maxsize=64)
def _built(source: str) -> ForcedSystem | PointMap:
    """Return the system of a program that has been written here, the same one for the same program.

    What is compiled for a system is kept with it: pages that give the same equations share it.
    """
    names: dict[str, Any] = {}
    exec(compile(source, "<equations>", "exec"), names)
    return names["system"]


def _turns(system: ForcedSystem | PointMap, found: _Text, name: str) -> bool:
    """Tell whether all formulas have the period 2 pi in a coordinate; images may be full rotations further on."""
    place = list(found.states).index(name)
    states = np.random.default_rng(0).uniform(-3.0, 3.0, (16, len(found.states)))
    shifted = states.copy()
    shifted[:, place] += 2.0 * pi
    if isinstance(system, PointMap):
        images = [np.asarray(system(x)) for x in (states, shifted)]
    else:
        times = np.linspace(0.0, system.length, len(states))
        images = [np.array(list(map(system.derivative, times, x))) for x in (states, shifted)]
    difference = images[1] - images[0]
    if isinstance(system, PointMap):
        difference[:, place] -= 2.0 * pi * np.round(difference[:, place] / (2.0 * pi))
    return bool(np.nanmax(np.abs(difference)) < 1e-9 * (1.0 + np.nanmax(np.abs(images[0]))))


def typed_file(path: str | os.PathLike[str]) -> Explored:
    """Return the system that a text file describes, under the name of the file.

    Raises
    ------
    EquationError
        For text that is no system, with the place.
    OSError, UnicodeDecodeError
        For a file that cannot be read.
    """
    file = Path(path)
    return typed_system(file.read_text(encoding="utf-8"), file.stem)


def _source(found: _Text, title: str) -> str:
    """Return the program of lines of equations, after which ``system`` is the system."""
    states, sorted_names = list(found.states), _in_order(found)
    constants = [name for name in found.others if name != "period" and name not in sorted_names]
    values = {name: _number(found, name) for name in constants}
    line = next(iter(found.lines.values()))
    if not found.is_map and "period" not in found.others:
        written = " ".join(ast.unparse(f) for f in (*found.others.values(), *found.states.values()))
        rate = next((f"/{m[1] or m[2]}" for m in _RATE.finditer(written) if not (m[1] or m[2]).isdigit()), "")
        raise EquationError(f"period is missing: add a line such as  period = 2*pi{rate}", line)
    scope = {*states, *constants, *sorted_names, "t"}
    if found.is_map:
        scope.discard("t")
    rename = _Translated(values)
    body = [f"    {', '.join(states)}{',' if len(states) == 1 else ''} = x"]
    work = 0
    for name in [*sorted_names, *states]:
        formula = found.others.get(name) or found.states[name]
        _known_names(formula, scope, found.lines[name])
        work += work_of(formula)
        if work > MOST_WORK:
            raise too_long(found.lines[name])
        if name in sorted_names:
            body.append(f"    {name} = {ast.unparse(rename.visit(deepcopy(formula)))}")
    images = ", ".join(ast.unparse(rename.visit(deepcopy(found.states[name]))) for name in states)
    body.append(f"    return {images}{',' if len(states) == 1 else ''}")
    called = {n: repr(found.names[n]) for n in states}
    coordinates = "".join(f"angle({called[n]}), " if n in found.angles else f"{called[n]}, " for n in states)
    formulas = [*found.states.values(), *(found.others[n] for n in found.others if n not in values)]
    used = sorted({name for formula in formulas for name in _math_in(formula)})
    lines = [f"from math import {', '.join(used)}", ""] if used else []
    lines += ["from cellmap import ForcedSystem, angle, discrete_map", ""]
    lines += ["", f"def rhs({'' if found.is_map else 't, '}x, p):", *body, "", ""]
    if found.is_map:
        lines.append(f"system = discrete_map(rhs, {values!r}, ({coordinates.strip()}), name={title!r})")
    else:
        _known_names(found.others["period"], set(constants), found.lines["period"])
        lines += ["def period(p):", f"    return {ast.unparse(rename.visit(deepcopy(found.others['period'])))}", "", ""]
        lines.append(f"system = ForcedSystem(rhs, {values!r}, period, ({coordinates.strip()}), name={title!r})")
    return "\n".join(lines) + "\n"


def _parsed(text: str) -> _Text:
    if len(text) > LONGEST_TEXT:
        raise EquationError(f"{len(text)} characters: write at most {LONGEST_TEXT}", 1)
    found = _Text()
    kinds = set()
    for number, full in enumerate(text.splitlines(), 1):
        line = plain(full.split("#")[0])
        if not line.text.strip():
            continue
        match = _LINE.match(line.text)
        if match is None:
            raise EquationError("write  name' = formula,  name = formula,  name -> formula  or  angle name", number)
        if match[1]:
            found.angles.add(match[1])
            found.lines.setdefault(f"angle {match[1]}", number)
            continue
        stem, primes, sign = match[2], match[3], match[4]
        column = line.place(match.start(2) + 1)
        if primes and sign == "->":
            raise EquationError(f"the image of {stem} has no prime: write  {stem} -> {match[5]}", number, column)
        below = [stem + "'" * k for k in range(max(1, len(primes)))]  # coordinates, up to the highest derivative
        for called in below:
            name = identifier(called)
            if name in found.states or name in found.others:
                raise EquationError(f"{called} has a line already: remove one of them", number, column)
            if name in _RESERVED:
                raise EquationError(f"{called} means something already: take another name", number, column)
            try:
                parameter_values({name: 0.0})
            except ValueError:
                raise EquationError(f"{called} cannot be a name: begin it with a letter", number, column) from None
            found.names[name], found.lines[name] = called, number
        tree = _formula(match[5], number, line, match.start(5))
        for name, following in itertools.pairwise(map(identifier, below)):
            found.states[name] = ast.Name(following, ast.Load())
        (found.states if primes or sign == "->" else found.others)[identifier(below[-1])] = tree
        kinds |= {sign == "->"} if primes or sign == "->" else set()
    if not found.states:
        raise EquationError("no equation: write a line such as  x' = v  or, for a map,  x -> a - x^2", 1)
    if len(kinds) > 1:
        raise EquationError(
            "derivatives and images are mixed: write  '=  everywhere, or  ->", min(found.lines.values())
        )
    for name in found.angles - found.states.keys():
        raise EquationError(f"{name} is no coordinate: give it an equation", found.lines[f"angle {name}"])
    found.is_map = kinds == {True}
    return found


def _formula(formula: str, number: int, line: Plain, offset: int) -> ast.expr:
    """Parse a formula, from a place of its line on, and refuse what is none."""
    if (named := _BARE.search(formula)) is not None:
        name, power, what = named["name"], named["power"] or "", named["what"] or named["bare"]
        corrected = f"write  {name}({what.strip('()')}){power.replace('**', '^')}"
        raise EquationError(corrected, number, line.place(offset + named.start() + 1))
    # Names of derivatives are longer in programs: places are kept in blanks behind shorter ones.
    columns, written = list[int](), ""
    position = 0
    for primed in _PRIMED.finditer(formula):
        for piece, where in ((formula[position : primed.start()], position), (identifier(primed[0]), primed.start())):
            columns += [where + min(k, len(primed[0]) - 1) if where else k for k in range(len(piece))]
            written += piece
        position = primed.end()
    written, columns = written + formula[position:], [*columns, *range(position, len(formula) + 1)]

    def at(column: int) -> int:
        return line.place(offset + columns[min(column, len(columns) - 1)] + 1)

    try:
        tree = ast.parse(written, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        place = getattr(error, "offset", None) or 1
        raise EquationError(f"no formula ({getattr(error, 'msg', error)})", number, at(place - 1)) from None
    pending: list[ast.AST] = [tree]
    while pending:
        node = pending.pop()
        _refuse(node, number, at(getattr(node, "col_offset", 0)))
        pending += [n for n in ast.iter_child_nodes(node) if not (isinstance(node, ast.Call) and n is node.func)]
    return tree


def _refuse(node: ast.AST, line: int, column: int) -> None:
    """Raise an error for a node that is no part of a formula."""
    if isinstance(node, ast.Call):
        if not isinstance(node.func, ast.Name) or node.func.id not in (*FUNCTIONS, *BUILT_IN) or node.keywords:
            if isinstance(node.func, ast.Name) and len(node.args) == 1 and len(node.func.id) < 3:
                corrected = f"{node.func.id}*({ast.unparse(node.args[0])})"
                raise EquationError(f"{node.func.id} is no function: write  {corrected}", line, column)
            raise EquationError(f"unknown function: use one of {', '.join((*FUNCTIONS, *BUILT_IN))}", line, column)
    elif isinstance(node, ast.Name):
        if node.id in (*FUNCTIONS, *BUILT_IN):
            raise EquationError(f"{node.id} is a function: write {node.id}(...)", line, column)
    elif isinstance(node, ast.Constant):
        if not is_number(node.value):
            raise EquationError(f"{shown(node.value)} is no number", line, column)
    elif isinstance(node, ast.operator | ast.unaryop):
        if not isinstance(node, OPERATORS):
            raise EquationError(f"{type(node).__name__} is no operation on numbers: use + - * / ** %", line, column)
    elif isinstance(node, ast.Compare):
        if len(node.ops) > 1 or not isinstance(node.ops[0], COMPARISONS):
            raise EquationError("compare two numbers, with < <= > >=", line, column)
    elif not isinstance(node, ast.BinOp | ast.UnaryOp | ast.IfExp | ast.expr_context | ast.cmpop):
        raise EquationError(f"{type(node).__name__} does not belong in a formula", line, column)


def _math_in(tree: ast.expr) -> set[str]:
    return {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and n.id in (*FUNCTIONS, "pi")}


def _names(tree: ast.expr) -> list[ast.Name]:
    return [n for n in ast.walk(tree) if isinstance(n, ast.Name) and n.id not in (*FUNCTIONS, *BUILT_IN, "pi")]


def _known_names(tree: ast.expr, scope: set[str], line: int) -> None:
    for node in _names(tree):
        if node.id not in scope:
            raise EquationError(_unknown(node.id), line)


def _unknown(name: str) -> str:
    """Return what to write for a name that nothing has defined."""
    called = re.sub(r"_(d*)dot$", lambda found: "'" * (len(found[1]) + 1), name)
    if called != name:
        return f"{called} is no coordinate: it has an equation already, or write one for {called}'"
    if name == "e":
        return "e is not defined here: write  exp(...)  for powers of it"
    return f"{name} is not defined here: add a line such as  {name} = 1"


def _in_order(found: _Text) -> list[str]:
    """Return the abbreviations, each after those that it contains."""
    varying = {*found.states, "t"}
    inside: dict[str, set[str]] = {n: {m.id for m in _names(f)} for n, f in found.others.items() if n != "period"}
    while more := {n for n, names in inside.items() if n not in varying and names & varying}:
        varying |= more
    left, order = {n: inside[n] for n in inside if n in varying}, list[str]()
    while left:
        ready = [n for n, names in left.items() if not names & left.keys()]
        if not ready:
            name = next(iter(left))
            raise EquationError(f"{name} is defined by itself", found.lines[name])
        order += ready
        left = {n: names for n, names in left.items() if n not in ready}
    return order


def _number(found: _Text, name: str) -> float:
    """Return the value of a parameter, which is written in numbers alone."""
    line = found.lines[name]
    if names := _names(found.others[name]):
        raise EquationError(f"{name} is a parameter, and contains {names[0].id}: write a number", line)
    try:
        return value_of(_Translated({}).visit(found.others[name]))
    except (ValueError, TypeError, ArithmeticError) as error:
        raise EquationError(f"{name} has no value ({error})", line) from error


class _Translated(PlainNumbers):
    """Formulas as right-hand sides read them: parameters are attributes of p."""

    def __init__(self, params: Container[str]) -> None:
        self._params = params

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self._params:
            return ast.Attribute(ast.Name("p", ast.Load()), node.id, ast.Load())
        return node
