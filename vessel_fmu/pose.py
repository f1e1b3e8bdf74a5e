"""Where the vessel is: centre of gravity, hang-off point and the pipe section held there.

Ports refer to the hang-off point r_t; the pipe section held there has the orientation R_t = R_b (R_b^t)^T with R_b^t =
R_y(-alpha), turned further by the departure rotation vector rho in b: R_t = R_b exp(rho) R_y(alpha).
"""

import numpy as np

from .attitude import Array, add_cross, apply, exp_quaternion, fill, multiply, rotation_matrix
from .compiled import inlined, kernel
from .hydrodynamics import HANG_OFF
from .parameters import place

ANGLE, ROTATION, DEPTH = place("departure_angle"), place("departure_rotation"), place("environment.depth")


@inlined
def centre(values: Array, position: Array) -> Array:
    """Centre of gravity (3,), m in e, of a `position` whose third entry counts from the heave equilibrium."""
    point = position.copy()
    point[2] -= values[DEPTH]
    return point


@inlined
def held_section(values: Array) -> Array:
    """Orientation (4,) t to b of the pipe section held at the hang-off point."""
    return multiply(exp_quaternion(values[ROTATION], 1.0), exp_quaternion(np.eye(3)[1], values[ANGLE]))


@inlined
def hang_off_pose(values: Array, point: Array, quaternion: Array) -> tuple[Array, Array]:
    """Hang-off point (3,), m in e, and orientation (4,) t to e of the section held there, eq. (5); `point` is the centre of gravity."""
    top = apply(rotation_matrix(quaternion), values[HANG_OFF])
    for i in range(3):
        top[i] += point[i]
    return top, multiply(quaternion, held_section(values))


@kernel
def hang_off_velocity(values: Array, quaternion: Array, nu: Array) -> Array:
    """Velocity, m/s, and angular velocity, rad/s, of the hang-off point, (6,) in e, for a body velocity nu (6,); eq. (68)."""
    rotation, path, velocity = rotation_matrix(quaternion), nu[:3].copy(), np.empty(6)
    add_cross(path, 1.0, nu[3:], values[HANG_OFF])
    fill(velocity[:3], apply(rotation, path))
    fill(velocity[3:], apply(rotation, nu[3:]))
    return velocity


@inlined
def moment_about_centre(values: Array, quaternion: Array, force: Array, moment: Array) -> Array:
    """Moment (3,), N m in e, about the centre of gravity of a force and a moment at the hang-off point."""
    total = moment.copy()
    add_cross(total, 1.0, apply(rotation_matrix(quaternion), values[HANG_OFF]), force)
    return total
