"""Type checks of the arguments of public functions, from their signatures."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from types import NoneType, UnionType
from typing import Any, NamedTuple, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from .checks import is_sequence, real_number, shown

_LIBRARY = __name__.split(".")[0]
F = TypeVar("F", bound=Callable[..., Any])

MADE_BY = {
    "Attractor": "find_attractors",
    "Axes": "matplotlib.pyplot.subplots",
    "ArnoldTongue": "arnold_tongue",
    "AttractorAtlas": "attractor_atlas",
    "Ball": "largest_ball",
    "BasinContinuation": "continue_basins",
    "BasinEntropy": "basin_entropy",
    "BasinStability": "basin_stability",
    "Basins": "find_basins",
    "Bifurcation": "continue_orbit, among the bifurcations of a Branch",
    "BifurcationCurve": "continue_bifurcation or switch_curve",
    "BifurcationDiagram": "bifurcation_diagram",
    "BoundaryDistance": "boundary_distance",
    "BoxSet": "BoxSet.full or relative_attractor",
    "Branch": "continue_orbit",
    "CellChain": "generalized_cell_mapping",
    "CellMapping": "simple_cell_mapping",
    "Certificate": "certify",
    "ChaosTest": "exponent_test, zero_one_test or alignment_test",
    "ChaoticSaddle": "chaotic_saddle",
    "CircleBranch": "continue_circle",
    "CodimensionTwo": "continue_bifurcation, among the points codimension_two() of a BifurcationCurve",
    "ConnectingOrbit": "connecting_orbits",
    "ConnectionBranch": "continue_connection",
    "CovariantVectors": "covariant_vectors",
    "EdgeOrbit": "edge_orbit",
    "ExponentField": "finite_time_exponents",
    "FatalShock": "minimal_fatal_shock",
    "FeatureBasins": "classify_by_features",
    "FractalTest": "fractal_boundary_test",
    "GeneralizedDimensions": "generalized_dimensions",
    "KaplanYorke": "kaplan_yorke_dimension",
    "FunctionZero": "continue_orbit, among the zeros of Branch.with_zeros",
    "LyapunovSpectrum": "lyapunov_spectrum",
    "Manifold": "saddle_manifold",
    "MergingTest": "wada_merging",
    "MorseGraph": "morse_graph",
    "OrbitFunction": "OrbitFunction",
    "PeriodicOrbit": "periodic_orbit",
    "Plan": "plan",
    "PointMap": "stroboscopic_map or discrete_map",
    "Refinement": "refine_basins",
    "SettlingStatistics": "settling_statistics",
    "StabilityMap": "stability_map",
    "Tangency": "continue_connection, among the tangencies of a ConnectionBranch",
    "TippingProbabilities": "tipping_probabilities",
    "Trajectory": "trajectory",
    "TransferOperator": "transfer_operator",
    "UncertaintyExponent": "uncertainty_exponent",
    "WadaGrid": "wada_grid",
}
"""Where records come from, for the remedy of an error."""


class _Kind(NamedTuple):
    """What an argument may be: a test of its value, words for it, and where it comes from."""

    holds: Callable[[Any], bool]
    words: str
    maker: str = ""


def checked(function: F) -> F:
    """Hold the arguments of a public function to the records and numbers that its signature asks for.

    Bounds are left to the function, and so is what else a signature may ask for: array_like, strings, functions,
    mappings and pairs, of which it knows the shapes and the choices.  A sequence of numbers may be an array, and a
    float any real number.

    Raises
    ------
    TypeError
        Of the new function, for an argument of another type: ``argument=value: remedy``.

    Examples
    --------
    >>> @checked
    ... def cells(count: int) -> int:
    ...     return count
    >>> cells(1.5)
    Traceback (most recent call last):
        ...
    TypeError: count=1.5: give a whole number
    """
    code = function.__code__
    names = code.co_varnames[: code.co_argcount]

    @functools.wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        kinds = _kinds(function)
        for name, value in (*zip(names, args, strict=False), *named.items()):
            kind = kinds.get(name)
            if kind is not None and not kind.holds(value):
                raise TypeError(f"{name}={shown(value)}: give {kind.words}{kind.maker}")
        return function(*args, **named)

    return cast(F, call)


@functools.cache
def _kinds(function: Callable[..., Any]) -> Mapping[str, _Kind]:
    """Read a signature; late, when all modules are there."""
    found = {name: _kind(hint) for name, hint in get_type_hints(function).items() if name != "return"}
    return {name: kind for name, kind in found.items() if kind is not None}


def _kind(hint: Any) -> _Kind | None:
    """Return what a value of a type is; None where it is left to the function."""
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if origin in (Union, UnionType):
        return _any_of([_kind(h) for h in inner])
    if origin in _NUMBERS:
        return _NUMBERS[origin]
    if origin is tuple and len(inner) == 2 and inner[0] is inner[1] and inner[0] in (int, float):
        return _pair_of(_NUMBERS[inner[0]].holds, "two whole numbers" if inner[0] is int else "two numbers")
    if origin is Sequence:
        each = _kind(inner[0])
        return None if each is None else _sequence_of(each)
    if not isinstance(origin, type) or origin.__module__.split(".")[0] not in (_LIBRARY, "matplotlib"):
        return None
    name = origin.__name__
    article = "" if name.endswith("s") else "an " if name[0] in "AEIO" else "a "
    maker = f", made by {MADE_BY[name]}" if name in MADE_BY else ""
    return _Kind(lambda value: isinstance(value, origin), article + name, maker)


def _any_of(kinds: list[_Kind | None]) -> _Kind | None:
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds):
        return None
    words = list(dict.fromkeys(kind.words for kind in known))
    makers = {kind.maker for kind in known if kind.maker}
    maker = makers.pop() if len(makers) == 1 and len(words) <= 2 else ""
    return _Kind(lambda value: any(kind.holds(value) for kind in known), " or ".join(words), maker)


def _sequence_of(each: _Kind) -> _Kind:
    def holds(value: Any) -> bool:
        return is_sequence(value) and all(map(each.holds, value))

    return _Kind(holds, f"a sequence, each of it {each.words}", each.maker)


def _pair_of(holds: Callable[[Any], bool], words: str) -> _Kind:
    return _Kind(lambda value: is_sequence(value) and len(value) == 2 and all(map(holds, value)), words)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _is_real(value: Any) -> bool:
    try:
        real_number("", value)
    except (TypeError, ValueError):
        return False
    return True


_NUMBERS: dict[Any, _Kind] = {
    NoneType: _Kind(lambda value: value is None, "None"),
    bool: _Kind(lambda value: isinstance(value, bool | np.bool_), "True or False"),
    int: _Kind(_is_whole, "a whole number"),
    float: _Kind(_is_real, "one real number"),
}
