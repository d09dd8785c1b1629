"""Branches and curves of bifurcations as coordinates beside their tables, and rebuilt of them."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from typing import Any

import numpy as np

from .._lib.arrays import Complexes, Floats
from .._lib.checkpoint import plain
from .._lib.checks import warn_caller
from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.branch import Bifurcation, Branch, BranchPart
from ..bifurcations.kinds import BifurcationKind
from ..bifurcations.period_measures import OrbitFunction
from ..bifurcations.singular_orbits import SingularOrbits
from ..maps.coordinates import wrap
from ..maps.grazing import GRAZING, grazing_distance
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from ..orbits.arclength import SolutionPoint, tangent_of
from ..orbits.orbit_equations import OrbitProblem
from ..orbits.shooting import ShootingProblem

_NUMBERS = ("value", "before", "after", "place")
_LOOKS = 5  # orbits of each part that are compared with a map
_OFF, _OTHER = 1e-6, 1e-4  # scaled distance from solutions, and relative change of multipliers, that are rounding
_AGAIN = "locate them again with the method with_zeros of what from_xarray returns"


class OtherMapError(ValueError):
    """A map that is not the one of a branch or curve."""


def solutions_of(result: Branch | BifurcationCurve) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return coordinates and attributes from which a branch or curve is rebuilt."""
    if isinstance(result, Branch):
        names, origin = [result.parameter], None
        parts = [(part.problem, part.unknowns) for part in result._parts]
    else:
        problem = result._problem
        if not isinstance(problem, SingularOrbits):
            raise ValueError(
                f"result={result!r}: curves of functions are not rebuilt of arrays, and are not written; write the "
                "branch and continue its zero again, or take the values of the curve with to_dataframe()"
            )
        names, origin = [*result.parameters], problem.origin
        parts = [(problem.orbits, np.array([p.unknowns for p in result._places]) * problem.orbits.scale)]
    coords: dict[str, Any] = {
        "parameter_values": (("point", "parameter"), result.values.reshape(len(result.values), -1)),
        "multipliers": (("part", "point", "multiplier"), _split(result.multipliers)),
    }
    for k, (equations, unknowns) in enumerate(parts):
        coords[f"unknowns_{k}"] = ((f"point_{k}", f"unknown_{k}"), unknowns)
        coords[f"scale_{k}"] = (f"unknown_{k}", equations.scale)
    if origin is not None:
        coords["origin"] = ("unknown_0", origin)
    if isinstance(result, Branch) and result.bifurcations:
        rows = [_row(b, [problem is b._problem for problem, _ in parts].index(True)) for b in result.bifurcations]
        table = np.full((len(rows), max(map(len, rows))), np.nan)
        for into, row in zip(table, rows, strict=True):
            into[: len(row)] = row
        coords["bifurcations"] = (("bifurcation", "number"), table)
        coords["bifurcation_kinds"] = ("bifurcation", np.array([str(b.kind) for b in result.bifurcations], object))
    divisions = [p.divisions if isinstance(p, ShootingProblem) else 0 for p, _ in parts]
    further = {
        "params": json.dumps(plain(result.point_map.params)),
        "state_variables": json.dumps([asdict(c) for c in result.point_map.coordinates]),
        "parameters": json.dumps(names),
        "orbit_period": result.period,
        "segments": json.dumps(divisions),
        "bifurcation_count": len(result.bifurcations) if isinstance(result, Branch) else 0,
    }
    functions = dict(sorted((zero.name, zero.function) for zero in result.zeros))
    own = [name for name, function in functions.items() if callable(function.quantity)]
    named = {n: [f.quantity, f.measure, f.value, f.extremum] for n, f in functions.items() if n not in own}
    further["functions"] = json.dumps(plain(named))
    left = {"functions_left_out": json.dumps(own)} if own else {}
    if own:
        warn_caller(f"zeros of the functions {own} are left out, whose code is not written: {_AGAIN}")
    return coords, {**further, "solutions_sha256": _digest(coords, further), **left}


def _digest(coords: dict[str, Any], further: dict[str, Any]) -> str:
    digest = hashlib.sha256(json.dumps(further, sort_keys=True).encode())
    for name, (_, values) in sorted(coords.items()):
        digest.update(f"{name}{values.shape}".encode())
        digest.update(repr(values.tolist()).encode() if values.dtype == object else values.astype("<f8").tobytes())
    return digest.hexdigest()


def rebuilt(read: Any, point_map: PointMap | None) -> Branch | BifurcationCurve:
    """Return the branch or curve of arrays that are read, with the zeros of functions that are named there."""
    result = _without_zeros(read, point_map)
    functions = {name: OrbitFunction(*given) for name, given in read.json("functions").items()}
    if "functions_left_out" in read.attributes:
        warn_caller(f"zeros of the functions {read.json('functions_left_out')} were not written: {_AGAIN}")
    return result.with_zeros(functions) if functions else result


def _without_zeros(read: Any, point_map: PointMap | None) -> Branch | BifurcationCurve:
    if point_map is None:
        raise OtherMapError("point_map=None: give the map of the branch or curve")
    for what, own, other in (
        ("state variables", point_map.coordinates, read.coordinates),
        ("parameters", set(point_map.params), set(read.json("params"))),
    ):
        if own != other:
            raise OtherMapError(f"point_map={point_map!r}: it has other {what} than the map of the branch or curve")
    exact = point_map.without_table.with_params(**read.json("params"))
    names, period = tuple(read.json("parameters")), int(read.attributes["orbit_period"])
    swept, problems, unknowns = swept_map(exact, *names), list[OrbitProblem](), list[Floats]()
    for k, count in enumerate(read.json("segments")):
        common = exact, swept, period, read.array(f"scale_{k}")
        parts = swept.specified.parts(count) if count else None
        problems.append(OrbitProblem(*common) if parts is None else ShootingProblem(*common, parts))
        unknowns.append(read.array(f"unknowns_{k}"))
        if count and parts is None:
            raise OtherMapError(f"point_map={point_map!r}: its orbits cannot be divided into segments, as these are")
    firsts = [0, *np.cumsum([len(u) - 1 for u in unknowns]).tolist()]
    values, (real, imag) = read.array("parameter_values"), read.array("multipliers")
    factors = real + 1j * imag
    for first, equations, block in zip(firsts, problems, unknowns, strict=False):
        _require_orbits(point_map, names, equations, block, factors[first:])
    each = [p.once(u) for p, block in zip(problems, unknowns, strict=True) for u in block[:-1]]
    states = np.array([*each, problems[-1].once(unknowns[-1][-1])])
    before, after = read.attributes["ends"].split(", ")
    points = wrap(states[:, : exact.dimension], exact.coordinates)
    if len(names) == 1:
        found: list[Bifurcation] = []
        if read.attributes["bifurcation_count"]:
            kinds, rows = read.tree["bifurcation_kinds"].values, read.array("bifurcations")
            found = [_bifurcation(str(kind), row, problems) for kind, row in zip(kinds, rows, strict=True)]
        pieces = tuple(BranchPart(*piece) for piece in zip(firsts, problems, unknowns, strict=False))
        return Branch(names[0], period, values[:, 0], points, factors, tuple(found), (before, after), exact, pieces)
    kind = BifurcationKind(read.attributes["kind"])
    problem, scaled = SingularOrbits(problems[0], kind, read.array("origin")), unknowns[0] / problems[0].scale
    places = []
    for k, place in enumerate(scaled):
        slopes, chord = problem(place)[1], scaled[min(k + 1, len(scaled) - 1)] - scaled[max(k - 1, 0)]
        along = tangent_of(slopes, chord)
        places.append(SolutionPoint(place, slopes, chord if along is None else along))
    return BifurcationCurve(kind, names, values, points, factors, (before, after), problem, tuple(places))


def _require_orbits(
    point_map: PointMap, names: tuple[str, ...], problem: OrbitProblem, unknowns: Floats, multipliers: Complexes
) -> None:
    """Refuse a map of which some of the solutions (n, ...) are no orbits, or orbits with other multipliers.

    Along a direction in which derivatives are large a residual is as large a multiple of the distance from a solution.
    """
    for k in np.unique(np.linspace(0, min(len(unknowns), len(multipliers)) - 1, _LOOKS).astype(int)).tolist():
        place = unknowns[k] / problem.scale
        residual, slopes = problem(place)
        where = ", ".join(f"{n}={v:.6g}" for n, v in zip(names, unknowns[k, -len(names) :].tolist(), strict=True))
        remedy = "give the map of the branch or curve, with the same formulas"
        apart = np.inf
        if np.isfinite(residual).all() and np.isfinite(slopes).all():
            left, sizes, _ = np.linalg.svd(slopes, full_matrices=False)
            apart = float(np.linalg.norm(left.T @ residual / np.maximum(sizes, 1.0)))
        if not apart <= _OFF:
            raise OtherMapError(
                f"point_map={point_map!r}: what is stored is no orbit of it; at {where} it fails to close by "
                f"{apart:.2g} of its size: {remedy}"
            )
        if grazing_distance(problem.swept, problem.once(unknowns[k]), problem.period) <= GRAZING:
            continue  # an orbit that grazes has no multipliers
        own, found = multipliers[k], problem.multipliers(SolutionPoint(place, slopes, place))
        size = max(1.0, float(np.abs(own).max()))
        other = float(np.abs(np.poly(found / size) - np.poly(own / size)).max())
        if not other <= _OTHER:
            raise OtherMapError(
                f"point_map={point_map!r}: at {where} the orbit has the multipliers {found.tolist()} in place of "
                f"{own.tolist()}: {remedy}"
            )


def _split(values: Complexes) -> Floats:
    return np.stack([values.real, values.imag])


def _row(b: Bifurcation, part: int) -> Floats:
    direction = np.full_like(b._unknowns, np.nan) if b._branch_direction is None else b._branch_direction
    numbers = [part, *(getattr(b, name) for name in _NUMBERS)]
    return np.concatenate([numbers, b.point, *_split(b.multipliers), b._unknowns, b._along, direction])


def _bifurcation(kind: str, row: Floats, problems: list[OrbitProblem]) -> Bifurcation:
    problem = problems[int(row[0])]
    d, n = problem.dimension, len(problem.scale)
    ends = np.cumsum([1 + len(_NUMBERS), d, d, d, n, n, n])
    (_, value, *whole), point, real, imag, unknowns, along, direction = np.split(row, ends)[:-1]
    given = {name: int(number) for name, number in zip(_NUMBERS[1:], whole, strict=True)}
    return Bifurcation(
        kind=BifurcationKind(kind), value=float(value), point=point, multipliers=real + 1j * imag, **given,
        _unknowns=unknowns, _along=along, _problem=problem,
        _branch_direction=None if np.isnan(direction).any() else direction,
    )  # fmt: skip
