"""Is an equilibrium stable, and if not, which way does it fall?

Symmetric part of the static tangent with the ends held; positive definite means that any small push is opposed. A neutral motion, as the
turning of a slack line about the vertical through its two ends, counts as stable.
"""

import math

import numpy as np

from .block_tridiagonal import SIZE, condense, factorize, substitute
from .compiled import kernel
from .line import Array, Line
from .so3 import matrix

_SWEEPS = 12  # of inverse iteration
_LARGEST_SHIFT = 1e12
_HELD = 1e6  # stiffness over metric given to what is held


class Tangent:
    """Symmetric tangent of a line with its ends held, blocks (n, 6, 6) and (n - 1, 6, 6), and the metric (n, 6) it is compared with."""

    def __init__(self, line: Line, quaternion: Array, blocks: tuple[Array, Array, Array], metric: Array) -> None:
        diagonal, lower, upper = blocks
        self.diagonal = 0.5 * (diagonal + diagonal.transpose(0, 2, 1))
        self.upper = 0.5 * (upper + lower.transpose(0, 2, 1))
        self.metric = metric
        for node, free in ((0, _foot(line, quaternion)), (-1, _top(line))):
            self.diagonal[node] = free @ self.diagonal[node] @ free + (np.eye(SIZE) - free) * _HELD * metric[node]
            self.upper[node] = free @ self.upper[node] if node == 0 else self.upper[node] @ free

    def _shifted(self, shift: float) -> Array:
        out = self.diagonal.copy()
        out[:, range(SIZE), range(SIZE)] += shift * self.metric
        return out

    def positive(self, shift: float) -> bool:
        """Whether the tangent plus `shift` times the metric is positive definite."""
        return bool(_cholesky(self._shifted(shift), self.upper.copy()))

    def softest(self, shift: float) -> Array:
        """Motion (n, 6) of lowest stiffness over metric, of largest entry 1, by inverse iteration; `shift` is a first guess."""
        while not self.positive(shift) and shift < _LARGEST_SHIFT:
            shift *= 4.0
        diagonal, upper = self._shifted(shift), self.upper.copy()
        lower = np.ascontiguousarray(upper.transpose(0, 2, 1))
        exchanges = np.empty((len(upper), SIZE), np.int64)
        factorize(diagonal, lower, upper, exchanges)
        x = np.random.default_rng(0).normal(size=self.metric.shape)
        for _ in range(_SWEEPS):
            right = -self.metric * x
            condense(diagonal, lower, exchanges, right)
            substitute(upper, right, np.linalg.solve(diagonal[-1], -right[-1]), x)
            x /= x.flat[np.argmax(np.abs(x))]
        return x


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
