"""What a step does at the nodes: inertia of lumped mass and section, eqs. (25)-(27), rotational damping (32) in the material frame, added
mass by Kirchhoff's equations; and the state after it. See step/system.py.
"""

import math

from ..compiled import inner
from ..maths.so3 import (
    add,
    apply,
    apply_transposed,
    cross,
    dot,
    left_jacobian,
    left_jacobian_transposed,
    matrix,
    normalize,
    scale,
)
from ..simd.columns import attitude, vector_of
from ..simd.lane_arrays import grid, group, lane, row
from ..simd.lanes import WIDTH
from .state import ROTATIONAL

PATH = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15), 1.0)  # of a step: three Gauss points and the end,
MIDDLE, END = 1, 3  # of which two are named


@inner
def turn_columns(jacobian, block, height, first):
    """block[:, first:first + 3] <- block[:, first:first + 3] J_l: from spins at the end of the step to the rotation vector."""
    for i in range(height):
        turned = apply_transposed(jacobian, (block[i, first], block[i, first + 1], block[i, first + 2]))
        block[i, first], block[i, first + 1], block[i, first + 2] = turned


@inner
def _mass_motion(offset, theta, r_old, dphi):
    """Arm of the node's mass averaged over the step, and the displacement of its centre (new arm - old arm = theta x mean, exactly)."""
    old = (offset * r_old[0][0], offset * r_old[1][0], offset * r_old[2][0])
    mean = left_jacobian_transposed(scale(-1.0, theta), old)
    return mean, add(dphi, cross(theta, mean))


@inner
def _add_lever(arm, arm_new, tensor, gain, with_tangent, block, residual):
    """Add the inertial force `gain` (3,) at the end of the node's arm, and its tangent: `tensor` (3, 3) = d gain / d displacement."""
    moment = cross(arm, gain)
    for a in range(3):
        residual[a] += gain[a]
        residual[3 + a] += moment[a]
    if not with_tangent:
        return
    for a in range(3):
        push = (tensor[0, a], tensor[1, a], tensor[2, a])
        turn = cross(arm, push)
        unit = (1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0)
        swing = cross(unit, arm_new)
        shove = (dot(tensor[0], swing), dot(tensor[1], swing), dot(tensor[2], swing))
        twist = cross(arm, shove)
        for b in range(3):
            block[b, a] += push[b]
            block[3 + b, a] += turn[b]
            block[b, 3 + a] += shove[b]
            block[3 + b, 3 + a] += twist[b]


@inner
def add_nodes(line, first, count, h, old, moves, turned, with_tangent, diagonal, residual, sums):
    """Add the inertia, damping and added mass of the `count` nodes from `first` on; arrays as in step.system.assemble."""
    at = group(first)
    block, force = grid(6, 6), row(6)
    for i in range(6):
        force[i] = 0.0
        for j in range(6):
            block[i, j] = 0.0
    _add_node(line, at, h, old, moves, turned, with_tangent, block, force, sums)
    if with_tangent:
        turn_columns(left_jacobian(vector_of(moves, 3, at)), block, 6, 3)
    for m in range(count):
        ours, our_force = lane(block, m), lane(force, m)
        for i in range(6):
            residual[first + m, i] += our_force[i]
            for j in range(6 if with_tangent else 0):
                diagonal[first + m, i, j] += ours[i, j]


@inner
def _add_node(line, i, h, old, moves, turned, with_tangent, block, residual, works):
    """Inertia, rotational damping (material frame) and added mass of one node, or of a group."""
    _, quaternion, velocity, rate, added_mass_velocity, _, _ = old
    tensor = grid(3, 3)
    theta = vector_of(moves, 3, i)
    r_old = matrix(attitude(quaternion, i))
    r_mid = matrix(attitude(turned[MIDDLE], i))
    r_new = matrix(attitude(turned[END], i))
    turn = apply_transposed(r_old, theta)
    arm, move = _mass_motion(line.offset[i], theta, r_old, vector_of(moves, 0, i))
    arm_new = scale(line.offset[i], (r_new[0][0], r_new[1][0], r_new[2][0]))
    pace = 2.0 * line.mass[i] / (h * h)  # eq. (25)
    for a in range(3):
        for b in range(3):
            tensor[a, b] = pace if a == b else 0.0 * pace
    gain = scale(pace, add(move, scale(-h, vector_of(velocity, 0, i))))
    _add_lever(arm, arm_new, tensor, gain, with_tangent, block, residual)
    j, c = vector_of(line.inertia, 0, i), vector_of(line.spin_damping, 0, i)
    w_old = vector_of(rate, 0, i)
    w_new = add(scale(2.0 / h, turn), scale(-1.0, w_old))
    momentum = apply(r_new, (j[0] * w_new[0], j[1] * w_new[1], j[2] * w_new[2]))  # eqs. (26), (27)
    before = apply(r_old, (j[0] * w_old[0], j[1] * w_old[1], j[2] * w_old[2]))
    brake = apply(r_mid, (c[0] * turn[0] / h, c[1] * turn[1] / h, c[2] * turn[2] / h))  # eq. (32)
    works[ROTATIONAL] += (c[0] * turn[0] * turn[0] + c[1] * turn[1] * turn[1] + c[2] * turn[2] * turn[2]) / h  # eq. (81)
    for a in range(3):
        residual[3 + a] += (momentum[a] - before[a]) / h + brake[a]
        for b in range(3 if with_tangent else 0):
            for k in range(3):
                block[3 + a, 3 + b] += (2.0 * j[k] / (h * h) + c[k] / h) * r_mid[a][k] * r_mid[b][k]
    if line.added_mass.shape[1] > 0:
        m, v_flow = vector_of(line.added_mass, 0, i), vector_of(added_mass_velocity, 0, i)
        _add_added_mass(m, h, v_flow, r_mid, scale(1.0 / h, turn), arm, arm_new, move, with_tangent, block, residual, tensor)


@inner
def _add_added_mass(m, h, added_mass_velocity, r_mid, spin_t, arm, arm_new, move, with_tangent, block, residual, tensor):
    """Added mass `m` (3,) of one node in the section's frame (Kirchhoff's equations); `added_mass_velocity` (3,) its old velocity there."""
    v = apply_transposed(r_mid, scale(1.0 / h, move))
    p = (m[0] * v[0], m[1] * v[1], m[2] * v[2])
    u = added_mass_velocity
    rate = (2.0 * m[0] * (v[0] - u[0]) / h, 2.0 * m[1] * (v[1] - u[1]) / h, 2.0 * m[2] * (v[2] - u[2]) / h)
    for a in range(3):
        for b in range(3):
            tensor[a, b] = 0.0
            for k in range(3):
                tensor[a, b] += 2.0 * m[k] / (h * h) * r_mid[a][k] * r_mid[b][k]
    _add_lever(arm, arm_new, tensor, apply(r_mid, add(rate, cross(spin_t, p))), with_tangent, block, residual)
    moment = apply(r_mid, cross(v, p))
    momentum, speed = apply(r_mid, p), scale(1.0 / h, move)
    for a in range(3):
        residual[3 + a] += moment[a]
    for a in range(3 if with_tangent else 0):
        unit = (1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0)
        turned = cross(unit, momentum)
        carried = (0.5 * h * tensor[0, a], 0.5 * h * tensor[1, a], 0.5 * h * tensor[2, a])
        bent = add(scale(1.0 / h, turned), cross(speed, carried))
        for b in range(3):
            block[b, 3 + a] += turned[b] / h
            block[3 + b, a] += bent[b]


@inner
def advance(line, h, old, moves, turned, new):
    """Columns `new` of attitudes, velocities, body rates and added-mass velocities after the increments; see step.system.assemble."""
    _, quaternion, velocity, rate, added_mass_velocity, _, _ = old
    new_quaternion, new_velocity, new_rate, new_flow = new
    for first in range(0, line.mass.shape[0], WIDTH):
        i = group(first)
        theta = vector_of(moves, 3, i)
        r_old = matrix(attitude(quaternion, i))
        turn = apply_transposed(r_old, theta)
        now = normalize(attitude(turned[END], i))
        _, move = _mass_motion(line.offset[i], theta, r_old, vector_of(moves, 0, i))
        for a in range(3):
            new_velocity[a, i] = 2.0 * move[a] / h - velocity[a, i]
            new_rate[a, i] = 2.0 * turn[a] / h - rate[a, i]
        for a in range(4):
            new_quaternion[a, i] = now[a]
        if added_mass_velocity.shape[1] > 0:
            r_mid = matrix(attitude(turned[MIDDLE], i))
            v = apply_transposed(r_mid, scale(1.0 / h, move))
            for a in range(3):
                new_flow[a, i] = 2.0 * v[a] - added_mass_velocity[a, i]
