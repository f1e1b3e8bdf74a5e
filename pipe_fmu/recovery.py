"""Section forces at the nodes, recovered from equilibrium of the elements' ends.

A two-node element knows its section force only in the mean. What it hands to its node, less its own share of the distributed loads, is
the section force at the node to the accuracy of the reactions; the elements left and right of a node are averaged. Tension is the effective
tension; the wall's own, T_w = T - p_e A_e + p_i A_i, enters the stress.

They follow from the elastic strains at an instant. Internal and numerical damping act on the means over a step: the mean force and moment
at the top contain them, the section forces here, and with them the force and moment at the top at the end of a step, do not.
"""

import math
from typing import NamedTuple

import numpy as np

from .assembly import expand
from .columns import columns, fill_straight, line_columns, room
from .compiled import inner, kernel
from .element import ROWS, STRAINS, frame, gradients
from .lane_arrays import grid, group, lane, row
from .lanes import WIDTH
from .line import Array
from .loads import add_drag, add_press, press
from .parameters import PipeParameters
from .so3 import apply_transposed, matrix
from .static_kernel import attitude, chord

_SAMPLES = 16  # parts of an element
_AT_JOINT = 1e-9  # m; so near to the end of a section a node stands at its joint


class SectionForces(NamedTuple):
    """Material components (along t_1, t_2, t_3) at the nodes."""

    tension: Array  # (n,) effective tension n_1 [N]
    shear: Array  # (n, 2) n_2, n_3 [N]
    moment: Array  # (n, 3) torque m_1, bending moments m_2, m_3 [N m]

    @classmethod
    def of(cls, wrenches: Array) -> "SectionForces":
        """From nodal wrenches (n, 6)."""
        return cls(wrenches[:, 0].copy(), wrenches[:, 1:3].copy(), wrenches[:, 3:].copy())


def largest_bending_moment(s: Array, forces: SectionForces) -> float:
    """Largest bending moment [N m] along the line, between the nodes `s` (n,) too.

    |m|^2 is a cubic in every element: its slope at the nodes is 2 (m_2 n_3 - m_3 n_2) by eq. (26).
    """
    return math.sqrt(_largest_square(s, forces.moment, forces.shear))


@inner
def _largest_square(s, moment, shear):
    largest = 0.0
    for e in range(s.shape[0] - 1):
        h = s[e + 1] - s[e]
        a = moment[e, 1] ** 2 + moment[e, 2] ** 2
        b = moment[e + 1, 1] ** 2 + moment[e + 1, 2] ** 2
        da = 2.0 * h * (moment[e, 1] * shear[e, 1] - moment[e, 2] * shear[e, 0])
        db = 2.0 * h * (moment[e + 1, 1] * shear[e + 1, 1] - moment[e + 1, 2] * shear[e + 1, 0])
        for k in range(_SAMPLES + 1):
            x = k / _SAMPLES
            largest = max(largest, a + x * (da + x * (3.0 * (b - a) - 2.0 * da - db + x * (2.0 * (a - b) + da + db))))
    return largest


@kernel
def nodal_wrenches(line, water, position, quaternion, velocity, strain):
    """Section force and moment (n, 6) at the nodes, material components, without those of damping."""
    n = position.shape[0]
    out, positions = np.zeros((n, 6)), np.empty((3, room(n)))
    fill_straight(position, positions)
    state = positions, columns(quaternion, n, 1.0), columns(velocity, n, 1.0), columns(strain, n, 1.0)
    _add_end_forces(line_columns(line), water, *state, out)
    for k in range(n):
        r = matrix((quaternion[k, 0], quaternion[k, 1], quaternion[k, 2], quaternion[k, 3]))
        force = apply_transposed(r, (out[k, 0], out[k, 1], out[k, 2]))
        moment = apply_transposed(r, (out[k, 3], out[k, 4], out[k, 5]))
        for i in range(3):
            out[k, i] = force[i]
            out[k, 3 + i] = moment[i]
    return out


@inner
def _add_end_forces(line, water, position, quaternion, velocity, strain, out):
    """Add what the elements hand to their nodes, less their own loads, to `out` (n, 6), the mean of left and right; columns elsewhere."""
    n = out.shape[0]
    for first in range(0, n - 1, WIDTH):
        a, b, count = group(first), group(first + 1), min(WIDTH, n - 1 - first)
        stress, nine, vector = row(7), row(9), row(12)
        rows, unused, ends, drags = grid(7, 9), grid(12, 12), grid(2, 6), (grid(3, 12), grid(3, 12))
        points, by_sag = grid(4, 2), row(12)
        h = line.length[a]
        rm, u, psi = frame(attitude(quaternion, a), attitude(quaternion, b), chord(position, a, b))
        gradients(rm, u, psi, h, (line.share[0, a], line.share[1, a]), rows)
        weight = h * line.weight[a]
        for k in range(STRAINS):
            stress[k] = h * line.stiffness[k, a] * strain[k, a]
        stress[STRAINS] = -weight / 6.0
        for i in range(9):
            nine[i] = 0.0
            for k in range(ROWS):
                nine[i] += stress[k] * rows[k, i]
        expand(nine, vector)
        vector[2] -= 0.5 * weight
        vector[8] -= 0.5 * weight
        if water.drag:
            for i in range(3):
                ends[0, i], ends[1, i] = velocity[i, a], velocity[i, b]
                ends[0, 3 + i], ends[1, 3 + i] = 0.0, 0.0
            depths, coefficients = (position[2, a], position[2, b]), (line.drag[0, a], line.drag[1, a])
            stream = water.levels, water.velocities
            add_drag(rm, u, psi, h, coefficients, ends, depths, *stream, 0.0, False, vector, unused, drags)
        for m in range(count):
            e, ours = first + m, lane(vector, m)
            if line.bed.shape[0] > 0:
                lies = line.length[e], line.diameter[e], line.bearing[e], position[2, e], position[2, e + 1], strain[STRAINS, e]
                _, on_sag = press(*lies, lane(points, m))
                add_press(lane(points, m), ours)
                expand(lane(rows, m)[STRAINS], lane(by_sag, m))
                for i in range(12):
                    ours[i] += on_sag * lane(by_sag, m)[i]
            for i in range(6):
                out[e, i] -= ours[i] * (1.0 if e == 0 else 0.5)
                out[e + 1, i] += ours[6 + i] * (1.0 if e == n - 2 else 0.5)


def centreline_length(line_length: Array, strain: Array) -> float:
    """Length of the stretched centreline, the integral of |d phi / d S| [m]."""
    return float(line_length @ (1.0 + strain[:, 0]))


class Wall(NamedTuple):
    """Tube wall on one side of the nodes and pressures on it; (n,) each. `area` is 0 where a section has no wall."""

    area: Array  # m2
    second_moment: Array  # m4
    inner: Array  # m
    outer: Array  # m
    displaced: Array  # A_e, m2
    contents: Array  # weight per volume of the contents, N/m3
    water: float  # that of the water
    depth: float  # m


def walls(parameters: PipeParameters, s: Array) -> tuple[Wall, Wall]:
    """Walls below and above the nodes `s` (n,): two at a joint of sections, elsewhere the same."""
    return _wall(parameters, s - _AT_JOINT), _wall(parameters, s + _AT_JOINT)


def _wall(parameters: PipeParameters, s: Array) -> Wall:
    environment = parameters.environment
    ends = np.cumsum([section.length or parameters.length for section in parameters.all_sections])
    at = [parameters.all_sections[min(int(np.searchsorted(ends, x)), len(ends) - 1)] for x in s]
    columns = [
        (
            one.steel_area if one.wall_thickness is not None else 0.0,
            one.second_moment,
            *one.radii,
            one.outer_area,
            one.contents_density * environment.gravity,
        )
        for one in at
    ]
    return Wall._make([*np.array(columns).T.copy(), environment.water_density * environment.gravity, environment.depth])


def wall_tension(wall: Wall, position: Array, forces: SectionForces) -> Array:
    """Force (n,) [N] in `wall`: effective tension - p_e A_e + p_i A_i. Nodes of sections without a wall have the effective tension."""
    out = np.empty(len(wall.area))
    _wall_tension(wall, position, forces.tension, out)
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
def _wall_tension(wall, position, tension, out):
    for i in range(out.shape[0]):
        outside, inside = _pressures(wall, position[i, 2], i)
        out[i] = tension[i]
        if wall.area[i] > 0.0:
            out[i] += inside * math.pi * wall.inner[i] ** 2 - outside * wall.displaced[i]


@inner
def _von_mises(wall, position, tension, moment, out):
    _wall_tension(wall, position, tension, out)
    for i in range(out.shape[0]):
        area, a, b = wall.area[i], wall.inner[i], wall.outer[i]
        if area == 0.0:
            out[i] = 0.0
            continue
        outside, inside = _pressures(wall, position[i, 2], i)
        axial = out[i] / area
        mean = (inside * a**2 - outside * b**2) * math.pi / area
        largest = 0.0
        for r in (a, b):
            swing = (inside - outside) * math.pi * b**2 / area * ((a / r) ** 2 if r > 0.0 else 0.0)
            radial, hoop = mean - swing, mean + swing
            bending = math.hypot(moment[i, 1], moment[i, 2]) * r / wall.second_moment[i]
            twist = moment[i, 0] * r / (2.0 * wall.second_moment[i])
            for side in (axial + bending, axial - bending):
                squares = (side - hoop) ** 2 + (hoop - radial) ** 2 + (radial - side) ** 2
                largest = max(largest, 0.5 * squares + 3.0 * twist**2)
        out[i] = math.sqrt(largest)
