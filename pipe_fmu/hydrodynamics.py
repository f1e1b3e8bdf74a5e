"""Quadratic drag on a slender section, eqs. (29)-(31), for a section symmetric about t1 (D_2 = D_3)."""

import math

from .compiled import inner
from .so3 import add, dot, scale

_STILL = 1e-300  # of a square of a speed


@inner
def drag(v_r, tangent, tangential, normal):
    """Drag force per length on the water [N/m] for relative velocity `v_r` and unit tangent t1, all in e.

    `tangential`, `normal` are rho d D_1 / 2 and rho d D_2 / 2 [N s^2/m^3]. The pipe feels minus this force; force . v_r >= 0.
    Also returns the coefficients (a, b, c) of the derivative  d force / d v_r = a I + b t t^T + c v_n v_n^T,  and v_n.
    """
    v_t = dot(v_r, tangent)
    v_n = add(v_r, scale(-v_t, tangent))
    speed = math.sqrt(dot(v_n, v_n))
    force = add(scale(normal * speed, v_n), scale(tangential * math.fabs(v_t) * v_t, tangent))
    a = normal * speed
    c = a / max(dot(v_n, v_n), _STILL)
    return force, a, 2.0 * tangential * math.fabs(v_t) - a, c, v_n


@inner
def current_at(z, levels, velocities):
    """Current (3,) at depth coordinate z: linear between `levels` (n,), ascending, constant beyond; `velocities` (n, 3) [m/s]."""
    x, y, w = velocities[0, 0] + 0.0 * z, velocities[0, 1] + 0.0 * z, velocities[0, 2] + 0.0 * z
    for k in range(1, levels.shape[0]):
        f = min(max((z - levels[k - 1]) / (levels[k] - levels[k - 1]), 0.0), 1.0)
        x = x + f * (velocities[k, 0] - velocities[k - 1, 0])
        y = y + f * (velocities[k, 1] - velocities[k - 1, 1])
        w = w + f * (velocities[k, 2] - velocities[k - 1, 2])
    return (x, y, w)


@inner
def current_slope(z, levels, velocities):
    """Derivative (3,) of the current with respect to the depth coordinate z [1/s]."""
    n = levels.shape[0]
    if z <= levels[0] or z >= levels[n - 1]:
        return (0.0, 0.0, 0.0)
    k = 1
    while levels[k] < z:
        k += 1
    rate = 1.0 / (levels[k] - levels[k - 1])
    return (
        rate * (velocities[k, 0] - velocities[k - 1, 0]),
        rate * (velocities[k, 1] - velocities[k - 1, 1]),
        rate * (velocities[k, 2] - velocities[k - 1, 2]),
    )
