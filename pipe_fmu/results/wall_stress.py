"""Forces and stresses in the wall of a tube, from the section forces and the pressures of the water and of what fills the pipe."""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..compiled import inner
from .section_forces import SAMPLES, SectionForces, bending_square


class Wall(NamedTuple):
    """Tube wall at n places along the line, and pressures on it; (n,) each. `area` is 0 where a section has no wall."""

    area: Array  # m2
    second_moment: Array  # m4
    inner: Array  # m
    outer: Array  # m
    displaced: Array  # A_e, m2
    contents: Array  # weight per volume of the contents, N/m3
    water: float  # that of the water
    depth: float  # m
    yield_stress: Array  # Pa, infinite where it is not given


@inner
def fill_wall(wall, i, shape, thickness, contents, yield_stress):
    """Fill in a section's wall at place i; contents [N/m3]; thickness and yield stress are NaN where they are not given."""
    wall.area[i] = 0.0 if math.isnan(thickness) else shape.steel_area
    wall.second_moment[i], wall.inner[i], wall.outer[i] = shape.second_moment, shape.inner, shape.outer
    wall.displaced[i], wall.contents[i] = shape.outer_area, contents
    wall.yield_stress[i] = math.inf if math.isnan(yield_stress) else yield_stress


def wall_tension(wall: Wall, position: Array, forces: SectionForces) -> Array:
    """Force (n,) [N] in `wall`: effective tension - p_e A_e + p_i A_i. Nodes of sections without a wall have the effective tension."""
    out = np.empty(len(wall.area))
    fill_wall_tension(wall, position, forces.tension, out)
    return out


def von_mises(walls: tuple[Wall, Wall], position: Array, forces: SectionForces) -> Array:
    """Largest von Mises stress (n,) [Pa] over the wall of a tube at every node: tension, bending, torsion and water pressure.

    Thick-walled tube (Lame) under the pressure outside and, where the pipe is filled, the head of its contents inside. A node at a joint
    of sections has that of the worse. Nodes of sections without a wall have stress 0.
    """
    out = np.empty((2, len(position)))
    for side, wall in enumerate(walls):
        _von_mises(wall, position, forces.tension, forces.moment, out[side])
    return out.max(axis=0)


@inner
def _pressures(wall, z, i):
    """Pressure outside and, of what fills the pipe, inside [Pa] of node i, at its depth below the surface."""
    depth = max(0.0, z + wall.depth)
    return wall.water * depth, wall.contents[i] * depth


@inner
def _in_wall(wall, i, tension, outside, inside):
    """Force in the wall at node i, from the effective tension and the pressures outside and inside."""
    return tension + inside * math.pi * wall.inner[i] ** 2 - outside * wall.displaced[i]


@inner
def fill_wall_tension(wall, position, tension, out):
    for i in range(out.shape[0]):
        outside, inside = _pressures(wall, position[i, 2], i)
        out[i] = _in_wall(wall, i, tension[i], outside, inside) if wall.area[i] > 0.0 else tension[i]


def largest_von_mises(wall: Wall, s: Array, position: Array, forces: SectionForces) -> tuple[float, float]:
    """Largest von Mises stress [Pa] along the line, between the nodes `s` (n,) too, and largest over the yield stress (0 without one).

    `wall` is that of the elements. Between nodes the bending moment is that of section_forces.bending_square; tension, torque and depth
    are linear.
    """
    stress, utilisation = largest_stress(wall, s, position, forces)
    return float(stress), float(utilisation)


@inner
def _von_mises(wall, position, tension, moment, out):
    for i in range(out.shape[0]):
        bending = math.hypot(moment[i, 1], moment[i, 2])
        out[i] = math.sqrt(_square(wall, i, position[i, 2], tension[i], bending, moment[i, 0]))


@inner
def largest_stress(wall, s, position, forces):
    largest, used, tension, moment = 0.0, 0.0, forces.tension, forces.moment
    for e in range(s.shape[0] - 1):
        for k in range(SAMPLES + 1):
            x = k / SAMPLES
            y = 1.0 - x
            bending = math.sqrt(max(0.0, bending_square(s, moment, forces.shear, e, x)))
            depth, pull = y * position[e, 2] + x * position[e + 1, 2], y * tension[e] + x * tension[e + 1]
            square = _square(wall, e, depth, pull, bending, y * moment[e, 0] + x * moment[e + 1, 0])
            largest, used = max(largest, square), max(used, square / wall.yield_stress[e] ** 2)
    return math.sqrt(largest), math.sqrt(used)


@inner
def _square(wall, i, z, tension, bending, torque):
    """Square of the largest von Mises stress [Pa2] in the wall at node i for a depth coordinate z [m], tension [N] and moments [N m]."""
    area, a, b = wall.area[i], wall.inner[i], wall.outer[i]
    if area == 0.0:
        return 0.0
    outside, inside = _pressures(wall, z, i)
    axial = _in_wall(wall, i, tension, outside, inside) / area
    mean = (inside * a**2 - outside * b**2) * math.pi / area
    largest = 0.0
    for r in (a, b):
        swing = (inside - outside) * math.pi * b**2 / area * ((a / r) ** 2 if r > 0.0 else 0.0)
        radial, hoop = mean - swing, mean + swing
        bent = bending * r / wall.second_moment[i]
        twist = torque * r / (2.0 * wall.second_moment[i])
        for side in (axial + bent, axial - bent):
            squares = (side - hoop) ** 2 + (hoop - radial) ** 2 + (radial - side) ** 2
            largest = max(largest, 0.5 * squares + 3.0 * twist**2)
    return largest
