"""Equations of motion written with SymPy, as right-hand sides."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .._lib.checks import check_mapping, shown
from .coordinates import Coordinate, as_coordinates

_RECIPROCAL = {"sec": math.cos, "csc": math.sin, "cot": math.tan, "sech": math.cosh, "csch": math.sinh}


def _printed_as() -> dict[str, Any]:
    """Return functions by SymPy's names where those of :mod:`math` have another meaning, or are not there."""
    special = importlib.import_module("scipy.special")
    return {
        "Abs": abs,
        "sign_of": np.sign,
        "Heaviside": lambda x, at_zero=0.5: np.heaviside(x, at_zero),
        "besselj": special.jv,
        "coth": lambda x: 1.0 / math.tanh(x),
        **{name: lambda x, f=f: 1.0 / f(x) for name, f in _RECIPROCAL.items()},
    }


def _sympy() -> Any:
    try:
        return importlib.import_module("sympy")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"{error}: pip install 'cellmap-dynamics[sympy]'", name=error.name) from error


def with_sympy(
    equations: Any, params: Mapping[Any, Any], period: Any, coordinates: Iterable[str | Coordinate] | None
) -> tuple[Callable[..., Any], dict[str, Any], Any, tuple[Coordinate, ...]]:
    """Return right-hand side, parameters by name, period and coordinates of equations of SymPy.

    The equations are linear in the highest derivatives; these are solved for numerically, in each connected block.

    Raises
    ------
    TypeError, ValueError
        For what is no system of ordinary differential equations, or has symbols without a value.
    """
    sp = _sympy()
    check_mapping("params", params, "of symbols or names to numbers, such as {'g': 9.81}")
    values = {str(name): value for name, value in params.items()}
    axes = None if coordinates is None else as_coordinates(coordinates)
    time, residuals = _residuals(sp, equations, axes)
    orders = _orders(sp, residuals, time)
    if len(residuals) != len(orders) or not orders:
        raise ValueError(
            f"equations has {len(residuals)} equations for {len(orders)} unknown functions of {time} "
            f"({', '.join(f.func.__name__ for f in orders)}): give one for each"
        )
    axes, place = _states(orders, axes)
    x, highest = sp.symbols(f"x:{len(axes)}", cls=sp.Dummy, real=True), {f: sp.Dummy(real=True) for f in orders}
    known = {f.diff(time, k) if k else f: x[j] for (f, k), j in place.items()}
    known |= {f.diff(time, order): highest[f] for f, order in orders.items()}
    rest = sp.Matrix([r.xreplace(known) for r in residuals])
    mass = rest.jacobian(list(highest.values()))
    if not mass.free_symbols.isdisjoint(highest.values()):
        raise ValueError("equations is not linear in the highest derivatives: solve for them before")
    force = -rest.xreplace(dict.fromkeys(highest.values(), sp.Integer(0)))
    symbols = sorted((mass.free_symbols | force.free_symbols) - {time, *x}, key=str)
    if lacking := [s.name for s in symbols if s.name not in values]:
        raise ValueError(f"params={shown(values)}: give a value for {', '.join(lacking)} of the equations")
    blocks, formulas = _blocks(sp, mass, force)
    formulas = [[[_printable(sp, e) for e in row] for row in block] for block in formulas]
    call = sp.lambdify((time, *x, *symbols), formulas, [_printed_as(), "math"])
    following = [place.get((f, k + 1), -1) for f, k in place]  # the state that is the derivative of each
    last = [place[f, order - 1] for f, order in orders.items()]
    rhs = _right_hand_side(call, tuple(following), blocks, tuple(last), tuple(s.name for s in symbols))
    return rhs, values, _period(sp, period), axes


def _right_hand_side(
    call: Callable[..., Any],
    following: tuple[int, ...],
    blocks: tuple[tuple[int, ...], ...],
    last: tuple[int, ...],
    names: tuple[str, ...],
) -> Callable[..., Any]:
    def equations(t: float, x: Sequence[float], p: Any) -> Sequence[float]:
        found: list[Any] = [x[j] for j in following]
        for unknowns, (mass, force) in zip(blocks, call(t, *x, *[getattr(p, n) for n in names]), strict=True):
            solved = (
                [force[0] / mass[0]] if len(force) == 1 else np.linalg.solve(np.reshape(mass, (len(force), -1)), force)
            )
            for k, value in zip(unknowns, solved, strict=True):
                found[last[k]] = value
        return found

    equations.__qualname__ = "equations"
    return equations


def _printable(sp: Any, expression: Any) -> Any:
    """Return an expression whose text has no test for equality, and a value wherever it is evaluated."""
    expression = expression.replace(sp.sign, sp.Function("sign_of"))
    return expression.replace(sp.Piecewise, lambda *pairs: sp.Piecewise(*pairs, (sp.nan, True)))


def _real(sp: Any, expressions: Sequence[Any]) -> tuple[Any, list[Any]]:
    """Return the symbol of time, and expressions with real symbols, of which one name is one, derivatives evaluated."""
    for e in expressions:
        if not isinstance(e, sp.Expr | float | int) or isinstance(e, bool):
            raise TypeError(f"equations has {shown(e)}: give expressions and equations of SymPy")
    expressions = [sp.sympify(e) for e in expressions]
    functions = {f for e in expressions for f in e.atoms(sp.core.function.AppliedUndef)}
    times = {f.args for f in functions} or {(sp.Symbol("t"),)}
    if len(times) > 1 or len(next(iter(times))) != 1 or not next(iter(times))[0].is_Symbol:
        raise ValueError(f"equations has functions of {shown(times)}: give functions of time alone")
    time = sp.Symbol(next(iter(times))[0].name, real=True)
    new = {s: sp.Symbol(s.name, real=True) for e in expressions for s in e.free_symbols}
    new |= {f: sp.Function(f.func.__name__, real=True)(time) for f in functions}
    return time, [e.xreplace(new).doit() for e in expressions]


def _residuals(sp: Any, equations: Any, axes: Sequence[Coordinate] | None) -> tuple[Any, list[Any]]:
    """Return time, and expressions that are zero along an orbit."""
    if hasattr(equations, "form_lagranges_equations"):
        equations = list(equations.form_lagranges_equations())
    elif hasattr(equations, "kindiffdict"):
        velocities = [left - right for left, right in equations.kindiffdict().items()]
        rates = equations.u.diff(equations.u[0].args[0])
        equations = [*velocities, *(equations.mass_matrix * rates - equations.forcing)]
    if isinstance(equations, Mapping):
        time, sides = _real(sp, [*equations, *equations.values()])
        left, right = sides[: len(equations)], sides[len(equations) :]
    elif isinstance(equations, list | tuple | sp.Tuple | sp.MatrixBase | sp.Expr | sp.Equality):
        equations = [equations] if isinstance(equations, sp.Expr | sp.Equality) else equations
        parts = [e.lhs - e.rhs if isinstance(e, sp.Equality) else e for e in equations]
        time, right = _real(sp, parts)
        if any(e.has(sp.Derivative) for e in right):
            return time, right
        if axes is None or len(axes) != len(right):
            raise ValueError(
                f"equations has {len(right)} expressions without derivatives: give coordinates=, one name for each, "
                "whose derivatives they are"
            )
        left = [sp.Symbol(c.name, real=True) for c in axes]
    else:
        raise TypeError(
            f"equations={shown(equations)}: give a list of equations of SymPy, a dict of right-hand sides, "
            "LagrangesMethod or KanesMethod"
        )
    functions = {s: sp.Function(s.name, real=True)(time) for s in left if s.is_Symbol}
    rates = [functions.get(e, e) for e in left]
    rates = [e if isinstance(e, sp.Derivative) else e.diff(time) for e in rates]
    return time, [rate - e.xreplace(functions) for rate, e in zip(rates, right, strict=True)]


def _orders(sp: Any, residuals: Sequence[Any], time: Any) -> dict[Any, int]:
    """Return the unknown functions with the order of their highest derivatives, in the order of the equations."""
    orders: dict[Any, int] = {}
    for residual in residuals:
        derivatives = residual.atoms(sp.Derivative)
        for d in sorted(derivatives, key=lambda d: (-d.derivative_count, str(d))):
            if not isinstance(d.expr, sp.core.function.AppliedUndef) or set(d.variables) != {time}:
                raise ValueError(f"equations has the derivative {d}: give derivatives of functions of {time} by {time}")
            orders[d.expr] = max(orders.get(d.expr, 0), d.derivative_count)
    unknown = {f for r in residuals for f in r.atoms(sp.core.function.AppliedUndef)} - orders.keys()
    if unknown:
        raise ValueError(f"equations has {', '.join(sorted(map(str, unknown)))}, of which no derivative is given")
    return orders


def _states(
    orders: Mapping[Any, int], axes: tuple[Coordinate, ...] | None
) -> tuple[tuple[Coordinate, ...], dict[tuple[Any, int], int]]:
    """Return the coordinates, and which of them each derivative below the highest is, in their order."""
    names = {f.func.__name__: f for f in orders}
    further = [(f, k) for k in range(1, max(orders.values())) for f in orders if k < orders[f]]
    if axes is None:
        axes = as_coordinates([*names, *(f"{f.func.__name__}_{'d' * k}ot" for f, k in further)])
    free = [j for j, c in enumerate(axes) if c.name not in names]
    if len(axes) != len(names) + len(further) or len(free) != len(further):
        raise ValueError(
            f"coordinates={shown([c.name for c in axes])}: give {len(names) + len(further)}, of which "
            f"{', '.join(names)} and names of your own for {len(further)} derivatives"
        )
    order = [names[c.name] for c in axes if c.name in names]
    further.sort(key=lambda pair: (pair[1], order.index(pair[0])))
    found = {(names[c.name], 0): j for j, c in enumerate(axes) if c.name in names}
    found |= dict(zip(further, free, strict=True))
    return axes, dict(sorted(found.items(), key=lambda pair: pair[1]))


def _blocks(sp: Any, mass: Any, force: Any) -> tuple[tuple[tuple[int, ...], ...], list[Any]]:
    """Return the unknowns of each connected block of linear equations, and its matrix and right side."""
    n = len(force)
    graph = sp.Matrix(sp.BlockMatrix([[sp.zeros(n, n), mass], [mass.T, sp.zeros(n, n)]]))
    blocks, formulas = [], []
    for vertices in graph.connected_components():
        rows, columns = [v for v in vertices if v < n], [v - n for v in vertices if v >= n]
        if len(rows) != len(columns):
            raise ValueError("equations does not determine the highest derivatives: the mass matrix is singular")
        blocks.append(tuple(columns))
        formulas.append([list(mass.extract(rows, columns)), list(force.extract(rows, [0]))])
    return tuple(blocks), formulas


def _period(sp: Any, period: Any) -> Any:
    """Return a period as a number, or a function of parameters, of one of SymPy."""
    if not isinstance(period, sp.Basic):
        return period
    symbols = sorted(period.free_symbols, key=str)
    if not symbols:
        return float(period)
    call = sp.lambdify(symbols, period, "math")
    return lambda p: call(*[getattr(p, s.name) for s in symbols])
