"""Taylor-series steps as straight-line code.

The series of the solution is found by the classical recurrences of automatic differentiation (Moore 1966; Jorba and
Zou 2005).  Coefficients are those in the step's own time (t - t_n)/h: the factor h^k is contained in them, so that the
step is their plain sum and the last of them are the estimate of the error.  All lanes share the time, so the series of
everything that depends on time alone is computed once for all lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from .emit import assignment, dot, in_chains, input_name, library
from .evaluation import ROUNDING
from .expression import ANALYTIC, Expression, in_order
from .lanes import StepCode
from .resolution import Scale, as_error, largest, layers, limited
from .trace import CONSTANT, STATEFUL, TIMED, Trace

MODES: dict[str, Callable[[int], str]] = {"sign": lambda i: f"g{i}", "slide": lambda i: f"u{i}"}
_PAIRS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}


_RATIONAL = frozenset({"add", "sub", "mul", "div", "neg", "sqrt"})


def taylor_steps(trace: Trace, order: int) -> StepCode:
    """Write one step of the Taylor method of the given order for a traced, analytic right-hand side.

    States that rest have no series.  Of the nodes that depend on no other state, those with such a number belong to
    the lane, the others to all.
    """
    resting = trace.resting
    trace = trace.with_resting_inputs()
    series = Series(trace, order)
    levels = series.levels
    for node in in_order(trace.outputs):
        if node in series.modal and node.arguments:
            moving = levels[node] == TIMED or any(levels[a] == STATEFUL for a in node.arguments)
            if moving or node.operation not in _RATIONAL:
                levels[node] = STATEFUL
    moving_states = [j for j in range(len(trace.states)) if j not in resting]
    once = series.at_order(CONSTANT, 0, of_lanes=False)
    per_step = ["t0 = t", *(f"h{k} = h / {k}.0" for k in range(1, order + 1))]
    per_lane = [f"s{j}_0 = x{j}" for j in moving_states]
    per_lane += [f"g{j} = x{j}; y{j} = x{j}; e{j} = 0.0" for j in resting]
    per_lane += series.at_order(CONSTANT, 0, of_lanes=True)
    for k in range(order):
        per_step += series.at_order(TIMED, k)
        per_lane += [*series.at_order(STATEFUL, k), *series.next_of_states(k, moving_states)]
    for j in moving_states:
        per_lane += [f"y{j} = x{j} + {series.change(j)}", f"e{j} = {series.local_error(j)}"]
    sharp = []
    for number, (argument, scale) in enumerate(layers(trace.outputs, levels)):
        (per_step if levels[argument] == TIMED else per_lane).extend(series.excess(str(number), argument, scale))
        sharp.append(f"sharp{number}")
    per_lane += as_error(largest(sharp), f"e{moving_states[0]}") if sharp else ()
    return StepCode(tuple(once), tuple(per_step), tuple(per_lane))


class Series:
    """Names and recurrences of the coefficients of every node.

    ``extra`` expressions are expanded besides those of the trace.  With ``one_clock`` all lanes share the time.
    """

    def __init__(self, trace: Trace, order: int, extra: tuple[Expression, ...] = (), one_clock: bool = True) -> None:
        self.trace, self.order, self.extra = trace, order, extra
        self.levels = replace(trace, outputs=(*trace.outputs, *extra)).levels()
        if not one_clock:
            self.levels = {n: STATEFUL if level == TIMED else level for n, level in self.levels.items()}
        ordered = in_order((*trace.outputs, *extra))
        self.nodes = [n for n in ordered if n.arguments]
        self.numbers = {n: i for i, n in enumerate(self.nodes)}
        # At the border of their domain steps may begin where a mode does.
        self.roots = {n for n in self.nodes if n.operation in {"sqrt", "pow"} and self.levels[n] and not one_clock}
        self.modal: set[Expression] = set()
        for node in ordered:
            if node.operation in MODES or not self.modal.isdisjoint(node.arguments):
                self.modal.add(node)

    def name(self, node: Expression, k: int) -> str:
        """Name of coefficient k of a node; empty where it vanishes."""
        if node.operation == "time":
            return ("t0", "h")[k] if k < 2 else ""
        if k and self.levels.get(node, CONSTANT) == CONSTANT:
            return ""
        inputs = {"state": lambda i: f"s{i}_{k}", "parameter": lambda i: f"p{i}", **MODES}
        return input_name(node, inputs) or f"v{self.numbers[node]}_{k}"

    def at_order(
        self, level: int, k: int, of_lanes: bool | None = None, only: tuple[Expression, ...] | None = None
    ) -> list[str]:
        """Statements for coefficient k of all nodes of one level, or of those that some expressions need.

        Constants differ from lane to lane where they depend on the mode; `of_lanes` chooses these or the others.
        """
        wanted = self.numbers.keys() if only is None else set(in_order(only))
        lines: list[str] = []
        for node in self.nodes:
            if self.levels[node] == level and node in wanted and of_lanes in (None, node in self.modal):
                lines += self._statements(node, k, level)
        return lines

    def next_of_states(self, k: int, numbers: Iterable[int] | None = None) -> list[str]:
        """Statements for coefficient k + 1 of all states, or of some, from coefficient k of their derivatives."""
        chosen = range(len(self.trace.outputs)) if numbers is None else numbers
        terms = [(j, self.name(self.trace.outputs[j], k)) for j in chosen]
        return [f"s{j}_{k + 1} = h{k + 1} * {term}" if term else f"s{j}_{k + 1} = 0.0" for j, term in terms]

    def change(self, j: int) -> str:
        """Sum of the series of a state without its first term: what a step adds."""
        return f"({' + '.join(f's{j}_{k}' for k in range(self.order, 0, -1))})"

    def local_error(self, j: int) -> str:
        """Estimate of the error of a step in a state."""
        return f"abs(s{j}_{self.order}) + 0.5 * abs(s{j}_{self.order - 1})"

    def excess(self, number: str, argument: Expression, scale: Scale) -> Iterator[str]:
        """Write by what factor a step is too long for a function whose layer its argument may pass."""
        first, terms = self.name(argument, 0), [self.name(argument, k) for k in range(1, self.order)]
        moved = " + ".join(f"abs({term})" for term in terms if term) or "0.0"
        return limited(number, moved, first, first, scale)

    def _statements(self, node: Expression, k: int, level: int) -> list[str]:
        target, number = self.name(node, k), self.numbers[node]
        if node.operation in _PAIRS:
            return self._pair(node, k, level)
        if node.operation in {"tan", "tanh"}:
            return self._tangent(node, k, level)
        if node.operation == "atan":
            return self._arc_tangent(node, k, level)
        if k == 0 and node in self.roots:
            return self._root(node, level)
        if k == 0 and node.operation in {"exp", "log", "sqrt"}:
            argument = self.name(node.arguments[0], 0)
            lines = [f"{target} = {library(node.operation, level)}({argument})"]
            if node.operation == "log":
                lines.append(f"r{number} = 1.0 / {argument}")
            if node.operation == "sqrt":
                lines.append(f"r{number} = 0.5 / {target}")
            return lines
        if k == 0 and node.operation == "pow":
            base, exponent = (self.name(a, 0) for a in node.arguments)
            return [f"{target} = {base} ** {exponent}", f"r{number} = 1.0 / {base}"]
        if level == CONSTANT and node.operation not in ANALYTIC:
            return [assignment(node, lambda a: self.name(a, 0), level)]
        rule: Callable[[Expression, int], str] = getattr(self, "_" + node.operation)
        lines = [f"r{number} = 1.0 / {self.name(node.arguments[1], 0)}"] if node.operation == "div" and k == 0 else []
        return [*lines, f"{target} = {rule(node, k) or '0.0'}"]

    def _root(self, node: Expression, level: int) -> list[str]:
        """Value of a root, or power; where its argument is zero it has no series, and none of its terms count."""
        target, number = self.name(node, 0), self.numbers[node]
        argument, base = self.name(node.arguments[0], 0), f"b{number}"
        lines = [f"{base} = 0.0 if {argument} <= 0.0 and {argument} > {-ROUNDING!r} else {argument}"]
        if node.operation == "sqrt":
            lines += [f"{target} = {library('sqrt', level)}({base})", f"r{number} = 0.5 / {target}"]
        else:
            lines += [f"{target} = {base} ** {self.name(node.arguments[1], 0)}", f"r{number} = 1.0 / {base}"]
        return [*lines, f"r{number} = 0.0 if {base} == 0.0 else r{number}"]

    def begins_at_a_root(self) -> str:
        """Condition that the argument of a root, or power, leaves zero; empty where there is none."""
        moving = [n for n in self.roots if self.name(n.arguments[0], 1)]
        return " or ".join(f"b{self.numbers[n]} == 0.0 and {self.name(n.arguments[0], 1)} != 0.0" for n in moving)

    # Rules: text of coefficient k; empty where it vanishes.

    def _add(self, node: Expression, k: int) -> str:
        return " + ".join(filter(None, (self.name(a, k) for a in node.arguments)))

    def _sub(self, node: Expression, k: int) -> str:
        left, right = (self.name(a, k) for a in node.arguments)
        return f"{left} - {right}" if left and right else left or (f"-{right}" if right else "")

    def _neg(self, node: Expression, k: int) -> str:
        term = self.name(node.arguments[0], k)
        return f"-{term}" if term else ""

    def _select(self, node: Expression, k: int) -> str:
        above, below = (self.name(a, k) for a in node.arguments[1:])
        sign = self.name(node.arguments[0], 0)
        return f"{above or '0.0'} if {sign} > 0.0 else {below or '0.0'}" if above or below else ""

    def _mul(self, node: Expression, k: int) -> str:
        a, b = node.arguments
        return self._square(a, k) if a is b else self._convolution(a, b, 0, k, k)

    def _square(self, a: Expression, k: int) -> str:
        pairs = [(self.name(a, i), self.name(a, k - i)) for i in range((k + 1) // 2)]
        terms = dot((x, y) for x, y in pairs if x and y)
        text = f"2.0 * ({terms})" if terms else ""
        middle = self.name(a, k // 2) if k % 2 == 0 else ""
        return " + ".join(filter(None, (f"{middle} * {middle}" if middle else "", text)))

    def _convolution(self, a: Expression, b: Expression, first: int, last: int, k: int) -> str:
        """Sum of a_i b_(k-i) over i from first to last."""
        pairs = [(self.name(a, i), self.name(b, k - i)) for i in range(first, last + 1)]
        return dot((x, y) for x, y in pairs if x and y)

    def _weighted(self, a: Expression, b: Expression, last: int, k: int) -> str:
        """Sum of i a_i b_(k-i) over i from 1 to last: the convolution of the derivative of a with b."""
        pairs = [(i, self.name(a, i), self.name(b, k - i)) for i in range(1, last + 1)]
        return in_chains(f"{i}.0 * {x} * {y}" if i > 1 else f"{x} * {y}" for i, x, y in pairs if x and y)

    def _div(self, node: Expression, k: int) -> str:
        a, b = node.arguments
        known = self._convolution(b, node, 1, k, k)
        left = self.name(a, k)
        if not left and not known:
            return ""
        return f"({left or '0.0'}{f' - ({known})' if known else ''}) * r{self.numbers[node]}"

    def _exp(self, node: Expression, k: int) -> str:
        terms = self._weighted(node.arguments[0], node, k, k)
        return f"({terms}) * {1.0 / k!r}" if terms else ""

    def _log(self, node: Expression, k: int) -> str:
        (a,) = node.arguments
        known = self._weighted(node, a, k - 1, k)
        left = self.name(a, k)
        if not left and not known:
            return ""
        return f"({left or '0.0'}{f' - ({known}) * {1.0 / k!r}' if known else ''}) * r{self.numbers[node]}"

    def _sqrt(self, node: Expression, k: int) -> str:
        left = self.name(node.arguments[0], k) or "0.0"
        known = self._convolution(node, node, 1, k - 1, k)
        return f"({left}{f' - ({known})' if known else ''}) * r{self.numbers[node]}"

    def _pow(self, node: Expression, k: int) -> str:
        base, exponent = node.arguments
        if self.levels.get(exponent, CONSTANT) != CONSTANT:
            raise ValueError("a power with a varying exponent has no recurrence here")
        e = self.name(exponent, 0)
        pairs = [(i, self.name(base, i), self.name(node, k - i)) for i in range(1, k + 1)]
        terms = in_chains(f"({e} * {i}.0 - {k - i}.0) * {x} * {y}" for i, x, y in pairs if x and y)
        return f"({terms}) * r{self.numbers[node]} * {1.0 / k!r}" if terms else ""

    def _pair(self, node: Expression, k: int, level: int) -> list[str]:
        """Sine with cosine, hyperbolic or not: each is the other's derivative up to a sign."""
        (u,) = node.arguments
        target, partner = self.name(node, k), f"w{self.numbers[node]}"
        operation = node.operation
        if k == 0:
            value = self.name(u, 0)
            return [
                f"{target} = {library(operation, level)}({value})",
                f"{partner}_0 = {library(_PAIRS[operation], level)}({value})",
            ]
        lines, factors = [], []
        for i in range(1, k + 1):
            if term := self.name(u, i):
                weight = f"d{self.numbers[node]}_{i}"
                if i == k:
                    lines.append(f"{weight} = {i}.0 * {term}" if i > 1 else f"{weight} = {term}")
                factors.append((weight, k - i))
        own = dot((w, self.name(node, m)) for w, m in factors)
        other = dot((w, f"{partner}_{m}") for w, m in factors)
        signs = {"sin": ("", "-"), "cos": ("-", ""), "sinh": ("", ""), "cosh": ("", "")}[operation]
        scale = repr(1.0 / k)
        lines.append(f"{target} = {signs[0]}{scale} * ({other})" if other else f"{target} = 0.0")
        lines.append(f"{partner}_{k} = {signs[1]}{scale} * ({own})" if own else f"{partner}_{k} = 0.0")
        return lines

    def _tangent(self, node: Expression, k: int, level: int) -> list[str]:
        """Tangent y of u, hyperbolic or not: y' = (1 +- y^2) u'; the bracket is the partner."""
        (u,) = node.arguments
        target, partner = self.name(node, k), f"w{self.numbers[node]}"
        sign = "+" if node.operation == "tan" else "-"
        if k == 0:
            return [
                f"{target} = {library(node.operation, level)}({self.name(u, 0)})",
                f"{partner}_0 = 1.0 {sign} {target} * {target}",
            ]
        pairs = [(i, self.name(u, i)) for i in range(1, k + 1)]
        terms = in_chains(f"{i}.0 * {x} * {partner}_{k - i}" for i, x in pairs if x)
        lines = [f"{target} = {1.0 / k!r} * ({terms})" if terms else f"{target} = 0.0"]
        return [*lines, f"{partner}_{k} = {'' if sign == '+' else '-'}({self._square(node, k)})"]

    def _arc_tangent(self, node: Expression, k: int, level: int) -> list[str]:
        """Arc tangent y of u: (1 + u^2) y' = u'; the bracket is the partner."""
        (u,) = node.arguments
        target, number = self.name(node, k), self.numbers[node]
        partner = f"w{number}"
        if k == 0:
            value = self.name(u, 0)
            return [
                f"{target} = {library('atan', level)}({value})",
                f"{partner}_0 = 1.0 + {value} * {value}",
                f"r{number} = 1.0 / {partner}_0",
            ]
        pairs = [(i, self.name(node, i)) for i in range(1, k)]
        known = in_chains(f"{i}.0 * {y} * {partner}_{k - i}" for i, y in pairs if y)
        left = self.name(u, k) or "0.0"
        return [
            f"{partner}_{k} = {self._square(u, k) or '0.0'}",
            f"{target} = ({left}{f' - ({known}) * {1.0 / k!r}' if known else ''}) * r{number}",
        ]
