"""Figures of branches and stability maps: lines against closed forms, branch cuts, markers, classes, legends."""

from dataclasses import replace
from math import pi, sqrt
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from legends import legend_of
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from numpy.typing import NDArray

from cellmap import angle, continue_orbit, discrete_map, periodic_orbit, plot, stability_map, stroboscopic_map
from cellmap.bifurcations import Branch, continue_bifurcation, switch_branch
from cellmap.plot._stability import CROSSING_COLOURS
from systems import driven_pendulum, henon_map, logistic_map


@pytest.fixture(scope="module")
def logistic() -> Branch:
    exact = logistic_map(2.0)
    return continue_orbit(exact, periodic_orbit(exact, [0.5]), "mu", 0.5, 4.0)


@pytest.fixture(scope="module")
def henon() -> Any:
    """The fixed point that exists for a >= -(1 - b)^2/4 and is stable up to a = 3 (1 - b)^2/4."""
    exact = henon_map(0.2, 0.3)
    axes = ("a", np.linspace(-0.6, 1.2, 37)), ("b", np.linspace(-0.5, 0.5, 20))
    return stability_map(exact, periodic_orbit(exact, [0.5, 0.2]), *axes)


def lines(ax: Axes, style: str) -> NDArray[np.float64]:
    """Return all points of the lines of one style."""
    return np.concatenate([line.get_xydata() for line in ax.get_lines() if line.get_linestyle() == style])


def marks(ax: Axes, marker: str) -> NDArray[np.float64]:
    return np.concatenate([line.get_xydata() for line in ax.get_lines() if line.get_marker() == marker])


def longest_jump(places: NDArray[np.float64]) -> float:
    """Return the longest step of a line in its second column, where the pen is down."""
    return float(np.nanmax(np.abs(np.diff(places[:, 1]))))


def test_stable_parts_are_solid_and_end_at_bifurcations(logistic: Branch) -> None:
    ax = plot.branches(logistic)
    solid, dashed = lines(ax, "-"), lines(ax, "--")
    for places in (solid, dashed):
        mu, x = places[~np.isnan(places[:, 0])].T
        np.testing.assert_allclose(x, 1.0 - 1.0 / mu, atol=1e-11)
    assert [np.nanmin(solid[:, 0]), np.nanmax(solid[:, 0])] == pytest.approx([1.0, 3.0], rel=1e-12)
    mu = dashed[~np.isnan(dashed[:, 0]), 0]
    assert not ((mu > 1.0 + 1e-12) & (mu < 3.0 - 1e-12)).any()
    assert [mu.min(), mu.max()] == pytest.approx([0.5, 4.0])
    assert np.isnan(dashed[:, 0]).sum() == 1
    np.testing.assert_allclose(marks(ax, "X"), [[1.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(marks(ax, "o"), [[3.0, 2.0 / 3.0]], rtol=1e-12)
    assert legend_of(ax) == ["stable", "unstable", "period doubling", "transcritical"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"$\mu$", "$x$")


def test_all_points_of_an_orbit_or_the_first(logistic: Branch) -> None:
    doubled = switch_branch(logistic, logistic.bifurcations[1], 2.5, 3.9)
    both, first = plot.branches(doubled), plot.branches(doubled, all_points=False)
    for ax, count in ((both, 2), (first, 1)):
        places = np.concatenate([lines(ax, "-"), lines(ax, "--")])
        mu, x = places[~np.isnan(places[:, 0])].T
        split = np.sqrt((mu - 3.0) * (mu + 1.0))
        above = np.isclose(x, (mu + 1.0 + split) / (2.0 * mu), atol=1e-9)
        below = np.isclose(x, (mu + 1.0 - split) / (2.0 * mu), atol=1e-9)
        assert (above | below).all()
        assert int(above.any()) + int(below.any()) == count
        np.testing.assert_allclose(marks(ax, "o")[:, 0], [1.0 + sqrt(6.0)] * count, rtol=1e-12)


def test_an_angle_is_cut_at_its_branch_cut() -> None:
    # The fixed point is at theta = q, wherever that is on the circle.
    rotating = discrete_map(lambda x, p: (x[0] - 0.5 * np.sin(x[0] - p.q),), {"q": 0.5}, (angle("theta"),), "rotating")
    ax = plot.branches(continue_orbit(rotating, periodic_orbit(rotating, [0.4]), "q", -4.0, 9.0, step=0.05))
    places = lines(ax, "-")
    q, theta = places[~np.isnan(places[:, 0])].T
    assert np.abs(np.exp(1j * theta) - np.exp(1j * q)).max() < 1e-11
    assert [theta.min(), theta.max()] == pytest.approx([-pi, pi], abs=1e-14)
    # The branch cut is at odd multiples of pi, of which -pi and pi are passed, upwards.
    lifted = np.flatnonzero(np.isnan(places[:, 0]))
    np.testing.assert_allclose(places[lifted - 1], [[-pi, pi], [pi, pi]], atol=1e-10)
    np.testing.assert_allclose(places[lifted + 1], [[-pi, -pi], [pi, -pi]], atol=1e-10)
    assert longest_jump(places) < 1.0
    assert "$\\pi$" in [t.get_text() for t in ax.get_yticklabels()]


@pytest.mark.thorough
def test_an_orbit_on_the_branch_cut_does_not_jump() -> None:
    exact = stroboscopic_map(driven_pendulum())
    inverted = continue_orbit(exact, periodic_orbit(exact, [pi, 0.0]), "amplitude", 0.001, 0.014)
    arm = switch_branch(inverted, inverted.bifurcations[0], 0.001, 0.014)
    ax = plot.branches([inverted, arm], coordinate="theta")
    for line in ax.get_lines():
        if len(line.get_xydata()) > 1:
            assert longest_jump(line.get_xydata()) < 1.0
    rest = ax.get_lines()[0].get_ydata()
    np.testing.assert_allclose(np.abs(rest[~np.isnan(rest)]), pi, atol=1e-9)
    assert 1e3 * marks(ax, "D")[0, 0] == pytest.approx(2.329021135978, abs=1e-9)


@pytest.fixture(scope="module")
def fixed_points() -> Branch:
    exact = henon_map(0.2, 0.3)
    return continue_orbit(exact, periodic_orbit(exact, [0.5, 0.2]), "a", -0.5, 1.4, step=0.05)


def test_what_is_no_branch_is_refused(logistic: Branch) -> None:
    for wrong in (3, [], [logistic, 3]):
        with pytest.raises(TypeError, match="branches="):
            plot.branches(wrong)  # type: ignore[arg-type]
    other = replace(logistic, parameter="nu")
    with pytest.raises(ValueError, match="over one parameter of one system"):
        plot.branches([logistic, other])
    with pytest.raises(ValueError, match="coordinate='y'"):
        plot.branches(logistic, coordinate="y")


def test_classes_and_boundaries_are_those_of_the_map(henon: Any) -> None:
    ax = plot.stability_map(henon)
    (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    drawn = mesh.get_array()
    a, b = np.meshgrid(henon.x, henon.y)
    exists = a > -((1.0 - b) ** 2) / 4.0
    np.testing.assert_array_equal(np.ma.getmaskarray(drawn), ~exists)
    np.testing.assert_array_equal(drawn[exists], np.where(a < 0.75 * (1.0 - b) ** 2, 0, 1)[exists])
    assert mesh.to_rgba(0)[:3] == (1.0, 1.0, 1.0)
    assert ax.patch.get_hatch()
    assert legend_of(ax) == ["stable", "1 multiplier outside", "no orbit", "multiplier −1"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$b$")
    assert (*ax.get_xlim(), *ax.get_ylim()) == (-0.6, 1.2, -0.5, 0.5)
    assert len(ax.get_lines()) == len(henon.curves)
    for line, curve in zip(ax.get_lines(), henon.curves, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.stack([curve.x, curve.y], axis=-1))
        assert line.get_color() == CROSSING_COLOURS[curve.crossing]
        np.testing.assert_allclose(curve.x, 0.75 * (1.0 - curve.y) ** 2, rtol=1e-10)


@pytest.mark.parametrize(
    ("measured", "message"),
    [
        ("dots", "measured='dots': give rows of two or three real numbers"),
        ([0.4, 0.2], r"measured has the shape \(2,\): give rows of x, y"),
        ([[0.4]], r"measured has the shape \(1, 1\)"),
        ([[0.4, 0.2], [np.nan, 0.1]], r"measured\[1\] is not finite: leave it out"),
        ([[0.4, 0.2, -0.1]], "measured holds the error -0.1: give standard errors of at least 0"),
    ],
)
def test_bad_measured_points_are_refused(henon: Any, measured: Any, message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        plot.stability_map(henon, measured=measured)
    assert plt.get_fignums() == []


def test_curves_of_bifurcations_have_their_points_of_codimension_two(fixed_points: Branch) -> None:
    """Folds of the Henon map at a = -(1 - b)^2/4, doublings at a = 3 (1 - b)^2/4, with multipliers +-1 and b."""
    box = (-2.0, 4.0), (-1.5, 0.9)
    curves = [continue_bifurcation(fixed_points, b, "b", *box, step=0.05) for b in fixed_points.bifurcations]
    ax = plot.bifurcation_curves(curves)
    assert [t.get_text() for t in ax.texts] == ["1:1", "1:2"]
    assert legend_of(ax)[:2] == ["fold", "period doubling"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$b$")
    np.testing.assert_allclose(marks(ax, "o"), [[-1.0, -1.0], [3.0, -1.0]], atol=1e-10)
    a, b = curves[1].values.T
    np.testing.assert_allclose(a, 0.75 * (1.0 - b) ** 2, atol=1e-11)
    with pytest.raises(ValueError, match="same two parameters"):
        plot.bifurcation_curves([curves[0], replace(curves[1], parameters=("b", "a"))])
