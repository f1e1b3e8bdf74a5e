"""Rotations: quaternions (scalar first, unit) and the exponential of SO(3), compiled.

The mean of exp(s theta) over s in [0, 1],

    A(theta) = I + b1 [theta]x + b2 [theta]x^2,    b1 = (1 - cos t) / t^2,  b2 = (t - sin t) / t^3,  t = |theta|,

turns a constant body velocity into the exact chord of its path, exp(theta) - I = A(theta) [theta]x, and A(theta) theta
= theta.
"""

import math

import numpy as np

from .compiled import kernel

Array = np.ndarray
SERIES_TERMS = 9  # below t = 1 what is left out is under 1e-18


@kernel
def add_cross(out: Array, factor: float, a: Array, b: Array) -> None:
    """out (3,) += factor a x b."""
    out[0] += factor * (a[1] * b[2] - a[2] * b[1])
    out[1] += factor * (a[2] * b[0] - a[0] * b[2])
    out[2] += factor * (a[0] * b[1] - a[1] * b[0])


@kernel
def product(a: Array, b: Array) -> Array:
    """Matrix product; small matrices, without a call of BLAS."""
    c = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            for j in range(b.shape[1]):
                c[i, j] += a[i, k] * b[k, j]
    return c


@kernel
def apply(a: Array, x: Array) -> Array:
    """a x."""
    y = np.zeros(a.shape[0])
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            y[i] += a[i, j] * x[j]
    return y


@kernel
def fill(out: Array, x: Array) -> None:
    """out (n,) = x."""
    for i in range(out.shape[0]):
        out[i] = x[i]


@kernel
def dot(a: Array, b: Array) -> float:
    """Scalar product."""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
def multiply(p: Array, q: Array) -> Array:
    """Unit quaternion of the rotation q followed by p, normalised."""
    r = np.empty(4)
    r[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    r[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    r[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    r[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    length = math.sqrt(dot(r, r))
    for i in range(4):
        r[i] /= length
    return r


@kernel
def exp_quaternion(w: Array, h: float) -> Array:
    """Unit quaternion of the rotation vector h w: w (3,), rad/s, h, s."""
    angle = h * math.sqrt(dot(w, w))
    factor = h * math.sin(0.5 * angle) / angle if angle != 0.0 else 0.5 * h
    q = np.empty(4)
    q[0] = math.cos(0.5 * angle)
    for i in range(3):
        q[1 + i] = factor * w[i]
    return q


@kernel
def rotation_matrix(q: Array) -> Array:
    """Rotation matrix (3, 3) of the unit quaternion q."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    rotation = np.empty((3, 3))
    rotation[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    rotation[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    rotation[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    rotation[0, 2], rotation[2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    rotation[1, 2], rotation[2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)
    return rotation


@kernel
def mean_rotation(w: Array, h: float) -> Array:
    """A(theta) (3, 3) of theta = h w: w (3,), rad/s, h, s."""
    square = h * h * dot(w, w)
    if square < 1.0:
        b1, b2, term = 0.0, 0.0, 0.5
        for k in range(SERIES_TERMS):  # term = (-square)^k / (2 k + 2)!
            b1 += term
            b2 += term / (2 * k + 3)
            term *= -square / ((2 * k + 3) * (2 * k + 4))
    else:
        angle = math.sqrt(square)
        b1 = (1.0 - math.cos(angle)) / square
        b2 = (angle - math.sin(angle)) / (square * angle)
    x, y, z = h * w[0], h * w[1], h * w[2]
    a = np.empty((3, 3))
    a[0, 0] = 1.0 - b2 * (y * y + z * z)
    a[1, 1] = 1.0 - b2 * (x * x + z * z)
    a[2, 2] = 1.0 - b2 * (x * x + y * y)
    a[0, 1], a[1, 0] = b2 * x * y - b1 * z, b2 * x * y + b1 * z
    a[0, 2], a[2, 0] = b2 * x * z + b1 * y, b2 * x * z - b1 * y
    a[1, 2], a[2, 1] = b2 * y * z - b1 * x, b2 * y * z + b1 * x
    return a


@kernel
def quaternion_from_angles(roll: float, pitch: float, yaw: float) -> Array:
    """Unit quaternion of the zyx Euler angles, rad."""
    axes = np.eye(3)
    return multiply(exp_quaternion(axes[2], yaw), multiply(exp_quaternion(axes[1], pitch), exp_quaternion(axes[0], roll)))


@kernel
def angles_from_quaternion(q: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw (zyx), rad, of the unit quaternion q."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.atan2(2.0 * (w * y - x * z), math.hypot(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


@kernel
def heading(yaw: float) -> Array:
    """Rotation (3, 3) of (surge, sway, yaw moment) along the heading to (x, y, yaw moment) in e."""
    c, s = math.cos(yaw), math.sin(yaw)
    rotation = np.eye(3)
    rotation[0, 0] = rotation[1, 1] = c
    rotation[0, 1], rotation[1, 0] = -s, s
    return rotation


@kernel
def along_heading(yaw: float, x: Array) -> Array:
    """(surge, sway, yaw moment) along the heading of x (3,), (x, y, yaw moment) in e."""
    return apply(heading(-yaw), x)
