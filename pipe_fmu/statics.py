"""Static equilibrium, G_stat = 0 of eq. (94): Newton's method, made safe by damping and by turning the top in small steps.

A correction that raises both the potential and the residual is refused and repeated with a stiffer diagonal, until undamped corrections
converge. The line is first hung with a free top from the catenary, then its top section is turned to where it is held.
"""

import math
from typing import NamedTuple

import numpy as np

from . import catenary
from .block_tridiagonal import condense, factorize, substitute
from .compiled import kernel
from .line import Array, Line, Water
from .newton import LOST, condense_top, hold_foot, hold_foot_residual, top_correction
from .so3 import conjugate, exp, log, multiply, normalize, scale
from .stability import positive
from .static_kernel import static_system

TOLERANCE = 1e-11  # of the line's weight (times its longest element, for moments)
ROUND_OFF = 1e-7  # accepted once the residual no longer falls
_FREE_CORRECTIONS = 60
_LARGEST_TURN = 0.25  # rad of one correction
_LEAST_DAMPING = 1e-3  # of the scales, per metre and radian
_MOST_DAMPING = 1e9
_STALLED = 1e3  # damping at which a residual of round-off no longer falls
_HAULED_FROM = 0.9  # of the taut distance
_HAULS = 8  # steps at least in which the top is hauled in
_TURN_OF_TOP = 0.35  # rad of one load step of the top section


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


@kernel
def _turn(quaternion, x, out):
    """Attitudes after the spins of x (n, 6)."""
    for i in range(x.shape[0]):
        old = (quaternion[i, 0], quaternion[i, 1], quaternion[i, 2], quaternion[i, 3])
        turned = normalize(multiply(exp((x[i, 3], x[i, 4], x[i, 5])), old))
        for a in range(4):
            out[i, a] = turned[a]


class _System:
    """Residual and tangent of a line at rest, and the Newton correction from them."""

    def __init__(self, line: Line, water: Water, force_scale: float, moment_scale: float) -> None:
        n = len(line.length) + 1
        self.line, self.water = line, water
        self.blocks = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n, 6))
        self.scales = np.array([force_scale] * 3 + [moment_scale] * 3)
        self.held = 6 if line.top_clamped else 3

    def assemble(self, position: Array, quaternion: Array) -> tuple[float, float, Array, Array]:
        """Fill the system; returns (potential [J], largest free residual over its scale, forces on top and foot (6,))."""
        diagonal, lower, upper, residual = self.blocks
        potential = sum(static_system(self.line, self.water, position, quaternion, diagonal, lower, upper, residual))
        top, foot = residual[-1].copy(), residual[0].copy()
        hold_foot(self.line, quaternion, diagonal, upper)
        hold_foot_residual(self.line, quaternion, (0.0, 0.0, 0.0), residual)
        ratios = np.abs(residual) / self.scales
        ratios[-1, : self.held] = 0.0
        return potential, float(ratios.max()), top, foot

    def eliminate(self, damping: float) -> bool:
        """Condense onto the top, with `damping` times the scales added to the diagonal; False if singular."""
        diagonal, lower, upper, residual = self.blocks
        if damping > 0.0:
            diagonal[1:, range(6), range(6)] += damping * self.scales
        if not factorize(diagonal, lower, upper):
            return False
        condense(lower, residual)
        return True

    def correction(self) -> Array | None:
        """Newton correction (n, 6) of an eliminated system, no section turned by more than _LARGEST_TURN; None if singular."""
        diagonal, _, upper, residual = self.blocks
        at_top, x = np.empty(6), np.empty_like(residual)
        if not top_correction(self.line, diagonal[-1], residual[-1], np.zeros(6), at_top):
            return None
        substitute(diagonal, upper, residual, at_top, x)
        largest = float(np.abs(x[:, 3:]).max())
        return x * (_LARGEST_TURN / largest) if largest > _LARGEST_TURN else x

    def stiffness(self) -> Array:
        """Condensed tangent (6, 6) at the top of an eliminated system."""
        out = np.empty((6, 6))
        condense_top(self.line, self.blocks[0][-1], out)
        return out

    def stable(self, position: Array, quaternion: Array) -> bool:
        """Whether the tangent of a configuration is positive definite."""
        static_system(self.line, self.water, position, quaternion, *self.blocks)
        return positive(self.line, quaternion, self.blocks[:3], self.scales / self.line.length.sum())


def relax(line: Line, water: Water, position: Array, quaternion: Array, scales: tuple[float, float], limit: int) -> Equilibrium:
    """Equilibrium with the top held where it is (its attitude too if the line's top is clamped).

    Newton's corrections are taken as they come for _FREE_CORRECTIONS; if that fails, the search starts anew and refuses, and damps, every
    correction that raises both the potential and the residual. At most `limit` corrections of that kind.
    """
    system = _System(line, water, *scales)
    start = (position, quaternion)
    found = _newton(system, start)
    if found.converged:
        return found
    found = _damped(system, start, limit)
    closer = found if found.converged else _newton(system, (found.position, found.quaternion))
    return closer if closer.converged else found


def _newton(system: _System, trial: tuple[Array, Array]) -> Equilibrium:
    """Plain Newton's method."""
    best, size, iteration = math.inf, math.inf, 0
    for iteration in range(_FREE_CORRECTIONS):
        _, size, top, foot = system.assemble(*trial)
        if not system.eliminate(0.0) or not size < LOST:
            break
        if size <= TOLERANCE or (size <= ROUND_OFF and size > 0.3 * best):
            return Equilibrium(True, *trial, top, foot, system.stiffness(), system.stable(*trial), iteration, size)
        best = min(best, size)
        move = system.correction()
        if move is None:
            break
        trial = _moved(trial, move)
    return Equilibrium(False, *trial, np.zeros(6), np.zeros(6), np.zeros((6, 6)), False, iteration, size)


def _damped(system: _System, trial: tuple[Array, Array], limit: int) -> Equilibrium:
    """Newton's method with a diagonal that stiffens until a correction lowers the potential or the residual."""
    damping, lowest, best, good = 0.0, math.inf, math.inf, trial
    for iteration in range(limit):
        potential, size, top, foot = system.assemble(*trial)
        resting = size <= TOLERANCE or (size <= ROUND_OFF and damping > _STALLED)
        if resting and system.eliminate(0.0):
            return Equilibrium(True, *trial, top, foot, system.stiffness(), system.stable(*trial), iteration, size)
        if size < LOST and (size < best or potential < lowest):
            best, lowest, good = size, potential, trial
            damping = 0.0 if damping < _LEAST_DAMPING else 0.25 * damping
        else:
            damping = max(4.0 * damping, _LEAST_DAMPING)
            system.assemble(*good)
        move = system.correction() if system.eliminate(damping) else None
        while move is None and damping < _MOST_DAMPING:
            damping = max(4.0 * damping, _LEAST_DAMPING)
            system.assemble(*good)
            move = system.correction() if system.eliminate(damping) else None
        if move is None or damping >= _MOST_DAMPING:
            break
        trial = _moved(good, move)
    _, size, top, foot = system.assemble(*good)
    if size <= ROUND_OFF and system.eliminate(0.0):
        return Equilibrium(True, *good, top, foot, system.stiffness(), system.stable(*good), limit, size)
    return Equilibrium(False, *good, top, foot, np.zeros((6, 6)), False, limit, size)


def _moved(configuration: tuple[Array, Array], move: Array) -> tuple[Array, Array]:
    """Positions and attitudes after a correction (n, 6)."""
    turned = np.empty_like(configuration[1])
    _turn(configuration[1], move, turned)
    return configuration[0] + move[:, :3], turned


def solve(line: Line, s: Array, water: Water, top: tuple[float, float, float], attitude: Array | None, limit: int = 400) -> Equilibrium:
    """Equilibrium with the top at `top` (3,) [m], e, and its section at `attitude` (4,), or as it hangs if None.

    line, s (n,): the discretised line; water: current at the time of the start.
    """
    weight = float(np.abs(line.weight * line.length).sum())
    scales = weight, weight * float(line.length.max())
    still = Water(np.zeros(0), np.zeros((0, 3)), False)
    free = line._replace(top_clamped=False)
    result = _hung(free, still, s, top, scales, limit)
    if result.converged and water.levels.shape[0] > 0:
        result = _with_current(free, water, result, scales, limit)
    if attitude is None or not line.top_clamped or not result.converged:
        return result
    held = tuple(float(x) for x in attitude)
    start = tuple(float(x) for x in result.quaternion[-1])
    turn = log(multiply(held, conjugate(start)))
    steps = max(1, math.ceil(math.hypot(*turn) / _TURN_OF_TOP))
    for k in range(1, steps + 1):
        quaternion = result.quaternion.copy()
        quaternion[-1] = held if k == steps else multiply(exp(scale(k / steps, turn)), start)
        result = relax(line, water, result.position, quaternion, scales, limit)
        if not result.converged:
            break
    return result


def _hung(line: Line, water: Water, s: Array, top: tuple[float, float, float], scales: tuple[float, float], limit: int) -> Equilibrium:
    """Equilibrium of the line hanging from `top` (3,): from the catenary, or else hauled in from where it is nearly taut."""
    found = relax(line, water, *_catenary(line, s, top), scales, limit)
    if found.converged and found.stable:
        return found
    heading = math.atan2(top[1], top[0])
    reach = _HAULED_FROM * math.sqrt(max(float(s[-1]) ** 2 - top[2] ** 2, 0.0))
    away = (reach * math.cos(heading), reach * math.sin(heading), top[2])
    result = relax(line, water, *_catenary(line, s, away), scales, limit)
    way = np.array(top) - away
    reached, step = 0.0, 1.0 / _HAULS
    while result.converged and reached < 1.0:
        wanted = min(1.0, reached + step)
        move = np.outer(s / s[-1], (wanted - reached) * way)
        trial = relax(line, water, result.position + move, result.quaternion, scales, limit)
        if trial.converged and trial.stable:
            reached, result, step = wanted, trial, min(1.5 * step, 1.0 / _HAULS)
        elif step < 1.0 / 2048.0:
            return found if found.converged else trial
        else:
            step *= 0.5
    return result if (result.converged and result.stable) or not found.converged else found


def _catenary(line: Line, s: Array, top: tuple[float, float, float]) -> tuple[Array, Array]:
    """Pose in which the search starts."""
    position, quaternion = catenary.shape(s, float(s[-1]), top, line.bed.shape[0] > 0)
    if line.foot_clamped:
        quaternion[0] = (1.0, 0.0, 0.0, 0.0)
    return position, quaternion


def _with_current(line: Line, water: Water, start: Equilibrium, scales: tuple[float, float], limit: int) -> Equilibrium:
    """Equilibrium in the current: at once, or else by raising it in ever smaller steps."""
    reached, step, result = 0.0, 1.0, start
    while reached < 1.0:
        wanted = min(1.0, reached + step)
        slower = water._replace(velocities=wanted * water.velocities)
        trial = relax(line, slower, result.position, result.quaternion, scales, limit)
        if trial.converged:
            reached, result = wanted, trial
        elif step < 1.0 / 64.0:
            return trial
        else:
            step *= 0.5
    return result
