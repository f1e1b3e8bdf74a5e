"""A first guess for the next step of a bond: extrapolation of the last means, of the order that lately did best."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from .bond import Vector

HIGHEST_ORDER = 2
MEMORY = 0.5  # per step: how fast an order's past failure is forgotten


class Extrapolation:
    """Means of flow and effort by the middle of their steps; `norm` measures an error of the effort."""

    def __init__(self, flow: Vector, effort: Vector, norm: Callable[[Vector], float]) -> None:
        self._start = np.concatenate([flow, effort])
        self._n, self._norm = flow.size, norm
        self._points: deque[tuple[float, Vector]] = deque(maxlen=HIGHEST_ORDER + 1)
        self._errors = [0.0] * (HIGHEST_ORDER + 1)

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Flow and effort expected as the mean over a step with this middle."""
        orders = range(len(self._points))
        best = min(orders, key=self._errors.__getitem__, default=0)
        value = self._value(time, best)
        return value[: self._n], value[self._n :]

    def add(self, time: float, flow: Vector, effort: Vector) -> None:
        """Take in an accepted step and judge the orders by it."""
        for order in range(len(self._points)):
            error = self._norm(effort - self._value(time, order)[self._n :])
            self._errors[order] = max(error, MEMORY * self._errors[order])
        self._points.appendleft((time, np.concatenate([flow, effort])))

    def _value(self, time: float, order: int) -> Vector:
        if not self._points:
            return self._start
        nodes = [node for node, _ in list(self._points)[: order + 1]]
        total = np.zeros_like(self._start)
        for i, (node, (_, value)) in enumerate(zip(nodes, self._points, strict=False)):
            weight = 1.0
            for j, other in enumerate(nodes):
                if j != i:
                    weight *= (time - other) / (node - other)
            total += weight * value
        return total
