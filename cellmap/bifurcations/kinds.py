"""Kinds of bifurcations of periodic orbits."""

from __future__ import annotations

from enum import StrEnum


class BifurcationKind(StrEnum):
    """Kinds of bifurcations of periodic orbits in one parameter."""

    FOLD = "fold"
    """Saddle-node: two orbits meet, and the branch turns back."""
    PERIOD_DOUBLING = "period doubling"
    """A multiplier crosses the unit circle at -1."""
    PITCHFORK = "pitchfork"
    """A multiplier crosses at +1, where the branch meets one that exists on one side of the parameter value only."""
    TRANSCRITICAL = "transcritical"
    """A multiplier crosses at +1, where the branch intersects one that continues on both sides."""
    NEIMARK_SACKER = "Neimark-Sacker"
    """A complex pair of multipliers crosses the unit circle; without damping two pairs collide on it (Krein)."""
    DEGENERATE = "degenerate"
    """Several multipliers cross together, by symmetry or coincidence; the bifurcating branches are not determined."""
