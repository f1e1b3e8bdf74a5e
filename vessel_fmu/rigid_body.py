"""Inertia of the hull and the water it carries: eq. (48), M nu' + C(nu) nu, in b about the centre of gravity, constant M.

With the momentum P = M nu = (P_1, P_2) the Coriolis and centripetal force is C(nu) nu = (w x P_1, w x P_2 + v x P_1):
eqs. (50)-(52) for the full M, rigid body and added mass alike (Kirchhoff's equations). Its power nu . C(nu) nu vanishes
identically. C acts on the velocity over ground, as printed in (48); the Munk moment of a steady current on the hull is
therefore not in it.

A symmetric matrix of a hull with port-starboard symmetry has twelve entries: its diagonal in the order of MODES, then COUPLINGS.
"""

import math

import numpy as np

from .attitude import Array, add_cross, apply, dot
from .compiled import kernel

MODES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
COUPLINGS = ("surge_heave", "surge_pitch", "heave_pitch", "sway_roll", "sway_yaw", "roll_yaw")
PAIRS = np.array([[MODES.index(mode) for mode in name.split("_")] for name in COUPLINGS])


@kernel
def symmetric_matrix(entries: Array) -> Array:
    """6 x 6 matrix of twelve entries."""
    matrix = np.zeros((6, 6))
    for k in range(6):
        i, j = PAIRS[k, 0], PAIRS[k, 1]
        matrix[k, k] = entries[k]
        matrix[i, j] = matrix[j, i] = entries[6 + k]
    return matrix


@kernel
def mass_matrix(mass: float, inertia: Array, added_mass: Array) -> Array:
    """M = M_RB + M_A, eqs. (37), (38), 6 x 6 about the centre of gravity, in b: mass, kg, inertia (3,), kg m^2, twelve entries of M_A."""
    matrix = symmetric_matrix(added_mass)
    for i in range(3):
        matrix[i, i] += mass
        matrix[3 + i, 3 + i] += inertia[i]
    return matrix


@kernel
def indefinite(matrix: Array, shift: float) -> bool:
    """Whether the symmetric `matrix` (n, n) with `shift` added to its diagonal is not positive definite (Cholesky); not with NaN in it."""
    n = matrix.shape[0]
    lower = np.zeros((n, n))
    for j in range(n):
        pivot = matrix[j, j] + shift - dot(lower[j], lower[j])
        if pivot <= 0.0:
            return True
        lower[j, j] = math.sqrt(pivot)
        for i in range(j + 1, n):
            lower[i, j] = (matrix[i, j] - dot(lower[i], lower[j])) / lower[j, j]
    return False


@kernel
def largest_coupling(entries: Array) -> int:
    """Place in COUPLINGS of the coupling that is largest in magnitude."""
    largest = 0
    for k in range(6):
        if abs(entries[6 + k]) > abs(entries[6 + largest]):
            largest = k
    return largest


@kernel
def kinetic_energy(mass: Array, nu: Array) -> float:
    """Kinetic energy, J, eq. (75), of the body velocity nu (6,) with the mass matrix (6, 6)."""
    return 0.5 * dot(nu, apply(mass, nu))


@kernel
def add_coriolis(mass: Array, nu: Array, force: Array) -> None:
    """Add C(nu) nu, eqs. (49)-(52), to `force` (6,), N and N m."""
    momentum = apply(mass, nu)
    add_cross(force[:3], 1.0, nu[3:], momentum[:3])
    add_cross(force[3:], 1.0, nu[3:], momentum[3:])
    add_cross(force[3:], 1.0, nu[:3], momentum[:3])
