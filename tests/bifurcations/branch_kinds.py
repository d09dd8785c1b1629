"""Kinds of bifurcations of a branch."""

from __future__ import annotations

from cellmap.bifurcations import BifurcationKind, Branch

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
PITCHFORK, TRANSCRITICAL = BifurcationKind.PITCHFORK, BifurcationKind.TRANSCRITICAL
NEIMARK_SACKER = BifurcationKind.NEIMARK_SACKER


def kinds(branch: Branch) -> list[BifurcationKind]:
    return [b.kind for b in branch.bifurcations]
