"""Whole modules: a loop with its entry from Python, and a function of C."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .functions import Callee, Module
from .grammar import LanguageError
from .marks import Deferred
from .values import FLOAT, TRUTH, WHOLE, Kind, PointerKind, kind_of_argument, registers


def entered(what: Deferred, arguments: tuple[Any, ...], entry: Callable[[Callee], str], checked: bool) -> str:
    """Return the module of a loop for the kinds of some arguments, with an entry that calls it."""
    module = Module(checked)
    callee = module.callee(what, tuple(map(kind_of_argument, arguments)))
    if callee.result not in (None, FLOAT, WHOLE, TRUTH):
        code = what.function.__code__
        raise LanguageError(f"{code.co_filename}:{code.co_firstlineno}: {callee.result} is returned to Python")
    return module.text + entry(callee)


def exported(name: str, what: Deferred, signature: str, checked: bool) -> str:
    """Return the module of a function of C of a name, whose arguments have kinds in words."""
    module = Module(checked)
    kinds: list[Kind] = [PointerKind(word[:-1]) if word.endswith("*") else word for word in signature.split()]
    callee = module.callee(what, tuple(kinds))
    given = [f"{registers(kind)[0]} %a{place}" for place, kind in enumerate(kinds)]
    return f"""{module.text}
define void @{name}({", ".join(given)}) {{
  %failure = alloca i32
  store i32 0, ptr %failure
  {callee.call(given, "%failure")}
  %code = load i32, ptr %failure
  %failed = icmp ne i32 %code, 0
  br i1 %failed, label %failure_found, label %end
failure_found:
  call void @abort()
  unreachable
end:
  ret void
}}
"""
