"""Kinds of bifurcations of periodic orbits, of codimension one and two."""

from __future__ import annotations

from enum import StrEnum


class BifurcationKind(StrEnum):
    """Kinds of bifurcations of periodic orbits in one parameter."""

    FOLD = "fold"
    """Saddle-node: two orbits meet, and the branch turns back."""
    PERIOD_DOUBLING = "period doubling"
    """A multiplier crosses the unit circle at -1."""
    PITCHFORK = "pitchfork"
    """A multiplier crosses at +1, where a branch meets one that exists on one side of the parameter value only.  On the
    latter the multiplier touches +1.  The period doubling at which orbits are born is one on the branch of these."""
    TRANSCRITICAL = "transcritical"
    """A multiplier crosses at +1, where the branch intersects one that continues on both sides."""
    NEIMARK_SACKER = "Neimark-Sacker"
    """A complex pair of multipliers crosses the unit circle; without damping two pairs collide on it (Krein)."""
    DEGENERATE = "degenerate"
    """Several multipliers cross together, by symmetry or coincidence, or orbits fill a line at one parameter value; the
    bifurcating branches are not determined."""


class CodimensionTwoKind(StrEnum):
    """Kinds of bifurcations of codimension two, points of a curve of bifurcations in two parameters."""

    CUSP = "cusp"
    """Fold whose quadratic coefficient vanishes: two curves of folds meet in a tip."""
    GENERALISED_FLIP = "generalised flip"
    """Period doubling whose cubic coefficient vanishes: a curve of folds of the doubled orbits begins."""
    DEGENERATE_PITCHFORK = "degenerate pitchfork"
    """Pitchfork whose cubic coefficient vanishes: a curve of folds of the asymmetric orbits begins."""
    CHENCINER = "Chenciner"
    """Neimark-Sacker bifurcation whose coefficient vanishes: a curve of folds of invariant circles begins."""
    RESONANCE_1_1 = "1:1 resonance"
    """Two multipliers +1 with one eigenvector: curves of folds and of Neimark-Sacker bifurcations meet."""
    RESONANCE_1_2 = "1:2 resonance"
    """Two multipliers -1 with one eigenvector: curves of period doublings and Neimark-Sacker bifurcations meet."""
    RESONANCE_1_3 = "1:3 resonance"
    """Neimark-Sacker bifurcation with multipliers exp(+-2 pi i/3)."""
    RESONANCE_1_4 = "1:4 resonance"
    """Neimark-Sacker bifurcation with multipliers +-i."""
    FOLD_FLIP = "fold-flip"
    """Multipliers +1 and -1."""
    FOLD_NEIMARK_SACKER = "fold-Neimark-Sacker"
    """A multiplier +1 and a complex pair on the unit circle."""
    FLIP_NEIMARK_SACKER = "flip-Neimark-Sacker"
    """A multiplier -1 and a complex pair on the unit circle."""
    DOUBLE_NEIMARK_SACKER = "double Neimark-Sacker"
    """Two complex pairs on the unit circle: two curves of Neimark-Sacker bifurcations intersect."""
