"""What functions read besides their arguments."""

import functools
import types
from collections.abc import Callable
from dataclasses import dataclass
from math import cos
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap._compiled.codegen.captured import captured, kept
from cellmap.maps import jacobian

stiffness = 1.0


def spring(x: Any) -> Any:
    return -stiffness * x


@dataclass(frozen=True)
class Oscillator:
    k: float

    def __call__(self, x: float) -> float:
        return -self.k * x

    def rhs(self, x: float) -> float:
        return self.k * x


def test_what_functions_read() -> None:
    inside, array = 2.0, np.array([3.0, 4.0])

    def f(x: float, power: float = 5.0, *, offset: tuple[float, ...] = (6.0,)) -> Any:
        return spring(x) ** power + inside * array[0] + cos(x) + offset[0]

    constants = types.ModuleType("constants")
    constants.g, constants.unused = 9.8, 7.0  # type: ignore[attr-defined]
    read = [(f, value) for value in (1.0, 2.0, 5.0, 6.0, ("<f8", (2,), array.tobytes()))]
    read += [(Oscillator(3.0), 3.0), (Oscillator(3.0).rhs, 3.0), (functools.partial(spring, 4.0), 4.0)]
    for function, value in [*read, (lambda x: constants.g * x, 9.8)]:
        assert value in captured(function)
    assert 7.0 not in captured(lambda x: constants.g * x)


def test_functions_that_call_each_other_end() -> None:
    def f(n: int) -> int:
        return 0 if n == 0 else g(n - 1)

    def g(n: int) -> int:
        return f(n)

    assert isinstance(captured(f), tuple)


def test_what_is_kept_follows_the_values() -> None:
    built: list[float] = []

    @kept
    def build(function: Callable[..., Any], n: int) -> int:
        built.append(n)
        return n

    scale = 1.0

    def f(x: float) -> float:
        return scale * x

    assert build(f, 1) == build(f, 1) == 1
    assert built == [1]
    scale = 2.0
    build(f, 1)
    build(f, 2)
    assert built == [1, 1, 2]


@pytest.mark.parametrize("form", ["traced", "branching", "discrete"])
def test_a_changed_constant_is_seen(form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A global number that a right-hand side reads, changed between two maps."""

    def image() -> float:
        if form == "discrete":
            return float(discrete_map(lambda x, p: (spring(x[0]),), {}, ("x",))([1.0])[0])
        branch = lambda v: spring(v) if v < 1e9 else 0.0  # noqa: E731
        law = {"traced": spring, "branching": branch}[form]
        system = ForcedSystem(lambda t, x, p: (law(x[0]),), {}, 1.0, ("x",))
        return float(stroboscopic_map(system, method="RK45", rtol=1e-6)([1.0])[0])

    before = image()
    monkeypatch.setitem(globals(), "stiffness", 2.0)
    after = image()
    exact = (-1.0, -2.0) if form == "discrete" else (np.exp(-1.0), np.exp(-2.0))
    assert (before, after) == pytest.approx(exact, rel=1e-5)


def test_a_map_has_no_derivatives_of_a_system_that_has_changed_since() -> None:
    """What a map compiles later is of the same system as its images: in a class and a dictionary too."""

    class Spring:
        stiffness = 1.0

    settings = {"damping": 0.0, "seed": 1.0}

    def rhs(t: float, x: Any, p: Any) -> tuple[float]:
        return (-(Spring.stiffness + settings["damping"]) * x[0],)

    first = stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("x",)))
    settings["seed"] = 2.0  # which rhs does not ask for
    assert jacobian(first, [1.0]) == pytest.approx(np.exp(-1.0), rel=1e-9)
    second = stroboscopic_map(first.spec.system)
    step = discrete_map(lambda x, p: rhs(0.0, x, p), {}, ("x",))
    Spring.stiffness = 2.0
    with pytest.raises(ValueError, match=r"rhs of .* reads a value that has changed since the map was made"):
        jacobian(second, [1.0])
    with pytest.raises(ValueError, match=r"function of .* reads a value that has changed since the map was made"):
        jacobian(step, [1.0])
    third = stroboscopic_map(first.spec.system)
    assert [m([1.0])[0] for m in (second, third)] == pytest.approx(np.exp([-1.0, -2.0]), rel=1e-8)
    assert jacobian(third, [1.0]) == pytest.approx(np.exp(-2.0), rel=1e-9)


def test_objects_without_a_hash_are_refused() -> None:
    @dataclass
    class Decay:
        rate: float

        def __call__(self, t: float, x: Any, p: Any) -> tuple[float]:
            return (-self.rate * x[0],)

    with pytest.raises(TypeError, match=r"Decay\(rate=1.0\) cannot be told from others: .* frozen dataclass"):
        stroboscopic_map(ForcedSystem(Decay(1.0), {}, 1.0, ("x",)))
