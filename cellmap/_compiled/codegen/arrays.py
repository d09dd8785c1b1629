"""Arrays in a traced function: NumPy's functions over numbers and expressions.

In a traced function all arrays of floats are :class:`TracedArray`, whatever makes them: entries are numbers, and become
expressions where these are assigned.  Its entries go through NumPy's own machinery, one by one, where this has loops
for objects; elementary functions are those of expressions, and what LAPACK computes is written out.
"""

from __future__ import annotations

import functools
import importlib
import types
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .complex_numbers import ComplexExpression, phase
from .elementary import clip, elementary_functions, nearest, sinc, where
from .expression import Answer, Comparison, ComparisonError, Expression, UntraceableError
from .rebind import CANONICAL_NAMES
from .tables import TableError, interpolated, piecewise

LARGEST_MATRIX = 6
"""Of a system of linear equations that is solved by formulas, of which there are twice as many for each row more."""

_FLOATS = ("d", "f8", "float", "float64", np.dtype(float))
_COMPLEX = ("D", "c16", "complex", "complex128", np.dtype(complex))
_FUNCTIONS = (np.ufunc, types.FunctionType, types.BuiltinFunctionType, type(np.concatenate))


class TracedArray(np.ndarray[Any, Any]):
    """Array of numbers and expressions."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply a function to all entries."""
        return applied(ufunc, inputs, options, method)

    def __array_function__(self, function: Any, kinds: Any, arguments: Any, options: Any) -> Any:
        """Apply a function to the array."""
        return applied(function, arguments, options)

    def astype(self, dtype: Any, *further: Any, **options: Any) -> Any:
        """Return a copy: floats and expressions are of one kind."""
        return self.copy() if np.dtype(dtype).kind in "fcO" else super().astype(dtype, *further, **options)

    @property  # type: ignore[misc]
    def real(self) -> Any:
        """Real parts."""
        return applied(np.real, (self,), {})

    @property  # type: ignore[misc]
    def imag(self) -> Any:
        """Imaginary parts."""
        return applied(np.imag, (self,), {})

    def view(self, *kinds: Any) -> Any:  # type: ignore[override]
        """Return the array, or its numbers as complex ones, or these as numbers."""
        if kinds and _names(kinds[0], complex):
            return self[..., ::2] + 1j * self[..., 1::2]
        if kinds and _names(kinds[0], float) and any(isinstance(e, Expression.complex_kinds) for e in self.flat):
            return _traced(np.stack([self.real, self.imag], axis=-1).reshape(*self.shape[:-1], -1))
        return super().view(*kinds)

    def dot(self, b: Any, out: Any = None) -> Any:
        """Return the product with a vector or a matrix."""
        return applied(np.dot, (self, b), {"out": out})

    def __setitem__(self, key: Any, value: Any) -> None:
        if isinstance(key, Comparison) or (isinstance(key, np.ndarray) and is_symbolic(key)):
            key, value = ..., applied(np.where, (key, value, self), {})
        super().__setitem__(key, value)


Expression.__array_ufunc__ = ComplexExpression.__array_ufunc__ = TracedArray.__array_ufunc__


def is_symbolic(item: Any) -> bool:
    """Tell whether there are expressions, or comparisons of them, in a number, an array, a list or a tuple."""
    if isinstance(item, np.ndarray):
        return item.dtype == object and any(map(is_symbolic, item.flat))
    if isinstance(item, list | tuple):
        return any(map(is_symbolic, item))
    return isinstance(item, Expression | ComplexExpression | Comparison | Answer)


def in_a_trace(value: Any) -> Any:
    """Return what a value is to a traced function: arrays of floats, and functions that make them, are other ones."""
    if isinstance(value, np.ndarray):
        return _traced(value)
    if type(value).__module__.startswith("scipy.interpolate") and hasattr(value, "extrapolate"):
        return _Spline(value)
    of_numpy = isinstance(value, np.ufunc) or (getattr(value, "__module__", None) or "").partition(".")[0] == "numpy"
    is_function = isinstance(value, _FUNCTIONS) or hasattr(type(value), "makemat")  # of which np.r_ is one
    return _Function(value) if of_numpy and is_function and CANONICAL_NAMES.get(value) != "print" else value


class _Function:
    """Function of NumPy in a traced function."""

    def __init__(self, function: Any, method: str = "__call__") -> None:
        self._function, self._method = function, method

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return applied(self._function, arguments, options, self._method)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._function, name)
        return _Function(self._function, name) if callable(found) else found

    def __getitem__(self, key: Any) -> Any:
        return _traced(self._function[key])


class _Spline:
    """Piecewise polynomial of SciPy in a traced function."""

    def __init__(self, spline: Any) -> None:
        self._spline = spline

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._spline, name)
        return (lambda *arguments: in_a_trace(found(*arguments))) if callable(found) else in_a_trace(found)

    def __call__(self, x: Any, nu: int = 0, extrapolate: Any = None) -> Any:
        spline, extrapolate = self._spline, self._spline.extrapolate if extrapolate is None else extrapolate
        if not is_symbolic(x):
            return _traced(spline(_numbers(x), nu, extrapolate))
        if hasattr(spline, "t"):
            spline = importlib.import_module("scipy.interpolate").PPoly.from_spline(spline)
        spline = spline.derivative(nu) if nu else spline
        if spline.c.ndim != 2 or not extrapolate:
            raise UntraceableError(
                "a spline has several values, or none beyond its ends: give one for each that goes on"
            )
        pieces = np.flatnonzero(np.diff(spline.x) > 0.0)
        places, coefficients = spline.x[[*pieces, -1]], spline.c[:, pieces]

        value = functools.partial(
            piecewise, places=places, coefficients=coefficients, repeats=extrapolate == "periodic"
        )
        return _traced(_by_entries(value)(x))


def applied(function: Any, arguments: Sequence[Any], options: dict[str, Any], method: str = "__call__") -> Any:
    """Apply a function of NumPy to numbers and expressions, or a method of one that has several.

    Raises
    ------
    UntraceableError
        Where it has no formula.
    """
    symbolic = is_symbolic([*arguments, *options.values()])
    arguments = [*arguments[:1], *(_kind(a, symbolic) for a in arguments[1:])]
    options = {name: _kind(value, symbolic) for name, value in options.items()}
    name = CANONICAL_NAMES.get(function, "")
    if isinstance(function, np.ufunc) and getattr(np, function.__name__, None) is not function:
        name = function.__name__  # one of SciPy
    rule = _RULES.get(function) or elementary_functions().get(name)
    try:
        if isinstance(function, np.ufunc):
            if function is not np.matmul or not symbolic:
                return _ufunc(function, arguments, options, method, symbolic, rule)
            rule = functools.partial(_product, out=(options.pop("out", None) or (None,))[0])
        if rule is not None and symbolic:
            return _traced(rule(*arguments, **options))
        of_numbers = rule is not None or getattr(function, "__module__", "") == "numpy.linalg"
        if of_numbers and not symbolic:
            arguments, options = _numbers(arguments), {name: _numbers(value) for name, value in options.items()}
        return _traced(getattr(function, "_implementation", function)(*arguments, **options))
    except (ComparisonError, TableError, UntraceableError):
        raise
    except (TypeError, np.linalg.LinAlgError) as error:
        if not symbolic:
            raise
        name = getattr(function, "__qualname__", None) or function.__name__
        raise UntraceableError(
            f"{name} has no formula for values that depend on x, t or p{_spline_for(function, name, arguments)}"
        ) from error


def _spline_for(function: Any, name: str, arguments: Sequence[Any]) -> str:
    """Return the lines that replace a function of SciPy of one number that moves."""
    moving = [is_symbolic(a) for a in arguments]
    of_numpy = getattr(np, name, None) is function
    if of_numpy or not isinstance(function, np.ufunc) or sum(moving) != 1:
        return ""
    given = ", ".join("s" if moves else repr(a) for a, moves in zip(arguments, moving, strict=True))
    return (
        f": write s = np.linspace(lowest, highest, 201); spline = scipy.interpolate.CubicSpline(s, {name}({given})) "
        f"before, and spline(...) in the place of {name}. Its pieces are located, and it goes on beyond its ends"
    )


def _names(value: Any, kind: type[Any]) -> bool:
    """Tell whether a value names a kind of entries: floats or complex numbers."""
    if isinstance(value, type):
        return issubclass(value, kind | (np.floating if kind is float else np.complexfloating))
    return isinstance(value, str | np.dtype) and value in {float: _FLOATS, complex: _COMPLEX}[kind]


def _kind(value: Any, symbolic: bool) -> Any:
    """Return the kind of entries, where a value names that of floats: among them are expressions."""
    for kind in (float, complex):
        if _names(value, kind):
            return object if symbolic else kind
    return int if isinstance(value, type) and issubclass(value, int) and value is not bool else value


def _ufunc(
    ufunc: np.ufunc,
    inputs: Sequence[Any],
    options: dict[str, Any],
    method: str,
    symbolic: bool,
    rule: Callable[..., Any] | None,
) -> Any:
    out = options.pop("out", None)
    places = out if isinstance(out, tuple) else (out,)
    if not symbolic and method != "at":
        found = getattr(ufunc, method)(*_numbers(inputs), **options)
    else:
        takes_indices = method in {"at", "reduceat"}
        bare = [v if k == 1 and takes_indices else _objects(v) for k, v in enumerate(inputs)]
        loop = ufunc if rule is None else np.frompyfunc(rule, ufunc.nin, ufunc.nout)
        kind = {} if method == "at" else {"dtype": object}  # so that comparisons are kept, not asked
        found = getattr(loop, method)(*bare, **{**options, **kind})
    if places[0] is None:
        return _traced(found)
    for place, value in zip(places, found if isinstance(found, tuple) else (found,), strict=True):
        place[...] = value
    return out if len(places) > 1 else places[0]


def _by_entries(rule: Callable[..., Any], count: int | None = None) -> Callable[..., Any]:
    """Return a function of the entries of several arrays, or of the first so many."""

    def function(*arguments: Any, **options: Any) -> Any:
        arrays, further = [_objects(a) for a in arguments[:count]], arguments[len(arguments[:count]) :]
        return np.frompyfunc(lambda *entries: rule(*entries, *further, **options), len(arrays), 1)(*arrays)

    return function


def _objects(item: Any) -> Any:
    """Return an array of expressions and Python's numbers: NumPy's would ask for a function of arrays again."""
    found = np.asarray(item, dtype=object)
    for place, entry in np.ndenumerate(found):
        if isinstance(entry, np.generic):
            found[place] = entry.item()
    return found


def _traced(found: Any) -> Any:
    """Return arrays of floats as such of objects."""
    if type(found) is tuple:
        return tuple(map(_traced, found))
    if not isinstance(found, np.ndarray) or isinstance(found, TracedArray) or found.dtype.kind not in "fcO":
        return found
    return found.astype(object, copy=False).view(TracedArray)


def _numbers(item: Any) -> Any:
    """Return numbers as NumPy has them, where there are no expressions."""
    if isinstance(item, TracedArray):
        return (
            np.array(item.tolist()) if any(isinstance(v, complex) for v in item.flat) else np.array(item, dtype=float)
        )
    if type(item) in {list, tuple}:
        return type(item)(map(_numbers, item))
    return item


def _matrix(a: Any) -> Any:
    found = np.asarray(a, dtype=object)
    if found.ndim != 2 or found.shape[0] != found.shape[1] or len(found) > LARGEST_MATRIX:
        raise UntraceableError(
            f"a matrix of the shape {found.shape} is solved or inverted: formulas are written for square ones of up "
            f"to {LARGEST_MATRIX} rows"
        )
    return found


def _minors(rows: Any) -> Callable[[tuple[int, ...]], Any]:
    """Return the determinants of the last rows and some columns, each computed once."""

    @functools.cache
    def minor(columns: tuple[int, ...]) -> Any:
        if not columns:
            return 1.0
        row = rows[-len(columns)]
        found: Any = 0.0
        for k, column in enumerate(columns):
            if not _is_zero(row[column]):
                term = _TIMES(row[column], minor(columns[:k] + columns[k + 1 :]))
                found = found - term if k % 2 else found + term
        return found

    return minor


def _solution(a: Any, b: Any) -> Any:
    """Solve linear equations by Cramer's rule: of its formulas none divides by what may vanish but the determinant."""
    rows, right = _matrix(a), np.asarray(b, dtype=object)
    n, columns = len(rows), right.reshape(len(rows), -1)
    minor = _minors(np.concatenate([rows, columns], axis=1))
    whole = minor(tuple(range(n)))
    found = [
        [(-1.0) ** (n - 1 - j) * minor((*range(j), *range(j + 1, n), n + k)) / whole for k in range(columns.shape[1])]
        for j in range(n)
    ]
    return np.array(found, dtype=object).reshape(right.shape)


def _product(a: Any, b: Any, out: Any = None) -> Any:
    """Multiply vectors or matrices; nothing is left of products with zeros of them."""
    left, right = _objects(a), _objects(b)
    if left.ndim not in {1, 2} or right.ndim not in {1, 2}:
        return np.dot(left, right, out)
    rows, columns = left.reshape(-1, left.shape[-1], 1), right.reshape(1, len(right), -1)
    found = np.add.reduce(_TIMES(rows, columns), axis=1).reshape((*left.shape[:-1], *right.shape[1:]))
    if out is None:
        return found if found.ndim else found.item()
    out[...] = found
    return out


def _is_zero(value: Any) -> bool:
    known = isinstance(value, Expression | ComplexExpression)
    return not isinstance(value, Comparison) and (value.vanishes if known else value == 0.0)


_TIMES = np.frompyfunc(lambda u, v: 0.0 if _is_zero(u) or _is_zero(v) else u * v, 2, 1)


def _norm(vector: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    entries = _traced(_objects(vector))
    if ord not in {None, 2} or (ord == 2 and axis is None and entries.ndim > 1):
        raise UntraceableError(
            f"np.linalg.norm with ord={ord!r} has no formula here: that of a vector without ord has one"
        )
    return applied(np.sqrt, (np.sum((entries * entries.conj()).real, axis=axis, keepdims=keepdims),), {})


def _select(conditions: Any, choices: Any, default: Any = 0.0) -> Any:
    pairs = reversed(list(zip(conditions, choices, strict=True)))
    return functools.reduce(lambda chosen, pair: applied(np.where, (*pair, chosen), {}), pairs, default)


_RULES: dict[Any, Callable[..., Any]] = {
    np.where: _by_entries(where),
    np.clip: _by_entries(clip),
    np.round: _by_entries(nearest, 1),
    np.interp: _by_entries(interpolated, 1),
    np.sinc: _by_entries(sinc),
    np.select: _select,
    np.polyval: lambda p, x: functools.reduce(lambda y, c: y * x + c, p),
    np.linalg.solve: _solution,
    np.linalg.inv: lambda a: _solution(a, np.eye(len(a))),
    np.linalg.norm: _norm,
    np.real: _by_entries(lambda value: value.real),
    np.imag: _by_entries(lambda value: value.imag),
    np.angle: _by_entries(phase),
    np.dot: _product,
    np.matmul: _product,
    np.linalg.det: lambda a: _minors(_matrix(a))(tuple(range(len(a)))),
}
"""Functions of arrays that are other ones for expressions."""
