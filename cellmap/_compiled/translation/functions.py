"""Functions of the language: each becomes one of LLVM's, with what it calls beside it."""

from __future__ import annotations

import ast
import functools
import linecache
from collections.abc import Callable
from dataclasses import dataclass
from types import CodeType
from typing import Any

from .grammar import LanguageError, names_set
from .marks import Deferred
from .numbers import literal
from .statements import Statements, Widened
from .values import FLOAT, TRUTH, WHOLE, Kind, PointerKind, TypedValue, kind_of_argument, registers, typed

_DECLARED = """declare ptr @malloc(i64)
declare ptr @calloc(i64, i64)
declare void @free(ptr)
declare void @abort()
declare i64 @llvm.abs.i64(i64, i1)
declare {i64, i1} @llvm.umul.with.overflow.i64(i64, i64)
declare i64 @llvm.smin.i64(i64, i64)
declare i64 @llvm.smax.i64(i64, i64)
declare i64 @llvm.umin.i64(i64, i64)
declare double @llvm.copysign.f64(double, double)
declare double @llvm.pow.f64(double, double)
""" + "".join(f"declare double @llvm.{name}.f64(double)\n" for name in ("sqrt", "floor", "log", "fabs"))
_NO_VECTORS = '!0 = distinct !{!0, !1}\n!1 = !{!"llvm.loop.vectorize.enable", i1 false}\n'

_LARGE = 150
"""Lines of a function that is not inlined: LLVM would put it into its only caller, and compile that for longer."""


@dataclass(frozen=True)
class Callee:
    """A function of the module: its name, the kind of its result, and whether it may end without one."""

    name: str
    result: Kind
    may_fail: bool

    def call(self, handed: list[str], failure: str) -> str:
        """Return the instruction that calls it; a code other than 0 is left at the address `failure` where it fails."""
        return f"call {returned(self.result)} @{self.name}({', '.join([*handed, f'ptr {failure}'])})"


class Module:
    """Functions that call one another, each for the kinds of arguments that it is called with.

    A :class:`Failure` ends the outermost function; an index outside of an array is one with `checked` alone.
    """

    def __init__(self, checked: bool = False) -> None:
        self.checked = checked
        self._texts: list[str] = [_DECLARED, _NO_VECTORS]
        self._callees: dict[Any, Callee] = {}
        self._begun: set[Any] = set()

    @property
    def text(self) -> str:
        """The whole module."""
        return "\n".join(self._texts)

    def constants(self, values: tuple[Any, ...]) -> tuple[str, str]:
        """Return the name of an array of constants, and NumPy's name of their type."""
        name = f"@constants{len(self._texts)}"
        items = [literal(value) for value in values]
        (kind,) = {str(item.kind) for item in items}
        register = registers(kind)[0]
        listed = ", ".join(f"{register} {item.register}" for item in items)
        self._texts.append(f"{name} = internal constant [{len(items)} x {register}] [{listed}]\n")
        return name, kind

    def callee(self, what: Deferred, kinds: tuple[Kind, ...]) -> Callee:
        """Return a function for arguments of some kinds, written if it is not there yet.

        Raises
        ------
        TypeError
            Where it is not in the language; the message says in which line.
        """
        key = what.function, what.contract, what.vectors, what.is_inlined, kinds
        if key not in self._callees:
            if key in self._begun:
                raise TypeError(f"{what.function.__qualname__} calls itself")
            self._begun.add(key)
            tree, file = _tree(what.function), what.function.__code__.co_filename
            stored = names_set(tree, file)
            names = [argument.arg for argument in tree.args.args]
            if len(names) != len(kinds):
                raise TypeError(f"{what.function.__qualname__} takes {len(names)} arguments, not {len(kinds)}")
            variables: dict[str, Kind] = dict(zip(names, kinds, strict=True))
            given = {name: _argument(name, kind) for name, kind in variables.items()}
            result: list[Kind] = []
            while True:
                body = Statements(self, what, given, stored, variables, result)
                try:
                    body.function(tree.body)
                    break
                except Widened:
                    continue
                except LanguageError:  # of a function that this one calls
                    raise
                except Exception as error:
                    raise LanguageError(f"{file}:{body.line}: {error}") from error
            callee = Callee(f"{what.function.__name__}.{len(self._callees)}", body.result, body.may_fail)
            self._callees[key] = callee
            self._texts.append(_definition(callee, body, names, kinds, what.is_inlined))
        return self._callees[key]


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


def returned(kind: Kind) -> str:
    """Return LLVM's type of a result."""
    found = registers(kind)
    return "void" if not found else found[0] if len(found) == 1 else "{" + ", ".join(found) + "}"


def _tree(function: Callable[..., Any]) -> ast.FunctionDef:
    """Return the grammar of a function as it was imported.

    Raises
    ------
    RuntimeError
        Where its file has been changed since then.
    """
    code = function.__code__
    text = "".join(linecache.updatecache(code.co_filename))
    codes, trees = _functions_in(text, code.co_filename)
    if code not in codes:
        raise RuntimeError(f"{code.co_filename} was changed after it had been imported: restart Python")
    if (code.co_firstlineno, code.co_name) not in trees:
        raise LanguageError(f"{code.co_filename}:{code.co_firstlineno}: {code.co_name} is no function made with def")
    return trees[code.co_firstlineno, code.co_name]


@functools.lru_cache(maxsize=32)
def _functions_in(text: str, file: str) -> tuple[set[CodeType], dict[tuple[int, str], ast.FunctionDef]]:
    """Return the functions of a text as Python compiles them, and their grammar by their lines and names."""
    tree = ast.parse(text)
    codes, left = set(), [compile(tree, file, "exec", dont_inherit=True)]
    while left:
        inner = {one for one in left.pop().co_consts if isinstance(one, CodeType)}
        codes |= inner
        left += inner
    found = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    begins = (min([node.lineno, *(one.lineno for one in node.decorator_list)]) for node in found)
    return codes, {(line, node.name): node for line, node in zip(begins, found, strict=True)}


def _argument(name: str, kind: Kind) -> TypedValue:
    return TypedValue(kind, tuple(f"%{name}.{k}" for k in range(len(registers(kind)))))


def _definition(callee: Callee, body: Statements, names: list[str], kinds: tuple[Kind, ...], is_inlined: bool) -> str:
    w, given, stores = body.writer, [], []
    for name, kind in zip(names, kinds, strict=True):
        given += typed(_argument(name, kind))
        if name not in body.places:
            continue
        # An argument may become a variable of a wider kind.
        value = body.fitted(_argument(name, kind), body.kinds[name], first=True)
        for register, t, place in zip(value.registers, registers(value.kind), body.places[name], strict=True):
            stores.append(f"  store {t} {register}, ptr {place}")
    w.begin("exit")
    for kept in body.kept:
        w.write(f"call void @free(ptr {w.value(f'load ptr, ptr {kept}')})")
    types, text = registers(callee.result), returned(callee.result)
    found = [w.value(f"load {t}, ptr {place}") for t, place in zip(types, body.results, strict=True)]
    if len(found) > 1:
        whole = "poison"
        for k, (t, register) in enumerate(zip(types, found, strict=True)):
            whole = w.value(f"insertvalue {text} {whole}, {t} {register}, {k}")
        found = [whole]
    w.write(f"ret {text} {found[0]}" if found else "ret void")
    where = "alwaysinline " if is_inlined else "noinline " if len(w.lines) > _LARGE else ""
    head = f"define internal {text} @{callee.name}({', '.join([*given, 'ptr %failure'])}) {where}nounwind {{"
    first = [*w.first, *body.conversions, *stores, "  br label %begin", "begin:"]
    return "\n".join([head, *first, *w.lines, *body.refusals, "}", ""])
