"""Right-hand sides are tried out when a system is made: what they return, their period, and their angles."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._compiled.codegen.captured import captured
from .._compiled.codegen.expression import ImpureError
from .._compiled.codegen.trace import StateMisusedError
from .misread import PLACES, asks_for_more, called_twice, differ, misread, short, trial_state
from .periodicity import InTime, check_periodic


def try_right_hand_side(system: Any, in_time: InTime) -> None:
    """Call the right-hand side at a few times and states; check what it returns, its period and its angles."""
    places = trial_state(system.dimension)
    angles = [(j, c) for j, c in enumerate(system.axes) if c.period is not None]
    functions = "rhs" if system.switches is None else "rhs with its switches"
    failure: Exception | None = None
    checked = False
    before = captured(system.rhs)
    for fraction in PLACES:
        t = fraction * system.length
        try:
            now = called_twice(functions, system.derivative, t, places)
            turned = [
                system.derivative(t, [*places[:j], places[j] + (c.period or 0.0), *places[j + 1 :]]) for j, c in angles
            ]
        except (ImpureError, StateMisusedError):
            raise
        except (AttributeError, NameError, TypeError) as error:
            raise misread(system.rhs, system.switches, (t, places, system.parameters), system.axes, error) from error
        except Exception as error:
            failure = error
            continue  # outside the domain of the right-hand side; other places may be inside
        if len(now) != system.dimension:
            names = ", ".join(c.name for c in system.axes)
            raise ValueError(
                f"rhs returns {len(now)} components for {system.dimension} coordinates ({names}): "
                "return one derivative for each coordinate"
            )
        if any(isinstance(v, complex) for v in now):
            failure = TypeError(f"rhs returns {now!r}: its components must be real numbers")
            continue  # outside the domain of a power
        if not all(isinstance(v, int | float | np.floating | np.integer) for v in now):
            raise TypeError(f"rhs returns {now!r}: its components must be real numbers")
        for (_, c), there in zip(angles, turned, strict=True):
            if differ(now, there):
                raise ValueError(
                    f"coordinates: rhs is {short(now)} and one period of {c.name} further on {short(there)}, so "
                    f"{c.name} is not an angle of period {c.period:g}; give period= its period, or the "
                    "name alone if it is no angle"
                )
        checked = True
    if captured(system.rhs) != before:
        raise ValueError(
            "rhs changes a value outside of it: it must depend on t, x and p alone, for it is not called in the "
            "order of time. Declare events at which the state jumps as impacts=[Impact(guard, reset)]"
        )
    if not checked and asks_for_more(failure):
        assert failure is not None, "nothing was checked"
        arguments = (0.0, places, system.parameters)
        raise misread(system.rhs, system.switches, arguments, system.axes, failure) from failure
    if not checked and isinstance(failure, TypeError):
        raise failure
    if not checked:
        raise ValueError(
            f"rhs fails at every state tried, such as {places} ({failure}): check its domain, and that "
            "there is one coordinate for each state variable"
        ) from failure
    check_periodic(functions, in_time, system.length)
