"""Quadratic drag of the water on a slender section, eqs. (29)-(31), for a section symmetric about t1 (D_2 = D_3).

It has no potential. Its power on the relative velocity, <v_r, f_D> >= 0, is dissipated; the rest, -<v_c, R f_D>, is what the current gives
(the paper's eq. (82) takes both as one, which has no sign).

Over a step the force is that of the mean velocity half way; at rest it is that of the current alone, with its exact tangent: along the
nodes' mean spin beta and spin difference mu, d(bow) = beta_m x bow + A^-1 mu and beta_m = beta - b bow x mu (maths/relative_rotation.py).
"""

import math

from ..compiled import inner
from ..maths.relative_rotation import mid_spin, relative_turn
from ..maths.so3 import add, apply, cross, dot, scale, subtract
from .current import current_at, current_slope
from .points import add_linked, depth, linked_forces, linked_motion, sag_rate

LEDGER: dict[str, tuple[str, float | None]] = {
    "current_work": ("work done on the pipe by the current since the start", None),
    "drag_dissipation": ("energy dissipated by drag since the start", 0.0),
}
POINTS = (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0))  # of Gauss, each of half the length
_STILL = 1e-300  # of a square of a speed


@inner
def drag(v_r, tangent, tangential, normal):
    """Drag force per length on the water [N/m] for relative velocity `v_r` and unit tangent t1, all in e.

    `tangential`, `normal` are rho d D_1 / 2 and rho d D_2 / 2 [N s^2/m^3], eq. (30). The pipe feels minus this force; force . v_r >= 0.
    Also returns the coefficients (a, b, c) of the derivative  d force / d v_r = a I + b t t^T + c v_n v_n^T,  and v_n.
    """
    v_t = dot(v_r, tangent)
    v_n = add(v_r, scale(-v_t, tangent))
    speed = math.sqrt(dot(v_n, v_n))
    force = add(scale(normal * speed, v_n), scale(tangential * math.fabs(v_t) * v_t, tangent))  # eq. (29)
    a = normal * speed
    c = a / max(dot(v_n, v_n), _STILL)
    return force, a, 2.0 * tangential * math.fabs(v_t) - a, c, v_n


@inner
def _by_velocity(tangent, a, b, c, v_n):
    """Derivative (3, 3) of `drag` with respect to v_r, as three rows."""
    t, v = tangent, v_n
    return (
        (b * t[0] * t[0] + c * v[0] * v[0] + a, b * t[0] * t[1] + c * v[0] * v[1], b * t[0] * t[2] + c * v[0] * v[2]),
        (b * t[1] * t[0] + c * v[1] * v[0], b * t[1] * t[1] + c * v[1] * v[1] + a, b * t[1] * t[2] + c * v[1] * v[2]),
        (b * t[2] * t[0] + c * v[2] * v[0], b * t[2] * t[1] + c * v[2] * v[1], b * t[2] * t[2] + c * v[2] * v[2] + a),
    )


@inner
def _by_tangent(v_r, tangent, a, c, v_n, tangential, d_t):
    """Change of `drag` with the tangent's change `d_t`."""
    v_t, s_t = dot(v_r, tangent), dot(v_r, d_t)
    d_n = add(scale(-s_t, tangent), scale(-v_t, d_t))
    change = add(scale(a, d_n), scale(c * dot(v_n, d_n), v_n))
    k = 2.0 * tangential * math.fabs(v_t) * s_t
    return add(change, add(scale(k, tangent), scale(tangential * math.fabs(v_t) * v_t, d_t)))


@inner
def add_mean_drag(rm, u, psi, h, coefficients, ends, depths, levels, velocities, rate, with_tangent, vector, matrix, scratch):
    """Add minus the mean force on an element over a step to `vector` (12,) and, if `with_tangent`, its tangent to `matrix` (12, 12).

    rm, u, psi: frame, chord in it and relative rotation; `ends` (2, 6) velocities (v, w) of the nodes; `depths` (2,) their z;
    `rate` = d velocity / d unknown [1/s]; scratch: two (3, 12).
    Returns (power dissipated >= 0, power supplied by the current) [W].
    """
    d = apply(rm, u)
    v1 = (ends[0, 0], ends[0, 1], ends[0, 2])
    v2 = (ends[1, 0], ends[1, 1], ends[1, 2])
    bow = apply(rm, psi)
    swing = sag_rate(d, bow, v1, v2, (ends[0, 3], ends[0, 4], ends[0, 5]), (ends[1, 3], ends[1, 4], ends[1, 5]))
    sag = 0.5 * (d[0] * bow[1] - d[1] * bow[0])
    dissipated, supplied = 0.0 * h, 0.0 * h
    moves, slopes = scratch[0], scratch[1]
    for x in POINTS:
        y = 1.0 - x
        linked = x * y
        bend = cross(scale(x - 0.5, psi), (1.0, 0.0, 0.0))
        local = (1.0, bend[1], bend[2])
        tangent = apply(rm, scale(1.0 / math.sqrt(dot(local, local)), local))
        v = add(add(scale(y, v1), scale(x, v2)), scale(linked, swing))
        v_c = (0.0 * h, 0.0 * h, 0.0 * h)
        if levels.shape[0] > 0:
            v_c = current_at(depth(x, depths[0], depths[1], sag), levels, velocities)
        v_r = subtract(v, v_c)  # eq. (31)
        force, a, b, c, v_n = drag(v_r, tangent, coefficients[0], coefficients[1])
        force = scale(0.5 * h, force)
        dissipated += dot(force, v_r)  # eqs. (82), (84), parted
        supplied -= dot(force, v_c)
        add_linked(x, d, bow, force, vector)
        if not with_tangent:
            continue
        linked_motion(x, d, bow, moves)
        slope = _by_velocity(tangent, a, b, c, v_n)
        for i in range(3):
            for j in range(12):
                value = 0.0
                for k in range(3):
                    value += slope[i][k] * moves[k, j]
                slopes[i, j] = 0.5 * h * rate * value
        for j in range(3):  # with the spin of t1
            unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
            change = _by_tangent(v_r, tangent, a, c, v_n, coefficients[0], cross(unit, tangent))
            for i in range(3):
                slopes[i, 3 + j] += 0.125 * h * change[i]
                slopes[i, 9 + j] += 0.125 * h * change[i]
        for i in range(12):
            for j in range(12):
                matrix[i, j] += moves[0, i] * slopes[0, j] + moves[1, i] * slopes[1, j] + moves[2, i] * slopes[2, j]
    return dissipated, supplied


@inner
def _tangent_to_arc(axis, bow, x):
    """Unit tangent of the arc at x and the length it was divided by; `axis` is t1 of the mid frame."""
    local = add(axis, scale(x - 0.5, cross(bow, axis)))
    length = math.sqrt(dot(local, local))
    return scale(1.0 / length, local), length


@inner
def add_static_drag(rm, u, psi, h, coefficients, z1, z2, levels, velocities, vector, matrix):
    """Add minus the force on an element at rest to `vector` (12,) and its derivative to `matrix` (12, 12).

    rm, u, psi: frame, chord in it and relative rotation; coefficients (2,) rho d D_1 / 2, rho d D_2 / 2; z1, z2: depths of the nodes.
    """
    axis = (rm[0][0], rm[1][0], rm[2][0])
    d = (dot(rm[0], u), dot(rm[1], u), dot(rm[2], u))
    bow = (dot(rm[0], psi), dot(rm[1], psi), dot(rm[2], psi))
    sag = 0.5 * (d[0] * bow[1] - d[1] * bow[0])
    for x in POINTS:
        z = depth(x, z1, z2, sag)
        v = scale(-1.0, current_at(z, levels, velocities))  # eq. (31)
        tangent, length = _tangent_to_arc(axis, bow, x)
        force, a, b, c, v_n = drag(v, tangent, coefficients[0], coefficients[1])
        f = scale(0.5 * h, force)
        add_linked(x, d, bow, f, vector)
        point = (x, axis, d, bow, f)
        change = (v, current_slope(z, levels, velocities), tangent, length, a, b, c, v_n, 0.5 * h, coefficients[0])
        for j in range(12):
            _add_column(point, change, j, matrix)


@inner
def _add_column(point, change, j, matrix):
    """Add the derivative of the nodes' shares of a force at a point along unknown j to column j of `matrix` (12, 12)."""
    x, axis, d, bow, f = point
    v, slope, tangent, length, a, b, c, v_n, share, tangential = change
    unit = (1.0 if j % 3 == 0 else 0.0, 1.0 if j % 3 == 1 else 0.0, 1.0 if j % 3 == 2 else 0.0)
    zero = (0.0, 0.0, 0.0)
    along = 1.0 - x if j < 3 else x  # share of a node's displacement at the point
    d_z = along * unit[2] if j < 3 or 6 <= j < 9 else 0.0
    d_d = scale(-1.0, unit) if j < 3 else (unit if 6 <= j < 9 else zero)
    d_bow, spin = zero, zero
    if d_d == zero:
        mu = scale(-1.0 if j < 6 else 1.0, unit)
        spin = mid_spin(bow, scale(0.5, unit), mu)
        d_bow = add(relative_turn(bow, mu), cross(spin, bow))
    d_sag = add(cross(d_d, bow), cross(d, d_bow))
    d_z += 0.5 * x * (1.0 - x) * d_sag[2]
    d_axis = cross(spin, axis)
    d_local = add(d_axis, scale(x - 0.5, add(cross(d_bow, axis), cross(bow, d_axis))))
    d_t = scale(1.0 / length, add(d_local, scale(-dot(tangent, d_local), tangent)))
    d_f = add(apply(_by_velocity(tangent, a, b, c, v_n), scale(-d_z, slope)), _by_tangent(v, tangent, a, c, v_n, tangential, d_t))
    d_f = scale(share, d_f)
    fixed = linked_forces(x, d, bow, d_f)  # the force's change where the element stands, and the change of its levers
    half = 0.5 * x * (1.0 - x)
    d_shifted, lever = scale(half, cross(d_bow, f)), scale(half, cross(f, d_d))
    d_rolled = scale(0.5, add(cross(d_bow, scale(half, cross(f, d))), cross(bow, lever)))
    levers = (scale(-1.0, d_shifted), subtract(d_rolled, lever), d_shifted, add(d_rolled, lever))
    for i in range(3):
        for k in range(4):
            matrix[3 * k + i, j] += fixed[k][i] + levers[k][i]
