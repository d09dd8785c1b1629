"""Branches of a plain function, located: both sides of each comparison are traced.

A comparison a > b asks for the sign of the switching function h = a - b.  The function is run once for each sequence
of answers, and the results become one expression: ``select(s, A, B)`` is A where the sign s of h is positive, else B.
What both sides have in common stays outside of it.  The absolute value, the larger of two numbers, the sign and their
like need no second run.  Whole parts (of floor, and of remainders) are counted by a switch of their own.

For a motion the signs are inputs "sign", the modes of :mod:`cellmap._compiled.codegen.filippov`; what depends on
parameters alone is decided where it stands.  For one application of a discrete map all of it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .evaluation import evaluated
from .expression import Comparison, Expression, Graph, ImpureError, UndefinedError, UntraceableError, in_order
from .pieces import BY_SERIES, LOCATED, PIECES, is_made_of_steps, is_number, moves

MOST_PATHS = 256
MOST_SWITCHES = 24
_NEUTRAL = {"add": 0.0, "sub": 0.0, "mul": 1.0, "div": 1.0}
_SAMPLES = 16  # places at which expressions are compared
_INPUTS = frozenset({"state", "time", "parameter", "constant", "sign", "slide"})


@dataclass(frozen=True, eq=False)
class Switch:
    """A switching function and the expression of its sign; or, if it `counts`, of the whole number below it."""

    sign: Expression
    function: Expression
    counts: bool = False

    @property
    def is_mode(self) -> bool:
        """Whether its sign is an input."""
        return self.sign.operation == "sign"


Met = tuple[int, bool | None]
"""A switch that a run has met, and the answer that it got; None where both sides were taken at once."""


class BranchingGraph(Graph):
    """A graph in which comparisons have answers: those that are given first, then yes.

    With `modes`, signs that depend on state or time are inputs; then h and -h share a switch.  Without, signs stand for
    themselves, equality falls on the side that the comparison says, and no comparison with NaN holds.
    """

    def __init__(self, modes: bool) -> None:
        super().__init__()
        self.modes = modes
        self.followed: set[Expression] = set()
        self.restart()

    def restart(self) -> None:
        """Forget all switches; from now on both sides are run of those whose functions are among the followed."""
        self.switches: list[Switch] = []
        self.conditions: list[Expression] = []  # functions of the switches on the paths that meet them
        self._met: list[Met] = []
        self._answers: Sequence[bool] = ()

    def answer(self, function: Expression, strictly: bool = True) -> bool:
        """Decide in this run whether an expression is positive or, if not `strictly`, zero."""
        if function.operation == "constant":
            return bool(function.value > 0.0 or (function.value == 0.0 and not strictly))
        return self._side(*self._condition(function, strictly))

    def _condition(self, function: Expression, strictly: bool) -> tuple[int, int]:
        """Return the number of the switch of a condition, and the factor +-1 between both."""
        if strictly or not self._is_input(function):
            return self._switch(function, "side" if strictly else "reached")
        number, factor = self._switch(self._reversed(function), "side")
        return number, -factor

    def _is_input(self, function: Expression) -> bool:
        """Whether the sign of a function is an input: that of what changes in steps is known from their sides."""
        return self.modes and moves(function) and not is_made_of_steps(function)

    def _reversed(self, function: Expression) -> Expression:
        """Return an expression with the other sign: of a difference that of its operands in the other order."""
        return self.minus(*reversed(function.arguments)) if function.operation == "sub" else self.apply("neg", function)

    def _side(self, number: int, factor: int) -> bool:
        before = [yes for n, yes in self._met if n == number and yes is not None]
        if before:
            return before[0] is (factor > 0)
        asked = sum(yes is not None for _, yes in self._met)
        yes = self._answers[asked] if asked < len(self._answers) else True
        self._met.append((number, yes))
        return yes is (factor > 0)

    def choose(self, function: Expression, a: Any, b: Any, *, strictly: bool = True) -> Expression:
        """Return a where an expression is positive or, if not `strictly`, zero; else b, where it is NaN too."""
        sides = (self.lift(a), self.lift(b))
        if function.operation == "constant":
            return sides[0] if self.answer(function, strictly) else sides[1]
        number, factor = self._condition(function, strictly)
        if self.conditions[number] in self.followed:
            chosen = sides[0] if self._side(number, factor) else sides[1]
        else:
            chosen = self.selection(self.switches[number].sign, *(sides if factor > 0 else sides[::-1]))
        return self.where_defined(function, chosen, sides[1]) if self.switches[number].is_mode else chosen

    def where_defined(self, function: Expression, a: Expression, b: Expression) -> Expression:
        """Return a where an expression is a number, b where it is NaN."""
        if is_number(function, self.modes) or a is b:
            return a
        return self.plain("select", self.plain("defined", function), a, b)

    def whole_part(self, a: Expression) -> Expression:
        """Return the largest whole number that is not above an expression."""
        return self.switches[self._switch(a, "floor")[0]].sign

    def compare(self, a: Any, b: Any, *, strictly: bool) -> Comparison:
        """Return the comparison a > b, or a >= b."""
        return Comparison(self, self.ordered(self.difference(a, b)), strictly)

    def equal(self, a: Any, b: Any, *, inverted: bool = False) -> Comparison:
        """Return whether two expressions are equal, of which a motion that meets events knows nothing."""
        if self._is_input(self.difference(a, b)):
            raise UntraceableError(
                "it compares by == or != what moves, which is so at single moments that are no events: compare by >= "
                "or <=, or declare impacts or ends there"
            )
        return super().equal(a, b, inverted=inverted)

    def ordered(self, difference: Expression) -> Expression:
        """Return a difference that is compared: Python has complex powers of negative numbers, without an order."""
        powers = [e for e in in_order([difference]) if e.operation == "pow"] if not self.modes else []
        if powers and not self.answer(self.plain("defined", difference)):
            raise UndefinedError("TypeError: complex numbers have no order")
        return difference

    def difference(self, a: Any, b: Any) -> Expression:
        """Subtract expressions or numbers."""
        left, right = self.lift(a), self.lift(b)
        return left if right.vanishes else self.minus(left, right)

    def apply(self, operation: str, *operands: Any) -> Expression:
        """Apply an operation; those with kinks and jumps become selections, and with modes all become series."""
        rule = PIECES.get(operation) or ((BY_SERIES | LOCATED).get(operation) if self.modes else None)
        arguments = tuple(self.lift(a) for a in operands)
        if rule is None or all(a.operation == "constant" for a in arguments):
            return super().apply(operation, *arguments)
        if operation in BY_SERIES and arguments[0].operation == "select":
            # A side that does not move may be where the series of the other has a pole.
            sign, *sides = arguments[0].arguments
            if operation == "pow" and any(side.vanishes for side in sides):
                return super().apply(operation, *arguments)
            return self.selection(sign, *(self.apply(operation, side, *arguments[1:]) for side in sides))
        return rule(self, *arguments)

    def plain(self, operation: str, *operands: Any) -> Expression:
        """Apply an operation as it is."""
        return super().apply(operation, *operands)

    def selection(self, sign: Expression, a: Expression, b: Expression) -> Expression:
        """Return ``select(sign, a, b)``, with what both have in common outside of it."""
        if a is b:
            return a
        if a.operation == b.operation and a.operation not in _INPUTS and len(a.arguments) == len(b.arguments):
            pairs = list(zip(a.arguments, b.arguments, strict=True))
            if len(pairs) == 1 or (len(pairs) == 2 and any(u is v for u, v in pairs)):
                return self.plain(a.operation, *(self.selection(sign, u, v) for u, v in pairs))
        # Where one side adds a term, or a factor, to the other: only that is selected.
        for longer, shorter in ((a, b), (b, a)):
            if longer.operation in _NEUTRAL and any(
                shorter is e for e in longer.arguments[: 2 if longer.operation in {"add", "mul"} else 1]
            ):
                first, second = longer.arguments
                term = second if first is shorter else first
                sides = (term, self.constant(_NEUTRAL[longer.operation]))
                chosen = self.selection(sign, *(sides if longer is a else sides[::-1]))
                return self.plain(longer.operation, *((shorter, chosen) if first is shorter else (chosen, shorter)))
        return self.plain("select", sign, a, b)

    def add_switch(self, function: Expression) -> Expression:
        """Add a switching function that is given; return the input of its sign."""
        return self.switches[self._new(function, "side")].sign

    def trace_paths(self, run: Callable[[], Sequence[Any]]) -> tuple[Expression, ...]:
        """Run a function for all sequences of answers and return its results as one.

        The function of a switch that only some paths meet is selected where they do; elsewhere it leaves the sign
        alone.
        """
        known = len(self.switches)
        found: list[tuple[tuple[Expression, ...] | None, list[Met]]] = []
        undefined = UndefinedError("it has no values")
        waiting: list[list[bool]] = [[]]
        while waiting:
            if len(found) + len(waiting) > MOST_PATHS:
                raise UntraceableError(
                    f"its branches have more than {MOST_PATHS} combinations: where conditions do not depend on one "
                    "another, multiply values by them, as in (x[0] > 0) * a, or name the surfaces as switches"
                )
            self._answers, self._met = waiting.pop(), []
            outputs: tuple[Expression, ...] | None = None
            try:
                outputs = tuple(self.lift(e) for e in run())
                if asked := len(self._met):
                    if any(a is not b for a, b in zip(outputs, map(self.lift, run()), strict=False)):
                        raise ImpureError("a function", "computes another value in a branch when it is called again")
                    del self._met[asked:]
            except UndefinedError as error:
                if self.modes:
                    raise  # an orbit cannot go over to a mode without motion: it is met by a step that fails
                undefined = error
            found.append((outputs, self._met))
            given = [yes for _, yes in self._met if yes is not None]
            waiting += [[*given[:i], False] for i in range(len(self._answers), len(given))]
        count = max((len(outputs) for outputs, _ in found if outputs is not None), default=0)
        if count == 0:
            raise undefined
        nowhere = (self.constant(math.nan),) * count
        runs = [(nowhere if outputs is None else outputs, met) for outputs, met in found]
        joined = self._joined(runs, 0)
        for i in range(known, len(self.switches)):
            own = self.switches[i]
            rest = _at_rest(self, own)
            where = [((own.function if any(n == i for n, _ in met) else rest,), met) for _, met in runs]
            joined_function = self._joined(where, 0, rest)[0]
            if own.is_mode:  # where its function is NaN there is no event
                joined_function = self.where_defined(self.conditions[i], joined_function, rest)
            self.switches[i] = replace(own, function=joined_function)
        return joined

    def _joined(
        self, runs: Sequence[tuple[tuple[Expression, ...], list[Met]]], place: int, rest: Expression | None = None
    ) -> tuple[Expression, ...]:
        """Join the results of runs that have met the same switches up to a place.

        Where a switch slides, both of its sides matter: then a result is not the one at `rest`.
        """
        results, met = runs[0]
        while len(runs) > 1 and met[place][1] is None:
            place += 1
        if len(runs) == 1:
            return results
        sides = [[run for run in runs if run[1][place][1] is yes] for yes in (True, False)]
        pairs = zip(*(self._joined(side, place + 1, rest) for side in sides), strict=True)
        sign = self.switches[met[place][0]].sign
        below = self.plain("neg", sign)
        return tuple(
            self.plain("select", below, b, a) if b is rest and a is not b else self.selection(sign, a, b)
            for a, b in pairs
        )

    def _switch(self, function: Expression, operation: str) -> tuple[int, int]:
        """Return the number of the switch of an expression, and the factor +-1 between both; make it if need be."""
        counts, turns = operation == "floor", operation == "side" and self._is_input(function)
        forms = [(function, 1)]
        if turns:
            forms.append((self.plain("neg", function), -1))
            if function.operation == "sub":
                forms.append((self.plain("sub", *reversed(function.arguments)), -1))
        for form, factor in forms:
            for number, switch in enumerate(self.switches):
                alike = switch.counts == counts and (switch.is_mode or switch.sign.operation == operation)
                if alike and (switch.function is form or (switch.sign is form and not counts)):
                    self._met.append((number, None))
                    return number, factor
        if turns:
            for number, condition in enumerate(self.conditions):
                ratio = 0.0 if self.switches[number].counts else _ratio(function, condition)
                if ratio != 0.0:
                    self._met.append((number, None))
                    return number, 1 if ratio > 0.0 else -1
        return self._new(function, operation), 1

    def _new(self, function: Expression, operation: str) -> int:
        number = len(self.switches)
        if number >= MOST_SWITCHES:
            raise UntraceableError(
                f"it makes more than {MOST_SWITCHES} comparisons, of which one that depends on the outcome of others "
                "counts for each of their outcomes: compare states and time alone, or name the surfaces as switches"
            )
        if self._is_input(function):
            sign = self.node("sign", value=sum(s.is_mode for s in self.switches))
        else:
            sign = self.plain(operation, function)
        self.switches.append(Switch(sign, function, operation == "floor"))
        self.conditions.append(function)
        self._met.append((number, None))
        return number


def _ratio(a: Expression, b: Expression) -> float:
    """Return the factor between expressions that are multiples of each other, 0 for others."""
    inputs, others = ({e for e in in_order([f]) if e.operation in _INPUTS - {"constant"}} for f in (a, b))
    if inputs != others:
        return 0.0
    rng = np.random.default_rng(0)
    ordered = [e for e in in_order([a]) if e in inputs]
    first, second = evaluated([a, b], {e: rng.normal(size=_SAMPLES) for e in ordered})
    with np.errstate(all="ignore"):
        ratios = np.asarray(first / second)
    alike = np.isfinite(ratios).all() and np.ptp(ratios) <= 1e-12 * np.abs(ratios).min()
    return float(np.median(ratios)) if alike else 0.0


def initial_functions(graph: BranchingGraph, modes: Sequence[Switch]) -> list[Expression]:
    """Return the functions of switches without the signs of one another: at a beginning, nothing is a mode yet."""
    functions: dict[Expression, Expression] = {}
    signs: dict[Expression, Expression] = {}

    def find(switch: Switch, above: frozenset[Expression] = frozenset()) -> None:
        if switch.sign in functions:
            return
        if switch.sign in above:
            raise UntraceableError("it compares values that comparisons of these have chosen: choose by min and max")
        needed = {e for e in in_order([switch.function]) if e.operation == "sign" and e is not switch.sign}
        for other in modes:
            if other.sign in needed:
                find(other, above | {switch.sign})
        known = {**signs, switch.sign: graph.constant(1.0)}
        (functions[switch.sign],) = graph.substituted([switch.function], known, graph.plain)
        signs[switch.sign] = graph.plain("floor" if switch.counts else "side", functions[switch.sign])

    for switch in modes:
        find(switch)
    return [functions[switch.sign] for switch in modes]


def _at_rest(graph: BranchingGraph, switch: Switch) -> Expression:
    """Return a function that leaves the sign of a switch as it is."""
    return graph.plain("add", switch.sign, 0.5) if switch.counts else switch.sign
