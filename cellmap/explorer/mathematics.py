"""Equations of a system as MathML, which browsers typeset, from its traced formulas."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape
from math import pi, prod

from .._compiled.codegen.branches import BranchingGraph
from .._compiled.codegen.expression import Expression, UntraceableError, in_order
from .._compiled.codegen.trace import empty_trace
from ..maps.discrete import Discrete
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem

LONGEST = 250
"""Operations of formulas that are written in full; in longer ones parts that occur several times have names."""

_GREEK = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau phi chi psi omega"
LETTERS = dict(zip(_GREEK.split(), "αβγδεζηθικλμνξπρστφχψω", strict=True))
"""Greek letters by their names."""

_FEW = 4  # nodes of a part that is written again rather than named
_SUM, _PRODUCT, _POWER, _ATOM = range(4)  # how strongly a formula holds together
_SPACE = '<mspace width="0.2em"/>'
_FRACTIONS = {(k / n) * pi: (k, n) for n in (6, 4, 3, 2, 1) for k in range(1, 13)}


def named(name: str) -> str:
    """Return a name: Greek letters, indices, and dots of derivatives.

    Examples
    --------
    >>> named("theta1'")
    '<mover><msub><mi>θ</mi><mn>1</mn></msub><mo>˙</mo></mover>'
    """
    if name.endswith("'"):
        return f"<mover>{named(name[:-1])}<mo>˙</mo></mover>"
    stem = name.rstrip("0123456789")
    index, stem = name[len(stem) :], stem.rstrip("_") or stem
    symbol = f"<mi>{escape(LETTERS.get(stem, stem.replace('_', ' ')))}</mi>"
    return f"<msub>{symbol}<mn>{index}</mn></msub>" if index and stem else symbol


def symbol(name: str) -> str:
    """Return a name as text: Greek letters, indices, and dots of derivatives.

    Examples
    --------
    >>> symbol("theta1'"), symbol("omega_0"), symbol("amplitude")
    ('θ̇₁', 'ω₀', 'amplitude')
    """
    stem = name.rstrip("'")
    dots = {0: "", 1: "\u0307", 2: "\u0308"}.get(len(name) - len(stem))
    letter = stem.rstrip("0123456789")
    index = stem[len(letter) :]
    letter = letter.removesuffix("_") if index else letter
    short = LETTERS.get(letter, letter)
    if dots is None or len(short) > 1:
        return name
    return f"{short}{dots}{index.translate(str.maketrans('0123456789', '₀₁₂₃₄₅₆₇₈₉'))}"


def equations(system: ForcedSystem | PointMap) -> list[list[str]] | None:
    """Return lines of MathML, each the left side and the terms of the right one; None where formulas are not known.

    Long formulas are followed by lines for the parts that they name.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> equations(discrete_map(lambda x, p: (p.mu - x[0] ** 2,), {"mu": 1.0}, ("x",)))
    [['<mi>x</mi><mo>↦</mo>', '<mi>μ</mi>', '<mo form="infix">−</mo><msup><mrow><mi>x</mi></mrow><mn>2</mn></msup>']]
    """
    try:
        outputs, names = _traced(system)
    except (UntraceableError, TypeError, ValueError, ArithmeticError, RecursionError):
        return None
    coordinates = [c.name for c in (system.axes if isinstance(system, ForcedSystem) else system.coordinates)]
    writer, lines = _Writer(coordinates, names, outputs), []
    for name, output in zip(coordinates, outputs, strict=True):
        if isinstance(system, PointMap):
            left = f"{named(name)}<mo>↦</mo>"
        elif output.operation == "state" and coordinates[output.value] == f"{name}'":
            continue  # the derivative has its name from the coordinate
        else:
            dots = (name[:-1], "¨") if name.endswith("'") else (name, "˙")
            left = f"<mover>{named(dots[0])}<mo>{dots[1]}</mo></mover><mo>=</mo>"
        lines.append([left, *writer.terms(output)])
    parts = [[f"{_part(n)}<mo>=</mo>", *writer.terms(e, whole=True)] for e, n in writer.parts.items()]
    return lines + parts


def _traced(system: ForcedSystem | PointMap) -> tuple[tuple[Expression, ...], tuple[str, ...]]:
    """Return the components of the right-hand side, with the switching functions in the place of their signs."""
    names = tuple(system.params)
    if isinstance(system, PointMap):
        spec = system.spec
        if not isinstance(spec, Discrete):
            raise UntraceableError("no formulas")
        function = spec.function
        inputs = empty_trace(len(system.coordinates), len(names), BranchingGraph(modes=False))
        return inputs.graph.trace_paths(inputs.run(lambda t, x, p: function(x, p), names)), names
    inputs = empty_trace(system.dimension, len(names), BranchingGraph(modes=False))
    further: tuple[tuple[Expression, ...], ...] = ()
    if system.switches is not None:
        surfaces = inputs.graph.trace_paths(inputs.run(system.switches, names))
        further = (tuple(inputs.graph.node("sgn", (surface,)) for surface in surfaces),)
    return inputs.graph.trace_paths(inputs.run(system.rhs, names, *further)), names


class _Writer:
    """Writes formulas; parts that occur several times in long ones have names q1, q2, ..."""

    def __init__(self, coordinates: Sequence[str], names: Sequence[str], outputs: Sequence[Expression]) -> None:
        self._coordinates, self._names = coordinates, names
        self.parts: dict[Expression, int] = {}
        nodes, sizes = in_order(outputs), dict[Expression, int]()
        for e in nodes:
            sizes[e] = 1 + sum(sizes[a] for a in e.arguments)
        if sum(sizes[e] for e in outputs) > LONGEST:
            uses = Counter(a for e in nodes for a in e.arguments)
            often = [e for e in nodes if uses[e] > 1 and sizes[e] > _FEW and e.operation != "neg"]
            self.parts = {e: n for n, e in enumerate(often, 1)}

    def text(self, node: Expression, within: int = _SUM) -> str:
        """Return a formula as a part of one that holds together more strongly or less."""
        if node in self.parts:
            return _part(self.parts[node])
        written, strength = self._written(node)
        return f"<mrow><mo>(</mo>{written}<mo>)</mo></mrow>" if strength < within else written

    def _written(self, node: Expression) -> tuple[str, int]:
        operation, arguments = node.operation, node.arguments
        if operation == "constant":
            return _number(node.value), _ATOM if node.value >= 0.0 else _SUM
        if operation == "time":
            return "<mi>t</mi>", _ATOM
        if operation in ("state", "parameter"):
            return named((self._coordinates if operation == "state" else self._names)[node.value]), _ATOM
        if operation in ("add", "sub"):
            return "".join(self.terms(node, whole=True)), _SUM
        if operation in ("mul", "div", "neg"):
            return self._product(node)
        if operation == "pow":
            return f"<msup>{self._row(arguments[0], _ATOM)}{self._row(arguments[1])}</msup>", _POWER
        if operation == "sqrt":
            return f"<msqrt>{self.text(arguments[0])}</msqrt>", _ATOM
        if operation == "fabs":
            return f"<mrow><mo>|</mo>{self.text(arguments[0])}<mo>|</mo></mrow>", _ATOM
        if operation in ("mod", "fmod"):
            return f"{self.text(arguments[0], _PRODUCT)}<mo>mod</mo>{self.text(arguments[1], _PRODUCT)}", _SUM
        if operation == "select":
            sign, above, below = arguments
            condition = self.text(sign.arguments[0] if sign.operation in ("side", "sign", "sgn") else sign)
            rows = (
                (above, f"<mtext>if</mtext>{_SPACE}{condition}<mo>&gt;</mo><mn>0</mn>"),
                (below, "<mtext>else</mtext>"),
            )
            cells = "".join(f"<mtr><mtd>{self.text(e)}</mtd><mtd>{when}</mtd></mtr>" for e, when in rows)
            return f"<mrow><mo>{{</mo><mtable>{cells}</mtable></mrow>", _ATOM
        inner = "<mo>,</mo>".join(self.text(a) for a in arguments)
        name = escape({"fmin": "min", "fmax": "max", "side": "sgn", "sign": "sgn"}.get(operation, operation))
        short = len(arguments) == 1 and arguments[0].operation in ("state", "time", "parameter")
        if short:
            return f"<mi>{name}</mi><mo>&#x2061;</mo>{_SPACE}{inner}", _PRODUCT
        return f"<mi>{name}</mi><mo>&#x2061;</mo><mrow><mo>(</mo>{inner}<mo>)</mo></mrow>", _ATOM

    def _row(self, node: Expression, within: int = _SUM) -> str:
        return f"<mrow>{self.text(node, within)}</mrow>"

    def terms(self, node: Expression, whole: bool = False) -> list[str]:
        """Return the terms of a sum, with their signs; `whole`: also of one that has a name."""
        found: list[tuple[bool, Expression, bool]] = []
        pending = [(False, node, whole)]
        while pending:
            negative, e, whole = pending.pop()
            if e.operation in ("add", "sub") and (whole or e not in self.parts):
                left, right = e.arguments
                pending += [(negative != (e.operation == "sub"), right, False), (negative, left, False)]
            else:
                found.append((negative, e, whole))
        written = list[str]()
        for negative, e, whole in found:
            minus, term = self._signed(e, whole)
            if term != _number(0.0) or len(found) == 1:
                sign = "−" if negative != minus else "+" if written else ""
                form = ' form="infix"' if written else ""
                written.append((f"<mo{form}>{sign}</mo>" if sign else "") + term)
        return written

    def _signed(self, node: Expression, whole: bool) -> tuple[bool, str]:
        """Return whether a term of a sum has the sign minus, and the rest of it."""
        if node in self.parts and not whole:
            return False, self.text(node)
        if node.operation == "constant":
            return node.value < 0.0, _number(abs(node.value))
        if node.operation in ("mul", "div", "neg"):
            negative, written, _ = self._factors(node)
            return negative, written
        return False, self._written(node)[0] if whole else self.text(node, _PRODUCT)

    def _product(self, node: Expression) -> tuple[str, int]:
        negative, written, strength = self._factors(node)
        return ("<mo>−</mo>" + written, _SUM) if negative else (written, strength)

    def _factors(self, node: Expression) -> tuple[bool, str, int]:
        """Return the sign of a product, and the rest of it: numbers, parameters, then what varies; powers together."""
        above, below, negative = list[Expression](), list[Expression](), False
        pending = [(node, True, True)]
        while pending:
            e, up, whole = pending.pop()
            if e in self.parts and not whole:
                (above if up else below).append(e)
            elif e.operation == "neg":
                negative = not negative
                pending.append((e.arguments[0], up, False))
            elif e.operation in ("mul", "div"):
                pending += [(e.arguments[1], up == (e.operation == "mul"), False), (e.arguments[0], up, False)]
            elif e.operation == "constant" and e.value < 0.0:
                negative = not negative
                (above if up else below).append(e)
            else:
                (above if up else below).append(e)
        if not below:
            return negative, self._powers(above), _PRODUCT
        top, bottom = (self._powers(factors, open_=True) for factors in (above, below))
        return negative, f"<mfrac><mrow>{top}</mrow><mrow>{bottom}</mrow></mfrac>", _ATOM

    def _powers(self, factors: Sequence[Expression], open_: bool = False) -> str:
        """Return factors side by side, powers together; `open_`: alone, a sum needs no brackets."""
        number = prod(abs(e.value) for e in factors if e.operation == "constant")
        if number == 0.0:
            return _number(0.0)
        counts = Counter(e for e in factors if e.operation != "constant")
        parts = [] if number == 1.0 and counts else [_number(number)]
        alone = open_ and len(counts) == 1 and not parts
        for e in sorted(counts, key=_rank):
            if counts[e] > 1:
                parts.append(f"<msup><mrow>{self.text(e, _ATOM)}</mrow><mn>{counts[e]}</mn></msup>")
            else:
                parts.append(self.text(e, _SUM if alone else _PRODUCT))
        return _SPACE.join(parts)


def _part(number: int) -> str:
    """Return the name of a part."""
    return f"<msub><mi>q</mi><mn>{number}</mn></msub>"


def _rank(factor: Expression) -> int:
    """Return where a factor stands in its product: parameters, what varies, formulas."""
    leaves = ("parameter", "time", "state")
    return leaves.index(factor.operation) if factor.operation in leaves else len(leaves)


def _number(value: float) -> str:
    """Return a number, multiples of pi as such."""
    for multiple, (k, n) in _FRACTIONS.items():
        for power in (1, 2):
            known = multiple if power == 1 else multiple * multiple
            if abs(value - known) < 1e-14 * known:
                up, down = k**power, n**power
                sign = "<mi>π</mi>" if power == 1 else "<msup><mi>π</mi><mn>2</mn></msup>"
                top = sign if up == 1 else f"<mn>{up}</mn>{sign}"
                return top if down == 1 else f"<mfrac><mrow>{top}</mrow><mn>{down}</mn></mfrac>"
    return f"<mn>{value:.6g}</mn>" if value >= 0 else f"<mo>−</mo><mn>{-value:.6g}</mn>"
