"""Mutants: small changes of the library's code, each of which some test should notice.

The operators are those of cosmic-ray and mutmut for numbers, comparisons, arithmetic and conditions.  Docstrings,
annotations, decorators, errors, warnings and representations stay as they are.
"""

from __future__ import annotations

import ast
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

COMPARED = {
    ast.Eq: ("==", ["!="]),
    ast.NotEq: ("!=", ["=="]),
    ast.Lt: ("<", ["<=", ">="]),
    ast.LtE: ("<=", ["<", ">"]),
    ast.Gt: (">", [">=", "<="]),
    ast.GtE: (">=", [">", "<"]),
    ast.Is: ("is", ["is not"]),
    ast.IsNot: ("is not", ["is"]),
    ast.In: ("in", ["not in"]),
    ast.NotIn: ("not in", ["in"]),
}
COMPUTED = {
    ast.Add: ("+", ["-"]),
    ast.Sub: ("-", ["+"]),
    ast.Mult: ("*", ["/"]),
    ast.Div: ("/", ["*"]),
    ast.Pow: ("**", ["*"]),
    ast.FloorDiv: ("//", ["*"]),
    ast.Mod: ("%", ["*"]),
    ast.BitOr: ("|", ["&"]),
    ast.BitAnd: ("&", ["|"]),
}
TWINS = ("min max", "minimum maximum", "fmin fmax", "any all", "argmin argmax", "floor ceil", "zeros ones", "sin cos")
CALLED = {a: b for pair in map(str.split, TWINS) for a, b in (pair, pair[::-1])}
SILENT = {"__repr__", "__str__", "_repr_html_", "warn", "warning", "tick", "progress_bar", "default_rng"}
"""Functions whose bodies, and calls whose arguments, only say something, or seed."""
UNSEEN = {"repr", "strict", "stacklevel", "kw_only", "desc", "unit", "disable", "optimize"}
"""Keywords that change no number."""
CONSTANTS = {"bool": ["True", "False"], "int": ["0"], "float": ["0.0"], "str": ["''"], "None": ["None"]}
"""What functions of a kind return in place of what they compute."""


@dataclass(frozen=True)
class Mutant:
    """`old`, at bytes `begin` to `end` of the file, becomes `new`; it is executed where one of `lines` is."""

    path: str
    line: int
    begin: int
    end: int
    old: str
    new: str
    lines: tuple[int, ...]
    function: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.old!r} -> {self.new!r}"

    def of(self, source: bytes) -> bytes:
        return source[: self.begin] + self.new.encode() + source[self.end :]


class Places(ast.NodeVisitor):
    """All mutants of one file."""

    def __init__(self, path: str, source: bytes) -> None:
        self.path, self.source = path, source
        self.starts = [0]
        for line in source.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.found: list[Mutant] = []
        self.constant: list[Mutant] = []
        self.statement: tuple[int, ...] = ()
        self.function: tuple[int, ...] = ()
        self.visit(ast.parse(source))

    def begin(self, node: ast.AST) -> int:
        return self.starts[node.lineno - 1] + node.col_offset

    def end(self, node: ast.AST) -> int:
        return self.starts[node.end_lineno - 1] + node.end_col_offset

    def replace(self, begin: int, end: int, new: str) -> None:
        line = self.source.count(b"\n", 0, begin) + 1
        old = self.source[begin:end].decode()
        self.found.append(Mutant(self.path, line, begin, end, old, new, self.statement, self.function))

    def operator(self, left: ast.AST, right: ast.AST, old: str, new: list[str]) -> None:
        between = self.source[self.end(left) : self.begin(right)]
        at = between.find(old.encode())
        if b"#" not in between and at >= 0:
            for operator in new:
                self.replace(self.end(left) + at, self.end(left) + at + len(old), operator)

    def negate(self, node: ast.AST) -> None:
        self.replace(self.begin(node), self.end(node), f"not ({ast.unparse(node)})")

    def visit(self, node: ast.AST) -> None:
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            last = max(node.lineno, body[0].lineno - 1) if body else node.end_lineno
            before, self.statement = self.statement, tuple(range(node.lineno, last + 1))
            super().visit(node)
            self.statement = before
        else:
            super().visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if node.name in SILENT or any("overload" in ast.unparse(d) for d in node.decorator_list):
            return
        before, self.function = self.function, tuple(range(node.body[0].lineno, node.end_lineno + 1))
        first = next((s for s in node.body if not isinstance(getattr(s, "value", None), ast.Constant)), None)
        for value in CONSTANTS.get(ast.unparse(node.returns) if node.returns else "", []) if first else []:
            new, at = f"return {value}\n{' ' * first.col_offset}", self.begin(first)
            self.constant.append(Mutant(self.path, first.lineno, at, at, "", new, (first.lineno,), self.function))
        for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(part)
        self.function = before

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for part in node.body:
            self.visit(part)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Raise(self, node: ast.Raise) -> None:
        pass

    visit_JoinedStr = visit_Assert = visit_Raise

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, operator, right in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
            self.operator(left, right, *COMPARED[type(operator)])
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        text = any(isinstance(s, ast.Constant) and isinstance(s.value, str) for s in (node.left, node.right))
        if type(node.op) in COMPUTED and not text:
            self.operator(node.left, node.right, *COMPUTED[type(node.op)])
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) in COMPUTED:
            old, new = COMPUTED[type(node.op)]
            self.operator(node.target, node.value, old + "=", [operator + "=" for operator in new])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self.operator(left, right, old, [new])
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not | ast.USub):
            self.replace(self.begin(node), self.begin(node) + (3 if isinstance(node.op, ast.Not) else 1), "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bool):
            self.replace(self.begin(node), self.end(node), str(not node.value))
        elif isinstance(node.value, int | float):
            more = node.value + 1 if node.value + 1 != node.value else 2 * node.value
            self.replace(self.begin(node), self.end(node), repr(more))

    def visit_If(self, node: ast.If | ast.While | ast.IfExp) -> None:
        if ast.unparse(node.test) not in {"TYPE_CHECKING", "progress"}:
            if not isinstance(node.test, ast.Constant):
                self.negate(node.test)
            self.generic_visit(node)

    visit_While = visit_IfExp = visit_If

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self.negate(test)
        self.generic_visit(node)

    def visit_Break(self, node: ast.Break) -> None:
        self.replace(self.begin(node), self.end(node), "continue")

    def visit_Continue(self, node: ast.Continue) -> None:
        self.replace(self.begin(node), self.end(node), "break")

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in SILENT:
            return
        if name in CALLED:
            self.replace(self.end(node.func) - len(name), self.end(node.func), CALLED[name])
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg not in UNSEEN:
            self.generic_visit(node)


def mutants_of(path: Path, root: Path, constant: bool = False) -> list[Mutant]:
    places = Places(str(path.relative_to(root)), path.read_bytes())
    return places.constant if constant else places.found


def chosen(root: Path, room: str, number: int, seed: int, constant: bool = False) -> Iterator[Mutant]:
    """Choose mutants of one room: lines at random, of each line one, so that all lines count alike.

    Or functions that return a constant, in place of lines.
    """
    lines: dict[tuple[str, int], list[Mutant]] = {}
    for path in sorted((root / "cellmap" / room).rglob("*.py")):
        for mutant in mutants_of(path, root, constant):
            lines.setdefault((mutant.path, mutant.line), []).append(mutant)
    rng, places = random.Random(f"{room} {seed}"), sorted(lines)
    rng.shuffle(places)
    for place in places[:number]:
        yield rng.choice(lines[place])
