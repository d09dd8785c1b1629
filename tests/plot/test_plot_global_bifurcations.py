"""Figures of atlases, connecting orbits, invariant circles and Arnold tongues."""

from dataclasses import replace
from math import pi, sin

import numpy as np
import pytest
from matplotlib.patches import Polygon

from cellmap import ForcedSystem, angle, discrete_map, periodic_orbit, plot, stroboscopic_map
from cellmap.bifurcations import AttractorAtlas, arnold_tongue, attractor_atlas, connecting_orbits
from cellmap.bifurcations.circle_branches import continue_circle
from cellmap.bifurcations.connecting_branches import ConnectionBranch, continue_connection, continue_tangency
from systems import henon_map


@pytest.fixture(scope="module")
def branch() -> ConnectionBranch:
    exact = discrete_map(lambda x, p: (p.a - x[0] ** 2 + p.b * x[1], x[0]), {"a": 1.4, "b": -0.3}, ("x", "y"))
    orbit = connecting_orbits(exact, periodic_orbit(exact, [-2.0, -2.0]), max_steps=17, n_samples=2048)[0]
    return continue_connection(orbit, "a", 1.25, 1.45, step=0.1)


def test_parameters_have_their_units_on_axes(branch: ConnectionBranch) -> None:
    def rhs(t, x, p):
        growth = 1.0 - x[0] ** 2 - x[1] ** 2
        return growth * x[0] - p.omega * x[1], growth * x[1] + p.omega * x[0]

    limit_cycle = ForcedSystem(rhs, {"omega": 1.0}, 1.0, ("x", "y"), parameter_units={"omega": "rad/s"})
    circles = continue_circle(stroboscopic_map(limit_cycle), "omega", [1.0, 1.1], [1.0, 0.0], transient=20)
    assert plot.invariant_circles(circles).get_xlabel() == r"$\omega$ (rad/s)"
    ax = plot.invariant_circles(circles, show="circles")
    assert ax.figure is not None and ax.figure.axes[1].get_ylabel() == r"$\omega$ (rad/s)"
    assert plot.connections(branch).get_xlabel() == "$a$"
    assert plot.connections(replace(branch, parameter_units={"a": "m"})).get_xlabel() == "$a$ (m)"


def test_tongues() -> None:
    circle = discrete_map(
        lambda x, p: (x[0] + p.omega - p.k / (2 * pi) * sin(2 * pi * x[0]),),
        {"omega": 0.5, "k": 0.8},
        (angle("x", "", 1.0, 0.0),),
    )
    tongue = arnold_tongue(circle, 0, 1, ("omega", "k"), (-0.2, 0.2), (0.2, 0.9), [0.1], step=0.1)
    ax = plot.arnold_tongues([tongue])
    (area,) = ax.patches
    assert isinstance(area, Polygon)
    # Omega = +-k / 2 pi.
    corners = area.get_xy()
    across, up = corners[:-1].T
    shoelace = 0.5 * abs(across @ np.roll(up, -1) - up @ np.roll(across, -1))
    assert shoelace == pytest.approx((0.9**2 - 0.2**2) / (2.0 * pi), rel=1e-9)
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["0/1"]


@pytest.fixture(scope="module")
def atlas() -> AttractorAtlas:
    axes = ("a", np.linspace(0.0, 0.7, 15)), ("b", np.linspace(0.1, 0.4, 7))
    return attractor_atlas(henon_map(0.2, 0.3), *axes, [[0.0, 0.0]])


def test_further_curves(atlas: AttractorAtlas, branch: ConnectionBranch) -> None:
    curve = continue_tangency(branch.tangencies[0], ("a", "b"), (1.3, 1.6), (-0.4, -0.2), step=0.2)
    assert len(plot.attractor_atlas(atlas, extra_curves=[curve]).lines) == 2
    for show in ("fractions", True):
        with pytest.raises((TypeError, ValueError), match="show="):
            plot.attractor_atlas(atlas, show=show)  # type: ignore[arg-type]
