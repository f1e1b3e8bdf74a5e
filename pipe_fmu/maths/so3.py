"""Rotations as unit quaternions (scalar first) and vectors as tuples of three floats.

All functions are compiled, take and return tuples, and allocate nothing; their numbers may be Lanes. `exp` and `log` are the
exponential map of SO(3) and its inverse (rotation vectors); `left_jacobian` is the matrix J_l of `exp(J_l(theta) d) exp(theta) =
exp(theta + d)` to first order in d. Source: Crisfield and Jelenic (1999), section 2; Sola (2017), chapter 4.

Functions of an angle are taken from its square z: by their power series up to a bound below which what is left out is round-off, else in
closed form.
"""

import math

from ..compiled import inner
from ..simd.lanes import below, lane_by_lane

_TURN = 0.25  # bound of z for sines
_ARC = 0.023  # and for the tangent's inverse, of its square

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@inner
def add(a, b):
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inner
def subtract(a, b):
    """Difference of two vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


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
def _cosine_series(z):
    return 1.0 - z / 2.0 * (1.0 - z / 12.0 * (1.0 - z / 30.0 * (1.0 - z / 56.0 * (1.0 - z / 90.0 * (1.0 - z / 132.0 * (1.0 - z / 182.0))))))


@inner
def _sine_series(z):
    return 1.0 - z / 6.0 * (1.0 - z / 20.0 * (1.0 - z / 42.0 * (1.0 - z / 72.0 * (1.0 - z / 110.0 * (1.0 - z / 156.0)))))


@lane_by_lane
@inner
def _cosine(z):
    """cos a, z = a^2."""
    return _cosine_series(z) if z < _TURN else math.cos(math.sqrt(z))


@lane_by_lane
@inner
def _sine(z):
    """sin a / a, z = a^2."""
    return _sine_series(z) if z < _TURN else math.sin(math.sqrt(z)) / math.sqrt(z)


@inner
def exp(theta):
    """Quaternion of a rotation vector [rad]."""
    z = 0.25 * dot(theta, theta)
    if below(z, _TURN):
        c, k = _cosine_series(z), 0.5 * _sine_series(z)
    else:
        c, k = _cosine(z), 0.5 * _sine(z)
    return (c, k * theta[0], k * theta[1], k * theta[2])


@inner
def _arc_series(z):
    out = 1.0 / 19.0
    for n in (17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0):
        out = 1.0 / n - z * out
    return out


@lane_by_lane
@inner
def _arc(z):
    """atan t / t, z = t^2."""
    return _arc_series(z) if z < _ARC else math.atan(math.sqrt(z)) / math.sqrt(z)


@inner
def log(q):
    """Rotation vector [rad], at most pi long, of a unit quaternion; its length is 4 atan of the tangent of a quarter of the angle."""
    k = 1.0 / (1.0 + math.fabs(q[0]))
    z = k * k * (q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    k *= math.copysign(4.0, q[0]) * (_arc_series(z) if below(z, _ARC) else _arc(z))
    return (k * q[1], k * q[2], k * q[3])


@inner
def root(q):
    """Half of the rotation q: the quaternion of `log(q) / 2`."""
    w = 1.0 + math.fabs(q[0])
    n = 1.0 / math.sqrt(w * w + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    k = math.copysign(n, q[0])
    return (w * n, k * q[1], k * q[2], k * q[3])


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
def _half_series(z):
    return 0.5 - z / 24.0 * (1.0 - z / 30.0 * (1.0 - z / 56.0 * (1.0 - z / 90.0 * (1.0 - z / 132.0 * (1.0 - z / 182.0)))))


@inner
def _sixth_series(z):
    return (1.0 - z / 20.0 * (1.0 - z / 42.0 * (1.0 - z / 72.0 * (1.0 - z / 110.0 * (1.0 - z / 156.0))))) / 6.0


@lane_by_lane
@inner
def _half(z):
    """(1 - cos a) / a^2, z = a^2."""
    return _half_series(z) if z < _TURN else (1.0 - math.cos(math.sqrt(z))) / z


@lane_by_lane
@inner
def _sixth(z):
    """(a - sin a) / a^3, z = a^2."""
    return _sixth_series(z) if z < _TURN else (1.0 - math.sin(math.sqrt(z)) / math.sqrt(z)) / z


@inner
def left_jacobian_transposed(theta, v):
    """J_l(theta)^T v, J_l the left Jacobian of the exponential map."""
    z = dot(theta, theta)
    if below(z, _TURN):
        b, c = _half_series(z), _sixth_series(z)
    else:
        b, c = _half(z), _sixth(z)
    w = cross(theta, v)
    return add(v, add(scale(-b, w), scale(c, cross(theta, w))))


@inner
def left_jacobian(theta):
    """J_l(theta), the left Jacobian of the exponential map, as three rows."""
    rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return (
        left_jacobian_transposed(theta, rows[0]),
        left_jacobian_transposed(theta, rows[1]),
        left_jacobian_transposed(theta, rows[2]),
    )
