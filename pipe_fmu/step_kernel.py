"""One discretely passive time step of the pipe, eqs. (25), (26) with the corrected signs.

Unknowns: displacement and rotation vector of every node over the step, x = (phi_new - phi_old, theta), R_new = exp(theta) R_old. With

- v_new = 2 dphi / h - v_old, body rates W_new = 2 R_old^T theta / h - W_old, spatial angular momentum R J W;
- section forces C (strain_old + strain_new) / 2 through the strain gradients averaged over the path phi_old + s dphi, exp(s theta) R_old
  (three Gauss points; what they leave of strain_new - strain_old, and it is round-off below 0.02 rad, is closed by a
  discrete-gradient correction along the relative motion, which touches neither the linear momentum nor a rigid turn);
- drag at mean velocity and mid rotation, the bed by a discrete gradient, weight through the exact change of its potential;

the work of the top equals the change of kinetic, elastic, gravity and contact energy plus the dissipations less the work of the current,
for any h, to the tolerance of Newton's method. A free line keeps its linear momentum exactly, its angular momentum to second order in h
(3e-6 of it over 10 steps of 0.04 s of a bar tumbling at 1 rad/s, 8e-7 over 20 of 0.02 s). The mass is lumped, the centre of a node's
share (h_right - h_left) / 6 ahead of the node: with elements that are exact at their nodes the inertia of a smooth motion across the
line then acts as if it were distributed, to fourth order (along it, and that of rotation, to second), and conserves as a rigid body's
does (a consistent matrix would need couples that turn with the element).
"""

import math

import numpy as np

from .assembly import add_matrix, add_outer, add_vector, clear, expand, expand_matrix
from .compiled import inner, kernel
from .element import ROWS, STRAINS, frame, geometric_stiffness, gradients, resultant, strains
from .loads import add_drag, add_mean_contact, bed_on_sag
from .node_kernel import CONTACT, CURRENT, DRAG, INTERNAL, NUMERICAL, add_node, turn_columns, vector_of
from .so3 import (
    add,
    dot,
    exp,
    multiply,
    scale,
)
from .static_kernel import chord, spin

_PATH = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15), 1.0)  # three Gauss points and the end
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)
_CLOSURE_ANGLE = 0.02  # rad per step; below it three Gauss points are exact to round-off


@inner
def element_strains(line, position, quaternion, out):
    """Strains and sags (n - 1, 7) of a configuration."""
    for e in range(line.length.shape[0]):
        rm, u, psi = frame(spin(quaternion, e), spin(quaternion, e + 1), chord(position, e))
        strains(rm, u, psi, line.length[e], line.share[e], out[e])


@kernel
def folded(length, old, new):
    """Whether the turn between the ends of an element, from strains `old` to `new` (n - 1, 7), went past half a turn: its rotation vector
    then jumps to the other end of the same axis, and the strain energy with it."""
    for e in range(length.shape[0]):
        change = 0.0
        for i in range(3, 6):
            change += (new[e, i] - old[e, i]) ** 2
        if math.sqrt(change) * length[e] > math.pi:
            return True
    return False


@kernel
def step_system(line, water, h, position, quaternion, velocity, rate, flow, strain, x, new_strain, fresh, sharp, system, works):
    """Residual of the step for trial increments `x` (n, 6), and the tangent if `fresh`, into `system` = (diagonal, lower, upper, residual).

    `sharp`: see add_mean_contact.

    position, velocity (n, 3), quaternion (n, 4), rate (n, 3) body rates, flow (n, 3) or (0, 3) body velocity of the added mass,
    strain (n - 1, 7): old state. Fills new_strain (n - 1, 7) and works (6,). Returns (force scale [N], moment scale [N m]).
    """
    n = x.shape[0]
    turned = np.empty((4, n, 4))
    elemental = np.empty((3, ROWS, 9)), np.empty((9, 9)), np.empty((12, 12)), np.empty((2, 3, 12)), np.empty((2, 6)), np.empty((8, 12))
    old = (position, quaternion, velocity, rate, flow, strain)
    return _assemble(line, water, h, old, x, new_strain, fresh, sharp, system, works, turned, elemental)


@inner
def _assemble(line, water, h, old, x, new_strain, fresh, sharp, system, works, turned, elemental):
    """`step_system` with its scratch: `turned` (4, n, 4) attitudes on the path, and arrays of one element."""
    position, quaternion, velocity, rate, flow, strain = old
    diagonal, lower, upper, residual = system
    if fresh:
        clear(diagonal, lower, upper)
    residual[:] = 0.0
    works[:] = 0.0
    n = x.shape[0]
    for i in range(n):
        theta, q = vector_of(x, i, 3), spin(quaternion, i)
        for g in range(4):
            at = multiply(exp(scale(_PATH[g], theta)), q)
            for a in range(4):
                turned[g, i, a] = at[a]
    operators, square, twelve, scratch, ends, vectors = elemental
    rows, mean, new = operators[0], operators[1], operators[2]
    stress, nine, vector, depths = vectors[0], vectors[1, :9], vectors[2], vectors[3]
    old_z, new_z, motion = vectors[4], vectors[5], vectors[6]
    tensor = scratch[0, :, :3]
    force_scale, moment_scale = 0.0, 0.0
    for e in range(n - 1):
        length = line.length[e]
        share = line.share[e]
        d = chord(position, e)
        t1, t2 = vector_of(x, e, 3), vector_of(x, e + 1, 3)
        dd = (x[e + 1, 0] - x[e, 0], x[e + 1, 1] - x[e, 1], x[e + 1, 2] - x[e, 2])
        rm, u, psi = frame(spin(turned[3], e), spin(turned[3], e + 1), add(d, dd))
        strains(rm, u, psi, length, share, new_strain[e])
        if fresh:
            gradients(rm, u, psi, length, share, new)
        late = line.numerical_damping
        lag = line.damping[e] if line.damping.shape[0] > 0 else 0.0
        ahead = lag / h + late
        for k in range(STRAINS):
            modulus = length * line.stiffness[e, k]
            change = new_strain[e, k] - strain[e, k]
            stress[k] = modulus * (0.5 * (strain[e, k] + new_strain[e, k]) + ahead * change)
            works[INTERNAL] += modulus * lag / h * change * change
            works[NUMERICAL] += modulus * late * change * change
        weight = length * line.weight[e]
        stress[STRAINS] = -weight / 6.0
        large = max(dot(t1, t1), dot(t2, t2)) > _CLOSURE_ANGLE**2
        by_row = fresh or large or line.bed.shape[0] > 0
        nine[:] = 0.0
        mean[:] = 0.0
        for g in range(3):
            rm, u, psi = frame(spin(turned[g], e), spin(turned[g], e + 1), add(d, scale(_PATH[g], dd)))
            if g == 1:
                middle, u_mid, psi_mid = rm, u, psi
            if by_row:
                gradients(rm, u, psi, length, share, rows)
                for k in range(ROWS):
                    for i in range(9):
                        mean[k, i] += _WEIGHTS[g] * rows[k, i]
            else:
                resultant(rm, u, psi, length, share, stress, rows[0])
                for i in range(9):
                    nine[i] += _WEIGHTS[g] * rows[0, i]
        if large:
            _close(mean, motion, dd, t1, t2, length, strain[e], new_strain[e])
        if by_row:
            for k in range(ROWS):
                for i in range(9):
                    nine[i] += stress[k] * mean[k, i]
        if line.bed.shape[0] > 0:
            old_z[0], old_z[1], old_z[2] = position[e, 2], position[e + 1, 2], strain[e, STRAINS]
            new_z[0], new_z[1], new_z[2] = old_z[0] + x[e, 2], old_z[1] + x[e + 1, 2], new_strain[e, STRAINS]
            if fresh:
                stress[STRAINS] += bed_on_sag(length, h, line.diameter[e], line.weight[e], line.bed[0], old_z, new_z)
        if fresh:
            geometric_stiffness(middle, u_mid, psi_mid, length, share, stress, square)
            for i in range(9):
                for j in range(9):
                    square[i, j] *= 0.5
            for k in range(STRAINS):
                add_outer(square, length * line.stiffness[e, k] * (0.5 + ahead), mean[k], new[k])
            expand_matrix(square, twelve)
        expand(nine, vector)
        for i in range(3):
            force_scale = max(force_scale, math.fabs(vector[i]))
            moment_scale = max(moment_scale, math.fabs(vector[3 + i]))
        vector[2] -= 0.5 * weight
        vector[8] -= 0.5 * weight
        if water.drag or line.bed.shape[0] > 0:
            for i in range(6):
                ends[0, i] = x[e, i] / h
                ends[1, i] = x[e + 1, i] / h
        if water.drag:
            depths[0] = position[e, 2] + 0.5 * x[e, 2]
            depths[1] = position[e + 1, 2] + 0.5 * x[e + 1, 2]
            stream = water.levels, water.velocities
            dissipated, supplied = add_drag(
                middle, u_mid, psi_mid, length, line.drag[e], ends, depths, *stream, 1.0 / h, fresh, vector, twelve, scratch
            )
            works[DRAG] += h * dissipated
            works[CURRENT] += h * supplied
        if line.bed.shape[0] > 0:
            works[CONTACT] += add_mean_contact(
                length,
                h,
                line.diameter[e],
                line.weight[e],
                line.bed,
                old_z,
                new_z,
                ends,
                mean[STRAINS],
                new[STRAINS],
                fresh,
                sharp,
                vector,
                twelve,
                scratch,
            )
        add_vector(residual, e, vector)
        if fresh:
            add_matrix(diagonal, lower, upper, e, twelve)
    for i in range(n):
        add_node(line, i, h, quaternion, velocity, rate, flow, x, fresh, diagonal[i], residual[i], works, tensor)
        theta = vector_of(x, i, 3)
        if fresh and dot(theta, theta) > 1e-8:
            turn_columns(theta, diagonal[i])
            if i > 0:
                turn_columns(theta, upper[i - 1])
            if i < n - 1:
                turn_columns(theta, lower[i])
    return force_scale, moment_scale


@inner
def _close(mean, motion, dd, t1, t2, length, old, new):
    """Make mean . motion = new - old exactly, by the least change along the relative motion of the ends."""
    norm = 0.0
    for i in range(3):
        motion[i] = dd[i]
        motion[3 + i] = 0.5 * (t1[i] + t2[i])
        motion[6 + i] = t2[i] - t1[i]
        norm += motion[i] ** 2 + (length * motion[6 + i]) ** 2
    if norm == 0.0:
        return
    for k in range(ROWS):
        gap = new[k] - old[k]
        for i in range(9):
            gap -= mean[k, i] * motion[i]
        for i in range(3):
            mean[k, i] += gap * motion[i] / norm
            mean[k, 6 + i] += gap * length * length * motion[6 + i] / norm
