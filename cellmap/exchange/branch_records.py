"""Branches and curves of bifurcations as coordinates beside their tables, and rebuilt of them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.checkpoint import plain
from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.branch import Bifurcation, Branch, BranchPart
from ..bifurcations.kinds import BifurcationKind
from ..bifurcations.singular_orbits import SingularOrbits
from ..maps.coordinates import wrap
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from ..orbits.arclength import SolutionPoint, tangent_of
from ..orbits.orbit_equations import OrbitProblem
from ..orbits.shooting import ShootingProblem

_NUMBERS = ("value", "before", "after", "place")


def solutions_of(result: Branch | BifurcationCurve) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return coordinates and attributes from which a branch or curve is rebuilt."""
    if isinstance(result, Branch):
        names, origin = [result.parameter], None
        parts = [(part.problem, part.unknowns) for part in result._parts]
    else:
        problem = result._problem
        names, origin = [*result.parameters], problem.origin if isinstance(problem, SingularOrbits) else None
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
    return coords, {
        "params": json.dumps(plain(result.point_map.params)),
        "parameters": json.dumps(names),
        "orbit_period": result.period,
        "segments": json.dumps(divisions),
    }


def rebuilt(read: Any, point_map: PointMap | None) -> Branch | BifurcationCurve:
    """Return the branch or curve of arrays that are read."""
    if point_map is None:
        raise ValueError("point_map=None: give the map of the branch or curve")
    exact = point_map.without_table.with_params(**read.json("params"))
    names, period = tuple(read.json("parameters")), int(read.attributes["orbit_period"])
    swept, problems, unknowns = swept_map(exact, *names), list[OrbitProblem](), list[NDArray[np.float64]]()
    for k, count in enumerate(read.json("segments")):
        common = exact, swept, period, read.array(f"scale_{k}")
        parts = swept.specified.parts(count) if count else None
        problems.append(OrbitProblem(*common) if parts is None else ShootingProblem(*common, parts))
        unknowns.append(read.array(f"unknowns_{k}"))
    firsts = [0, *np.cumsum([len(u) - 1 for u in unknowns]).tolist()]
    each = [p.once(u) for p, block in zip(problems, unknowns, strict=True) for u in block[:-1]]
    states = np.array([*each, problems[-1].once(unknowns[-1][-1])])
    values, (real, imag) = read.array("parameter_values"), read.array("multipliers")
    before, after = read.attributes["ends"].split(", ")
    points, factors = wrap(states[:, : exact.dimension], exact.coordinates), real + 1j * imag
    if len(names) == 1:
        found: list[Bifurcation] = []
        if "bifurcations" in read.tree.variables:
            kinds, rows = read.tree["bifurcation_kinds"].values, read.array("bifurcations")
            found = [_bifurcation(str(kind), row, problems) for kind, row in zip(kinds, rows, strict=True)]
        pieces = tuple(BranchPart(*piece) for piece in zip(firsts, problems, unknowns, strict=False))
        return Branch(names[0], period, values[:, 0], points, factors, tuple(found), (before, after), exact, pieces)
    if "origin" not in read.tree.variables:
        raise ValueError("curves of functions are not rebuilt: continue the zero of the branch again")
    kind = BifurcationKind(read.attributes["kind"])
    problem, scaled = SingularOrbits(problems[0], kind, read.array("origin")), unknowns[0] / problems[0].scale
    places = []
    for k, place in enumerate(scaled):
        slopes, chord = problem(place)[1], scaled[min(k + 1, len(scaled) - 1)] - scaled[max(k - 1, 0)]
        along = tangent_of(slopes, chord)
        places.append(SolutionPoint(place, slopes, chord if along is None else along))
    return BifurcationCurve(kind, names, values, points, factors, (before, after), problem, tuple(places))


def _split(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.stack([values.real, values.imag])


def _row(b: Bifurcation, part: int) -> NDArray[np.float64]:
    direction = np.full_like(b._unknowns, np.nan) if b._branch_direction is None else b._branch_direction
    numbers = [part, *(getattr(b, name) for name in _NUMBERS)]
    return np.concatenate([numbers, b.point, *_split(b.multipliers), b._unknowns, b._along, direction])


def _bifurcation(kind: str, row: NDArray[np.float64], problems: list[OrbitProblem]) -> Bifurcation:
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
