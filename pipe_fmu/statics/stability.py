"""Is an equilibrium stable? The static tangent with the ends held: positive definite if any small push is opposed.

A neutral motion, as the turning of a slack line about the vertical through its two ends, counts as stable.
"""

import math

import numpy as np

from ..arrays import Array
from ..compiled import kernel
from ..line import Line
from ..maths.block_tridiagonal import SIZE
from ..maths.so3 import matrix


def positive(line: Line, quaternion: Array, blocks: tuple[Array, Array, Array], added: Array) -> bool:
    """Whether the symmetric part of the tangent `blocks` (n, 6, 6), (n - 1, 6, 6) x 2 of free ends is positive definite once they are held.

    quaternion (n, 4); added (n, 6): stiffness [N/m, N m] added to the diagonal.
    """
    diagonal, lower, upper = blocks
    block = 0.5 * (diagonal + diagonal.transpose(0, 2, 1))
    side = 0.5 * (upper + lower.transpose(0, 2, 1))
    block[:, range(SIZE), range(SIZE)] += added
    for node, free in ((0, _foot(line, quaternion)), (-1, _top(line))):
        block[node] = free @ block[node] @ free + np.eye(SIZE) - free
        side[node] = free @ side[node] if node == 0 else side[node] @ free
    return bool(_cholesky(block, side))


def _foot(line: Line, quaternion: Array) -> Array:
    """Projector (6, 6) on the free motions of the foot: none, or a pinned foot's turning but about t1."""
    out = np.zeros((SIZE, SIZE))
    if not line.foot_clamped:
        axis = np.array(matrix(tuple(quaternion[0])))[:, 0]
        out[3:, 3:] = np.eye(3) - np.outer(axis, axis)
    return out


def _top(line: Line) -> Array:
    return np.diag([0.0] * 3 + [0.0 if line.top_clamped else 1.0] * 3)


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
