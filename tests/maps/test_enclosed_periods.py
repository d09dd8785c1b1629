"""Enclosures of flows over boxes: points of boxes in extended precision, failures, steps, intervals of parameters."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from enclosure_witnesses import LONG, extrapolated
from two_tiers import at_once

from cellmap import ForcedSystem, PointMap, set_threads, stroboscopic_map
from cellmap._compiled.codegen import flow_enclosures, picard
from cellmap._compiled.kernels.parallelepipeds import Sets
from cellmap.basins.proofs.orbits_of_sets import sets_of
from cellmap.maps import enclosed_periods, enclosures, followed_boxes
from cellmap.maps.enclosures import MeanValueForms, enclosed_images

PARAMETERS = {"g": 0.05, "a": 0.3, "k": 0.7, "w": 1.25}
TEXTS = {
    "pendulum": "y, -p.g * y - (p.a - p.k * cos(p.w * t)) * sin(x)",
    "Duffing": "y, x - x**3 - p.g * y + p.a * cos(p.w * t)",
    "rational": "y - 0.1 * x, tanh(p.a * x) - y / (1.5 + sin(p.w * t) + x * x) - sqrt(1.1 + cos(x)) + exp(-(y**2))",
    "autonomous": "y, (1.0 - x * x) * y - x + 0.1 * atan(x) + 0.1 * log(3.0 + y * y)",
}
NUMPY = {"atan": np.arctan, "asin": np.arcsin, "acos": np.arccos, "asinh": np.arcsinh, "acosh": np.arccosh}
NUMPY |= {"atanh": np.arctanh}


def compiled(text: str, functions: dict[str, Any]) -> Callable[..., Any]:
    """Return a right-hand side in terms of some elementary functions."""
    names = dict(functions)
    exec(f"def rhs(t, s, p):\n    (x, y), k = s, p.k\n    return {text}\n", names)
    return names["rhs"]


def flow_of(text: str, **changes: Any) -> PointMap:
    values = PARAMETERS | changes
    rhs = compiled(text, {n: getattr(math, n) for n in dir(math)})
    return stroboscopic_map(ForcedSystem(rhs, values, lambda p: 2.0 * math.pi / p.w, ("x", "y"), "flow"), phase=0.3)


def worst_of(
    forms: MeanValueForms,
    text: str,
    centres: Any,
    halves: Any,
    rng: Any,
    values: Any,
    steps: int = 32,
    periods: int = 1,
    sets: Sets | None = None,
) -> float:
    """Return the largest distance of images of points of boxes from the mean-value form, divided by its radius.

    The same of distances from the centres of sets, along directions in which these are thin.  Parameters are exact,
    and so is the length of the period: the double that the map has.
    """
    functions = {n: NUMPY.get(n, getattr(np, n, None)) for n in dir(math)}
    rhs, p = compiled(text, functions), SimpleNamespace(**{n: LONG(v) for n, v in values.items()})
    length = 2.0 * math.pi / values["w"]
    rows = np.tile(np.flatnonzero(forms.proved), 4)  # the centre, corners, and points between
    inside = (
        rng.choice([-1.0, 1.0], (len(rows), 2)) * np.repeat([0.0, 1.0, 1.0, rng.uniform()], len(rows) // 4)[:, None]
    )
    shift = LONG(halves[rows]) * inside
    image = (LONG(centres[rows]) + shift).T
    for _ in range(periods):
        image = extrapolated(lambda t, s: rhs(t, s, p), LONG(0.3 * length), image, LONG(length), steps, 10)
    off = np.abs(np.array(image).T - forms.images[rows] - np.einsum("nij,nj->ni", LONG(forms.derivatives[rows]), shift))
    bound = forms.image_radii[rows] + np.einsum("nij,nj->ni", forms.derivative_radii[rows], np.abs(shift))
    worst = [np.max(off / bound, initial=0.0), np.max(off / forms.spreads[rows], initial=0.0)]
    if sets is not None:
        generators = np.concatenate(
            [sets.shapes * sets.sizes[:, None], sets.frames * sets.spreads[:, None]], axis=2, dtype=LONG
        )[rows]
        normals = np.stack([-generators[:, 1], generators[:, 0]], axis=1)
        along = np.einsum("nik,ni->nk", normals, np.array(image).T - sets.centres[rows])
        widths = np.abs(np.einsum("nik,nij->nkj", normals, generators)).sum(axis=2)
        worst.append(np.max(np.abs(along) / widths, initial=0.0, where=widths > 0.0))
    return float(max(worst))


def boxes(rng: Any, count: int, size: float = 1.5) -> tuple[Any, Any]:
    """Return boxes of many sizes, some of them points."""
    centres = rng.uniform(-size, size, (count, 2))
    return centres, 10.0 ** rng.uniform(-9.0, -2.0, (count, 2)) * rng.choice([0.0, 1.0], (count, 1), p=[0.1, 0.9])


@pytest.fixture(autouse=True)
def short_series(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile short series: they take a fraction of the time."""
    monkeypatch.setattr(enclosed_periods, "_ORDERS", (5,))
    monkeypatch.setattr(followed_boxes, "_FEW", 0)


def with_second_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(followed_boxes, "_FEW", 2)
    monkeypatch.setattr(followed_boxes, "_MANY", -1.0)


@pytest.mark.parametrize("name", at_once(["Duffing"], later=TEXTS))
def test_points_of_boxes_in_extended_precision(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    if name == "Duffing":
        with_second_derivatives(monkeypatch)
    centres, halves = boxes(rng, 40)
    forms = enclosed_images(flow_of(TEXTS[name]), centres, halves)
    assert forms.proved.mean() > 0.95
    assert 0.0 < worst_of(forms, TEXTS[name], centres, halves, rng, PARAMETERS) < 1.0


def test_failures_are_statuses() -> None:
    runaway = "y, x**3 + 0.0 * t"
    forms = enclosed_images(
        flow_of(runaway),
        [[0.0, 0.0], [3.0, 3.0], [0.0, 0.0], [math.nan, 0.0]],
        [[0.01] * 2] * 2 + [[50.0] * 2, [0.1] * 2],
    )
    assert forms.proved.tolist() == [True, False, False, False]
    for array in (forms.images, forms.image_radii, forms.derivatives, forms.derivative_radii):
        assert np.isnan(array[~forms.proved]).all()
    dies = "y, 1.0 / x - p.g * y + 0.0 * t"  # falls on x = 0
    assert enclosed_images(flow_of(dies), [[1.0, 0.0], [0.001, -30.0]], [1e-3, 1e-3]).proved.tolist() == [True, False]
    assert enclosed_images(flow_of(dies), np.zeros((0, 2)), [1e-3, 1e-3]).images.shape == (0, 2)


def test_intervals_of_parameters_hold_for_all_of_their_values() -> None:
    centres, halves = np.array([[0.5, 0.1], [-1.0, 0.4]]), np.full((2, 2), 1e-3)
    intervals = {"k": (0.69, 0.71), "w": (1.24, 1.26)}
    forms = enclosed_images(flow_of(TEXTS["pendulum"]), centres, halves, parameters=intervals)
    assert forms.proved.all()
    for k, w in ((0.69, 1.24), (0.71, 1.26), (0.705, 1.25)):
        worst = worst_of(
            forms, TEXTS["pendulum"], centres, halves, np.random.default_rng(0), PARAMETERS | {"k": k, "w": w}
        )
        assert 0.01 < worst < 1.0
    alone = enclosed_images(flow_of(TEXTS["pendulum"]), centres, halves)
    assert (alone.image_radii < 0.01 * forms.image_radii).all()


@pytest.mark.parametrize("ends", [(0.9, 1.1), (1.0, 1.01), (0.95, 0.95)])
def test_a_parameter_that_changes_the_period_of_the_forcing_asks_for_a_function(ends: tuple[float, float]) -> None:
    """With 2 pi for all of them the map would begin again at t = 0, and not where the cosine repeats."""

    def driven(period: Any) -> PointMap:
        def rhs(t: float, x: Any, p: Any) -> Any:
            return x[1], -x[1] - x[0] + 0.5 * math.cos(p.w * t)

        return stroboscopic_map(ForcedSystem(rhs, {"w": 1.0}, period, ("q", "v")))

    with pytest.raises(ValueError, match=r"parameters=.*'w'.*period=6.28.*is a number; give .*lambda p: 2 \* pi / p.w"):
        enclosed_images(driven(math.tau), [[0.0, 0.5]], [0.1, 0.1], parameters={"w": ends})
    held = enclosed_images(driven(lambda p: math.tau / p.w), [[0.0, 0.5]], [0.1, 0.1], parameters={"w": ends})
    own = driven(lambda p: math.tau / p.w).with_params(w=ends[1])([0.0, 0.5])
    assert held.proved.all() and (np.abs(own - held.images[0]) <= held.image_radii[0]).all()


def test_intervals_whose_ends_and_middles_keep_the_period_are_held_to_it() -> None:
    """cos(a t) has it for whole a, a b cos(sqrt(2) t) at the middle of either interval, and cos(t + a b) everywhere."""

    def of(force: Any) -> PointMap:
        rhs = lambda t, x, p: (-x[0] + force(t, p),)  # noqa: E731
        return stroboscopic_map(ForcedSystem(rhs, {"a": 0.0, "b": 0.0}, math.tau, ("q",)))

    with pytest.raises(ValueError, match="the period of the right-hand side changes with a"):
        enclosed_images(of(lambda t, p: math.cos(p.a * t)), [[0.0]], [0.1], parameters={"a": (1.0, 3.0)})
    both = {"a": (-1.0, 1.0), "b": (-1.0, 1.0)}
    with pytest.raises(ValueError, match="the period of the right-hand side changes with a"):
        enclosed_images(of(lambda t, p: p.a * p.b * math.cos(math.sqrt(2.0) * t)), [[0.0]], [0.1], parameters=both)
    assert enclosed_images(of(lambda t, p: math.cos(t + p.a * p.b)), [[0.0]], [0.1], parameters=both).proved.all()


@pytest.mark.thorough
def test_units_do_not_matter() -> None:
    centres, spreads = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2)), []
    for unit in (1.0, 1024.0):
        text = f"y / {unit}, {unit} * (-p.g * y / {unit} - (p.a - p.k * cos(p.w * t)) * sin(x))"
        forms = enclosed_images(flow_of(text), centres * [1.0, unit], [1e-3, 1e-3 * unit])
        spreads.append(forms.spreads / [1.0, unit])
    assert spreads[1] == pytest.approx(spreads[0], rel=1e-3)


def test_second_derivatives_make_enclosures_narrower(monkeypatch: pytest.MonkeyPatch) -> None:
    centres, halves, spreads = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2)), np.full((20, 2), 4e-3), []
    for second in (False, True):
        if second:
            with_second_derivatives(monkeypatch)
        forms = enclosed_images(flow_of(TEXTS["Duffing"]), centres, halves)
        assert worst_of(forms, TEXTS["Duffing"], centres, halves, np.random.default_rng(0), PARAMETERS) < 1.0
        spreads.append(np.median(forms.spreads))
    assert spreads[1] < 0.2 * spreads[0]


@pytest.mark.parametrize("second", [False, True])
def test_boxes_that_are_followed(second: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if second:
        with_second_derivatives(monkeypatch)
    rng = np.random.default_rng(1)
    centres = rng.uniform(-1.5, 1.5, (24, 2))
    halves = np.repeat([1e-3, 1e-4, 1e-6], 8)[:, None] * np.ones(2)
    boxes = enclosures.followed_boxes(flow_of(TEXTS["Duffing"]), centres, halves)
    assert boxes is not None
    for _ in range(3):
        boxes.advance()
    forms = MeanValueForms.of(boxes.kernel.rows, boxes.rows)
    assert forms.proved.mean() > 0.6
    assert 0.3 < worst_of(forms, TEXTS["Duffing"], centres, halves, rng, PARAMETERS, 32, 3, sets_of(boxes)) <= 1.0


def test_any_number_of_threads_and_code_compiled_quickly_or_well_give_the_same_bits(monkeypatch: Any) -> None:
    centres, found = np.random.default_rng(0).uniform(-1.0, 1.0, (2500, 2)), []
    for threads, enough in ((1, math.inf), (2, math.inf), (3, 0)):
        monkeypatch.setattr(flow_enclosures, "_ENOUGH", enough)
        set_threads(threads)
        found.append(enclosed_images(flow_of(TEXTS["Duffing"]), centres, [1e-3, 1e-3]))
    set_threads(None)
    for forms in found[1:]:
        assert np.array_equal(forms.images, found[0].images)
        assert np.array_equal(forms.derivative_radii, found[0].derivative_radii)


def test_a_solution_that_ends_within_a_step_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    runaway, centre, half = "x * x, -y + 0.0 * t", [[0.1999, 0.0]], [1e-3, 1e-3]  # ends at the time 1/x, after 5
    assert not enclosed_images(flow_of(runaway), centre, half).proved.any()
    monkeypatch.setattr(picard, "_is_inside", lambda a, b: a.r >= 0.0)
    assert enclosed_images(flow_of(runaway), centre, half).proved.any()


@pytest.mark.parametrize("force", at_once(["0.0 * t"], later=["cos(p.w * t)"]))
def test_boxes_of_many_sizes_in_long_steps_of_low_order(force: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What series leave out, errors from before, the time and the way of a step, and the size of the set all count."""
    monkeypatch.setattr(enclosed_periods, "_ORDERS", (2,))
    monkeypatch.setattr(enclosed_periods, "_REMAINDER", 100.0)
    text, values = f"x * x + 0.5 * y, {force} - 0.3 * x", PARAMETERS | {"w": 10.0}  # a quarter of a period a step
    rng, centres = np.random.default_rng(0), np.random.default_rng(1).uniform(-0.5, 0.5, (32, 2))
    halves = np.repeat([0.1, 0.01, 1e-3, 1e-4], 8)[:, None] * np.ones(2)
    forms = enclosed_images(flow_of(text, **values), centres, halves)
    assert worst_of(forms, text, centres, halves, rng, values) <= 1.0


def test_large_boxes_by_second_derivatives_in_long_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """From (0.8, 0) on, y' = x^3 + y^3 grows beyond all bounds within 1.93 units of time; the period is 2.09."""
    monkeypatch.setattr(enclosed_periods, "_REMAINDER", 1.0)
    with_second_derivatives(monkeypatch)
    text, values, rng = "x * x + 0.0 * t, -0.3 * y", PARAMETERS | {"w": 10.0}, np.random.default_rng(0)
    centres = np.random.default_rng(1).uniform(-0.5, 0.5, (12, 2))
    halves = np.repeat([0.3, 0.1, 1e-3], 4)[:, None] * np.ones(2)
    forms = enclosed_images(flow_of(text, **values), centres, halves)
    assert worst_of(forms, text, centres, halves, rng, values, 8) <= 1.0
    ends = flow_of("0.0 * t, x * x * x + y * y * y", w=3.0)
    assert not enclosed_images(ends, [[0.0, 0.0]], [[0.8, 8e-3]]).proved.any()
