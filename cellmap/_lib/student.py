"""Intervals around means of few numbers, by Student's distribution."""

from __future__ import annotations


def student_factor(confidence: float, freedom: int) -> float:
    """Return the standard errors to either side of a mean that an interval of a confidence reaches.

    Source: Student, Biometrika 6 (1908) 1.

    Examples
    --------
    >>> student_factor(0.95, 10)
    2.228
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * confidence))
