"""Flow of a system over an interval of time, integrated in SIMD lanes."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._compiled.codegen.evaluation import evaluated
from .._compiled.codegen.expression import UntraceableError
from .._compiled.codegen.kernel import (
    PeriodKernel,
    flow_kernel,
    frame_kernel,
    jet_flow_kernel,
    stiff_frame_kernel,
    switching_kernel,
)
from .._compiled.codegen.methods import LARGE, MIXED
from .._compiled.kernels.blocks import LANES, ROUNDED, wrap_rows
from .._compiled.kernels.periods import INACCURATE, PROBE, Motion, Motions, integrate, sample
from .._lib.arrays import Bools, Floats, Ints
from .._lib.computed import computed_once
from .coordinates import turns_of
from .formulas import Formulas
from .misread import check_compiled, trial_state, warn_of_cost
from .orbit_batch import Orbits
from .reversals import warn_of_reversals
from .system import ForcedSystem

_RUNGS_PER_OCTAVE = 4
_SHORT = 1e-9  # step that tells a right-hand side
_FINER = 0.1  # part of the tolerance with which errors of derivatives are estimated
_FIRST = 64  # orbits, or periods of one orbit, that a compiled loop takes before it is known what they cost
_GROWTH = 8
_STEPS_AT_ONCE = 2**22  # steps times components in a call: tenths of a second; lanes are filled at each number of steps
_RUNGS_TO_COMPARE = 3  # rungs between two numbers of steps whose images are compared; of own steps all that are climbed
_AGREEMENT = 2.0  # two images differ by less than the tolerance over this
_REGROWN = 3  # periods in which a component can fall below its tolerance and grow again
_AT_POLES, _ENOUGH = 1e-9, 8192  # tolerance of a step (looser ones pass poles), and steps, for orbits that may end
_SAFETY = 2.0  # error expected of the steps that are chosen, under the tolerance by this factor

Turns = tuple[Floats, Floats]


def flow(
    known: Formulas,
    begin: float,
    length: float,
    rtol: float,
    atol: ArrayLike,
    method: str,
    max_steps: int,
    bounds: ArrayLike = np.inf,
) -> Flow:
    """Return the motion of a system from the time `begin` over a time `length`.

    The tolerance is meant for the whole of that time, as :func:`stroboscopic_map` describes it.  Coordinates of states
    on which the motion is tried are not larger than `bounds`.
    """
    system = known.system
    turn, floors = turns_of(system.axes)[1], np.full(system.dimension, atol, dtype=np.float64)
    warn_of_reversals(known)
    chosen = Flow(
        kernel=_kernel(known, "auto" if method == MIXED else method, rtol),
        stiff=_kernel(known, "Rosenbrock", rtol) if method == MIXED else None,
        parameters=_values(system),
        begin=begin,
        length=length,
        rtol=rtol,
        atol=floors,
        max_steps=max_steps,
        largest=np.where(turn > 0, 0.5 * turn, np.inf),
        fewest_steps=_fewest_steps(known, length, max(rtol, float(floors.min()))),
        unknown_formulas=known.unknown,
        keeps_zero=_keeps_zero(known, floors / length),
    )
    if known.unknown and not known.has_events:
        kernel, parameters, names = chosen.kernel, chosen.parameters, tuple(system.params)
        check_compiled("rhs", system.derivative, kernel.advance, system.dimension, parameters, _SHORT)
        place = (*trial_state(system.dimension), *parameters.tolist())
        name = f"rhs of {system.name}"
        warn_of_cost(name, known.unknown, system.rhs, names, place, kernel.advance, kernel.method)
    if method == "auto" and known.plain is not None and not known.plain.has_branches:
        chosen = _fitting(chosen, known)
    return replace(chosen, checked=_checked(chosen, turns_of(system.axes), bounds))


@functools.lru_cache(maxsize=16)
def _ladder(max_steps: int) -> Ints:
    """Numbers of steps to choose from, four to an octave."""
    rungs = np.unique([round(4 * 2 ** (k / _RUNGS_PER_OCTAVE)) for k in range(30 * _RUNGS_PER_OCTAVE)])
    return np.unique(np.minimum(rungs, max_steps))


_OWN_STEPS = 16.0  # own steps for each equal step that is allowed
_SAMPLES = 32
_FEW_STEPS = 32
_MANY_STEPS = 256
_TRIAL_STEPS = 1024
_RATES = 3
_POWERS = 32
_STABLE = 3.0  # eigenvalue times the size of a step up to which no explicit method is unstable
_ROSENBROCK_WORK = 3  # work of a step, in steps of the explicit methods, at most: 1.1 to 2.1 with 2 to 8 states
_FEWEST = -0.25  # power of the tolerance: so many steps a method of order 4, as Rosenbrock's estimate, takes or more


def _fitting(explicit: Flow, known: Formulas) -> Flow:
    """Return the flow by an explicit method, by the method for stiff systems, or by both, whichever is least work.

    They are tried on a few initial conditions, the second and third only where the first would take many steps.
    """
    points = np.random.default_rng(0).normal(scale=1.5, size=(_SAMPLES, known.system.dimension))
    expected = explicit.steps_at(points, _FEW_STEPS)
    # Steps that pass over a thin layer do not see it: many are only believed if as many of them expect the same.
    if expected <= 2 * _FEW_STEPS:
        return explicit
    if expected <= _MANY_STEPS and explicit.steps_at(points, int(np.ceil(expected))) <= _MANY_STEPS:
        return explicit
    if known.system.dimension > LARGE and _fastest_rate(known, points) * explicit.length < _STABLE * _FEW_STEPS:
        return explicit  # its steps are not short for the sake of stability
    try:
        kernel = _kernel(known, "Rosenbrock", explicit.rtol)
    except (UntraceableError, ValueError):
        return explicit
    stiff, both = replace(explicit, kernel=kernel), replace(explicit, stiff=kernel)
    (missed_stiff, steps), tried = (
        _trial(replace(m, max_steps=min(m.max_steps, _TRIAL_STEPS)), points) for m in (stiff, both)
    )
    work = {tried: both, (missed_stiff, _ROSENBROCK_WORK * steps): stiff}
    # More than four times as many steps as would be worth it need not be tried.
    enough = int(4.0 * min(work)[1] / _SAMPLES)
    bound = explicit.max_steps if missed_stiff else min(explicit.max_steps, max(enough, _FEW_STEPS))
    work[_trial(replace(explicit, max_steps=bound), points)] = explicit
    return work[min(work)]


def _fastest_rate(known: Formulas, points: Floats) -> float:
    """Return the largest size of an eigenvalue of the derivative at a few states, by powers of difference quotients."""
    system, traced, found = known.system, known.plain, 0.0
    assert traced is not None, "only formulas are tried in two ways"
    shared = dict(zip((traced.time, *traced.parameters), (0.0, *_values(system)), strict=True))
    for point in points[:_RATES]:
        states = np.vstack([point, point + _SHORT * np.eye(system.dimension)])
        values = evaluated(traced.outputs, shared | dict(zip(traced.states, states.T, strict=True)))
        rates = np.stack([np.broadcast_to(v, len(states)) for v in values])
        matrix = (rates[:, 1:] - rates[:, :1]) / _SHORT
        if not np.isfinite(matrix).all():
            continue
        vector, growth = np.random.default_rng(0).normal(size=system.dimension), 0.0
        for k in range(2 * _POWERS):
            vector = (matrix * vector).sum(axis=1)
            size = float(np.sqrt((vector * vector).sum())) or 1.0
            vector, growth = vector / size, growth + np.log(size) * (k >= _POWERS)
        found = max(found, float(np.exp(growth / _POWERS)))
    return found


_CHECKED = 1.0 / 1024  # fraction of the orbits
_SCALES = (1.0, 10.0)
_SURE = 0.4  # tolerances, an error up to which no other orbit is expected to miss one
_FINER_STEPS = 1e-2
_CLEAR = 1e-11  # tolerance from which on errors are clear of those of rounding


def _checked(motion: Flow, turns: Turns, bounds: ArrayLike) -> float:
    """Return the fraction of orbits whose images are to be compared with those of more steps.

    It is small, or all of them where the error of a sample of orbits, of some sizes and over two periods, comes near
    the tolerance or beyond: the flow stretches errors more than the margin allows for, or steps pass over something.
    """
    rtol, atol = max(motion.rtol, _CLEAR), np.maximum(motion.atol, _CLEAR)
    usual = replace(motion, max_steps=min(motion.max_steps, _TRIAL_STEPS), rtol=rtol, atol=atol)
    finer = replace(usual, rtol=rtol * _FINER_STEPS, atol=atol * _FINER_STEPS)
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.normal(scale=s, size=(_SAMPLES // 4, len(motion.largest))) for s in _SCALES])
    points = np.clip(points, -np.asarray(bounds), bounds)
    for _ in range(2):
        wrap_rows(points, np.zeros(points.shape, np.int64), *turns)
        found, precise = Orbits.starting(points.copy()), Orbits.starting(points.copy())
        usual(found)
        finer(precise)
        both = (found.status == 0) & (precise.status <= INACCURATE)
        rounded = ROUNDED * np.maximum(np.abs(points), np.abs(precise.points))[both].max(axis=1, keepdims=True)
        points = precise.points[both]
        sizes = np.minimum(np.abs(points), motion.largest)
        ratios = (np.abs(found.points[both] - points) - rounded) / (atol + rtol * sizes)
        if (ratios > _SURE).any():
            return 1.0
    return _CHECKED


def _trial(motion: Flow, points: Floats) -> tuple[int, int]:
    """Return how many of some orbits miss the tolerance in a period, and the steps of all."""
    orbits = Orbits.starting(points.copy())
    motion(orbits)
    return int(np.count_nonzero(orbits.status)), orbits.work.evaluations // motion.kernel.stages


def tangent_flow(
    known: Formulas,
    begin: float,
    length: float,
    rtol: float,
    atol: ArrayLike,
    along: float,
    max_steps: int,
    method: str = "auto",
) -> Flow | None:
    """Return the motion of states with some tangent vectors behind each; None without known derivatives.

    States are held to the tolerances of :func:`flow`, and tangent vectors to the tolerance `along` of errors relative
    to their lengths.  With events, or by the method for stiff systems alone, there is one vector, which is held to
    `rtol`.
    """
    system = known.unchanged()
    names, d = tuple(system.params), system.dimension
    if known.has_events or known.unknown or method == "Rosenbrock":
        kernel = None
        if known.has_events:
            kernel = switching_kernel(system.functions, d, names, rtol, True)
        elif not known.unknown:
            kernel = jet_flow_kernel(system.rhs, d, names, rtol, 1, "Rosenbrock")
        return _of_derivatives(kernel, known, begin, length, rtol, max_steps, 1, atol)
    found = frame_kernel(system.rhs, d, names, rtol)
    if found is None:
        return None
    kernel, vectors = found
    stiff = stiff_frame_kernel(system.rhs, d, names, rtol, vectors) if method == MIXED else None
    turn, floors = turns_of(system.axes)[1], np.full(d, atol, dtype=np.float64)
    return Flow(
        kernel=kernel,
        stiff=stiff,
        parameters=_values(system),
        begin=begin,
        length=length,
        rtol=rtol,
        atol=np.append(floors, np.full(vectors * d, along)),
        max_steps=max_steps,
        largest=np.append(np.where(turn > 0, 0.5 * turn, np.inf), np.zeros(vectors * d)),
        fewest_steps=_fewest_steps(known, length, max(rtol, float(floors.min()))),
        vectors=vectors,
    )


def jet_flow(
    known: Formulas,
    begin: float,
    length: float,
    tolerance: float,
    max_steps: int,
    order: int,
    method: str,
    finer: bool,
) -> Flow | None:
    """Return the motion of states with their derivatives along a curve; None where these are not known.

    With `finer` the steps are those of a tenth of the tolerance.
    """
    system = known.unchanged()
    names = tuple(system.params)
    if known.has_events or known.unknown:
        return None
    methods = ("auto", "Rosenbrock") if method == MIXED else (method,)
    kernel, *stiff = (jet_flow_kernel(system.rhs, system.dimension, names, tolerance, order, m) for m in methods)
    tolerance *= _FINER if finer else 1.0
    return _of_derivatives(kernel, known, begin, length, tolerance, max_steps, order, stiff=stiff[0] if stiff else None)


def _of_derivatives(
    kernel: PeriodKernel | None,
    known: Formulas,
    begin: float,
    length: float,
    tolerance: float,
    steps: int,
    order: int,
    atol: ArrayLike | None = None,
    stiff: PeriodKernel | None = None,
) -> Flow | None:
    """Return the motion of states with derivatives up to an order, all to one tolerance, or states to that of each."""
    if kernel is None:
        return None
    d = known.system.dimension
    largest = np.full((order + 1) * d, np.inf)
    fewest = _fewest_steps(known, length, tolerance)
    floors = np.append(np.full(d, tolerance if atol is None else atol), np.full(order * d, tolerance))
    values = _values(known.system)
    return Flow(kernel, values, begin, length, tolerance, floors, steps, largest, fewest, vectors=order, stiff=stiff)


def _kernel(known: Formulas, method: str, rtol: float) -> PeriodKernel:
    system = known.unchanged()
    names, locates = tuple(system.params), method in {"auto", "Taylor"}
    if system.functions[1:] == (None, None) and not (known.has_events and locates):
        return flow_kernel(system.rhs, system.dimension, names, method, rtol, not known.unknown)
    if not locates:
        what = "impacts need" if system.impacts else "a discontinuous right-hand side needs"
        raise ValueError(f"method={method!r}: {what} method='Taylor'")
    kernel = switching_kernel(system.functions, system.dimension, names, rtol, False)
    if kernel is None:
        raise TypeError(
            f"rhs of {system.name} has switches or impacts and must therefore be plain arithmetic, branches, and "
            "analytic functions of math" + (known.unknown and f" ({known.unknown})")
        )
    return kernel


def _values(system: ForcedSystem) -> Floats:
    return np.array([float(v) for v in system.params.values()])


def _fewest_steps(known: Formulas, length: float, tolerance: float) -> int:
    """Return the steps without which the integrator might step over a part of the forcing and not see it.

    They follow from the harmonics of the right-hand side at two states that move the image by more than the tolerance.
    """
    period = known.system.length
    fewest = max((steps_of_harmonics(strengths, tolerance / period) for strengths in known.harmonics), default=1)
    return max(1, int(np.ceil(fewest * length / period)))


def _keeps_zero(known: Formulas, least: Floats) -> Bools:
    """Return which components stay zero where they are, as numbers of a species do, or move less than `least`."""
    system, rng, found = known.system, np.random.default_rng(0), np.ones(known.system.dimension, bool)
    for j, axis in enumerate(system.axes):
        for time in system.length * rng.uniform(size=3):
            state = rng.uniform(-1.0, 1.0, system.dimension)
            state[j] = 0.0
            with np.errstate(all="ignore"):
                try:
                    rate = system.derivative(float(time), tuple(state.tolist()))[j]
                except Exception:  # outside the domain of the function
                    rate = np.nan
            found[j] &= axis.period is None and abs(rate) <= 0.1 * least[j]
    return found


def steps_of_harmonics(strengths: Floats, least: float = 0.0) -> int:
    """Return half the number of the highest harmonic that has a strength of at least some size, at least 1."""
    return max(1, int((np.flatnonzero(strengths > least).max(initial=0) + 2) // 2))


def in_lanes(points: Floats) -> Floats:
    """Return points (n, d) in blocks of lanes (blocks, d, LANES), the last one filled up with copies of the first."""
    rows = np.concatenate([points, points[:1].repeat(-len(points) % LANES, axis=0)])
    return np.ascontiguousarray(rows.reshape(-1, LANES, points.shape[1]).swapaxes(1, 2))


def out_of_lanes(blocks: Floats, number: int) -> Floats:
    """Return the first points of blocks of lanes, shape (number, d)."""
    return blocks.swapaxes(1, 2).reshape(-1, blocks.shape[1])[:number]


@dataclass(frozen=True, eq=False)
class Flow:
    """The motion of a system over a stretch of time, compiled, with its tolerance.  Call it with orbits.

    ``unknown_formulas`` is the reason why the right-hand side is compiled as it is, empty where its formulas are known.
    ``vectors`` is how many vectors of derivatives are behind each state.  Orbits that no number of steps does for are
    handed over to ``stiff``, the method for stiff systems, where there is one.
    """

    kernel: PeriodKernel
    parameters: Floats
    begin: float
    length: float
    rtol: float
    atol: Floats
    max_steps: int
    largest: Floats
    fewest_steps: int
    unknown_formulas: str = ""
    checked: float = 0.0
    keeps_zero: Bools | bool = False
    vectors: int = 0
    stiff: PeriodKernel | None = None

    @property
    def method(self) -> str:
        """Name of the method, with which :func:`flow` chooses the same."""
        return MIXED if self.stiff else self.kernel.method

    @computed_once
    def numbers(self) -> Motions:
        """The numbers that the integrator takes."""
        usual = self._motion(self.kernel)
        if self.stiff is None:
            return Motions(usual)
        stiff = self._motion(self.stiff)
        fewest = max(self.rtol, float(self.atol.max())) ** _FEWEST
        unstable = min(int(np.searchsorted(usual.ladder, fewest)), len(usual.ladder) - 1)
        return Motions(usual._replace(hands_over=1, unstable=unstable), stiff._replace(price=_ROSENBROCK_WORK))

    def _motion(self, kernel: PeriodKernel) -> Motion:
        """The numbers that one method takes."""
        ladder, tolerance = _ladder(self.max_steps), max(self.rtol, float(self.atol.max()))
        margin = kernel.margin(tolerance)
        climb = (4 if kernel.own_steps else 3) * _RUNGS_PER_OCTAVE
        compared = ((climb if kernel.own_steps else _RUNGS_TO_COMPARE) - 0.5) / _RUNGS_PER_OCTAVE
        context, coarse, largest = kernel.advance.context, np.zeros(1, np.int64), self.largest
        if kernel.own_steps:
            largest = np.where(largest > 0.0, largest, np.inf)  # a vector that is forgotten has no relative error
            longest = self.length / self.fewest_steps  # or a step would pass over a pulse of the forcing
            context, coarse = (
                np.array([f * self.rtol / margin, _OWN_STEPS * steps, longest, *largest, *(f * self.atol / margin)])
                for f, steps in ((1.0, self.max_steps), (_AT_POLES / tolerance, _ENOUGH))
            )
            context, coarse = context.view(np.int64), coarse.view(np.int64)
        return Motion(
            function=kernel.advance.address,
            context=context,
            parameters=self.parameters,
            begin=float(self.begin),
            length=float(self.length),
            largest=largest,
            rtol=self.rtol / margin,
            atol=self.atol / margin,
            digit=margin / tolerance,
            ladder=ladder,
            powers=ladder.astype(float) ** kernel.estimate_order,
            lowest=min(int(np.searchsorted(ladder, self.fewest_steps)), len(ladder) - 1),
            probe=int(np.searchsorted(ladder, PROBE)),
            highest_climb=climb,
            order=kernel.estimate_order,
            safety=_SAFETY,
            trial=kernel.trial,
            checked=self.checked,
            more=2.0 ** (compared * kernel.estimate_order) / _SAFETY,
            agreement=_AGREEMENT / margin * (1.0 if self.checked == 1.0 else min(1.0, tolerance / _CLEAR)),
            floor=np.where(self.keeps_zero, self.atol, 0.0),
            lost=np.zeros(len(largest), np.int64),
            coarse=coarse,
            unstable=len(ladder),
        )

    def steps_at(self, points: Floats, steps: int) -> float:
        """Return how many steps nine in ten orbits need at most, expected from their errors at a number of steps."""
        motion, x = self.numbers.usual, in_lanes(points)
        errors, numbers = np.zeros_like(x), np.full(len(x), steps)
        self.kernel.advance(x, numbers, self.begin, self.length, self.parameters, errors)
        sizes = np.minimum(np.abs(x), self.largest[:, np.newaxis])
        floors = motion.atol[:, np.newaxis]
        with np.errstate(invalid="ignore", over="ignore"):
            ratios = (errors / (floors + motion.rtol * sizes)).max(axis=1).ravel()[: len(points)]
        ratios = np.where(ratios < 1e300, ratios, np.inf)
        return float(np.sort(steps * (motion.safety * ratios) ** (1.0 / motion.order))[len(points) * 9 // 10])

    def __call__(self, orbits: Orbits) -> None:
        """Move orbits on in place, angles unwrapped, each with the steps it needs."""
        anywhere = np.zeros(orbits.points.shape[1])
        self.advance(orbits, 1, anywhere, anywhere)

    def advance(self, orbits: Orbits, periods: int, lower: Floats, turn: Floats) -> None:
        """Advance orbits by some periods in place, with wrapped angles.

        A compiled loop takes so many orbits and periods at once that it is soon back, and Ctrl-C is heard; how many, it
        takes from the work of those before, and not from the time.
        """
        budget = _STEPS_AT_ONCE // (LARGE if self.unknown_formulas else min(len(self.largest), LARGE))
        begin, size, pace = 0, _FIRST, 1
        while begin < len(orbits):
            part = orbits[begin : begin + size]
            small = np.zeros(part.points.shape if periods > _REGROWN else (0, 0), np.uint8)
            done, some = 0, max(1, _FIRST // len(part))
            while done < periods:
                some = min(some, periods - done)
                steps = integrate(self.numbers, part.points, part.rotations, part.status, small, lower, turn, some)
                orbits.work.evaluations += steps * self.kernel.stages
                done += some
                pace = max(1, steps // some)  # of a period of these orbits
                some = max(1, min(_GROWTH * some, budget // pace))
            begin += size
            size = max(LANES, min(_GROWTH * size, budget * len(part) // pace // LANES * LANES))

    def sample(self, orbits: Orbits, begins: Floats, turn: Floats) -> Iterator[Floats]:
        """Advance orbits in place over stretches of the length of this motion, which begin at some times (m,).

        Yields the states (n, ..., d) at the ends of stretches, angles unwrapped: of many where orbits are few.
        """
        some, none = max(1, _FIRST // max(1, len(orbits))), np.zeros((0, 0), np.uint8)
        for begin in range(0, len(begins), some):
            times = begins[begin : begin + some]
            states = np.empty((len(orbits), len(times), orbits.points.shape[1]))
            steps = sample(self.numbers, times, orbits.points, orbits.rotations, orbits.status, none, turn, states)
            orbits.work.evaluations += steps * self.kernel.stages
            yield states
