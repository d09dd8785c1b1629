"""Results from the labelled arrays of xarray that were made of them."""

from __future__ import annotations

import importlib
import json
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, replace
from types import NoneType, SimpleNamespace
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import shown
from .._lib.records import Keyed, Layout
from ..attractors.settling.labels import LABEL_NAMES
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
from .attractor_group import attractors_of
from .branch_records import OtherMapError, rebuilt
from .conventions import attribute_fields, decoded, variable_names, variables_of, without_none
from .datasets import BOUNDARY, to_xarray
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
    read_by = _READERS.get(str(kind)) or _by_layout(str(kind))
    if read_by is None:
        raise ValueError(
            f"tree has the attribute record={shown(kind)}: give what to_xarray of this version makes of one of "
            f"{', '.join((*_READERS, 'BifurcationDiagram', 'ExponentField'))}, or another record with a layout"
        )
    try:
        result = read_by(_Read(tree), point_map)
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
        if kind == np.int16 and values.dtype == np.int32:
            kind = np.int32  # labels of more attractors
        if values.dtype != kind or (shape is not None and values.shape != shape):
            raise ValueError(f"{name} is {values.dtype} of shape {values.shape}")
        return values

    def json(self, name: str) -> Any:
        return json.loads(self.attributes[name])

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        return tuple(Coordinate(**c) for c in self.json("state_variables"))

    def record(self, kind: type, /, **given: Any) -> Any:
        """Return a record, by its layout, from what is given of it, the attributes and the variables."""
        attributes = {field: at for field, at in attribute_fields(kind).items() if field not in given}
        for field, (name, hint) in attributes.items():
            missing = name not in self.attributes and NoneType in get_args(hint)
            given[field] = None if missing else decoded(hint, self.attributes[name])
        layout: Layout = kind._layout  # type: ignore[attr-defined]
        known, hints, split = SimpleNamespace(**given), get_type_hints(kind), dict[str, list[NDArray[Any]]]()
        for name, variable in variables_of({**layout.coords, **layout.variables}, known).items():
            field = variable.field
            if field not in hints or field in given:
                continue
            hint = without_none(hints[field])
            if hint is not hints[field] and name not in self.tree.variables:
                given[field] = None
            elif get_origin(hint) is tuple:
                one = get_args(hint)[0]
                values = self.tree[name].values if one is str else self.array(name, np.dtype(one))
                given[field] = tuple(map(one, values.tolist()))
            else:
                over_cells = variable.about.dims == "{cells}"
                array = self.array(name, get_args(get_args(hint)[1])[0], _cells_of(known) if over_cells else None)
                split.setdefault(field, []).append(array)
                if variable.place is None:
                    given[field] = split.pop(field)[0]
        return kind(**given, **{field: np.stack(arrays, axis=-1) for field, arrays in split.items()})


def _cells_of(known: Any) -> tuple[int, ...]:
    grid = getattr(known, "grid", None)
    return tuple(grid.shape) if grid is not None else tuple(known.initial_conditions.shape[:-1])


def _basins(read: _Read, _: Any = None) -> Basins:
    coordinates = read.coordinates
    attractors = tuple(attractors_of(read.tree["attractors"].to_dataset(), coordinates))
    given: dict[str, Any] = {"attractors": attractors, "initial_conditions": None}
    if "grid" not in read.attributes:
        names = variable_names(c.name for c in coordinates)
        given |= {"grid": None, "initial_conditions": np.stack([read.array(name) for name in names], axis=-1)}
    basins: Basins = read.record(Basins, **given)
    labels, times = basins.labels, basins.settling_time
    if labels.size and not min(LABEL_NAMES) <= labels.min() <= labels.max() < len(attractors):
        raise ValueError(f"labels are not between {min(LABEL_NAMES)} and {len(attractors) - 1}")
    if times.size and times.min() < -1:
        raise ValueError(f"settling_time is {times.min()}")
    return basins


def _certificate(read: _Read, _: Any = None) -> Certificate:
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
        cost=Cost(**read.json("cost_of_certificate")),
    )


def _continuation(read: _Read, _: Any = None) -> BasinContinuation:
    in_grid = "grid" in read.attributes
    given = CellGrid(**read.json("grid")) if in_grid else read.array("initial_conditions")
    group = read.tree["attractors"].to_dataset()
    attractors: list[dict[int, Any]] = [{} for _ in range(read.tree["counts"].shape[0])]
    rows = zip(group["value_number"].values.tolist(), group["label"].values.tolist(), strict=True)
    for (k, label), attractor in zip(rows, attractors_of(group, read.coordinates), strict=True):
        attractors[k][label] = attractor
    labels = tuple(read.array("label", np.int16).tolist())
    found: BasinContinuation = read.record(
        BasinContinuation,
        attractors=tuple(Keyed(a, "attractors") for a in attractors),
        initial_conditions=given,
        labels=labels,
    )
    return found


def _stability_map(read: _Read, _: Any = None) -> StabilityMap:
    x, y = variable_names(read.json("parameters"))
    numbers = {"x": read.array(f"boundary_{x}"), "y": read.array(f"boundary_{y}")}
    points = {name: numbers[name] if name in numbers else read.array(name, np.int64) for name in BOUNDARY}
    side = read.array("refined", np.int8)
    rows, columns = (Boundary(**{name: v[side == k] for name, v in points.items()}) for k in (0, 1))
    found: StabilityMap = read.record(StabilityMap, rows=rows, columns=columns)
    return found


_READERS: Mapping[str, Callable[[_Read, PointMap | None], Any]] = {
    "Basins": _basins,
    "Certificate": _certificate,
    "BasinContinuation": _continuation,
    "StabilityMap": _stability_map,
    "Branch": rebuilt,
    "BifurcationCurve": rebuilt,
}
"""What makes a result of a tree that is more than the arrays of its layout, by its class."""


def _by_layout(name: str) -> Callable[[_Read, PointMap | None], Any] | None:
    """Return what reads a public record of a name, where its layout and its attributes are all that it consists of."""
    library = importlib.import_module(__name__.partition(".")[0])
    packages = pkgutil.walk_packages(library.__path__, f"{library.__name__}.")
    for room in (importlib.import_module(package.name) for package in packages if package.ispkg):
        kind: Any = getattr(room, name) if name in getattr(room, "__all__", ()) else None
        layout = getattr(kind, "_layout", None)
        if layout is not None:
            known = {*layout.coords, *layout.variables, *attribute_fields(kind)}
            if all(f.name in known or f.default is not MISSING for f in fields(kind)):
                return lambda read, _: read.record(kind)
    return None
