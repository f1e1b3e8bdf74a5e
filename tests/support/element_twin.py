"""The element of pipe_fmu/element in NumPy, as short as its equations: strains, energy and forces of two nodes, for comparison.

Poses are (phi (3,), R (3, 3)). Lengths in m, stiffnesses (EA, GA_2, GA_3, GJ, EI_2, EI_3).
"""

import numpy as np
from scipy.spatial.transform import Rotation


def strains(one, two, h, stiffness):
    """(e, g_2, g_3, k_1, k_2, k_3) of an element of length h [m], and the sag of its arc along e3 [m]; eqs. (11), (17)."""
    (phi_1, r_1), (phi_2, r_2) = one, two
    psi = Rotation.from_matrix(r_1.T @ r_2).as_rotvec()
    r_m = r_1 @ Rotation.from_rotvec(psi / 2.0).as_matrix()
    u = r_m.T @ (phi_2 - phi_1)
    s = (u - psi[0] * u[0] * psi / 24.0)[1:] / h  # a line bent and twisted at once is coiled
    f = 2.0 * np.linalg.norm(u) / (np.linalg.norm(u) + u[0])
    # from here on: what a shear force bends the element to an S by
    _, chord_share = chord_shear(h, stiffness)
    b = chord_share * s
    extension = helix_length(u, psi) / h - 1.0 + 0.1 * f * b @ b
    twist = (psi[0] + b @ psi[1:]) / h
    sag = 0.5 * (r_m @ np.cross(u, psi))[2]
    return np.array([extension, *(f * s), twist, *((psi[1:] - b * psi[0]) / h)]), sag


def helix_length(u, psi):
    """Length of the helix with the relative rotation psi and the chord u: the part of u along psi, and an arc across it."""
    angle = np.linalg.norm(psi)
    if angle == 0.0:
        return float(np.linalg.norm(u))
    along = u @ psi / angle
    across = np.linalg.norm(u - along * psi / angle)
    return float(np.hypot(along, across * (angle / 2.0) / np.sin(angle / 2.0)))


def chord_shear(h, stiffness):
    """Stiffness K [N] of the chord against shear in the directions 2 and 3, and the share of bending in it: 1/K = 1/GA + h^2 / (12 EI)."""
    shear, bending = np.array(stiffness[1:3]), np.array([stiffness[5], stiffness[4]])  # a shear force along t2 bends about t3
    by_bending = h**2 / (12.0 * bending)
    k = 1.0 / (1.0 / shear + by_bending)
    return k, by_bending * k


def energy(one, two, h, stiffness):
    """Strain energy [J], eq. (16)."""
    strain, _ = strains(one, two, h, stiffness)
    k, _ = chord_shear(h, stiffness)
    return 0.5 * h * np.array([stiffness[0], *k, *stiffness[3:]]) @ strain**2


def forces(one, two, h, stiffness, step=1e-6):
    """Derivatives (12,) of the energy by displacements [m] and spins [rad], in e, of both nodes: fourth-order differences."""

    def at(x):
        (phi_1, r_1), (phi_2, r_2) = one, two
        turn_1, turn_2 = Rotation.from_rotvec([x[3:6], x[9:]]).as_matrix()
        return energy((phi_1 + x[:3], turn_1 @ r_1), (phi_2 + x[6:9], turn_2 @ r_2), h, stiffness)

    def slope(way):
        near, far = (at(k * step * way) - at(-k * step * way) for k in (1, 2))
        return (8.0 * near - far) / (12.0 * step)

    return np.array([slope(way) for way in np.eye(12)])
