"""The discretised line: what the kernels need to know of every element, and of the water and the bed around it."""

from typing import NamedTuple

from .arrays import Array
from .compiled import inner, kernel
from .environment import time_factor
from .loads import Loads, loads_columns
from .simd.columns import column, columns


class Line(NamedTuple):
    """Constant data of n nodes and n - 1 elements."""

    length: Array  # (n-1,) h [m]
    stiffness: Array  # (n-1, 6) EA, K_2, K_3 [N], GJ, EI_2, EI_3 [N m^2]; K the chord's shear stiffness (element/strains.py)
    share: Array  # (n-1, 2) p_2, p_3
    loads: Loads
    mass: Array  # (n,) lumped m_P times length [kg]
    offset: Array  # (n,) centre of the lumped mass ahead of the node, along t1 [m]
    inertia: Array  # (n, 3) lumped J_rho times length [kg m^2], eq. (27)
    spin_damping: Array  # (n, 3) lumped D_R times length [N m s], eq. (32), material frame
    added_mass: Array  # (n, 3) lumped added mass [kg], material frame; (0, 3) when absent
    damping: Array  # (n-1,) Kelvin-Voigt time [s]; (0,) when absent
    foot_clamped: bool
    top_clamped: bool
    numerical_damping: float  # 0 conserves energy; 0.5 is backward Euler on the strains


class Water(NamedTuple):
    """Current at one instant: piecewise linear over `levels`."""

    levels: Array  # (k,) ascending depth coordinate z [m]
    velocities: Array  # (k, 3) [m/s]; k = 0 means still water
    drag: bool


class Sea(NamedTuple):
    """The current over time: its profile at full strength, and the times of `environment.time_factor` [s]."""

    levels: Array  # (k,) ascending depth coordinate z [m]; k = 0 means still water
    velocities: Array  # (k, 3) [m/s]
    start: float
    ramp: float
    period: float
    drag: bool


_factor = kernel(time_factor)


@kernel
def water_at(sea, time):
    """The water of a sea at `time` [s]."""
    factor = _factor(time, sea.start, sea.ramp, sea.period) if sea.levels.shape[0] > 0 else 0.0
    count = sea.levels.shape[0] if factor != 0.0 else 0
    return Water(sea.levels[:count], factor * sea.velocities[:count], sea.drag)


@inner
def shear_stiffness(shear, bending, length):
    """Chord shear stiffness K [N] and bending share p of an element: 1/K = 1/GA + h^2/(12 EI) (see element/strains.py)."""
    flexibility = length * length / (12.0 * bending)
    stiffness = 1.0 / (1.0 / shear + flexibility)
    return stiffness, flexibility * stiffness


@kernel
def line_columns(line):
    """The line with its arrays as columns (simd/columns.py)."""
    n = line.mass.shape[0]
    return Line(
        column(line.length, n, 1.0),
        columns(line.stiffness, n, 0.0),
        columns(line.share, n, 1.0),
        loads_columns(line.loads, n),
        column(line.mass, n, 0.0),
        column(line.offset, n, 0.0),
        columns(line.inertia, n, 0.0),
        columns(line.spin_damping, n, 0.0),
        columns(line.added_mass, n, 0.0),
        column(line.damping, n, 0.0),
        line.foot_clamped,
        line.top_clamped,
        line.numerical_damping,
    )
