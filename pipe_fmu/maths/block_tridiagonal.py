"""Elimination of block tridiagonal systems with blocks of six, from the foot to the top.

Row i of the system is  lower[i-1] x[i-1] + diagonal[i] x[i] + upper[i] x[i+1] = -right[i].  `factorize` condenses everything below the last
node onto it, so that what is left in `diagonal[-1]` is the Schur complement: the pipe as its top feels it; `condense` does the same to
a right-hand side, as often as there are any, and `substitute` finds x from that of the top.
"""

import math

import numpy as np

from ..compiled import inner, kernel
from ..simd.lane_arrays import lane, rows_of_six, six

SIZE = 6
_SHRUNK = 1e-4  # of the largest entry of its column: a pivot for which rows are exchanged


@inner
def lu(a, pivots):
    """Factors of a dense block (m, m) in place, rows exchanged as `pivots` (m,) says. False if singular."""
    m = a.shape[0]
    for k in range(m):
        pivot = k
        for i in range(k + 1, m):
            if math.fabs(a[i, k]) > math.fabs(a[pivot, k]):
                pivot = i
        if not math.fabs(a[pivot, k]) > 0.0:
            return False
        pivots[k] = pivot
        if pivot != k:
            for j in range(m):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, m):
            factor = a[i, k] * inverse
            a[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, m):
                    a[i, j] -= factor * a[k, j]
    return True


@inner
def lu_solve_vector(a, pivots, b):
    """Solve with the factors of `lu` for one right-hand side `b` (m,), in place."""
    m = a.shape[0]
    for k in range(m):
        pivot = pivots[k]
        if pivot != k:
            b[k], b[pivot] = b[pivot], b[k]
    for k in range(m):
        for i in range(k + 1, m):
            b[i] -= a[i, k] * b[k]
    for k in range(m - 1, -1, -1):
        value = b[k]
        for i in range(k + 1, m):
            value -= a[k, i] * b[i]
        b[k] = value / a[k, k]


@inner
def lu_solve(a, pivots, b):
    """Solve with the factors of `lu` for the columns of `b` (m, c), in place."""
    m, c = b.shape
    for k in range(m):
        pivot = pivots[k]
        if pivot != k:
            for j in range(c):
                b[k, j], b[pivot, j] = b[pivot, j], b[k, j]
    for k in range(m):
        for i in range(k + 1, m):
            factor = a[i, k]
            if factor != 0.0:
                for j in range(c):
                    b[i, j] -= factor * b[k, j]
    for k in range(m - 1, -1, -1):
        for i in range(k + 1, m):
            factor = a[k, i]
            if factor != 0.0:
                for j in range(c):
                    b[k, j] -= factor * b[i, j]
        inverse = 1.0 / a[k, k]
        for j in range(c):
            b[k, j] *= inverse


@kernel
def _invert_with_exchange(a):
    """a <- a^-1 (6, 6), rows exchanged. False if singular."""
    factors, pivots = a.copy(), np.empty(SIZE, np.int64)
    if not lu(factors, pivots):
        return False
    for i in range(SIZE):
        for j in range(SIZE):
            a[i, j] = 1.0 if i == j else 0.0
    lu_solve(factors, pivots, a)
    return True


@inner
def _invert(a):
    """a <- a^-1 (6, 6) by Gauss and Jordan's elimination. False, and a as it was, where a pivot has shrunk."""
    at, rows = six(0), rows_of_six(6)
    high = 0.0 * a[0, at]
    for i in range(SIZE):
        rows[i] = a[i, at]
        high = max(high, math.fabs(rows[i]))
    for k in range(SIZE):
        column = lane(rows, k)
        if not math.fabs(column[k]) > _SHRUNK * lane(high, k):
            return False
        inverse = 1.0 / column[k]
        column[k] = 1.0
        rows[k] = rows[k] * inverse
        for i in range(SIZE):
            if i != k:
                factor = column[i]
                column[i] = 0.0
                rows[i] = rows[i] - factor * rows[k]
    for i in range(SIZE):
        a[i, at] = rows[i]
    return True


@inner
def _load(block, rows):
    for i in range(SIZE):
        rows[i] = block[i, six(0)]


@inner
def _product_row(block, i, rows):
    """Row i of the product of a block (6, 6) and one given in rows."""
    return (block[i, 0] * rows[0] + block[i, 1] * rows[1] + block[i, 2] * rows[2]) + (
        block[i, 3] * rows[3] + block[i, 4] * rows[4] + block[i, 5] * rows[5]
    )


@kernel
def factorize(diagonal, lower, upper):
    """Condense nodes 0..n-2 onto node n-1, in place: diagonal[k] becomes D^-1, upper[k] D^-1 U, lower[k] L D^-1. False if singular.

    diagonal (n, 6, 6), lower and upper (n - 1, 6, 6).
    """
    at, inverse, side, product = six(0), rows_of_six(6), rows_of_six(6), rows_of_six(6)
    for k in range(diagonal.shape[0] - 1):
        if not _invert(diagonal[k]) and not _invert_with_exchange(diagonal[k]):
            return False
        _load(upper[k], side)
        _load(diagonal[k], inverse)
        for i in range(SIZE):
            product[i] = _product_row(diagonal[k], i, side)
            upper[k, i, at] = product[i]
        for i in range(SIZE):
            diagonal[k + 1, i, at] = diagonal[k + 1, i, at] - _product_row(lower[k], i, product)
        for i in range(SIZE):
            lower[k, i, at] = _product_row(lower[k], i, inverse)
    return True


@inner
def condense(lower, right):
    """Condense a right-hand side (n, 6) with the factors, in place."""
    for k in range(right.shape[0] - 1):
        for i in range(SIZE):
            value = 0.0
            for m in range(SIZE):
                value += lower[k, i, m] * right[k, m]
            right[k + 1, i] -= value


@inner
def substitute(diagonal, upper, right, top, x):
    """Solution for the right-hand side -`right`, condensed, whose last unknown is `top` (6,), into `x` (n, 6)."""
    n = right.shape[0]
    for i in range(SIZE):
        x[n - 1, i] = top[i]
    for k in range(n - 2, -1, -1):
        for i in range(SIZE):
            value = 0.0
            for j in range(SIZE):
                value -= diagonal[k, i, j] * right[k, j] + upper[k, i, j] * x[k + 1, j]
            x[k, i] = value
