"""Generated source text as a module."""

from __future__ import annotations

import linecache
import types
from typing import Any


def module_in_memory(text: str, name: str, **scope: Any) -> types.ModuleType:
    """Run generated text as a module that no file holds; tracebacks still show its lines."""
    filename = f"<{name}>"
    linecache.cache[filename] = (len(text), None, text.splitlines(keepends=True), filename)
    module = types.ModuleType(name)
    vars(module).update(scope, __file__=filename)
    exec(compile(text, filename, "exec"), vars(module))  # the text is our own, never a user's
    return module
