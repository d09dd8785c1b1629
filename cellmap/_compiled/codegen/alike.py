"""Formulas of large systems as few loops: those that are the same but for what they read are found.

A network has one law for all of its nodes and one for all of its links.  Its graph of expressions is cut into pieces:
at each value that is used more than once, at each elementary function, and where a piece becomes long.  Pieces of the
same operations are one loop over a table of the places that they read and write.  So the machine code of a network does
not grow with its size, and what does not repeat is compiled in functions of bounded size.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise

from .emit import applied
from .expression import Expression, in_order
from .functions import TABLE
from .instructions import Instructions, Value
from .trace import CONSTANT, STATEFUL, TIMED, Trace

VALUES, SLOPES, ONCE, TIMES = "%values", "%slopes", "%once", "%times"
"""Arrays: vectors of lanes, derivatives of the states, numbers for all times, and those of one time."""

Places = Sequence[str | int]
Rows = Sequence[Sequence[int]]

_ARRAYS = {STATEFUL: VALUES, CONSTANT: ONCE, TIMED: TIMES}
_ARGUMENTS = ", ".join(f"ptr noalias {name}" for name in (VALUES, SLOPES, ONCE, TIMES))
_LONGEST = 40  # operations of a piece, about
_LINES = 400  # lines of a function, about
_UNROLLED = 500  # operations, of a piece as often as it occurs, up to which no loop is worth its table
_COST = 30  # cost of an elementary function, in operations


@dataclass(frozen=True)
class Piece:
    """Operations on leaves, which are numbered first, and on operations before: the last one is stored.

    A piece can be computed once all of less `depth` are.  Without operations it is a copy.
    """

    depth: int
    target: str
    leaves: tuple[str, ...]
    operations: tuple[tuple[str, tuple[int, ...]], ...]


@dataclass(eq=False)
class Pieces:
    """A right-hand side in pieces: for each the places of its leaves and its result, as often as it occurs.

    ``place`` says where values of lanes are kept, states first; ``shared`` where those are which all lanes share.
    """

    levels: dict[Expression, int]
    place: dict[Expression, int]
    shared: dict[int, dict[Expression, int]] = field(default_factory=lambda: {CONSTANT: {}, TIMED: {}})
    found: dict[Piece, list[tuple[int, ...]]] = field(default_factory=dict)
    _depth: dict[Expression, int] = field(default_factory=dict)

    def add(self, root: Expression, target: str, result: int, copied: bool = False) -> None:
        """Add the piece that ends at a root, or its copy."""
        inner = {} if copied else self._inside(root)
        leaves: dict[Expression, int] = {root: 0} if copied else {}
        for leaf in (a for node in inner for a in node.arguments):
            if leaf not in inner:
                leaves.setdefault(leaf, len(leaves))
        number = leaves | {node: len(leaves) + i for i, node in enumerate(inner)}
        operations = tuple((n.operation, tuple(number[a] for a in n.arguments)) for n in inner)
        depth = 1 + max(self._depth.get(leaf, 0) for leaf in leaves)
        if not copied:
            self._depth[root] = depth
        piece = Piece(depth, target, tuple(_ARRAYS[self.levels[leaf]] for leaf in leaves), operations)
        self.found.setdefault(piece, []).append((*map(self.place_of, leaves), result))

    def place_of(self, leaf: Expression) -> int:
        """Return the place of a value in its array."""
        if self.levels[leaf] == STATEFUL:
            return self.place[leaf]
        known = self.shared[self.levels[leaf]]
        return known.setdefault(leaf, len(known))

    def _inside(self, root: Expression) -> dict[Expression, None]:
        """Return the operations of a piece in order."""
        order: dict[Expression, None] = {}

        def visit(node: Expression) -> None:
            for a in node.arguments:
                if self.levels[a] == STATEFUL and a not in self.place and a not in order:
                    visit(a)
            order[node] = None

        visit(root)
        return order


def in_pieces(trace: Trace, results: Mapping[int, int], kept: Set[Expression]) -> Pieces:
    """Return a right-hand side in pieces: of the components that have a result, by number, with its place.

    Expressions that are `kept` have a place of their own.
    """
    levels, wanted = trace.levels(), {j: trace.outputs[j] for j in results}
    outputs = Counter(wanted.values())
    inner = [n for n in in_order(outputs) if n.arguments and levels[n] == STATEFUL]
    uses = outputs + Counter(a for n in inner for a in set(n.arguments))
    roots, size = dict[Expression, None](), dict[Expression, int]()
    for node in inner:
        size[node] = 1 + sum(size[a] for a in set(node.arguments) if a in size and a not in roots)
        if outputs[node] or uses[node] > 1 or node in kept or is_long(node.operation) or size[node] > _LONGEST:
            roots[node] = None
    pieces = Pieces(levels, {e: j for j, e in enumerate((*trace.states, *roots))})
    for root in roots:
        if not (outputs[root] and uses[root] == 1 and root not in kept):
            pieces.add(root, VALUES, pieces.place[root])
    for j, output in wanted.items():
        pieces.add(output, SLOPES, results[j], copied=output not in roots or uses[output] > 1 or output in kept)
    return pieces


def is_long(operation: str) -> bool:
    """Whether an operation is more than an instruction or two."""
    known = TABLE.get(operation)
    return operation in {"pow", "floordiv"} or (known is not None and not isinstance(known.kernel, str))


def written(pieces: Pieces, width: int, stages: int) -> tuple[str, list[Instructions]]:
    """Return the text of a function `slopes` that computes all pieces, one depth after the other, and the bodies."""
    parts, tables = [Instructions(width)], list[str]()
    for name, piece in enumerate(sorted(pieces.found, key=lambda piece: piece.depth)):
        strides = [{VALUES: width, SLOPES: stages * width}.get(array, 1) for array in (*piece.leaves, piece.target)]
        rows = [[place * stride for place, stride in zip(row, strides, strict=True)] for row in pieces.found[piece]]
        cost = 1 + sum(_COST if is_long(operation) else 1 for operation, _ in piece.operations)
        if len(rows) == 1 or len(rows) * cost <= _UNROLLED:
            for row in rows:
                _write(_current(parts), piece, row)
        else:
            with loop_over_rows(_current(parts), f"row{name}", rows, tables) as places:
                _write(parts[-1], piece, places)
    calls = Instructions(width)
    for k in range(len(parts)):
        calls.write(f"call void @part{k}({_ARGUMENTS.replace('noalias ', '')})")
    functions = [part.function(f"part{k}", _ARGUMENTS) for k, part in enumerate(parts)]
    return "".join([*tables, *functions, calls.function("slopes", _ARGUMENTS)]), parts


def _current(parts: list[Instructions]) -> Instructions:
    """Return the body of the last function, or of a new one where that is long."""
    if len(parts[-1].lines) > _LINES:
        parts.append(Instructions(parts[-1].width))
    return parts[-1]


def table(name: str, kind: str, values: list[int] | list[float]) -> str:
    """Return the text of a constant array."""
    return f"@{name} = internal constant [{len(values)} x {kind}] [{', '.join(f'{kind} {v!r}' for v in values)}]\n"


@contextmanager
def loop_over_rows(out: Instructions, name: str, rows: Rows, tables: list[str]) -> Iterator[Places]:
    """Repeat what is written inside for rows of whole numbers, given those of a row.

    Columns that do not follow from the number of the row are listed in a table, which is added to ``tables``.
    """
    columns = list(zip(*rows, strict=True))
    regular = [all(b - a == c[1] - c[0] for a, b in pairwise(c)) for c in columns]
    listed = [c for c, is_regular in zip(columns, regular, strict=True) if not is_regular]
    if listed:
        tables.append(table(name, "i64", [place for row in zip(*listed, strict=True) for place in row]))
    with out.loop(name, len(rows)) as row:
        first, number, places = out.whole("mul", row, len(listed)), 0, list[str | int]()
        for column, is_regular in zip(columns, regular, strict=True):
            if is_regular:
                step = column[1] - column[0] if len(column) > 1 else 0
                places.append(out.whole("add", out.whole("mul", row, step), column[0]) if step else column[0])
            else:
                places.append(out.load_whole(out.address(f"@{name}", out.whole("add", first, number))))
                number += 1
        yield places


def _write(out: Instructions, piece: Piece, offsets: Places) -> None:
    """Write the operations of a piece on what is at some places of the arrays."""
    known: list[Value] = []
    for array, offset in zip(piece.leaves, offsets, strict=False):
        known.append(out.load(out.address(array, offset), vector=array == VALUES))
    for operation, arguments in piece.operations:
        known.append(applied(out, operation, [known[a] for a in arguments], STATEFUL))
    out.store(out.as_vector(known[-1]), out.address(piece.target, offsets[-1]))
