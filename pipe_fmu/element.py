"""Two-node Simo-Reissner element on SE(3), fourth-order accurate at the nodes.

Kinematics, eqs. (11), (17). With the chord d = phi_2 - phi_1, the relative rotation R_1^T R_2 = exp(psi) and the frame
R_m = R_1 exp(psi / 2) half way between the ends, everything the element feels is a function of

    u = R_m^T d,    psi                                                              (invariant under rigid motions)

Strains (the order of the rows of `stiffness` and of the gradients):

    0  e   = length of the element's centreline / h - 1     extension, eq. (17)
    1  g_2 = w_2 / h,   2  g_3 = w_3 / h                    shear of the chord against the mid frame, w = u - psi_1 u_1 psi / 24
    3  k_1 = (psi_1 + p_2 psi_2 g_2 + p_3 psi_3 g_3) / h    twist
    4  k_2 = (psi_2 - p_2 psi_1 g_2) / h,   5  k_3 = (psi_3 - p_3 psi_1 g_3) / h     bending
    6  c_z = e3 . (d x R_m psi) / 2                         sag of the arc below the chord (loads, not strain)

For a constant strain the centreline is a helix (log of the relative frame on SE(3)) whose length is
l^2 = P |u|^2 - G (psi.u)^2, P = rho^2, G = (P - 1) / |psi|^2, rho = a / sin a, a = |psi| / 2; bent and
twisted at once, its chord leaves the mid frame by psi_1 psi / 24 (to third order), which is no shear. A bending moment that varies
over the element (shear force Q, kappa' = Q / EI) bends it to an S: the chord leaves the mid frame by h^2 kappa' / 12, the
centreline grows by a tenth of that angle squared, and the log loses h^2 / 12 kappa x kappa' (second term of the Magnus series), which
k_1, k_2, k_3 give back. So the chord's shear flexibility is 1/K = 1/GA + h^2 / (12 EI), p = (h^2 / 12 EI) K is the share that is bending,
and the energy h/2 (EA e^2 + K g^2 + GJ k_1^2 + EI k^2) is that of the bar with linearly varying moment. Departures from
the plain law (20): the extension is measured along the centreline, not along t_1; they differ by g^2/2, g the physical shear
strain (1e-10 in a pipe). The reward is fourth order with two nodes under any forces and torque, no shear locking, and a tension that
never shears the section away, however long the element. Only where EI_2 and EI_3 differ, and the line is bent about both axes at once, does
the twist vary within an element, and the order is two. (Residual bending flexibility: MacNeal 1978; SE(3) element: Sonneville et al. 2014.)

Variations, in the mid frame, from nu = R_m^T delta d, beta = R_m^T (theta_1 + theta_2) / 2, mu = R_m^T (theta_2 - theta_1), theta_i
the spatial spins: delta psi = A^-1 mu with A^-1 = rho I - chi psi psi^T, chi = (rho - 1) / |psi|^2; spin of the mid frame
beta_m = beta - b psi x mu, b = tan(a / 2) / (4 a); delta u = nu + u x beta_m. A function f(u, psi) with gradients N, Q so has the
conjugate vectors N, c = N x u, M = A^-1 Q + b psi x c of (nu, beta, mu): its row of nine, turned to e.
"""

import math

from .compiled import inner
from .lanes import below, lane_by_lane
from .so3 import add, apply, apply_transposed, conjugate, cross, dot, log, matrix, multiply, root, scale

STRAINS = 6
ROWS = 7
_COIL = 1.0 / 24.0  # of the chord of a line bent and twisted at once
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
def _chi(z):
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
def _half_spin(z):
    """b = tan(a / 2) / (4 a) and its derivative with respect to z = 4 a^2."""
    return _half_spin_series(z) if below(z, _TURNED) else _half_spin_closed(z)


@inner
def mid_spin(psi, beta, mu):
    """Spin beta_m of the mid frame under the mean spin beta and the spin difference mu, all in the same frame."""
    return add(beta, scale(-_half_spin(dot(psi, psi))[0], cross(psi, mu)))


@inner
def relative_turn(psi, mu):
    """A^-1 mu: change of psi, seen from the mid frame, under the spin difference mu, all in the same frame."""
    z = dot(psi, psi)
    chi = _chi(z)[0]
    return add(scale(1.0 + z * chi, mu), scale(-chi * dot(psi, mu), psi))


@inner
def frame(q1, q2, d):
    """Mid frame (rows of R_m), chord in it and relative rotation vector: (rm, u, psi)."""
    relative = multiply(conjugate(q1), q2)
    rm = matrix(multiply(q1, root(relative)))
    return rm, apply_transposed(rm, d), log(relative)


@inner
def strains(rm, u, psi, h, share, out):
    """Strains 0-5 and the sag 6 of one element into `out` (7,); `share` (2,) holds p_2, p_3."""
    z = dot(psi, psi)
    chi = _chi(z)[0]
    rho = 1.0 + z * chi
    along = dot(psi, u)
    length = math.sqrt(rho * rho * dot(u, u) - chi * (rho + 1.0) * along * along)
    coil = _COIL * psi[0] * u[0]
    g2, g3 = (u[1] - coil * psi[1]) / h, (u[2] - coil * psi[2]) / h
    p2, p3 = share[0], share[1]
    out[0] = (length - h) / h + 0.1 * (p2 * p2 * g2 * g2 + p3 * p3 * g3 * g3)
    out[1] = g2
    out[2] = g3
    out[3] = (psi[0] + p2 * psi[1] * g2 + p3 * psi[2] * g3) / h
    out[4] = (psi[1] - p2 * psi[0] * g2) / h
    out[5] = (psi[2] - p3 * psi[0] * g3) / h
    out[6] = 0.5 * dot(rm[2], cross(u, psi))


@inner
def _put(row, rm, n, q, c, psi, rho, chi, b):
    """Row of nine (e components) of a function with gradients n, q and frame moment c."""
    m = add(add(scale(rho, q), scale(-chi * dot(psi, q), psi)), scale(b, cross(psi, c)))
    f, c_e, m_e = apply(rm, n), apply(rm, c), apply(rm, m)
    row[0], row[1], row[2] = f
    row[3], row[4], row[5] = c_e
    row[6], row[7], row[8] = m_e


@inner
def gradients(rm, u, psi, h, share, out):
    """Rows of nine of the strains and the sag with respect to (d, mean spin, spin difference) into `out` (7, 9), e components."""
    z = dot(psi, psi)
    chi, chi1, _ = _chi(z)
    b = _half_spin(z)[0]
    rho = 1.0 + z * chi
    rho1 = chi + z * chi1
    big_g = chi * (rho + 1.0)
    big_g1 = chi1 * (rho + 1.0) + chi * rho1
    along = dot(psi, u)
    x = dot(u, u)
    length = math.sqrt(rho * rho * x - big_g * along * along)
    p2, p3 = share[0], share[1]

    coil = _COIL * psi[0] * u[0]
    g2, g3 = (u[1] - coil * psi[1]) / h, (u[2] - coil * psi[2]) / h
    turn, push = -_COIL * u[0] / h, -_COIL * psi[0] / h
    n2, q2 = (push * psi[1], 1.0 / h, 0.0), (turn * psi[1], turn * psi[0], 0.0)
    n3, q3 = (push * psi[2], 0.0, 1.0 / h), (turn * psi[2], 0.0, turn * psi[0])
    _put(out[1], rm, n2, q2, cross(n2, u), psi, rho, chi, b)
    _put(out[2], rm, n3, q3, cross(n3, u), psi, rho, chi, b)

    k = 1.0 / (h * length)
    n = add(scale(k * rho * rho, u), scale(-k * big_g * along, psi))
    n = add(n, add(scale(0.2 * p2 * p2 * g2, n2), scale(0.2 * p3 * p3 * g3, n3)))
    q = add(scale(k * (2.0 * rho * rho1 * x - big_g1 * along * along), psi), scale(-k * big_g * along, u))
    q = add(q, add(scale(0.2 * p2 * p2 * g2, q2), scale(0.2 * p3 * p3 * g3, q3)))
    _put(out[0], rm, n, q, cross(n, u), psi, rho, chi, b)
    n = add(scale(p2 * psi[1] / h, n2), scale(p3 * psi[2] / h, n3))
    q = add(scale(p2 * psi[1] / h, q2), scale(p3 * psi[2] / h, q3))
    q = add(q, (1.0 / h, p2 * g2 / h, p3 * g3 / h))
    _put(out[3], rm, n, q, cross(n, u), psi, rho, chi, b)
    n, q = scale(-p2 * psi[0] / h, n2), add(scale(-p2 * psi[0] / h, q2), (-p2 * g2 / h, 1.0 / h, 0.0))
    _put(out[4], rm, n, q, cross(n, u), psi, rho, chi, b)
    n, q = scale(-p3 * psi[0] / h, n3), add(scale(-p3 * psi[0] / h, q3), (-p3 * g3 / h, 0.0, 1.0 / h))
    _put(out[5], rm, n, q, cross(n, u), psi, rho, chi, b)
    down = rm[2]
    n = scale(0.5, cross(psi, down))
    c = add(cross(n, u), scale(0.5, cross(cross(u, psi), down)))
    _put(out[6], rm, n, scale(0.5, cross(down, u)), c, psi, rho, chi, b)


@inner
def _shear(g2, g3, psi, h, p2, p3, stress):
    """What is conjugate to w: the chord's shear force over h, with the parts of extension, twist and bending that go with it."""
    n2 = stress[1] + 0.2 * stress[0] * p2 * p2 * g2 + p2 * (stress[3] * psi[1] - stress[4] * psi[0]) / h
    n3 = stress[2] + 0.2 * stress[0] * p3 * p3 * g3 + p3 * (stress[3] * psi[2] - stress[5] * psi[0]) / h
    return (0.0, n2 / h, n3 / h)


@inner
def resultant(rm, u, psi, h, share, stress, out):
    """`stress` (7,) . gradients into `out` (9,), e components: force on the chord, moments on the mean spin and the spin difference."""
    z = dot(psi, psi)
    chi, chi1, _ = _chi(z)
    rho = 1.0 + z * chi
    rho1 = chi + z * chi1
    big_g = chi * (rho + 1.0)
    big_g1 = chi1 * (rho + 1.0) + chi * rho1
    along, x = dot(psi, u), dot(u, u)
    length = math.sqrt(rho * rho * x - big_g * along * along)
    p2, p3 = share[0], share[1]
    s0, s3, s4, s5, s6 = stress[0], stress[3], stress[4], stress[5], 0.5 * stress[6]
    arc = s0 / (h * length)
    down = rm[2]
    coil = _COIL * psi[0] * u[0]
    g2, g3 = (u[1] - coil * psi[1]) / h, (u[2] - coil * psi[2]) / h
    shear = _shear(g2, g3, psi, h, p2, p3, stress)
    bent = dot(shear, psi)
    n = add(scale(arc * rho * rho, u), scale(-arc * big_g * along, psi))
    n = add(n, scale(s6, cross(psi, down)))
    n = add(n, (-_COIL * psi[0] * bent, shear[1], shear[2]))
    q = add(scale(arc * (2.0 * rho * rho1 * x - big_g1 * along * along), psi), scale(-arc * big_g * along, u))
    q = add(q, scale(s6, cross(down, u)))
    q = add(q, ((s3 - p2 * g2 * s4 - p3 * g3 * s5) / h, (s3 * p2 * g2 + s4) / h, (s3 * p3 * g3 + s5) / h))
    q = add(q, scale(-_COIL * u[0], (bent, psi[0] * shear[1], psi[0] * shear[2])))
    c = add(cross(n, u), scale(s6, cross(cross(u, psi), down)))
    _put(out, rm, n, q, c, psi, rho, chi, _half_spin(z)[0])


@inner
def geometric_stiffness(rm, u, psi, h, share, stress, out):
    """Derivative of `stress` (7,) . gradients at fixed stress into `out` (9, 9), e components; exact, unsymmetric off equilibrium."""
    z = dot(psi, psi)
    chi, chi1, chi2 = _chi(z)
    b, b1 = _half_spin(z)
    rho = 1.0 + z * chi
    rho1 = chi + z * chi1
    rho2 = 2.0 * chi1 + z * chi2
    big_p, big_p1, big_p2 = rho * rho, 2.0 * rho * rho1, 2.0 * (rho1 * rho1 + rho * rho2)
    big_g = chi * (rho + 1.0)
    big_g1 = chi1 * (rho + 1.0) + chi * rho1
    big_g2 = chi2 * (rho + 1.0) + 2.0 * chi1 * rho1 + chi * rho2
    along, x = dot(psi, u), dot(u, u)
    y = along * along
    length = math.sqrt(big_p * x - big_g * y)
    p2, p3 = share[0], share[1]
    s0, s3, s4, s5, s6 = stress[0], stress[3], stress[4], stress[5], 0.5 * stress[6]
    down = rm[2]
    coil = _COIL * psi[0] * u[0]
    g2, g3 = (u[1] - coil * psi[1]) / h, (u[2] - coil * psi[2]) / h
    shear = _shear(g2, g3, psi, h, p2, p3, stress)
    bent = dot(shear, psi)
    arc = s0 / (h * length)
    half_u = add(scale(big_p, u), scale(-big_g * along, psi))  # half the gradient of l^2
    spread = big_p1 * x - big_g1 * y
    half_psi = add(scale(spread, psi), scale(-big_g * along, u))
    n = add(scale(arc, half_u), scale(s6, cross(psi, down)))
    n = add(n, (-_COIL * psi[0] * bent, shear[1], shear[2]))
    q = add(scale(arc, half_psi), scale(s6, cross(down, u)))
    q = add(q, ((s3 - p2 * g2 * s4 - p3 * g3 * s5) / h, (s3 * p2 * g2 + s4) / h, (s3 * p3 * g3 + s5) / h))
    q = add(q, scale(-_COIL * u[0], (bent, psi[0] * shear[1], psi[0] * shear[2])))
    sagging = cross(u, psi)
    c = add(cross(n, u), scale(s6, cross(sagging, down)))
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
        psi_dpsi, psi_du, u_dpsi, u_du = dot(psi, d_psi), dot(psi, d_u), dot(u, d_psi), dot(u, d_u)
        d_along = psi_du + u_dpsi
        d_length = (dot(half_u, d_u) + dot(half_psi, d_psi)) / length
        d_half_u = add(scale(big_p, d_u), scale(2.0 * big_p1 * psi_dpsi, u))
        d_half_u = add(d_half_u, scale(-big_g * along, d_psi))
        d_half_u = add(d_half_u, scale(-big_g * d_along - 2.0 * big_g1 * psi_dpsi * along, psi))
        d_spread = 2.0 * (big_p2 * x - big_g2 * y) * psi_dpsi + 2.0 * big_p1 * u_du - 2.0 * big_g1 * along * d_along
        d_half_psi = add(scale(spread, d_psi), scale(d_spread, psi))
        d_half_psi = add(d_half_psi, scale(-big_g * along, d_u))
        d_half_psi = add(d_half_psi, scale(-big_g * d_along - 2.0 * big_g1 * psi_dpsi * along, u))
        d_n = add(scale(arc, d_half_u), scale(-arc * d_length / length, half_u))
        d_n = add(d_n, scale(s6, add(cross(d_psi, down), cross(psi, d_down))))
        d_coil = _COIL * (d_psi[0] * u[0] + psi[0] * d_u[0])
        d_g2 = (d_u[1] - d_coil * psi[1] - coil * d_psi[1]) / h
        d_g3 = (d_u[2] - d_coil * psi[2] - coil * d_psi[2]) / h
        d_shear = (
            0.0,
            (0.2 * s0 * p2 * p2 * d_g2 + p2 * (s3 * d_psi[1] - s4 * d_psi[0]) / h) / h,
            (0.2 * s0 * p3 * p3 * d_g3 + p3 * (s3 * d_psi[2] - s5 * d_psi[0]) / h) / h,
        )
        d_bent = dot(d_shear, psi) + dot(shear, d_psi)
        d_n = add(d_n, (-_COIL * (d_psi[0] * bent + psi[0] * d_bent), d_shear[1], d_shear[2]))
        d_q = add(scale(arc, d_half_psi), scale(-arc * d_length / length, half_psi))
        d_q = add(d_q, scale(s6, add(cross(d_down, u), cross(down, d_u))))
        d_q = add(d_q, (-(s4 * p2 * d_g2 + s5 * p3 * d_g3) / h, s3 * p2 * d_g2 / h, s3 * p3 * d_g3 / h))
        d_turn = (
            _COIL * (d_u[0] * bent + u[0] * d_bent),
            d_coil * shear[1] + coil * d_shear[1],
            d_coil * shear[2] + coil * d_shear[2],
        )
        d_q = add(d_q, scale(-1.0, d_turn))
        d_c = add(cross(d_n, u), cross(n, d_u))
        d_sagging = add(cross(d_u, psi), cross(u, d_psi))
        d_c = add(d_c, scale(s6, add(cross(d_sagging, down), cross(sagging, d_down))))
        d_m = add(scale(rho, d_q), scale(2.0 * rho1 * psi_dpsi, q))
        d_m = add(d_m, scale(-chi * psi_q, d_psi))
        d_m = add(d_m, scale(-2.0 * chi1 * psi_dpsi * psi_q - chi * (dot(psi, d_q) + dot(d_psi, q)), psi))
        d_m = add(d_m, add(scale(b, add(cross(psi, d_c), cross(d_psi, c))), scale(2.0 * b1 * psi_dpsi, cross(psi, c))))
        rows = (add(d_n, cross(spin, n)), add(d_c, cross(spin, c)), add(d_m, cross(spin, m)))
        for i in range(3):
            turned = apply(rm, rows[i])
            out[3 * i, j] = turned[0]
            out[3 * i + 1, j] = turned[1]
            out[3 * i + 2, j] = turned[2]
    for i in range(9):
        for j in range(3):
            k = 3 * j
            turned = apply(rm, (out[i, k], out[i, k + 1], out[i, k + 2]))
            out[i, k] = turned[0]
            out[i, k + 1] = turned[1]
            out[i, k + 2] = turned[2]
