"""Two-node Simo-Reissner element on SE(3), fourth-order accurate at the nodes.

Kinematics, eqs. (11), (17). With the chord d = phi_2 - phi_1, the relative rotation R_1^T R_2 = exp(psi) and the frame
R_m = R_1 exp(psi / 2) half way between the ends, everything the element feels is a function of

    u = R_m^T d,    psi                                                              (invariant under rigid motions)

Strains (the order of the rows of `stiffness` and of the gradients):

    0  e   = length of the element's centreline / h - 1     extension, eq. (17)
    1  g_2 = f s_2,   2  g_3 = f s_3                        shear of the chord against the mid frame, s = (u - psi_1 u_1 psi / 24) / h
    3  k_1 = (psi_1 + p_2 psi_2 s_2 + p_3 psi_3 s_3) / h    twist
    4  k_2 = (psi_2 - p_2 psi_1 s_2) / h,   5  k_3 = (psi_3 - p_3 psi_1 s_3) / h     bending
    6  c_z = e3 . (d x R_m psi) / 2                         sag of the arc below the chord (loads, not strain)

Where the chord stands at an angle a to t_1 of the mid frame, s is |u| / h times the sine of a and f = 2 |u| / (|u| + u_1), which is
1 / cos^2(a / 2), so that g is |u| / h times 2 tan(a / 2). They differ by a^3 / 4 to lowest order, but the sine falls beyond a right angle
and vanishes at a = pi, where the element is quite inside out; g grows with a, without bound at pi. Eq. (1), <d_S phi, R e1> > 0, is
broken from a right angle on, which `inverted` refuses.
The extension by bending takes f s^2 (that is 4 sin^2(a / 2)): it grows with a too, so that tension as well turns an element right side
out, and is bounded, so that no element can pay for its turning by shortening to a point. Twist and bending, corrected by little, take s.

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

Variations, in the mid frame, from nu = R_m^T delta d and the mean spin beta and spin difference mu of the ends (relative_rotation):
delta u = nu + u x beta_m. A function f(u, psi) with gradients n, q so has the conjugate vectors n, c = n x u, m = A^-1 q + b psi x c of
(nu, beta, mu): its row of nine, turned to e. The sag also turns with the frame, d(R_m^T e3) = R_m^T e3 x beta_m, which adds to c.
"""

import math

import numpy as np

from ..compiled import inner, kernel
from ..maths.relative_rotation import chi_of, half_spin
from ..maths.so3 import add, apply, apply_transposed, conjugate, cross, dot, log, matrix, multiply, root, scale
from ..simd.columns import attitude, chord

STRAINS = 6
ROWS = 7
INSIDE_OUT = "turned inside out"  # see `inverted`
COIL = 1.0 / 24.0  # of the chord of a line bent and twisted at once


@inner
def frame(q1, q2, d):
    """Mid frame (rows of R_m), chord in it and relative rotation vector: (rm, u, psi)."""
    relative = multiply(conjugate(q1), q2)
    rm = matrix(multiply(q1, root(relative)))
    return rm, apply_transposed(rm, d), log(relative)


@kernel
def inverted(position, quaternion):
    """Whether an element is turned inside out: its chord points against its sections, <d_S phi, R e1> <= 0 in eq. (1)."""
    for e in range(position.shape[0] - 1):
        _, u, _ = frame(attitude(quaternion.T, e), attitude(quaternion.T, e + 1), chord(position.T, e, e + 1))
        if not u[0] > 0.0:
            return True
    return False


@kernel
def chords(length, position):
    """Chords of the elements (n - 1, 4), e, and the excess of their squares over those of the lengths.

    A step adds to them what the nodes move (`growth`). From the positions of a line of a kilometre they would be known to 1e-13 m only, and
    the extension, from the chord's length, to 1e-16: the tension does work on both.
    """
    out = np.empty((length.shape[0], 4))
    for e in range(length.shape[0]):
        d = chord(position.T, e, e + 1)
        out[e, 0], out[e, 1], out[e, 2] = d
        out[e, 3] = excess(d, length[e])
    return out


@inner
def excess(d, h):
    """Excess of the square of a chord d over that of the length h [m2]."""
    return dot(d, d) - h * h


@inner
def growth(d, dd):
    """Growth of the square of a chord d by dd."""
    return dot(dd, add(scale(2.0, d), dd))


@inner
def chord_shear(u, psi, h):
    """(s_2, s_3): sideways part of the chord over h, less what coiling does."""
    coil = COIL * psi[0] * u[0]
    return (u[1] - coil * psi[1]) / h, (u[2] - coil * psi[2]) / h


@inner
def barrier(u):
    """f = 2 |u| / (|u| + u_1), which is 1 along t_1 and infinite against it, and its gradient."""
    size = math.sqrt(dot(u, u))
    f = 2.0 * size / (size + u[0])
    k = 0.5 * f * f / (size * size * size)
    return f, (-k * (u[1] * u[1] + u[2] * u[2]), k * u[0] * u[1], k * u[0] * u[2])


@inner
def strains(rm, u, psi, beyond, h, share, out):
    """Strains 0-5 and the sag 6 of one element into `out` (7,); beyond: the `excess` of its chord; `share` (2,) holds p_2, p_3."""
    z = dot(psi, psi)
    chi = chi_of(z)[0]
    along = dot(psi, u)
    longer = beyond + chi * (2.0 + z * chi) * (z * dot(u, u) - along * along)  # l^2 - h^2
    length = math.sqrt(h * h + longer)
    s2, s3 = chord_shear(u, psi, h)
    f, _ = barrier(u)
    b2, b3 = share[0] * s2, share[1] * s3
    out[0] = longer / (h * (length + h)) + 0.1 * f * (b2 * b2 + b3 * b3)
    out[1] = f * s2  # eq. (17)
    out[2] = f * s3
    out[3] = (psi[0] + b2 * psi[1] + b3 * psi[2]) / h
    out[4] = (psi[1] - b2 * psi[0]) / h  # eq. (11)
    out[5] = (psi[2] - b3 * psi[0]) / h
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
    s2, s3 = chord_shear(u, psi, h)
    f, f_u = barrier(u)
    turn, push = -COIL * u[0] / h, -COIL * psi[0] / h
    n2, q2 = (push * psi[1], 1.0 / h, 0.0), (turn * psi[1], turn * psi[0], 0.0)
    n3, q3 = (push * psi[2], 0.0, 1.0 / h), (turn * psi[2], 0.0, turn * psi[0])
    n = add(scale(f, n2), scale(s2, f_u))
    _put(out[1], rm, n, scale(f, q2), cross(n, u), psi, chi, b)
    n = add(scale(f, n3), scale(s3, f_u))
    _put(out[2], rm, n, scale(f, q3), cross(n, u), psi, chi, b)
    k, l2, l3 = 1.0 / (h * length), 0.2 * f * p2 * p2 * s2, 0.2 * f * p3 * p3 * s3
    n = add(scale(0.1 * (p2 * p2 * s2 * s2 + p3 * p3 * s3 * s3), f_u), add(scale(l2, n2), scale(l3, n3)))
    n = add(scale(k, half_u), n)
    q = add(scale(k, half_psi), add(scale(l2, q2), scale(l3, q3)))
    _put(out[0], rm, n, q, cross(n, u), psi, chi, b)
    n = add(scale(p2 * psi[1] / h, n2), scale(p3 * psi[2] / h, n3))
    q = add(scale(p2 * psi[1] / h, q2), scale(p3 * psi[2] / h, q3))
    q = add(q, (1.0 / h, p2 * s2 / h, p3 * s3 / h))
    _put(out[3], rm, n, q, cross(n, u), psi, chi, b)
    n, q = scale(-p2 * psi[0] / h, n2), add(scale(-p2 * psi[0] / h, q2), (-p2 * s2 / h, 1.0 / h, 0.0))
    _put(out[4], rm, n, q, cross(n, u), psi, chi, b)
    n, q = scale(-p3 * psi[0] / h, n3), add(scale(-p3 * psi[0] / h, q3), (-p3 * s3 / h, 0.0, 1.0 / h))
    _put(out[5], rm, n, q, cross(n, u), psi, chi, b)
    down = rm[2]
    n = scale(0.5, cross(psi, down))
    c = add(cross(n, u), scale(0.5, cross(cross(u, psi), down)))
    _put(out[6], rm, n, scale(0.5, cross(down, u)), c, psi, chi, b)


@inner
def shear_force(s2, s3, f, psi, h, share, stress):
    """What is conjugate to h s and to f; the former is the chord's shear force, with the parts of extension, twist and bending that go
    with it."""
    p2, p3 = share[0], share[1]
    l2, l3 = 0.1 * stress[0] * p2 * p2 * s2, 0.1 * stress[0] * p3 * p3 * s3
    n2 = f * (stress[1] + 2.0 * l2) + p2 * (stress[3] * psi[1] - stress[4] * psi[0]) / h
    n3 = f * (stress[2] + 2.0 * l3) + p3 * (stress[3] * psi[2] - stress[5] * psi[0]) / h
    return (0.0, n2 / h, n3 / h), s2 * (stress[1] + l2) + s3 * (stress[2] + l3)


@inner
def conjugate_vectors(down, u, psi, h, share, stress, chi, chi1):
    """(n, q, c) of the function `stress` (7,) . (strains and sag); `down` = R_m^T e3."""
    p2, p3, sag = share[0], share[1], 0.5 * stress[6]
    length, half_u, half_psi = _stretch(u, psi, chi, chi1)
    arc = stress[0] / (h * length)
    s2, s3 = chord_shear(u, psi, h)
    f, f_u = barrier(u)
    shear, turning = shear_force(s2, s3, f, psi, h, share, stress)
    bent = dot(shear, psi)
    n = add(scale(arc, half_u), scale(sag, cross(psi, down)))
    n = add(n, add((-COIL * psi[0] * bent, shear[1], shear[2]), scale(turning, f_u)))
    q = add(scale(arc, half_psi), scale(sag, cross(down, u)))
    b2, b3 = p2 * s2, p3 * s3
    q = add(q, ((stress[3] - b2 * stress[4] - b3 * stress[5]) / h, (stress[3] * b2 + stress[4]) / h, (stress[3] * b3 + stress[5]) / h))
    q = add(q, scale(-COIL * u[0], (bent, psi[0] * shear[1], psi[0] * shear[2])))
    return n, q, add(cross(n, u), scale(sag, cross(cross(u, psi), down)))


@inner
def resultant(rm, u, psi, h, share, stress, out):
    """`stress` (7,) . gradients into `out` (9,), e: force on the chord, moments on mean spin and spin difference; eqs. (22), (23)."""
    z = dot(psi, psi)
    chi, chi1, _ = chi_of(z)
    n, q, c = conjugate_vectors(rm[2], u, psi, h, share, stress, chi, chi1)
    _put(out, rm, n, q, c, psi, chi, half_spin(z)[0])
