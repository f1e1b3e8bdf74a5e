"""Spins of the ends of an element and the rotation vector psi between them, R_1^T R_2 = exp(psi), all seen from the frame half way.

With theta_1, theta_2 the spatial spins of the ends, beta their mean and mu = theta_2 - theta_1 their difference, both in that frame,

    delta psi = A^-1 mu,   A^-1 = rho I - chi psi psi^T,   rho = a / sin a,   chi = (rho - 1) / |psi|^2,   a = |psi| / 2,
    beta_m = beta - b psi x mu,   b = tan(a / 2) / (4 a),

beta_m the spin of the frame half way. Functions of an angle are taken from its square z: by their power series up to a bound, else in
closed form. Either way they and their first derivatives are good to 1e-11, the second, which only tangents take, to 1e-8.
"""

import math

from ..compiled import inner
from ..simd.lanes import below, lane_by_lane
from .so3 import add, cross, dot, scale

_BENT, _TURNED = 0.36, 0.04  # bounds of |psi|^2 below which series are used


@inner
def _chi_series(z):
    c0, c1, c2, c3 = 1.0 / 24.0, 7.0 / 5760.0, 31.0 / 967680.0, 127.0 / 154828800.0
    c4, c5, c6 = 73.0 / 3503554560.0, 5.281589e-10, 1.338096e-11
    chi = c0 + z * (c1 + z * (c2 + z * (c3 + z * (c4 + z * (c5 + z * c6)))))
    d1 = c1 + z * (2.0 * c2 + z * (3.0 * c3 + z * (4.0 * c4 + z * (5.0 * c5 + z * 6.0 * c6))))
    d2 = 2.0 * c2 + z * (6.0 * c3 + z * (12.0 * c4 + z * (20.0 * c5 + z * 30.0 * c6)))
    return chi, d1, d2


@lane_by_lane
@inner
def _chi_closed(z):
    if z < _BENT:
        return _chi_series(z)
    a = 0.5 * math.sqrt(z)
    s, c = math.sin(a), math.cos(a)
    rho = a / s
    rho_a = 1.0 / s - a * c / s**2
    rho_aa = a / s - 2.0 * c / s**2 + 2.0 * a * c * c / s**3
    chi = (rho - 1.0) / z
    d1 = (rho_a / (8.0 * a) - chi) / z
    d2 = ((rho_aa - rho_a / a) / (64.0 * a * a) - 2.0 * d1) / z
    return chi, d1, d2


@inner
def chi_of(z):
    """chi = (rho - 1) / z and its first two derivatives, rho = a / sin a, z = |psi|^2 = 4 a^2."""
    return _chi_series(z) if below(z, _BENT) else _chi_closed(z)


@inner
def _half_spin_series(z):
    b = 0.125 + z * (1.0 / 384.0 + z * (1.0 / 15360.0 + z * (17.0 / 10321920.0 + z * 31.0 / 743178240.0)))
    return b, 1.0 / 384.0 + z * (2.0 / 15360.0 + z * (51.0 / 10321920.0 + z * 124.0 / 743178240.0))


@lane_by_lane
@inner
def _half_spin_closed(z):
    if z < _TURNED:
        return _half_spin_series(z)
    a = 0.5 * math.sqrt(z)
    t = math.tan(0.5 * a)
    return t / (4.0 * a), (0.5 * (1.0 + t * t) / (4.0 * a) - t / (4.0 * a * a)) / (8.0 * a)


@inner
def half_spin(z):
    """b = tan(a / 2) / (4 a) and its derivative with respect to z = 4 a^2."""
    return _half_spin_series(z) if below(z, _TURNED) else _half_spin_closed(z)


@inner
def mid_spin(psi, beta, mu):
    """Spin beta_m of the mid frame under the mean spin beta and the spin difference mu, all in the same frame."""
    return add(beta, scale(-half_spin(dot(psi, psi))[0], cross(psi, mu)))


@inner
def relative_turn(psi, mu):
    """A^-1 mu: change of psi, seen from the mid frame, under the spin difference mu, all in the same frame."""
    z = dot(psi, psi)
    chi = chi_of(z)[0]
    return add(scale(1.0 + z * chi, mu), scale(-chi * dot(psi, mu), psi))
