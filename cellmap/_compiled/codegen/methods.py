"""Integration methods by name.  A new one is an entry here and a function that writes the code of its step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isqrt, log10

from .expression import Expression, in_order
from .functions import TABLE
from .period import Step
from .rosenbrock import OwnStep, rosenbrock_steps
from .runge_kutta import Tableau, traced_steps
from .tableaus import dop853, rk45
from .taylor import taylor_steps
from .trace import CONSTANT, STATEFUL, Trace


@dataclass(frozen=True)
class Method:
    """How one integration method writes its steps.

    ``write(trace)`` returns the code of a step; ``estimate_order`` is the power of the step size at which the error
    estimate of a whole period shrinks; ``tableau`` is there for methods that can call an untraceable right-hand side.
    With ``own_steps`` each initial condition has steps of its own, and the estimate shrinks with their tolerance.
    """

    name: str
    write: Callable[[Trace], Step | OwnStep]
    estimate_order: int
    tableau: Tableau | None = None
    stretch: tuple[float, float] = (1.0, 0.0)
    own_steps: bool = False

    def margin(self, tolerance: float) -> float:
        """Factor by which the sum of local errors has to stay below a tolerance, so that the error of a period does.

        The flow stretches errors on their way, most where steps are large.  The factor covers the largest ratios of
        error to estimate that were measured on pendulums, Duffing oscillators and double pendulums.
        """
        factor, growth = self.stretch
        return factor * max(1.0, (tolerance / 1e-9) ** growth)


def taylor_method(order: int) -> Method:
    """Return the Taylor method of an order."""
    return Method("Taylor", lambda trace: taylor_steps(trace, order), order - 1, stretch=(1.0, 0.1))


def _runge_kutta(tableau: Tableau) -> Method:
    stretch = (2.0, 0.2) if tableau.order > 5 else (1.0, 0.3)
    return Method(tableau.name, lambda trace: traced_steps(trace, tableau), tableau.estimate_order, tableau, stretch)


ROSENBROCK = Method("Rosenbrock", rosenbrock_steps, 1, stretch=(2.0, 0.0), own_steps=True)
"""For stiff right-hand sides."""

_MUCH_WORK = 8  # products of series a step, up to which series are worth their work
MOST_WORK = 32
"""Products of series up to which they are worth it for states alone."""

_LONGEST_STEP = 3600  # products of terms: a step of more leaves the first cache of instructions
_MANY_SERIES = 256


def taylor_order(rtol: float, trace: Trace | None = None, expanded: Sequence[Expression] = ()) -> int:
    """Order of the Taylor method that costs least at a tolerance, as measured: 12, 15, 18 at 1e-6, 1e-9, 1e-12.

    For a right-hand side of much work, or many expressions that are expanded, two thirds of that cost no more, and are
    compiled in half the time.
    """
    order = max(8, min(20, round(6.0 - log10(rtol))))
    trace = trace and trace.with_resting_inputs()
    much = (trace is not None and series_work(trace) > _MUCH_WORK) or len(in_order(expanded)) > _MANY_SERIES
    return max(8, round(order * 2 / 3)) if much else order


_TABLEAUS = {"DOP853": dop853, "RK45": rk45}

MIXED = "mixed"
"""Taylor or DOP853, and Rosenbrock for orbits in which these are unstable, or miss the tolerance."""

METHOD_NAMES = ("auto", *_TABLEAUS, "Taylor", "Rosenbrock", MIXED)


LARGE = 16
"""States beyond which steps of traced right-hand sides are loops over states in memory, and none are series."""


def choose_method(
    name: str, trace: Trace | None, rtol: float, large: bool = False, most_work: int = _MUCH_WORK
) -> Method:
    """Return the method of that name; "auto" takes the cheaper of Taylor and DOP853 for this right-hand side.

    For a `large` system it takes DOP853, whose code does not grow with the number of states, and for one of more work
    for series than the most.

    Raises
    ------
    ValueError
        Where the Taylor method is asked for and the right-hand side has no power series that can be traced.
    """
    trace = trace and trace.with_resting_inputs()
    analytic = trace is not None and trace.is_analytic
    if name == "auto":
        name = (
            "Taylor"
            if analytic and not large and trace is not None and _shows_all(trace) and series_work(trace) <= most_work
            else "DOP853"
        )
    if name == "Taylor":
        if trace is None or not analytic:
            raise ValueError(
                "method='Taylor' needs a right-hand side of +, -, *, /, powers and analytic functions of math, without "
                "branches on the state: use method='DOP853'"
            )
        longest = isqrt(_LONGEST_STEP // max(1, series_work(trace)))
        return taylor_method(max(8, min(taylor_order(rtol), longest)))
    if name == "Rosenbrock":
        if trace is None or trace.has_branches:
            raise ValueError(
                "method='Rosenbrock' needs a right-hand side whose formulas are known, without branches: use 'DOP853'"
            )
        return ROSENBROCK
    return _runge_kutta(_TABLEAUS[name]())


def _shows_all(trace: Trace) -> bool:
    """Whether state and time enter through products and sines alone, whose series hide nothing, and quotients of them.

    A choice that parameters make hides nothing either.

    A series sees the function at one point.  Where tanh is saturated, or at the foot of a narrow bell, all of its
    coefficients vanish and a step may pass over what lies ahead; a Runge-Kutta step looks at a dozen places.  What
    divides may contain states in sines, as inertia of linkages does: with it there are no bells far from the origin.
    """
    levels, turning = trace.levels(), set[Expression]()
    plain = {"add", "sub", "mul", "neg", "state", "time"}
    for node in in_order(trace.outputs):
        level, operation = levels[node], node.operation
        is_entire = operation in TABLE and TABLE[operation].is_entire
        known = all(a in turning for a in node.arguments) and bool(node.arguments)
        if level == CONSTANT or (level == STATEFUL and (is_entire or known)):
            turning.add(node)
        divides = operation == "div" and node.arguments[1] in turning
        chooses = operation == "select" and levels[node.arguments[0]] == CONSTANT
        if not (level == CONSTANT or operation in plain or is_entire or divides or chooses):
            return False
    return True


def series_work(trace: Trace) -> int:
    """Products of series for each step, the work that grows with the square of the order."""
    levels = trace.levels()
    work = 0
    for node in in_order(trace.outputs):
        if levels[node] == STATEFUL and node.arguments:
            varying = sum(levels[a] > 0 for a in node.arguments)
            if node.operation in TABLE:
                work += TABLE[node.operation].products
            elif (node.operation in {"mul", "div"} and varying == 2) or node.operation == "pow":
                work += 1
    return work
