"""A first guess for the next step of a bond: extrapolation of the last means, of the order that lately did best."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from .bond import Matrix, Vector

HIGHEST_ORDER = 2
MEMORY = 0.5  # per step: how fast an order's past failure is forgotten


class Extrapolation:
    """Means of flow and effort by the middle of their steps; `norm` measures errors of the effort, (k, n) to (k,)."""

    def __init__(self, flow: Vector, effort: Vector, norm: Callable[[Matrix], Vector]) -> None:
        self._start = np.concatenate([flow, effort])
        self._n, self._norm = flow.size, norm
        self._nodes: deque[float] = deque(maxlen=HIGHEST_ORDER + 1)  # the latest first
        self._points: deque[Vector] = deque(maxlen=HIGHEST_ORDER + 1)
        self._errors = [0.0] * (HIGHEST_ORDER + 1)

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Flow and effort expected as the mean over a step with this middle."""
        if not self._nodes:
            return self._start[: self._n], self._start[self._n :]
        best = min(range(len(self._nodes)), key=self._errors.__getitem__)
        value = np.array(self._weights(time, best)) @ np.array(self._points)
        return value[: self._n], value[self._n :]

    def add(self, time: float, flow: Vector, effort: Vector) -> None:
        """Take in an accepted step and judge the orders by it."""
        if self._nodes:
            weights = [self._weights(time, order) for order in range(len(self._nodes))]
            missed = effort - (np.array(weights) @ np.array(self._points))[:, self._n :]
            for order, error in enumerate(self._norm(missed).tolist()):
                self._errors[order] = max(error, MEMORY * self._errors[order])
        self._nodes.appendleft(time)
        self._points.appendleft(np.concatenate([flow, effort]))

    def _weights(self, time: float, order: int) -> list[float]:
        """Lagrange's weights of the points, zero for those that the order does not use."""
        nodes, weights = self._nodes, [0.0] * len(self._nodes)
        for i in range(order + 1):
            weights[i] = 1.0
            for j in range(order + 1):
                if j != i:
                    weights[i] *= (time - nodes[j]) / (nodes[i] - nodes[j])
        return weights
