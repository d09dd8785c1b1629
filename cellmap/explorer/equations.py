"""Systems typed as text: formulas are parsed and translated, and nothing else that Python knows is executed.

Each line is one of these; a `#` begins a comment::

    theta' = omega                     the derivative of a coordinate
    omega' = -sin(theta) - c*omega + f*drive
    drive = cos(w*t)                   an abbreviation: it contains t, a coordinate or another abbreviation
    c = 0.2                            a parameter: numbers alone
    f = 1.5
    w = 2/3
    period = 2*pi/w                    the period of the forcing
    angle theta                        a coordinate of period 2 pi

With ``x -> formula`` in the place of derivatives the system is a discrete map.  Programs in Python are read by
:mod:`cellmap.explorer.python_notation`.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .._lib.checks import parameter_values
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
from .python_notation import Translation, is_python, translated

_LINE = re.compile(r"\s*(?:(angle)\s+(\w+)|(\w+)\s*(='|'\s*=|->|=)\s*(.*?))\s*$")
_RESERVED = {"t", "pi", *FUNCTIONS, *BUILT_IN}


@dataclass(eq=False)
class _Text:
    """Formulas by what they define, each with its line."""

    states: dict[str, ast.expr] = field(default_factory=dict)
    others: dict[str, ast.expr] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)
    angles: set[str] = field(default_factory=set)
    is_map: bool = False


def typed_system(text: str, title: str = "typed") -> Explored:
    """Return the system that a text describes, as equations or as a program, under a name.

    Raises
    ------
    EquationError
        For text that is none, with the place.

    Examples
    --------
    >>> oscillator = typed_system("x' = v; v' = -x - c*v + cos(t); c = 0.5; period = 2*pi".replace(";", chr(10)))
    >>> oscillator.system.derivative(0.0, (0.0, 1.0))
    (1.0, 0.5)
    """
    names: dict[str, Any] = {}
    try:
        found = translated(text, title) if is_python(text) else _translated(text, title)
        exec(compile(found.source, "<equations>", "exec"), names)
    except RecursionError:
        raise EquationError(
            "a formula has too many parts within or after each other: give some of them names", 1
        ) from None
    except EquationError:
        raise
    except (ValueError, TypeError, ArithmeticError) as error:
        part = next((part for part in ("period", "coordinates") if str(error).startswith(part)), "rhs")
        raise EquationError(str(error), found.lines.get(part, 1)) from error
    system: ForcedSystem | PointMap = names["system"]
    return Explored(title, lambda: system, source=found.source)


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


def _translated(text: str, title: str) -> Translation:
    """Return the program of lines of equations."""
    found = _parsed(text)
    states, sorted_names = list(found.states), _in_order(found)
    constants = [name for name in found.others if name != "period" and name not in sorted_names]
    values = {name: _number(found, name) for name in constants}
    line = next(iter(found.lines.values()))
    if not found.is_map and "period" not in found.others:
        raise EquationError("period is missing: add a line such as  period = 2*pi", line)
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
            body.append(f"    {name} = {ast.unparse(rename.visit(formula))}")
    images = ", ".join(ast.unparse(rename.visit(found.states[name])) for name in states)
    body.append(f"    return {images}{',' if len(states) == 1 else ''}")
    coordinates = "".join(f"angle({n!r}), " if n in found.angles else f"{n!r}, " for n in states)
    formulas = [*found.states.values(), *(found.others[n] for n in found.others if n not in values)]
    used = sorted({name for formula in formulas for name in _math_in(formula)})
    lines = [f"from math import {', '.join(used)}", ""] if used else []
    lines += ["from cellmap import ForcedSystem, angle, discrete_map", ""]
    lines += ["", f"def rhs({'' if found.is_map else 't, '}x, p):", *body, "", ""]
    if found.is_map:
        lines.append(f"system = discrete_map(rhs, {values!r}, ({coordinates.strip()}), name={title!r})")
    else:
        _known_names(found.others["period"], set(constants), found.lines["period"])
        lines += ["def period(p):", f"    return {ast.unparse(rename.visit(found.others['period']))}", "", ""]
        lines.append(f"system = ForcedSystem(rhs, {values!r}, period, ({coordinates.strip()}), name={title!r})")
    places = {"period": found.lines["period"]} if "period" in found.lines else {}
    return Translation("\n".join(lines) + "\n", places)


def _parsed(text: str) -> _Text:
    if len(text) > LONGEST_TEXT:
        raise EquationError(f"{len(text)} characters: write at most {LONGEST_TEXT}", 1)
    found = _Text()
    kinds = set()
    for number, full in enumerate(text.splitlines(), 1):
        content = full.split("#")[0]
        if not content.strip():
            continue
        match = _LINE.match(content)
        if match is None:
            raise EquationError("write  name' = formula,  name = formula,  name -> formula  or  angle name", number)
        if match[1]:
            found.angles.add(match[2])
            found.lines.setdefault(f"angle {match[2]}", number)
            continue
        name, sign, formula = match[3], match[4], match[5]
        column = match.start(3) + 1
        if name in found.states or name in found.others:
            raise EquationError(f"{name} has a line already: remove one of them", number, column)
        if name in _RESERVED:
            raise EquationError(f"{name} means something already: take another name", number, column)
        try:
            parameter_values({name: 0.0})
        except ValueError:
            raise EquationError(f"{name} cannot be a name: begin it with a letter", number, column) from None
        tree = _formula(formula, number, match.start(5))
        (found.others if sign == "=" else found.states)[name] = tree
        found.lines[name] = number
        kinds |= {sign == "->"} if sign != "=" else set()
    if not found.states:
        raise EquationError("no equation: write a line such as  x' = v  or, for a map,  x -> a - x**2", 1)
    if len(kinds) > 1:
        raise EquationError(
            "derivatives and images are mixed: write  '=  everywhere, or  ->", min(found.lines.values())
        )
    for name in found.angles - found.states.keys():
        raise EquationError(f"{name} is no coordinate: give it an equation", found.lines[f"angle {name}"])
    found.is_map = kinds == {True}
    return found


def _formula(formula: str, line: int, offset: int) -> ast.expr:
    """Parse a formula, and refuse what is none."""
    if "^" in formula:
        raise EquationError("^ is no power: write **", line, offset + formula.index("^") + 1)
    try:
        tree = ast.parse(formula, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        place = getattr(error, "offset", None) or 1
        raise EquationError(f"no formula ({getattr(error, 'msg', error)})", line, offset + place) from None
    pending: list[ast.AST] = [tree]
    while pending:
        node = pending.pop()
        _refuse(node, line, offset)
        pending += [n for n in ast.iter_child_nodes(node) if not (isinstance(node, ast.Call) and n is node.func)]
    return tree


def _refuse(node: ast.AST, line: int, offset: int) -> None:
    """Raise an error for a node that is no part of a formula."""
    column = offset + getattr(node, "col_offset", 0) + 1
    if isinstance(node, ast.Call):
        if not isinstance(node.func, ast.Name) or node.func.id not in (*FUNCTIONS, *BUILT_IN) or node.keywords:
            raise EquationError(f"unknown function: use one of {', '.join((*FUNCTIONS, *BUILT_IN))}", line, column)
    elif isinstance(node, ast.Name):
        if node.id in (*FUNCTIONS, *BUILT_IN):
            raise EquationError(f"{node.id} is a function: write {node.id}(...)", line, column)
    elif isinstance(node, ast.Constant):
        if not is_number(node.value):
            raise EquationError(f"{node.value!r} is no number", line, column)
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
            raise EquationError(f"{node.id} is not defined here: add a line such as  {node.id} = 1", line)


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
