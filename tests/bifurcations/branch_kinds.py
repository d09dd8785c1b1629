"""Kinds of bifurcations and ends of a branch."""

from cellmap.bifurcations import BifurcationKind, CodimensionTwoKind

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
PITCHFORK, TRANSCRITICAL = BifurcationKind.PITCHFORK, BifurcationKind.TRANSCRITICAL
NEIMARK_SACKER, DEGENERATE = BifurcationKind.NEIMARK_SACKER, BifurcationKind.DEGENERATE
POINT = CodimensionTwoKind
LEFT, BOTH_LEFT = ("left the interval",) * 2, ("left the intervals",) * 2
"""Ends of a branch, and of a curve, that go on beyond their intervals."""


def kinds(branch):
    return [b.kind for b in branch.bifurcations]


def values(branch, *chosen):
    """Return the values of the bifurcations, of some kinds if such are given."""
    return [b.value for b in branch.bifurcations if not chosen or b.kind in chosen]
