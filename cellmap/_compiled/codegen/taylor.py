"""Taylor-series steps as straight-line code.

The series of the solution is found by the classical recurrences of automatic differentiation (Moore 1966; Jorba and
Zou 2005).  Coefficients are those in the step's own time (t - t_n)/h: the factor h^k is contained in them, so that the
step is their plain sum and the last of them are the estimate of the error.  All lanes share the time, so the series of
everything that depends on time alone is computed once for all lanes.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from .emit import applied
from .evaluation import ROUNDING
from .expression import Expression, has_series, in_order
from .functions import TABLE
from .instructions import Instructions, Value, dot, in_chains, total, value_of, where
from .period import PerLane, PerStep, Step, Values
from .resolution import Scale, as_error, layers, limited
from .trace import CONSTANT, STATEFUL, TIMED, Trace

MODES = ("sign", "slide")
_PAIRS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}
_SIGNS = {"sin": (1.0, -1.0), "cos": (-1.0, 1.0), "sinh": (1.0, 1.0), "cosh": (1.0, 1.0)}
_RATIONAL = frozenset({"add", "sub", "mul", "div", "neg", "sqrt"})

Coefficient = Value | None
"""One of a series, None where it vanishes."""


def taylor_steps(trace: Trace, order: int) -> Step:
    """Return one step of the Taylor method of the given order for a traced, analytic right-hand side.

    States that rest have no series.  Of the nodes that depend on no other state, those with such a number belong to
    the lane, the others to all.
    """
    resting = trace.resting
    trace = trace.with_resting_inputs()
    structure = Structure(trace)
    levels = structure.levels
    for node in structure.nodes:
        if node in structure.modal:
            moving = levels[node] == TIMED or any(levels[a] == STATEFUL for a in node.arguments)
            if moving or node.operation not in _RATIONAL:
                levels[node] = STATEFUL
    moving_states = [j for j in range(len(trace.states)) if j not in resting]
    arguments = layers(trace.outputs, levels)

    def step(out: Instructions, p: Values) -> PerStep:
        series = Series(structure, order, out, p)
        series.write(CONSTANT, 0, of_lanes=False)

        def per_step(t: Value, h: Value) -> PerLane:
            series.start_step(t, h, [h / float(k) for k in range(1, order + 1)])
            for k in range(order):
                series.write(TIMED, k)
            sharp = {a: series.excess(a, scale) for a, scale in arguments if levels[a] == TIMED}

            def per_lane(x: Values) -> tuple[Values, Values]:
                series.states = [[state] for state in x]
                series.modes["sign"] = dict(enumerate(x))
                series.write(CONSTANT, 0, of_lanes=True)
                for k in range(order):
                    series.write(STATEFUL, k)
                    series.advance_states(k, moving_states)
                after, errors = list(x), [value_of(0.0)] * len(x)
                for j in moving_states:
                    after[j] = x[j] + series.change(j)
                    errors[j] = series.local_error(j)
                factors = [sharp[a] if a in sharp else series.excess(a, scale) for a, scale in arguments]
                if factors:
                    errors[moving_states[0]] = as_error(factors, errors[moving_states[0]])
                return after, errors

            return per_lane

        return per_step

    return step


class Structure:
    """Dependences of the expressions of a step, in the order in which they are expanded.

    ``extra`` expressions are expanded besides those of the trace.  With ``one_clock`` all lanes share the time.
    """

    def __init__(self, trace: Trace, extra: tuple[Expression, ...] = (), one_clock: bool = True) -> None:
        self.trace, self.extra = trace, extra
        # Of functions without a recurrence of their own, the derivative is expanded too.
        self.slopes: dict[Expression, Expression] = {}
        ordered = in_order((*trace.outputs, *extra))
        met, moving = set(ordered), set[Expression]()
        for node in ordered:  # which grows
            if node.operation not in {"state", "time"} and moving.isdisjoint(node.arguments):
                continue
            moving.add(node)
            known = TABLE.get(node.operation)
            if known is not None and known.slope is not None and not hasattr(Series, f"_{node.operation}"):
                self.slopes[node] = known.slope(node.arguments[0], node)
                ordered += [e for e in in_order([self.slopes[node]]) if e not in met]
                met.update(ordered)
        self.levels = replace(trace, outputs=tuple(ordered)).levels()
        if not one_clock:
            self.levels = {n: STATEFUL if level == TIMED else level for n, level in self.levels.items()}
        self.nodes = [n for n in ordered if n.arguments]
        # At the border of their domain steps may begin where a mode does.
        self.roots = {n for n in self.nodes if n.operation in {"sqrt", "pow"} and self.levels[n] and not one_clock}
        self.modal: set[Expression] = set()
        for node in ordered:
            if node.operation in MODES or not self.modal.isdisjoint(node.arguments):
                self.modal.add(node)

    def moves(self, node: Expression) -> bool:
        """Whether an expression depends on state or time."""
        return self.levels.get(node, CONSTANT) != CONSTANT


class Series:
    """Coefficients of every expression of a structure, as far as they are written in a function."""

    def __init__(self, structure: Structure, order: int, out: Instructions, p: Values) -> None:
        self.structure, self.order, self.out, self.p = structure, order, out, p
        self.trace, self.extra, self.levels = structure.trace, structure.extra, structure.levels
        self.states: list[list[Value]] = []
        self.modes: dict[str, Any] = {}
        self.clock: Values = ()
        self._fractions: Values = ()
        self._known: dict[Expression, list[Value]] = {}
        self._partners: dict[Expression, list[Value]] = {}
        self._weights: dict[Expression, list[Coefficient]] = {}
        self._reciprocals: dict[Expression, Value] = {}
        self._bases: dict[Expression, Value] = {}

    def start_step(self, t: Value, h: Value, fractions: Values) -> None:
        """Begin a step at a time, of a size, given with 1/k of it for k = 1, 2, ...."""
        self.clock, self._fractions = (t, h), fractions

    def at(self, node: Expression, k: int) -> Coefficient:
        """Return coefficient k of a node."""
        if node.operation == "time":
            return self.clock[k] if k < 2 else None
        if k and not self.structure.moves(node):
            return None
        if node.operation == "state":
            return self.states[node.value][k]
        if node.operation == "constant":
            return self.out.number(node.value)
        if node.operation == "parameter":
            return self.p[node.value]
        if node.operation in MODES:
            mode: Value = self.modes[node.operation][node.value]
            return mode
        return self._known[node][k]

    def first(self, node: Expression) -> Value:
        """Return the value of a node at the beginning of the step."""
        value = self.at(node, 0)
        assert value is not None, "it is a number"
        return value

    def write(
        self, level: int, k: int, of_lanes: bool | None = None, only: tuple[Expression, ...] | None = None
    ) -> None:
        """Write coefficient k of all nodes of one level, or of those that some expressions need.

        Constants differ from lane to lane where they depend on the mode; `of_lanes` chooses these or the others.
        """
        structure = self.structure
        wanted = None if only is None else set(in_order(only))
        for node in structure.nodes:
            chosen = (wanted is None or node in wanted) and of_lanes in (None, node in structure.modal)
            if chosen and self.levels[node] == level:
                self._write(node, k, level)

    def advance_states(self, k: int, numbers: Iterable[int] | None = None) -> None:
        """Write coefficient k + 1 of all states, or of some, from coefficient k of their derivatives."""
        outputs = self.trace.outputs
        for j in range(len(outputs)) if numbers is None else numbers:
            term = self.at(outputs[j], k)
            self.states[j].append(self.out.number(0.0) if term is None else self._fractions[k] * term)

    def change(self, j: int) -> Value:
        """Return the sum of the series of a state without its first term: what a step adds."""
        return total(self.states[j][:0:-1])

    def local_error(self, j: int) -> Value:
        """Return the estimate of the error of a step in a state."""
        return abs(self.states[j][self.order]) + 0.5 * abs(self.states[j][self.order - 1])

    def excess(self, argument: Expression, scale: Scale) -> Value:
        """Write by what factor a step is too long for a function whose layer its argument may pass."""

        def moved() -> Value:
            terms = [term for k in range(1, self.order) if (term := self.at(argument, k)) is not None]
            return total(abs(term) for term in terms) if terms else self.out.number(0.0)

        return limited([self.first(argument)], moved, scale)

    def leaves_a_root(self) -> Value | None:
        """Return the condition that the argument of a root, or power, leaves zero; None where there is none."""
        roots = [node for node in self.structure.nodes if node in self.structure.roots]
        moving = [(node, term) for node in roots if (term := self.at(node.arguments[0], 1)) is not None]
        leave = [self._bases[node].equals(0.0) & term.differs(0.0) for node, term in moving]
        return functools.reduce(operator.or_, leave) if leave else None

    def _write(self, node: Expression, k: int, level: int) -> None:
        """Write coefficient k of a node."""
        known = self._known.setdefault(node, [])
        del known[k:]
        operation = node.operation
        if k == 0 and operation not in {"add", "sub", "mul", "neg", "select"}:
            known.append(self._value(node, level))
            return
        rule: Callable[[Expression, int], Coefficient] = getattr(self, f"_{operation}", self._by_slope)
        found = rule(node, k)
        known.append(self.out.number(0.0) if found is None else found)
        partner = self._partners.get(node)
        if partner is not None and operation in {"tan", "tanh"}:
            square = self._square(node, k)
            assert square is not None, "its terms do not vanish"
            partner.append(square if operation == "tan" else -square)

    def _value(self, node: Expression, level: int) -> Value:
        """Write the value of a function, and what its recurrence needs."""
        operation, u = node.operation, self.first(node.arguments[0])
        arguments = [self.first(a) for a in node.arguments]
        if operation == "div":
            self._reciprocals[node] = 1.0 / arguments[1]
            return u * self._reciprocals[node]
        if level == CONSTANT and not has_series(operation):
            return applied(self.out, operation, arguments, level)
        is_root = node in self.structure.roots
        if is_root:
            # Where its argument is zero it has no series, and none of its terms count.
            u = where((u <= 0.0) & (u > -ROUNDING), 0.0, u)
            self._bases[node] = arguments[0] = u
        value = applied(self.out, operation, arguments, level)
        if operation in _PAIRS:
            self._partners[node] = [applied(self.out, _PAIRS[operation], arguments, level)]
        elif operation in {"tan", "tanh"}:
            square = value * value
            self._partners[node] = [1.0 + square if operation == "tan" else 1.0 - square]
        elif operation == "atan":
            self._partners[node] = [1.0 + u * u]
            self._reciprocals[node] = 1.0 / self._partners[node][0]
        elif operation in {"log", "pow"}:
            self._reciprocals[node] = 1.0 / u
        elif operation == "sqrt":
            self._reciprocals[node] = 0.5 / value
        if is_root:
            self._reciprocals[node] = where(u.equals(0.0), 0.0, self._reciprocals[node])
        return value

    # Rules for coefficient k: None where it vanishes.

    def _add(self, node: Expression, k: int) -> Coefficient:
        terms = [term for term in (self.at(a, k) for a in node.arguments) if term is not None]
        return total(terms) if terms else None

    def _sub(self, node: Expression, k: int) -> Coefficient:
        left, right = (self.at(a, k) for a in node.arguments)
        if right is None:
            return left
        return -right if left is None else left - right

    def _neg(self, node: Expression, k: int) -> Coefficient:
        term = self.at(node.arguments[0], k)
        return None if term is None else -term

    def _defined(self, node: Expression, k: int) -> Coefficient:
        return None

    def _select(self, node: Expression, k: int) -> Coefficient:
        above, below = (self.at(a, k) for a in node.arguments[1:])
        if above is None and below is None:
            return None
        sides = (value_of(0.0) if side is None else side for side in (above, below))
        return where(self.first(node.arguments[0]) > 0.0, *sides)

    def _mul(self, node: Expression, k: int) -> Coefficient:
        a, b = node.arguments
        return self._square(a, k) if a is b else self._convolution(a, b, 0, k, k)

    def _square(self, a: Expression, k: int) -> Coefficient:
        middle = self.at(a, k // 2) if k % 2 == 0 else None
        own = None if middle is None else middle * middle
        others = self._convolution(a, a, 0, (k + 1) // 2 - 1, k)
        if others is None:
            return own
        twice = 2.0 * others
        return twice if own is None else own + twice

    def _pairs(self, a: Expression, b: Expression, first: int, last: int, k: int) -> list[tuple[int, Value, Value]]:
        """Return i, a_i and b_(k-i) for i from first to last, without those that vanish."""
        triples = ((i, self.at(a, i), self.at(b, k - i)) for i in range(first, last + 1))
        return [(i, x, y) for i, x, y in triples if x is not None and y is not None]

    def _convolution(self, a: Expression, b: Expression, first: int, last: int, k: int) -> Coefficient:
        """Sum of a_i b_(k-i) over i from first to last."""
        return dot([(x, y) for _, x, y in self._pairs(a, b, first, last, k)])

    def _slope(self, node: Expression, k: int) -> Coefficient:
        """Return k times coefficient k of a node, of a state straight from its derivative."""
        if node.operation == "state":
            slope = self.at(self.trace.outputs[node.value], k - 1)
            return None if slope is None else self.clock[1] * slope
        term = self.at(node, k)
        return term if term is None or k == 1 else float(k) * term

    def _weighted(self, a: Expression, b: Expression, last: int, k: int) -> Coefficient:
        """Sum of i a_i b_(k-i) over i from 1 to last: the convolution of the derivative of a with b."""
        pairs = self._pairs(a, b, 1, last, k)
        return in_chains(pairs, lambda term: (term[0] * term[1] if term[0] > 1 else term[1]) * term[2])

    def _quotient(self, node: Expression, left: Coefficient, known: Coefficient) -> Coefficient:
        """Return what is left without what is known, times the reciprocal of a node."""
        if left is None and known is None:
            return None
        rest = self.out.number(0.0) if left is None else left
        return (rest if known is None else rest - known) * self._reciprocals[node]

    def _div(self, node: Expression, k: int) -> Coefficient:
        a, b = node.arguments
        return self._quotient(node, self.at(a, k), self._convolution(b, node, 1, k, k))

    def _by_slope(self, node: Expression, k: int) -> Coefficient:
        """The function f of u, from f' = f_u u': the derivative f_u has a series too."""
        terms = self._weighted(node.arguments[0], self.structure.slopes[node], k, k)
        return None if terms is None else terms * self.out.reciprocal(k)

    def _log(self, node: Expression, k: int) -> Coefficient:
        (a,) = node.arguments
        known = self._weighted(node, a, k - 1, k)
        return self._quotient(node, self.at(a, k), None if known is None else known * self.out.reciprocal(k))

    def _sqrt(self, node: Expression, k: int) -> Coefficient:
        known = self._convolution(node, node, 1, k - 1, k)
        left = self.at(node.arguments[0], k)
        return self._quotient(node, self.out.number(0.0) if left is None else left, known)

    def _pow(self, node: Expression, k: int) -> Coefficient:
        base, exponent = node.arguments
        if self.structure.moves(exponent):
            raise ValueError("a power with a varying exponent has no recurrence here")
        e = self.first(exponent)
        pairs = self._pairs(base, node, 1, k, k)
        terms = in_chains(pairs, lambda term: (e * float(term[0]) - float(k - term[0])) * term[1] * term[2])
        return None if terms is None else terms * self._reciprocals[node] * self.out.reciprocal(k)

    def _sin(self, node: Expression, k: int) -> Coefficient:
        """Sine with cosine, hyperbolic or not: each is the other's derivative up to a sign."""
        (u,), partner = node.arguments, self._partners[node]
        weights = self._weights.setdefault(node, [])
        del weights[k - 1 :]
        weights.append(self._slope(u, k))
        factors = [(w, k - i) for i, w in enumerate(weights, 1) if w is not None]
        del partner[k:]
        of_own, of_partner = (sign * self.out.reciprocal(k) for sign in _SIGNS[node.operation])
        other = dot([(w, partner[m]) for w, m in factors])
        found = None if other is None else of_own * other
        own = dot([(w, self._known[node][m]) for w, m in factors])
        partner.append(self.out.number(0.0) if own is None else of_partner * own)
        return found

    _cos = _sinh = _cosh = _sin

    def _tan(self, node: Expression, k: int) -> Coefficient:
        """Tangent y of u, hyperbolic or not: y' = (1 +- y^2) u'; the bracket is the partner."""
        partner = self._partners[node]
        del partner[k:]
        pairs = ((i, self.at(node.arguments[0], i)) for i in range(1, k + 1))
        found = [(i, x) for i, x in pairs if x is not None]
        terms = in_chains(found, lambda term: float(term[0]) * term[1] * partner[k - term[0]])
        return None if terms is None else self.out.reciprocal(k) * terms

    _tanh = _tan

    def _atan(self, node: Expression, k: int) -> Coefficient:
        """Arc tangent y of u: (1 + u^2) y' = u'; the bracket is the partner."""
        (u,), partner = node.arguments, self._partners[node]
        del partner[k:]
        square = self._square(u, k)
        partner.append(self.out.number(0.0) if square is None else square)
        found = [(i, self._known[node][i]) for i in range(1, k)]
        known = in_chains(found, lambda term: float(term[0]) * term[1] * partner[k - term[0]])
        left = self.at(u, k)
        return self._quotient(
            node,
            self.out.number(0.0) if left is None else left,
            None if known is None else known * self.out.reciprocal(k),
        )
