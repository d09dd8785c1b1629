"""Which starts are inside an ellipsoid."""

from __future__ import annotations

import numpy as np

from ..loops import loop


@loop
def capture(points, found, times, now, centres, metrics, owners, turn):
    """Write into ``found[i]`` the owner of the first ellipsoid that holds row i, and ``now`` into ``times[i]``.

    Rows that were found before are left as they are.

    Ellipsoid m holds x where (x - c)' M (x - c) <= 1 with centre c and metric M; angles are compared the shorter way
    round (``turn`` is 0 on the line).
    """
    n, d = points.shape
    shift = np.empty((d, n))
    distance = np.empty(n)
    for m in range(centres.shape[0]):
        for j in range(d):
            centre, circle = centres[m, j], turn[j]
            if circle > 0.0:
                inverse = 1.0 / circle
                for i in range(n):
                    s = points[i, j] - centre
                    shift[j, i] = s - circle * np.floor(s * inverse + 0.5)
            else:
                for i in range(n):
                    shift[j, i] = points[i, j] - centre
        distance[:] = 0.0
        for j in range(d):
            row = shift[j]
            diagonal = metrics[m, j, j]
            for i in range(n):
                distance[i] += diagonal * row[i] * row[i]
            for k in range(j):
                other = shift[k]
                twice = 2.0 * metrics[m, j, k]
                for i in range(n):
                    distance[i] += twice * row[i] * other[i]
        owner = owners[m]
        for i in range(n):
            if distance[i] <= 1.0 and found[i] < 0:
                found[i] = owner
                times[i] = now
