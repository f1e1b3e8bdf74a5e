"""Is an equilibrium stable? The static tangent with the ends held: positive definite if any small push is opposed.

A neutral motion, as the turning of a slack line about the vertical through its two ends, counts as stable.
"""

import math

import numpy as np

from ..compiled import kernel
from ..element.ends import axis_of_foot
from ..maths.block_tridiagonal import SIZE

_TANGENT = 16.0 * float(np.finfo(float).eps)  # of a node's largest stiffness: what its tangent is known to


@kernel
def definite(line, quaternion, blocks, metric, stiffness):
    """Whether the symmetric part of the tangent, with `stiffness` [1/m] times the metric (n, 6) and its round-off, is positive definite."""
    added = np.empty(metric.shape)
    for i in range(metric.shape[0]):
        for first in (0, 3):  # forces, moments
            known = 0.0
            for j in range(first, first + 3):
                for k in range(SIZE):
                    known = max(known, math.fabs(blocks[0][i, j, k]))
            for j in range(first, first + 3):
                added[i, j] = stiffness * metric[i, j] + _TANGENT * known
    return positive(line, quaternion, blocks, added)


@kernel
def positive(line, quaternion, blocks, added):
    """Whether the symmetric part of the tangent `blocks` (n, 6, 6), (n - 1, 6, 6) x 2 of free ends is positive definite once they are held.

    quaternion (n, 4); added (n, 6): stiffness [N/m, N m] added to the diagonal.
    """
    diagonal, lower, upper = blocks
    n = diagonal.shape[0]
    block, side, free = np.empty((n, SIZE, SIZE)), np.empty((n - 1, SIZE, SIZE)), np.zeros((SIZE, SIZE))
    for k in range(n):
        for i in range(SIZE):
            for j in range(SIZE):
                block[k, i, j] = 0.5 * (diagonal[k, i, j] + diagonal[k, j, i])
                if k < n - 1:
                    side[k, i, j] = 0.5 * (upper[k, i, j] + lower[k, j, i])
            block[k, i, i] += added[k, i]
    if not line.foot_clamped:
        _turning(axis_of_foot(quaternion), free)
    _hold(free, block[0])
    _put(_product(free, side[0]), side[0])
    _turning((0.0, 0.0, 0.0), free)
    if line.top_clamped:
        free[:] = 0.0
    _hold(free, block[n - 1])
    _put(_product(side[n - 2], free), side[n - 2])
    return _cholesky(block, side)


@kernel
def _turning(axis, free):
    """Fill in the projector (6, 6) on turning about all axes but one (none, if that is zero)."""
    for i in range(3):
        for j in range(3):
            free[3 + i, 3 + j] = (1.0 if i == j else 0.0) - axis[i] * axis[j]


@kernel
def _hold(free, block):
    """Let a block act on the free motions, of which `free` is the projector, and be one on the others."""
    inside = _product(free, _product(block, free))
    for i in range(SIZE):
        for j in range(SIZE):
            block[i, j] = inside[i, j] + (1.0 if i == j else 0.0) - free[i, j]


@kernel
def _product(a, b):
    """Product of two blocks (6, 6)."""
    out = np.zeros((SIZE, SIZE))
    for i in range(SIZE):
        for k in range(SIZE):
            for j in range(SIZE):
                out[i, j] += a[i, k] * b[k, j]
    return out


@kernel
def _put(block, out):
    for i in range(SIZE):
        for j in range(SIZE):
            out[i, j] = block[i, j]


@kernel
def _cholesky(diagonal, upper):
    """Block Cholesky factors in place; False where a pivot is not positive."""
    n = diagonal.shape[0]
    for k in range(n):
        a = diagonal[k]
        for j in range(SIZE):
            value = a[j, j]
            for m in range(j):
                value -= a[j, m] * a[j, m]
            if not value > 0.0:
                return False
            a[j, j] = math.sqrt(value)
            for i in range(j + 1, SIZE):
                value = a[i, j]
                for m in range(j):
                    value -= a[i, m] * a[j, m]
                a[i, j] = value / a[j, j]
        if k == n - 1:
            break
        b = upper[k]
        for j in range(SIZE):
            for i in range(SIZE):
                value = b[i, j]
                for m in range(i):
                    value -= a[i, m] * b[m, j]
                b[i, j] = value / a[i, i]
        for i in range(SIZE):
            for j in range(SIZE):
                for m in range(SIZE):
                    diagonal[k + 1, i, j] -= b[m, i] * b[m, j]
    return True
