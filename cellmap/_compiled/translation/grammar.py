"""Which parts of Python's grammar the language has."""

from __future__ import annotations

import ast
import functools
from collections import Counter

_OPERATORS = "Add Sub Mult Div FloorDiv Mod Pow LShift RShift BitAnd BitOr BitXor USub Not And Or"
FIELDS: dict[str, str] = {
    **dict.fromkeys(f"Load Store Pass Break Continue {_OPERATORS} Lt LtE Gt GtE Eq NotEq".split(), ""),
    "arguments": "args", "arg": "arg", "Assign": "targets value", "AugAssign": "target op value", "Expr": "value",
    "If": "test body orelse", "While": "test body", "For": "target iter body", "Return": "value",
    "Constant": "value", "Name": "id ctx", "Tuple": "elts ctx", "Attribute": "value attr ctx",
    "Subscript": "value slice ctx", "Slice": "lower upper", "BinOp": "left op right", "UnaryOp": "op operand",
    "Compare": "left ops comparators", "BoolOp": "op values", "IfExp": "test body orelse", "Call": "func args keywords",
    "keyword": "arg value",
}  # fmt: skip
"""What is translated: nodes of the grammar, and the fields of each.  All else is refused, so ``orelse`` of While."""

_NOT_RUN = ("annotation", "type_comment")


class LanguageError(TypeError):
    """Something is not in the language; the message says where."""


@functools.lru_cache(maxsize=256)
def names_set(tree: ast.FunctionDef, file: str) -> Counter[str]:
    """Return the names that a function sets, and in how many places.

    Raises
    ------
    LanguageError
        Where anything in it has no translation.
    """
    names: Counter[str] = Counter()
    left: list[tuple[ast.AST, int]] = [(tree.args, tree.lineno), *((one, one.lineno) for one in tree.body)]
    while left:
        node, line = left.pop()
        line, name = getattr(node, "lineno", line), type(node).__name__
        fields = {field: value for field, value in ast.iter_fields(node) if value and field not in _NOT_RUN}
        foreign = set(fields).difference(FIELDS.get(name, "").split())
        if name not in FIELDS or foreign:
            of = f" with {', '.join(sorted(foreign))}" if name in FIELDS else ""
            raise LanguageError(f"{file}:{line}: {name}{of} is not in the language: {ast.unparse(node)}")
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names[node.id] += 1
        for value in fields.values():
            left += [(one, line) for one in (value if isinstance(value, list) else [value]) if isinstance(one, ast.AST)]
    return names
