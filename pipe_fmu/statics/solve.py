"""Static equilibrium, G_stat = 0 of eq. (94): the line is hung with a free top from the catenary, in still water and then in the current,
and its top section is turned to where it is held, each time to a stable equilibrium near the last one. The foot's is held from the start,
or where that fails turned in the same way.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..line import Line, Water
from ..maths.so3 import apply_transposed, conjugate, exp, log, matrix, multiply, scale
from . import catenary
from .balance import Balance, Factors, Pose, Scales
from .relaxation import DESCENTS, relax

_HAULED_FROM = 0.9  # of the taut distance
_LONGEST = 1.0 / 8.0  # of the way that the top is led, in one step,
_SHORTEST = 1.0 / 512.0  # and the step at which the line may fall into another shape
_FEW = 150  # steps of descent, while the step of the top can be shortened
_MOST = 10000  # corrections on the whole way, after which no equilibrium is found
_TURN_OF_END = 0.35  # rad of the section at an end in one step
_EITHER_WAY = 1e-6  # rad, within which a turn is half a turn
_LEVEL = np.array([1.0, 0.0, 0.0, 0.0])  # attitude of a clamped foot


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
    residual: float  # largest force not in balance, over the weight or the force at an end, whichever is largest
    worst: int  # the node it is at
    flaw: str  # what an element is where the forces balance in no configuration of a line

    def unbalance(self, s: Array) -> str:
        """What is not in balance, in words; s (n,): arc lengths of the nodes."""
        largest = f"residual {self.residual:.1e} of the weight or end force at s = {s[self.worst]:.6g} m"
        return f"{largest} after {self.iterations} corrections" + (f"; an element is {self.flaw}" if self.flaw else "")


Led = Callable[[Equilibrium, float, float], Pose]


def solve(line: Line, s: Array, water: Water, top: tuple[float, float, float], attitude: Array | None) -> Equilibrium:
    """Equilibrium with the top at `top` (3,) [m], e, and its section at `attitude` (4,), or as it hangs if None.

    line, s (n,): the discretised line; water: current at the time of the start.
    """
    scales, free = Scales(line), line._replace(top_clamped=False)
    result = _hung(free, water, scales, s, top)
    if not result.stable and line.foot_clamped:
        pinned = _hung(free._replace(foot_clamped=False), water, scales, s, top)
        turned = _turned(free, water, scales, pinned, 0, _LEVEL)
        result = turned if turned.stable or not result.converged else result
    if not result.stable:
        hauled = _hauled(free, water, scales, s, top)
        result = hauled if hauled.stable or not result.converged else result
    if attitude is None or not line.top_clamped or not result.converged:
        return result
    return _turned(line, water, scales, result, -1, attitude)


def _turned(line: Line, water: Water, scales: Scales, result: Equilibrium, node: int, attitude: Array) -> Equilibrium:
    """Equilibrium with the section at one end turned to `attitude` (4,) from where it is."""
    held = tuple(float(x) for x in attitude)
    start = tuple(float(x) for x in result.quaternion[node])
    turn = _least(log(multiply(held, conjugate(start))), start)

    def turned(at: Equilibrium, reached: float, wanted: float) -> Pose:
        quaternion = at.quaternion.copy()
        quaternion[node] = held if wanted == 1.0 else multiply(exp(scale(wanted, turn)), start)
        return at.position, quaternion

    return _led(line, water, scales, result, turned, min(1.0, _TURN_OF_END / max(math.hypot(*turn), _TURN_OF_END)))


def _least(turn: tuple[float, ...], start: tuple[float, ...]) -> tuple[float, ...]:
    """The rotation vector of the least turn from an attitude; of two that are half a turn either way, but for round-off, that which twists
    the line first about t1 (else t2, t3) of the attitude, so that the line is led alike whatever the directions of the axes.
    """
    angle = math.hypot(*turn)
    if angle < math.pi - _EITHER_WAY:
        return turn
    along = apply_transposed(matrix(start), turn)
    leading = next(part for part in along if abs(part) > _EITHER_WAY)
    return turn if leading > 0.0 else scale(1.0 - 2.0 * math.pi / angle, turn)


def _hung(line: Line, water: Water, scales: Scales, s: Array, top: tuple[float, float, float]) -> Equilibrium:
    """Equilibrium of the line hanging from `top` (3,): from the catenary in still water, then in the current."""
    still = water._replace(levels=np.zeros(0), velocities=np.zeros((0, 3)))
    result = equilibrium(line, still, scales, _catenary(line, s, top))
    if result.converged and water.levels.shape[0] > 0:
        result = equilibrium(line, water, scales, (result.position, result.quaternion))
    return result


def _hauled(line: Line, water: Water, scales: Scales, s: Array, top: tuple[float, float, float]) -> Equilibrium:
    """Equilibrium of the line hanging from `top` (3,), its top hauled in from where it is nearly taut, so that slack is carried off as it
    comes.
    """
    heading = math.atan2(top[1], top[0])
    reach = _HAULED_FROM * math.sqrt(max(float(s[-1]) ** 2 - top[2] ** 2, 0.0))
    away = (reach * math.cos(heading), reach * math.sin(heading), top[2])
    result = _hung(line, water, scales, s, away)
    way = np.outer(s / s[-1], np.array(top) - away)

    def hauled(at: Equilibrium, reached: float, wanted: float) -> Pose:
        return at.position + (wanted - reached) * way, at.quaternion

    return _led(line, water, scales, result, hauled, _LONGEST)


def _led(line: Line, water: Water, scales: Scales, result: Equilibrium, pose: Led, longest: float) -> Equilibrium:
    """Equilibrium at the end of the way that the top is led, in steps shortened where the line would leave the stable shape it is in.

    pose: where the line starts from for the part `wanted` of the way, from the equilibrium at the part `reached`.
    """
    reached, step, left = 0.0, longest, _MOST
    while result.converged and reached < 1.0:
        wanted = min(1.0, reached + step)
        trial = equilibrium(line, water, scales, pose(result, reached, wanted), min(left, _FEW if step > _SHORTEST else DESCENTS))
        left = max(left - trial.iterations, 0)
        if trial.stable or not result.stable or step <= _SHORTEST:
            reached, result, step = wanted, trial, min(1.5 * step, longest)
        else:
            step *= 0.5
    return result


def equilibrium(line: Line, water: Water, scales: Scales, pose: Pose, descents: int = DESCENTS) -> Equilibrium:
    """Equilibrium near a pose, with the top held where it is, in at most so many steps of descent."""
    balance, converged, stable, iterations = relax(Balance(line, water, scales, pose), descents)
    factors = Factors(balance, 0.0)
    stiffness = factors.stiffness() if factors.regular else np.full((6, 6), math.nan)
    at_ends = balance.top, balance.foot, stiffness
    return Equilibrium(converged, *balance.pose, *at_ends, stable, iterations, balance.size, balance.worst, balance.flaw())


def _catenary(line: Line, s: Array, top: tuple[float, float, float]) -> Pose:
    """Pose in which the search starts."""
    floats = float(line.loads.weight @ line.length) < 0.0
    position, quaternion = catenary.shape(s, float(s[-1]), top, line.loads.bed.bearing.size > 0, floats)
    if line.foot_clamped:
        quaternion[0] = _LEVEL
    return position, quaternion
