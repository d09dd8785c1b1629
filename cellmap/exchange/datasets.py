"""Results as labelled arrays of xarray, with the attributes of the CF conventions."""

from __future__ import annotations

from collections.abc import Mapping
from functools import singledispatch
from typing import Any

import numpy as np

from .._lib.checks import shown
from .._lib.records import Layout
from ..basins.certification.certificate import Certificate, Evidence
from ..basins.continuation_record import BasinContinuation
from ..basins.record import Basins
from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.branch import Branch
from ..bifurcations.circle_branches import CircleBranch
from ..bifurcations.connecting_branches import ConnectionBranch, TangencyCurve
from ..bifurcations.crossings import Crossing
from ..bifurcations.diagram import BifurcationDiagram
from ..bifurcations.equilibrium_stability import StabilityMap
from ..bifurcations.period_measures import OrbitFunction, Quantity
from ..maps.grid import CellGrid
from .attractor_group import attractor_group
from .branch_records import solutions_of
from .conventions import (
    Variable,
    about,
    attribute_fields,
    coordinate_attributes,
    encoded,
    enum_flags,
    flags,
    names_of,
    values_of,
    variable_names,
    variables_of,
)
from .optional import xarray_package
from .tables import columns_of, function_columns

_ROWS = "point"  # dimension of the rows of tables
_COLUMNS = {"fraction": np.float64, "standard_error": np.float64, "count": np.int64}  # columns of attractors
BOUNDARY = ("x", "y", "crossing", "below", "above")
"""Fields of the points of a stability boundary."""


def to_xarray(result: Any, functions: Mapping[str, Quantity | OrbitFunction] | None = None) -> Any:
    """Return a result as labelled arrays of xarray, which can be written to netCDF.

    Variables and coordinates have names, units and, for numbers with a meaning such as labels, `flag_values` and
    `flag_meanings` (CF conventions 1.11).  Parameters and settings are attributes, as JSON.  The method `to_xarray` of
    a result does the same.

    Parameters
    ----------
    result : Basins, Certificate, BasinContinuation, BifurcationDiagram, StabilityMap, AttractorAtlas, ExponentField, \
Branch, BifurcationCurve, CircleBranch, ConnectionBranch or TangencyCurve
        What is to be converted.
    functions : mapping of str to OrbitFunction, optional
        Further variables of a branch, a curve or a diagram, as for :func:`to_dataframe`.

    Returns
    -------
    xarray.DataTree or xarray.Dataset
        A tree for results with attractors, which are its group ``"attractors"``; else a Dataset.  Arrays are not
        copied.  Its method `to_netcdf` writes it to a file, which ``xarray.open_datatree`` or ``xarray.open_dataset``
        reads; :func:`from_xarray` makes the result again of all but atlases, branches of circles and
        connecting orbits, and curves of tangencies.

    Raises
    ------
    ModuleNotFoundError
        If xarray is not installed.
    TypeError
        For anything else.
    ValueError
        For a curve of a function, and for a function with the name of another variable.

    References
    ----------
    Eaton et al., *NetCDF Climate and Forecast (CF) Metadata Conventions*, version 1.11 (2023).

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> wells = discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"), "two wells")
    >>> tree = to_xarray(find_basins(wells, CellGrid((-1, -1), (1, 1), (20, 10))))
    >>> tree["labels"].sel(x=0.3, y=0.0, method="nearest").item()
    0
    >>> tree["labels"].attrs["flag_meanings"].split()[:2]
    ['fixed_point_0.707_0', 'fixed_point_-0.707_0']
    >>> tree["attractors"]["points"].values.round(3)
    array([[ 0.707,  0.   ],
           [-0.707,  0.   ]])
    """
    found = _converted(result)
    more = function_columns(result, functions, {*found.variables, *found.dims} if functions is not None else set())
    dims = ("branch", *variable_names([result.parameter])) if isinstance(result, BifurcationDiagram) else _ROWS
    return found.assign({name: (dims, values) for name, values in more.items()}) if more else found


@singledispatch
def _converted(result: Any) -> Any:
    if getattr(result, "_layout", None) is None or isinstance(result, type):
        raise TypeError(
            f"result={shown(result)}: give Basins, a Certificate, a BasinContinuation, a BifurcationDiagram, a "
            "StabilityMap, an AttractorAtlas, an ExponentField, a Branch, a curve, or another record with to_xarray"
        )
    return dataset_of(result)


def dataset_of(record: Any) -> Any:
    """Return a record as a Dataset, by its layout."""
    layout: Layout = record._layout
    parts: list[dict[str, Any]] = [
        {
            name: (v.dims, values_of(record, v), _about(record, v))
            for name, v in variables_of(arrays, record).items()
            if getattr(record, v.field) is not None
        }
        for arrays in (layout.coords, layout.variables)
    ]
    coords, variables = parts
    dims = {dim for part in parts for dims, _, _ in part.values() for dim in dims}
    names = names_of(record)
    if any("{cells}" in array.dims for array in layout.variables.values()):
        for j, (name, c) in enumerate(zip(names["states"], record.coordinates, strict=True)):
            own = record.initial_conditions[..., j] if record.grid is None else record.grid.axis(j)
            coords[name] = (names["cells"].split() if record.grid is None else name, own, coordinate_attributes(c))
    if "coordinate" in dims:
        coords["coordinate"] = ("coordinate", np.array([c.name for c in record.coordinates], object))
    attributes = about(record, layout.title.format(record))
    for field, (name, _) in attribute_fields(record.__class__).items():
        if getattr(record, field) is not None:
            attributes[name] = encoded(getattr(record, field))
    return xarray_package().Dataset(variables, coords, attributes)


def _about(record: Any, variable: Variable) -> dict[str, Any]:
    array = variable.about
    if variable.place is not None:
        return coordinate_attributes(record.coordinates[variable.place])
    found = {"long_name": array.about.format(record), "units": array.unit, "comment": array.comment}
    found = {name: text for name, text in found.items() if text}
    if not array.flags:
        return found
    kind = values_of(record, variable).dtype
    if isinstance(array.flags, str):
        return found | flags(getattr(record, array.flags), kind)
    return found | enum_flags(array.flags, kind)


@_converted.register
def _(result: Basins) -> Any:
    found = dataset_of(result)
    if result.point_map is not None:
        found.attrs["map_period"] = result.point_map.period
    parts = [result.fractions[k] for k in range(len(result.attractors))]
    columns = {name: np.array([getattr(s, name) for s in parts], kind) for name, kind in _COLUMNS.items()}
    labels = range(len(result.attractors))
    return _with_attractors(found, attractor_group(result.attractors, labels, result.coordinates, **columns))


@_converted.register
def _(result: Certificate) -> Any:
    tree = _converted(result.basins)
    evidence = {"long_name": "evidence for the label", **enum_flags(Evidence, np.uint8)}
    tree = tree.assign(evidence=xarray_package().Variable(tree["labels"].dims, result.evidence, evidence))
    tree.attrs |= {
        "record": "Certificate",
        "recomputed": result.redone,
        "changed": result.changed,
        "wrong_95_percent": np.array(result.wrong),
        "audit": encoded(result.audit),
        "cost_of_certificate": encoded(result.cost),
    }
    return tree


@_converted.register
def _(result: BasinContinuation) -> Any:
    found = dataset_of(result).assign_attrs(total=result.total)
    given = result.initial_conditions
    if isinstance(given, CellGrid):
        found.attrs["grid"] = encoded(given)
    else:
        axes = [f"initial_condition_{j}" for j in range(given.ndim - 1)]
        found["initial_conditions"] = ((*axes, "state"), given, {"long_name": "initial conditions"})
    here = [(k, label, a) for k, there in enumerate(result.attractors) for label, a in sorted(there.items())]
    places = np.array([k for k, _, _ in here], np.int64)
    labels, attractors = [label for _, label, _ in here], [a for _, _, a in here]
    columns = {"parameter_value": result.values[places], "value_number": places}
    return _with_attractors(found, attractor_group(attractors, labels, result.coordinates, **columns))


def _with_attractors(root: Any, group: Any) -> Any:
    return xarray_package().DataTree.from_dict({"/": root, "/attractors": group})


@_converted.register
def _(result: StabilityMap) -> Any:
    sides = (result.rows, result.columns)
    points = {name: np.concatenate([getattr(side, name) for side in sides]) for name in BOUNDARY}
    found, (x, y) = dataset_of(result), variable_names(result.parameters)
    about_refined = {"long_name": "parameter in which the point is refined", **flags({0: x, 1: y}, np.int8)}
    along = "boundary"
    found = found.assign_coords({f"boundary_{n}": (along, points[k]) for n, k in ((x, "x"), (y, "y"))})
    found["crossing"] = (along, points["crossing"], enum_flags(Crossing, points["crossing"].dtype))
    found["below"], found["above"] = (along, points["below"]), (along, points["above"])
    found["refined"] = (along, np.repeat(np.array([0, 1], np.int8), list(map(len, sides))), about_refined)
    return found


@_converted.register(Branch)
@_converted.register(BifurcationCurve)
@_converted.register(CircleBranch)
@_converted.register(ConnectionBranch)
@_converted.register(TangencyCurve)
def _(result: Branch | BifurcationCurve | CircleBranch | ConnectionBranch | TangencyCurve) -> Any:
    columns = columns_of(result)
    names = variable_names(columns, fixed=_ROWS)
    variables = {
        name: (_ROWS, np.asarray(values, object if isinstance(values, list) else None))
        for name, values in zip(names, columns.values(), strict=True)
    }
    ends = {} if isinstance(result, CircleBranch) else {"ends": ", ".join(result.ends)}
    if isinstance(result, CircleBranch | TangencyCurve):
        ends["state_variables"] = encoded(result.coordinates)
    coords: dict[str, Any] = {}
    if isinstance(result, Branch | BifurcationCurve):
        coords, further = solutions_of(result)
        ends |= further
    if isinstance(result, BifurcationCurve):
        ends["kind"] = str(result.kind)
    return xarray_package().Dataset(variables, coords, about(result, type(result).__name__, **ends))
