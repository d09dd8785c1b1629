"""Arguments that errors name, ``word=``, are arguments of whatever public function ends in the error."""

import ast
import inspect
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from public_calls import arguments_named, public_things, words_of

import cellmap
import systems

Place = tuple[str, str]
"""A module, and the name of a function or method in it."""

ONLY_WHERE_GIVEN = {
    "choose_method": "method",
    "check_belongs": "checkpoint",
    "check_client": "client",
    "_told_of_losses": "client",
    "absolute_tolerances": "atol",
    "label_image": "wraps",
    "labeller": "attractors outcome",
    "Discrete.__post_init__": "function",
    "check_unforced": "system",
    "begin_orbit": "point_map",
    "_checked": "name path unverified",
    "_enclosable": "point_map",
    "enclosed_images": "point_map",
}
"""Errors that come to nobody who has not given the argument, or of `prove`, which says ``basins.point_map=``."""

OF_RECORDS = {"random_state", "record", "grazing", "rtol"}
"""Attributes of an estimator, entries of files, and the tolerance that a map has."""


class Library:
    """Which function of the library may call which, by the names that they use."""

    def __init__(self, sources: dict[str, str]) -> None:
        trees = {module: ast.parse(text) for module, text in sources.items()}
        self.functions = {place: node for module, tree in trees.items() for place, node in functions_of(module, tree)}
        self.classes = {
            (m, node.name) for m, tree in trees.items() for node in tree.body if isinstance(node, ast.ClassDef)
        }
        self.imported: dict[Place, Place] = {}
        for module, tree in trees.items():
            for node in (part for part in parts_of(tree) if isinstance(part, ast.ImportFrom)):
                above = module.split(".")[: -node.level or None] if node.level else []
                origin = ".".join([*above, *filter(None, [node.module])])
                self.imported |= {(module, a.asname or a.name): (origin, a.name) for a in node.names}
        self.callers: dict[Place, set[Place]] = defaultdict(set)
        for place, node in self.functions.items():
            for called in self._called(place, node):
                self.callers[called].add(place)

    def _called(self, place: Place, node: ast.FunctionDef) -> set[Place]:
        module, own = place[0], place[1].partition(".")[0]
        found: set[Place] = set()
        for part in parts_of(node):
            if isinstance(part, ast.Name):
                target = self._meant(module, part.id)
                found |= {target, *((target[0], f"{target[1]}.{made}") for made in ("__post_init__", "__init__"))}
            elif isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name):
                name = part.value.id
                target = (module, own) if name in ("self", "cls") else self._meant(module, name)
                found.add((target[0], f"{target[1]}.{part.attr}"))
        return found & self.functions.keys()

    def _meant(self, module: str, name: str) -> Place:
        place = module, name
        while place not in self.functions and place not in self.classes and place in self.imported:
            place = self.imported[place]
        return place

    def ends(self, place: Place, public: dict[Place, str]) -> set[str]:
        """Names of the public functions that the errors of a function come to, without others between."""
        found, seen, left = set(), {place}, [place]
        while left:
            if (one := left.pop()) in public:
                found.add(public[one])
            else:
                left += self.callers[one] - seen
                seen |= self.callers[one]
        return found

    def strange_words(self, functions: dict[Place, ast.FunctionDef]) -> list[tuple[str, str, list[str]]]:
        """Words in errors of functions, with the public functions that have no such argument."""
        found, public = [], public_places()
        for place, node in functions.items():
            given = {*ONLY_WHERE_GIVEN.get(place[1], "").split(), *OF_RECORDS}
            for error in (part.exc for part in parts_of(node) if isinstance(part, ast.Raise) and part.exc is not None):
                texts = [p.value for p in ast.walk(error) if isinstance(p, ast.Constant) and isinstance(p.value, str)]
                for word in words_of(" ".join(texts)) - given:
                    lack = [
                        name for name in self.ends(place, public) if not arguments_named(word, name, " ".join(texts))
                    ]
                    if lack:
                        found.append((f"{place[0]}:{error.lineno}", word, sorted(lack)))
        return found


@cache
def parts_of(node: ast.AST) -> list[ast.AST]:
    """Return names, attributes, errors raised and imports anywhere in a node."""
    found, left = [], [node]
    while left:
        one = left.pop()
        if isinstance(one, (ast.Name, ast.Attribute, ast.Raise, ast.ImportFrom)):
            found.append(one)
        for value in vars(one).values():
            if isinstance(value, ast.AST) and not isinstance(value, ast.expr_context):
                left.append(value)
            elif isinstance(value, list):
                left += [part for part in value if isinstance(part, ast.AST)]
    return found


def functions_of(module: str, tree: ast.Module) -> Iterator[tuple[Place, ast.FunctionDef]]:
    """Yield functions and methods of a module."""
    for node in tree.body:
        for part in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(part, ast.FunctionDef):
                yield (module, part.name if part is node else f"{node.name}.{part.name}"), part


@cache
def sources() -> dict[str, str]:
    """Texts of all modules by name; errors of the explorer name what is on its page."""
    found = {}
    for library in (cellmap, systems):
        root = Path(library.__file__).parent
        for path in sorted(root.rglob("*.py")):
            parts = path.relative_to(root.parent).with_suffix("").parts
            if "explorer" not in parts and path.name != "__init__.py":
                found[".".join(parts)] = path.read_text(encoding="utf-8")
    return found


@cache
def public_places() -> dict[Place, str]:
    """Where public functions and methods are defined, and their names."""
    found = {}
    for name, thing in public_things().items():
        members = {"": thing} if inspect.isfunction(thing) else vars(thing) if inspect.isclass(thing) else {}
        for method, member in members.items():
            made = method in ("__post_init__", "__init__")
            function = inspect.unwrap(getattr(member, "__func__", member))
            if inspect.isfunction(function) and (made or not method.startswith("_")):
                called = f"{name}.{method}" if method and not made else name
                found[function.__module__, function.__qualname__] = called
    return found


@pytest.fixture(scope="module")
def library() -> Library:
    return Library(sources())


def test_errors_name_arguments_of_the_functions_that_end_in_them(library: Library) -> None:
    assert len([place for place in library.functions if library.ends(place, public_places())]) > 1000
    assert library.strange_words(library.functions) == []


@pytest.mark.parametrize("word", ["window", "samples"])
def test_words_of_other_functions_are_noticed(library: Library, word: str) -> None:
    """Of helpers, too, that raise in the place of public functions."""
    module = "cellmap.analysis.fractal.box_counting"
    text = sources()[module].replace("{argument}= and", f"{{argument}}= or {word}= and")
    ((_, found, lack),) = library.strange_words(dict(functions_of(module, ast.parse(text))))
    assert found == word
    assert lack == ["boundary_dimension", "box_dimension", "correlation_dimension", "generalized_dimensions"]
