"""Products of small matrices and of their inverses, each divided by its size as it grows."""

from __future__ import annotations

from math import log

import numpy as np

from ..loops import inlined, loop

EPSILON = 2.0**-52
"""A pivot that is smaller than this part of the largest entry is rounding: the matrix has no inverse."""


@loop
def append_steps(matrices, there, size_there, back, size_back):
    """Multiply products (n, d, d) by one more step each: `there` from the left, `back` by its inverse from the right.

    The largest entry of a product becomes 1 and its logarithm is added to the size; of a singular step's inverse the
    size is infinite.
    """
    n, d, _ = matrices.shape
    work = np.empty((d, d))
    row = np.empty((d, d))
    for k in range(n):
        for i in range(d):
            for j in range(d):
                total = 0.0
                for m in range(d):
                    total += matrices[k, i, m] * there[k, m, j]
                row[i, j] = total
        size_there[k] += _scaled(row, there[k])
        if size_back[k] == np.inf:
            continue
        for i in range(d):
            for j in range(d):
                work[i, j], row[i, j] = matrices[k, i, j], back[k, i, j]
        if _divide(row, work):
            size_back[k] += _scaled(row, back[k])
        else:
            size_back[k] = np.inf


@inlined
def _scaled(source, target):
    """Write a matrix divided by its largest entry; return the logarithm of that, minus infinity for nothing."""
    largest = 0.0
    for v in source.flat:
        largest = max(largest, abs(v))
    scale = largest if largest > 0.0 else 1.0
    for i in range(len(source)):
        for j in range(len(source)):
            target[i, j] = source[i, j] / scale
    return log(largest)


@inlined
def _divide(rows, matrix):
    """Replace rows by rows times the inverse of a matrix, by elimination of its columns; tell whether it has one."""
    d = len(matrix)
    noise = 0.0
    for v in matrix.flat:
        noise = max(noise, EPSILON * abs(v))
    for step in range(d):
        pivot = step
        for j in range(step + 1, d):
            if abs(matrix[step, j]) > abs(matrix[step, pivot]):
                pivot = j
        if not abs(matrix[step, pivot]) > noise:
            return False
        for i in range(d):
            matrix[i, step], matrix[i, pivot] = matrix[i, pivot], matrix[i, step]
            rows[i, step], rows[i, pivot] = rows[i, pivot], rows[i, step]
        inverse = 1.0 / matrix[step, step]
        for i in range(d):
            matrix[i, step] *= inverse
            rows[i, step] *= inverse
        for j in range(d):
            if j != step:
                factor = matrix[step, j]
                for i in range(d):
                    matrix[i, j] -= factor * matrix[i, step]
                    rows[i, j] -= factor * rows[i, step]
    return True
