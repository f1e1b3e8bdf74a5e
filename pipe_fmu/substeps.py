"""Division of a step that does not converge, for a host that cannot roll back and try a shorter one.

A step, or part of one, that fails is divided in three, down to parts of a `most`-th of the step. All parts hold the same mean velocity and
angular velocity of the top, so that its pose after them is that of the one step, and the mean of their forces and moments, weighted with
their lengths, does the sum of their works: h (F.v + M.w), exactly. Each part keeps the energy identity, hence the step does.

Three, because v_new = 2 v - v_old, done twice under one held velocity, leaves the top's mass with the velocity it had, and its inertia out
of the mean force; an odd number of parts, whatever their lengths, gives it the velocity and the impulse of the one step. What is lost:
the one step takes the held velocity for the mean of a smooth motion, the parts take it as it is, with a jump at either end of the step, to
which the line below the top answers with waves of its own.
"""

import numpy as np

from .compiled import inlined
from .line import water_at
from .step.integrator import search
from .step.state import timed

DIVISOR = 3
_MOST_WAITING = 64  # parts that wait to be done: two for each time that the step is divided, and one


@inlined
def divide(line, sea, state, velocity, spin, h, mobility, most, longest):
    """A step of h [s], whole if it converges, else in as few parts as do, none shorter than h / `most`, a power of three.

    No part longer than `longest` [s] is tried, unless it is the last resort. Returns the fields of a StepResult, then the number of parts
    and the shortest [s]. A divided step has the mean top force, the impedance of the last part, all corrections and the largest residual.
    Where a part of h / `most` does not converge, the result is that part's, and its state the old one.
    """
    waiting, left = np.empty(_MOST_WAITING), 1
    waiting[0] = h
    now, total, spent, parts, shortest, worst = state, np.zeros(6), 0, 0, h, 0.0
    done, top, impedance, residual, flaw = False, np.zeros(6), np.zeros((6, 6)), 0.0, 0
    while left > 0:
        left -= 1
        length = waiting[left]
        divisible = length * most > 1.5 * h
        done = False
        if length <= longest or not divisible:
            water = water_at(sea, now.time + 0.5 * length)
            done, new, top, impedance, iterations, residual, flaw = search(line, water, now, velocity, spin, length, mobility)
            spent += iterations
            if done:
                now, parts, shortest, worst = new, parts + 1, min(shortest, length), max(worst, residual)
                for i in range(6):
                    total[i] += length * top[i]
        if not done:
            if not divisible:
                return False, state, top, impedance, spent, residual, flaw, parts, length
            for _ in range(DIVISOR):
                waiting[left] = length / DIVISOR
                left += 1
    if parts > 1:
        now, top = timed(now, state.time + h), total / h
    return True, now, top, impedance, spent, worst, 0, parts, shortest
