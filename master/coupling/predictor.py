"""A first guess for the next step of a bond: extrapolation of the last means, of the order that lately did best."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import nan

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
        self._differences: list[Vector] = []  # divided ones, of order 0, 1, ... from the latest node back
        self._errors = [0.0] * (HIGHEST_ORDER + 1)
        self._expected: tuple[float, list[Vector]] = (nan, [])  # the time last asked for, and the values there by order

    def at(self, time: float) -> tuple[Vector, Vector]:
        """Flow and effort expected as the mean over a step with this middle."""
        value = self._start
        if self._differences:
            self._expected = time, self._orders(time)
            value = self._expected[1][min(range(len(self._differences)), key=self._errors.__getitem__)]
        return value[: self._n], value[self._n :]

    def add(self, time: float, flow: Vector, effort: Vector) -> None:
        """Take in an accepted step and judge the orders by it."""
        if self._differences:
            asked, values = self._expected
            missed = effort - np.array(values if asked == time else self._orders(time))[:, self._n :]
            for order, error in enumerate(self._norm(missed).tolist()):
                self._errors[order] = max(error, MEMORY * self._errors[order])
        found = [np.concatenate([flow, effort])]
        for node, older in zip(self._nodes, self._differences[:HIGHEST_ORDER], strict=False):
            found.append((found[-1] - older) / (time - node))
        self._nodes.appendleft(time)
        self._differences = found

    def _orders(self, time: float) -> list[Vector]:
        """The values extrapolated with rising order, by Newton's form."""
        values, product = self._differences[:1], 1.0
        for node, difference in zip(self._nodes, self._differences[1:], strict=False):
            product *= time - node
            values.append(values[-1] + product * difference)
        return values
