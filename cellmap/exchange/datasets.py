"""Results as labelled arrays of xarray, with the attributes of the CF conventions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from functools import singledispatch
from typing import Any

import numpy as np

from .._lib.checks import shown
from ..attractors.labels import LABEL_NAMES
from ..basins.certification.certificate import Certificate, Evidence
from ..basins.continuation_record import BasinContinuation
from ..basins.record import Basins
from ..bifurcations.atlas_record import AttractorAtlas
from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.branch import Branch
from ..bifurcations.circle_branches import CircleBranch
from ..bifurcations.connecting_branches import ConnectionBranch, TangencyCurve
from ..bifurcations.crossings import Crossing
from ..bifurcations.diagram import BifurcationDiagram
from ..bifurcations.equilibrium_stability import StabilityMap
from ..bifurcations.period_measures import OrbitFunction, Quantity
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Status
from ..orbits.exponent_fields import ExponentField
from .attractor_group import attractor_group
from .branch_records import solutions_of
from .conventions import about, coordinate_attributes, enum_flags, flags, variable_names
from .optional import xarray_package
from .tables import columns_of, function_columns

_ROWS = "point"  # dimension of the rows of tables


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
    more = function_columns(result, functions, {*found.variables, *found.dims} if functions else set())
    dims = ("branch", *variable_names([result.parameter])) if isinstance(result, BifurcationDiagram) else _ROWS
    return found.assign({name: (dims, values) for name, values in more.items()}) if more else found


@singledispatch
def _converted(result: Any) -> Any:
    raise TypeError(
        f"result={shown(result)}: give Basins, a Certificate, a BasinContinuation, a BifurcationDiagram, a "
        "StabilityMap, an AttractorAtlas, an ExponentField, a Branch or a curve"
    )


@_converted.register
def _(result: Basins) -> Any:
    return _basins_tree(result, {}, {})


@_converted.register
def _(result: Certificate) -> Any:
    evidence = {"long_name": "evidence for the label", **enum_flags(Evidence, np.uint8)}
    more = {
        "record": "Certificate",
        "recomputed": result.redone,
        "changed": result.changed,
        "wrong_95_percent": np.array(result.wrong),
        "audit": json.dumps(asdict(result.audit)),
        "cost_of_certificate": json.dumps(asdict(result.cost)),
    }
    return _basins_tree(result.basins, {"evidence": (result.evidence, evidence)}, more)


def _basins_tree(basins: Basins, more: dict[str, tuple[Any, dict[str, Any]]], attributes: dict[str, Any]) -> Any:
    names = variable_names(c.name for c in basins.coordinates)
    described = [coordinate_attributes(c) for c in basins.coordinates]
    if basins.grid is not None:
        dims = tuple(names)
        coords = {n: (n, basins.grid.axis(j), described[j]) for j, n in enumerate(names)}
    else:
        states = np.asarray(basins.initial_conditions)
        axes = states.ndim - 1
        dims = ("initial_condition",) if axes == 1 else tuple(f"initial_condition_{j}" for j in range(axes))
        coords = {n: (dims, states[..., j], described[j]) for j, n in enumerate(names)}  # type: ignore[misc]
    labels = {**dict(enumerate(basins.label_name(k) for k in range(len(basins.attractors)))), **LABEL_NAMES}
    arrays: dict[str, tuple[Any, dict[str, Any]]] = {
        "labels": (basins.labels, {"long_name": "label of the attractor", **flags(labels, basins.labels.dtype)}),
        "settling_time": (
            basins.settling_time,
            {"long_name": "settling time in steps of the map", "comment": "-1 without attractor"},
        ),
        **more,
    }
    root = about(basins, f"Basins of attraction of {basins.name}", inaccurate=basins.inaccurate, **attributes)
    if basins.point_map is not None:
        root["map_period"] = basins.point_map.period
    parts = [basins.fractions[k] for k in range(len(basins.attractors))]
    group = attractor_group(
        basins.attractors,
        range(len(basins.attractors)),
        basins.coordinates,
        fraction=np.array([s.fraction for s in parts]),
        standard_error=np.array([s.standard_error for s in parts]),
        count=np.array([s.count for s in parts], np.int64),
    )
    variables = {name: (dims, values, attrs) for name, (values, attrs) in arrays.items()}
    return _tree(variables, coords, root, group)


@_converted.register
def _(result: BasinContinuation) -> Any:
    (parameter,) = variable_names([result.parameter])
    meanings = {label: result.label_name(label) for label in result.labels}
    codes = np.array(result.labels, np.int16)
    both = (parameter, "label")
    variables = {
        "counts": (both, result.counts, {"long_name": "initial conditions with the label", "units": "1"}),
        "fractions": (both, result.fractions, {"long_name": "fraction of the initial conditions", "units": "1"}),
        "standard_errors": (both, result.standard_errors, {"long_name": "standard error of the fraction"}),
        "present": (both, result.present, {"long_name": "the attractor exists, or the label occurs"}),
        "inaccurate": (parameter, result.inaccurate, {"long_name": "orbits that missed the tolerance"}),
    }
    coords = {
        parameter: (parameter, result.values, {"long_name": result.parameter}),
        "label": ("label", codes, flags(meanings, codes.dtype)),
    }
    found = [(k, label, a) for k, there in enumerate(result.attractors) for label, a in sorted(there.items())]
    group = attractor_group(
        [a for _, _, a in found],
        [label for _, label, _ in found],
        result.coordinates,
        parameter_value=result.values[[k for k, _, _ in found]],
        value_number=np.array([k for k, _, _ in found], np.int64),
    )
    given = result.initial_conditions
    if isinstance(given, CellGrid):
        more = {"grid": json.dumps(asdict(given))}
    else:
        more = {}
        axes = [f"initial_condition_{j}" for j in range(given.ndim - 1)]
        variables["initial_conditions"] = ((*axes, "state"), given, {"long_name": "initial conditions"})
    root = about(result, f"Basin fractions of {result.system}", total=result.total, parameter=result.parameter, **more)
    return _tree(variables, coords, root, group)


def _tree(variables: Any, coords: Any, attributes: dict[str, Any], group: Any) -> Any:
    xarray = xarray_package()
    root = xarray.Dataset(variables, coords=coords, attrs=attributes)
    return xarray.DataTree.from_dict({"/": root, "/attractors": group})


@_converted.register
def _(result: BifurcationDiagram) -> Any:
    parameter, *states = variable_names([result.parameter, *(c.name for c in result.coordinates)])
    both = ("branch", parameter)
    variables = {
        **{
            name: ((*both, "step"), result.points[..., j], coordinate_attributes(c))
            for j, (name, c) in enumerate(zip(states, result.coordinates, strict=True))
        },
        "status": (both, result.status, {"long_name": "status of the orbit", **enum_flags(Status, np.uint8)}),
        "restarted": (both, result.restarted),
        "orbit_period": (both, result.period, {"long_name": "period in steps of the map; 0 without one"}),
        "chaotic": (both, result.chaotic),
        "rotation_numbers": ((*both, "coordinate"), result.rotation_numbers),
        "exponents": ((*both, "exponent"), result.exponents, {"long_name": "Lyapunov exponents per step of the map"}),
        "exponent_errors": ((*both, "exponent"), result.standard_errors),
    }
    coords = {
        parameter: (parameter, result.values, {"long_name": result.parameter}),
        "direction": ("branch", np.array(result.directions, object)),
        "coordinate": np.array([c.name for c in result.coordinates], object),
        "initial_condition": (("branch", "coordinate"), result.initial_conditions),
    }
    attributes = about(result, f"Bifurcation diagram of {result.system}", parameter=result.parameter)
    return xarray_package().Dataset(variables, coords=coords, attrs=attributes)


@_converted.register
def _(result: StabilityMap) -> Any:
    x, y = variable_names(result.parameters)
    sides = (result.rows, result.columns)
    fields = ("x", "y", "crossing", "below", "above")
    points = {name: np.concatenate([getattr(side, name) for side in sides]) for name in fields}
    refined = np.repeat(np.array([0, 1], np.int8), list(map(len, sides)))
    variables = {
        "largest": ((y, x), result.largest, {"long_name": "largest modulus of the multipliers", "units": "1"}),
        "unstable": ((y, x), result.unstable, {"long_name": "multipliers outside the unit circle; -1 where unknown"}),
        "status": ((y, x), result.status, enum_flags(Status, np.uint8)),
        "crossing": ("boundary", points["crossing"], enum_flags(Crossing, points["crossing"].dtype)),
        "below": ("boundary", points["below"]),
        "above": ("boundary", points["above"]),
        "refined": (
            "boundary",
            refined,
            {"long_name": "parameter in which the point is refined", **flags({0: x, 1: y}, np.int8)},
        ),
    }
    coords = {
        x: (x, result.x, {"long_name": result.parameters[0]}),
        y: (y, result.y, {"long_name": result.parameters[1]}),
        f"boundary_{x}": ("boundary", points["x"]),
        f"boundary_{y}": ("boundary", points["y"]),
    }
    attributes = about(result, "Stability map", parameters=json.dumps(result.parameters))
    return xarray_package().Dataset(variables, coords=coords, attrs=attributes)


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
    coords: dict[str, Any] = {}
    if isinstance(result, Branch | BifurcationCurve):
        coords, further = solutions_of(result)
        ends |= further
    if isinstance(result, BifurcationCurve):
        ends["kind"] = str(result.kind)
    return xarray_package().Dataset(variables, coords, about(result, type(result).__name__, **ends))


@_converted.register
def _(result: AttractorAtlas) -> Any:
    x, y = variable_names(result.parameters)
    families = range(len(result.families))
    fractions = np.array([result.fraction(k) for k in families]).reshape(len(families), result.y.size, result.x.size)
    variables = {
        "number": ((y, x), result.number, {"long_name": "attractors found", "units": "1"}),
        "fractions": (("family", y, x), fractions, {"long_name": "fraction of the initial conditions", "units": "1"}),
        "escaped": ((y, x), result.escaped, {"long_name": "orbits that terminated"}),
        "undecided": ((y, x), result.undecided, {"long_name": "orbits that neither converged nor are chaotic"}),
    }
    coords = {
        x: (x, result.x, {"long_name": result.parameters[0]}),
        y: (y, result.y, {"long_name": result.parameters[1]}),
        "family": ("family", np.array([family.name for family in result.families], object)),
    }
    return xarray_package().Dataset(variables, coords=coords, attrs=about(result, f"Attractors of {result.system}"))


@_converted.register
def _(result: ExponentField) -> Any:
    names = variable_names(c.name for c in result.coordinates)
    coords = {
        name: (name, result.grid.axis(j), coordinate_attributes(c))
        for j, (name, c) in enumerate(zip(names, result.coordinates, strict=True))
    }
    variables = {
        "forward": (names, result.forward, {"long_name": "forward exponent per step of the map", "units": "1"}),
        "backward": (names, result.backward, {"long_name": "backward exponent per step, at the image", "units": "1"}),
        **{
            f"image_{name}": (names, result.images[..., j], coordinate_attributes(c))
            for j, (name, c) in enumerate(zip(names, result.coordinates, strict=True))
        },
    }
    title = f"Finite-time Lyapunov exponents of {result.name}"
    attributes = about(result, title, periods=result.periods, map_period=result.period)
    return xarray_package().Dataset(variables, coords=coords, attrs=attributes)
