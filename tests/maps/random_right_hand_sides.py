"""Random forced right-hand sides with branches, as source text of Python and as programs for another integrator.

An expression is a tuple: an operation and its operands.  Python decides all branches by itself; in a program for
``frozen_branches`` each comparison is a surface, of which a side is given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from frozen_branches import ADD, CELL, CONST, COS, MUL, SELECT, SIDE, SIN, STATE, SUB, TANH, TIME, Program

Expression = tuple[Any, ...]

_BINARY = {"+": ADD, "-": SUB, "*": MUL}
_UNARY = {"sin": SIN, "cos": COS, "tanh": TANH}


@dataclass(frozen=True)
class RightHandSide:
    """Rates of change, one expression for each coordinate, with a period and parameters between bounds."""

    rates: tuple[Expression, ...]
    period: float
    bounds: tuple[tuple[float, float], ...] = ()

    def parameters(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw values of all parameters: each draw is another right-hand side, and one compilation serves all."""
        return {f"c{i}": float(np.round(rng.uniform(*pair), 3)) for i, pair in enumerate(self.bounds)}

    @property
    def source(self) -> str:
        lines = ", ".join(text(rate) for rate in self.rates)
        return f"def rhs(t, x, p):\n    return ({lines},)\n"

    def function(self) -> Callable[..., Any]:
        """Return the right-hand side in plain Python."""
        names: dict[str, Any] = {n: getattr(math, n) for n in ("sin", "cos", "tanh", "floor")}
        names |= {"np": np}
        exec(self.source, names)
        return names["rhs"]  # type: ignore[no-any-return]

    def program(self, parameters: Mapping[str, float]) -> Program:
        """Return the same for the integrator that is given the sides of all surfaces."""
        writer = _Writer(parameters)
        rates = [writer.code(as_selections(rate)) for rate in self.rates]
        return Program.of(rates, writer.surfaces, writer.levels)


def text(e: Expression) -> str:
    """Return an expression as Python writes it."""
    match e:
        case ("x", i):
            return f"x[{i}]"
        case ("t",):
            return "t"
        case ("c", value):
            return f"({value!r})"
        case ("p", i):
            return f"p.c{i}"
        case ("+" | "-" | "*" as sign, a, b):
            return f"({text(a)} {sign} {text(b)})"
        case ("sin" | "cos" | "tanh" | "abs" | "floor" as name, a):
            return f"{name}({text(a)})"
        case ("max" | "min" as name, a, b):
            return f"{name}({text(a)}, {text(b)})"
        case ("sign", a):
            return f"np.sign({text(a)})"
        case ("clip", a):
            return f"np.clip({text(a)}, -0.5, 0.75)"
        case ("mod", a):
            return f"({text(a)} % 1.0)"
        case ("if", a, yes, no):
            return f"({text(yes)} if {text(a)} > 0 else {text(no)})"
        case ("both", a, b, yes, no):
            return f"({text(yes)} if {text(a)} > 0 and not {text(b)} <= 0 else {text(no)})"
    raise ValueError(e)


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
            case ("x", i):
                return [(STATE, i)]
            case ("t",):
                return [(TIME, 0)]
            case ("c", value):
                return [(CONST, value)]
            case ("p", i):
                return [(CONST, self.parameters[f"c{i}"])]
            case ("+" | "-" | "*" as sign, a, b):
                return [*code(a), *code(b), (_BINARY[sign], 0)]
            case ("sin" | "cos" | "tanh" as name, a):
                return [*code(a), (_UNARY[name], 0)]
            case ("floor", a):
                return [(CELL, self.surface(a, levels=True))]
            case ("mod", a):
                return [*code(a), (CELL, self.surface(a, levels=True)), (SUB, 0)]
            case ("if", a, yes, no):
                return [(SIDE, self.surface(a)), *code(yes), *code(no), (SELECT, 0)]
        raise ValueError(e)


def as_selections(e: Expression) -> Expression:
    """Return an expression in which ``if`` is the only operation that selects.

    A condition that has another one inside becomes a condition on either side of that: where a solution slides along
    the inner surface, both sides count.
    """
    if not isinstance(e, tuple):
        return e
    match (e[0], *map(as_selections, e[1:])):
        case ("max", a, b):
            return as_selections(("if", ("-", a, b), a, b))
        case ("min", a, b):
            return as_selections(("if", ("-", a, b), b, a))
        case ("abs", a):
            return as_selections(("if", a, a, ("-", ("c", 0.0), a)))
        case ("sign", a):
            return as_selections(("if", a, ("c", 1.0), ("c", -1.0)))
        case ("clip", a):
            low, high = ("c", -0.5), ("c", 0.75)
            return as_selections(("if", ("-", a, high), high, ("if", ("-", a, low), a, low)))
        case ("both", a, b, yes, no):
            return as_selections(("if", a, ("if", b, yes, no), no))
        case ("if", a, yes, no) if (inner := _selection_in(a)) is not None:
            sides = (("if", _replaced(a, inner, side), yes, no) for side in inner[2:])
            return as_selections(("if", inner[1], *sides))
        case other:
            return other


def _selection_in(e: Expression) -> Expression | None:
    if not isinstance(e, tuple):
        return None
    return e if e[0] == "if" else next((i for a in e[1:] if (i := _selection_in(a)) is not None), None)


def _replaced(e: Expression, old: Expression, new: Expression) -> Expression:
    if e == old:
        return new
    return (e[0], *(_replaced(a, old, new) for a in e[1:])) if isinstance(e, tuple) else e


def drawn(rng: np.random.Generator) -> RightHandSide:
    """Draw a system of one to four dimensions, oscillators or of first order, with up to three branches."""
    maker = _Maker(rng, float(np.round(rng.uniform(0.5, 3.0), 3)))
    return RightHandSide(maker.rates(), 2.0 * math.pi / maker.omega, tuple(maker.bounds))


@dataclass
class _Maker:
    rng: np.random.Generator
    omega: float
    dimension: int = 1
    bounds: list[tuple[float, float]] = field(default_factory=list)

    def number(self, low: float, high: float) -> Expression:
        self.bounds.append((low, high))
        return ("p", len(self.bounds) - 1)

    def of_time(self) -> Expression:
        multiple = float(self.rng.integers(1, 4)) * self.omega
        return ("sin", ("+", ("*", ("c", multiple), ("t",)), self.number(-3, 3)))

    def atom(self) -> Expression:
        state = ("x", int(self.rng.integers(self.dimension)))
        match int(self.rng.integers(6)):
            case 0:
                return self.of_time()
            case 1:
                return ("tanh", ("*", self.number(0.5, 3), state))
            case 2:
                return ("*", state, ("x", int(self.rng.integers(self.dimension))))
        return state

    def smooth(self, terms: int) -> Expression:
        total: Expression = self.number(-0.6, 0.6)
        for _ in range(terms):
            total = ("+", total, ("*", self.number(-1.2, 1.2), self.atom()))
        return total

    def condition(self) -> Expression:
        """Return what is compared with zero: smooth as a rule, sometimes with a kink."""
        smooth = self.smooth(int(self.rng.integers(1, 3)))
        return ("-", ("abs", smooth), self.number(0.1, 1.0)) if self.rng.random() < 0.1 else smooth

    def branch(self, depth: int = 0) -> Expression:
        def side() -> Expression:
            if depth < 1 and self.rng.random() < 0.25:
                return self.branch(depth + 1)
            return self.smooth(int(self.rng.integers(0, 3)))

        a = self.condition()
        ramp = ("+", ("*", ("c", float(self.rng.integers(1, 4)) * self.omega / (2 * math.pi)), ("t",)), ("c", 0.137))
        stiff = self.number(5.0, 20.0) if self.rng.random() < 0.2 else self.number(0.3, 2.0)
        match int(self.rng.integers(11)):
            case 0:
                return ("max", a, side())
            case 1:
                return ("min", a, side())
            case 2:
                return ("*", stiff, ("abs", a))
            case 3:
                return ("sign", a)
            case 4:
                return ("floor", ("*", ("c", 1.7), a))
            case 5:
                return ("mod", ramp)
            case 6:
                return ("clip", ("*", stiff, a))
            case 7:
                return ("both", a, self.condition(), side(), side())
            case 8:
                return ("*", stiff, ("if", a, a, ("c", 0.0)))
            case 9:
                return ("if", ("-", ("x", 0), ("-", ("*", ("c", 2.0), ("mod", ramp)), ("c", 1.0))), side(), side())
        return ("if", a, side(), side())

    def forces(self, count: int) -> Expression:
        total: Expression = ("*", self.number(0.2, 1.5), self.of_time())
        for _ in range(count):
            total = ("+", total, ("*", self.number(-1.0, 1.0), self.branch()))
        return total

    def rates(self) -> tuple[Expression, ...]:
        kind = self.rng.choice(["oscillator", "first order", "third variable", "two"], p=[0.5, 0.15, 0.2, 0.15])
        self.dimension = {"oscillator": 2, "first order": 1, "third variable": 3, "two": 4}[str(kind)]
        count = int(self.rng.integers(1, 4))

        def held(state: int, *others: int) -> Expression:
            total = ("*", self.number(-2.0, -0.5), ("x", state))
            for other in others:
                total = ("-", total, ("*", self.number(0.05, 0.4), ("x", other)))
            return total

        if kind == "first order":
            return (("+", held(0), self.forces(count)),)
        first = (("x", 1), ("+", held(0, 1), self.forces(count)))
        if kind == "oscillator":
            return first
        if kind == "third variable":
            return (*first, ("+", held(2), self.forces(1)))
        return (*first, ("x", 3), ("+", held(2, 3), ("+", self.forces(1), ("*", ("c", 0.3), ("x", 0)))))
