"""Zeros and extreme values of functions along branches and curves, against closed forms and SciPy."""

from math import cos, pi, sin

import matplotlib.pyplot as plt
import numpy as np
import pytest
from cases import branch_of

from cellmap import ForcedSystem, angle, discrete_map, plot, stroboscopic_map
from cellmap.bifurcations import OrbitFunction, continue_bifurcation
from cellmap.exchange import save_auto, to_dataframe

PEAK = OrbitFunction("x", "amplitude", extremum=True)


@pytest.fixture(scope="module")
def linear():
    """x'' + b x' + x = cos(w t) has the amplitude 1/sqrt((1 - w^2)^2 + (b w)^2), largest at w^2 = 1 - b^2/2."""
    system = ForcedSystem(
        lambda t, x, p: (x[1], cos(p.w * t) - x[0] - p.b * x[1]),
        {"w": 0.5, "b": 0.2},
        period=lambda p: 2.0 * pi / p.w,
        coordinates=("x", "v"),
    )
    exact = stroboscopic_map(system)
    branch = branch_of(exact, [1.0, 0.0], "w", 0.5, 1.5, step=0.05)
    level, own = OrbitFunction("x", "maximum", value=2.0), {"w=1": lambda t, x, p: p.w - 1.0}
    return branch.with_zeros({"peak": PEAK, "level": level, **own})


def test_peaks_and_levels_of_a_linear_resonance(linear):
    names = [z.name for z in linear.zeros]
    assert names == ["level", "peak", "w=1", "level"]
    low, high = ((2.0 - 0.04 + s * np.sqrt(0.04**2 - 4.0 * 0.04 + 1.0)) / 2.0 for s in (-1.0, 1.0))
    expected = [np.sqrt(low), np.sqrt(0.98), 1.0, np.sqrt(high)]
    np.testing.assert_allclose([z.value for z in linear.zeros], expected, rtol=0, atol=1e-11)
    assert all(z.unstable == 0 for z in linear.zeros)
    assert not linear.bifurcations and linear.special_points == linear.zeros


def test_curves_of_peaks_and_of_equal_amplitude(linear):
    level, peak = linear.zeros[:2]
    box = (0.9, 1.1), (0.15, 0.3)
    peaks = continue_bifurcation(linear, peak, "b", *box, step=0.1)
    w, b = peaks.values.T
    np.testing.assert_allclose(w**2, 1.0 - 0.5 * b**2, rtol=0, atol=1e-10)
    assert (peaks.kind, peaks.codimension_two(), len(peaks.ends)) == ("peak", (), 2)
    assert {*b[[0, -1]].round(12)} == {0.15, 0.3}
    levels = continue_bifurcation(linear, level, "b", (0.5, 1.5), (0.19, 0.8), step=0.2)
    w, b = levels.values.T
    np.testing.assert_allclose((1.0 - w**2) ** 2 + (b * w) ** 2, 0.25, rtol=0, atol=1e-11)
    levels = levels.with_zeros({"w=1": lambda t, x, p: p.w - 1.0})
    assert levels.zeros[0].values == pytest.approx([1.0, 0.5], abs=1e-11)
    assert levels.zeros[0].params == levels.zeros[0].orbit.params == pytest.approx({"w": 1.0, "b": 0.5})
    ax = plot.bifurcation_curves([levels, peaks])
    assert [t.get_text() for t in ax.texts] == ["w=1"]
    plt.close("all")


def test_branch_cuts_are_no_zeros_and_functions_that_vanish_are_refused():
    circle = discrete_map(lambda x, p: (x[0] - 0.5 * sin(x[0] - p.q),), {"q": 1.0}, (angle("theta"),))
    branch = branch_of(circle, [1.0], "q", -1.0, 4.0, step=0.03)
    (zero,) = branch.with_zeros({"straight": "theta"}).zeros
    assert zero.value == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ValueError, match=r"functions\['same'\]: it is zero at all points"):
        branch.with_zeros({"same": lambda t, x, p: sin(x[0] - p.q)})


def test_labels_in_figures_tables_and_files(linear, tmp_path):
    ax = plot.branches(linear, measure="amplitude")
    assert [t.get_text() for t in ax.texts] == [z.name for z in linear.zeros]
    table = to_dataframe(linear.special_points)
    assert list(table["kind"]) == ["level", "peak", "w=1", "level"]
    lines = save_auto(linear, tmp_path / "b.linear", measures=True).read_text().splitlines()
    users = [line for line in lines if line[10:14] == "  -4"]
    assert [float(line[19:38]) for line in users] == pytest.approx([z.value for z in linear.zeros], rel=1e-10)
    assert float(users[1][57:76]) == pytest.approx(1.0 / np.sqrt(0.02**2 + 0.04 * 0.98), rel=1e-9)
    plt.close("all")


def test_a_closed_branch_has_each_zero_once():
    # Fixed points on the circle x^2 + q^2 = 1, from q = 0 on.
    isola = discrete_map(lambda x, p: (x[0] + 0.3 * (1.0 - x[0] ** 2 - p.q**2),), {"q": 0.0}, ("x",))
    branch = branch_of(isola, [1.0], "q", -1.5, 1.5, step=0.05)
    assert branch.ends == ("closed", "closed")
    np.testing.assert_allclose(branch.points[[0, -1], 0], 1.0, rtol=1e-13)
    functions = {"q": lambda t, x, p: p.q, "half": lambda t, x, p: p.q - 0.5, "x": OrbitFunction("x", extremum=True)}
    found = sorted((z.name, z.point[0]) for z in branch.with_zeros(functions).zeros)
    side = np.sqrt(0.75)
    expected = [("half", -side), ("half", side), ("q", -1.0), ("q", 1.0), ("x", -1.0), ("x", 1.0)]
    assert [name for name, _ in found] == [name for name, _ in expected]
    np.testing.assert_allclose([x for _, x in found], [x for _, x in expected], atol=1e-9)


@pytest.fixture(scope="module")
def parabola():
    """Fixed points x^2 = q, from (1/2, 1/4) on: the initial orbit is where the two parts of the branch meet."""
    fold = discrete_map(lambda x, p: (x[0] + p.q - x[0] ** 2,), {"q": 0.25}, ("x",))
    return branch_of(fold, [0.5], "q", -0.3, 0.8)


def test_zeros_and_extrema_at_the_initial_orbit_are_found_once(parabola):
    functions = {
        "q": lambda t, x, p: p.q - 0.25,
        "touches": lambda t, x, p: (x[0] - 0.5) ** 2,
        "least": OrbitFunction(lambda t, x, p: (x[0] - 0.5) ** 2, extremum=True),
        "last": lambda t, x, p: x[0] - p.q - np.sqrt(0.8) + 0.8,
    }
    zeros = [(z.name, z.point[0]) for z in parabola.with_zeros(functions).zeros]
    names = sorted(name for name, _ in zeros)
    assert names == ["last", "last", "least", "q", "q", "touches"]
    # x - x^2 has the same value at x and at 1 - x.
    expected = {"q": {-0.5, 0.5}, "touches": {0.5}, "least": {0.5}, "last": {np.sqrt(0.8), 1.0 - np.sqrt(0.8)}}
    for name, places in expected.items():
        np.testing.assert_allclose(sorted(x for n, x in zeros if n == name), sorted(places), atol=1e-9)


def test_zeros_of_high_multiplicity_and_close_by_lose_no_others(parabola):
    functions = {f"{n}": lambda t, x, p, n=n: (x[0] - 0.31) ** n for n in (3, 5, 9)}
    # Two within one step on the way towards x = 0, and away from it; others beside the initial orbit, 1/2.
    places, beside = [-0.2005, -0.2, 0.2, 0.2005], [0.49, 0.503, 0.507, 0.512, 0.518, 0.524]
    values = {str(v): OrbitFunction("x", value=v) for v in [*beside, *places[::-1]]}
    found = parabola.with_zeros({**functions, **values})
    assert [z.name for z in found.zeros] == [*map(str, places), "3", "5", "9", *map(str, beside)]
    np.testing.assert_allclose([z.point[0] for z in found.zeros], [*places, *3 * [0.31], *beside], rtol=0, atol=1e-13)
    points = [point.point[0] for point in found.special_points]
    assert len(points) == 14 and points == sorted(points)


def test_extrema_are_found_on_large_constants_and_where_they_are_flat(parabola):
    functions = {
        "quartic": OrbitFunction(lambda t, x, p: (x[0] - 0.31) ** 4, extremum=True),
        "large": OrbitFunction(lambda t, x, p: 1e6 + (x[0] - 0.31) ** 2, extremum=True),
        "edge": OrbitFunction(lambda t, x, p: (p.q - 0.8) ** 2, extremum=True),  # none at both ends, one at the fold
        "inflection": OrbitFunction(lambda t, x, p: (x[0] - 0.31) ** 3, extremum=True),
    }
    zeros = parabola.with_zeros(functions).zeros
    found = {z.name: z.point[0] for z in zeros}
    # Truncation of the slope's differences, 16 (3e-4)^4, under a cube root; rounding of 1e6 beside a slope.
    near = pytest.approx
    assert len(zeros) == 3
    assert found == {"quartic": near(0.31, abs=5e-5), "large": near(0.31, abs=1e-6), "edge": near(0.0, abs=1e-9)}


def test_functions_that_are_zero_on_a_stretch_are_said_so_once(parabola):
    functions = {
        "kink": lambda t, x, p: max(0.0, x[0] - 0.31),
        "half": lambda t, x, p: (x[0] - abs(p.q) ** 0.5) * (x[0] + 0.5),
    }
    with pytest.warns(RuntimeWarning, match=r"functions\['(kink|half)'\]: it is zero along stretches") as caught:
        found = parabola.with_zeros({**functions, "x": OrbitFunction("x", value=0.2)}).zeros
    assert len(caught) == 2 and [z.name for z in found] == ["half", "x"]
    np.testing.assert_allclose([z.point[0] for z in found], [-0.5, 0.2], rtol=0, atol=1e-12)
