"""From one equilibrium to that of a changed line, in kernels alone: the equilibrium is followed on the way from the one to the other.

On the way stiffness and loads of the line, the water and the position of the top are mixed linearly and its attitude is turned evenly; a
top that is let go is turned by the moment that held it until that is gone. Each equilibrium is found by Newton's method from the one before.
Where that ends in none, or in one that is not stable, or with an element turned inside out, a shorter part of the way is gone.
"""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..compiled import kernel
from ..element.ends import condense_top, hold_foot_tangent
from ..element.strains import inverted
from ..line import Line, Water
from ..loads import Bed, Loads
from ..maths.block_tridiagonal import factorize
from ..maths.so3 import conjugate, dot, exp, log, multiply, scale
from .balance import correction, hold, limited, measures, turn, unbalance
from .relaxation import CORRECTIONS, LOST, TURN, settled
from .stability import definite
from .system import static_system

SHORTEST = 1.0 / 512.0  # part of the way
_TURN_OF_TOP = 0.35  # rad in one part of the way
_LONGER = 1.5  # times the part that was gone is the next


class Found(NamedTuple):
    """Where Newton's method has ended; arrays of no meaning where that is no equilibrium."""

    converged: bool
    stable: bool
    top: Array  # (6,) force and moment on the pipe at its top, e
    stiffness: Array  # (6, 6) d top / d (displacement, spin) of the top
    residual: float  # largest force not in balance, over the weight or the force at an end, whichever is largest


@kernel
def newton(line, water, couple, position, quaternion, corrections):
    """Bring a pose, in place, into the equilibrium that Newton's method finds in at most so many `corrections`; a Found.

    couple (3,): moment on a top that is not clamped. Stable is what is positive definite.
    """
    n = position.shape[0]
    diagonal, lower, upper = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6))
    residual, pull, move, stiffness, turned = np.empty((n, 6)), np.empty((n, 6)), np.empty((n, 6)), np.zeros((6, 6)), np.empty((n, 4))
    force, longest, neutral, rounding, metric = measures(line)
    best, size, stable, converged = math.inf, math.inf, False, False
    top = np.zeros(6)
    for _ in range(corrections):
        static_system(line, water, position, quaternion, diagonal, lower, upper, residual, pull)
        for k in range(3):
            residual[n - 1, 3 + k] -= couple[k]
        top, foot = residual[n - 1].copy(), residual[0].copy()
        hold(line, quaternion, residual)
        size, _, largest = unbalance(residual, top, foot, force, longest)
        if not size < LOST:
            break
        converged = settled(size, rounding / largest, best)
        if converged:
            stable = definite(line, quaternion, (diagonal, lower, upper), metric, neutral)
        best = min(best, size)
        hold_foot_tangent(line, quaternion, diagonal, upper)
        regular = factorize(diagonal, lower, upper)
        if converged:
            condense_top(line, diagonal[n - 1], stiffness)
            break
        if not regular:
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
def stands(line, water, position, quaternion):
    """Whether the tangent in an equilibrium is positive definite."""
    n = position.shape[0]
    blocks = np.empty((n, 6, 6)), np.empty((n - 1, 6, 6)), np.empty((n - 1, 6, 6))
    static_system(line, water, position, quaternion, *blocks, np.empty((n, 6)), np.empty((n, 6)))
    _, _, neutral, _, metric = measures(line)
    return definite(line, quaternion, blocks, metric, neutral)


@kernel
def follow(start, end, s, top, moment, position, quaternion, strict):
    """Lead a pose, in place, from its equilibrium to that of another line; the last Found, and whether that is at the end of the way.

    start, end: line (of `at_rest`) and water before and after; s (n,): arc lengths; top (7,): position and attitude to which the top is
    brought; moment (3,): on the top before; strict: whether all equilibria have to be stable.
    """
    n = position.shape[0]
    position_from, quaternion_from, held = position[n - 1].copy(), _four(quaternion[n - 1]), _four(top[3:])
    free, rotation = not end[0].top_clamped, (0.0, 0.0, 0.0)
    if not free:
        rotation = log(multiply(held, conjugate(quaternion_from)))
    longest = min(1.0, _TURN_OF_TOP / max(math.sqrt(dot(rotation, rotation)), _TURN_OF_TOP))
    reached, step, couple = 0.0, longest, np.zeros(3)
    trial_position, trial_quaternion = position.copy(), quaternion.copy()
    found = Found(False, False, np.zeros(6), np.zeros((6, 6)), math.inf)
    while reached < 1.0 and step >= SHORTEST:
        wanted = min(1.0, reached + step)
        line, water = mixed(start[0], end[0], wanted, not free), mixed_water(start[1], end[1], wanted)
        _keep(quaternion, trial_quaternion)
        for k in range(3):
            couple[k] = (1.0 - wanted) * moment[k] if free else 0.0
            to = top[k] - position_from[k]
            for i in range(n):
                trial_position[i, k] = position[i, k] + (wanted - reached) * s[i] / s[n - 1] * to
            trial_position[n - 1, k] = top[k] if wanted == 1.0 else position_from[k] + wanted * to
        if not free:
            turned = held if wanted == 1.0 else multiply(exp(scale(wanted, rotation)), quaternion_from)
            for a in range(4):
                trial_quaternion[n - 1, a] = turned[a]
        found = newton(line, water, couple, trial_position, trial_quaternion, CORRECTIONS)
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


@kernel
def mix(a, b, share):
    """The vector that lies at `share` of the way from a to b (m,)."""
    out = np.empty(b.shape[0])
    for i in range(b.shape[0]):
        out[i] = (1.0 - share) * a[i] + share * b[i]
    return out


@kernel
def _mix(a, b, share):
    """The table that lies at `share` of the way from a to b (m, k); of one that is empty, as from zero."""
    out = np.empty(b.shape)
    for i in range(b.shape[0]):
        for k in range(b.shape[1]):
            out[i, k] = (1.0 - share) * a[i, k] + share * b[i, k]
    return out


@kernel
def at_rest(line, top):
    """The line with its top as it is at the start: not clamped where the attitude in `top` (7,) is all zero, as it hangs."""
    return mixed(line, line, 1.0, line.top_clamped and (top[3] != 0.0 or top[4] != 0.0 or top[5] != 0.0 or top[6] != 0.0))


@kernel
def flows(water):
    """Whether there is a current that drags."""
    return water.drag and water.levels.shape[0] > 0


@kernel
def alike(a, b, top_a, top_b):
    """Whether nothing that bears on the equilibrium differs between two pairs of line (of `at_rest`) and water, and two poses of the top."""
    one, other = a[0], b[0]
    same = one.top_clamped == other.top_clamped and flows(a[1]) == flows(b[1])
    for k in range(7 if one.top_clamped else 3):
        same = same and top_a[k] == top_b[k]
    same = same and _same(one.loads.weight, other.loads.weight)
    same = same and _same(one.loads.bed.bearing, other.loads.bed.bearing) and _same(one.loads.bed.diameter, other.loads.bed.diameter)
    same = same and _same(one.stiffness.reshape(one.stiffness.size), other.stiffness.reshape(other.stiffness.size))
    if same and flows(a[1]):
        same = _same(one.loads.drag.reshape(one.loads.drag.size), other.loads.drag.reshape(other.loads.drag.size))
        same = same and _same(a[1].levels, b[1].levels)
        same = same and _same(a[1].velocities.reshape(a[1].velocities.size), b[1].velocities.reshape(b[1].velocities.size))
    return same


@kernel
def _same(a, b):
    """Whether two vectors (m,) are equal."""
    for i in range(a.shape[0]):
        if a[i] != b[i]:
            return False
    return True


@kernel
def mixed(a, b, share, top_clamped):
    """The line at rest that lies at `share` of the way from line a to line b."""
    stiffness, part = _mix(a.stiffness, b.stiffness, share), _mix(a.share, b.share, share)
    drag, bed = _mix(a.loads.drag, b.loads.drag, share), b.loads.bed
    bearing, diameter = mix(a.loads.bed.bearing, bed.bearing, share), mix(a.loads.bed.diameter, bed.diameter, share)
    bed = Bed(bearing, diameter, bed.damping, bed.friction, bed.friction_speed)
    loads = Loads(mix(a.loads.weight, b.loads.weight, share), drag, bed)
    return Line(
        b.length, stiffness, part, loads, b.mass, b.offset, b.inertia, b.spin_damping, b.added_mass, b.damping, b.foot_clamped, top_clamped,
        b.numerical_damping,
    )  # fmt: skip


@kernel
def mixed_water(a, b, share):
    """The water that lies at `share` of the way from water a to water b, still where one of them is."""
    drag = a.drag or b.drag
    if b.levels.shape[0] == 0:
        return Water(a.levels, (1.0 - share) * a.velocities, drag)
    if a.levels.shape[0] == 0:
        return Water(b.levels, share * b.velocities, drag)
    return Water(mix(a.levels, b.levels, share), _mix(a.velocities, b.velocities, share), drag)
