"""Questions that a page may ask about an image, and messages of failures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from numpy.linalg import LinAlgError

from .._lib.checks import whole_number
from .._lib.stopping import Stopped
from . import downloads
from .accuracy import quality, verification
from .formulas import EquationError
from .images import Images, orbit
from .measures import certificate, measures
from .saddles import saddles
from .stability import stability
from .sweeps import diagram

_NO_NUMBERS = (
    "numbers became too large or too small on the way ({}): take values nearer to those of the system at first, "
    "or reset the parameters"
)


def failure(error: BaseException, request: Any) -> dict[str, Any]:
    """Return the message that says what has failed, and for typed equations where."""
    message = str(error) or type(error).__name__
    if isinstance(error, Stopped):
        message = str(error) or "cancelled"
    elif isinstance(error, LinAlgError | ArithmeticError):
        message = _NO_NUMBERS.format(message[:1].lower() + message[1:])
    elif isinstance(error, MemoryError):
        message = f"there is not enough memory ({message}): take fewer cells"
    elif not isinstance(error, TypeError | ValueError):
        message = f"{type(error).__name__}: {message}"
    told = {"type": "error", "request": request if isinstance(request, int) else None, "message": message}
    if isinstance(error, Stopped):
        told |= {"cancelled": True, **getattr(error, "facts", {})}
    if isinstance(error, EquationError):
        told |= {"line": error.line, "column": error.column}
    return told


def range_of(asked: Mapping[str, Any]) -> tuple[Any, Any, Any]:
    """Return the parameter and the ends of the range that a message names."""
    return asked.get("parameter"), asked.get("lower"), asked.get("upper")


def _number_of_samples(asked: Mapping[str, Any]) -> int:
    return whole_number("n_samples", asked.get("n_samples", 1000), 1, 20000)


QUESTIONS: Mapping[str, Callable[[Images, Mapping[str, Any]], Any]] = {
    "quality": lambda images, asked: quality(*images.seen()),
    "verify": lambda images, asked: verification(images.seen()[1], _number_of_samples(asked)),
    "certify": lambda images, asked: certificate(*images.seen()),
    "measures": lambda images, asked: measures(images.seen()[1]),
    "orbit": lambda images, asked: orbit(images.explored, *images.seen(complete=False), asked.get("point", ())),
    "saddles": lambda images, asked: saddles(*images.seen(), asked.get("longest_period", 1)),
    "diagram": lambda images, asked: diagram(*images.seen(), *range_of(asked)),
    "stability": lambda images, asked: stability(*images.seen(), asked.get("x"), asked.get("y")),
    "script": lambda images, asked: {"text": downloads.script(images.explored, *images.seen())},
    "hdf5": lambda images, asked: downloads.hdf5(images.seen()[1]),
    "netcdf": lambda images, asked: downloads.netcdf(images.seen()[1]),
}
"""Answers by what is asked, of the images of a system and the message."""
