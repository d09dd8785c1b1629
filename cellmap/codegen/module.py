"""Modules of generated source: named after what they contain, kept on disk, never stale.

numba's own disk cache looks only at the file that defines a function.  A generated module is therefore named by a hash
of its text, of the hand-written functions that are inlined into it and of numba's version: whatever changes gets a new
name, and an old file can never be mistaken for it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.util
import linecache
import sys
import types
from pathlib import Path
from typing import Any

import numba

from ..files import written_whole
from ..kernels import borrow, contraction, options, simd_math, sums, switching
from ..kernels.cache import cache_folder


@functools.cache
def _inlined_text() -> str:
    return "".join(
        Path(str(m.__file__)).read_text(encoding="utf-8")
        for m in (borrow, contraction, options, simd_math, sums, switching)
    )


@functools.lru_cache(maxsize=256)
def generated_module(text: str) -> types.ModuleType:
    """Import a module of generated text, from disk where its compiled code is already there."""
    name = "cellmap_" + hashlib.sha256("\0".join((text, _inlined_text(), numba.__version__)).encode()).hexdigest()[:32]
    path = _write_whole(name, text)
    if path is not None:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except Exception:
            # Unreadable or damaged files: what is wrong with the text itself, if anything, shows below.
            del sys.modules[name]
            _discard_compiled(path)
        else:
            return module
    return module_in_memory(text.replace("**KERNEL)", "**{**KERNEL, 'cache': False})"), name)


def _discard_compiled(path: Path) -> None:
    for compiled in path.parent.rglob(f"*/{path.stem}.*"):
        with contextlib.suppress(OSError):
            compiled.unlink()


def module_in_memory(text: str, name: str, **scope: Any) -> types.ModuleType:
    """Run generated text as a module that no file holds; tracebacks still show its lines."""
    filename = f"<{name}>"
    linecache.cache[filename] = (len(text), None, text.splitlines(keepends=True), filename)
    module = types.ModuleType(name)
    vars(module).update(scope, __file__=filename)
    exec(compile(text, filename, "exec"), vars(module))  # the text is our own, never a user's
    return module


def _write_whole(name: str, text: str) -> Path | None:
    folder = cache_folder()
    if folder is None:
        return None
    path = folder / f"{name}.py"
    try:
        if path.exists() and path.read_bytes() == text.encode():
            return path
        with written_whole(path, durable=False) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError:
        return None
    return path
