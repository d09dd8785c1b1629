"""A hard case: why it is hard, what must come out, and a function that finds out what does."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}
"""Tolerances of the cases that need more than the default; few choices mean few compiled kernels."""


@dataclass(frozen=True)
class Finding:
    """One thing that came out, in words, and whether it is what must come out."""

    text: str
    met: bool


@dataclass(frozen=True)
class HardCase:
    """A case; `examine` yields what came out."""

    title: str
    why: str
    expected: str
    examine: Callable[[], Iterator[Finding]]

    def __str__(self) -> str:
        return self.title

    @property
    def name(self) -> str:
        """Name for the command line and the tests."""
        return self.examine.__name__

    def run(self) -> Outcome:
        """Find out what comes out."""
        began = time.perf_counter()
        return Outcome(self, tuple(self.examine()), time.perf_counter() - began)


@dataclass(frozen=True)
class Outcome:
    """What came out of a case, and the time that took."""

    case: HardCase
    findings: tuple[Finding, ...]
    seconds: float

    @property
    def met(self) -> bool:
        """Whether all of it is what must come out."""
        return bool(self.findings) and all(f.met for f in self.findings)


def hard_case(title: str, why: str, expected: str) -> Callable[[Callable[[], Iterator[Finding]]], HardCase]:
    """Make a case of a generator of findings."""
    return lambda examine: HardCase(title, why, expected, examine)


def at_most(what: str, value: float, bound: float) -> Finding:
    """Find a size that must not exceed a bound."""
    return Finding(f"{what}: {_size(value)} (at most {_size(bound)})", bool(value <= bound))


def agrees(what: str, value: float, reference: float, within: float) -> Finding:
    """Find a number that must agree with a reference."""
    error = abs(value - reference)
    return Finding(
        f"{what}: {value:.12g} (reference {reference:.12g}; error {_size(error)}, at most {_size(within)})",
        bool(error <= within),
    )


def is_so(what: str, met: bool) -> Finding:
    """Find a statement to hold."""
    return Finding(what, bool(met))


def refused(what: str, call: Callable[[], object], kind: type[Exception], words: str) -> Finding:
    """Find an error of one kind whose message has certain words."""
    try:
        call()
    except kind as error:
        return Finding(f"{what}: `{kind.__name__}: {error}`", words in str(error))
    return Finding(f"{what}: no error", False)


def _size(value: float) -> str:
    return f"{value:.2g}"
