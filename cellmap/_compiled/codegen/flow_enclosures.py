"""Enclosures of flows over boxes: steps of Taylor series with remainders (Lohner 1987; Zgliczynski 2002).

A box is carried along as the set of all x + e + D (x0 - c): a point x, known exactly, an error e of it, and the
derivative D at any point of the box.  It is known up to an error, and this and e lie in boxes of a frame Q.  In a step
of length h, with X the box around that set,

1. a set B that no orbit from X leaves during the step follows from Picard's operator: if X + [0, h] f(B) lies in B for
   f over the whole step, then all solutions exist, and stay in X + [0, h] f(B).  Derivatives are among the components.
2. The series at x, to the order K, has as its remainder the coefficient K + 1 over B; so has the series of the
   derivative of the step, W, over X.
3. x moves to the midpoint of its series and D to that of W D.  Errors become W Q times what they are in the frame, and
   what the midpoints do not know.  The frame turns to the axes that Gram and Schmidt make of W Q, for boxes that do not
   turn with the flow would grow at every step.

What depends on time alone is computed once for all boxes, at the beginning of the step and over all of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..forking import COMPILING
from ..machine_code import MachineCode, machine_code, vector_width
from .derivative import along, frame_traces
from .enclosing_steps import FirstOrderStep, SecondOrderStep, pairs_of
from .enclosures import BoxLayout, CompiledEnclosure, Lanes
from .exact_formulas import enclosable
from .expression import in_order
from .intervals import Interval, widened
from .methods import series_work
from .taylor import Series, Structure
from .trace import CONSTANT, TIMED, Trace

_LONG = 25_000  # lines, from which on it takes long to find registers
_ENOUGH = 400_000  # steps of boxes, by which code that keeps values in memory has lost as much time as it has saved


def flow_enclosure(trace: Trace, parameters: int, order: int, second: bool = False) -> CompiledEnclosure:
    """Compile the enclosure of a period of a traced right-hand side, with series of an order.

    With `second` second derivatives over the boxes are enclosed as well, and make the enclosures of others narrower.
    """
    text = flow_text(enclosable(trace), parameters, order, vector_width(), second)
    return CompiledEnclosure(_rows(len(trace.states), second), order, _CodeForSteps(text))


class _CodeForSteps:
    """Machine code for more and more steps of boxes: compiled quickly at first, for most questions are about few boxes.

    It is compiled well when it has been used for long.  Instructions have no flags, so that results have the same bits.
    """

    def __init__(self, text: str) -> None:
        self._text, self._steps = text, 0
        self._code = machine_code(text, quick=True)

    def __call__(self, steps: int) -> MachineCode:
        with COMPILING:
            self._steps += steps
            if self._steps > _ENOUGH and self._text.count("\n") <= _LONG:
                self._code = machine_code(self._text)
            return self._code


def _rows(d: int, second: bool) -> BoxLayout:
    return BoxLayout.of(d, d * (d + 1) // 2 if second else 0)


def flow_text(trace: Trace, parameters: int, order: int, width: int, second: bool = False) -> str:
    """Return the text of a module with the function ``enclose`` of a flow."""
    d = len(trace.states)
    first = min(frame_traces(trace, d), key=lambda found: (series_work(found), len(in_order(found.outputs))))
    whole = _with_second_derivatives(first, d) if second else first
    lanes = Lanes(width, parameters, d)
    out, code, rows = lanes.out, lanes.code, _rows(d, second)
    memory = out.array(4 * len(whole.states) * width)
    given: Any = code, lanes.p
    structures: Any = (first if second else trace, order), (whole, order), (whole, order + 1)
    each: Any = [(Series(Structure(t), k, *given), k) for t, k in structures]
    for series, _ in each:
        series.write(CONSTANT, 0)
    with out.loop("step", "%steps") as step:
        t = code.loaded("%times", out.whole("mul", step, 2))
        h = Interval(code, out.argument("%length"), out.argument("%spread"))
        half = h * 0.5
        middle = t + half
        meanwhile = Interval(code, middle.m, widened(middle.r, half.reach))
        parts = [h * code.reciprocal(k) for k in range(1, order + 2)]
        for series, last in each:
            series.start_step(t if last == order else meanwhile, h, parts)
            for k in range(last):
                series.write(TIMED, k)
        with lanes.boxes() as box:
            write: Any = SecondOrderStep if second else FirstOrderStep
            write(lanes, rows, box, [series for series, _ in each], order, h, memory).write()
    return lanes.module(
        "ptr noalias %state, i64 %count, i64 %stride, ptr noalias %p, "
        "i64 %steps, ptr noalias %times, double %length, double %spread"
    )


def _with_second_derivatives(trace: Trace, d: int) -> Trace:
    """Return the trace of (x, w, ...) -> (f, Df w, ...) with D2f w w' + Df v behind it, for all pairs of w and w'."""
    graph, states, outputs = trace.graph, list(trace.states), list(trace.outputs)
    vectors = [states[(1 + k) * d : (2 + k) * d] for k in range(d)]
    for j, k in pairs_of(d):
        v = [graph.node("state", value=len(states) + i) for i in range(d)]
        seeds = dict(zip((*states[:d], *vectors[j]), (*vectors[k], *v), strict=True))
        outputs += along(graph, trace.outputs[(1 + j) * d : (2 + j) * d], seeds)
        states += v
    return replace(trace, states=tuple(states), outputs=tuple(outputs))
