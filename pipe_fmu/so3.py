"""Rotations as unit quaternions (scalar first) and vectors as tuples of three floats.

All functions are compiled, take and return tuples, and allocate nothing. `exp` and `log` are the exponential map of
SO(3) and its inverse (rotation vectors); `left_jacobian` is the matrix J_l of `exp(J_l(theta) d) exp(theta) =
exp(theta + d)` to first order in d. Source: Crisfield and Jelenic (1999), section 2; Sola (2017), chapter 4.
"""

import math

from .compiled import inner

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@inner
def add(a, b):
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inner
def scale(s, a):
    """A number times a vector."""
    return (s * a[0], s * a[1], s * a[2])


@inner
def dot(a, b):
    """Inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def cross(a, b):
    """Vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inner
def multiply(p, q):
    """Product of two quaternions: first q, then p."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@inner
def conjugate(q):
    """Inverse of a unit quaternion."""
    return (q[0], -q[1], -q[2], -q[3])


@inner
def exp(theta):
    """Quaternion of a rotation vector [rad]."""
    half = 0.5 * math.sqrt(dot(theta, theta))
    if half < 1e-4:
        k = 0.5 - half * half / 12.0
        c = 1.0 - 0.5 * half * half
    else:
        k = 0.5 * math.sin(half) / half
        c = math.cos(half)
    return (c, k * theta[0], k * theta[1], k * theta[2])


@inner
def log(q):
    """Rotation vector [rad], at most pi long, of a unit quaternion."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    s = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    k = 2.0 * sign * (1.0 + s * s / 6.0) if s < 1e-5 else 2.0 * math.atan2(s, sign * q[0]) / s * sign
    return (k * q[1], k * q[2], k * q[3])


@inner
def root(q):
    """Half of the rotation q: the quaternion of `log(q) / 2`."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    w = 1.0 + sign * q[0]
    n = 1.0 / math.sqrt(w * w + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (w * n, sign * q[1] * n, sign * q[2] * n, sign * q[3] * n)


@inner
def normalize(q):
    """Quaternion scaled to unit length."""
    n = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] * n, q[1] * n, q[2] * n, q[3] * n)


@inner
def matrix(q):
    """Rotation matrix of a unit quaternion as three rows."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@inner
def apply(m, v):
    """Matrix (three rows) times vector."""
    return (dot(m[0], v), dot(m[1], v), dot(m[2], v))


@inner
def apply_transposed(m, v):
    """Transposed matrix (three rows) times vector."""
    return (
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    )


@inner
def left_jacobian_transposed(theta, v):
    """J_l(theta)^T v, J_l the left Jacobian of the exponential map."""
    z = dot(theta, theta)
    if z < 1e-6:
        b = 0.5 - z / 24.0
        c = 1.0 / 6.0 - z / 120.0
    else:
        t = math.sqrt(z)
        b = (1.0 - math.cos(t)) / z
        c = (t - math.sin(t)) / (z * t)
    w = cross(theta, v)
    return add(v, add(scale(-b, w), scale(c, cross(theta, w))))
