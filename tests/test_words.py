"""README, pages, code and its names use the words of the field: no private words, no pages without the terms.

Only prose is read: of pages everything but code blocks, inline code, formulas, link targets and comments; of code
docstrings without examples, names of arguments and references, comments, and strings with a blank. Another source of
text is a further function of `SOURCES`.
"""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parent.parent

PACKAGES = ("cellmap", "systems", "studies")
"""Packages whose docstrings, comments and messages are read; of tests and of the site docstrings and comments are."""


class Text(NamedTuple):
    """Prose with its origin; offsets of lines are those of the file."""

    name: str
    prose: str


class Finding(NamedTuple):
    name: str
    line: int
    found: str
    instead: str


def pages() -> Iterator[Text]:
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        name = path.relative_to(ROOT).as_posix()
        yield Text(name, prose_of(path.read_text(encoding="utf-8")))


def code() -> Iterator[Text]:
    for package in (*PACKAGES, "tests", "docs"):
        for path in sorted((ROOT / package).rglob("*.py")):
            if path != Path(__file__):
                prose = prose_of_code(path.read_text(encoding="utf-8"), messages=package in PACKAGES)
                yield Text(path.relative_to(ROOT).as_posix(), prose)


PROSE_OF_CODE = re.compile(
    r'''"""(?P<docstring>.*?)"""|"(?P<message>(?:[^"\\\n]|\\.)*)"|'(?:[^'\\\n]|\\.)*'|\#[ ](?P<comment>[^\n]*)''',
    re.DOTALL,
)


def prose_of_code(source: str, messages: bool = True) -> str:
    """Return docstrings, comments and messages, each on its lines; line numbers stay the same."""
    parts, end = [], 0
    for match in PROSE_OF_CODE.finditer(source):
        if match["docstring"] is not None:
            prose = prose_of_docstring(match["docstring"])
        else:
            prose = match["comment"] or (match["message"] if messages else "") or ""
            prose = prose_of(re.sub(r"{[^{}]*}", "_", prose)) if " " in prose else ""
        if " " in prose:
            between = source.count("\n", end, match.start())
            parts.append("\n" * between + (" " if between else " | ") + prose)
            end = match.end()
    return "".join(parts)


SOURCES: tuple[Callable[[], Iterator[Text]], ...] = (pages, code)
"""Functions that yield the texts in which no private word may occur."""

QUOTATIONS: tuple[str, ...] = ()
"""Quotations and titles, as they are printed, in which any word may stand."""

# Code before formulas: a dollar sign in code begins no formula.
NOT_PROSE = (
    r"^(`{3,}).*?^\1[ ]*$",  # fenced blocks
    r"(?<=\n\n)(?: {4}[^\n]*\n)+",  # indented blocks
    r"<!--.*?-->",
    r"`[^`]+`",  # inline code, roles included
    r"\$\$.+?\$\$",
    r"\$[^$]+\$",
    r"(?<=\])\([^)]*\)",  # targets of links
)


def prose_of(markdown: str) -> str:
    """Blank out everything else; line numbers stay the same."""
    for pattern in (*NOT_PROSE, *map(re.escape, QUOTATIONS)):
        markdown = re.sub(pattern, _blank, markdown, flags=re.DOTALL | re.MULTILINE)
    return markdown


NOT_PROSE_OF_DOCSTRINGS = (
    r"^References\n-+\n.*?(?=^[A-Z]\w+\n---|\Z)",
    r"^(?:>>>|\.\.\.)[^\n]*\n(?:(?!>>>)[^\n]+\n)*",  # examples with their output
    r"^[\w*, ]+ :[^\n]*$",  # arguments and their types
)


def prose_of_docstring(text: str) -> str:
    """Blank out everything else; line numbers stay the same."""
    text = re.sub(r"^[ ]+", "", text, flags=re.MULTILINE)  # indentation is no code here
    for pattern in NOT_PROSE_OF_DOCSTRINGS:
        text = re.sub(pattern, _blank, text, flags=re.DOTALL | re.MULTILINE)
    return prose_of(text)


def _blank(match: re.Match[str]) -> str:
    return re.sub(r"[^\n]", "_", match.group())


DIALECT = {
    # Plural "starts" is taken for a noun unless it is a verb with a preposition: "the page starts from".
    r"starts(?! (?:from|with|at|on|by|to|over)\b)": "initial conditions",
    r"(?:an?|any|each|every|given|no|one|random|single|some|that|undecided|which) start": "initial condition",
    r"start (?:that|is|which|whose)": "initial condition",
    r"pictures?": "basin image, figure",
    r"(?:an?|the|its|their|this|each|by|large|small) shares?|shares? (?:of|that|is|are)|shared out": "fraction",
    r"tabulat\w+": "interpolated map, interpolation grid",
    r"(?:(?:coars|fin)er?|larger|smaller|without an?|under an?) tables?": "interpolation grid",
    r"tables? of (?:order|\d+|such)": "interpolation grid",
    r"rough cells?": "fallback cell",
    r"left to the exact map": "evaluated with the exact map",
    r"(?:left|leaves?|leaving) the table": "escaped",
    r"leaps?": "multi-period step",
    r"(?:one|its|their|whole|half|full|each|quarter of a|number of|in|\d+) turns": "full rotations",
    r"(?:an?|one|its|their|whole|half a|full|each|mean) turn": "period of the angle, full rotation",
    r"seams?|circle is cut": "branch cut",
    r"(?:one|an?|each|every|two) rounds?": "period, monodromy matrix",
    r"angles?,? and (?:the )?rates?|all rates|both rates": "angular velocity",
    r"rest states?|stands? still": "equilibrium, fixed point",
    r"(?:go|goes|going|went) round": "rotating (running) solution",
    r"right-hand sides? that (?:jumps?|branch(?:es)?)": "discontinuous (Filippov) right-hand side",
    r"sets? of equilibria": "sticking set, continuum of equilibria",
    r"polish(?:ed|es|ing)?": "refined by Newton's method",
    r"to spare": "contraction margin",
    r"legs?": "restart times",
    r"horizons?": "current time limit",
    r"keeps? volumes?": "volume-preserving",
    r"neither here nor there": "edge state",
    r"what bounds": "basin boundary",
    r"what a (?:state in a )?basin withstands": "resilience",
    r"parameters in lanes": "vectorised parameter sweep",
    r"made again|anew": "recomputed, rebuilt",
    r"t(?:ell|old) apart": "distinguish",
    r"belongs? into": "is declared in",
    r"just so": "in the same way",
    r"to be had": "can be reached",
    r"(?:it|that|would) pays?|worth while": "worthwhile",
    r"numbers of the machine|machine numbers": "double precision",
}
"""Private words, as regular expressions in which a blank is any white space, and the words of the field."""

TERMS = {
    "README.md": ("initial condition", "limit cycle"),
    "docs/boundaries.md": ("edge state", "chaotic saddle"),
    "docs/bifurcations.md": ("Floquet multipliers", "hysteresis", "saddle-node", "bistability", "period doubling"),
    "docs/discontinuous.md": ("Filippov", "sliding mode"),
    "docs/how-it-works.md": ("monodromy matrix", "trapping region"),
    "docs/index.md": ("Poincaré",),
    "docs/integration.md": ("Poincaré section",),
    "docs/own-system.md": ("Multistability", "fallback cell"),
    "docs/set-oriented.md": ("autonomous",),
}
"""Pages, and terms for which readers search that each must answer."""

NAMES = {
    "starts": "initial_conditions",
    "picture": "image, figure",
    "pictures": "images, figures",
    "leap": "max_step, multi_period_step",
    "leaps": "multi_period_steps",
    "seam": "branch_cut",
    "seams": "branch_cuts",
    "shares": "fractions",
    "tabulated": "interpolated",
    "polish": "refinement",
    "anew": "again",
}
"""Private words that no name of a function, a class, an argument or a variable has between its underscores."""


def compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(rf"\b(?:{pattern})\b".replace(" ", r"\s+"), re.IGNORECASE)


ANY = re.compile(compiled("|".join(DIALECT)).pattern)  # in lower case, which is faster than either case


def findings(text: Text) -> Iterator[Finding]:
    if not ANY.search(text.prose.lower()):  # one search is faster than one for each of them
        return
    for pattern, instead in DIALECT.items():
        for match in compiled(pattern).finditer(text.prose):
            line = text.prose.count("\n", 0, match.start()) + 1
            yield Finding(text.name, line, " ".join(match.group().split()), instead)


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.__name__)
def test_the_words_are_those_of_the_field(source):
    found = [f"{f.name}:{f.line}: {f.found!r}; write {f.instead!r}" for text in source() for f in findings(text)]
    assert not found, "\n".join(found)


def test_a_search_for_a_term_finds_its_page():
    for page, terms in TERMS.items():
        prose = " ".join(prose_of((ROOT / page).read_text(encoding="utf-8")).split())
        assert not [term for term in terms if term not in prose], page


PRIVATE = """Random starts are integrated.  It labels each start.  A picture of 500 cells.  The share of the window.
Angles are kept in one turn.  All of these are in whole turns.  The orbit left the table.  An orbit takes the longest
leap.  A motion that goes round and round.  Right-hand sides that jump.  It is made anew."""
OTHER = (
    "This page starts from diagrams; to start again, see the start of the page.",
    "Both lanes share a step, and the branch turns back; orbits visit the points in turn.",
    "The table below shows a rough floor.",
    "Use `leap=8` and `initial_conditions`, {func}`~cellmap.share` or [this](a.md#one-turn).",
    "```text\nthe picture\n```\n\n    a picture\n\n<!-- a picture -->\n$a turn$ and",
)


def test_private_words_are_found_and_other_uses_of_a_word_are_not():
    for sentence in " ".join(PRIVATE.split()).split(". "):
        for written in (sentence, sentence.replace(" ", "\n")):
            assert list(findings(Text("a page", prose_of(written)))), sentence
    assert not [sentence for sentence in OTHER if list(findings(Text("a page", prose_of(sentence))))]
    (finding,) = findings(Text("a page", prose_of("```py\nx = 1\n```\n\nSome text\nand a picture\n")))
    assert (finding.line, finding.found) == (6, "picture")


CODE = '''"""A module."""

import this  # a picture


def label(starts):
    """Return one.

    starts : array_like
        A picture.

    References
    ----------
    Somebody, A picture of one share (1980).

    Examples
    --------
    >>> a picture
    """
    raise ValueError(
        f"starts={starts!r}: {starts} are no "
        "initial conditions, but starts" if "starts" in starts else "picture"
    )
'''


def test_of_code_comments_messages_and_docstrings_are_read_but_not_their_names_examples_and_references():
    found = [(f.line, f.found) for f in findings(Text("a module", prose_of_code(CODE)))]
    assert found == [(21, "starts"), (22, "starts"), (3, "picture"), (10, "picture")]
    names = {text.name for text in code()}
    assert {f"{package}/__init__.py" for package in PACKAGES} <= names
    assert len(names) >= 350


def names_in(source: str) -> Iterator[tuple[str, int]]:
    """Names that code gives to functions, classes, arguments and variables, each with its line."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno


def private_names(source: str) -> Iterator[tuple[str, int, str]]:
    if not re.search("|".join(NAMES), source.lower()):  # faster than to parse
        return
    for name, line in names_in(source):
        for word in {*name.lower().split("_")} & NAMES.keys():
            yield name, line, NAMES[word]


def test_the_names_are_those_of_the_field():
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{line}: {name}; write {instead}"
        for package in (*PACKAGES, "tests", "docs")
        for path in sorted((ROOT / package).rglob("*.py"))
        for name, line, instead in private_names(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(found)
    source = "def draw_picture(starts):\n    class Leap:\n        seam = starts.polish\n    _start = 1\n"
    assert sorted(name for name, _, _ in private_names(source)) == ["Leap", "draw_picture", "seam", "starts"]
