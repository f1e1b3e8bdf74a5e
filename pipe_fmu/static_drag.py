"""Drag of a current on an element at rest, eqs. (29)-(31), with its exact tangent.

The force at a point is that of `loads.add_drag` at zero velocity; it reaches the nodes by way of the element's arc,

    F_1 = y f - g bow x f,   M_1 = -g f x d + g/2 bow x (f x d),   F_2 = x f + g bow x f,   M_2 = g f x d + g/2 bow x (f x d),

y = 1 - x, g = x y / 2, bow = R_m psi, all in e. The tangent is its derivative along the twelve nodal unknowns one by one: with the nodes'
mean spin beta and spin difference mu, d(bow) = beta_m x bow + A^-1 mu and beta_m = beta - b bow x mu (relative_rotation.py). It has no
potential.
"""

import math

from .compiled import inner
from .hydrodynamics import current_at, current_slope, drag
from .loads import DRAG_POINTS
from .relative_rotation import mid_spin, relative_turn
from .so3 import add, cross, dot, scale


@inner
def _tangent_to_arc(axis, bow, x):
    """Unit tangent of the arc at x and the length it was divided by; `axis` is t1 of the mid frame."""
    local = add(axis, scale(x - 0.5, cross(bow, axis)))
    length = math.sqrt(dot(local, local))
    return scale(1.0 / length, local), length


@inner
def add_static_drag(rm, u, psi, h, coefficients, z1, z2, levels, velocities, vector, matrix):
    """Add minus the force on the pipe to `vector` (12,) and its derivative to `matrix` (12, 12).

    rm, u, psi: frame, chord in it and relative rotation; coefficients (2,) rho d D_1 / 2, rho d D_2 / 2; z1, z2: depths of the nodes.
    """
    axis = (rm[0][0], rm[1][0], rm[2][0])
    d = (dot(rm[0], u), dot(rm[1], u), dot(rm[2], u))
    bow = (dot(rm[0], psi), dot(rm[1], psi), dot(rm[2], psi))
    sag = 0.5 * (d[0] * bow[1] - d[1] * bow[0])
    for x in DRAG_POINTS:
        z = (1.0 - x) * z1 + x * z2 + x * (1.0 - x) * sag
        v = scale(-1.0, current_at(z, levels, velocities))
        tangent, length = _tangent_to_arc(axis, bow, x)
        force, a, b, c, v_n = drag(v, tangent, coefficients[0], coefficients[1])
        f = scale(0.5 * h, force)
        point = (x, axis, d, bow, f)
        change = (v, current_slope(z, levels, velocities), tangent, length, a, b, c, v_n, 0.5 * h, coefficients[0])
        parts = _parts(x, d, bow, f)
        for i in range(3):
            for k in range(4):
                vector[3 * k + i] += parts[k][i]
        for j in range(12):
            _add_column(point, change, j, matrix)


@inner
def _parts(x, d, bow, f):
    """F_1, M_1, F_2, M_2 of a force f at x."""
    half = 0.5 * x * (1.0 - x)
    shifted = scale(half, cross(bow, f))
    lever = scale(half, cross(f, d))
    rolled = scale(0.5, cross(bow, lever))
    return add(scale(1.0 - x, f), scale(-1.0, shifted)), add(rolled, scale(-1.0, lever)), add(scale(x, f), shifted), add(rolled, lever)


@inner
def _add_column(point, change, j, matrix):
    """Derivative of the parts along unknown j into column j."""
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
    d_v = scale(-d_z, slope)
    s_t, v_t = dot(v, d_t), dot(v, tangent)
    d_n = add(scale(-s_t, tangent), scale(-v_t, d_t))
    d_f = add(add(scale(a, d_v), scale(b * dot(tangent, d_v), tangent)), scale(c * dot(v_n, d_v), v_n))
    d_f = add(d_f, add(scale(a, d_n), scale(c * dot(v_n, d_n), v_n)))
    d_f = add(d_f, scale(tangential * math.fabs(v_t), add(scale(2.0 * s_t, tangent), scale(v_t, d_t))))
    d_f = scale(share, d_f)
    half = 0.5 * x * (1.0 - x)
    d_shifted = scale(half, add(cross(d_bow, f), cross(bow, d_f)))
    d_lever = scale(half, add(cross(d_f, d), cross(f, d_d)))
    d_rolled = scale(0.5, add(cross(d_bow, scale(half, cross(f, d))), cross(bow, d_lever)))
    low, high = add(scale(1.0 - x, d_f), scale(-1.0, d_shifted)), add(scale(x, d_f), d_shifted)
    turn_low, turn_high = add(d_rolled, scale(-1.0, d_lever)), add(d_rolled, d_lever)
    for i in range(3):
        matrix[i, j] += low[i]
        matrix[3 + i, j] += turn_low[i]
        matrix[6 + i, j] += high[i]
        matrix[9 + i, j] += turn_high[i]
