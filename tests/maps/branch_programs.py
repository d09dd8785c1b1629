"""Random programs with branches, statement by statement, and a reference that executes them with decisions held fixed.

Later statements use the values of earlier ones, in conditions too.  Each statement is written twice: as a user would
write it, and with every comparison, or whole part, as a question to a :class:`Decisions`.  The reference takes equal
steps with SciPy's coefficients of order 8 while the answers are held; it finds the time at which one of them no longer
holds, and there asks again.  Where both sides push back onto a surface the motion is Filippov's, each side with answers
of its own; where a second surface would be slid along as well, the orbit is given up.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate._ivp import dop853_coefficients as dop853
from scipy.integrate._ivp.rk import rk_step

_A, _B, _C = dop853.A[:12, :12], dop853.B, dop853.C[:12]
_NEAR = 1e-8  # a surface on which a state is
_EVENTS = 300
_TINY = 1e-30  # imaginary part by which rates along the motion are found

Text = tuple[str, str]
"""What a user writes, and what the reference executes."""


class GivenUpError(Exception):
    """The reference does not say where an orbit goes: two surfaces at once, or events without end."""


def _margin(answer: Any, value: Any) -> float:
    """Return how far an answer is from being untrue."""
    if isinstance(answer, bool):
        return float(value.real if answer else -value.real)
    return float(min(value.real - answer, answer + 1.0 - value.real))


@dataclass
class Decisions:
    """Answers to the questions of a program by their numbers.

    A question without an answer gets the earlier one if that is nearly true, else the one that is.
    """

    answers: dict[int, Any] = field(default_factory=dict)
    earlier: dict[int, Any] = field(default_factory=dict)
    values: dict[int, Any] = field(default_factory=dict)

    def above(self, number: int, value: Any) -> Any:
        return self._answer(number, value, bool(value.real > 0.0))

    def whole(self, number: int, value: Any) -> Any:
        return self._answer(number, value, float(math.floor(value.real)))

    def pick(self, number: int, value: Any, a: Any, b: Any) -> Any:
        return a if self.above(number, value) else b

    def _answer(self, number: int, value: Any, true: Any) -> Any:
        self.values[number] = value
        if number not in self.answers:
            old = self.earlier.get(number)
            self.answers[number] = true if old is None or _margin(old, value) < -_NEAR else old
        return self.answers[number]


@dataclass(frozen=True)
class BranchProgram:
    """A right-hand side of some dimension with a period, as text of Python and as text for the reference."""

    lines: tuple[Text, ...]
    dimension: int
    period: float

    def source(self, which: int) -> str:
        return "\n    ".join(((f"def rhs(t, x, {'pd'[which]}):"), *(line[which] for line in self.lines)))

    def function(self) -> Callable[..., Any]:
        """Return the right-hand side in plain Python."""
        names: dict[str, Any] = {n: getattr(math, n) for n in ("sin", "tanh", "floor")} | {"np": np}
        exec(self.source(0), names)
        return names["rhs"]  # type: ignore[no-any-return]

    def image(self, place: NDArray[np.float64], step: float) -> NDArray[np.float64]:
        """Return where a period leads."""
        return _Motion(self, step).image(place)


class _Motion:
    def __init__(self, program: BranchProgram, step: float) -> None:
        self.period, self.step, self.dimension = program.period, step, program.dimension
        self.rules = []
        for functions in (math, cmath):
            names: dict[str, Any] = {n: getattr(functions, n) for n in ("sin", "tanh")}
            exec(program.source(1), names)
            self.rules.append(names["rhs"])
        self.room = np.empty((13, program.dimension))

    def rate(self, t: float, x: Any, d: Decisions) -> NDArray[np.float64]:
        return np.array(self.rules[0](t, x, d), dtype=float)

    def speed(self, t: float, x: Any, d: Decisions, number: int, f: Any) -> float:
        """Return the rate of what is asked under a number, along a motion."""
        other = Decisions(dict(d.answers))
        self.rules[1](complex(t, _TINY), [complex(u, _TINY * v) for u, v in zip(x, f, strict=True)], other)
        return float(other.values[number].imag / _TINY)

    def part(self, t: float, x: Any, mode: Any) -> tuple[float, Any]:
        """Return the part of the side above in a motion that slides, and the motion."""
        number, above, below = mode
        fs = [self.rate(t, x, d) for d in (above, below)]
        up, down = (self.speed(t, x, d, number, f) for d, f in zip((above, below), fs, strict=True))
        part = -down / (up - down)
        return part, part * fs[0] + (1.0 - part) * fs[1]

    def field(self, mode: Any) -> Callable[..., Any]:
        if isinstance(mode, Decisions):
            return lambda t, x: self.rate(t, x, mode)
        return lambda t, x: self.part(t, x, mode)[1]

    def margins(self, t: float, x: Any, mode: Any) -> dict[Any, float]:
        """Return how far a mode is from its end, by what would end it: a question on one side, or the slide itself."""
        found: dict[Any, float] = {}
        for side, d in enumerate((mode,) if isinstance(mode, Decisions) else mode[1:]):
            d.values = {}
            self.rate(t, x, d)
            found |= {(side, n): _margin(d.answers[n], v) for n, v in d.values.items()}
        if not isinstance(mode, Decisions):
            number, above, _ = mode
            for n, value in list(above.values.items()):
                if abs(abs(value) - abs(above.values[number])) < 1e-15:
                    found.pop((0, n), None)
                    found.pop((1, n), None)
            part = self.part(t, x, mode)[0]
            found["to below"], found["to above"] = part, 1.0 - part
        return found

    def stepped(self, t: float, x: Any, h: float, mode: Any) -> Any:
        f = self.field(mode)
        return rk_step(f, t, x, f(t, x), h, _A, _B, _C, self.room)[0]

    def asked_again(self, t: float, x: Any, d: Decisions, given: dict[int, Any]) -> Decisions:
        """Return decisions in which some are given; those that are clearly untrue are replaced."""
        new = Decisions(dict(given), d.answers)
        self.rate(t, x, new)
        return Decisions({n: new.answers[n] for n in new.values}, {}, new.values)

    def after(self, t: float, x: Any, mode: Any, what: Any) -> Any:
        """Return the mode after an event."""
        if what in ("to below", "to above"):
            number, above, below = mode
            side = above if what == "to above" else below
            return self.asked_again(t, x, side, {number: side.answers[number]})
        side, number = what
        d = mode if isinstance(mode, Decisions) else mode[1 + side]
        d.values = {}
        self.rate(t, x, d)
        value, old = d.values[number].real, d.answers[number]
        new = (not old) if isinstance(old, bool) else (old + 1.0 if value - old > 0.5 else old - 1.0)
        flipped = {number: new}
        if isinstance(old, bool):
            flipped |= {
                n: not d.answers[n]
                for n, v in d.values.items()
                if isinstance(d.answers[n], bool) and abs(abs(v) - abs(value)) < 1e-15
            }
        if isinstance(mode, Decisions):
            held = {n: d.answers[n] for n in flipped}
            return self.between(t, x, number, self.asked_again(t, x, d, held), self.asked_again(t, x, d, flipped), True)
        sliding, *sides = mode
        for i, other in enumerate(sides):
            other.values = {}
            self.rate(t, x, other)
            common = number in other.values and abs(other.values[number] - value) < 1e-12
            if i == side or common:
                kept = {n: v for n, v in other.answers.items() if n == sliding}
                sides[i] = self.asked_again(t, x, other, {**kept, **flipped})
        for d in sides:
            value = d.values.get(sliding)
            if value is None or (abs(value) > _NEAR and isinstance(d.answers[sliding], bool)):
                return self.asked_again(t, x, d, flipped)  # the surface has jumped away, or matters no more
        result = self.between(t, x, sliding, sides[1], sides[0], False)
        f = self.field(result)(t, x)
        for s, now in enumerate((result,) if isinstance(result, Decisions) else result[1:]):
            if s == side and number in now.answers and now.answers[number] == new:
                gone = self.speed(t, x, now, number, f) * (1.0 if new > old else -1.0)
                if gone <= 0.0:
                    raise GivenUpError("two surfaces")
        return result

    def between(self, t: float, x: Any, number: int, old: Decisions, new: Decisions, crossing: bool) -> Any:
        """Return the mode on a surface between two sides: the new one, or sliding between both."""
        above, below = (new, old) if new.answers[number] > old.answers[number] else (old, new)
        up, down = (self.speed(t, x, d, number, self.rate(t, x, d)) for d in (above, below))
        if down > 0.0 > up:
            return number, above, below
        if crossing:
            return new
        if up > 0.0 > down:
            raise GivenUpError("both sides lead away")
        return above if up > 0.0 else below

    def image(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        t, x, mode, events = 0.0, place.copy(), Decisions(), 0
        self.rate(t, x, mode)
        while t < self.period:
            h = min(self.step, self.period - t)
            before = self.margins(t, x, mode)

            def left(y: Any, u: float, mode: Any = mode, before: Any = before) -> Any:
                """Return what ends the mode before a place, None for nothing."""
                now = self.margins(u, y, mode)
                over = [e for e, m in now.items() if m < (0.0 if before[e] > 1e-10 else -1e-10)]
                return min(over, key=lambda e: now[e] - before[e]) if over else None

            y = self.stepped(t, x, h, mode)
            if not np.abs(y).max() < 1e3:
                raise GivenUpError("far away")
            if left(y, t + h) is None:
                x, t = y, (self.period if h < self.step else t + h)
                continue
            events += 1
            if events > _EVENTS:
                raise GivenUpError("events without end")
            first, last = 0.0, h
            for _ in range(60):
                middle = 0.5 * (first + last)
                if middle in (first, last):
                    break
                if left(self.stepped(t, x, middle, mode), t + middle) is None:
                    first = middle
                else:
                    last = middle
            y = self.stepped(t, x, last, mode)
            what = left(y, t + last)
            x, t = y, min(t + last, self.period)
            mode = self.after(t, x, mode, what)
        return x


def drawn(rng: np.random.Generator) -> BranchProgram:
    """Draw a program of one to three states with up to ten comparisons."""
    return _Writer(rng).program()


@dataclass
class _Writer:
    rng: np.random.Generator
    asked: int = 0
    named: int = 0
    dimension: int = 1
    omega: float = 1.0

    def number(self, low: float, high: float) -> str:
        return repr(float(np.round(self.rng.uniform(low, high), 3)))

    def one_of(self, *choices: str) -> str:
        return choices[int(self.rng.integers(len(choices)))]

    def question(self) -> int:
        self.asked += 1
        return self.asked

    def signal(self) -> str:
        return f"sin({float(self.rng.integers(1, 3)) * self.omega!r} * t + {self.number(-3, 3)})"

    def value(self) -> str:
        """Return what a branch may result in."""
        states = [f"x[{j}]" for j in range(self.dimension)]
        values = [f"v{k}" for k in range(self.named)]
        match int(self.rng.integers(6)):
            case 0:
                return self.number(-0.6, 0.6)
            case 1:
                return self.signal()
            case 2:
                return f"tanh({self.one_of(*states)} * {self.one_of(*states)})"
            case 3 if values:
                return f"{self.number(0.3, 0.9)} * {self.one_of(*values)}"
            case 4:
                return f"tanh({self.number(0.5, 2)} * {self.one_of(*states)})"
        return self.one_of(*states)

    def level(self) -> str:
        """Return what is compared: states, time, and now and then an earlier value."""
        text = f"x[{int(self.rng.integers(self.dimension))}]"
        if self.dimension > 1 and self.rng.random() < 0.4:
            text += f" + {self.number(-0.6, 0.6)} * x[{int(self.rng.integers(self.dimension))}]"
        if self.rng.random() < 0.25:
            text += f" + {self.number(0.2, 0.8)} * {self.signal()}"
        if self.named and self.rng.random() < 0.5:
            text += f" + {self.number(0.1, 0.4)} * v{int(self.rng.integers(self.named))}"
        return self.signal() if self.rng.random() < 0.1 else text

    def condition(self) -> Text:
        level, bound, k = self.level(), self.number(-0.8, 0.8), self.question()
        if self.rng.random() < 0.5:
            return f"{level} > {bound}", f"d.above({k}, {level} - {bound})"
        return f"{level} < {bound}", f"d.above({k}, {bound} - ({level}))"

    def within(self) -> Text:
        """Return a chain of two comparisons."""
        level, low, high = self.level(), self.number(-0.9, -0.1), self.number(0.1, 0.9)
        a, b = self.question(), self.question()
        return f"{low} < {level} < {high}", f"(d.above({a}, {level} - {low}) and d.above({b}, {high} - ({level})))"

    def joined(self) -> Text:
        (a, r), (b, s) = self.condition(), self.condition()
        match int(self.rng.integers(4)):
            case 0:
                return f"{a} and {b}", f"{r} and {s}"
            case 1:
                return f"not ({a} or {b})", f"not ({r} or {s})"
            case 2:
                return f"({a} and not {b})", f"({r} and not {s})"
        return f"{a} or {b}", f"{r} or {s}"

    def statement(self, room: int) -> list[Text]:
        """Return lines that give the next name a value, with at most so many comparisons."""
        name, a, b, c = f"v{self.named}", self.value(), self.value(), self.value()
        kind = int(self.rng.integers(13)) if room > 2 else int(self.rng.integers(7, 13)) if room > 1 else 9
        lines: list[Text] = []

        def line(text: str, *parts: Text) -> None:
            """Write a line, each of whose gaps is filled as a user would and with questions."""
            lines.append((text.format(*(p for p, _ in parts)), text.format(*(q for _, q in parts))))

        def pick(plain: str, value: str, yes: str, no: str) -> None:
            line(f"{name} = {{}}", (plain, f"d.pick({self.question()}, {value}, {yes}, {no})"))

        match kind:
            case 0:
                for word, value in (("if", a), ("elif", b)):
                    line(f"{word} {{}}:", self.condition())
                    line(f"    {name} = {value}")
                line("else:")
                line(f"    {name} = {c}")
            case 1:
                line("if {}:", self.condition())
                inner = self.condition() if self.rng.random() < 0.5 else self.within()
                line(f"    {name} = {a}")
                line("    if {}:", inner)
                line(f"        {name} = {name} + {b}")
                line("else:")
                line(f"    {name} = {c}")
            case 2:
                line(f"{name} = ({{}}) * ({a}) + ({{}}) * ({b})", self.condition(), self.condition())
            case 3:
                line(f"{name} = ({{}}) * ({{}}) * ({a})", self.condition(), self.condition())
            case 4:
                level, low, high = self.level(), self.number(-0.8, -0.2), self.number(0.2, 0.8)
                outer, inner_question = self.question(), self.question()
                inside = f"d.pick({inner_question}, {level} - {low}, {level}, {low})"
                clipped = f"d.pick({outer}, {level} - {high}, {high}, {inside})"
                line(f"{name} = {{}}", (f"np.clip({level}, {low}, {high})", clipped))
            case 5:
                line(f"{name} = {a} if {{}} else ({b} if {{}} else {c})", self.within(), self.condition())
            case 6 | 7:
                line(f"{name} = {a} if {{}} else {b}", self.joined())
            case 8:
                line(f"{name} = {a} if {{}} else {b}", self.within())
            case 9:
                condition = self.condition()
                line(f"{name} = {a}")
                line("if {}:", condition)
                line(f"    {name} = {name} - {b}")
            case 10:
                level, k, w = self.level(), self.question(), self.one_of("floor", "round", "mod")
                scaled = f"{self.number(0.8, 1.6)} * ({level})"
                whole = {"floor": scaled, "round": f"{scaled} + 0.5", "mod": f"({scaled}) / 0.7"}[w]
                if w == "mod":
                    line(f"{name} = {{}}", (f"({scaled}) % 0.7", f"{scaled} - 0.7 * d.whole({k}, {whole})"))
                else:
                    line(f"{name} = 0.3 * {{}}", (f"{w}({scaled})", f"d.whole({k}, {whole})"))
            case 11:
                level = self.level()
                match self.one_of("abs", "max", "min", "sign", "where"):
                    case "abs":
                        pick(f"abs({level})", level, level, f"-({level})")
                    case "max":
                        pick(f"max({level}, {a})", f"{level} - ({a})", level, a)
                    case "min":
                        pick(f"min({level}, {a})", f"{level} - ({a})", a, level)
                    case "sign":
                        pick(f"0.4 * np.sign({level})", level, "0.4", "-0.4")
                    case "where":
                        pick(f"np.where({level} > 0.1, {a}, {b})", f"{level} - 0.1", a, b)
            case 12:
                line(f"{name} = ({{}}) * ({a})", self.condition())
        self.named += 1
        return lines

    def program(self) -> BranchProgram:
        self.dimension, self.omega = int(self.rng.integers(1, 4)), float(np.round(self.rng.uniform(0.7, 2.0), 3))
        lines: list[Text] = []
        most = int(self.rng.integers(2, 11))
        while self.asked < most:
            lines += self.statement(most - self.asked)
        force = f"{self.number(0.3, 1.2)} * {self.signal()}"
        force += "".join(f" + {self.number(-0.7, 0.7)} * v{k}" for k in range(self.named))
        held = f"{self.number(-1.5, -0.6)} * x[0]"
        match self.dimension:
            case 1:
                rates = f"{held} + {force}"
            case 2:
                rates = f"x[1], {held} - {self.number(0.1, 0.4)} * x[1] + {force}"
            case _:
                rates = f"x[1] - 0.2 * x[2], {held} - 0.3 * x[1] + {force}, -0.8 * x[2] + 0.4 * x[0] + 0.3 * v0"
        lines.append((f"return ({rates},)",) * 2)
        return BranchProgram(tuple(lines), self.dimension, 2.0 * math.pi / self.omega)
