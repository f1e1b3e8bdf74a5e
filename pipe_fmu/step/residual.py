"""What the residual of a step is measured by, and the work that it leaves undone."""

import math

from ..compiled import inner
from ..element.strains import STRAINS
from ..maths.block_tridiagonal import SIZE
from ..simd.lanes import larger

EXCHANGED, STORED = 2e-11, 2e-15  # of the energies exchanged and stored in a step: work that its residual may do
STRETCH = 1e-14  # of the stiffness: round-off of the section forces, which the residual does not fall below
_NOTHING = 1e-300  # J


@inner
def largest_residual(residual, force_scale, moment_scale, top_clamped):
    """Largest free residual over its scale; NaN if one is."""
    worst = 0.0
    n = residual.shape[0]
    held = SIZE if top_clamped else 3
    for i in range(n):
        for j in range(held if i == n - 1 else 0, SIZE):
            worst = larger(worst, math.fabs(residual[i, j]) / (force_scale if j < 3 else moment_scale))
    return worst


@inner
def inertial_scales(line, h, old, x, top):
    """Largest terms of inertia at any node, the top's increment `top` (6,) given: force 2 m v / h [N] and the moment like it [N m]."""
    velocity, rate = old[2], old[3]
    force, moment = 0.0, 0.0
    told, turned = 0.0, 0.0
    for k in range(3):
        told, turned = max(told, math.fabs(top[k]) / h), max(turned, math.fabs(top[3 + k]) / h)
    for i in range(x.shape[0]):
        speed, spin, mass, inertia = told, turned, line.mass[i], 0.0
        for k in range(3):
            speed = max(speed, math.fabs(x[i, k]) / h, math.fabs(velocity[k, i]))
            spin = max(spin, math.fabs(x[i, 3 + k]) / h, math.fabs(rate[k, i]))
            inertia = max(inertia, line.inertia[k, i])
            if line.added_mass.shape[1] > 0:
                mass = max(mass, line.added_mass[k, i])
        arm = math.fabs(line.offset[i])
        push = 2.0 * mass / h * (speed + arm * spin)
        force = max(force, push)
        moment = max(moment, arm * push + 2.0 * inertia / h * spin)
    return force, moment


@inner
def elastic_round_off(line, h):
    """Round-off of the section forces [N], those of internal damping included."""
    worst = 0.0
    for e in range(line.length.shape[0]):
        lag = line.damping[e] if line.damping.shape[0] > 0 else 0.0
        worst = max(worst, STRETCH * line.stiffness[e, 0] * (1.0 + lag / h))
    return worst


@inner
def work_left(line, old, x, residual, force, works):
    """Work of the free residual, which eqs. (78)-(80) of the step do not account for, over EXCHANGED of the works and the fall of the
    weight and STORED of the gravity and elastic energy before the step; line and `old` state in columns.
    """
    n, held, z, strain = x.shape[0], SIZE if line.top_clamped else 3, old[0], old[5]
    made, top, fall, stored = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        for j in range(held if i == n - 1 else 0, SIZE):
            made += residual[i, j] * x[i, j]
    for j in range(held):
        top += force[j] * x[n - 1, j]
    for e in range(n - 1):
        weight = 0.5 * line.length[e] * line.loads.weight[e]
        fall += weight * (x[e, 2] + x[e + 1, 2])
        stored += math.fabs(weight * (z[e] + z[e + 1]))
        for k in range(STRAINS):
            stored += 0.5 * line.length[e] * line.stiffness[k, e] * strain[k, e] * strain[k, e]
    exchanged = math.fabs(top) + math.fabs(fall)
    for k in range(works.shape[0]):
        exchanged += math.fabs(works[k])
    return math.fabs(made) / (EXCHANGED * exchanged + STORED * stored + _NOTHING)
