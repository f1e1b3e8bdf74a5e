"""Geometric stiffness of the element (element/strains.py): the derivative of its forces at fixed section forces, exact.

Along every one of the nine (chord, mean spin, spin difference) in turn the changes of u, psi and R_m^T e3 are found first, from them those
of the conjugate vectors n, q, c and m, and last their turning with the mid frame. Unsymmetric where the element is not in equilibrium.
"""

import math

from ..compiled import inner
from ..maths.relative_rotation import chi_of, half_spin
from ..maths.so3 import add, apply, cross, dot, scale
from .strains import COIL, barrier, chord_shear, conjugate_vectors, shear_force


@inner
def _extent(u, psi, chi, chi1, chi2):
    """Of the centreline's length l: (P, P', G, G'), psi.u, first and half second derivative of l^2 by |psi|^2, l, its half gradients."""
    z, along, x = dot(psi, psi), dot(psi, u), dot(u, u)
    rho, rho1, rho2 = 1.0 + z * chi, chi + z * chi1, 2.0 * chi1 + z * chi2
    big_p, big_p1, big_p2 = rho * rho, 2.0 * rho * rho1, 2.0 * (rho1 * rho1 + rho * rho2)
    big_g = chi * (rho + 1.0)
    big_g1 = chi1 * (rho + 1.0) + chi * rho1
    big_g2 = chi2 * (rho + 1.0) + 2.0 * chi1 * rho1 + chi * rho2
    y = along * along
    spread, curve = big_p1 * x - big_g1 * y, big_p2 * x - big_g2 * y
    half_u = add(scale(big_p, u), scale(-big_g * along, psi))
    half_psi = add(scale(spread, psi), scale(-big_g * along, u))
    return (big_p, big_p1, big_g, big_g1), along, (spread, curve), math.sqrt(big_p * x - big_g * y), half_u, half_psi


@inner
def _stretched(extent, u, psi, d_u, d_psi):
    """Changes of the half gradients of l^2 by u and psi, over l."""
    (big_p, big_p1, big_g, big_g1), along, (spread, curve), length, half_u, half_psi = extent
    turned = dot(psi, d_psi)
    d_along = dot(psi, d_u) + dot(u, d_psi)
    d_length = (dot(half_u, d_u) + dot(half_psi, d_psi)) / length
    lost = -big_g * d_along - 2.0 * big_g1 * turned * along
    d_spread = 2.0 * (curve * turned + big_p1 * dot(u, d_u) - big_g1 * along * d_along)
    d_half_u = add(add(scale(big_p, d_u), scale(2.0 * big_p1 * turned, u)), add(scale(-big_g * along, d_psi), scale(lost, psi)))
    d_half_psi = add(add(scale(spread, d_psi), scale(d_spread, psi)), add(scale(-big_g * along, d_u), scale(lost, u)))
    less = -d_length / length
    return add(d_half_u, scale(less, half_u)), add(d_half_psi, scale(less, half_psi))


@inner
def _turned(u, f, f_u, d_u):
    """Changes of the barrier f and of its gradient."""
    x = dot(u, u)
    longer = dot(u, d_u)
    d_f = dot(f_u, d_u)
    k = 0.5 * f * f / (x * math.sqrt(x))
    d_bow = add(add(scale(d_u[0], u), scale(u[0], d_u)), (-2.0 * longer, 0.0, 0.0))
    return d_f, add(scale(2.0 * d_f / f - 3.0 * longer / x, f_u), scale(k, d_bow))


@inner
def _sheared(u, psi, h, share, stress, s2, s3, f, d_f, shear, bent, d_u, d_psi):
    """Changes of the parts of n and q that shear, twist and bending make, and of what is conjugate to f."""
    p2, p3 = share[0], share[1]
    t0, t3, t4, t5 = 0.2 * stress[0], stress[3], stress[4], stress[5]
    coil, d_coil = COIL * psi[0] * u[0], COIL * (d_psi[0] * u[0] + psi[0] * d_u[0])
    d_s2 = (d_u[1] - d_coil * psi[1] - coil * d_psi[1]) / h
    d_s3 = (d_u[2] - d_coil * psi[2] - coil * d_psi[2]) / h
    across2, across3 = stress[1] + t0 * p2 * p2 * s2, stress[2] + t0 * p3 * p3 * s3
    d_shear = (
        0.0,
        (d_f * across2 + f * t0 * p2 * p2 * d_s2 + p2 * (t3 * d_psi[1] - t4 * d_psi[0]) / h) / h,
        (d_f * across3 + f * t0 * p3 * p3 * d_s3 + p3 * (t3 * d_psi[2] - t5 * d_psi[0]) / h) / h,
    )
    d_bent = dot(d_shear, psi) + dot(shear, d_psi)
    d_turn = (
        COIL * (d_u[0] * bent + u[0] * d_bent),
        d_coil * shear[1] + coil * d_shear[1],
        d_coil * shear[2] + coil * d_shear[2],
    )
    d_q = (-(t4 * p2 * d_s2 + t5 * p3 * d_s3) / h, t3 * p2 * d_s2 / h, t3 * p3 * d_s3 / h)
    d_n = (-COIL * (d_psi[0] * bent + psi[0] * d_bent), d_shear[1], d_shear[2])
    return d_n, add(d_q, scale(-1.0, d_turn)), across2 * d_s2 + across3 * d_s3


@inner
def geometric_stiffness(rm, u, psi, h, share, stress, out):
    """Derivative of `stress` (7,) . gradients at fixed stress into `out` (9, 9), e components."""
    z = dot(psi, psi)
    chi, chi1, chi2 = chi_of(z)
    b, b1 = half_spin(z)
    rho, rho1 = 1.0 + z * chi, chi + z * chi1
    down, sagging, s6 = rm[2], cross(u, psi), 0.5 * stress[6]
    n, q, c = conjugate_vectors(down, u, psi, h, share, stress, chi, chi1)
    extent = _extent(u, psi, chi, chi1, chi2)
    arc = stress[0] / (h * extent[3])
    s2, s3 = chord_shear(u, psi, h)
    f, f_u = barrier(u)
    shear, turning = shear_force(s2, s3, f, psi, h, share, stress)
    bent = dot(shear, psi)
    psi_q = dot(psi, q)
    m = add(add(scale(rho, q), scale(-chi * psi_q, psi)), scale(b, cross(psi, c)))
    for j in range(9):
        unit = (1.0 if j % 3 == 0 else 0.0, 1.0 if j % 3 == 1 else 0.0, 1.0 if j % 3 == 2 else 0.0)
        zero = (0.0, 0.0, 0.0)
        nu = unit if j < 3 else zero
        beta = unit if 3 <= j < 6 else zero
        mu = unit if j >= 6 else zero
        spin = add(beta, scale(-b, cross(psi, mu)))
        d_psi = add(scale(rho, mu), scale(-chi * dot(psi, mu), psi))
        d_u = add(nu, cross(u, spin))
        d_down = cross(down, spin)
        turned = dot(psi, d_psi)
        stretched_u, stretched_psi = _stretched(extent, u, psi, d_u, d_psi)
        d_f, d_f_u = _turned(u, f, f_u, d_u)
        sheared_n, sheared_q, d_turning = _sheared(u, psi, h, share, stress, s2, s3, f, d_f, shear, bent, d_u, d_psi)
        sheared_n = add(sheared_n, add(scale(turning, d_f_u), scale(d_turning, f_u)))
        d_n = add(add(scale(arc, stretched_u), scale(s6, add(cross(d_psi, down), cross(psi, d_down)))), sheared_n)
        d_q = add(add(scale(arc, stretched_psi), scale(s6, add(cross(d_down, u), cross(down, d_u)))), sheared_q)
        d_c = add(cross(d_n, u), cross(n, d_u))
        d_sagging = add(cross(d_u, psi), cross(u, d_psi))
        d_c = add(d_c, scale(s6, add(cross(d_sagging, down), cross(sagging, d_down))))
        d_m = add(add(scale(rho, d_q), scale(2.0 * rho1 * turned, q)), scale(-chi * psi_q, d_psi))
        d_m = add(d_m, scale(-2.0 * chi1 * turned * psi_q - chi * (dot(psi, d_q) + dot(d_psi, q)), psi))
        d_m = add(d_m, add(scale(b, add(cross(psi, d_c), cross(d_psi, c))), scale(2.0 * b1 * turned, cross(psi, c))))
        rows = (add(d_n, cross(spin, n)), add(d_c, cross(spin, c)), add(d_m, cross(spin, m)))
        for i in range(3):
            out[3 * i, j], out[3 * i + 1, j], out[3 * i + 2, j] = apply(rm, rows[i])
    for i in range(9):
        for k in range(0, 9, 3):
            out[i, k], out[i, k + 1], out[i, k + 2] = apply(rm, (out[i, k], out[i, k + 1], out[i, k + 2]))
