"""Marks of functions that are written in the language of loops, and codes with which they may end."""

from __future__ import annotations

import functools
from collections.abc import Callable
from enum import IntEnum
from typing import Any


class Deferred:
    """A function of the language; in Python it is the plain function.

    Parameters
    ----------
    function : callable
        What is compiled.
    contract : bool
        Whether a product and a sum may be rounded once, together.
    vectors : bool
        Whether its innermost loops are long enough to be compiled for vectors.
    is_inlined : bool
        Whether it becomes part of those that call it.
    """

    def __init__(
        self, function: Callable[..., Any], contract: bool = True, vectors: bool = False, is_inlined: bool = False
    ) -> None:
        self.function, self.contract, self.vectors, self.is_inlined = function, contract, vectors, is_inlined
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)


class ByAddress(Deferred):
    """A function that is somewhere else: loops call it by its address, with numbers and addresses of arrays."""


class ArrayAt:
    """The operation that makes an array of an address, its elements, and a shape."""

    def __call__(self, address: Any, shape: Any) -> Any:
        """Stand in loops for the array; there is none in Python."""
        raise NotImplementedError


class Failure(IntEnum):
    """Reason why a function has ended before it returned."""

    NO_MEMORY = 1
    OUTSIDE = 2
    """An index outside of an array."""
    WRONG_VALUE = 3
    """An array of negative length, or a range with step 0."""
