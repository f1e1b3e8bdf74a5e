"""Newton's method for the equations of one step, which step/system.py makes, with the ends held as element/ends.py says."""

import math

import numpy as np

from ..compiled import inlined, inner, kernel
from ..element.ends import condense_top, hold_foot, hold_foot_tangent, top_correction, yielding
from ..element.strains import growth
from ..line import line_columns
from ..maths.block_tridiagonal import SIZE, condense, factorize, substitute
from ..maths.so3 import add
from ..simd.columns import chord, take, vector_of
from .nodes import advance
from .residual import elastic_round_off, inertial_scales, largest_residual, work_left
from .state import WORKS, PipeState
from .system import assemble, old_columns

TOLERANCE = 1e-11  # of the largest element force (moment), inertia included as below: well below any coupling tolerance
ROUND_OFF = 1e-9  # accepted once the residual no longer falls
PATIENCE = 8  # corrections of a settled residual that do not lower it, after which its work is taken for round-off
INERTIAL = 1e-3  # of the terms of inertia, which the residual is measured by too: some forty units of their round-off over TOLERANCE
NEAR = 1e-5  # residual from which on a tangent is kept
MAX_CORRECTIONS = 25
DAMPED_CORRECTIONS = 100
SLOW = 0.03  # reduction of the residual by a kept tangent that is too little
SHARP = 1e-3  # residual below which a damped search takes Newton's tangent of friction
LEAST_SHARE = 0.02  # of a correction: a damped search halves no further
LOST = 1e12  # residual, and element force over the axial stiffness, from which there is no way back


@inlined
def solve_step(line, water, state, velocity, spin, h, mobility, weights, damped):
    """One step from a guess of its mean velocities: the sum of those of the last three steps times `weights`.

    velocity, spin (3,), mobility (6, 6): see integrator.step; damped: see `_search`. Returns (converged, new state, force on the pipe's
    top (6,), its derivative by the mean velocity (6, 6), corrections, residual); when not converged the state is the old one.
    """
    n = state.position.shape[0]
    ours = line_columns(line)
    kept = state.velocity, state.rate, state.added_mass_velocity, state.strain, state.chord
    old, new = old_columns(state.position, state.quaternion, *kept)
    x, top, works = np.empty((n, SIZE)), np.empty(SIZE), np.empty(len(WORKS))
    for k in range(3):
        top[k], top[3 + k] = h * velocity[k], h * spin[k]
    for i in range(n):
        for k in range(SIZE):
            guess = weights[0] * state.last[i, k] + weights[1] * state.before[i, k] + weights[2] * state.earlier[i, k]
            x[i, k] = h * guess
    hold_foot(line, state.quaternion, x[0])
    force, tangent = np.empty(SIZE), np.zeros((SIZE, SIZE))
    system = np.empty((n, SIZE, SIZE)), np.empty((n - 1, SIZE, SIZE)), np.empty((n - 1, SIZE, SIZE)), np.empty((n, SIZE))
    scratch = np.empty((n, SIZE)), np.empty(SIZE), np.empty(SIZE), np.empty((n, SIZE))
    ends = state.quaternion, h * mobility, top, force, tangent
    converged, iterations, size = _search(line, ours, water, h, old, new, x, damped, works, ends, system, scratch)
    for i in range(3 if not line.top_clamped else 0):
        force[3 + i] = 0.0
    found = _advanced(ours, h, state, old, new, x, force, works) if converged else state
    return converged, found, force, h * tangent, iterations, size


@kernel
def _advanced(line, h, state, old, new, x, force, works):
    """State after the increments x (n, 6); line and old state, and attitudes and strains on the way, in columns."""
    fields = np.empty_like(old[1]), np.empty_like(old[2]), np.empty_like(old[3]), np.empty_like(old[4])
    advance(line, h, old, new[0], new[1], fields)
    position, last = np.empty_like(state.position), np.empty_like(x)
    quaternion, velocity, rate = np.empty_like(state.quaternion), np.empty_like(state.velocity), np.empty_like(state.rate)
    added_mass_velocity, strain, chords = np.empty_like(state.added_mass_velocity), np.empty_like(state.strain), np.empty_like(state.chord)
    for i in range(x.shape[0]):
        for k in range(3):
            position[i, k] = state.position[i, k] + x[i, k]
        for k in range(SIZE):
            last[i, k] = x[i, k] / h
    for e in range(x.shape[0] - 1):
        d, dd = vector_of(state.chord.T, 0, e), chord(x.T, e, e + 1)
        chords[e, 0], chords[e, 1], chords[e, 2] = add(d, dd)
        chords[e, 3] = state.chord[e, 3] + growth(d, dd)
    take(fields[0], quaternion)
    take(fields[1], velocity)
    take(fields[2], rate)
    take(fields[3], added_mass_velocity)
    take(new[2], strain)
    top_work = state.top_work
    for k in range(SIZE):
        top_work += force[k] * x[-1, k]
    for k in range(works.shape[0]):
        works[k] += state.works[k]
    moved = position, quaternion, velocity, rate, added_mass_velocity, strain, chords
    return PipeState(state.time + h, *moved, last, state.last, state.before, top_work, works)


@inlined
def _search(line, ours, water, h, old, new, x, damped, works, ends, system, scratch):
    """Increments x (n, 6) of one step, from a guess of them; the line and the old state come in columns (simd/columns.py).

    The top's increment is `top` (6,) less mobility (6, 6) x the force on it; without a mobility it is prescribed, and met exactly; with
    one the force is still exactly that of the increment found, but the relation between the two is met to the last correction only.

    The tangent is made at the guess and kept from a residual of NEAR on; when a correction then reduces the residual by less than SLOW, it
    is made anew for every further one. A `damped` search makes it anew always, starts with a tangent of friction with which nothing
    overshoots, and halves a correction that does not lower the residual. Fills the force on the pipe's top (6,), the tangent (6, 6) as the
    top feels it and the works (len(WORKS),). Returns (converged, corrections, residual).

    ends: quaternions (n, 4), mobility, top, force, tangent; system: as in step.system.assemble; scratch: (n, 6), (6,), (6,), (n, 6).
    """
    quaternion, mobility, top, force, tangent = ends
    correction, wanted, move, best = scratch
    n, limit = x.shape[0], DAMPED_CORRECTIONS if damped else MAX_CORRECTIONS
    diagonal, lower, upper, residual = system
    previous, size = math.inf, math.inf
    share, lowest = 1.0, math.inf
    least, lowest_settled, patience, last = math.inf, math.inf, PATIENCE, False
    inertial_force, inertial_moment = inertial_scales(ours, h, old, x, top)
    round_off = elastic_round_off(line, h)
    with_tangent = reuse_tangent = n > 0  # True, but no literal, for which numba would compile the assembly once more
    prescribed = True
    for i in range(SIZE):
        for j in range(SIZE):
            prescribed = prescribed and mobility[i, j] == 0.0
    for iteration in range(limit + 2):
        newton_friction = not damped or size < SHARP
        force_scale, moment_scale = assemble(ours, water, h, old, new, x, with_tangent, newton_friction, system, works)
        gap = 0.0
        for i in range(SIZE):
            force[i] = residual[n - 1, i]
            wanted[i] = top[i] - x[n - 1, i]
            if prescribed and (line.top_clamped or i < 3):
                gap = max(gap, math.fabs(wanted[i]))
        hold_foot(line, quaternion, residual[0])
        floor = ROUND_OFF * force_scale + round_off
        force_scale, moment_scale = force_scale + INERTIAL * inertial_force, moment_scale + INERTIAL * inertial_moment
        size = largest_residual(residual, force_scale, moment_scale + 0.1 * force_scale, line.top_clamped)
        if last:
            return True, iteration, size
        lost = not (size < LOST and force_scale < LOST * line.stiffness[n - 2, 0])
        stalled = max(size, previous) <= TOLERANCE + floor / force_scale and size > 0.3 * previous and share == 1.0
        guessed = iteration == 0 and not prescribed  # a guess knows nothing of the relation between the top's increment and the force
        settled = not (lost or guessed) and gap == 0.0 and (size <= TOLERANCE or stalled)
        made = work_left(ours, old, x, residual, force, works) if settled else math.inf
        done = made <= 1.0
        if done and iteration > 0:
            return True, iteration, size
        if made < least:
            least = made
            _copy(x, best)
        if settled:
            patience -= 1 if size > 0.9 * lowest_settled else 0
            lowest_settled = min(size, lowest_settled)
        if least < math.inf and (patience == 0 or lost or iteration == limit):
            _copy(best, x)
            with_tangent, last = n == 0, True
            continue
        if damped and not settled and iteration > 1 and share > LEAST_SHARE and not size * force_scale < lowest:
            share *= 0.5
            _move(x, -share, correction)
            continue
        share, lowest = 1.0, size * force_scale
        if lost or iteration == limit:
            break
        if with_tangent:
            hold_foot_tangent(line, quaternion, diagonal, upper)
            if not line.foot_clamped:
                diagonal[0, 3:, :3] = 0.0  # times no displacement; beside them a held row is no pivot, and moves by round-off
            if not factorize(diagonal, lower, upper):
                break
            condense_top(line, diagonal[n - 1], tangent)
        elif size > SLOW * previous or size > NEAR:
            with_tangent, reuse_tangent = True, size <= SLOW * previous
            continue
        if done:
            return True, iteration, size
        with_tangent = damped or not reuse_tangent
        condense(lower, residual)
        if prescribed:
            fine = top_correction(line, diagonal[n - 1], residual[n - 1], wanted, move)
        else:
            fine = yielding(line, diagonal[n - 1], residual[n - 1], tangent, wanted, mobility, move)
        if not fine:
            break
        substitute(diagonal, upper, residual, move, correction)
        _move(x, 1.0, correction)
        hold_foot(line, quaternion, x[0])
        for i in range(SIZE):
            if prescribed and (line.top_clamped or i < 3):
                x[n - 1, i] = top[i]
        previous = size
    return False, limit, size


@inner
def _copy(a, b):
    """b = a (n, 6); a slice assignment would bring the making of messages along."""
    for k in range(a.shape[0]):
        for i in range(SIZE):
            b[k, i] = a[k, i]


@inner
def _move(x, share, correction):
    """x += share * correction."""
    for k in range(x.shape[0]):
        for i in range(SIZE):
            x[k, i] += share * correction[k, i]
