"""Periodically forced systems, given by their right-hand sides."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._compiled.codegen.kernel import over_states
from .._compiled.codegen.trace import as_state, parameter_record
from .._lib.arrays import Floats
from .._lib.checks import (
    changed_parameters,
    check_mapping,
    finite_number,
    finite_points,
    known_parameter,
    label,
    named,
    parameter_values,
    parameters_in_words,
    real_array,
    shown,
)
from .._lib.computed import computed_once
from .._lib.signatures import checked
from .coordinates import Coordinate, as_coordinates
from .impacts import REMEDY, Impact, check_ends, in_time, joined, try_impact
from .misread import PLACES, as_numbers, lacking, trial_state
from .periodicity import InTime, check_periodic, shortest_period
from .scipy_signature import with_parameters
from .sympy_equations import with_sympy
from .trials import try_right_hand_side

RightHandSide = Callable[..., Sequence[float]]
"""``rhs(t, x, p)``, or ``rhs(t, x, p, s)`` with the signs of switching functions."""

StateFunction = Callable[[float, Sequence[float], Any], Sequence[float]]
"""Functions ``f(t, x, p)`` of time, state and parameters that return a tuple."""


@dataclass(frozen=True, eq=False)
class ForcedSystem:
    """A system dx/dt = rhs(t, x, p) whose right-hand side is periodic in time.

    For an autonomous system, choose any period.  A discontinuous (Filippov) right-hand side, as with dry friction, is
    given with its `switches`: functions whose zeros are the switching surfaces, and whose signs s are its fourth
    argument.  On a surface towards which both vector fields point the solution is in a sliding mode (sticking, for dry
    friction) in the sense of Filippov (1988): s takes the value between -1 and 1 that keeps the solution on the
    surface.

    Parameters
    ----------
    rhs : callable
        Pure function ``rhs(t, x, p)`` of time, the tuple of state variables and the named tuple of parameters; returns
        the tuple of derivatives.  Write it with :mod:`math` and plain arithmetic.  With `switches` it is
        ``rhs(t, x, p, s)``, where s is the tuple of their signs.
    params : mapping of str to float or ndarray, dataclass or namedtuple
        Parameters by name; the right-hand side reads them as ``p.name``.  Entries of arrays, ``p.K[0, 1]``, are
        parameters with names such as "K[0, 1]".
    period : float or callable
        Period of the forcing, in the unit of t, or a function of the parameters that returns it (for a period that
        depends on a parameter).
    coordinates : sequence of str or Coordinate
        Name of each state variable; use :func:`angle` for angles.
    name : str, optional
        Name for files and plots; by default the name of `rhs`.
    switches : callable, optional
        Switching functions: ``switches(t, x, p)`` returns the tuple of smooth functions at whose zeros `rhs` is
        discontinuous.  Between the surfaces, and for fixed signs, `rhs` must be smooth; on a surface it must be affine
        in its sign (any function of one sign is).
    impacts : sequence of Impact, optional
        Events at which the state jumps: walls, moving tables, kicks at given times.  After ever smaller impacts on a
        surface a state rests on it until the acceleration lifts it off.
    ends : mapping of str to callable, optional
        Ends of orbits by name, such as ``{"capsized": lambda t, x, p: abs(x[0]) - 1.5}``: an orbit ends where such a
        guard becomes positive, located in time as impacts are, and has a label of that name.
    outputs : mapping of str to callable, optional
        Further quantities by name, functions ``f(t, x, p)`` that return a tuple, such as energies or positions of
        parts; see :meth:`output`.
    parameter_units : mapping of str to str, optional
        Units of parameters by name, such as ``{"frequency": "Hz"}``, which figures write on axes.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers, a right-hand side that returns a wrong number of components, or a
        right-hand side without the period given for time or for an angle.

    References
    ----------
    Filippov, *Differential Equations with Discontinuous Righthand Sides* (1988).

    Examples
    --------
    >>> from math import cos, pi
    >>> def rhs(t, x, p):
    ...     q, v = x
    ...     return v, q - q**3 - p.delta * v + p.gamma * cos(t)
    >>> duffing = ForcedSystem(rhs, {"delta": 0.15, "gamma": 0.2}, period=2 * pi, coordinates=("q", "v"))
    >>> duffing.derivative(0.0, (1.0, 0.0))
    (0.0, 0.2)
    >>> duffing.with_params(gamma=0.3).parameters.gamma
    0.3
    """

    _made_by: ClassVar = ""
    rhs: RightHandSide
    params: Mapping[str, float] | Any = field(repr=False)
    period: float | Callable[[Any], float]
    coordinates: Iterable[str | Coordinate]
    name: str = ""
    switches: StateFunction | None = None
    impacts: Sequence[Impact] = ()
    ends: Mapping[str, StateFunction] = field(default_factory=dict, repr=False)
    outputs: Mapping[str, StateFunction] = field(default_factory=dict, repr=False)
    parameter_units: Mapping[str, str] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if not callable(self.rhs):
            raise TypeError(f"rhs={self.rhs!r}: give a function rhs(t, x, p)")
        set_field = functools.partial(object.__setattr__, self)
        set_field("params", parameter_values(self.params))
        set_field("coordinates", as_coordinates(self.coordinates))
        set_field("name", named(self.name, self.rhs))
        if self.switches is not None and not callable(self.switches):
            raise TypeError(f"switches={self.switches!r}: give a function switches(t, x, p) that returns a tuple")
        if not isinstance(self.impacts, Sequence) or not all(isinstance(i, Impact) for i in self.impacts):
            raise TypeError(f"impacts={shown(self.impacts)}: give a sequence of Impact(guard, reset)")
        set_field("impacts", tuple(self.impacts))
        if not isinstance(self.outputs, Mapping) or not all(callable(f) for f in self.outputs.values()):
            raise TypeError(f"outputs={shown(self.outputs)}: give functions f(t, x, p) by name")
        for name in self.outputs:
            label("outputs", name)
        check_mapping("parameter_units", self.parameter_units, "of parameters to units, such as {'frequency': 'Hz'}")
        for name, unit in self.parameter_units.items():
            label(f"parameter_units[{known_parameter('parameter_units', name, self.params, 'system')!r}]", unit)
        finite_number("period", self.length, above=0.0)
        places = trial_state(self.dimension), self.parameters
        set_field("ends", check_ends(self.ends, "t, x, p", (PLACES[0] * self.length, *places)))
        try_right_hand_side(self, self._in_time)
        for k, impact in enumerate(self.impacts):
            try_impact(k, impact, self.length, self.axes, self.parameters)
        for name, guard in self.ends.items():
            check_periodic(f"ends[{name!r}]", in_time(guard, *places), self.length, REMEDY)

    @classmethod
    def from_scipy(
        cls,
        fun: Callable[..., Any],
        args: Sequence[Any] = (),
        *,
        period: float | Callable[[Any], float],
        coordinates: Iterable[str | Coordinate],
        params: Mapping[str, Any] | None = None,
        **further: Any,
    ) -> ForcedSystem:
        """Return the system of a function that :func:`scipy.integrate.solve_ivp` takes.

        Parameters
        ----------
        fun : callable
            Function ``fun(t, y)`` or ``fun(t, y, *args)`` of time, the array of states, and further arguments.
        args : sequence, optional
            Further arguments in the order of `fun`.  Those that are numbers, or arrays of them, become parameters under
            the names that `fun` has for them; others are constants.
        period, coordinates
            As for :class:`ForcedSystem`.
        params : mapping of str to float or ndarray, optional
            Further arguments by name, in place of `args` or after them.
        **further
            Other arguments of :class:`ForcedSystem`, such as `ends`.

        Returns
        -------
        ForcedSystem
            The system, whose `repr` names the parameters.

        Raises
        ------
        TypeError, ValueError
            For arguments that `fun` does not have, or without a value, and as for :class:`ForcedSystem`.

        Examples
        --------
        >>> import numpy as np
        >>> def fun(t, y, delta, gamma):
        ...     dy = np.zeros(2)
        ...     dy[0] = y[1]
        ...     dy[1] = y[0] - y[0] ** 3 - delta * y[1] + gamma * np.cos(t)
        ...     return dy
        >>> ForcedSystem.from_scipy(fun, (0.15, 0.2), period=2 * np.pi, coordinates=("q", "v"))
        ForcedSystem(fun: delta=0.15, gamma=0.2; period 6.28319)
        """
        rhs, parameters = with_parameters(fun, args, params)
        return cls(rhs, parameters, period, coordinates, **further)

    @classmethod
    def from_sympy(
        cls, equations: Any, params: Mapping[Any, Any], period: Any, coordinates: Any = None, **further: Any
    ) -> ForcedSystem:
        """Return the system of equations of motion that are written with SymPy.

        Parameters
        ----------
        equations : list, dict, Matrix, LagrangesMethod or KanesMethod
            Equations, or expressions that are zero, for as many functions of time, of any order and linear in the
            highest derivatives.  Or right-hand sides of first-order equations, in the order of `coordinates` or in a
            dict with symbols or derivatives as keys.  Piecewise, Abs, Max and their like are located as events.
        params : mapping
            Values of all other symbols, by their names or by the symbols themselves.
        period : float, expression or callable
            Period of the forcing, such as ``2 * sympy.pi / omega``.
        coordinates : sequence of str or Coordinate, optional
            State variables in order: names of SymPy, others for derivatives; by default such as theta and theta_dot.
        **further
            Other arguments of :class:`ForcedSystem`, such as `ends`.

        Returns
        -------
        ForcedSystem
            The system, whose right-hand side has the formulas.

        Raises
        ------
        TypeError, ValueError
            For what is no system of ordinary differential equations, or has symbols without a value.

        Examples
        --------
        >>> import sympy
        >>> t, delta = sympy.symbols("t delta")
        >>> q = sympy.Function("q")(t)
        >>> duffing = sympy.Eq(q.diff(t, 2) + delta * q.diff(t) - q + q**3, 0.2 * sympy.cos(t))
        >>> ForcedSystem.from_sympy(duffing, {delta: 0.15}, 2 * sympy.pi, ("q", "v"))
        ForcedSystem(equations: delta=0.15; period 6.28319)
        """
        return cls(*with_sympy(equations, params, period, coordinates), **further)

    def __repr__(self) -> str:
        values = parameters_in_words(self.params)
        shorter = self.shortest_period
        times = f", {self.length / shorter:.0f} times the shortest" if 0.0 < shorter < self.length else ""
        return f"ForcedSystem({self.name}: {values}; period {self.length:g}{times})"

    @property
    def dimension(self) -> int:
        """Number of state variables."""
        return len(self.axes)

    @property
    def axes(self) -> tuple[Coordinate, ...]:
        """State variables, as :class:`Coordinate` objects."""
        return as_coordinates(self.coordinates)

    @computed_once
    def functions(self) -> tuple[Callable[..., Any] | None, ...]:
        """Right-hand side, switching functions, and guards and resets of all impacts, None where there are none."""
        return (self.rhs, self.switches, joined(tuple(self.impacts), tuple(self.ends.values())))

    @property
    def length(self) -> float:
        """Period as a number, for the parameters of this system."""
        if not callable(self.period):
            return self.period
        try:
            return self.period(self.parameters)
        except AttributeError as error:
            raise lacking("period", error) from error
        except (ArithmeticError, TypeError) as error:
            raise ValueError(
                f"period={shown(self.period)} fails for the parameters {self.parameters}: {error}"
            ) from error

    @computed_once
    def shortest_period(self) -> float:
        """Shortest period that the right-hand side is seen to have, a whole fraction (1 to 1/1000) of the given one.

        It is 0 where time is seen to play no part, and the given one where impacts or switches are defined, which may
        have another period.  A multiple of the shortest period is right, and some want it: for a second forcing that is
        off at these parameters, or to see every n-th iterate.  So it is no error and brings no warning, but `repr`
        says it.  Often it is a frequency given as a period (5 for ``cos(2 * pi * 5 * t)``, of period 1/5): each period
        of the map then is so many cycles of the forcing, and takes as much longer.

        Examples
        --------
        >>> from math import cos, pi
        >>> ForcedSystem(lambda t, x, p: (cos(2 * pi * 5 * t) - x[0],), {}, 5.0, ("x",), "five hertz")
        ForcedSystem(five hertz: ; period 5, 25 times the shortest)
        """
        length = self.length
        if self.functions[1:] != (None, None):
            return length
        return shortest_period(self._in_time, length)

    @property
    def _in_time(self) -> InTime:
        """The right-hand side as a function of time, at one state."""
        rhs, state, parameters = self.rhs, as_state(self.rhs, trial_state(self.dimension)), self.parameters
        if self.switches is not None:
            return lambda t: self.derivative(t, state)
        return lambda t: rhs(t, state, parameters)

    @property
    def cycles(self) -> str:
        """Remedy for warnings: the shortest period, where the given one is a multiple of it; "" elsewhere."""
        shorter = self.shortest_period
        if not 0.0 < shorter < self.length:
            return ""
        return (
            f". rhs repeats {self.length / shorter:.0f} times in period={self.length:g}: give {shorter:.6g}, if a "
            "frequency was meant"
        )

    @property
    def parameters(self) -> Any:
        """Parameters as the named tuple that the right-hand side receives."""
        return parameter_record(tuple(self.params))(*self.params.values())

    def with_params(self, values: Mapping[str, ArrayLike] | None = None, /, **changes: ArrayLike) -> ForcedSystem:
        """Return the system with some parameters changed, as in ``with_params(gamma=0.3)``.

        Parameters
        ----------
        values : mapping of str to float or array_like, optional
            New values by the names of parameters, ``with_params({"gamma": 0.3})``.
        **changes : float or array_like
            The same as keywords, which come after those of `values`.

        Raises
        ------
        ValueError
            For a name that the system does not have.
        """
        entries = changed_parameters(self.params, values, changes, "system")
        return replace(self, params={**self.params, **entries})

    def signs(self, t: float, x: Sequence[float]) -> tuple[float, ...]:
        """Return the signs of the switching functions at one time and state: -1, 1, and 0 on a surface."""
        if self.switches is None:
            return ()
        values = map(float, self.switches(t, as_state(self.switches, x), self.parameters))
        return tuple(float(h > 0.0) - float(h < 0.0) for h in values)

    def derivative(self, t: float, x: Sequence[float], signs: Sequence[float] | None = None) -> tuple[float, ...]:
        """Return the right-hand side at one time and state, evaluated in plain Python.

        On a switching surface `signs` select the side; by default they are those of the switching functions, and on a
        surface the mean of both sides is returned.
        """
        if self.switches is None:
            return as_numbers(self.rhs(t, as_state(self.rhs, x), self.parameters))
        own = self.signs(t, x)
        chosen = own if signs is None else tuple(finite_number("signs", s, at_least=-1.0, at_most=1.0) for s in signs)
        if len(chosen) != len(own):
            raise ValueError(f"signs={signs!r}: give {len(own)}, one for each switching function")
        return as_numbers(self.rhs(t, as_state(self.rhs, x), self.parameters, chosen))

    def fun(self, t: float, y: Floats) -> Floats:
        """Return the right-hand side in the form that :func:`scipy.integrate.solve_ivp` takes."""
        return np.array(self.derivative(t, tuple(y)), dtype=float)

    @checked
    def output(self, name: str, t: ArrayLike, states: ArrayLike) -> Floats:
        """Return one of the `outputs` at given times and states.

        Parameters
        ----------
        name : str
            One of `outputs`.
        t : array_like, shape (...)
            Times, which broadcast against the states.
        states : array_like, shape (..., dimension)
            States.

        Returns
        -------
        ndarray, shape (..., components)
            Values of the function.
        """
        if not isinstance(name, str) or name not in self.outputs:
            raise ValueError(f"name={shown(name)}: the outputs of {self.name} are {sorted(self.outputs) or 'none'}")
        points = finite_points("states", states, self.dimension)
        times = real_array("t", t)
        try:
            np.broadcast_shapes(times.shape, points.shape[:-1])
        except ValueError:
            raise ValueError(
                f"t has the shape {times.shape}, which does not broadcast with states of {points.shape}"
            ) from None
        return over_states(self.outputs[name], times, points, self.params)
