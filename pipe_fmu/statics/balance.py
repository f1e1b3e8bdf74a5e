"""A line at rest with its top held: forces, potential and tangent at a pose, and the corrections that follow from them."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..compiled import kernel
from ..element.ends import condense_top, hold_foot, hold_foot_tangent, top_correction
from ..element.strains import INSIDE_OUT, inverted
from ..line import Line, Water
from ..maths.block_tridiagonal import condense, factorize, substitute
from ..maths.so3 import exp, multiply, normalize
from ..simd.columns import attitude
from .stability import definite
from .system import static_system

Pose = tuple[Array, Array]  # positions (n, 3) [m], attitudes (n, 4)

_ROUND_OFF = 1e-12  # of the sum of absolute potentials
_NEUTRAL = 1e-6  # of the weight over the length: about the stiffness of a hanging line
_EPSILON = float(np.finfo(float).eps)
_NEAREST = 8  # eigenvalues looked at
_KRYLOV = 80  # vectors they are found with


@kernel
def turn(quaternion, x, out):
    """Attitudes after the spins of x (n, 6)."""
    for i in range(x.shape[0]):
        turned = normalize(multiply(exp((x[i, 3], x[i, 4], x[i, 5])), attitude(quaternion.T, i)))
        for a in range(4):
            out[i, a] = turned[a]


def moved(pose: Pose, move: Array) -> Pose:
    """Positions and attitudes after the displacements and spins (n, 6)."""
    turned = np.empty_like(pose[1])
    turn(pose[1], move, turned)
    return pose[0] + move[:, :3], turned


class Scales:
    """What a line is measured by: `force`, its weight [N]; `longest`, its longest element [m], which moments are measured over;
    `metric` (n, 6), each node's share of the weight by its length [N] (times that length squared over twelve); `neutral` [1/m]: of the
    metric, stiffness that counts as none; `rounding` [N]: force that a last digit of the position of the top makes in the stiffest element.

    A line that has hardly any weight is measured by the force that bends it, EI / L^2.
    """

    def __init__(self, line: Line) -> None:
        self.force, self.longest, self.neutral, self.rounding, self.metric = measures(line)


@kernel
def measures(line):
    """Force [N], longest element [m], neutral stiffness [1/m], rounding [N] and metric (n, 6) [N] of a line's Scales."""
    n, length, longest, weight, soft, stiff = line.mass.shape[0], 0.0, 0.0, 0.0, math.inf, 0.0
    for e in range(n - 1):
        h = line.length[e]
        length, longest = length + h, max(longest, h)
        weight += math.fabs(line.loads.weight[e] * h)
        soft = min(soft, line.stiffness[e, 4], line.stiffness[e, 5])
        stiff = max(stiff, line.stiffness[e, 0] / h)
    force = max(weight, soft / (length * length))
    metric = np.empty((n, 6))
    for i in range(n):
        node = 0.5 * ((line.length[i] if i < n - 1 else 0.0) + (line.length[i - 1] if i > 0 else 0.0))
        for k in range(3):
            metric[i, k], metric[i, 3 + k] = force / length * node, force / length * node * node * node / 12.0
    return force, longest, _NEUTRAL / length, _EPSILON * length * stiff, metric


@kernel
def hold(line, quaternion, vector):
    """Strike what acts on the held ends from forces (n, 6)."""
    hold_foot(line, quaternion, vector[0])
    for i in range(6 if line.top_clamped else 3):
        vector[-1, i] = 0.0


@kernel
def unbalance(residual, top, foot, force, longest):
    """Largest residual (moments over the longest element) over the weight `force` [N] or the force at an end, whichever is largest; the
    node it is at, and that force.
    """
    for end in (top, foot):
        force = max(force, math.sqrt(end[0] * end[0] + end[1] * end[1] + end[2] * end[2]))
    largest, worst = 0.0, 0
    for i in range(residual.shape[0]):
        for k in range(6):
            left = math.fabs(residual[i, k]) / (1.0 if k < 3 else longest)
            if not left <= largest:
                largest, worst = left, i
                if math.isnan(left):
                    return left, i, force
    return largest / force, worst, force


@kernel
def correction(line, factors, residual, x):
    """Fill in the displacements and spins x (n, 6) that undo a residual (n, 6), to first order, by the `factors` of the tangent."""
    diagonal, lower, upper = factors
    right, at_top = residual.copy(), np.empty(6)
    condense(lower, right)
    top_correction(line, diagonal[-1], right[-1], np.zeros(6), at_top)
    substitute(diagonal, upper, right, at_top, x)


@kernel
def limited(move, turn):
    """Displacements and spins (n, 6), reduced so that no section turns by more than `turn` [rad]; not finite if they are not."""
    largest = 0.0
    for i in range(move.shape[0]):
        for k in range(3, 6):
            largest = max(largest, math.fabs(move[i, k]))
    return (turn / largest if largest > turn else 1.0) * move


class Balance:
    """Forces on a line at a pose with its top held (the top's attitude too if it is clamped).

    potential [J], known to `blur`; residual (n, 6): what is not in balance, 0 where held; pull (n, 6): minus the drag in it; top, foot
    (6,): force and moment on the pipe at its ends; size: largest residual (moments over the longest element), at the node `worst`, over
    the weight or the force at an end, whichever is largest; rounding: what round-off makes of it.
    """

    def __init__(self, line: Line, water: Water, scales: Scales, pose: Pose) -> None:
        n = len(pose[0])
        self.line, self.water, self.scales, self.pose = line, water, scales, pose
        self.tangent = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6))
        self.residual, self.pull = np.empty((n, 6)), np.empty((n, 6))
        parts = static_system(line, water, *pose, *self.tangent, self.residual, self.pull)
        self.potential, self.blur = sum(parts), _ROUND_OFF * sum(abs(part) for part in parts)
        self.top, self.foot = self.residual[-1].copy(), self.residual[0].copy()
        self.hold(self.residual)
        self.size, self.worst, force = unbalance(self.residual, self.top, self.foot, scales.force, scales.longest)
        self.rounding = scales.rounding / force

    def after(self, move: Array) -> "Balance":
        """The balance after the displacements and spins (n, 6)."""
        return Balance(self.line, self.water, self.scales, moved(self.pose, move))

    def hold(self, vector: Array) -> None:
        """Strike what acts on the held ends from forces (n, 6)."""
        hold(self.line, self.pose[1], vector)

    def flaw(self) -> str:
        """What an element is in a pose that is no configuration of a line; empty if it is one."""
        return INSIDE_OUT if inverted(*self.pose) else ""

    def stable(self) -> bool:
        """Whether the line comes back when it is pushed.

        It does if the symmetric part of the tangent is positive definite, however it is damped. In still water, where the tangent is
        symmetric, this is all there is to it. The drag of a current has no potential and its part of the tangent is not symmetric; where
        the symmetric part is not definite, the line, moving as if damped by the metric, still comes back if all eigenvalues of the
        tangent have positive real parts (Lyapunov's first method). Only the eight nearest to zero are looked at: a drag so strong that it
        reversed a stiffness far from zero and left the softer ones alone would not be seen.
        """
        return self.definite() or (bool(self.pull.any()) and self._attracting())

    def definite(self, damping: float = 0.0) -> bool:
        """Whether the symmetric part of the tangent, with `damping` [1/m] times the metric, is positive definite."""
        stiffness = self.scales.neutral + damping
        return bool(definite(self.line, self.pose[1], self.tangent, self.scales.metric, stiffness))

    def _attracting(self) -> bool:
        factors = Factors(self, self.scales.neutral)

        def undone(flat: Array) -> Array:
            right = self.scales.metric * flat.reshape(-1, 6)
            self.hold(right)
            return -factors.correction(right).ravel()

        nearest = _largest_eigenvalues(undone, np.ones(self.residual.size))  # of the inverse
        return bool((nearest.real > 0.0).all())

    def along(self, move: Array) -> Array:
        """Tangent times displacements and spins (n, 6)."""
        diagonal, lower, upper = self.tangent
        out = np.einsum("nij,nj->ni", diagonal, move)
        out[:-1] += np.einsum("nij,nj->ni", upper, move[1:])
        out[1:] += np.einsum("nij,nj->ni", lower, move[:-1])
        return out

    def promise(self, move: Array) -> float:
        """Energy [J] that displacements and spins (n, 6) release to second order."""
        return -float((self.residual * move).sum() + 0.5 * (self.along(move) * move).sum())


class Factors:
    """Tangent of a balance with `damping` [1/m] times the metric, eliminated; `regular` is False where that is not possible."""

    def __init__(self, balance: Balance, damping: float) -> None:
        self.line = balance.line
        self.diagonal, self.lower, self.upper = (block.copy() for block in balance.tangent)
        if damping > 0.0:
            self.diagonal[:, range(6), range(6)] += damping * balance.scales.metric
        hold_foot_tangent(self.line, balance.pose[1], self.diagonal, self.upper)
        self.regular = bool(factorize(self.diagonal, self.lower, self.upper))

    def correction(self, residual: Array) -> Array:
        """Displacements and spins (n, 6) that undo a residual (n, 6), to first order."""
        x = np.empty_like(residual)
        correction(self.line, (self.diagonal, self.lower, self.upper), residual, x)
        return x

    def stiffness(self) -> Array:
        """Tangent (6, 6) at the top, the rest of the line following."""
        out = np.empty((6, 6))
        condense_top(self.line, self.diagonal[-1], out)
        return out


def _largest_eigenvalues(operator: Callable[[Array], Array], start: Array) -> NDArray[np.complex128]:
    """The _NEAREST eigenvalues of largest modulus, by Arnoldi's method (scipy's would cost every exported unit 140 MB)."""
    count = min(_KRYLOV, start.size)
    basis, projected = np.zeros((count + 1, start.size)), np.zeros((count + 1, count))
    basis[0] = start / np.linalg.norm(start)
    for k in range(count):
        new = operator(basis[k])
        for _ in range(2):  # once more, for round-off
            parts = basis[: k + 1] @ new
            new = new - parts @ basis[: k + 1]
            projected[: k + 1, k] += parts
        left = float(np.linalg.norm(new))
        if left <= np.finfo(float).eps * float(np.linalg.norm(projected[: k + 1, k])):
            count = k + 1
            break
        projected[k + 1, k], basis[k + 1] = left, new / left
    found = np.linalg.eigvals(projected[:count, :count]).astype(complex)
    return found[np.argsort(-np.abs(found))[:_NEAREST]]
