"""The discretised line: what the kernels need to know of every element, and of the water and the bed around it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Line(NamedTuple):
    """Constant data of n nodes and n - 1 elements."""

    length: Array  # (n-1,) h [m]
    stiffness: Array  # (n-1, 6) EA, K_2, K_3 [N], GJ, EI_2, EI_3 [N m^2]; K the chord's shear stiffness (element.py)
    share: Array  # (n-1, 2) p_2, p_3
    weight: Array  # (n-1,) submerged weight per length [N/m], eq. (28)
    bearing: Array  # (n-1,) weight per length from which the bed's stiffness follows [N/m] (seabed.py)
    drag: Array  # (n-1, 2) rho d D_1 / 2, rho d D_2 / 2 [N s^2/m^3], eq. (29)
    diameter: Array  # (n-1,) outer diameter d [m]
    mass: Array  # (n,) lumped m_P times length [kg]
    offset: Array  # (n,) centre of the lumped mass ahead of the node, along t1 [m]
    inertia: Array  # (n, 3) lumped J_rho times length [kg m^2], eq. (27)
    spin_damping: Array  # (n, 3) lumped D_R times length [N m s], eq. (32), material frame
    added_mass: Array  # (n, 3) lumped added mass [kg], material frame; (0, 3) when absent
    damping: Array  # (n-1,) Kelvin-Voigt time [s]; (0,) when absent
    bed: Array  # damping [1/(m/s)], friction [-], friction speed [m/s] of the bed; (0,) when there is none
    foot_clamped: bool
    top_clamped: bool
    numerical_damping: float  # 0 conserves energy; 0.5 is backward Euler on the strains


class Water(NamedTuple):
    """Current at one instant: piecewise linear over `levels`."""

    levels: Array  # (k,) ascending depth coordinate z [m]
    velocities: Array  # (k, 3) [m/s]; k = 0 means still water
    drag: bool


def shear_stiffness(shear: Array, bending: Array, length: Array) -> tuple[Array, Array]:
    """Chord shear stiffness K [N] and bending share p of elements: 1/K = 1/GA + h^2/(12 EI) (see element.py)."""
    flexibility = length**2 / (12.0 * bending)
    stiffness = 1.0 / (1.0 / shear + flexibility)
    return stiffness, flexibility * stiffness
