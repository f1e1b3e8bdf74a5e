"""Distributed loads on one element: drag of the water and the reaction of the bed.

Points of an element move with the linked interpolation of the nodes, phi(x) = (1 - x) phi_1 + x phi_2 + x (1 - x) c, c = d x psi / 2 the
sag of its arc, whose rate is taken as c' = (d' x psi + d x (w_2 - w_1 + (w_1 + w_2) x psi / 2)) / 2, exact for a rigid motion (without the
rolling part the drag on the arc would twist the line). Forces reach the nodes by the transpose of the same map, so that the nodal power is
the power at the points, exactly.
"""

import math

from .assembly import add_outer, expand
from .compiled import inner
from .hydrodynamics import current_at, drag
from .seabed import contact, mean_contact
from .so3 import add, apply, cross, dot, scale, subtract

DRAG_POINTS = (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0))
BED_POINTS = (0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970262)
BED_WEIGHTS = (0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692)


@inner
def _sag_rate(d, bow, v1, v2, w1, w2):
    """Rate of c = d x psi / 2; `bow` is psi in e."""
    mean = scale(0.5, add(w1, w2))
    turned = add(add(w2, scale(-1.0, w1)), cross(mean, bow))
    return scale(0.5, add(cross(add(v2, scale(-1.0, v1)), bow), cross(d, turned)))


@inner
def _linked_motion(x, d, bow, moves):
    """Matrix (3, 12) from the nodes' (v_1, w_1, v_2, w_2) to the velocity of the point at x."""
    half = 0.5 * x * (1.0 - x)
    for j in range(3):
        unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        stretched = cross(unit, bow)
        bent = cross(d, unit)
        rolled = cross(d, stretched)
        for i in range(3):
            moves[i, j] = (1.0 - x) * unit[i] - half * stretched[i]
            moves[i, 6 + j] = x * unit[i] + half * stretched[i]
            moves[i, 3 + j] = half * (0.5 * rolled[i] - bent[i])
            moves[i, 9 + j] = half * (0.5 * rolled[i] + bent[i])


@inner
def _add_linked(x, d, bow, force, vector):
    """Add the nodes' share of a force at x, the transpose of `_linked_motion` times the force, to `vector` (12,)."""
    half = 0.5 * x * (1.0 - x)
    stretched = scale(half, cross(bow, force))
    lever = cross(force, d)
    rolled = scale(0.5 * half, cross(bow, lever))
    for i in range(3):
        vector[i] += (1.0 - x) * force[i] - stretched[i]
        vector[6 + i] += x * force[i] + stretched[i]
        vector[3 + i] += rolled[i] - half * lever[i]
        vector[9 + i] += rolled[i] + half * lever[i]


@inner
def add_drag(rm, u, psi, h, coefficients, ends, depths, levels, velocities, rate, fresh, vector, matrix, scratch):
    """Drag on one element into `vector` (12,) (minus the force on the pipe) and, if `fresh`, its tangent into `matrix` (12, 12).

    rm, u, psi: frame, chord in it and relative rotation; `ends` (2, 6) velocities (v, w) of the nodes; `depths` (2,) their z;
    `rate` = d velocity / d unknown [1/s]; scratch: two (3, 12).
    Returns (power dissipated >= 0, power supplied by the current) [W].
    """
    d = apply(rm, u)
    v1 = (ends[0, 0], ends[0, 1], ends[0, 2])
    v2 = (ends[1, 0], ends[1, 1], ends[1, 2])
    bow = apply(rm, psi)
    swing = _sag_rate(d, bow, v1, v2, (ends[0, 3], ends[0, 4], ends[0, 5]), (ends[1, 3], ends[1, 4], ends[1, 5]))
    sag = 0.5 * (d[0] * bow[1] - d[1] * bow[0])
    dissipated, supplied = 0.0 * h, 0.0 * h
    moves, slopes = scratch[0], scratch[1]
    for x in DRAG_POINTS:
        y = 1.0 - x
        linked = x * y
        bend = cross(scale(x - 0.5, psi), (1.0, 0.0, 0.0))
        local = (1.0, bend[1], bend[2])
        tangent = apply(rm, scale(1.0 / math.sqrt(dot(local, local)), local))
        v = add(add(scale(y, v1), scale(x, v2)), scale(linked, swing))
        v_c = (0.0 * h, 0.0 * h, 0.0 * h)
        if levels.shape[0] > 0:
            v_c = current_at(y * depths[0] + x * depths[1] + linked * sag, levels, velocities)
        v_r = subtract(v, v_c)
        force, a, b, c, v_n = drag(v_r, tangent, coefficients[0], coefficients[1])
        force = scale(0.5 * h, force)
        dissipated += dot(force, v_r)
        supplied -= dot(force, v_c)
        _add_linked(x, d, bow, force, vector)
        if not fresh:
            continue
        _linked_motion(x, d, bow, moves)
        for i in range(3):
            for j in range(12):
                value = 0.0
                for k in range(3):
                    slope = b * tangent[i] * tangent[k] + c * v_n[i] * v_n[k] + (a if i == k else 0.0)
                    value += slope * moves[k, j]
                slopes[i, j] = 0.5 * h * rate * value
        v_t = dot(v_r, tangent)
        for j in range(3):  # derivative with respect to the spin of t1
            unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
            d_t = cross(unit, tangent)
            s_t = dot(v_r, d_t)
            d_n = add(scale(-s_t, tangent), scale(-v_t, d_t))
            change = add(scale(a, d_n), scale(c * dot(v_n, d_n), v_n))
            k = 2.0 * coefficients[0] * math.fabs(v_t) * s_t
            change = add(change, add(scale(k, tangent), scale(coefficients[0] * math.fabs(v_t) * v_t, d_t)))
            for i in range(3):
                slopes[i, 3 + j] += 0.125 * h * change[i]
                slopes[i, 9 + j] += 0.125 * h * change[i]
        for i in range(12):
            for j in range(12):
                matrix[i, j] += moves[0, i] * slopes[0, j] + moves[1, i] * slopes[1, j] + moves[2, i] * slopes[2, j]
    return dissipated, supplied


@inner
def bed_on_sag(h, dt, diameter, weight, damping, old, new):
    """Part of the bed's reaction over a step that bears on the sag [N]: for the tangent, as it goes with the sag's second derivative.

    Arguments as in `add_mean_contact`; with `old` = `new` the static reaction.
    """
    total = 0.0
    for k in range(4):
        x = BED_POINTS[k]
        y = 1.0 - x
        z_old = y * old[0] + x * old[1] + x * y * old[2]
        z_new = y * new[0] + x * new[1] + x * y * new[2]
        force, _ = mean_contact(z_old, z_new, diameter, weight)
        total += h * BED_WEIGHTS[k] * x * y * force * max(0.0, 1.0 + damping * (z_new - z_old) / dt)
    return total


@inner
def press(h, diameter, weight, z1, z2, sag, points):
    """Static reaction of the bed on one element: upward force [N] and stiffness [N/m] of its points into `points` (4, 2).

    Returns (potential [J], its derivative with respect to the sag [N]).
    """
    potential, on_sag = 0.0, 0.0
    for k in range(4):
        x = BED_POINTS[k]
        y = 1.0 - x
        u, force, stiffness = contact(y * z1 + x * z2 + x * y * sag, diameter, weight)
        share = h * BED_WEIGHTS[k]
        points[k, 0], points[k, 1] = share * force, share * stiffness
        potential += share * u
        on_sag += x * y * share * force
    return potential, on_sag


@inner
def add_press(points, vector):
    """Add the nodes' share of the reaction to `vector` (12,), without what goes by way of the sag."""
    for k in range(4):
        x = BED_POINTS[k]
        vector[2] += (1.0 - x) * points[k, 0]
        vector[8] += x * points[k, 0]


@inner
def add_press_stiffness(points, sag_row, matrix, row):
    """Add the tangent of the reaction to `matrix` (12, 12), but for the turning of `sag_row` (9,), the gradient of the sag; `row` (12,)."""
    for k in range(4):
        if points[k, 1] == 0.0:
            continue
        x = BED_POINTS[k]
        y = 1.0 - x
        expand(sag_row, row)
        for i in range(12):
            row[i] *= x * y
        row[2] += y
        row[8] += x
        add_outer(matrix, points[k, 1], row, row)


@inner
def add_mean_contact(h, dt, diameter, weight, bed, old, new, ends, mean_row, new_row, fresh, sharp, vector, matrix, scratch):
    """Reaction of the bed over a step: discrete gradient of the potential, damping and friction.

    `old`, `new` (3,): z of the two nodes and sag before and after; `ends` (2, 6) mean velocities; `mean_row`, `new_row` (9,) gradients
    of the sag, averaged over the step and at its end; `bed` = (damping [s/m], friction, friction speed [m/s]). The dashpot's force is
    damping * z' times the elastic force: it acts in contact only, and at most takes that force away. Friction is Coulomb's, regularised.
    Tangent if `fresh`; that of friction is Newton's if `sharp`, else one that never underrates it, with which no correction overshoots.
    `scratch`: one of (3, 12). Returns the work dissipated [J].
    """
    dissipated = 0.0
    row, row_new = scratch[0][0], scratch[0][1]
    for k in range(4):
        x = BED_POINTS[k]
        y = 1.0 - x
        z_old = y * old[0] + x * old[1] + x * y * old[2]
        z_new = y * new[0] + x * new[1] + x * y * new[2]
        force, slope = mean_contact(z_old, z_new, diameter, weight)
        if force == 0.0 and slope == 0.0:
            continue
        share = h * BED_WEIGHTS[k]
        expand(mean_row, row)
        if fresh:
            expand(new_row, row_new)
        for i in range(12):
            row[i] *= x * y
            row_new[i] *= x * y
        row[2] += y
        row[8] += x
        row_new[2] += y
        row_new[8] += x
        rate = 0.0  # of the points' depth; from the velocities, as a difference of depths over a very short step is round-off
        for i in range(6):
            rate += row[i] * ends[0, i] + row[6 + i] * ends[1, i]
        hardening = max(0.0, 1.0 + bed[0] * rate)  # the bed pushes, it never holds a pipe that leaves it
        total = force * hardening
        dissipated += share * (total - force) * rate * dt
        for i in range(12):
            vector[i] += share * total * row[i]
        if fresh:
            add_outer(matrix, share * (slope * hardening + (force * bed[0] / dt if hardening > 0.0 else 0.0)), row, row_new)
        if bed[1] > 0.0:
            vx = y * ends[0, 0] + x * ends[1, 0]
            vy = y * ends[0, 1] + x * ends[1, 1]
            speed = math.sqrt(vx * vx + vy * vy + bed[2] * bed[2])
            grip = share * bed[1] / speed
            f = grip * force
            dissipated += f * (vx * vx + vy * vy) * dt
            bent = 1.0 / (speed * speed) if sharp else 0.0
            for i in range(2):
                v_i = vx if i == 0 else vy
                vector[i] += y * f * v_i
                vector[6 + i] += x * f * v_i
                for j in range(2 if fresh else 0):
                    v_j = vx if j == 0 else vy
                    k_ij = f / dt * ((1.0 if i == j else 0.0) - v_i * v_j * bent)
                    matrix[i, j] += y * y * k_ij
                    matrix[i, 6 + j] += x * y * k_ij
                    matrix[6 + i, j] += x * y * k_ij
                    matrix[6 + i, 6 + j] += x * x * k_ij
                if fresh and sharp:
                    for j in range(12):
                        pressed = grip * v_i * slope * row_new[j]
                        matrix[i, j] += y * pressed
                        matrix[6 + i, j] += x * pressed
    return dissipated
