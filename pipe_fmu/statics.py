"""Static equilibrium, G_stat = 0 of eq. (94), of a line from the catenary of its length on.

The line is first hung with a free top from the catenary, then put into the current, then its top section is turned to where it is held.
"""

import math

from . import catenary
from .line import Array, Line, Water
from .relaxation import Equilibrium, Pose, relax
from .so3 import conjugate, exp, log, multiply, scale

import numpy as np

_TURN_OF_TOP = 0.35  # rad of one load step of the top section


def solve(line: Line, s: Array, water: Water, top: tuple[float, float, float], attitude: Array | None, limit: int = 400) -> Equilibrium:
    """Equilibrium with the top at `top` (3,) [m], e, and its section at `attitude` (4,), or as it hangs if None.

    line, s (n,): the discretised line; water: current at the time of the start.
    """
    length = float(s[-1])
    position, quaternion = catenary.shape(s, length, top, line.bed.shape[0] > 0)
    if line.foot_clamped:
        quaternion[0] = (1.0, 0.0, 0.0, 0.0)
    still = Water(np.zeros(0), np.zeros((0, 3)), False)
    free = line._replace(top_clamped=False)
    result = relax(free, still, (position, quaternion), limit)
    if result.converged and water.levels.shape[0] > 0:
        result = _with_current(free, water, result, limit)
    if attitude is None or not line.top_clamped or not result.converged:
        return result
    held = tuple(float(x) for x in attitude)
    start = tuple(float(x) for x in result.quaternion[-1])
    turn = log(multiply(held, conjugate(start)))
    steps = max(1, math.ceil(math.hypot(*turn) / _TURN_OF_TOP))
    for k in range(1, steps + 1):
        quaternion = result.quaternion.copy()
        quaternion[-1] = held if k == steps else multiply(exp(scale(k / steps, turn)), start)
        result = relax(line, water, (result.position, quaternion), limit)
        if not result.converged:
            break
    return result


def _with_current(line: Line, water: Water, start: Equilibrium, limit: int) -> Equilibrium:
    """Equilibrium in the current: at once, or else by raising it in ever smaller steps."""
    reached, step, result = 0.0, 1.0, start
    while reached < 1.0:
        wanted = min(1.0, reached + step)
        slower = water._replace(velocities=wanted * water.velocities)
        trial = relax(line, slower, (result.position, result.quaternion), limit)
        if trial.converged:
            reached, result = wanted, trial
        elif step < 1.0 / 64.0:
            return trial
        else:
            step *= 0.5
    return result
