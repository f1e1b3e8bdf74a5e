"""The law V = r + Y f by which the mean flow of an end without rollback is foreseen, found from the steps so far alone.

A mass, under loads that change smoothly, answers the effort f held over a step of length h with the mean flow

    V_n = V_(n-1) + A (h_n f_n + b h_(n-1) f_(n-1)) + g (h_n + h_(n-1)) / 2

where A is symmetric and not negative: half the inverse mass, with b = 1, if V is the mean over a midpoint step; the inverse mass, with
b = 0, if V is the velocity at the end of the step; in between for a unit with steps of its own. The acceleration g is due to the end's own
springs, dampers and loads. A and b follow from the last steps by least squares, beside an acceleration linear in time, flow and
displacement. The variance of the fit tells how far it can be trusted: A is drawn to its mean over all directions, that to zero, and b to 1;
a fit from steps that tell less than earlier ones did is not taken.

r is foreseen in several ways at once, by polynomials in time through g, g less what decays with the flow, and V - Y f; that which lately
came closest is believed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from .bond import Matrix, Vector

ORDERS = 3  # of the polynomials: constant, linear, quadratic
WINDOW = 24  # steps that the fit remembers
MEMORY = 0.5  # per step: how fast a way's past failure is forgotten
SEEN = 1e-9  # of the data: below it a column counts as explained by the others
AGEING, BEST = 1.2, 1e-6  # of a fit's relative variance: growth a step, and the least that is believed
ALTERNATIONS = 3  # of the fits of A and b
SIGNIFICANT = 4.0  # variances by which b must differ from 1


class _Seen(NamedTuple):
    """A step done: its middle, length, mean flow, effort, and the displacement before it."""

    middle: float
    step: float
    flow: Vector
    effort: Vector
    displacement: Vector


class MeasuredLaw:
    """The law of one end; flows are measured in units of `scale` (n,). Before the first step it has the flow it stands at."""

    def __init__(self, flow: Vector, scale: Vector) -> None:
        self._scale, self._size, still = scale, flow.size, np.zeros(flow.size)
        self._seen: deque[_Seen] = deque([_Seen(0.0, 0.0, flow, still, still)], maxlen=WINDOW)
        self._A, self._b = np.zeros((flow.size, flow.size)), 1.0
        self._variance = np.inf  # of A, relative
        self._decay = np.zeros(flow.size)  # 1/s, not positive
        self._errors = np.zeros(3 * ORDERS)

    def at(self, middle: float, step: float) -> tuple[Vector, Matrix]:
        """r and Y of a step with this middle and length."""
        return self._ways(middle, step)[int(np.argmin(self._errors))], step * self._A

    def add(self, middle: float, step: float, flow: Vector, effort: Vector) -> None:
        """Take in a step, judge the ways by it, and fit anew."""
        missed = np.array(self._ways(middle, step)) - (flow - step * self._A @ effort)
        self._errors = np.maximum(np.abs(missed / self._scale).max(axis=1), MEMORY * self._errors)
        last = self._seen[-1]
        self._seen.append(_Seen(middle, step, flow, effort, last.displacement + last.step * last.flow))
        if len(self._seen) > 2:
            self._fit()

    def _ways(self, middle: float, step: float) -> list[Vector]:
        recent = list(self._seen)[-1 - ORDERS :]
        last, span = recent[-1], (step + recent[-1].step) / 2
        base = last.flow + self._b * last.step * self._A @ last.effort
        found, none = [], [np.zeros(self._size)]
        for decay in (none[0], np.maximum(self._decay, -1.0 / span)):
            loads = [self._acceleration(*pair) - decay * pair[0].flow for pair in pairwise(recent)]
            smooth = _extrapolated([one.middle for one in recent[1:]], loads or none, middle)
            found += [base + span * (load + decay * last.flow) for load in smooth]
        recent = recent[-ORDERS:]
        means = [one.flow - one.step * self._A @ one.effort for one in recent]
        return found + _extrapolated([one.middle for one in recent], means, middle)

    def _acceleration(self, before: _Seen, one: _Seen) -> Vector:
        """g between two steps."""
        driven = self._A @ (one.step * one.effort + self._b * before.step * before.effort)
        return (one.flow - before.flow - driven) * 2.0 / (one.step + before.step)

    def _fit(self) -> None:
        """A, b and the decay, in units of the flows that count, where the steps seen tell them well enough."""
        middles, steps, flows, efforts, displacements = (np.array(column) for column in zip(*self._seen, strict=True))
        spans = ((steps[1:] + steps[:-1]) / 2)[:, None]
        answers = np.diff(flows, axis=0) / spans / self._scale  # (k, n)
        impulses = steps[:, None] * efforts * self._scale
        now, before = impulses[1:] / spans, impulses[:-1] / spans
        times = np.broadcast_to(middles[1:, None], answers.shape)
        count = min(4, len(answers) - 1)
        smooth = np.array([np.ones_like(answers), flows[:-1], displacements[1:], times])[:count].transpose(2, 1, 0)  # (n, k, count)
        sizes = np.linalg.norm(smooth, axis=1, keepdims=True)
        smooth = smooth / np.where(sizes > 0.0, sizes, 1.0)
        vectors, values, _ = np.linalg.svd(smooth, full_matrices=False)
        explained = vectors * (values > SEEN * values[:, :1])[:, None, :]

        def rest(columns: Matrix) -> Matrix:
            """What the smooth columns do not explain of (n, k, m)."""
            return columns - explained @ (explained.transpose(0, 2, 1) @ columns)

        shape = (self._size, *now.shape)
        own, late, early = (
            rest(answers.T[:, :, None])[:, :, 0],
            rest(np.broadcast_to(now, shape)),
            rest(np.broadcast_to(before, shape)),
        )
        freedom = max(own.size - self._size * count - 1, 1)
        a, variance, b = np.zeros((self._size, self._size)), np.inf, self._b
        for _ in range(ALTERNATIONS):
            a, variance = _slopes(own, late + b * early, count, SEEN * float(np.linalg.norm(now)))
            b = _share(own - np.einsum("ij,isj->is", a, late), np.einsum("ij,isj->is", a, early), freedom)
        self._variance *= AGEING
        if not variance <= self._variance:
            return
        self._A, self._variance = np.outer(self._scale, self._scale) * a, max(variance, BEST)
        self._b = b
        left = answers - (now + b * before) @ a.T
        for i in range(self._size if count > 1 else 0):
            by_flow = np.linalg.lstsq(smooth[i], left[:, i], rcond=SEEN)[0][1] * self._scale[i]
            self._decay[i] = min(by_flow / sizes[i, 0, 1], 0.0) if sizes[i, 0, 1] > 0.0 else 0.0


def _slopes(answers: Matrix, causes: Matrix, count: int, least: float) -> tuple[Matrix, float]:
    """The symmetric matrix (n, n), not negative, that gives answers (n, k) from causes (n, k, n), and its mean's relative variance.

    `count` smooth columns are taken out of both.
    """
    n, k = answers.shape
    freedom = max(n * (k - count) - 1, 1)
    own = causes[range(n), :, range(n)]
    strength = float((own * own).sum())
    mean = float((answers * own).sum()) / strength if strength > least * least else 0.0
    if mean <= 0.0:
        return np.zeros((n, n)), np.inf
    variance = float(((answers - mean * own) ** 2).sum()) / freedom / strength / mean**2
    mean *= max(0.0, 1.0 - variance)
    if mean == 0.0:
        return np.zeros((n, n)), np.inf
    a = mean * np.eye(n)
    for row, answer, cause in zip(a, answers, causes, strict=True):
        left, normal, spare = answer - cause @ row, cause.T @ cause, k - count - n
        if spare > 0:
            noise = left - cause @ np.linalg.lstsq(cause, left, rcond=SEEN)[0]
        else:
            noise, spare = left, max(k - count, 1)
        ridge = float(noise @ noise) / spare / mean**2 + SEEN * np.trace(normal)
        row += np.linalg.solve(normal + ridge * np.eye(n), cause.T @ left)
    values, vectors = np.linalg.eigh((a + a.T) / 2)
    return vectors * np.maximum(values, 0.0) @ vectors.T, variance


def _share(left: Matrix, early: Matrix, freedom: int) -> float:
    """b, where `left` is what the efforts of each step leave for those of the step before."""
    strength = float((early * early).sum())
    b = min(max(float((left * early).sum()) / strength, 0.0), 1.0) if strength > 0.0 else 1.0
    if b == 1.0:
        return b
    variance = float(((left - b * early) ** 2).sum()) / freedom / strength
    return 1.0 - (1.0 - b) * max(0.0, 1.0 - SIGNIFICANT * variance / (1.0 - b) ** 2)


def _extrapolated(times: Sequence[float], values: Sequence[Vector], time: float) -> list[Vector]:
    """Values at `time` by polynomials of rising order through the latest points; of the highest there is where points are few."""
    nodes, differences = times[::-1], list(values[::-1])  # Newton's form, from the latest point back
    found, product = [differences[0]], 1.0
    for order in range(1, ORDERS):
        if len(differences) > 1:
            differences = [(a - b) / (nodes[i] - nodes[i + order]) for i, (a, b) in enumerate(pairwise(differences))]
            product *= time - nodes[order - 1]
            found.append(found[-1] + product * differences[0])
        else:
            found.append(found[-1])
    return found
