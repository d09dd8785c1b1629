"""Bifurcations of forced systems, along branches and curves, against the numbers of AUTO-07p in tests/reference/."""

import json
from math import cos, pi, sin

import numpy as np
import pytest

from cellmap import ForcedSystem, continue_orbit, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import BifurcationKind, OrbitFunction, continue_bifurcation
from tests.reference.auto import RESULTS, SYSTEMS

NUMBERS = json.loads(RESULTS.read_text(encoding="utf-8"))
TIERS = dict.fromkeys(("two wells", "FitzHugh-Nagumo"), "thorough")
KINDS = {"BRANCH_POINT": "PITCHFORK"}
CLOSE = 1e-6


def point_map(system):
    formula = system.rhs

    def rhs(t, x, p):
        return formula(x, cos(p.w * t), sin(p.w * t), p)

    names = tuple(f"x{k}" for k in range(len(system.guess)))
    return stroboscopic_map(ForcedSystem(rhs, system.params, lambda p: 2 * pi / p.w, names), rtol=1e-12, atol=1e-12)


def branch_of(system):
    exact = point_map(system)
    guess = exact.iterate(system.guess, system.settle).points if system.settle else system.guess
    return continue_orbit(exact, periodic_orbit(exact, guess), system.free, *system.interval)


def compared(branch, rows):
    """Hold bifurcations of a branch against numbers, kind by kind."""
    for row in rows:
        kind = BifurcationKind[KINDS.get(row["kind"], row["kind"])]
        found = [b.value for b in branch.of_kind(kind)]
        assert min(abs(v - row[branch.parameter]) for v in found) < CLOSE, (row, found)


@pytest.mark.parametrize("name", [pytest.param(n, marks=getattr(pytest.mark, TIERS.get(n, "slow"))) for n in SYSTEMS])
def test_bifurcations_of_branches_and_curves(name):
    """AUTO stops beside the values of the second parameter by up to 1e-7: the curves are looked at where it does."""
    system, branch, numbers = SYSTEMS[name], branch_of(SYSTEMS[name]), NUMBERS["systems"][name]
    compared(branch, numbers["along"])
    compared(branch, [row for row in NUMBERS["missed"] if row["system"] == name])
    for curve in system.curves:
        rows = [r for r in numbers["curves"] if (r["kind"], r["from"]) == (curve.kind, curve.number)]
        value = [r[system.free] for r in numbers["along"] if r["kind"] == curve.kind][curve.number]
        first = min(branch.of_kind(BifurcationKind[curve.kind]), key=lambda b: abs(b.value - value))
        found = continue_bifurcation(branch, first, curve.second, curve.first, curve.range, step=0.03)
        for row in rows:
            line = OrbitFunction(lambda t, x, p, n=curve.second: getattr(p, n), None, value=row[curve.second])
            there = [z.orbit.params[system.free] for z in found.with_zeros({"there": line}).zeros]
            assert np.abs(np.subtract(there, row[system.free])).min() < CLOSE, (row, there)
