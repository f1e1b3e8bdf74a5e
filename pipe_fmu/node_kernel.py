"""What a step does at the nodes: inertia of lumped mass and section, rotational damping, added mass; and the state after it."""

from .compiled import inner
from .so3 import add, apply, apply_transposed, cross, dot, exp, left_jacobian_transposed, matrix, multiply, normalize, scale
from .static_kernel import spin

DRAG, CURRENT, SPIN, INTERNAL, CONTACT, NUMERICAL = range(6)  # works over the step, in this order


@inner
def vector_of(x, i, j):
    return (x[i, j], x[i, j + 1], x[i, j + 2])


@inner
def turn_columns(theta, block):
    """block[:, 3:] <- block[:, 3:] J_l(theta): from spins at the end of the step to the rotation vector."""
    for i in range(6):
        turned = left_jacobian_transposed(theta, (block[i, 3], block[i, 4], block[i, 5]))
        block[i, 3], block[i, 4], block[i, 5] = turned


@inner
def _mass_motion(offset, theta, r_old, dphi):
    """Arm of the node's mass averaged over the step, and the displacement of its centre (new arm - old arm = theta x mean, exactly)."""
    old = (offset * r_old[0][0], offset * r_old[1][0], offset * r_old[2][0])
    mean = left_jacobian_transposed(scale(-1.0, theta), old)
    return mean, add(dphi, cross(theta, mean))


@inner
def _add_lever(arm, arm_new, tensor, gain, fresh, block, residual):
    """Add the inertial force `gain` (3,) at the end of the node's arm, and its tangent: `tensor` (3, 3) = d gain / d displacement."""
    moment = cross(arm, gain)
    for a in range(3):
        residual[a] += gain[a]
        residual[3 + a] += moment[a]
    if not fresh:
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
def add_node(line, i, h, quaternion, velocity, rate, flow, x, fresh, block, residual, works, tensor):
    """Inertia, rotational damping (material frame) and added mass of one node; `tensor` (3, 3) is scratch."""
    q = spin(quaternion, i)
    theta = vector_of(x, i, 3)
    r_old = matrix(q)
    r_mid = matrix(multiply(exp(scale(0.5, theta)), q))
    r_new = matrix(multiply(exp(theta), q))
    turn = apply_transposed(r_old, theta)
    arm, move = _mass_motion(line.offset[i], theta, r_old, vector_of(x, i, 0))
    arm_new = scale(line.offset[i], (r_new[0][0], r_new[1][0], r_new[2][0]))
    pace = 2.0 * line.mass[i] / (h * h)
    for a in range(3):
        for b in range(3):
            tensor[a, b] = pace if a == b else 0.0
    gain = (
        pace * (move[0] - h * velocity[i, 0]),
        pace * (move[1] - h * velocity[i, 1]),
        pace * (move[2] - h * velocity[i, 2]),
    )
    _add_lever(arm, arm_new, tensor, gain, fresh, block, residual)
    j, c = line.inertia[i], line.spin_damping[i]
    w_new = (2.0 * turn[0] / h - rate[i, 0], 2.0 * turn[1] / h - rate[i, 1], 2.0 * turn[2] / h - rate[i, 2])
    momentum = apply(r_new, (j[0] * w_new[0], j[1] * w_new[1], j[2] * w_new[2]))
    before = apply(r_old, (j[0] * rate[i, 0], j[1] * rate[i, 1], j[2] * rate[i, 2]))
    brake = apply(r_mid, (c[0] * turn[0] / h, c[1] * turn[1] / h, c[2] * turn[2] / h))
    works[SPIN] += (c[0] * turn[0] ** 2 + c[1] * turn[1] ** 2 + c[2] * turn[2] ** 2) / h
    for a in range(3):
        residual[3 + a] += (momentum[a] - before[a]) / h + brake[a]
        for b in range(3 if fresh else 0):
            for k in range(3):
                block[3 + a, 3 + b] += (2.0 * j[k] / (h * h) + c[k] / h) * r_mid[a][k] * r_mid[b][k]
    if line.added_mass.shape[0] > 0:
        _add_added_mass(line.added_mass[i], h, flow[i], r_mid, scale(1.0 / h, turn), arm, arm_new, move, fresh, block, residual, tensor)


@inner
def _add_added_mass(m, h, flow, r_mid, spin_t, arm, arm_new, move, fresh, block, residual, tensor):
    """Added mass `m` (3,) of one node in the section's frame (Kirchhoff's equations); `flow` (3,) its old velocity there."""
    v = apply_transposed(r_mid, scale(1.0 / h, move))
    p = (m[0] * v[0], m[1] * v[1], m[2] * v[2])
    rate = (2.0 * m[0] * (v[0] - flow[0]) / h, 2.0 * m[1] * (v[1] - flow[1]) / h, 2.0 * m[2] * (v[2] - flow[2]) / h)
    for a in range(3):
        for b in range(3):
            tensor[a, b] = 0.0
            for k in range(3):
                tensor[a, b] += 2.0 * m[k] / (h * h) * r_mid[a][k] * r_mid[b][k]
    _add_lever(arm, arm_new, tensor, apply(r_mid, add(rate, cross(spin_t, p))), fresh, block, residual)
    moment = apply(r_mid, cross(v, p))
    momentum, speed = apply(r_mid, p), scale(1.0 / h, move)
    for a in range(3):
        residual[3 + a] += moment[a]
    for a in range(3 if fresh else 0):
        unit = (1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0)
        turned = cross(unit, momentum)
        carried = (0.5 * h * tensor[0, a], 0.5 * h * tensor[1, a], 0.5 * h * tensor[2, a])
        bent = add(scale(1.0 / h, turned), cross(speed, carried))
        for b in range(3):
            block[b, 3 + a] += turned[b] / h
            block[3 + b, a] += bent[b]


@inner
def advance(line, h, quaternion, velocity, rate, flow, x, new_quaternion, new_velocity, new_rate, new_flow):
    """Attitudes, velocities, body rates and added-mass velocities after the increments x (n, 6)."""
    for i in range(x.shape[0]):
        theta, q = vector_of(x, i, 3), spin(quaternion, i)
        r_old = matrix(q)
        turn = apply_transposed(r_old, theta)
        turned = normalize(multiply(exp(theta), q))
        _, move = _mass_motion(line.offset[i], theta, r_old, vector_of(x, i, 0))
        for a in range(3):
            new_velocity[i, a] = 2.0 * move[a] / h - velocity[i, a]
            new_rate[i, a] = 2.0 * turn[a] / h - rate[i, a]
        for a in range(4):
            new_quaternion[i, a] = turned[a]
        if flow.shape[0] > 0:
            r_mid = matrix(multiply(exp(scale(0.5, theta)), q))
            v = apply_transposed(r_mid, scale(1.0 / h, move))
            for a in range(3):
                new_flow[i, a] = 2.0 * v[a] - flow[i, a]
