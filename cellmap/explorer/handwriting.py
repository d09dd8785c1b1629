"""Formulas as they are written by hand, turned into Python's: powers, dots, Greek letters, products without a sign."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from .formulas import BUILT_IN, FUNCTIONS, IN_NUMPY
from .mathematics import LETTERS

_NAMES = {letter: name for name, letter in LETTERS.items()} | {"ϑ": "theta", "φ": "phi", "ϕ": "phi", "ε": "epsilon"}
_SIGNS = {"^": "**", "·": "*", "⋅": "*", "×": "*", "−": "-", "–": "-", "’": "'", "′": "'", "″": "''", "→": "->"}
_DOTS = {"\u0307": "'", "\u0308": "''"}
_RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True))
_LOWERED = dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789", strict=True))
_ALIASES = {"ln": "log", "arctan2": "atan2", **IN_NUMPY}
_WORDS = set("if else angle and or not in is for lambda".split())
_TOKEN = re.compile(
    r"(?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|(?P<name>[^\W\d]\w*'*)|(?P<space>\s+)"
    r"|(?P<sign>\*\*|->|<=|>=|==|.)"
)
_LEIBNIZ = re.compile(r"\s*d(?:(?P<order>(?:\*\*)?[2-9]))?\s*(?P<name>[^\W\d]\w*)\s*/\s*dt(?:(?:\*\*)?(?P=order))?\s*=")


@dataclass(frozen=True)
class Plain:
    """A line in Python's signs, and the place in the line as it was typed of each of its characters."""

    text: str
    places: tuple[int, ...]

    def place(self, column: int) -> int:
        """Return the column as it was typed, from one of the text, both counted from 1."""
        return self.places[min(column, len(self.places)) - 1] + 1 if self.places else 1


def identifier(name: str) -> str:
    """Return the name by which programs know a derivative.

    Examples
    --------
    >>> identifier("x"), identifier("x'"), identifier("x''")
    ('x', 'x_dot', 'x_ddot')
    """
    stem = name.rstrip("'")
    order = len(name) - len(stem)
    return f"{stem}_{'d' * (order - 1)}dot" if order else stem


def plain(line: str) -> Plain:
    """Return a line as Python reads it: names of Greek letters, ``**`` for powers, ``*`` for products without a sign.

    Derivatives keep their primes; a left side such as ``dx/dt`` has one.

    Examples
    --------
    >>> plain("θ̈ = -2γθ̇ - ω²sin(θ)").text
    "theta'' = -2*gamma*theta' - omega**2*sin(theta)"
    >>> plain("d²x/dt² = 3 x (1 - x)").text
    "x'' = 3*x*(1 - x)"
    """
    signs: list[tuple[str, int]] = []
    raised = False
    for place, letter in enumerate(line):
        for c in unicodedata.normalize("NFD", letter):
            if c in _RAISED and not raised:
                signs += [("*", place), ("*", place)]
            raised = c in _RAISED
            # A name ends where a Greek letter begins, and after it unless an index follows.
            known = _NAMES.get(c)
            text = f"\0{known}\0" if known else _SIGNS.get(c) or _DOTS.get(c) or _RAISED.get(c) or _LOWERED.get(c) or c
            signs += [(t, place) for t in text]
    begun = [sign for sign in signs if sign[0] != "\0"]
    if (found := _LEIBNIZ.match("".join(c for c, _ in begun))) is not None:
        left = f"{found['name']}{chr(39) * int((found['order'] or '1')[-1])} ="
        signs = [*((c, begun[found.start("name")][1]) for c in left), *signs[signs.index(begun[found.end() - 1]) + 1 :]]
    return _joined(signs)


def _joined(signs: list[tuple[str, int]]) -> Plain:
    """Return a line with signs between its factors."""
    text = "".join(c for c, _ in signs)
    # A dot or an index belongs to its letter.
    kept = [k for k, c in enumerate(text) if c != "\0" or not re.match("\0(?:'|_?\\d|_)", text[k:])]
    signs = [signs[k] for k in kept]
    text = "".join(c for c, _ in signs)
    found: list[tuple[str, int]] = []
    before, spaces, position, factor = "", list[tuple[str, int]](), 0, False
    for piece in re.split("(\0)", text):
        for match in _TOKEN.finditer(piece if piece != "\0" else ""):
            token, kind = match[0], match.lastgroup
            at = [place for _, place in signs[position + match.start() : position + match.end()]]
            if kind == "space":
                spaces += list(zip(token, at, strict=True))
                continue
            name = _ALIASES.get(token, token)
            opens = kind in ("number", "name") or token == "("
            called = token == "(" and before not in (")", "number") and not spaces
            product = factor and opens and not called and name not in _WORDS
            found += [("*", at[0])] if product else spaces
            found += [(c, at[min(k, len(at) - 1)]) for k, c in enumerate(name)]
            function = name in FUNCTIONS or name in BUILT_IN
            factor = token == ")" or kind == "number" or (kind == "name" and name not in _WORDS and not function)
            before, spaces = (token if kind == "sign" else str(kind)), []
        position += len(piece)
    return Plain("".join(c for c, _ in found), tuple(place for _, place in found))
