"""Elimination of block tridiagonal systems with blocks of six, from the foot to the top.

Row i of the system is  lower[i-1] x[i-1] + diagonal[i] x[i] + upper[i] x[i+1] = -right[i].  `factorize` condenses everything below the last
node onto it, so that what is left in `diagonal[-1]` is the Schur complement: the pipe as its top feels it; `condense` does the same to
a right-hand side, as often as there are any, and `substitute` finds x from that of the top.
"""

import math

from .compiled import inner

SIZE = 6


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


@inner
def factorize(diagonal, lower, upper, pivots):
    """Condense nodes 0..n-2 onto node n-1, in place: diagonal[i] becomes its factors, upper[i] D^-1 U. False if singular.

    diagonal (n, 6, 6), lower and upper (n - 1, 6, 6), pivots (n - 1, 6).
    """
    for k in range(diagonal.shape[0] - 1):
        if not lu(diagonal[k], pivots[k]):
            return False
        lu_solve(diagonal[k], pivots[k], upper[k])
        for i in range(SIZE):
            for m in range(SIZE):
                factor = lower[k, i, m]
                if factor != 0.0:
                    for j in range(SIZE):
                        diagonal[k + 1, i, j] -= factor * upper[k, m, j]
    return True


@inner
def condense(diagonal, lower, pivots, right):
    """Condense a right-hand side (n, 6) with the factors, in place."""
    for k in range(right.shape[0] - 1):
        lu_solve_vector(diagonal[k], pivots[k], right[k])
        for i in range(SIZE):
            value = 0.0
            for m in range(SIZE):
                value += lower[k, i, m] * right[k, m]
            right[k + 1, i] -= value


@inner
def substitute(upper, right, top, x):
    """Solution for the right-hand side -`right`, condensed, whose last unknown is `top` (6,), into `x` (n, 6)."""
    n = right.shape[0]
    for i in range(SIZE):
        x[n - 1, i] = top[i]
    for k in range(n - 2, -1, -1):
        for i in range(SIZE):
            value = -right[k, i]
            for j in range(SIZE):
                value -= upper[k, i, j] * x[k + 1, j]
            x[k, i] = value
