"""Images of boxes by interval arithmetic of forty digits: slow, and another program than the one that proofs rest on.

Formulas are evaluated with mpmath's intervals, derivatives are carried by the chain rule, and flows are followed by
their Taylor series in time (Moore 1966; Lohner 1987), with a remainder over a box that Picard's iteration encloses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import comb
from typing import Any

from .._compiled.codegen.expression import ARITHMETIC, Expression, ordered
from .._compiled.codegen.kernel import traced_function
from .._compiled.codegen.trace import Trace
from .._lib.stopping import check_stop
from .discrete import Discrete
from .enclosed_periods import period_as_map
from .point_map import PointMap
from .stroboscopic import Stroboscopic

Interval = Any
"""An interval of mpmath."""

_DIGITS = 40
_ORDER = 12  # order of Taylor series in time
_STEPS = (24, 96, 384)  # numbers of steps in a period that are tried until the boxes of all steps are enclosed
_WIDENINGS = 6  # widenings of a box in Picard's iteration


class NotEnclosedError(ArithmeticError):
    """No enclosure was found: an operation is not defined on a box, or the flow leaves every box."""


def intervals() -> Any:
    """Return mpmath's interval arithmetic with forty digits."""
    try:
        from mpmath.ctx_iv import MPIntervalContext
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "to check a proof by other interval arithmetic, install mpmath: pip install 'cellmap-dynamics[proofs]'"
        ) from error
    context = MPIntervalContext()
    context.dps = _DIGITS
    return context


class _Jet:
    """An interval with the intervals of its derivatives by the initial condition."""

    __slots__ = ("slopes", "value")

    def __init__(self, value: Interval, slopes: Sequence[Interval]) -> None:
        self.value, self.slopes = value, slopes

    def __add__(self, other: _Jet) -> _Jet:
        return _Jet(self.value + other.value, [a + b for a, b in zip(self.slopes, other.slopes, strict=True)])

    def __sub__(self, other: _Jet) -> _Jet:
        return _Jet(self.value - other.value, [a - b for a, b in zip(self.slopes, other.slopes, strict=True)])

    def __neg__(self) -> _Jet:
        return _Jet(-self.value, [-a for a in self.slopes])

    def __mul__(self, other: _Jet) -> _Jet:
        a, b = self.value, other.value
        return _Jet(a * b, [p * b + a * q for p, q in zip(self.slopes, other.slopes, strict=True)])

    def __truediv__(self, other: _Jet) -> _Jet:
        if 0 in other.value:
            raise NotEnclosedError("division by an interval that holds 0")
        quotient = self.value / other.value
        slopes = [(p - quotient * q) / other.value for p, q in zip(self.slopes, other.slopes, strict=True)]
        return _Jet(quotient, slopes)

    def times(self, number: Any) -> _Jet:
        """Multiply with a number or an interval."""
        return _Jet(self.value * number, [a * number for a in self.slopes])

    def mapped(self, value: Interval, slope: Interval) -> _Jet:
        """Return a function of this with its value and its derivative."""
        return _Jet(value, [slope * a for a in self.slopes])


class _Formulas:
    """Values and Taylor coefficients of formulas."""

    def __init__(self, context: Any, traced: Trace, parameters: Sequence[Interval]) -> None:
        self.context, self.traced, self.parameters = context, traced, parameters
        self.nodes = ordered(traced.outputs)

    def series(self, time: Interval, states: Sequence[_Jet], order: int) -> list[list[_Jet]]:
        """Return the Taylor coefficients 0 to `order` of the solution through states at a time."""
        zero = _Jet(self.context.mpf(0), [self.context.mpf(0)] * len(states[0].slopes))
        solution = [[s] for s in states]
        known: dict[Expression, list[_Jet]] = {node: [] for node in self.nodes}
        further: dict[Expression, list[_Jet]] = {node: [] for node in self.nodes}
        for j in range(order):
            self._next(j, time, solution, known, further, zero)
            for k, output in enumerate(self.traced.outputs):
                solution[k].append(known[output][j].times(self.context.mpf(1) / (j + 1)))
        return solution

    def values(self, time: Interval, states: Sequence[_Jet]) -> list[_Jet]:
        """Return the formulas' values."""
        zero = _Jet(self.context.mpf(0), [self.context.mpf(0)] * len(states[0].slopes))
        known: dict[Expression, list[_Jet]] = {node: [] for node in self.nodes}
        further: dict[Expression, list[_Jet]] = {node: [] for node in self.nodes}
        self._next(0, time, [[s] for s in states], known, further, zero)
        return [known[output][0] for output in self.traced.outputs]

    def _next(self, j: int, time: Interval, solution: Any, known: Any, further: Any, zero: _Jet) -> None:
        """Compute coefficient j of every node from the coefficients up to j of what it depends on."""
        for node in self.nodes:
            known[node].append(self._coefficient(node, j, time, solution, known, further[node], zero))

    def _coefficient(
        self, node: Expression, j: int, time: Interval, solution: Any, known: Any, further: list[_Jet], zero: _Jet
    ) -> _Jet:
        context, name = self.context, node.operation
        if not node.arguments:
            if name == "state":
                return solution[node.value][j]
            if name == "time":
                return _Jet(time if j == 0 else context.mpf(int(j == 1)), zero.slopes)
            value = node.value if name == "constant" else self.parameters[node.value]
            return _Jet(context.mpf(value) if j == 0 else zero.value, zero.slopes)
        arguments = [known[a] for a in node.arguments]
        a, own = arguments[0], known[node]
        if name in ("add", "sub", "neg"):
            return ARITHMETIC[name](*(c[j] for c in arguments))
        if name == "mul":
            return _product(a, arguments[1], j)
        if name == "div":
            b = arguments[1]
            total = a[j]
            for i in range(j):
                total = total - own[i] * b[j - i]
            return total / b[0]
        if name == "sqrt" or name == "pow":
            return self._power(node, a, own, j)
        if name == "exp":
            return a[0].mapped(*2 * (context.exp(a[0].value),)) if j == 0 else _convolved(a, own, j)
        if name == "log":
            if not a[0].value > 0:
                raise NotEnclosedError("log of an interval that holds 0 or less")
            if j == 0:
                return a[0].mapped(context.log(a[0].value), 1 / a[0].value)
            return (a[j] - _convolved_parts(own, a, j)) / a[0]
        if name in ("sin", "cos"):
            sine, cosine = context.sin(a[0].value), context.cos(a[0].value)
            if j == 0:
                pair = a[0].mapped(sine, cosine), a[0].mapped(cosine, -sine)
                further.append(pair[name == "sin"])
                return pair[name == "cos"]
            sign = 1 if name == "sin" else -1
            found, other = _convolved(a, further, j).times(sign), _convolved(a, own, j).times(-sign)
            further.append(other)
            return found
        if name in ("tanh", "tan", "atan"):
            return self._by_slope(name, a, own, further, j)
        raise NotEnclosedError(f"{name} is not among the functions that the witness knows")

    def _power(self, node: Expression, a: list[_Jet], own: list[_Jet], j: int) -> _Jet:
        context = self.context
        exponent = context.mpf(0.5)
        if node.operation == "pow":
            constant = node.arguments[1]
            if constant.operation not in ("constant", "parameter"):
                raise NotEnclosedError("a power whose exponent moves")
            given = constant.value if constant.operation == "constant" else self.parameters[constant.value]
            exponent = context.mpf(given)
        if not a[0].value > 0:
            raise NotEnclosedError("a power of an interval that holds 0 or less")
        if j == 0:
            value = context.sqrt(a[0].value) if node.operation == "sqrt" else a[0].value ** exponent
            return a[0].mapped(value, exponent * value / a[0].value)
        total = own[0].times(0)
        for i in range(1, j + 1):
            total = total + (a[i] * own[j - i]).times(exponent * i - (j - i))
        return total.times(context.mpf(1) / j) / a[0]

    def _by_slope(self, name: str, a: list[_Jet], own: list[_Jet], further: list[_Jet], j: int) -> _Jet:
        """Return a coefficient of a function from those of its derivative, which are kept in `further`."""
        context, x = self.context, a[0]
        one = _Jet(context.mpf(1), [context.mpf(0)] * len(x.slopes))
        if j == 0:
            if name == "tanh":
                value = 1 - 2 / (context.exp(2 * x.value) + 1)
                found = x.mapped(value, 1 - value**2)
            elif name == "tan":
                cosine = context.cos(x.value)
                if 0 in cosine:
                    raise NotEnclosedError("tan of an interval that holds a pole")
                value = context.sin(x.value) / cosine
                found = x.mapped(value, 1 + value**2)
            else:
                found = x.mapped(_arc_tangent(context, x.value), 1 / (1 + x.value**2))
        else:
            found = _convolved(a, further, j)
        squares = [*own, found] if name in ("tanh", "tan") else a
        square = _product(squares, squares, j)
        if name == "atan":
            total = one if j == 0 else one.times(0)
            for i in range(j):
                total = total - further[i] * _with_one(_product(a, a, j - i), one, j - i)
            further.append(total / _with_one(_product(a, a, 0), one, 0))
        else:
            signed = square if name == "tan" else -square
            further.append(one + signed if j == 0 else signed)
        return found


def _with_one(square: _Jet, one: _Jet, j: int) -> _Jet:
    return one + square if j == 0 else square


def _arc_tangent(context: Any, x: Interval) -> Interval:
    from mpmath import mp

    with mp.workdps(_DIGITS + 10):
        ends = mp.atan(mp.mpf(x.a)), mp.atan(mp.mpf(x.b))
        slack = mp.mpf(10) ** -_DIGITS
        return context.mpf([ends[0] - slack, ends[1] + slack])


def _product(a: list[_Jet], b: list[_Jet], j: int) -> _Jet:
    total = a[0] * b[j]
    for i in range(1, j + 1):
        total = total + a[i] * b[j - i]
    return total


def _convolved(a: list[_Jet], slope: list[_Jet], j: int) -> _Jet:
    """Return coefficient j of a function whose derivative by time is that of `a` times a slope."""
    total = (a[1] * slope[j - 1]).times(1)
    for i in range(2, j + 1):
        total = total + (a[i] * slope[j - i]).times(i)
    return _over(total, j)


def _convolved_parts(own: list[_Jet], a: list[_Jet], j: int) -> _Jet:
    """Return the part of coefficient j of ``a own'`` that earlier coefficients of `own` make, over j."""
    total = own[0].times(0)
    for i in range(1, j):
        total = total + (own[i] * a[j - i]).times(i)
    return _over(total, j)


def _over(jet: _Jet, j: int) -> _Jet:
    return _Jet(jet.value / j, [s / j for s in jet.slopes])


def witness(
    point_map: PointMap, parameters: Mapping[str, Any] | None = None
) -> Callable[[Sequence[Interval]], tuple[list[Interval], list[list[Interval]]]]:
    """Return a function of boxes, sequences of mpmath's intervals, that encloses image and derivative on them.

    ``witness(map)(box)`` returns an enclosure of the image of the box's midpoint, angles not wrapped, and one of the
    derivative at all points of the box.  It raises :class:`NotEnclosedError` where it finds none.
    """
    context, spec = intervals(), point_map.without_table.spec
    values = [_as_interval(context, v) for v in ({**point_map.params, **(parameters or {})}).values()]
    names = tuple(point_map.params)
    if isinstance(spec, Discrete):
        traced = spec.trace()
        if traced is not None:
            formulas = _Formulas(context, traced, values)
            return lambda box: _discrete_image(formulas, box)
    if isinstance(spec, Stroboscopic):
        system = spec.system
        traced = traced_function(system.rhs, system.dimension, names)
        if traced is not None and system.functions[1:] == (None, None):
            formulas = _Formulas(context, traced, values)
            length = context.mpf(system.length)
            if parameters and callable(system.period):
                period = traced_function(period_as_map(system.period), 1, names)
                if period is None:
                    raise ValueError(f"period={system.period!r}: its formula is not known; give parameters as numbers")
                length = _Formulas(context, period, values).values(context.mpf(0), [_Jet(context.mpf(0), [])])[0].value
            return lambda box: _flow_image(formulas, context.mpf(spec.phase) * length, length, box)
    raise ValueError(
        f"{point_map!r} has no formulas that intervals can evaluate: proofs are for discrete maps and smooth flows "
        "whose functions can be traced"
    )


def _as_interval(context: Any, value: Any) -> Interval:
    return context.mpf([*map(float, value)]) if isinstance(value, tuple | list) else context.mpf(float(value))


def middle(context: Any, x: Interval) -> Interval:
    """Return the midpoint of an interval, as an interval of one number."""
    return context.mpf(x.mid.a)


def _with_directions(context: Any, box: Sequence[Interval], slopes: Sequence[Sequence[Interval]]) -> list[_Jet]:
    return [_Jet(x, list(row)) for x, row in zip(box, slopes, strict=True)]


def _unit(context: Any, d: int) -> list[list[Interval]]:
    return [[context.mpf(int(i == k)) for k in range(d)] for i in range(d)]


def _discrete_image(formulas: _Formulas, box: Sequence[Interval]) -> tuple[list[Interval], list[list[Interval]]]:
    context, d = formulas.context, len(box)
    centre = [_Jet(middle(context, x), []) for x in box]
    image = formulas.values(context.mpf(0), centre)
    spread = formulas.values(context.mpf(0), _with_directions(context, box, _unit(context, d)))
    return [f.value for f in image], [list(f.slopes) for f in spread]


def _flow_image(
    formulas: _Formulas, begin: Interval, length: Interval, box: Sequence[Interval]
) -> tuple[list[Interval], list[list[Interval]]]:
    for steps in _STEPS:
        try:
            return _flow_in_steps(formulas, begin, length, box, steps)
        except NotEnclosedError as error:
            reason = error
    raise reason


def _flow_in_steps(
    formulas: _Formulas, begin: Interval, length: Interval, box: Sequence[Interval], steps: int
) -> tuple[list[Interval], list[list[Interval]]]:
    context, d = formulas.context, len(box)
    h = length / steps
    place, total = [middle(context, x) for x in box], _unit(context, d)
    offsets = [x - m for x, m in zip(box, place, strict=True)]
    for k in range(steps):
        check_stop()
        time = begin + k * h
        ahead = context.mpf([0, 1]) * h
        around = moved(place, total, offsets)
        held = _picard(formulas, time + ahead, ahead, around)
        slopes = formulas.values(time + ahead, _with_directions(context, held, _unit(context, d)))
        growth = max((sum(abs(s).b for s in f.slopes) for f in slopes), default=0)
        away = (context.exp(context.mpf(growth) * h) - 1).b
        ball = context.mpf([-away, away])
        tangents = [[x + ball for x in row] for row in _unit(context, d)]
        rest = formulas.series(time + ahead, _with_directions(context, held, tangents), _ORDER)
        wide = formulas.series(time, _with_directions(context, around, _unit(context, d)), _ORDER - 1)
        narrow = formulas.series(time, [_Jet(x, []) for x in place], _ORDER - 1)
        powers = [h**j for j in range(_ORDER + 1)]
        place = [
            sum((c.value * powers[j] for j, c in enumerate(row)), context.mpf(0)) + last[_ORDER].value * powers[_ORDER]
            for row, last in zip(narrow, rest, strict=True)
        ]
        step = [
            [
                sum((c.slopes[m] * powers[j] for j, c in enumerate(row)), context.mpf(0))
                + last[_ORDER].slopes[m] * powers[_ORDER]
                for m in range(d)
            ]
            for row, last in zip(wide, rest, strict=True)
        ]
        total = product(step, total)
    return place, total


def moved(place: Sequence[Interval], matrix: Any, offsets: Sequence[Interval]) -> list[Interval]:
    """Return a place plus a matrix times offsets."""
    products = (sum(a * o for a, o in zip(row, offsets, strict=True)) for row in matrix)
    return [x + p for x, p in zip(place, products, strict=True)]


def product(a: Any, b: Any) -> list[list[Interval]]:
    """Return the product of two matrices."""
    return [[sum(row[m] * b[m][c] for m in range(len(b))) for c in range(len(b[0]))] for row in a]


def _picard(formulas: _Formulas, times: Interval, ahead: Interval, box: Sequence[Interval]) -> list[Interval]:
    """Return a box that holds all solutions from another box over a step."""
    context = formulas.context
    held = list(box)
    for widening in range(_WIDENINGS):
        slopes = [f.value for f in formulas.values(times, [_Jet(x, []) for x in held])]
        moved = [x + ahead * s for x, s in zip(box, slopes, strict=True)]
        if widening and all(m in x for m, x in zip(moved, held, strict=True)):
            return moved
        reach = [m.delta.b * (comb(widening + 2, 2)) / 20 + context.mpf(10) ** -30 for m in moved]
        held = [m + context.mpf([-1, 1]) * r for m, r in zip(moved, reach, strict=True)]
    raise NotEnclosedError("no box holds the solutions over a step")
