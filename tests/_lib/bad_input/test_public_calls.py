"""Whatever public functions are given: a result, or an error that names an argument."""

import inspect
import itertools
import json
import re
import signal
import time
import traceback
import warnings
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from decimal import Decimal
from fractions import Fraction
from functools import cache, reduce
from math import inf, nan
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from described import Described, described, differences, elsewhere, worth_keeping
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants
from public_calls import (
    MADE_BY,
    TARGETS,
    arguments_named,
    called,
    cases,
    good_arguments,
    parameters,
    public_things,
    words_of,
)
from small_systems import WINDOW, wells

from cellmap import CellGrid, Coordinate, PointMap
from cellmap._lib.checks import shown
from cellmap._lib.signatures import checked
from cellmap.maps.tangent import NotDifferentiableError

mpl.use("Agg")
import matplotlib.pyplot as plt

RESULTS, ERRORS = (Path(__file__).parents[2] / f"reference/{name}.json" for name in ("results", "errors"))

LONGEST = 120.0
"""Seconds after which a call counts as one that does not end."""

OWN_ERRORS = {TypeError, ValueError, MemoryError, KeyError, NotDifferentiableError}
"""And those of files, but no other subclasses: LinAlgError and UnicodeError are a ValueError too, and no remedies."""


ENTRIES = {
    **{"lengths": r"lengths|length_\d+", "masses": r"masses|mass_\d+"},
    **{name: rf"{name}(_\d+)?" for name in ("damping", "friction")},
}
"""Arguments of which each entry has a name."""


def names_an_argument(message: str, name: str) -> bool:
    """Whether a message says ``argument=value``, ``argument[i]``, ``argument: ...``, or what the argument has or is."""
    names = "|".join(ENTRIES.get(p.name, p.name) for p in parameters(name))
    verbs = "has|have|run|is|are|holds|covers|goes|lies|returns|returned|asks for|must|made|fails"
    return re.search(rf"(^|\W)({names})(, \w+)?([=:\[]| ({verbs})\b)", message) is not None


def strange_words(message: str, name: str, arguments: Mapping[str, Any]) -> set[str]:
    """Words that a message names as arguments, ``word=``, and that the function has not, values left aside."""
    for value in arguments.values():
        for text in (shown(value), repr(value)):
            message = message.replace(text, "") if len(text) > 2 else message
    entries = "|".join(ENTRIES.get(p.name, p.name) for p in parameters(name))
    strange = {w for w in words_of(message) if not re.fullmatch(entries, w) and not arguments_named(w, name, message)}
    return strange - NO_ARGUMENTS


NO_ARGUMENTS = {"dtype", "grid", "what"}
"""Of the text of an array; the grid itself, of its methods; an entry of checkpoints."""


def fault(name: str, arguments: Mapping[str, Any]) -> str | None:
    """Call; return what is wrong with how the call ends."""

    def too_long(*_: Any) -> None:
        raise TimeoutError(f"no end after {LONGEST:g} s")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, LONGEST)
    try:
        called(name, arguments)
    except Exception as error:
        own = type(error) in OWN_ERRORS or isinstance(error, OSError)
        if not own or not names_an_argument(str(error), name) or strange_words(str(error), name, arguments):
            return f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        plt.close("all")
    return None


class Claimed(Sequence[float]):
    """A sequence that claims more entries than can be gone through."""

    def __len__(self) -> int:
        return 10**10

    def __getitem__(self, place: Any) -> Any:
        return 0.5


HUGE = range(10**18), range(-1, -(10**30), -1), Claimed(), [range(10**9)]

WRONG: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 3, 2**63, 2**64, -(2**70), 10**400, -(10**400),
    0.5, -0.5, -0.0, 1.0, 5e-324, 1e-300, 1e308, -1e308, inf, -inf, nan, 1j, Fraction(1, 3), Decimal("NaN"),
    np.float32(0.3), np.float16(inf), np.int8(-3), np.uint64(2**64 - 1), np.bool_(True), np.complex128(1j),
    np.array(3), np.array(nan), np.array("x"), np.datetime64("2000-01-01"), date(2000, 1, 1),
    "", "x", "theta", "r", "a", "no/such/folder/file", "zero\0byte", "\N{SNOWMAN}", b"x",
    (), [], {}, set(), [[]], [[], []], (0,), (1, 2), (2, 1), (1.0, 1.0), (nan, 1.0), (inf, -inf), [0.5], [[0.5, 0.2]],
    (1, 2, 3), [1, [2, 3]], ["x", "y"], [None, None], [[None, 1.0]], ("r", (1.0, 2.0)), ("r", 1.0), (0, 0), (-1, -1),
    [10**400, 1], [1j, 2j], [1e308, -1e308], [1e-320, 1.0], range(3), {"r": 1.5}, {"r": "x"}, {1: 2}, {"x": None},
    np.zeros(0), np.zeros((0, 2)), np.zeros((2, 0)), np.zeros((1, 2)), np.zeros((3, 3)), np.zeros((2, 2, 2)),
    np.full((4, 2), nan), np.full((2, 2), 1e300), np.arange(6), np.arange(12.0).reshape(6, 2), np.ones((5, 5), int),
    np.array([["a", "b"]]), np.array([None, 1], object), np.zeros((2, 2), bool), np.zeros((2, 2), complex),
    np.ma.masked_array([1.0, 2.0], [True, False]), np.zeros(3, [("a", float)]),
    np.array(["2000-01-01"], "datetime64[D]"),
    *HUGE, object(), object, len, iter(()), (v for v in (1, 2)), lambda: None, lambda *a: a, lambda *a: None,
    lambda *a: (nan, nan), lambda t, x, p: (x[5],), lambda x, p: (p.nothing, 0.0), lambda n: 1 / 0,
    Path("no/such/file"), Path(), int, Exception("x"), Ellipsis, NotImplemented, slice(1, 2), memoryview(b"abcd"),
    bytearray(b"ab"), CellGrid((0.0,), (1.0,), (4,)), CellGrid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2)),
    CellGrid((1e300, 1e300), (2e300, 2e300), (3, 3)), CellGrid((-1.0, -1.0), (1.0, 1.0), (1, 1)), Coordinate("z"),
)  # fmt: skip


LONG_TO_COMPILE = {
    *("section_map", "SectionMap.returns", "plan", "stability_map", "critical_values", "floquet_multipliers"),
    *("certify", "plot_certificate"),
    *("Plan.at", "Plan.map", "Plan.basins", "Plan.outcome", "Option.meets", "plot_plan", "plot_stability_map"),
}
"""Called with wrong values by `make test-all` alone; others share the kernels of a discrete map and of a pendulum."""

SHORT = [name for name in TARGETS if name not in LONG_TO_COMPILE]


def wrong_values() -> st.SearchStrategy[Any]:
    """Values that hardly any argument takes, and numbers and arrays of all kinds."""
    return st.one_of(
        st.sampled_from(WRONG),
        st.integers(-(2**70), 2),
        st.integers(2**63, 2**80),
        st.floats(),
        st.text(max_size=4),
        st.lists(st.one_of(st.integers(-2, 3), st.floats(), st.none()), max_size=4),
        arrays.arrays(np.float64, arrays.array_shapes(min_dims=0, max_dims=3, max_side=3), elements=st.floats()),
        arrays.arrays(np.int64, arrays.array_shapes(max_dims=2, max_side=4), elements=st.integers(-3, 3)),
    )


def calls(names: list[str], wrong: st.SearchStrategy[Any]) -> st.SearchStrategy[tuple[str, dict[str, Any]]]:
    """Calls of which most have one wrong argument, the first as often as any other, and some two or none."""

    def arguments(name: str) -> st.SearchStrategy[tuple[str, dict[str, Any]]]:
        given = [p.name for p in parameters(name)]
        changed = st.lists(st.sampled_from(given), min_size=1, max_size=2, unique=True) if given else st.just([])
        values = changed.flatmap(lambda some: st.fixed_dictionaries(dict.fromkeys(some, wrong)))
        return values.map(lambda some: (name, some))

    return st.sampled_from(names).flatmap(arguments)


def written(name: str, changed: Mapping[str, Any]) -> str:
    return f"{name}({', '.join(f'{key}={value!r}' for key, value in changed.items())})"


@pytest.fixture(autouse=True)
def the_same_calls_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hypothesis takes constants from modules that happen to be imported: calls would depend on the tests before."""
    monkeypatch.setattr(providers, "_get_local_constants", Constants)


def fuzz(names: list[str], number: int) -> None:
    @settings(
        max_examples=number, derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck)
    )
    @given(call=calls(names, wrong_values()))
    def each(call: tuple[str, dict[str, Any]]) -> None:
        name, changed = call
        found = fault(name, {**good_arguments(name), **changed})
        assert found is None, f"{written(name, changed)} ends in {found}"

    each()


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Names of files lead nowhere else, and what matters to matplotlib and numpy alone is not heard."""
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@pytest.fixture(scope="session")
def again(request: pytest.FixtureRequest) -> list[dict[str, Described]]:
    """Return what the good calls return elsewhere, where the reference is rewritten."""
    found = elsewhere() if request.config.getoption("--update-reference") else []
    for name in results().keys() - {name for every in found for name in every} if found else ():
        del results()[name]
    return found


@cache
def results() -> dict[str, Described]:
    kept: dict[str, Described] = json.loads(RESULTS.read_text(encoding="utf-8"))
    return kept


@pytest.mark.parametrize("name", TARGETS)
def test_a_wrong_first_argument_is_refused_and_results_are_what_they_were(
    name: str, again: list[dict[str, Described]]
) -> None:
    """By its name, and before anything is compiled; else a call never comes to what is behind its first check.

    Results that are meant to differ: `pytest --update-reference` this file.
    """
    first = next(iter(parameters(name)), None)
    if first is not None and "Any" not in str(first.annotation):
        with pytest.raises((TypeError, ValueError), match=f"{first.name}="):
            called(name, {**good_arguments(name), first.name: object()})
    for key, arguments in cases(name).items():
        plt.close("all")
        found = described(called(name, arguments))
        if again:
            results()[key] = reduce(worth_keeping, (every[key] for every in again), found)
            lines = (f"{json.dumps(k)}: {json.dumps(v, sort_keys=True)}" for k, v in sorted(results().items()))
            RESULTS.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
        assert not differences(found, results()[key])


@cache
def errors() -> dict[str, dict[str, str]]:
    """Return by functions what is wrong, an argument and its value, and the error with gaps for these two."""
    found: dict[str, dict[str, str]] = defaultdict(dict)
    for message, calls in json.loads(ERRORS.read_text(encoding="utf-8")).items():
        for name, _, wrong in (call.partition(" ") for call in calls):
            found[name][wrong] = message
    return found


def lasting(error: Exception, name: str, arguments: Mapping[str, Any]) -> bool:
    """Whether an error names an argument, and nothing that is of one machine only, or lists of other libraries."""
    said = str(error)
    good = names_an_argument(said, name) and not strange_words(said, name, arguments)
    return good and type(error) in OWN_ERRORS and not re.search(r" at 0x|[kMG]B\b|/|.{300}", said)


NOT_TAKEN = {
    repr(v): v for v in (-1, 0, 1, 64, nan, inf, 2.5, (nan, 1.0), (2.0, 1.0), [[0.5, 0.2, 0.1]], (), "x", None)
}


@pytest.mark.parametrize("name", SHORT)
def test_errors_name_arguments_of_the_function_and_are_what_they_were(
    name: str, request: pytest.FixtureRequest
) -> None:
    """Those that come at once, of each kind one; what is refused changes on purpose only, as results do."""
    update, found = request.config.getoption("--update-reference"), {}
    importing = "importlib._bootstrap"
    signal.signal(signal.SIGVTALRM, lambda _, frame: 1 / (importing in "".join(traceback.format_stack(frame))))
    if update and cases(name):  # imports and compiles what there is
        called(name, good_arguments(name))
    for p, (text, value) in itertools.product(parameters(name), NOT_TAKEN.items()):
        wrong = f"{p.name}={text}"
        if not update and wrong not in errors()[name]:
            continue
        arguments = {**good_arguments(name), p.name: value}
        signal.setitimer(signal.ITIMER_VIRTUAL, *((0.01, 0.01) if update else (LONGEST,)))
        try:
            called(name, arguments)
        except Exception as error:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
            message = str(error).replace(wrong, "<wrong>")
            new = all(m != message for w, m in found.items() if w.startswith(f"{p.name}="))
            if not update or (new and lasting(error, name, arguments)):
                found[wrong] = message
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    plt.close("all")
    if update:
        errors()[name] = found
        calls: dict[str, list[str]] = defaultdict(list)
        for function, every in sorted(errors().items()):
            for wrong, message in every.items():
                calls[message].append(f"{function} {wrong}")
        lines = (f"{json.dumps(message)}: {json.dumps(calls[message])}" for message in sorted(calls))
        ERRORS.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    assert found == errors()[name]


def test_ranges_without_end_are_refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """By every argument, as a sequence is that claims to be so long."""
    monkeypatch.setattr(f"{__name__}.LONGEST", 20.0)
    turns = itertools.cycle(HUGE)
    for name in SHORT:
        good = good_arguments(name)
        for key, huge in zip((p.name for p in parameters(name)), turns, strict=False):
            began = time.process_time()
            found = fault(name, {**good, key: huge})
            assert found is None, f"{written(name, {key: huge})} ends in {found}"
            assert time.process_time() - began < 1.0, written(name, {key: huge})


@pytest.mark.thorough
def test_a_thousand_calls() -> None:
    fuzz(SHORT, 1_000)


@pytest.mark.slow
def test_a_hundred_thousand_calls() -> None:
    fuzz(list(TARGETS), 100_000)


@pytest.mark.slow
def test_no_argument_takes_rows_of_different_lengths() -> None:
    """Nor do those that take arrays end in an error of NumPy's for matrices, other shapes and huge ranges."""
    unlike = (RAGGED, [1, [2, 3]], np.eye(2).view(np.matrix), MATRIX, np.ones((2, 2)), *HUGE)
    for name in SHORT:
        for key, value in itertools.product((p.name for p in parameters(name)), unlike):
            found = fault(name, {**good_arguments(name), key: value})
            assert found is None or "NotProved" in found, f"{written(name, {key: value})} ends in {found}"


NARROW = ((-1.5, -1e-320), (1.5, 1e-320)), ((1e-320, 1e-320), (2e-320, 2e-320)), ((1e-320, -1.0), (1.0, 1.0))
RAGGED, MATRIX = [[1.0], [1.0, 2.0]], np.array([[1.0, 2.0]]).view(np.matrix)

FAILED: tuple[tuple[str, str, Any], ...] = (
    ("physical_parameters", "alpha", 2.026423672846756e49),
    ("Fit.interval", "confidence", Decimal("NaN")),
    ("saddle_manifold", "spacing", 1.1754943508222875e-38),
    ("escape_rate", "tolerance", np.array(3.4924021e-231)),
    ("BoxSet.subdivided", "axes", np.int8(-3)),
    ("edge_orbit", "max_periods inside", (2, False)),
    *(
        ("section_map", "section", s)
        for s in (np.full((3, 2, 1), 3.7e192), ("q", 0.0, np.array([1, 2])), ("q", "x", 1))
    ),
    *(("continue_attractors", "extent", extent) for extent in (10**400, [0.0, 1.0])),
    ("find_basins", "initial_conditions", [1e-320, 1.0]),
    *(("find_basins", "initial_conditions", CellGrid(*corners, (12, 8))) for corners in NARROW),
    ("continue_basins", "values", (1, 2, 3)),
    ("plot_eigenvector", "index", -1),
    ("edge_orbit", "inside", 2**67),
    ("covariant_vectors", "initial_condition", (0, -3)),
    ("bifurcation_diagram", "perturbation", np.zeros((2, 2))),
    ("driven_pendulum", "frequency", 2.2e-309),
    ("physical_parameters", "length frequency", (2.2e-189, 2.2e-189)),
    ("physical_parameters", "frequency", 1.7e308),
    ("triple_pendulum", "phase", -2.3e16),
    ("triple_pendulum", "mass_3", 2.0**63),
    ("chain_pendulum", "phase", 5.9e16),
    ("compound_pendulum", "phase damping", (5.5e16, 0.0)),
    ("van_der_pol_oscillator", "mu frequency", (1e22, 5e-324)),
    ("from_stability_coordinates", "frequency_ratio gravity", (2.8e273, 2.8e273)),
    ("stability_coordinates", "gravity amplitude", (2.2e-309, 0.0)),
    *(("dimensionless_parameters", "frequency", frequency) for frequency in (5.8e-266, 1.7e308)),
    *((name, "atol", RAGGED) for name in ("stroboscopic_map", "trajectory")),
    ("slow_equilibrium", "near", RAGGED),
    ("BoxSet.chosen", "mask", RAGGED),
    ("image_uncertainty_exponent", "distances", RAGGED),
    ("smooth_boundary_entropy", "cells", RAGGED),
    ("refine_basins", "near", MATRIX),
    ("node_stability", "nodes", MATRIX),
    ("plot_attractor_atlas", "show", MATRIX),
    ("continue_orbit", "sizes", np.ones((2, 2))),
    ("normal_form", "point", np.ones((2, 2))),
    *(("minimal_fatal_shock", "scale", s) for s in (1.0001e-150, (1.0001e-150, 1.0), (0.9e150, 1.0001e-150))),
    ("fractal_boundary_test", "include", range(10**18)),
    ("boundary_dimension", "include", range(-1, -(10**30), -1)),
)
"""Calls that have ended in exceptions that name no argument, or not in a minute."""


@pytest.mark.parametrize(("name", "keys", "value"), FAILED, ids=lambda value: value if isinstance(value, str) else "")
def test_calls_that_have_failed(name: str, keys: str, value: Any) -> None:
    changed = dict(zip(keys.split(), value, strict=True)) if " " in keys else {keys: value}
    assert fault(name, {**good_arguments(name), **changed}) is None


def test_arguments_of_other_functions_are_strange() -> None:
    message = "points={}: 0 sizes; choose sizes=, samples= and window=, or box_entropy(box_size=)"
    cloud = [[0.0], [1.0]]
    found = strange_words(message.format(cloud), "box_dimension", {"points": cloud})
    assert found == {"samples", "window", "box_size"}
    assert strange_words(message.replace("box_entropy", "basin_entropy"), "box_dimension", {}) == found - {"box_size"}


def test_records_are_made_by_what_the_errors_name() -> None:
    """The remedy of an error names functions that are there, and that return the record."""
    for record, makers in MADE_BY.items():
        functions = [word.strip(",") for word in makers.split() if word.strip(",") in public_things()]
        assert functions, record
        for function in functions:
            if inspect.isfunction(public_things()[function]):
                returned = str(inspect.signature(public_things()[function]).return_annotation)
                assert record in returned or record in ("Bifurcation", "CodimensionTwo", "FunctionZero", "Tangency")


def test_checks_take_no_time() -> None:
    """A call with four arguments is held to its signature in microseconds."""

    def plain(point_map: PointMap, grid: CellGrid, periods: int = 1, phase: float = 0.0) -> None:
        return None

    held = checked(plain)
    began = time.perf_counter()
    for _ in range(2000):
        held(wells(), WINDOW, 3, phase=0.5)
    assert time.perf_counter() - began < 0.2
