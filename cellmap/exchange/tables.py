"""Results as tables of pandas, where a table is their natural form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import check_length, is_sequence, shown
from .._lib.records import Layout
from ..basins.record import Basins
from ..bifurcations.atlas_families import AtlasKind
from ..bifurcations.atlas_record import AttractorAtlas
from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.branch import Bifurcation, Branch
from ..bifurcations.circle_branches import CircleBranch, circle_columns
from ..bifurcations.connecting_branches import ConnectionBranch, TangencyCurve
from ..bifurcations.diagram import BifurcationDiagram
from ..bifurcations.function_zeros import FunctionZero
from ..bifurcations.period_measures import OrbitFunction, Quantity, as_functions
from ..maps.coordinates import Coordinate
from ..orbits.attractor import Attractor, distinct_names
from .conventions import values_of, variables_of
from .optional import pandas_package


def to_dataframe(result: Any, functions: Mapping[str, Quantity | OrbitFunction] | None = None) -> Any:
    """Return a result as a table of pandas.

    The method `to_dataframe` of Basins, Branch, BifurcationCurve, BifurcationDiagram and AttractorAtlas does the same.

    Parameters
    ----------
    result : Basins, sequence of Attractor, Branch, BifurcationCurve, special points of a Branch, BifurcationDiagram, \
AttractorAtlas, CircleBranch, ConnectionBranch or TangencyCurve
        Attractors have one row each, in Basins with the fraction of the initial conditions that converge to them, in an
        atlas with their parameters; a branch or curve one for each of its points; a diagram one for each recorded
        point.
    functions : mapping of str to OrbitFunction, optional
        Further columns of a branch, a curve or a diagram by their names: measures over the period, such as
        ``{"peak": OrbitFunction("x", "maximum")}``, or quantities at the points of a branch or curve.

    Returns
    -------
    pandas.DataFrame
        State variables have columns of their names, with an underscore where another column has that name.

    Raises
    ------
    ModuleNotFoundError
        If pandas is not installed.
    TypeError
        For anything else.
    ValueError
        For a function with the name of another column.

    Examples
    --------
    >>> from cellmap import discrete_map, find_attractors
    >>> wells = discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"), "two wells")
    >>> table = to_dataframe(find_attractors(wells, [[0.5, 0.0], [-0.5, 0.0]]))
    >>> table[["kind", "period", "x", "largest_multiplier"]].round(3)
              kind  period      x  largest_multiplier
    0  fixed point       1  0.707                 0.5
    1  fixed point       1 -0.707                 0.5
    """
    check_length("result", result)
    frame = columns_of(result)
    for name, values in function_columns(result, functions, set(frame)).items():
        each = isinstance(result, BifurcationDiagram)
        frame[name] = np.repeat(values, result.points.shape[2], axis=1).ravel() if each else values
    return pandas_package().DataFrame(frame)


def function_columns(
    result: Any, functions: Mapping[str, Quantity | OrbitFunction] | None, taken: set[Any]
) -> dict[str, Floats]:
    """Return the values of functions by their names: (n,) on branches and curves, (branches, n) in diagrams.

    Names that are taken are refused.
    """
    chosen = as_functions(functions)
    if chosen and not isinstance(result, Branch | BifurcationCurve | BifurcationDiagram):
        raise TypeError(f"functions={shown(functions)}: {type(result).__name__} has no orbits to measure")
    for name in taken & set(chosen):
        raise ValueError(f"functions[{name!r}]: {name!r} is already there; give the function another name")
    return {name: result.measure(f.quantity, f.measure) - f.value for name, f in chosen.items()}


def columns_of(result: Any) -> dict[str, Any]:
    """Return the columns of a table by their names."""
    if isinstance(result, Basins):
        fractions = [result.fractions[k] for k in range(len(result.attractors))]
        return {
            **_attractor_columns(result.attractors),
            "name": [result.label_name(k) for k in range(len(result.attractors))],
            "fraction": np.array([s.fraction for s in fractions]),
            "standard_error": np.array([s.standard_error for s in fractions]),
            "count": np.array([s.count for s in fractions], np.int64),
        }
    if isinstance(result, Branch):
        return _branch_columns(result)
    if isinstance(result, BifurcationCurve):
        return _curve_columns(result)
    if isinstance(result, CircleBranch):
        return circle_columns(result)
    if isinstance(result, ConnectionBranch):
        return {result.parameter: result.values, "angle": result.angles}
    if isinstance(result, TangencyCurve):
        return dict(zip(result.parameters, result.values.T, strict=True))
    if isinstance(result, AttractorAtlas):
        return _atlas_columns(result)
    if isinstance(result, BifurcationDiagram):
        return _diagram_columns(result)
    if is_sequence(result) and len(result):
        if all(isinstance(row, Attractor) for row in result):
            return _attractor_columns(result)
        if all(isinstance(row, Bifurcation | FunctionZero) for row in result):
            return _bifurcation_columns(result)
    layout: Layout | None = getattr(result, "_layout", None)
    variables = {} if layout is None else variables_of({**layout.coords, **layout.variables}, result)
    columns = {name: values_of(result, v) for name, v in variables.items() if getattr(result, v.field) is not None}
    if len({variables[name].dims for name in columns}) == 1 == max(map(np.ndim, columns.values())):
        return columns
    raise TypeError(
        f"result={shown(result)}: give Basins, a Branch, a BifurcationCurve, a BifurcationDiagram, an AttractorAtlas, "
        "a CircleBranch, a ConnectionBranch, a TangencyCurve, another record with arrays along one dimension, or a "
        "sequence of Attractor or special points of a Branch"
    )


def _attractor_columns(attractors: Sequence[Attractor]) -> dict[str, Any]:
    first = np.array([a.points[0] for a in attractors])
    fixed = "name kind period largest_multiplier largest_exponent verified fraction standard_error count"
    names = _different(attractors[0].coordinates if attractors else (), fixed)
    return {
        "name": list(distinct_names(attractors)),
        "kind": [str(a.kind) for a in attractors],
        "period": np.array([a.period for a in attractors], np.int64),
        **{name: first[:, j] for j, name in enumerate(names)},
        "largest_multiplier": np.array([_largest(a) for a in attractors]),
        "largest_exponent": np.array([a.exponents[0] for a in attractors]),
        "verified": np.array([a.verified for a in attractors], bool),
    }


def _branch_columns(branch: Branch) -> dict[str, Any]:
    names = _different(branch.point_map.coordinates, f"{branch.parameter} largest_multiplier unstable")
    return {
        branch.parameter: branch.values,
        **{name: branch.points[:, j] for j, name in enumerate(names)},
        "largest_multiplier": np.abs(branch.multipliers[:, 0]),
        "unstable": branch.unstable,
    }


def _curve_columns(curve: BifurcationCurve) -> dict[str, Any]:
    names = _different(curve.coordinates, f"{' '.join(curve.parameters)} kind largest_multiplier argument")
    return {
        "kind": [str(curve.kind)] * len(curve.values),
        **dict(zip(curve.parameters, curve.values.T, strict=True)),
        **{name: curve.points[:, j] for j, name in enumerate(names)},
        "largest_multiplier": np.abs(curve.multipliers[:, 0]),
        "argument": np.angle(curve.multipliers[:, 0]),
    }


def _atlas_columns(atlas: AttractorAtlas) -> dict[str, Any]:
    fixed = "kind period family count fraction largest_modulus"
    names = _different(atlas.coordinates, f"{' '.join(atlas.parameters)} {fixed}")
    return {
        atlas.parameters[0]: atlas.x[atlas.columns],
        atlas.parameters[1]: atlas.y[atlas.rows],
        "family": atlas.family,
        "kind": [AtlasKind(k).name.lower() for k in atlas.kind.tolist()],
        "period": atlas.period,
        **{name: atlas.points[:, j] for j, name in enumerate(names)},
        "largest_modulus": atlas.modulus,
        "count": atlas.counts,
        "fraction": atlas.counts / atlas.settings["initial_conditions"],
    }


def _bifurcation_columns(found: Sequence[Bifurcation | FunctionZero]) -> dict[str, Any]:
    both = [(b.before, b.after) if isinstance(b, Bifurcation) else (b.unstable, b.unstable) for b in found]
    return {
        "kind": [str(b.kind) if isinstance(b, Bifurcation) else b.name for b in found],
        "value": np.array([b.value for b in found]),
        "point": [tuple(b.point.tolist()) for b in found],
        "before": np.array([before for before, _ in both], np.int64),
        "after": np.array([after for _, after in both], np.int64),
        "place": np.array([b.place for b in found], np.int64),
    }


def _diagram_columns(diagram: BifurcationDiagram) -> dict[str, Any]:
    shape = diagram.points.shape[:-1]
    branch, value, step = (index.ravel() for index in np.indices(shape))
    names = _different(diagram.coordinates, f"branch direction {diagram.parameter} step period")
    return {
        "branch": branch,
        "direction": np.array(diagram.directions, object)[branch],
        diagram.parameter: diagram.values[value],
        "step": step,
        **{name: diagram.points[..., j].ravel() for j, name in enumerate(names)},
        "period": diagram.period[branch, value],
    }


def _different(coordinates: Sequence[Coordinate], fixed: str) -> list[str]:
    """Return the names of columns of coordinates; an underscore is added where another column has the name."""
    taken = set(fixed.split())
    return [c.name + "_" * (c.name in taken) for c in coordinates]


def _largest(attractor: Attractor) -> float:
    """Return the largest modulus of the multipliers; NaN where an attractor has none."""
    return float(np.abs(attractor.multipliers).max()) if attractor.multipliers.size else float("nan")
