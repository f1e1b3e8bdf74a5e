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

import math
from typing import NamedTuple

import numpy as np

from .attitude import Array, dot
from .compiled import inlined, kernel
from .environment import time_factor
from .parameters import SURFACE_FACTOR, place
from .rigid_body import mass_matrix, symmetric_matrix

STRIPS = 8
STATIONS, SHARES = np.polynomial.legendre.leggauss(STRIPS)
MASS, INERTIA, ADDED_MASS, DAMPING = place("mass"), place("inertia"), place("added_mass"), place("damping")
WATERPLANE, FLOTATION, HANG_OFF = place("waterplane_area"), place("flotation_centre"), place("hang_off")
GM_L, GM_T = place("longitudinal_metacentric_height"), place("metacentric_height")
DENSITY, GRAVITY = place("environment.water_density"), place("environment.gravity")
LENGTH, BEAM, DRAUGHT, MIDSHIP, SURGE_DRAG, CROSS_FLOW = (
    place(f"drag.{name}") for name in ("length", "beam", "draft", "midship", "surge_coefficient", "cross_flow_coefficient")
)
VELOCITY, START, RAMP, PERIOD = (place(f"environment.current.{name}") for name in ("velocity", "start", "ramp", "period"))

current_factor = kernel(time_factor)


class Hull(NamedTuple):
    """Constants of the hull for the kernels, all about the centre of gravity in b."""

    mass: Array  # (6, 6)
    damping: Array  # (6, 6)
    stiffness: Array  # (3,): rho_w g A_wp, N/m; m_V g GM_L and m_V g GM_T, N m
    flotation: float  # x_F, m
    surge_drag: float  # N s^2/m^2
    strips: Array  # (n, 2): x, m, and drag N s^2/m^2
    hang_off: Array  # (3,), m


@kernel
def hull_constants(values: Array) -> Hull:
    """The hull of the parameters' `values`; what is absent has coefficient zero."""
    density, gravity = values[DENSITY], values[GRAVITY]
    stiffness = np.empty(3)
    stiffness[0] = density * gravity * values[WATERPLANE]
    stiffness[1] = values[MASS] * gravity * values[GM_L]
    stiffness[2] = values[MASS] * gravity * values[GM_T]
    has_drag = not math.isnan(values[LENGTH])
    strips, surge_drag = np.empty((STRIPS if has_drag else 0, 2)), 0.0
    if has_drag:
        pressure, half = 0.5 * density * values[DRAUGHT], 0.5 * values[LENGTH]
        surge_drag = pressure * values[BEAM] * values[SURGE_DRAG]
        for k in range(STRIPS):
            strips[k, 0] = values[MIDSHIP] + half * STATIONS[k]
            strips[k, 1] = half * SHARES[k] * pressure * values[CROSS_FLOW]
    damping = np.zeros((6, 6)) if math.isnan(values[DAMPING][0]) else symmetric_matrix(values[DAMPING])
    mass = mass_matrix(values[MASS], values[INERTIA], values[ADDED_MASS])
    return Hull(mass, damping, stiffness, values[FLOTATION], surge_drag, strips, values[HANG_OFF])


@inlined
def surface_current(values: Array, time: float) -> Array:
    """Current velocity (3,), m/s in e, of the surface water at `time`, s; zero where there is none."""
    velocity = np.zeros(3)
    if not math.isnan(values[START]):
        factor = current_factor(time, values[START], values[RAMP], values[PERIOD]) * values[SURFACE_FACTOR]
        for i in range(3):
            velocity[i] = factor * values[VELOCITY][i]
    return velocity


@kernel
def restoring_energy(stiffness: Array, flotation: float, heave: float, rotation: Array) -> float:
    """Potential U, J, of the centre of gravity's heave off equilibrium, m, and the rotation b to e (3, 3); eq. (76)."""
    a1, a2 = rotation[2, 0], rotation[2, 1]
    sinkage = heave + flotation * a1
    return 0.5 * (stiffness[0] * sinkage * sinkage + stiffness[1] * a1 * a1 + stiffness[2] * a2 * a2)


@kernel
def add_restoring(stiffness: Array, flotation: float, heave: float, down: Array, axis: Array, nu: Array, h: float, force: Array) -> None:
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
