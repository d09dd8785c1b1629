"""Laws by which edges of a set, and of its pieces, raise counts of boxes, and which of them the counts follow."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr, stdtrit

from ..._lib.arrays import Floats

EDGES = np.linspace(0.0, 4.0, 201)
"""Coefficients of the edges of a whole set, over its extent."""

_EXPONENTS = (0.75, 0.5, 0.25)  # exponents of the edges of pieces that are longer than wide


def edge_laws(parts: Floats, dimension: int) -> tuple[Floats, Floats]:
    """Return laws by which edges may raise the logarithms of counts, shape (laws, sizes), and how likely each is.

    On grids at random places a brick with the sides a, b, ... meets (1 + a/s) (1 + b/s) ... boxes of the size s on
    average (Steiner's formula): more than a b .../s**d by factors like 1 + s/a, and other sets have ends and edges too.
    The first laws are (1 + c s)**d, with c from 0 to four over the extent.  It does not matter at small sizes, and
    bends the line at large ones.  The pieces of the width s of a self-affine set are longer than wide, a = s**(1 - e),
    so that the factor is 1 + c s**e, and the slope reaches the dimension the more slowly, the smaller e is: on a carpet
    of McMullen, contracted by n and m < n, e is 1 - ln m/ln n.  No edges, those of the whole set and those of
    pieces, with one of three exponents e, count as equally likely.

    Parameters
    ----------
    parts : ndarray, shape (n,)
        Sizes in extents of the set.
    dimension : int
        Of the space; 0 for boxes in a given place, where nothing is raised.
    """
    whole = edges_of_sets(np.tile(parts[:, None], dimension))
    pieces = [min(dimension, 1) * np.log1p(EDGES[1:, None] * parts**e) for e in _EXPONENTS]
    alike, n = np.full(len(EDGES) - 1, 1.0 / (len(EDGES) - 1)), len(_EXPONENTS)
    return np.concatenate([whole, *pieces]), np.concatenate([[1.0], alike, *[alike / n] * n])


def edges_of_sets(parts: Floats) -> Floats:
    """Return the first of these laws, shape (laws, sizes), for boxes with the sides (n, d) in extents of the set."""
    return np.asarray(np.log1p(EDGES[:, None, None] * parts).sum(axis=2))


def best_law(x: Floats, logs: Floats, laws: Floats) -> int:
    """Return the number of the law with which logarithms of counts are closest to a line, 0 where none is needed."""
    design = np.stack([np.ones_like(x), x], axis=1)
    rest = np.linalg.lstsq(design, (logs - laws).T, rcond=None)[1]
    freedom = max(len(x) - 3, 1)
    needed = rest[0] > rest.min() * (1.0 + stdtrit(freedom, 0.975) ** 2 / freedom)
    return int(np.argmin(rest)) if needed else 0


def law_weights(x: Floats, logs: Floats, errors: Floats, likely: Floats, dimension: int) -> Floats:
    """Return the probability of each law by how close to a line it leaves logarithms of counts, a row for each law.

    These are Bayes' weights for lines with unknown slope, intercept and scatter, of which the errors by the places of
    the grid tell as much as one more point, and a slope above the dimension of the space is impossible.
    """
    n, slope, about = len(x), slopes_of(x, logs), x - x.mean()
    rest = ((logs - logs.mean(axis=1, keepdims=True) - slope[:, None] * about) ** 2).sum(axis=1)
    rest += np.mean(errors**2) + 1e-24  # counts on one grid have no errors, and may be on a line to rounding
    possible = stdtr(n - 1, (dimension - slope) / np.sqrt(rest / (n - 1) / (about @ about)))
    weights = likely * np.maximum(possible, 1e-300) * (rest / rest.min()) ** (-0.5 * (n - 1))
    return np.asarray(weights / weights.sum())


def slopes_of(x: Floats, y: Floats) -> Floats:
    """Return the slopes of the lines of least squares through rows of points."""
    about = x - x.mean()
    return np.asarray(y @ about / (about @ about))
