"""Results from the labelled arrays of xarray that were made of them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import shown
from ..attractors.labels import LABEL_NAMES
from ..basins.certification.certificate import Certificate, Evidence
from ..basins.continuation_record import BasinContinuation
from ..basins.record import Basins
from ..basins.verification import Verification
from ..bifurcations.diagram import BifurcationDiagram
from ..bifurcations.equilibrium_stability import Boundary, StabilityMap
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost
from ..maps.point_map import PointMap
from ..orbits.exponent_fields import ExponentField
from .attractor_group import attractors_of
from .branch_records import OtherMapError, rebuilt
from .conventions import variable_names
from .datasets import to_xarray
from .optional import xarray_package


def from_xarray(tree: Any, point_map: PointMap | None = None) -> Any:
    """Return the result from which :func:`to_xarray` made a tree or Dataset, with the same bits.

    Parameters
    ----------
    tree : xarray.DataTree or xarray.Dataset
        What `to_xarray` returned, or ``xarray.open_datatree`` or ``xarray.open_dataset`` read from a netCDF file of it.
    point_map : PointMap, optional
        The map of a branch or curve, which is needed, or of a diagram, for its :meth:`BifurcationDiagram.measure`.

    Returns
    -------
    Basins, Certificate, BasinContinuation, BifurcationDiagram, StabilityMap, ExponentField, Branch or BifurcationCurve
        Branches and curves are continued like those from which the arrays came, and zeros of quantities that have a
        name or number are located again; those of functions ``f(t, x, p)``, whose code is not written, are left out
        with a warning: locate them with :meth:`Branch.with_zeros`.  Basins come without their map, as from a file:
        :func:`rebuild_map` rebuilds it.

    Raises
    ------
    ModuleNotFoundError
        If xarray is not installed.
    TypeError
        For anything else than a tree or Dataset.
    ValueError
        For one that `to_xarray` of this version has not made of such a result, or from which a part was removed; for
        a map that some of the stored orbits do not satisfy, to rounding, with their multipliers.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> wells = discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"), "two wells")
    >>> basins = find_basins(wells, CellGrid((-1, -1), (1, 1), (20, 10)))
    >>> same = from_xarray(basins.to_xarray())
    >>> bool((same.labels == basins.labels).all()), same.attractors[0].verified
    (True, True)
    """
    xarray = xarray_package()
    if not isinstance(tree, xarray.DataTree | xarray.Dataset):
        raise TypeError(f"tree={shown(tree)}: give a DataTree or a Dataset of xarray, as to_xarray returns it")
    kind = tree.attrs.get("record")
    if not isinstance(kind, str) or kind not in (*_READERS, *_CURVES):
        raise ValueError(
            f"tree has the attribute record={shown(kind)}: give what to_xarray of this version makes of one of "
            f"{', '.join((*_READERS, *_CURVES))}"
        )
    try:
        read = _Read(tree)
        result = rebuilt(read, point_map) if kind in _CURVES else _READERS[kind](read)
        changed = _difference(tree, to_xarray(result))
    except OtherMapError:
        raise
    except (KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        raise ValueError(
            f"tree is not what to_xarray made of {kind} ({type(error).__name__}: {error}): give all of it"
        ) from error
    if changed is not None:
        raise ValueError(
            f"tree has another {changed} than to_xarray gives {kind} of these values: give the tree as it was made, "
            "without selection, in the same sequence"
        )
    return replace(result, point_map=point_map) if isinstance(result, BifurcationDiagram) else result


def _difference(given: Any, again: Any) -> str | None:
    """Return the name of what a tree has otherwise than the one that is made of its result."""
    groups = [""] if not hasattr(again, "children") else ["", *again.children]
    for group in groups:
        mine, other = (tree[group] if group else tree for tree in (given, again))
        for name, variable in other.variables.items():
            if name not in mine.variables or mine[name].dims != variable.dims:
                return str(name)
            if not _same(mine[name].values, variable.values):
                return str(name)
    return next((k for k, v in again.attrs.items() if k != "source" and not _same(given.attrs.get(k), v)), None)


def _same(one: Any, other: Any) -> bool:
    """Tell whether two arrays, numbers or texts are the same; NaN is the same as NaN."""
    a, b = np.asarray(one), np.asarray(other)
    return np.array_equal(a, b, equal_nan=a.dtype.kind in "fc" and b.dtype.kind in "fc")


class _Read:
    """The variables and attributes of a tree."""

    def __init__(self, tree: Any) -> None:
        self.tree, self.attributes = tree, tree.attrs

    def array(self, name: str, kind: Any = np.float64, shape: tuple[int, ...] | None = None) -> NDArray[Any]:
        """Return the values of a variable in memory, which have a type and a shape."""
        values = np.ascontiguousarray(self.tree[name].values).reshape(self.tree[name].shape)
        if values.dtype != kind or (shape is not None and values.shape != shape):
            raise ValueError(f"{name} is {values.dtype} of shape {values.shape}")
        return values

    def json(self, name: str) -> Any:
        return json.loads(self.attributes[name])

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        return tuple(Coordinate(**c) for c in self.json("state_variables"))

    @property
    def grid(self) -> CellGrid | None:
        return CellGrid(**self.json("grid")) if "grid" in self.attributes else None

    @property
    def params(self) -> Mapping[str, float]:
        return {name: float(value) for name, value in self.json("params").items()}

    def cost(self, name: str = "cost") -> Cost:
        return Cost(**self.json(name))


def _basins(read: _Read) -> Basins:
    coordinates, grid = read.coordinates, read.grid
    names = variable_names(c.name for c in coordinates)
    initial_conditions = None if grid is not None else np.stack([read.array(name) for name in names], axis=-1)
    shape = grid.shape if initial_conditions is None else initial_conditions.shape[:-1]  # type: ignore[union-attr]
    attractors = tuple(attractors_of(read.tree["attractors"].to_dataset(), coordinates))
    labels = read.array("labels", np.int16, shape)
    if labels.size and not min(LABEL_NAMES) <= labels.min() <= labels.max() < len(attractors):
        raise ValueError(f"labels are not between {min(LABEL_NAMES)} and {len(attractors) - 1}")
    times = read.array("settling_time", np.int32, shape)
    if times.size and times.min() < -1:
        raise ValueError(f"settling_time is {times.min()}")
    return Basins(
        labels=labels,
        attractors=attractors,
        settling_time=times,
        grid=grid,
        initial_conditions=initial_conditions,
        name=str(read.attributes["system"]),
        params=read.params,
        coordinates=coordinates,
        settings=read.json("settings"),
        inaccurate=int(read.attributes["inaccurate"]),
        undecided=Counter(read.json("undecided")),
        cost=read.cost(),
    )


def _certificate(read: _Read) -> Certificate:
    basins = _basins(read)
    low, high = np.asarray(read.attributes["wrong_95_percent"]).tolist()
    evidence = read.array("evidence", np.uint8, basins.labels.shape)
    if evidence.size and evidence.max() > max(Evidence):
        raise ValueError(f"evidence is {evidence.max()}")
    return Certificate(
        basins=basins,
        evidence=evidence,
        redone=int(read.attributes["recomputed"]),
        changed=int(read.attributes["changed"]),
        audit=Verification(**read.json("audit")),
        wrong=(low, high),
        cost=read.cost("cost_of_certificate"),
    )


def _continuation(read: _Read) -> BasinContinuation:
    parameter, coordinates, grid = str(read.attributes["parameter"]), read.coordinates, read.grid
    values = read.array(variable_names([parameter])[0])
    labels = tuple(read.array("label", np.int16).tolist())
    group = read.tree["attractors"].to_dataset()
    attractors: tuple[dict[int, Any], ...] = tuple({} for _ in values)
    rows = zip(group["value_number"].values.tolist(), group["label"].values.tolist(), strict=True)
    for (k, label), attractor in zip(rows, attractors_of(group, coordinates), strict=True):
        attractors[k][label] = attractor
    return BasinContinuation(
        system=str(read.attributes["system"]),
        parameter=parameter,
        values=values,
        labels=labels,
        counts=read.array("counts", np.int64, (len(values), len(labels))),
        attractors=attractors,
        inaccurate=read.array("inaccurate", np.int64, values.shape),
        initial_conditions=read.array("initial_conditions") if grid is None else grid,
        coordinates=coordinates,
        params=read.params,
        settings=read.json("settings"),
        cost=read.cost(),
    )


def _diagram(read: _Read) -> BifurcationDiagram:
    parameter, coordinates = str(read.attributes["parameter"]), read.coordinates
    first, *states = variable_names([parameter, *(c.name for c in coordinates)])
    values = read.array(first)
    directions = tuple(str(d) for d in read.tree["direction"].values)
    both = (len(directions), len(values))
    return BifurcationDiagram(
        system=str(read.attributes["system"]),
        parameter=parameter,
        values=values,
        directions=directions,
        initial_conditions=read.array("initial_condition", shape=(len(directions), len(coordinates))),
        points=np.stack([read.array(name) for name in states], axis=-1),
        status=read.array("status", np.uint8, both),
        restarted=read.array("restarted", np.bool_, both),
        period=read.array("orbit_period", np.int64, both),
        rotation_numbers=read.array("rotation_numbers", shape=(*both, len(coordinates))),
        exponents=read.array("exponents"),
        standard_errors=read.array("exponent_errors"),
        coordinates=coordinates,
        params=read.params,
        settings=read.json("settings"),
    )


def _stability_map(read: _Read) -> StabilityMap:
    first, second = read.json("parameters")
    x, y = variable_names([first, second])
    points = {"x": read.array(f"boundary_{x}"), "y": read.array(f"boundary_{y}")}
    points |= {name: read.array(name, np.int64) for name in ("crossing", "below", "above")}
    side = read.array("refined", np.int8)
    rows, columns = (Boundary(**{name: v[side == k] for name, v in points.items()}) for k in (0, 1))
    shape = (read.tree[y].size, read.tree[x].size)
    return StabilityMap(
        parameters=(first, second),
        x=read.array(x),
        y=read.array(y),
        largest=read.array("largest", shape=shape),
        unstable=read.array("unstable", np.int64, shape),
        status=read.array("status", np.uint8, shape),
        rows=rows,
        columns=columns,
    )


def _exponents(read: _Read) -> ExponentField:
    coordinates, grid = read.coordinates, read.grid
    assert grid is not None
    names = variable_names(c.name for c in coordinates)
    return ExponentField(
        forward=read.array("forward", shape=grid.shape),
        backward=read.array("backward", shape=grid.shape),
        images=np.stack([read.array(f"image_{name}", shape=grid.shape) for name in names], axis=-1),
        periods=int(read.attributes["periods"]),
        period=float(read.attributes["map_period"]),
        grid=grid,
        name=str(read.attributes["system"]),
        params=read.params,
        coordinates=coordinates,
        cost=read.cost(),
    )


_READERS: Mapping[str, Callable[[_Read], Any]] = {
    "Basins": _basins,
    "Certificate": _certificate,
    "BasinContinuation": _continuation,
    "BifurcationDiagram": _diagram,
    "StabilityMap": _stability_map,
    "ExponentField": _exponents,
}
"""What makes a result of a tree, by its class."""

_CURVES = ("Branch", "BifurcationCurve")
