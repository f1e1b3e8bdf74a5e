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

Variations, in the mid frame, from nu = R_m^T delta d and the mean spin beta and spin difference mu of the ends (relative_rotation.py):
delta u = nu + u x beta_m. A function f(u, psi) with gradients n, q so has the conjugate vectors n, c = n x u, m = A^-1 q + b psi x c of
(nu, beta, mu): its row of nine, turned to e. The sag also turns with the frame, d(R_m^T e3) = R_m^T e3 x beta_m, which adds to c.
"""

import math

from .compiled import inner
from .relative_rotation import chi_of, half_spin
from .so3 import add, apply, apply_transposed, conjugate, cross, dot, log, matrix, multiply, root, scale

STRAINS = 6
ROWS = 7
COIL = 1.0 / 24.0  # of the chord of a line bent and twisted at once


@inner
def frame(q1, q2, d):
    """Mid frame (rows of R_m), chord in it and relative rotation vector: (rm, u, psi)."""
    relative = multiply(conjugate(q1), q2)
    rm = matrix(multiply(q1, root(relative)))
    return rm, apply_transposed(rm, d), log(relative)


@inner
def chord_shear(u, psi, h):
    """(g_2, g_3): shear of the chord, less what coiling does."""
    coil = COIL * psi[0] * u[0]
    return (u[1] - coil * psi[1]) / h, (u[2] - coil * psi[2]) / h


@inner
def strains(rm, u, psi, h, share, out):
    """Strains 0-5 and the sag 6 of one element into `out` (7,); `share` (2,) holds p_2, p_3."""
    z = dot(psi, psi)
    chi = chi_of(z)[0]
    rho = 1.0 + z * chi
    along = dot(psi, u)
    length = math.sqrt(rho * rho * dot(u, u) - chi * (rho + 1.0) * along * along)
    g2, g3 = chord_shear(u, psi, h)
    p2, p3 = share[0], share[1]
    out[0] = (length - h) / h + 0.1 * (p2 * p2 * g2 * g2 + p3 * p3 * g3 * g3)
    out[1] = g2
    out[2] = g3
    out[3] = (psi[0] + p2 * psi[1] * g2 + p3 * psi[2] * g3) / h
    out[4] = (psi[1] - p2 * psi[0] * g2) / h
    out[5] = (psi[2] - p3 * psi[0] * g3) / h
    out[6] = 0.5 * dot(rm[2], cross(u, psi))


@inner
def _stretch(u, psi, chi, chi1):
    """Length of the centreline, and half the gradients of its square by u and psi."""
    z, along, x = dot(psi, psi), dot(psi, u), dot(u, u)
    rho, rho1 = 1.0 + z * chi, chi + z * chi1
    big_g = chi * (rho + 1.0)
    spread = 2.0 * rho * rho1 * x - (chi1 * (rho + 1.0) + chi * rho1) * along * along
    half_u = add(scale(rho * rho, u), scale(-big_g * along, psi))
    return math.sqrt(rho * rho * x - big_g * along * along), half_u, add(scale(spread, psi), scale(-big_g * along, u))


@inner
def _put(row, rm, n, q, c, psi, chi, b):
    """Row of nine (e components) of a function with gradients n, q and frame moment c."""
    rho = 1.0 + dot(psi, psi) * chi
    m = add(add(scale(rho, q), scale(-chi * dot(psi, q), psi)), scale(b, cross(psi, c)))
    f, c_e, m_e = apply(rm, n), apply(rm, c), apply(rm, m)
    row[0], row[1], row[2] = f
    row[3], row[4], row[5] = c_e
    row[6], row[7], row[8] = m_e


@inner
def gradients(rm, u, psi, h, share, out):
    """Rows of nine of the strains and the sag with respect to (d, mean spin, spin difference) into `out` (7, 9), e components."""
    z = dot(psi, psi)
    chi, chi1, _ = chi_of(z)
    b = half_spin(z)[0]
    length, half_u, half_psi = _stretch(u, psi, chi, chi1)
    p2, p3 = share[0], share[1]
    g2, g3 = chord_shear(u, psi, h)
    turn, push = -COIL * u[0] / h, -COIL * psi[0] / h
    n2, q2 = (push * psi[1], 1.0 / h, 0.0), (turn * psi[1], turn * psi[0], 0.0)
    n3, q3 = (push * psi[2], 0.0, 1.0 / h), (turn * psi[2], 0.0, turn * psi[0])
    _put(out[1], rm, n2, q2, cross(n2, u), psi, chi, b)
    _put(out[2], rm, n3, q3, cross(n3, u), psi, chi, b)
    k = 1.0 / (h * length)
    n = add(scale(k, half_u), add(scale(0.2 * p2 * p2 * g2, n2), scale(0.2 * p3 * p3 * g3, n3)))
    q = add(scale(k, half_psi), add(scale(0.2 * p2 * p2 * g2, q2), scale(0.2 * p3 * p3 * g3, q3)))
    _put(out[0], rm, n, q, cross(n, u), psi, chi, b)
    n = add(scale(p2 * psi[1] / h, n2), scale(p3 * psi[2] / h, n3))
    q = add(scale(p2 * psi[1] / h, q2), scale(p3 * psi[2] / h, q3))
    q = add(q, (1.0 / h, p2 * g2 / h, p3 * g3 / h))
    _put(out[3], rm, n, q, cross(n, u), psi, chi, b)
    n, q = scale(-p2 * psi[0] / h, n2), add(scale(-p2 * psi[0] / h, q2), (-p2 * g2 / h, 1.0 / h, 0.0))
    _put(out[4], rm, n, q, cross(n, u), psi, chi, b)
    n, q = scale(-p3 * psi[0] / h, n3), add(scale(-p3 * psi[0] / h, q3), (-p3 * g3 / h, 0.0, 1.0 / h))
    _put(out[5], rm, n, q, cross(n, u), psi, chi, b)
    down = rm[2]
    n = scale(0.5, cross(psi, down))
    c = add(cross(n, u), scale(0.5, cross(cross(u, psi), down)))
    _put(out[6], rm, n, scale(0.5, cross(down, u)), c, psi, chi, b)


@inner
def shear_force(g2, g3, psi, h, share, stress):
    """What is conjugate to w: the chord's shear force over h, with the parts of extension, twist and bending that go with it."""
    p2, p3 = share[0], share[1]
    n2 = stress[1] + 0.2 * stress[0] * p2 * p2 * g2 + p2 * (stress[3] * psi[1] - stress[4] * psi[0]) / h
    n3 = stress[2] + 0.2 * stress[0] * p3 * p3 * g3 + p3 * (stress[3] * psi[2] - stress[5] * psi[0]) / h
    return (0.0, n2 / h, n3 / h)


@inner
def conjugate_vectors(down, u, psi, h, share, stress, chi, chi1):
    """(n, q, c) of the function `stress` (7,) . (strains and sag); `down` = R_m^T e3."""
    p2, p3 = share[0], share[1]
    s3, s4, s5, s6 = stress[3], stress[4], stress[5], 0.5 * stress[6]
    length, half_u, half_psi = _stretch(u, psi, chi, chi1)
    arc = stress[0] / (h * length)
    g2, g3 = chord_shear(u, psi, h)
    shear = shear_force(g2, g3, psi, h, share, stress)
    bent = dot(shear, psi)
    n = add(scale(arc, half_u), scale(s6, cross(psi, down)))
    n = add(n, (-COIL * psi[0] * bent, shear[1], shear[2]))
    q = add(scale(arc, half_psi), scale(s6, cross(down, u)))
    q = add(q, ((s3 - p2 * g2 * s4 - p3 * g3 * s5) / h, (s3 * p2 * g2 + s4) / h, (s3 * p3 * g3 + s5) / h))
    q = add(q, scale(-COIL * u[0], (bent, psi[0] * shear[1], psi[0] * shear[2])))
    return n, q, add(cross(n, u), scale(s6, cross(cross(u, psi), down)))


@inner
def resultant(rm, u, psi, h, share, stress, out):
    """`stress` (7,) . gradients into `out` (9,), e components: force on the chord, moments on the mean spin and the spin difference."""
    z = dot(psi, psi)
    chi, chi1, _ = chi_of(z)
    n, q, c = conjugate_vectors(rm[2], u, psi, h, share, stress, chi, chi1)
    _put(out, rm, n, q, c, psi, chi, half_spin(z)[0])
