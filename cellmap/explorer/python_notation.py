"""Systems as Python programs: functions, numbers and one system are parsed and rebuilt; nothing else is taken.

A program has imports, functions of numbers, numbers, and a system::

    from math import cos, pi, sin
    from cellmap import ForcedSystem, angle

    def rhs(t, x, p):
        theta, omega = x
        return omega, -sin(theta) - p.c * omega + p.f * cos(p.w * t)

    params = {"c": 0.2, "f": 1.5, "w": 2 / 3}
    pendulum = ForcedSystem(rhs, params, period=lambda p: 2 * pi / p.w, coordinates=(angle("theta"), "omega"))

or ``discrete_map(function, params, coordinates)``.  Without that line, ``rhs`` (or ``function``), ``params``,
``period`` and ``coordinates`` are its arguments; coordinates have the names to which the function unpacks its state, if
there are no others.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field
from typing import Any

from .._lib.checks import parameter_values
from .formulas import BUILT_IN, FUNCTIONS, IN_NUMPY, LONGEST_TEXT, EquationError, value_of
from .python_functions import Function, Functions, Kind, Places, Written

_ARGUMENTS = {
    "ForcedSystem": ("rhs", "params", "period", "coordinates", "name"),
    "discrete_map": ("function", "params", "coordinates", "name"),
}
_REMOVE = "this is not read here: leave functions, numbers and one system"
_COORDINATES = {"angle": ("name", "unit", "period", "lower"), "Coordinate": ("name", "unit", "period", "lower")}


def is_python(text: str) -> bool:
    """Whether a text is a program rather than lines of equations."""
    return re.search(r"^(def|from|import|class|async|@)\b", text, re.MULTILINE) is not None


@dataclass(frozen=True)
class Translation:
    """Python statements after which ``system`` is the system of a text, and the lines of its arguments."""

    source: str
    lines: dict[str, int] = field(default_factory=dict)


def translated(text: str, title: str) -> Translation:
    """Return the program of a text, rebuilt from what has been checked.

    Raises
    ------
    EquationError
        For anything that is no part of such a program, with the place.
    """
    if len(text) > LONGEST_TEXT:
        raise EquationError(f"{len(text)} characters: write at most {LONGEST_TEXT}", 1)
    try:
        tree = ast.parse(text)
        return _Program(text, title).read(tree)
    except SyntaxError as error:
        raise EquationError(f"no Python ({error.msg})", error.lineno or 1, error.offset or 1) from None
    except (RecursionError, MemoryError, ValueError) as error:
        if isinstance(error, EquationError):
            raise
        raise EquationError(f"no Python ({str(error) or 'it is nested too deeply'})", 1) from None


class _Program:
    """The parts of a program, in the order in which they are read."""

    def __init__(self, text: str, title: str) -> None:
        self.places, self.title = Places(text), title
        self.functions = Functions(self.places)
        self.tables: dict[str, ast.Dict] = {}
        self.sequences: dict[str, ast.expr] = {}
        self.cellmap: dict[str, str] = {}
        self.system: ast.Call | None = None

    def read(self, tree: ast.Module) -> Translation:
        for statement in tree.body:
            if isinstance(statement, ast.Import | ast.ImportFrom):
                self._import(statement)
            elif isinstance(statement, ast.FunctionDef):
                self.functions.add(statement.name, statement)
            elif isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None:
                self._assign(statement, statement.value)
            elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
                self._call(statement.value)
            elif not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)):
                self._fail(_REMOVE, statement)
        return self._written()

    def _fail(self, message: str, node: ast.AST) -> Any:
        raise self.places.error(message, node)

    def _import(self, statement: ast.Import | ast.ImportFrom) -> None:
        for alias in statement.names:
            local = alias.asname or alias.name
            module = alias.name if isinstance(statement, ast.Import) else statement.module
            if module in ("math", "numpy") and isinstance(statement, ast.Import):
                self.functions.modules.add(local)
            elif module in ("math", "numpy"):
                name = IN_NUMPY.get(alias.name, alias.name)
                if name not in (*FUNCTIONS, *BUILT_IN, "pi"):
                    self._fail(f"{alias.name} is not known here: use pi, {', '.join(FUNCTIONS)}", statement)
                self.functions.elementary[local] = name
            elif module == "cellmap" and isinstance(statement, ast.ImportFrom):
                self.cellmap[local] = alias.name
            elif statement.__class__ is not ast.ImportFrom or module != "__future__":
                self._fail(f"{module} is not imported here: use math, numpy and cellmap", statement)

    def _assign(self, statement: ast.Assign | ast.AnnAssign, value: ast.expr) -> None:
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        if len(targets) != 1 or not isinstance(targets[0], ast.Name):
            self._fail("write  name = value", statement)
        if isinstance(value, ast.Call) and self._callee(value) in _ARGUMENTS:
            self._call(value)
            return
        name = self.functions.new_name(targets[0].id, targets[0])  # type: ignore[attr-defined]
        if isinstance(value, ast.Lambda):
            self.functions.add(name, value)
        elif isinstance(value, ast.Dict):
            self.tables[name] = value
        elif isinstance(value, ast.Tuple | ast.List):
            self.sequences[name] = value
        elif isinstance(value, ast.Call) and self._callee(value):
            self._fail(_REMOVE, value)
        else:
            self.functions.numbers[name] = self._number(value)
            self.functions.lines[name] = statement.lineno

    def _callee(self, call: ast.Call) -> str:
        """Return what a call is called in cellmap; nothing if it is of no function of cellmap."""
        return self.cellmap.get(call.func.id, "") if isinstance(call.func, ast.Name) else ""

    def _call(self, call: ast.Call) -> None:
        if self._callee(call) not in _ARGUMENTS:
            self._fail(_REMOVE, call)
        if self.system is not None:
            self._fail("there is a system already: leave one", call)
        self.system = call

    def _number(self, formula: ast.expr) -> float:
        kind = self.functions.expression(formula, {})
        if kind != Kind.NUMBER:
            self._fail("write a number", formula)
        try:
            return value_of(Written(self.functions).visit(formula))
        except (ValueError, TypeError, ArithmeticError) as error:
            return float(self._fail(f"this has no value ({error})", formula))

    # --- the system

    def _arguments(self) -> tuple[str, dict[str, ast.expr]]:
        """Return ForcedSystem or discrete_map, and its arguments by their names."""
        if self.system is None:
            kind = "ForcedSystem" if "rhs" in self.functions.known else "discrete_map"
            if _ARGUMENTS[kind][0] not in self.functions.known:
                raise EquationError(
                    "no system: add a line such as  system = ForcedSystem(rhs, params, period, coordinates)", 1
                )
            known = {*self.functions.known, *self.functions.numbers, *self.tables, *self.sequences}
            line = self.functions.known[_ARGUMENTS[kind][0]].line
            return kind, {n: ast.Name(n, ast.Load(), lineno=line, col_offset=0) for n in _ARGUMENTS[kind] if n in known}
        call, kind = self.system, self._callee(self.system)
        names = _ARGUMENTS[kind]
        if len(call.args) > len(names) or any(isinstance(a, ast.Starred) for a in call.args):
            self._fail(f"{kind} takes {', '.join(names)} here", call)
        found = dict(zip(names, call.args, strict=False))
        for keyword in call.keywords:
            if keyword.arg not in names or keyword.arg in found:
                self._fail(f"{kind} takes {', '.join(names)} here", keyword.value)
            found[str(keyword.arg)] = keyword.value
        return kind, found

    def _written(self) -> Translation:
        kind, given = self._arguments()
        first = _ARGUMENTS[kind][0]
        for name in (first, *(("period",) if kind == "ForcedSystem" else ())):
            if name not in given:
                line = self.system.lineno if self.system else self.functions.known[first].line
                raise EquationError(f"{name} is missing: {kind} takes {', '.join(_ARGUMENTS[kind])}", line)
        params = self._params(given.get("params"))
        right = self._function(given[first], first)
        states = right.states
        coordinates = self._coordinates(given.get("coordinates"), states)
        dimension = len(coordinates) if coordinates else len(states)
        if not dimension:
            self._fail("coordinates are missing: name each state variable", given[first])
        self.functions.params, self.functions.dimension = params, dimension
        arguments = (Kind.NUMBER, Kind.STATE, Kind.PARAMS) if kind == "ForcedSystem" else (Kind.STATE, Kind.PARAMS)
        self.functions.check_system(right, arguments, dimension)
        lines = {"rhs": right.line, "coordinates": getattr(given.get("coordinates"), "lineno", right.line)}
        ends = [f"{params!r}"]
        if kind == "ForcedSystem":
            lines["period"] = given["period"].lineno
            if isinstance(given["period"], ast.Name):
                lines["period"] = self.functions.lines.get(given["period"].id, lines["period"])
            ends.append(self._period(given["period"]))
        ends.append(f"({''.join(f'{c}, ' for c in coordinates or map(repr, states)).strip()})")
        ends.append(f"name={self._name(given.get('name'))!r}")
        body = self.functions.source()
        used = sorted({name for name in [*FUNCTIONS, "pi"] if re.search(rf"\b{name}\b", body + "".join(ends))})
        head = [f"from math import {', '.join(used)}", ""] if used else []
        head.append(f"from cellmap import {kind}" + ", angle" * ("angle(" in ends[-2]))
        if "Coordinate(" in ends[-2]:
            head.append("from cellmap.maps import Coordinate")
        last = f"system = {kind}({right.name}, {', '.join(ends)})"
        return Translation("\n".join([*head, "", "", body, last, ""]), lines)

    def _function(self, node: ast.expr, role: str) -> Function:
        if isinstance(node, ast.Lambda):
            return self.functions.add(f"{role}_given", node)
        if isinstance(node, ast.Name) and node.id in self.functions.known:
            return self.functions.known[node.id]
        raise self.places.error(f"{role} is a function: give the name of one that is defined above", node)

    def _params(self, node: ast.expr | None) -> dict[str, float]:
        if isinstance(node, ast.Name) and node.id in self.tables:
            node = self.tables[node.id]
        if node is None:
            return {}
        if not isinstance(node, ast.Dict):
            self._fail('params are a dictionary, such as {"c": 0.2}', node)
        found: dict[str, float] = {}
        for key, value in zip(node.keys, node.values, strict=True):  # type: ignore[attr-defined]
            if not isinstance(key, ast.Constant) or not isinstance(key.value, str):
                self._fail('the name of a parameter is a text, such as "c"', key or node)
            try:
                parameter_values({key.value: 0.0})
            except ValueError:
                self._fail(f"{key.value!r} cannot be the name of a parameter: begin it with a letter", key)
            found[key.value] = self._number(value)
        return found

    def _coordinates(self, node: ast.expr | None, states: tuple[str, ...]) -> tuple[str, ...]:
        """Return the coordinates as Python source."""
        if isinstance(node, ast.Name) and node.id in self.sequences:
            node = self.sequences[node.id]
        if node is None:
            return ()
        if not isinstance(node, ast.Tuple | ast.List):
            self._fail('coordinates are names, such as ("q", "v")', node)
        return tuple(self._coordinate(item) for item in node.elts)  # type: ignore[attr-defined]

    def _coordinate(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return repr(node.value)
        kind = self._callee(node) if isinstance(node, ast.Call) else ""
        if not isinstance(node, ast.Call) or kind not in _COORDINATES or len(node.args) > 4:
            raise self.places.error('a coordinate is a name, such as "v", or angle("theta")', node)
        found = {
            **dict(zip(_COORDINATES[kind], node.args, strict=False)),
            **{str(k.arg): k.value for k in node.keywords},
        }
        values = []
        for name, value in found.items():
            if name in ("name", "unit") and isinstance(value, ast.Constant) and isinstance(value.value, str):
                values.append(f"{name}={value.value!r}")
            elif name in ("period", "lower"):
                values.append(f"{name}={self._number(value)!r}")
            else:
                self._fail(f"{kind} takes name, unit, period and lower", value)
        return f"{kind}({', '.join(values)})"

    def _period(self, node: ast.expr) -> str:
        if isinstance(node, ast.Lambda) or (isinstance(node, ast.Name) and node.id in self.functions.known):
            function = self._function(node, "period")
            self.functions.check(function, (Kind.PARAMS,), node, Kind.NUMBER)
            return function.name
        return repr(self._number(node))

    def _name(self, node: ast.expr | None) -> str:
        if node is None:
            return self.title
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str) or not node.value:
            self._fail("name is a text", node)
        return str(node.value)  # type: ignore[attr-defined]
