"""From one equilibrium to that of changed constants, in kernels alone: the equilibrium is followed on the way from the one to the other.

On the way stiffness and loads of the line, the water and the position of the top are mixed linearly and its attitude is turned evenly;
a top that is let go is turned by the moment that held it until that is gone. Each equilibrium is found by Newton's method from the one
before. Where that ends in none, or in one that is not stable, or with an element turned inside out, a shorter part of the way is gone.
"""

import math
from typing import NamedTuple

import numpy as np

from .arrays import Array
from .compiled import kernel
from .element.ends import condense_top, hold_foot_tangent
from .element.strains import inverted
from .line import Water, water_at
from .maths.block_tridiagonal import factorize
from .maths.so3 import conjugate, dot, exp, log, multiply, scale
from .statics.balance import correction, hold, limited, measures, turn, unbalance
from .statics.relaxation import CORRECTIONS, LOST, TURN, settled
from .statics.stability import definite
from .statics.system import static_system
from .vectors import TOP_CLAMPED, unpacked

SHORTEST = 1.0 / 512.0  # part of the way
_TURN_OF_TOP = 0.35  # rad in one part of the way
_LONGER = 1.5  # times the part that was gone is the next


class Found(NamedTuple):
    """Where Newton's method has ended; the forces are of no meaning where that is no equilibrium."""

    converged: bool
    stable: bool  # whether the tangent is positive definite
    top: Array  # (6,) force and moment on the pipe at its top, e
    stiffness: Array  # (6, 6) d top / d (displacement, spin) of the top
    residual: float  # largest force not in balance, over the weight or the force at an end, whichever is largest


@kernel
def freeze(c, time):
    """Make constants those of the line at rest at `time` [s]: the current is that of the time for good, the top clamped only where its
    attitude is given.
    """
    unit = unpacked(c)
    water = water_at(unit.sea, time)
    for k in range(unit.sea.levels.shape[0]):
        for i in range(3):
            unit.sea.velocities[k, i] = water.velocities[k, i] if water.levels.shape[0] > 0 else 0.0
    given = False
    for i in range(3, 7):
        given = given or unit.top[i] != 0.0
    if not given:
        c[TOP_CLAMPED] = 0.0


@kernel
def flows(c):
    """Whether there is a current that drags, in frozen constants."""
    sea = unpacked(c).sea
    moving = False
    for k in range(sea.levels.shape[0]):
        for i in range(3):
            moving = moving or sea.velocities[k, i] != 0.0
    return moving and sea.drag


@kernel
def alike(a, b):
    """Whether nothing that bears on the equilibrium differs between two frozen constants."""
    one, other, flowing = unpacked(a), unpacked(b), flows(a)
    if flowing != flows(b) or one.line.top_clamped != other.line.top_clamped:
        return False
    held = 7 if one.line.top_clamped else 3
    same = _same(one.top[:held], other.top[:held])
    same = same and _same_rows(one.line.stiffness, other.line.stiffness) and _same(one.line.loads.weight, other.line.loads.weight)
    same = same and _same(one.line.loads.bed.bearing, other.line.loads.bed.bearing)
    same = same and _same(one.line.loads.bed.diameter, other.line.loads.bed.diameter)
    if flowing:
        same = same and _same(one.sea.levels, other.sea.levels)
        same = same and _same_rows(one.line.loads.drag, other.line.loads.drag) and _same_rows(one.sea.velocities, other.sea.velocities)
    return same


@kernel
def _same(a, b):
    same = True
    for i in range(a.shape[0]):
        same = same and a[i] == b[i]
    return same


@kernel
def _same_rows(a, b):
    same = True
    for i in range(a.shape[0]):
        same = same and _same(a[i], b[i])
    return same


@kernel
def mix(a, b, share, out):
    """Fill in the frozen constants that lie at `share` of the way from a to b; the top is clamped as in b."""
    for i in range(b.shape[0]):
        out[i] = b[i] if a[i] == b[i] else (1.0 - share) * a[i] + share * b[i]
    out[TOP_CLAMPED] = b[TOP_CLAMPED]


@kernel
def newton(c, couple, position, quaternion, corrections):
    """Bring a pose, in place, into the equilibrium of frozen constants that Newton's method finds in less than so many `corrections`.

    couple (3,): moment on a top that is not clamped. Returns a Found.
    """
    unit = unpacked(c)
    line, water = unit.line, Water(unit.sea.levels, unit.sea.velocities, unit.sea.drag)
    n = position.shape[0]
    diagonal, lower, upper = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6))
    residual, pull, move, stiffness, turned = np.empty((n, 6)), np.empty((n, 6)), np.empty((n, 6)), np.zeros((6, 6)), np.empty((n, 4))
    force, longest, neutral, rounding, metric = measures(line)
    best, size, stable, converged, top = math.inf, math.inf, False, False, np.zeros(6)
    for left in range(int(corrections) - 1, -1, -1):
        static_system(line, water, position, quaternion, diagonal, lower, upper, residual, pull)
        for k in range(3):
            residual[n - 1, 3 + k] -= couple[k]
        top, foot = residual[n - 1].copy(), residual[0].copy()
        hold(line, quaternion, residual)
        size, _, largest = unbalance(residual, top, foot, force, longest)
        if not size < LOST:
            break
        converged = settled(size, rounding / largest, best)
        if converged or left == 0:
            stable = definite(line, quaternion, (diagonal, lower, upper), metric, neutral)
        best = min(best, size)
        hold_foot_tangent(line, quaternion, diagonal, upper)
        if not factorize(diagonal, lower, upper) or converged or left == 0:
            condense_top(line, diagonal[n - 1], stiffness)
            break
        correction(line, (diagonal, lower, upper), residual, move)
        move = limited(move, TURN)
        turn(quaternion, move, turned)
        _keep(turned, quaternion)
        for i in range(n):
            for k in range(3):
                position[i, k] += move[i, k]
    return Found(converged and not inverted(position, quaternion), stable, top, stiffness, size)


@kernel
def follow(start, end, moment, position, quaternion, strict):
    """Lead a pose, in place, from its equilibrium with the frozen constants `start` to that with `end`; the last Found, and whether the end
    is reached.

    moment (3,): on the top before; strict: whether all equilibria have to be stable.
    """
    n, unit = position.shape[0], unpacked(end)
    top, s, clamped = unit.top, unit.s, unit.line.top_clamped
    position_from, quaternion_from, held = position[n - 1].copy(), _four(quaternion[n - 1]), _four(top[3:])
    rotation = log(multiply(held, conjugate(quaternion_from))) if clamped else (0.0, 0.0, 0.0)
    longest = min(1.0, _TURN_OF_TOP / max(math.sqrt(dot(rotation, rotation)), _TURN_OF_TOP))
    reached, step, couple, between = 0.0, longest, np.zeros(3), np.empty(end.shape[0])
    trial_position, trial_quaternion = position.copy(), quaternion.copy()
    found = Found(False, False, np.zeros(6), np.zeros((6, 6)), math.inf)
    while reached < 1.0 and step >= SHORTEST:
        wanted = min(1.0, reached + step)
        mix(start, end, wanted, between)
        _keep(quaternion, trial_quaternion)
        for k in range(3):
            couple[k] = 0.0 if clamped else (1.0 - wanted) * moment[k]
            to = top[k] - position_from[k]
            for i in range(n):
                trial_position[i, k] = position[i, k] + (wanted - reached) * s[i] / s[n - 1] * to
            trial_position[n - 1, k] = top[k] if wanted == 1.0 else position_from[k] + wanted * to
        if clamped:
            turned = held if wanted == 1.0 else multiply(exp(scale(wanted, rotation)), quaternion_from)
            for a in range(4):
                trial_quaternion[n - 1, a] = turned[a]
        found = newton(between, couple, trial_position, trial_quaternion, float(CORRECTIONS))
        if found.converged and (found.stable or not strict):
            reached, step = wanted, min(_LONGER * step, longest)
            _keep(trial_position, position)
            _keep(trial_quaternion, quaternion)
        else:
            step *= 0.5
    return found, reached == 1.0


@kernel
def _four(row):
    return (row[0], row[1], row[2], row[3])


@kernel
def _keep(table, out):
    for i in range(table.shape[0]):
        for k in range(table.shape[1]):
            out[i, k] = table[i, k]
