"""Errors of normal form coefficients are what they are said to be: random planar maps, against 40 digits by mpmath."""

import mpmath as mp
import numpy as np
import pytest
from branch_kinds import DOUBLING, NEIMARK_SACKER
from cases import branch_of

from cellmap import discrete_map

DIGITS = 40


class RandomMap:
    """Map c + (A + p A') x + B(x, x)/2 + C(x, x, x)/6, with a multiplier -1 or a pair exp(+-i theta) near p = 0."""

    def __init__(self, rng, kind):
        self.kind, theta = kind, rng.uniform(0.4, 2.7)
        turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
        frame = rng.normal(size=(2, 2)) + 2.0 * np.eye(2)
        first = frame @ (turn if kind is NEIMARK_SACKER else np.diag([-1.0, rng.uniform(-0.7, 0.7)]))
        self.matrix, self.change = first @ np.linalg.inv(frame), rng.normal(size=(2, 2))
        two, three = rng.normal(size=(2, 3)), rng.normal(size=(2, 4))
        self.two, self.three = (
            two[:, np.add.outer(*2 * [range(2)])],
            three[:, np.add.outer(*2 * [range(2)])[..., None] + np.arange(2)],
        )

        x = self.state = 0.1 * rng.normal(size=2)
        linear = (self.matrix + 0.05 * self.change) @ x
        self.constant = x - linear - (self.two / 2.0 + self.three @ x / 6.0) @ x @ x

    def function(self):
        c, a, change, two, three = (
            v.tolist() for v in (self.constant, self.matrix, self.change, self.two / 2.0, self.three / 6.0)
        )
        pairs = [(j, k) for j in range(2) for k in range(2)]

        def row(i, x, p):
            linear = c[i] + sum((a[i][j] + p.p * change[i][j]) * x[j] for j in range(2))
            bends = (two[i][j][k] + sum(three[i][j][k][m] * x[m] for m in range(2)) for j, k in pairs)
            return linear + sum(bend * x[j] * x[k] for bend, (j, k) in zip(bends, pairs, strict=True))

        return lambda x, p: (row(0, x, p), row(1, x, p))

    def bifurcations(self):
        exact = discrete_map(self.function(), {"p": 0.05}, ("x", "y"))
        branch = branch_of(exact, self.state, "p", -0.3, 0.4, step=0.05, max_points=40)
        return branch.of_kind(self.kind)

    def coefficient(self, near):
        """Return the coefficient at the bifurcation near a located one."""
        exactly = np.vectorize(mp.mpf, otypes=[object])
        two, three = exactly(self.two), exactly(self.three)

        def matrix(x, p):
            return exactly(self.matrix) + p * self.change + (two + three @ x / 2) @ x

        def equations(*unknowns):
            x = np.array(unknowns[:2], dtype=object)
            (a, b), (c, d) = matrix(x, unknowns[2])
            test = a * d - b * c - 1 if self.kind is NEIMARK_SACKER else (a + 1) * (d + 1) - b * c
            linear = (exactly(self.matrix) + unknowns[2] * self.change) @ x
            return [*(self.constant + linear + (two / 2 + three @ x / 6) @ x @ x - x), test]

        *state, value = mp.findroot(
            equations, [*map(float, near.point), near.value], tol=mp.mpf(10) ** (10 - 2 * DIGITS)
        )
        x = np.array(state, dtype=object)
        a, b = matrix(x, value), two + three @ x
        half = (a[0, 0] + a[1, 1]) / 2
        mu = mp.mpc(half, mp.sqrt(1 - half**2)) if self.kind is NEIMARK_SACKER else mp.mpf(-1)
        q, p = np.array([a[0, 1], mu - a[0, 0]]), np.array([a[1, 0], mu - a[0, 0]])
        q = q / mp.sqrt(abs(q[0]) ** 2 + abs(q[1]) ** 2)
        p, bar = p / (p @ q), np.array([mp.conj(u) for u in q])

        def solved(factor, rhs):
            return np.array(
                mp.lu_solve(mp.matrix((factor * np.eye(2, dtype=object) - a).tolist()), mp.matrix(rhs.tolist())),
                dtype=object,
            ).ravel()

        mean, double = solved(1, b @ bar @ q), solved(mu**2, b @ q @ q)
        return (
            p
            @ (three @ bar @ q @ q + 2 * b @ mean @ q + b @ double @ bar)
            / (2 * mu if self.kind is NEIMARK_SACKER else 6)
        )


def ratios(seed, count):
    """Return the stated errors over the true ones."""
    rng, found = np.random.default_rng(seed), []
    with mp.workdps(DIGITS):
        for number in range(count):
            case = RandomMap(rng, NEIMARK_SACKER if number % 2 else DOUBLING)
            for bifurcation in case.bifurcations():
                form = bifurcation.normal_form
                assert form is not None
                true = abs(mp.mpc(form.coefficient, form.imaginary) - case.coefficient(bifurcation))
                found.append(float(form.error / max(true, mp.mpf(10) ** -18)))
    return np.array(found)


@pytest.mark.thorough
def test_stated_errors_are_near_the_true_ones():
    found = ratios(0, 6)
    assert len(found) >= 3
    assert found.min() > 1.0 / 3.0
    assert np.median(found) < 15.0
