"""Functions that numba compiles: right-hand sides whose formulas cannot be traced, and what they call.

Numba takes half a second to be imported; it is imported when such a right-hand side is compiled.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from typing import Any

from .._lib.computed import computed_once

LOOP: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, "boundscheck": False}
"""Options of the compiler, in one place.

``error_model="numpy"`` removes the zero-division branch that would keep LLVM from vectorising a loop.
``fastmath={"contract"}`` allows fused multiply-add and nothing else: full fastmath would delete the tests for NaN on
which the labels of failed initial conditions rest.
"""

INLINE: dict[str, Any] = {k: v for k, v in LOOP.items() if k != "nogil"} | {"forceinline": True}
"""Of a function called in the body of a loop over lanes; it must vanish into the loop, or the loop stays scalar."""

OF_USERS = INLINE | {"boundscheck": True, "error_model": "python"}
"""Of functions that users write: what Python raises they raise, also beyond the end of an array and for ``1 // 0``."""

PERIOD = "void(CPointer(i8), CPointer(f8), CPointer(i8), f8, f8, CPointer(f8), CPointer(f8), i8)"
"""Numba's signature of a period, as :mod:`cellmap._compiled.kernels.calls` has it in words."""


def whole(x: Any) -> int:
    """Stand for ``int`` in compiled functions, whose whole numbers have 64 bits."""
    if not abs(x) < 2.0**63:
        raise OverflowError("a whole number is larger than 2**63")
    return int(x)


class ForNumba:
    """A function that numba compiles into those that call it; in Python it is the plain function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)

    @computed_once
    def dispatcher(self) -> Any:
        """What numba makes of the function."""
        return numba().njit(**INLINE)(self.function)


@functools.cache
def numba() -> Any:
    """Import numba, which takes each :class:`ForNumba` for what it makes of it."""
    module = importlib.import_module("numba")
    extending, registry = (importlib.import_module(f"numba.{name}") for name in ("extending", "core.registry"))

    types = registry.cpu_target.typing_context

    def type_of_what_it_stands_for(value: ForNumba, context: Any) -> Any:
        shown = value.dispatcher
        types.refresh()
        return types.resolve_value_type(shown)

    extending.typeof_impl.register(ForNumba, type_of_what_it_stands_for)
    return module
