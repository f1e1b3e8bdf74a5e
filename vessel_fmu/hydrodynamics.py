"""Hydrostatic restoring beside its potential, linear and quadratic damping beside their powers.

Restoring, z down, a_i = (R e_i) . e3, and h = (p + R r_F) . e3 - z_eq the heave off the equilibrium at the centre of
flotation r_F = (x_F, 0, 0) from the centre of gravity (paper (54), (58), (59), (76), signs of (54) corrected; there
r_F = 0):

    U = 1/2 rho_w g A_wp h^2 + 1/2 m_V g (GM_L a_1^2 + GM_T a_2^2)

About the centre of gravity C_33 = rho_w g A_wp, C_35 = -x_F C_33, C_55 = m_V g GM_L + x_F^2 C_33. Over a step the force
is the discrete gradient of U along R(s) = R_old exp(s theta_b): means of old and new for h and a_i, and for the axis e3
in b its mean over s, so that its work is the drop of U exactly; the lift acts at r_F, which moves by h R_mean (v + w x r_F).

Damping acts on the velocity relative to the current, nu_r (D(nu) of (53) read so): nu_r . d(nu_r) >= 0 is what it
dissipates, while -nu_c . d(nu_r) is the power that the current supplies. Quadratic part: surge resistance and the
cross-flow principle, strip by strip at the stations of a Gauss rule, d_v = sum c_i |v + x_i r| (v + x_i r).
"""

from typing import NamedTuple

import numpy as np

from .attitude import Array, dot
from .compiled import kernel
from .parameters import VesselParameters, mass_matrix, symmetric_matrix

STRIPS = 8


class Hull(NamedTuple):
    """Constants of the hull for the kernels, all about the centre of gravity in b."""

    mass: Array  # (6, 6)
    damping: Array  # (6, 6)
    stiffness: Array  # (3,): rho_w g A_wp, N/m; m_V g GM_L and m_V g GM_T, N m
    flotation: float  # x_F, m
    surge_drag: float  # N s^2/m^2
    strips: Array  # (n, 2): x, m, and drag N s^2/m^2
    hang_off: Array  # (3,), m


def hull_constants(parameters: VesselParameters) -> Hull:
    """The constants of `parameters`; what is absent has coefficient zero."""
    sea, drag = parameters.environment, parameters.drag
    weight = parameters.mass * sea.gravity
    stiffness = np.array([
        sea.water_density * sea.gravity * parameters.waterplane_area,
        weight * parameters.longitudinal_metacentric_height,
        weight * parameters.metacentric_height,
    ])  # fmt: skip
    strips, surge_drag = np.zeros((0, 2)), 0.0
    if drag is not None:
        pressure = 0.5 * sea.water_density * drag.draft
        surge_drag = pressure * drag.beam * drag.surge_coefficient
        station, share = np.polynomial.legendre.leggauss(STRIPS)
        strips = np.column_stack([
            drag.midship + 0.5 * drag.length * station,
            0.5 * drag.length * share * pressure * drag.cross_flow_coefficient,
        ])  # fmt: skip
    damping = np.zeros((6, 6)) if parameters.damping is None else symmetric_matrix(parameters.damping)
    hang_off, flotation = np.array(parameters.hang_off), float(parameters.flotation_centre)
    return Hull(mass_matrix(parameters), damping, stiffness, flotation, surge_drag, strips, hang_off)


@kernel
def restoring_energy(stiffness: Array, flotation: float, heave: float, rotation: Array) -> float:
    """Potential U, J, of the centre of gravity's heave off equilibrium, m, and the rotation b to e (3, 3); eq. (76)."""
    a1, a2 = rotation[2, 0], rotation[2, 1]
    sinkage = heave + flotation * a1
    return 0.5 * (stiffness[0] * sinkage * sinkage + stiffness[1] * a1 * a1 + stiffness[2] * a2 * a2)


@kernel
def add_restoring(
    stiffness: Array, flotation: float, heave: float, down: Array, axis: Array, nu: Array, h: float, force: Array
) -> None:
    """Add the mean of dU over a step, left-hand side of (48), to `force` (6,), N and N m in b.

    `heave`, m, and `down` = R_old^T e3 (3,) are those at the start of the step, `axis` (3,) the mean of R^T e3, nu (6,)
    the mean velocity, h the step, s. With axis = down and h = 0 this is the static force (54), (58), (59), (60); (55), (57) without angles.
    """
    v, w = nu[:3], nu[3:]
    sinking = dot(axis, v) + flotation * (axis[1] * w[2] - axis[2] * w[1])  # of r_F
    lift = stiffness[0] * (heave + flotation * down[0] + 0.5 * h * sinking)
    for i in range(3):
        force[i] += lift * axis[i]
    trim = stiffness[1] * (down[0] + 0.5 * h * (axis[1] * w[2] - axis[2] * w[1]))  # about e1 x axis
    heel = stiffness[2] * (down[1] + 0.5 * h * (axis[2] * w[0] - axis[0] * w[2]))  # about e2 x axis
    force[3] += heel * axis[2]
    force[4] -= (trim + flotation * lift) * axis[2]
    force[5] += (trim + flotation * lift) * axis[1] - heel * axis[0]


@kernel
def add_drag(surge_drag: float, strips: Array, nu: Array, force: Array) -> None:
    """Add the quadratic drag d(nu_r), eq. (53), of the relative velocity nu_r (6,) to `force` (6,), N and N m in b."""
    force[0] += surge_drag * abs(nu[0]) * nu[0]
    for k in range(strips.shape[0]):
        speed = nu[1] + strips[k, 0] * nu[5]
        strip = strips[k, 1] * abs(speed) * speed
        force[1] += strip
        force[5] += strips[k, 0] * strip
