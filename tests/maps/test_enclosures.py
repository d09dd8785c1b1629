"""Enclosures of maps over boxes: points of boxes by mpmath, failures as statuses, intervals of parameters."""

import math
import random
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from cellmap import ForcedSystem, PointMap, discrete_map, set_threads, stroboscopic_map
from cellmap.maps import interval_witness
from cellmap.maps.enclosures import MeanValueForms, enclosed_images

OF_ONE = "sin cos tan exp log sqrt sinh cosh tanh atan asin acos asinh acosh atanh log1p expm1 log2 log10 exp2".split()
OF_TWO = ["({} + {})", "({} - {})", "({} * {})", "({} / {})", "hypot({}, {})"]
POWERS = ["({})**2", "({})**3", "({})**-2", "({})**0.5", "({})**1.3", "({})**19"]
MATH = {name: getattr(math, name) for name in (*OF_ONE, "hypot")}
EXACT: dict[str, Any] = {name: getattr(mpmath, name, None) for name in (*OF_ONE, "hypot")}
EXACT |= {"exp2": lambda a: mpmath.exp(a * mpmath.log(2)), "log2": lambda a: mpmath.log(a) / mpmath.log(2)}


NOISE = 1e-37
"""Rounding of numbers with forty digits."""


def formula(rng: random.Random, depth: int, names: str = "xyk") -> str:
    """Return a formula of x, y and a parameter k, none of whose parts is a number alone."""
    if depth == 0 or rng.random() < 0.1:
        return rng.choice(names)
    kind = rng.random()
    if kind < 0.35:
        return f"{rng.choice(OF_ONE)}({formula(rng, depth - 1, names)})"
    if kind < 0.5:
        return rng.choice(POWERS).format(formula(rng, depth - 1, names))
    other = formula(rng, depth - 1, names) if rng.random() < 0.8 else repr(round(rng.uniform(-2.0, 2.0), 3))
    return rng.choice(OF_TWO).format(formula(rng, depth - 1, names), f"({other})")


def map_of(text: str) -> tuple[PointMap, Callable[..., Any]]:
    """Return a map (x, y) -> (text, x + y) with a parameter k, and the same by mpmath."""
    names: dict[str, Any] = dict(MATH)
    exec(f"def f(s, p):\n    (x, y), k = s, p.k\n    return {text}, x + y\n", names)

    def exact(s: Any, k: Any) -> Any:
        return mpmath.matrix([eval(text, EXACT, {"x": s[0], "y": s[1], "k": k}), s[0] + s[1]])

    return discrete_map(names["f"], {"k": 0.7}, ("x", "y")), exact


def distance(forms: MeanValueForms, row: Any, centre: Any, image: Callable[..., Any], points: Any) -> Any:
    """Return the largest distance of points' images, by mpmath, from a mean-value form, divided by its radius.

    The differences of two images are compared as well, with the enclosed derivative times the difference of the points.
    """
    ratios, known = [mpmath.mpf(0)], [(mpmath.matrix(list(map(mpmath.mpf, p))), image(p)) for p in points]

    def compare(value: Any, step: Any, middle: Any, radius: Any, size: Any, spread: Any = None) -> None:
        for i in range(len(value)):
            along, within = mpmath.mpf(0), mpmath.mpf(float(radius[i]))
            for j, s in enumerate(step):
                d, r = forms.derivatives[row, i, j], forms.derivative_radii[row, i, j]
                along, within = along + mpmath.mpf(float(d)) * s, within + mpmath.mpf(float(r)) * abs(s)
            off = abs(value[i] - mpmath.mpf(float(middle[i])) - along)
            off = max(off - NOISE * (1 + abs(size[i])), mpmath.mpf(0))
            if spread is not None:
                within = min(within, mpmath.mpf(float(spread[i])))
            ratios.append(off / within if within else mpmath.mpf(2 if off else 0))

    c = mpmath.matrix([mpmath.mpf(float(v)) for v in centre])
    for (x, y), (x2, y2) in zip(known, [*known[1:], known[0]], strict=True):
        compare(y, x - c, forms.images[row], forms.image_radii[row], y, forms.spreads[row])
        compare(y2 - y, x2 - x, np.zeros(len(y)), np.zeros(len(y)), y)
    return max(ratios)


def points_of(rng: random.Random, centre: Any, half: Any) -> list[list[Any]]:
    """Return the centre, corners and random points of a box, exactly inside of it."""
    fractions: list[list[Any]] = [
        [0] * len(centre),
        [1] * len(centre),
        *([rng.choice([-1, 1, rng.uniform(-1, 1)]) for _ in centre] for _ in "ab"),
    ]
    return [
        [mpmath.mpf(float(c)) + mpmath.mpf(s) * float(w) for c, w, s in zip(centre, half, row, strict=True)]
        for row in fractions
    ]


def attacked(text: str, rng: random.Random, boxes: int, interval: tuple[float, float] | None = None) -> tuple[int, Any]:
    """Return how many points of random boxes were compared, and their largest distance over bound."""
    point_map, exact = map_of(text)
    centres = np.array([[rng.uniform(-3.0, 3.0) for _ in "xy"] for _ in range(boxes)])
    halves = np.array([[10.0 ** rng.uniform(-9.0, 0.0) * rng.choice([0, 1, 1, 1]) for _ in "xy"] for _ in range(boxes)])
    forms = enclosed_images(point_map, centres, halves, parameters=None if interval is None else {"k": interval})
    low, high = interval or (0.7, 0.7)
    compared, worst = 0, mpmath.mpf(0)
    with mpmath.workdps(40):
        for row in np.flatnonzero(forms.proved):
            k = mpmath.mpf(low) + rng.random() * (mpmath.mpf(high) - low)
            points = points_of(rng, centres[row], halves[row])
            worst = max(worst, distance(forms, row, centres[row], lambda p, k=k: exact(p, k), points))
            compared += len(points)
    return compared, worst


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(5))
def test_points_of_boxes_under_random_formulas(seed: int) -> None:
    rng, compared = random.Random(seed), 0
    for number in range(20):
        text = formula(rng, rng.choice([2, 3]))
        points, worst = attacked(text, rng, 12, (0.65, 0.75) if number % 2 else None)
        assert worst <= 1, text
        compared += points
    assert compared > 500


def test_points_of_boxes_where_every_part_of_second_order_counts() -> None:
    """Of a square, and of factors that are rounded where nothing bends."""
    worst, rng = mpmath.mpf(0), random.Random(0)
    centres = np.array([[1.0, 0.0], [0.3, 0.0], [2.0**-30, 0.0]])
    with mpmath.workdps(40):
        for text, width in (
            ("x * x", 0.25),
            ("(0.1 * k) * x", 0.25),
            ("(0.1 * k) * x", 0.0),
            ("x / k - y * y", 2.0**-30),
        ):
            point_map, exact = map_of(text)
            halves = np.full((3, 2), width)
            forms = enclosed_images(point_map, centres, halves)
            for row, centre in enumerate(centres):
                points = points_of(rng, centre, halves[row])
                worst = max(
                    worst, distance(forms, row, centre, lambda q, exact=exact: exact(q, mpmath.mpf(0.7)), points)
                )
    assert worst <= 1


def henon() -> PointMap:
    return discrete_map(lambda x, p: (1.0 - p.a * x[0] ** 2 + x[1], p.b * x[0]), {"a": 1.4, "b": 0.3}, ("x", "y"))


def test_failures_are_statuses() -> None:
    point_map = discrete_map(lambda x, p: (math.log(x[0]), x[1] / x[0]), {}, ("x", "y"))
    centres = [[1.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [math.nan, 0.0], [1.0, math.inf], [1.0, 0.0]]
    halves = [[0.5, 0.5], [1.0, 0.5], [0.1, 0.5], [0.1, 0.1], [0.1, 0.1], [-0.1, 0.1]]
    forms = enclosed_images(point_map, centres[:3] + centres[5:], halves[:3] + halves[5:])
    assert forms.proved.tolist() == [True, False, False, False]
    for array in (forms.images, forms.image_radii, forms.derivatives, forms.derivative_radii):
        assert np.isnan(array[~forms.proved]).all()
        assert np.isfinite(array[forms.proved]).all()
    assert repr(forms) == "MeanValueForms(1 of 4 boxes enclosed)"
    assert not enclosed_images(henon(), [[1e200, 0.0]], [1.0, 1.0]).proved.any()


def test_an_interval_of_a_parameter_holds_for_all_of_its_values() -> None:
    forms = enclosed_images(henon(), [[0.5, 0.1]], [1e-3, 1e-3], parameters={"a": (1.3, 1.5)})
    for a in (1.3, 1.42, 1.5):
        alone = enclosed_images(henon().with_params(a=a), [[0.5, 0.1]], [1e-3, 1e-3])
        assert (np.abs(alone.images - forms.images) <= forms.image_radii).all()
        assert (np.abs(alone.derivatives - forms.derivatives) <= forms.derivative_radii).all()


def test_any_number_of_threads_gives_the_same_bits() -> None:
    centres = np.random.default_rng(0).uniform(-1.0, 1.0, (3001, 2))
    found = []
    for threads in (1, 2, 3):
        set_threads(threads)
        found.append(enclosed_images(henon(), centres, [1e-3, 1e-3]))
    set_threads(None)
    for forms in found[1:]:
        assert np.array_equal(forms.images, found[0].images)
        assert np.array_equal(forms.derivative_radii, found[0].derivative_radii)
    alone = enclosed_images(henon(), centres[17:18], [1e-3, 1e-3])
    assert np.array_equal(alone.derivatives[0], found[0].derivatives[17])


@pytest.mark.parametrize(
    "text", ["(y + y) / (-1.577)", "3.3 * (0.1 * x) + x", "0.7 * x * (0.3 * x)", "log2(x + 3.0)", "(x + 3.0)**-3"]
)
def test_numbers_in_derivatives_are_not_rounded(text: str) -> None:
    assert attacked(text, random.Random(0), 10)[1] <= 1


@pytest.mark.parametrize("top, bottom", [(1e-13, 3e-310), (1e-30, 3e-290), (0.3e-15, 3e-308)])
def test_quotients_of_numbers_whose_errors_underflow(top: float, bottom: float) -> None:
    quotient = discrete_map(lambda x, p: (0.5 * x[0], p.c / p.b), {"c": top, "b": bottom}, ("x", "y"))
    forms = enclosed_images(quotient, [[0.0, 0.0]], [0.0, 0.0])
    with mpmath.workdps(40):
        off = abs(mpmath.mpf(top) / mpmath.mpf(bottom) - mpmath.mpf(float(forms.images[0, 1])))
        assert 0 < off <= forms.image_radii[0, 1]


ALL_FUNCTIONS = (
    "tanh(x) - tan(0.5 * x) + atan(x) * exp(-x) + log(x + 2.0) / (x + 1.5) + sqrt(x + 1.25) * sin(x) + cos(3.0 * x)"
    " + (x + 1.0)**1.5"
)


def primitive(x: Any, k: Any) -> Any:
    """Return the integral of all functions over a path of the length k from x on."""
    return mpmath.quad(lambda u: eval(ALL_FUNCTIONS, EXACT, {"x": u}), [x, x + k])


@pytest.mark.parametrize("flow", [False, True])
def test_the_witness_encloses_all_functions_and_their_series(flow: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A map of one of them by value and slope; of the flow x' = 1 the image is their integral, by quadrature."""
    names: dict[str, Any] = dict(MATH)
    exec(f"def f(x):\n    return {ALL_FUNCTIONS}\n", names)
    of = names["f"]
    if flow:
        monkeypatch.setattr(interval_witness, "_STEPS", (3,))
        system = ForcedSystem(lambda t, x, p: (1.0, of(x[0]) + 0.0 * x[1]), {}, 0.25, ("x", "y"))
        point_map, expected = stroboscopic_map(system), lambda x: primitive(x, 0.25)
    else:
        point_map, expected = discrete_map(lambda x, p: (x[0], of(x[0])), {}, ("x", "y")), None
    context = interval_witness.intervals()
    image, slopes = interval_witness.witness(point_map)([context.mpf([0.25, 0.25 + 2.0**-50]), context.mpf(0)])
    with mpmath.workdps(40):
        x = mpmath.mpf(0.25) + mpmath.mpf(2) ** -51
        of_x = lambda u: eval(ALL_FUNCTIONS, EXACT, {"x": u})  # noqa: E731
        slope = of_x(x + mpmath.mpf(0.25)) - of_x(x) if flow else mpmath.diff(of_x, x)
        for found, exact in ((image[1], expected(x) if flow else of_x(x)), (slopes[1][0], slope)):
            assert mpmath.mpf(found.a) - 1e-30 <= exact <= mpmath.mpf(found.b) + 1e-30
            assert found.delta < 1e-12
    with pytest.raises(interval_witness.NotEnclosedError, match="holds 0"):
        interval_witness.witness(discrete_map(lambda x, p: (1.0 / x[0], math.log(x[1])), {}, ("x", "y")))(
            [context.mpf([-1, 1]), context.mpf(1)]
        )


def test_remainders_of_short_series_are_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """x' = -x: image and slope are exp(-1/4), which two terms of the series miss by 1e-4."""
    monkeypatch.setattr(interval_witness, "_ORDER", 2)
    monkeypatch.setattr(interval_witness, "_STEPS", (3,))
    decay = stroboscopic_map(ForcedSystem(lambda t, x, p: (-x[0],), {}, 0.25, ("x",)))
    image, slopes = interval_witness.witness(decay)([interval_witness.intervals().mpf(1)])
    for found in (image[0], slopes[0][0]):
        assert found.a <= math.exp(-0.25) <= found.b
        assert found.delta < 2e-3
