"""One discretely passive step of eq. (48): six unknowns, the mean body velocity nu = (nu_old + nu_new) / 2.

    M (nu_new - nu_old) / h + C(nu) nu + D nu_r + d(nu_r) = g_mean + thrust + (A^T f_o, A^T m_o),
    R_new = R_old exp(h w)

with the pose change dp = h R_mean v, R_mean = R_old A(h w) the mean of R over the step, and spatial loads, held over
the step, in the body axes of its start (f_o = R_old^T f); loads given in b act as they are. Since nu . M (nu_new -
nu_old) is the change of kinetic energy, C does no work and the restoring is a discrete gradient, for any h

    kinetic + restoring (new - old) = h (f . v_h + m . w_h) + control + environment + current work
                                      - damping - drag dissipation.

At the hang-off point r_t the mean velocity is v_h = R_mean (v + w x r_t) = (dp + (R_new - R_old) r_t) / h, and w_h =
theta / h = R_old w. Moments are turned by R_mean^T like forces: R_old^T m does the same work, as A theta = theta, but
is first order in h.
"""

import math

import numpy as np

from .attitude import (
    Array,
    add_cross,
    apply,
    dot,
    exp_quaternion,
    mean_rotation,
    multiply,
    product,
    rotation_matrix,
)
from .compiled import inlined, kernel
from .hydrodynamics import Hull, add_drag, add_restoring
from .rigid_body import add_coriolis

MAX_ITERATIONS = 60
ROUND_OFF = 1e-12  # unbalance over the terms that make it up; Newton goes on below it as long as it halves
FLOOR = 2e-16  # nothing is left to gain
SLOW = 0.1  # reduction of the unbalance per iteration that calls for a fresh tangent
SHORTEST_CUT = 1e-4  # of a Newton step that did not reduce the unbalance
PARTS = 8  # lengths of step tried in turn where Newton fails from the old velocity
DIFFERENCE = 1e-5  # m/s, rad/s; central differences then err by 1e-10 of the tangent or less
PULL, FORCE, MOMENT, CURRENT, DOWN = range(5)  # rows of what is constant in e over a step


@kernel
def eliminate(a: Array) -> None:
    """Replace the right-hand sides a[:, n:] by a[:, :n]^-1 a[:, n:], a (n, n + m): elimination with row pivoting; a[:, :n] is lost."""
    n, columns = a.shape
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        for j in range(k, columns):
            a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            for j in range(k, columns):
                a[i, j] -= factor * a[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(n, columns):
            for i in range(k + 1, n):
                a[k, j] -= a[k, i] * a[i, j]
            a[k, j] /= a[k, k]


@kernel
def unbalance(hull: Hull, heave: float, nu_old: Array, held: Array, thrust: Array, h: float, nu: Array, residual: Array) -> float:
    """Fill `residual` (6,), left minus right side of eq. (48) at the mean velocity nu, and return its size relative to its terms.

    held (5, 3), in the body axes at the start: force at the hang-off point, all spatial force, all moment, current
    velocity, e3; thrust (6,): what acts in b.
    """
    turned = product(held, mean_rotation(nu[3:], h))  # rows A^T c
    terms, relative = np.zeros((5, 6)), nu.copy()
    for i in range(3):
        relative[i] -= turned[CURRENT, i]
        terms[0, i] = -thrust[i] - turned[FORCE, i]
        terms[0, 3 + i] = -thrust[3 + i] - turned[MOMENT, i]
    add_cross(terms[0, 3:], -1.0, hull.hang_off, turned[PULL])
    for i in range(6):
        for j in range(6):
            terms[1, i] += 2.0 / h * hull.mass[i, j] * (nu[j] - nu_old[j])
            terms[2, i] += hull.damping[i, j] * relative[j]
    add_drag(hull.surge_drag, hull.strips, relative, terms[2])
    add_coriolis(hull.mass, nu, terms[3])
    add_restoring(hull.stiffness, hull.flotation, heave, held[DOWN], turned[DOWN], nu, h, terms[4])
    unbalanced, size = 0.0, 0.0
    for i in range(6):
        scale = 1.0 / math.sqrt(hull.mass[i, i])  # forces and moments alike in the norm of the kinetic energy
        residual[i] = 0.0
        for k in range(5):
            residual[i] += terms[k, i]
            size += scale * abs(terms[k, i])
        unbalanced += scale * abs(residual[i])
        size += 2.0 / (scale * h) * (abs(nu[i]) + abs(nu_old[i]))
    return unbalanced / size if size != 0.0 else 0.0  # NaN stays NaN


@kernel
def tangent(hull: Hull, heave: float, nu_old: Array, held: Array, thrust: Array, h: float, nu: Array, system: Array) -> None:
    """Fill the first six columns of `system` (6, 6 + m) with the derivative of the unbalance with respect to nu, by central differences."""
    trial, ahead, behind = nu.copy(), np.empty(6), np.empty(6)
    for j in range(6):
        trial[j] = nu[j] + DIFFERENCE
        unbalance(hull, heave, nu_old, held, thrust, h, trial, ahead)
        trial[j] = nu[j] - DIFFERENCE
        unbalance(hull, heave, nu_old, held, thrust, h, trial, behind)
        trial[j] = nu[j]
        for i in range(6):
            system[i, j] = (ahead[i] - behind[i]) / (2.0 * DIFFERENCE)


@kernel
def newton(hull: Hull, heave: float, nu_old: Array, held: Array, thrust: Array, h: float, guess: Array) -> tuple[Array, int, float]:
    """Mean velocity (6,), iterations and remaining relative unbalance: Newton from `guess` (6,) down to round-off.

    The inverse tangent is kept as long as the unbalance falls fast; a step along a fresh one that does not reduce it is
    halved.
    """
    nu, residual, trial, trial_residual = guess.copy(), np.empty(6), np.empty(6), np.empty(6)
    system, cut, slow, fresh, iterations = np.empty((6, 12)), 1.0, True, False, 0
    least = unbalance(hull, heave, nu_old, held, thrust, h, nu, residual)
    while least > FLOOR and iterations < MAX_ITERATIONS and cut > SHORTEST_CUT:
        if slow:
            tangent(hull, heave, nu_old, held, thrust, h, nu, system)
            for i in range(6):
                for j in range(6):
                    system[i, 6 + j] = 1.0 if i == j else 0.0
            eliminate(system)
            fresh = True
        for i in range(6):
            trial[i] = nu[i] - cut * dot(system[i, 6:], residual)
        error = unbalance(hull, heave, nu_old, held, thrust, h, trial, trial_residual)
        iterations += 1
        if error < (0.5 * least if least < ROUND_OFF else least):
            slow, fresh, cut, least = error > SLOW * least, False, 1.0, error
            nu, trial, residual, trial_residual = trial, nu, trial_residual, residual
        elif least < ROUND_OFF:
            break
        elif fresh:
            cut, slow = 0.5 * cut, False
        else:
            slow = True
    return nu, iterations, least


@kernel
def mobility(hull: Hull, rotation: Array, mean: Array, nu: Array, h: float, system: Array) -> Array:
    """dV/dF (6, 6) of V = (v_h, w_h) by F = (f, m) at the hang-off point, the balance kept; symmetric only for small turns.

    system (6, 12) holds the tangent of the balance in its first six columns and is overwritten; `mean` = R_mean (3, 3),
    nu the mean velocity.
    """
    velocity, rates = np.zeros((6, 6)), nu[3:].copy()
    for i in range(3):
        for j in range(3):
            velocity[i, j] = mean[i, j]
            velocity[3 + i, 3 + j] = rotation[i, j]
            system[i, 6 + j] = system[3 + i, 9 + j] = mean[j, i]
            system[3 + i, 6 + j] = system[i, 9 + j] = 0.0
    for j in range(3):
        for sign in (-1.0, 1.0):  # d v_h / d w: through the lever arm and through R_mean
            rates[j] = nu[3 + j] + sign * DIFFERENCE
            path = nu[:3].copy()
            add_cross(path, 1.0, rates, hull.hang_off)
            path = apply(rotation, apply(mean_rotation(rates, h), path))
            for i in range(3):
                velocity[i, 3 + j] += sign * path[i] / (2.0 * DIFFERENCE)
        rates[j] = nu[3 + j]
        column = np.zeros(3)
        add_cross(column, 1.0, hull.hang_off, mean[j])
        for i in range(3):
            system[3 + i, 6 + j] = column[i]
    eliminate(system)
    return product(velocity, system[:, 6:].copy())


@kernel
def works(hull: Hull, loads: Array, nu: Array, v: Array, top: Array, w: Array, relative: Array, h: float) -> Array:
    """Works (6,), J, of a step h: bond, control, environment, current; dissipations of damping and drag, eqs. (85)-(87).

    Velocities are means.
    nu (6,) and `relative` = nu - nu_c in b; v, w of the centre of gravity and `top` of the hang-off point, (3,) in e.
    """
    drag, out = np.zeros(6), np.empty(6)
    add_drag(hull.surge_drag, hull.strips, relative, drag)
    damping = apply(hull.damping, relative)
    out[0] = h * (dot(loads[0], top) + dot(loads[1], w))
    out[1] = h * (loads[2, 0] * v[0] + loads[2, 1] * v[1] + loads[2, 2] * w[2])
    out[1] += h * (loads[3, 0] * nu[0] + loads[3, 1] * nu[1] + loads[3, 2] * nu[5])
    out[2] = h * (dot(loads[4], v) + dot(loads[5], w) + dot(loads[7], nu[:3]) + dot(loads[8], nu[3:]))
    out[4] = h * dot(relative, damping)
    out[5] = h * dot(relative, drag)
    out[3] = 0.0
    for i in range(6):
        out[3] -= h * (nu[i] - relative[i]) * (damping[i] + drag[i])
    return out


@inlined
def advance(
    hull: Hull, position: Array, quaternion: Array, nu_old: Array, loads: Array, h: float
) -> tuple[Array, Array, Array, Array, Array, Array, int, float]:
    """One step of length h, s, from the pose and the body velocity nu_old.

    position (3,), m in e, its third entry counted from the heave equilibrium; loads (9, 3): force and moment at the
    hang-off point, thruster force (x, y in e; yaw moment), external control force (surge, sway in b; yaw moment),
    environment force and moment in e, current velocity, environment force and moment in b. Returns position,
    quaternion, body velocity, (v_h, w_h) (6,), mobility (6, 6), the `works` (6,), iterations and the remaining relative
    unbalance (inf or NaN: no solution).
    """
    rotation = rotation_matrix(quaternion)
    spatial, thrust, system = np.zeros((5, 3)), np.zeros(6), np.empty((6, 12))
    for i in range(3):
        spatial[PULL, i] = loads[0, i]
        spatial[FORCE, i] = loads[0, i] + loads[4, i] + (loads[2, i] if i < 2 else 0.0)
        spatial[MOMENT, i] = loads[1, i] + loads[5, i] + (0.0 if i < 2 else loads[2, i])
        spatial[CURRENT, i] = loads[6, i]
        thrust[i], thrust[3 + i] = loads[7, i], loads[8, i]
    for i in range(3):
        thrust[i if i < 2 else 5] += loads[3, i]
    spatial[DOWN, 2] = 1.0
    held = product(spatial, rotation)  # rows R_old^T c
    nu, iterations, error = nu_old, 0, 1.0
    for part in range(PARTS + 1):  # at once, or for large turns in a long step: follow the solution from shorter steps
        length, guess = h * part / PARTS if part > 0 else h, nu if part > 1 else nu_old
        nu, more, error = newton(hull, position[2], nu_old, held, thrust, length, guess)
        iterations += more
        if part == 0 and error < ROUND_OFF:
            break

    mean = product(rotation, mean_rotation(nu[3:], h))
    path, relative = nu[:3].copy(), nu.copy()
    add_cross(path, 1.0, nu[3:], hull.hang_off)
    v, w, top = apply(mean, nu[:3]), apply(rotation, nu[3:]), apply(mean, path)
    new_position, mean_velocity, new_nu = np.empty(3), np.empty(6), np.empty(6)
    for i in range(3):
        for j in range(3):
            relative[i] -= mean[j, i] * loads[6, j]
        new_position[i] = position[i] + h * v[i]
        mean_velocity[i], mean_velocity[3 + i] = top[i], w[i]
    for i in range(6):
        new_nu[i] = 2.0 * nu[i] - nu_old[i]
    done = works(hull, loads, nu, v, top, w, relative, h)
    tangent(hull, position[2], nu_old, held, thrust, h, nu, system)
    response = mobility(hull, rotation, mean, nu, h, system)
    return new_position, multiply(quaternion, exp_quaternion(nu[3:], h)), new_nu, mean_velocity, response, done, iterations, error
