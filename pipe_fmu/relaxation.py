"""How a line finds its rest: Newton's method, and where that fails or ends in an unstable equilibrium, sinking through treacle.

Sinking is implicit Euler's method for the line without mass in a viscous medium, residual(x) + c (x - x_old) = 0 with c a `grip` times
the weight of each node: every step lowers the potential, as the real line does on its way to rest, and leaves unstable equilibria. The
grip loosens as steps succeed; without it the step is Newton's. From an unstable equilibrium the line is pushed along its softest
motion, downhill.
"""

import math
from typing import NamedTuple

import numpy as np

from .block_tridiagonal import condense, factorize, substitute
from .compiled import kernel
from .line import Array, Line, Water
from .newton import LOST, condense_top, hold_foot, hold_foot_residual, top_correction
from .so3 import exp, multiply, normalize
from .stability import Tangent
from .static_kernel import spin, static_system

TOLERANCE = 1e-11  # of the line's weight (times its longest element, for moments)
ROUND_OFF = 1e-7  # accepted once the residual no longer falls
NEUTRAL = 1e-6  # stiffness over weight per length of the line below which a motion counts as neutral
_FREE_CORRECTIONS = 20
_LARGEST_TURN = 0.25  # rad of one correction
_INNER_CORRECTIONS = 8  # of one step of sinking
_SETTLED = 0.02  # largest turn [rad] of the correction with which such a step ends
_FURTHEST_TURN = 0.8  # rad of such a step
_FIRST_GRIP = 10.0  # over the length of the line
_LEAST_GRIP = 1e-3
_MOST_GRIP = 1e7
_PUSH = 0.1  # rad, or this share of the longest element


class Equilibrium(NamedTuple):
    """Static solution; when not converged, the last good state."""

    converged: bool
    position: Array  # (n, 3)
    quaternion: Array  # (n, 4)
    top: Array  # (6,) force and moment on the pipe at its top, e
    foot: Array  # (6,) force and moment on the pipe at its foot, e
    stiffness: Array  # (6, 6) d top / d (displacement, spin) of the top
    stable: bool  # the tangent is positive definite
    iterations: int
    residual: float


Pose = tuple[Array, Array]


@kernel
def _turn(quaternion, x, out):
    """Attitudes after the spins of x (n, 6)."""
    for i in range(x.shape[0]):
        turned = normalize(multiply(exp((x[i, 3], x[i, 4], x[i, 5])), spin(quaternion, i)))
        for a in range(4):
            out[i, a] = turned[a]


class System:
    """Residual and tangent of a line at rest with its top held, and the corrections from them."""

    def __init__(self, line: Line, water: Water) -> None:
        h = line.length
        n = len(h) + 1
        self.line, self.water, self.extent = line, water, float(h.sum())
        self.blocks = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n, 6))
        self.exchanges = np.empty((n - 1, 6), np.int64)
        pull = np.maximum(np.abs(line.weight), 1e-3 * line.stiffness[:, 3:].max(axis=1) / self.extent**3) * h
        weight = float(pull.sum())
        self.scales = np.array([weight] * 3 + [weight * float(h.max())] * 3)
        node, arm = np.zeros(n), np.zeros(n)
        node[:-1] += 0.5 * pull
        node[1:] += 0.5 * pull
        arm[:-1] += 0.5 * pull * h**2
        arm[1:] += 0.5 * pull * h**2
        self.metric = np.column_stack([node] * 3 + [arm] * 3)  # force (moment) per grip and displacement (turn)
        self.held = 6 if line.top_clamped else 3

    def assemble(self, pose: Pose) -> tuple[float, float]:
        """Fill the system; returns (potential [J], largest free residual over its scale)."""
        diagonal, lower, upper, residual = self.blocks
        potential = sum(static_system(self.line, self.water, *pose, diagonal, lower, upper, residual))
        self.top, self.foot = residual[-1].copy(), residual[0].copy()
        hold_foot(self.line, pose[1], diagonal, upper)
        hold_foot_residual(self.line, pose[1], (0.0, 0.0, 0.0), residual)
        ratios = np.abs(residual) / self.scales
        ratios[-1, : self.held] = 0.0
        return potential, float(ratios.max())

    def correction(self, grip: float, way: Array) -> Array | None:
        """Correction (n, 6) of the assembled system under a grip [1/m] on a line that has gone `way` (n, 6); None if singular.

        No section turns by more than _LARGEST_TURN.
        """
        diagonal, lower, upper, residual = self.blocks
        if grip > 0.0:
            first = 1 if self.line.foot_clamped else 0
            diagonal[first:, range(6), range(6)] += grip * self.metric[first:]
            residual[first:] += grip * self.metric[first:] * way[first:]
            if first == 0:
                residual[0, :3] = 0.0
        if not factorize(diagonal, lower, upper, self.exchanges):
            return None
        condense(diagonal, lower, self.exchanges, residual)
        at_top, x = np.empty(6), np.empty_like(residual)
        if not top_correction(self.line, diagonal[-1], residual[-1], np.zeros(6), at_top):
            return None
        substitute(upper, residual, at_top, x)
        largest = float(np.abs(x[:, 3:]).max())
        if not largest < LOST:
            return None
        return x * (_LARGEST_TURN / largest) if largest > _LARGEST_TURN else x

    def tangent(self, pose: Pose) -> Tangent:
        """Symmetric tangent in a pose."""
        diagonal, lower, upper, residual = self.blocks
        static_system(self.line, self.water, *pose, diagonal, lower, upper, residual)
        return Tangent(self.line, pose[1], (diagonal, lower, upper), self.metric)

    def finished(self, pose: Pose, iterations: int, size: float) -> Equilibrium:
        """The equilibrium of a pose that has converged."""
        stable = self.tangent(pose).positive(NEUTRAL / self.extent)
        self.assemble(pose)
        diagonal, lower, upper, _ = self.blocks
        stiffness = np.zeros((6, 6))
        if factorize(diagonal, lower, upper, self.exchanges):
            condense_top(self.line, diagonal[-1], stiffness)
        return Equilibrium(True, *pose, self.top, self.foot, stiffness, stable, iterations, size)

    def failed(self, pose: Pose, iterations: int, size: float) -> Equilibrium:
        """What is left of a search without end."""
        self.assemble(pose)
        return Equilibrium(False, *pose, self.top, self.foot, np.zeros((6, 6)), False, iterations, size)


def relax(line: Line, water: Water, pose: Pose, limit: int) -> Equilibrium:
    """Stable equilibrium with the top held where it is (its attitude too if the line's top is clamped), in at most `limit` corrections."""
    system = System(line, water)
    found = newton(system, pose)
    if found.stable:
        return found
    start = (found.position, found.quaternion) if found.converged else pose
    return sink(system, start, found.converged, found.iterations, limit)


def newton(system: System, pose: Pose) -> Equilibrium:
    """Plain Newton's method."""
    best, size, iteration, still = math.inf, math.inf, 0, np.zeros_like(system.metric)
    for iteration in range(_FREE_CORRECTIONS):
        _, size = system.assemble(pose)
        if not size < LOST:
            break
        if _done(size, best):
            return system.finished(pose, iteration, size)
        best = min(best, size)
        move = system.correction(0.0, still)
        if move is None:
            break
        pose = moved(pose, move)
    return system.failed(pose, iteration, size)


def _done(size: float, best: float) -> bool:
    return size <= TOLERANCE or (size <= ROUND_OFF and size > 0.3 * best)


def sink(system: System, pose: Pose, at_rest: bool, spent: int, limit: int) -> Equilibrium:
    """Sinking from a pose; `at_rest`: it is an unstable equilibrium."""
    grip, size = _FIRST_GRIP, math.inf
    while spent < limit:
        if at_rest:
            pose, grip, at_rest = _pushed(system, pose), _FIRST_GRIP, False
        start, good, size = pose, False, math.inf
        tight = grip / system.extent if grip >= _LEAST_GRIP else 0.0
        way = np.zeros_like(system.metric)
        for k in range(1, _INNER_CORRECTIONS + 1 if tight > 0.0 else _FREE_CORRECTIONS + 1):
            best = size
            _, size = system.assemble(pose)
            if tight == 0.0 and _done(size, best):
                found = system.finished(pose, spent, size)
                if found.stable:
                    return found
                at_rest = True
                break
            move = system.correction(tight, way) if size < LOST else None
            if move is None:
                break
            spent += 1
            pose, way = moved(pose, move), way + move
            if not np.abs(way[:, 3:]).max() < _FURTHEST_TURN:
                break
            if tight > 0.0 and np.abs(move[:, 3:]).max() < _SETTLED:
                good = True
                break
        if at_rest:
            continue
        if good:
            grip *= 0.125 if k <= 3 else 0.4 if k <= 5 else 1.0
        else:
            pose, grip = start, max(4.0 * grip, _LEAST_GRIP)
            if grip > _MOST_GRIP:
                break
    return system.failed(pose, spent, size)


def _pushed(system: System, pose: Pose) -> Pose:
    """A pose moved a little along its softest motion."""
    mode = system.tangent(pose).softest(NEUTRAL / system.extent)
    size = max(np.abs(mode[:, 3:]).max(), np.abs(mode[:, :3]).max() / system.line.length.max())
    return moved(pose, mode * (_PUSH / size))


def moved(pose: Pose, move: Array) -> Pose:
    """Positions and attitudes after a correction (n, 6)."""
    turned = np.empty_like(pose[1])
    _turn(pose[1], move, turned)
    return pose[0] + move[:, :3], turned
