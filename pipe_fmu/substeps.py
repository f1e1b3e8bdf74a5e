"""Division of a step that does not converge, for a host that cannot roll back and try a shorter one.

A step, or part of one, that fails is divided in three, down to parts of a `most`-th of the step. All parts hold the same mean velocity and
angular velocity of the top, so that its pose after them is that of the one step, and the mean of their forces and moments, weighted with
their lengths, does the sum of their works: h (F.v + M.w), exactly. Each part keeps the energy identity, hence the step does.

Three, because v_new = 2 v - v_old, done twice under one held velocity, leaves the top's mass with the velocity it had, and its inertia out
of the mean force; an odd number of parts, whatever their lengths, gives it the velocity and the impulse of the one step. What is lost:
the one step takes the held velocity for the mean of a smooth motion, the parts take it as it is, with a jump at either end of the step, to
which the line below the top answers with waves of its own.
"""

from collections.abc import Callable

import numpy as np

from .arrays import Array
from .step.integrator import PipeState, StepResult

DIVISOR = 3

Step = Callable[[PipeState, Array, Array, float], StepResult]


def divide(step: Step, state: PipeState, velocity: Array, spin: Array, h: float, most: int) -> tuple[StepResult, tuple[float, ...]]:
    """A step of h [s], whole if it converges, else in as few parts as do, none shorter than h / `most`, a power of three; the parts [s].

    The result of a divided step has the mean top force, the impedance of the last part, all corrections and the largest residual. Where a
    part of h / `most` does not converge, the result is that part's, and its state the old one.
    """
    result = step(state, velocity, spin, h)
    if result.converged or most == 1:
        return result, (h,)
    spent, now = result.iterations, state
    todo, lengths, results = [h / DIVISOR] * DIVISOR, [], []
    while todo:
        length = todo.pop()
        result = step(now, velocity, spin, length)
        spent += result.iterations
        if result.converged:
            now = result.state
            lengths.append(length)
            results.append(result)
        elif length * most > 1.5 * h:
            todo += [length / DIVISOR] * DIVISOR
        else:
            return result._replace(state=state, iterations=spent), (*lengths, length)
    whole = result._replace(
        state=now._replace(time=state.time + h),
        top=np.average([one.top for one in results], axis=0, weights=lengths),
        iterations=spent,
        residual=max(one.residual for one in results),
    )
    return whole, tuple(lengths)
