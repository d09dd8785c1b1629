"""What the tests of this room share: branches and curves in one call, maps, Mathieu's equation, the second tier."""

from math import cos, pi, sin

import pytest

from cellmap import ForcedSystem, angle, continue_orbit, discrete_map, periodic_orbit
from cellmap.bifurcations import continue_bifurcation

HANGING, INVERTED = (0.0, 0.0), (pi, 0.0)


def branch_of(exact, guess, name, lower, upper, period=1, **options):
    return continue_orbit(exact, periodic_orbit(exact, guess, period), name, lower, upper, **options)


def branch_at_rest(exact, name, lower, upper, **options):
    return branch_of(exact, [0.0] * exact.dimension, name, lower, upper, **options)


def curve_of(exact, guess, kind, names, box, **options):
    """Return the curve of the first bifurcation of a kind on the branch over the first of two parameters."""
    branch = branch_of(exact, guess, names[0], *box[0], **options)
    return continue_bifurcation(branch, branch.of_kind(kind)[0], names[1], *box, **options)


def only(curve, kind):
    (found,) = (c for c in curve.codimension_two() if c.kind is kind)
    return found


def generalised_henon(r=-0.1):
    """Map of Gonchenko, Kuznetsov, Meijer, SIAM J. Appl. Dyn. Syst. 4 (2005) 407."""
    params = {"alpha": 0.3, "beta": 1.03, "R": r}
    return discrete_map(
        lambda x, p: (x[1], p.alpha - p.beta * x[0] - x[1] ** 2 + p.R * x[0] * x[1]), params, ("x", "y")
    )


def henon_parameters(trace, determinant, r=-0.1):
    """Return alpha and beta of the generalised Henon map at whose fixed point x the trace is (R - 2) x."""
    x = trace / (r - 2.0)
    beta = determinant + r * x
    return x + beta * x + x * x - r * x * x, beta


def delayed_logistic(r=2.5, c=0.4):
    """The logistic map with the delay in a part c: at x = 1 - 1/r, with s = r - 1, trace 1 - (1 - c) s, det c s."""
    return discrete_map(
        lambda x, p: (p.r * x[0] * (1 - (1 - p.c) * x[0] - p.c * x[1]), x[0]), {"r": r, "c": c}, ("x", "y")
    )


def quotient(x, y, u, v):
    """Return (x + i y) / (u + i v)."""
    return (x * u + y * v) / (u * u + v * v), (y * u - x * v) / (u * u + v * v)


def mathieu(alpha=0.25, beta=0.1, gamma=0.0):
    """Pendulum whose linearisation at 0 is Mathieu's equation with a = 4 alpha and q = 2 beta in the time t/2."""

    def rhs(t, x, p):
        return x[1], -p.gamma * x[1] - (p.alpha - p.beta * cos(t)) * sin(x[0])

    return ForcedSystem(rhs, {"alpha": alpha, "beta": beta, "gamma": gamma}, 2 * pi, (angle("theta"), "v"))


def thorough(*given):
    """Return a set of arguments of a test that runs in the second tier."""
    return pytest.param(*given, marks=pytest.mark.thorough)


def quick_and_thorough(names, quick):
    return [name if name in quick else thorough(name) for name in names]
