"""Random forced right-hand sides with branches, statement by statement, also as programs for another integrator.

An expression is a tuple: an operation and its operands.  Python decides all branches by itself; in a program for
``frozen_branches`` each comparison is a surface, of which a side is given.  Later statements use the values of earlier
ones, in conditions too.
"""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from frozen_branches import ADD, CELL, CONST, MUL, SELECT, SIDE, SIN, STATE, SUB, TANH, TIME, Program

Expression = tuple[Any, ...]

ZERO, HALF = ("c", 0.0), ("c", 0.5)
_BINARY = {"+": ADD, "-": SUB, "*": MUL}
_UNARY = {"sin": SIN, "tanh": TANH}


@dataclass(frozen=True)
class RightHandSide:
    """Statements, the values that they have, and rates of change, with a period and parameters between bounds."""

    statements: tuple[str, ...]
    values: tuple[Expression, ...]
    rates: tuple[Expression, ...]
    period: float
    bounds: tuple[tuple[float, float], ...]

    def parameters(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw values of all parameters: each draw is another right-hand side, and one compilation serves all."""
        return {f"c{i}": float(np.round(rng.uniform(*pair), 3)) for i, pair in enumerate(self.bounds)}

    def function(self) -> Callable[..., Any]:
        """Return the right-hand side in plain Python."""
        names: dict[str, Any] = {n: getattr(math, n) for n in ("sin", "tanh", "floor")} | {"np": np}
        result = f"return ({', '.join(text(rate) for rate in self.rates)},)"
        exec("\n    ".join(("def rhs(t, x, p):", *self.statements, result)), names)
        return names["rhs"]  # type: ignore[no-any-return]

    def program(self, parameters: Mapping[str, float]) -> Program:
        """Return the same for the integrator that is given the sides of all surfaces."""
        writer, known = _Writer(parameters), list[Expression]()
        for value in self.values:
            known.append(as_selections(_with_values(value, known)))
        rates = [writer.code(as_selections(_with_values(rate, known))) for rate in self.rates]
        return Program.of(rates, writer.surfaces, writer.levels)


def text(e: Expression) -> str:
    """Return an expression or a condition as Python writes it."""
    match e[0], *(a if not isinstance(a, tuple) else text(a) for a in e[1:]):
        case "x", i:
            return f"x[{i}]"
        case "v", k:
            return f"v{k}"
        case ["t"]:
            return "t"
        case "c", value:
            return f"({value!r})"
        case "p", i:
            return f"p.c{i}"
        case ("+" | "-" | "*" | "<" | ">" | "and" | "or") as sign, a, b:
            return f"({a} {sign} {b})"
        case "within", low, a, high:
            return f"({low} < {a} < {high})"
        case "truth", condition:
            return f"{condition}"
        case "mod", a:
            return f"({a} % 1.0)"
        case "if", condition, yes, no:
            return f"({yes} if {condition} else {no})"
        case ("sign" | "clip" | "where") as name, *parts:
            return f"np.{name}({', '.join(parts)})"
        case name, *parts:
            return f"{name}({', '.join(parts)})"
    raise ValueError(e)


def _with_values(e: Any, values: list[Expression]) -> Any:
    if not isinstance(e, tuple):
        return e
    return values[e[1]] if e[0] == "v" else (e[0], *(_with_values(a, values) for a in e[1:]))


@functools.cache
def as_selections(e: Expression) -> Expression:
    """Return an expression in which ``if`` is the only operation that selects, by a number that is positive or not.

    A number that has a selection inside becomes one on either side of that: where a solution slides along the inner
    surface, both sides count.
    """
    match e:
        case (("if" | "where"), condition, yes, no):
            return _decided(condition, as_selections(yes), as_selections(no))
        case "truth", condition:
            return _decided(condition, ("c", 1.0), ZERO)
        case "max", a, b:
            return as_selections(("if", (">", a, b), a, b))
        case "min", a, b:
            return as_selections(("if", (">", a, b), b, a))
        case "abs", a:
            return as_selections(("if", (">", a, ZERO), a, ("-", ZERO, a)))
        case "sign", a:
            return as_selections(("if", (">", a, ZERO), ("c", 1.0), ("c", -1.0)))
        case "clip", a, low, high:
            return as_selections(("min", ("max", a, low), high))
        case "round", a:
            return as_selections(("floor", ("+", a, HALF)))
        case "mod", a:
            return as_selections(("-", a, ("floor", a)))
        case "floor", a:
            return _apart(as_selections(a), lambda a: ("floor", a))
        case name, *parts:
            return (name, *(as_selections(p) if isinstance(p, tuple) else p for p in parts))
    raise ValueError(e)


def _decided(condition: Expression, yes: Expression, no: Expression) -> Expression:
    match condition:
        case "not", c:
            return _decided(c, no, yes)
        case "and", c, d:
            return _decided(c, _decided(d, yes, no), no)
        case "or", c, d:
            return _decided(c, yes, _decided(d, yes, no))
        case "within", low, a, high:
            return _decided(("and", (">", a, low), ("<", a, high)), yes, no)
        case "<", a, b:
            return _decided((">", b, a), yes, no)
        case ">", a, b:
            return _decided(("-", a, b), yes, no)
    return _apart(as_selections(condition), lambda number: yes if yes == no else ("if", number, yes, no))


def _apart(e: Expression, made: Callable[[Expression], Expression]) -> Expression:
    """Return what is made of an expression, on either side of the selections inside of it."""
    inner = _selection_in(e)
    if inner is None:
        return made(e)
    yes, no = (_apart(_replaced(e, inner[1], side), made) for side in (2, 3))
    return yes if yes == no else ("if", inner[1], yes, no)


def _selection_in(e: Any) -> Expression | None:
    if not isinstance(e, tuple):
        return None
    return e if e[0] == "if" else next((i for a in e[1:] if (i := _selection_in(a)) is not None), None)


def _replaced(e: Any, surface: Expression, side: int) -> Any:
    """Return an expression on one side of a surface."""
    if not isinstance(e, tuple):
        return e
    if e[0] == "if" and e[1] == surface:
        return _replaced(e[side], surface, side)
    return (e[0], *(_replaced(a, surface, side) for a in e[1:]))


@dataclass
class _Writer:
    """Writes programs; surfaces and whether they are levels at whole numbers, each after those inside it."""

    parameters: Mapping[str, float]
    surfaces: list[list[tuple[int, float]]] = field(default_factory=list)
    levels: list[bool] = field(default_factory=list)
    known: dict[tuple[bool, Expression], int] = field(default_factory=dict)

    def surface(self, e: Expression, levels: bool = False) -> int:
        if (levels, e) not in self.known:
            self.surfaces.append(self.code(e))
            self.levels.append(levels)
            self.known[levels, e] = len(self.levels) - 1
        return self.known[levels, e]

    def code(self, e: Expression) -> list[tuple[int, float]]:
        code = self.code
        match e:
            case "x", i:
                return [(STATE, i)]
            case ["t"]:
                return [(TIME, 0)]
            case "c", value:
                return [(CONST, value)]
            case "p", i:
                return [(CONST, self.parameters[f"c{i}"])]
            case ("+" | "-" | "*") as sign, a, b:
                return [*code(a), *code(b), (_BINARY[sign], 0)]
            case ("sin" | "tanh") as name, a:
                return [*code(a), (_UNARY[name], 0)]
            case "floor", a:
                return [(CELL, self.surface(a, levels=True))]
            case "if", a, yes, no:
                return [(SIDE, self.surface(a)), *code(yes), *code(no), (SELECT, 0)]
        raise ValueError(e)


def drawn(rng: np.random.Generator) -> RightHandSide:
    """Draw a system of one to four states with up to ten comparisons."""
    return _Maker(rng, float(np.round(rng.uniform(0.5, 3.0), 3)), int(rng.integers(1, 5))).made()


def plus(*terms: Expression) -> Expression:
    return functools.reduce(lambda a, b: ("+", a, b), terms)


@dataclass
class _Maker:
    rng: np.random.Generator
    omega: float
    dimension: int
    asked: int = 0
    lines: list[str] = field(default_factory=list)
    values: list[Expression] = field(default_factory=list)
    bounds: list[tuple[float, float]] = field(default_factory=list)

    def number(self, low: float, high: float) -> Expression:
        self.bounds.append((low, high))
        return ("p", len(self.bounds) - 1)

    def one_of(self, *choices: Any) -> Any:
        return choices[int(self.rng.integers(len(choices)))]

    def state(self) -> Expression:
        return ("x", int(self.rng.integers(self.dimension)))

    def earlier(self) -> Expression:
        return ("v", int(self.rng.integers(len(self.values))))

    def signal(self) -> Expression:
        multiple = float(self.rng.integers(1, 4)) * self.omega
        return ("sin", ("+", ("*", ("c", multiple), ("t",)), self.number(-3, 3)))

    def value(self) -> Expression:
        """Return what a branch may result in."""
        match int(self.rng.integers(6)):
            case 0:
                return self.number(-0.6, 0.6)
            case 1:
                return self.signal()
            case 2:
                return ("tanh", ("*", self.state(), self.state()))
            case 3 if self.values:
                return ("*", self.number(0.3, 0.9), self.earlier())
            case 4:
                return ("tanh", ("*", self.number(0.5, 3), self.state()))
        return self.state()

    def level(self) -> Expression:
        """Return what is compared: states, time, and now and then an earlier value or a ramp in time."""
        kind = self.rng.random()
        if kind < 0.1:
            return self.signal()
        if kind < 0.2:
            ramp = plus(("*", ("c", float(self.rng.integers(1, 4)) * self.omega / (2 * math.pi)), ("t",)), ("c", 0.137))
            return ("-", ("x", 0), ("-", ("*", ("c", 2.0), ("mod", ramp)), ("c", 1.0)))
        terms = [self.state()]
        if self.dimension > 1 and self.rng.random() < 0.4:
            terms.append(("*", self.number(-0.6, 0.6), self.state()))
        if self.rng.random() < 0.25:
            terms.append(("*", self.number(0.2, 0.8), self.signal()))
        if self.values and self.rng.random() < 0.5:
            terms.append(("*", self.number(0.1, 0.4), self.earlier()))
        return plus(*terms)

    def condition(self) -> Expression:
        self.asked += 1
        return (self.one_of("<", ">"), self.level(), self.number(-0.8, 0.8))

    def within(self) -> Expression:
        self.asked += 2
        return ("within", self.number(-0.9, -0.1), self.level(), self.number(0.1, 0.9))

    def joined(self) -> Expression:
        a, b = self.condition(), self.condition()
        return self.one_of(("and", a, b), ("not", ("or", a, b)), ("and", a, ("not", b)), ("or", a, b))

    def statement(self, room: int) -> None:
        """Write lines that give the next name a value, with at most so many comparisons."""
        name, a, b, c = f"v{len(self.values)}", self.value(), self.value(), self.value()
        kind = int(self.rng.integers(13)) if room > 2 else int(self.rng.integers(7, 13)) if room > 1 else 9
        first, lines, stiff = (
            self.condition,
            list[str](),
            self.number(*self.one_of((0.3, 2.0), (0.3, 2.0), (5.0, 20.0))),
        )
        match kind:
            case 0:
                one, two = first(), first()
                lines = [f"if {text(one)}:", f"    {name} = {text(a)}", f"elif {text(two)}:", f"    {name} = {text(b)}"]
                lines += ["else:", f"    {name} = {text(c)}"]
                value = ("if", one, a, ("if", two, b, c))
            case 1:
                outer, inner = first(), self.one_of(self.condition, self.within)()
                lines = [f"if {text(outer)}:", f"    {name} = {text(a)}", f"    if {text(inner)}:"]
                lines += [f"        {name} = {name} + {text(b)}", "else:", f"    {name} = {text(c)}"]
                value = ("if", outer, ("if", inner, plus(a, b), a), c)
            case 2:
                value = plus(*(("*", ("truth", first()), part) for part in (a, b)))
            case 3:
                value = ("*", ("*", ("truth", first()), ("truth", first())), a)
            case 4:
                self.asked += 2
                value = ("clip", ("*", stiff, self.level()), self.number(-0.8, -0.2), self.number(0.2, 0.8))
            case 5:
                value = ("if", self.within(), a, ("if", first(), b, c))
            case 6 | 7:
                value = ("if", self.joined(), a, b)
            case 8:
                value = ("if", self.within(), a, b)
            case 9:
                one = first()
                lines = [f"{name} = {text(a)}", f"if {text(one)}:", f"    {name} = {name} - {text(b)}"]
                value = ("if", one, ("-", a, b), a)
            case 10:
                self.asked += 1
                value = (self.one_of("floor", "round", "mod"), ("*", self.number(0.8, 1.7), self.level()))
            case 11:
                self.asked += 1
                one, other = self.one_of((">", self.level(), HALF), (">", HALF, self.level())), self.level()
                value = self.one_of(
                    ("*", stiff, ("abs", other)),
                    ("max", other, a),
                    ("min", other, a),
                    ("sign", other),
                    ("where", one, a, b),
                )
            case _:
                value = ("*", ("truth", first()), a)
        self.lines += lines or [f"{name} = {text(value)}"]
        self.values.append(value)

    def made(self) -> RightHandSide:
        most = int(self.rng.integers(1, 11))
        while self.asked < most:
            self.statement(most - self.asked)
        terms = [("*", self.number(-0.7, 0.7), ("v", k)) for k in range(len(self.values))]
        force = plus(("*", self.number(0.2, 1.5), self.signal()), *terms)

        def held(state: int, *others: int) -> Expression:
            slowed = (("*", self.number(-0.4, -0.05), ("x", other)) for other in others)
            return plus(("*", self.number(-2.0, -0.5), ("x", state)), *slowed)

        rates = [
            (plus(held(0), force),),
            (("x", 1), plus(held(0, 1), force)),
            (("-", ("x", 1), ("*", ("c", 0.2), ("x", 2))), plus(held(0, 1), force), plus(held(2), ("x", 0), ("v", 0))),
            (("x", 1), plus(held(0, 1), force), ("x", 3), plus(held(2, 3), ("*", ("c", 0.3), ("x", 0)), ("v", 0))),
        ][self.dimension - 1]
        return RightHandSide(
            tuple(self.lines), tuple(self.values), rates, 2.0 * math.pi / self.omega, tuple(self.bounds)
        )
