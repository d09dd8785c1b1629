"""Messages between the page and the server: text with JSON, and binary ones with a header and bytes.

A binary message begins with four letters, the version, and the length of a JSON text, as little-endian numbers of four
bytes.  The text follows, padded by blanks to a multiple of eight, and then the bytes that it describes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import shown
from ..attractors.settling.labels import LABEL_NAMES

MAGIC = b"CMAP"
VERSION = 1
MOST_BYTES = 65536
"""Longest message that a page may send."""

LOWEST = min(LABEL_NAMES)
"""Label that has the code 0 in an image."""

_HEAD = struct.Struct("<4sII")


class MessageError(ValueError):
    """A message that cannot be understood."""


def decoded(text: str) -> dict[str, Any]:
    """Return the object in a message from the page, whose ``type`` is a string.

    Raises
    ------
    MessageError
        For anything else.

    Examples
    --------
    >>> decoded('{"type": "drawn", "frame": 3}')
    {'type': 'drawn', 'frame': 3}
    """
    if len(text) > MOST_BYTES:
        raise MessageError(f"message of {len(text)} characters: send at most {MOST_BYTES}")
    try:
        message = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise MessageError(f"message={shown(text)}: send JSON ({error})") from None
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        raise MessageError(f"message={shown(message)}: send an object with a type")
    return message


def _no_number(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")


def plain(value: Any) -> Any:
    """Return a value that JSON can hold: numbers that are not finite become null, arrays lists."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value


def encoded(message: Mapping[str, Any]) -> str:
    """Return a message to the page as text."""
    return json.dumps(plain(message), ensure_ascii=False, allow_nan=False)


def packed(message: Mapping[str, Any], payload: bytes | memoryview) -> bytes:
    """Return a message to the page with bytes.

    Examples
    --------
    >>> packed({"type": "file"}, b"abc")[12:]
    b'{"type": "file"}    abc'
    """
    text = encoded(message).encode()
    text += b" " * (-(len(text) + _HEAD.size) % 8)
    return b"".join([_HEAD.pack(MAGIC, VERSION, len(text)), text, payload])


def unpacked(message: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the content of a message that :func:`packed` made, for clients that are written in Python."""
    magic, version, length = _HEAD.unpack_from(message)
    if magic != MAGIC or version != VERSION:
        raise MessageError(f"message begins with {magic!r} {version}: this is version {VERSION} of the protocol")
    end = _HEAD.size + length
    return json.loads(message[_HEAD.size : end]), message[end:]


def pixels(raster: NDArray[np.int16]) -> tuple[str, bytes]:
    """Return the type and the bytes of an image's codes, which are its labels less :data:`LOWEST`."""
    codes = raster - np.int16(LOWEST)
    kind = "uint8" if codes.max() < 256 else "uint16"
    return kind, np.ascontiguousarray(codes, dtype=f"<{np.dtype(kind).str[1:]}").tobytes()
