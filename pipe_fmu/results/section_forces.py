"""Section forces at the nodes of a line at rest or in motion, recovered from equilibrium of the elements' ends.

A two-node element knows its section force only in the mean. What it hands to its node, less its own share of the distributed loads, is
the section force at the node to the accuracy of the reactions; the elements left and right of a node are averaged. Three things
make moments fourth-order accurate in motion as at rest, and forces, in motion, second-order, as inertia along the line is lumped:

- The loads are all those that act at the instant. Weight, drag and the bed's elastic reaction are taken element by element. What then is
  not in balance at a node are the inertial forces of its mass and added mass (and damping and friction of the bed): they give the node's
  acceleration, which is linear between the nodes, zero at the foot, and extrapolated to the top, where the pull is not known.
- A load that varies linearly along a bar is carried by its ends as by a beam's (7/20, 3/20; h^2/20, h^2/30), not as it was lumped.
- The element bends as a cubic. Between nodes that are far apart against the bending length sqrt(EI / T), a bar under tension T does not:
  with z = T h^2 / (4 EI) its end moments differ from the mean law EI kappa by the factors F = 3 (sqrt z coth sqrt z - 1) / z (both ends
  bent alike) and 15 (1 / F - 1) / z (bent to an S) of what the cubic says (exact bar under tension and linear load). Both are 1 for a short
  element, and with EI the moment goes to zero. An element that is pushed keeps the cubic. Forces stay as they are: those at the ends
  of a line at rest are its reactions.

Tension is the effective tension; the wall's own: results/wall_stress.py. Viscous stresses of internal damping are those of the rates of strain at
the instant; numerical damping acts on the means over a step only, and is left out. So are the couples of rotary inertia (27) and rotational
damping (32), which cancel in the mean of left and right at all nodes but the ends.
"""

import math
from typing import NamedTuple

import numpy as np

from ..simd.columns import columns, fill_straight, room
from ..arrays import Array
from ..compiled import inner, kernel
from .end_forces import end_forces, matrix_at, node_motion
from ..line import line_columns
from ..maths.so3 import add, apply, apply_transposed, dot, scale, subtract

SAMPLES = 8  # parts of an element between whose ends a largest value is sought
_SHORT = 1e-2  # z below which the factors are taken from their series


class SectionForces(NamedTuple):
    """Material components (along t_1, t_2, t_3) at the nodes."""

    tension: Array  # (n,) effective tension n_1 [N]
    shear: Array  # (n, 2) n_2, n_3 [N]
    moment: Array  # (n, 3) torque m_1, bending moments m_2, m_3 [N m]

    @classmethod
    def of(cls, wrenches: Array) -> "SectionForces":
        """From nodal wrenches (n, 6)."""
        return cls(wrenches[:, 0].copy(), wrenches[:, 1:3].copy(), wrenches[:, 3:].copy())


class MassPerLength(NamedTuple):
    """Mass that is accelerated along and across the section of every element (n - 1,) [kg/m]; across, added mass goes with it."""

    along: Array
    across: Array


def largest_bending_moment(s: Array, forces: SectionForces) -> float:
    """Largest bending moment [N m] along the line, between the nodes `s` (n,) too."""
    return math.sqrt(largest_bending_square(s, forces.moment, forces.shear))


@inner
def largest_bending_square(s, moment, shear):
    largest = 0.0
    for e in range(s.shape[0] - 1):
        for k in range(SAMPLES + 1):
            largest = max(largest, bending_square(s, moment, shear, e, k / SAMPLES))
    return largest


@inner
def bending_square(s, moment, shear, e, x):
    """Square of the bending moment at the part x of element e: the cubic with the slopes 2 (m_2 n_3 - m_3 n_2) of eq. (26) at the nodes."""
    h = s[e + 1] - s[e]
    a = moment[e, 1] ** 2 + moment[e, 2] ** 2
    b = moment[e + 1, 1] ** 2 + moment[e + 1, 2] ** 2
    da = 2.0 * h * (moment[e, 1] * shear[e, 1] - moment[e, 2] * shear[e, 0])
    db = 2.0 * h * (moment[e + 1, 1] * shear[e + 1, 1] - moment[e + 1, 2] * shear[e + 1, 0])
    return a + x * (da + x * (3.0 * (b - a) - 2.0 * da - db + x * (2.0 * (a - b) + da + db)))


@kernel
def nodal_wrenches(line, mass, water, position, quaternion, velocity, rate, strain):
    """Section force and moment (n, 6) at the nodes, material components; arrays as in step.system.step_system, `mass` a MassPerLength."""
    n = position.shape[0]
    ends, frames, plain = np.zeros((n - 1, 12)), np.empty((n - 1, 9)), np.empty((n - 1, 6))
    positions, velocities, spins = np.empty((3, room(n))), np.empty((n, 3)), np.empty((n, 3))
    fill_straight(position, positions)
    node_motion(line, quaternion, velocity, rate, velocities, spins)
    state = positions, columns(quaternion, n, 1.0), columns(velocities, n, 1.0), columns(spins, n, 1.0), columns(strain, n, 1.0)
    end_forces(line_columns(line), water, *state, ends, frames, plain)
    acceleration, out = np.zeros((n, 3)), np.zeros((n, 6))
    _accelerations(line, mass, quaternion, ends, acceleration)
    for e in range(n - 1):
        _add_inertia(line, mass, e, frames[e], acceleration, ends[e])
        tension = line.stiffness[e, 0] * strain[e, 0]
        if tension > 0.0:
            _tighten(tension, line.length[e], line.stiffness[e], frames[e], plain[e], ends[e])
        for i in range(6):
            out[e, i] -= ends[e, i] * (1.0 if e == 0 else 0.5)
            out[e + 1, i] += ends[e, 6 + i] * (1.0 if e == n - 2 else 0.5)
    for k in range(n):
        r = matrix_at(quaternion, k)
        force = apply_transposed(r, (out[k, 0], out[k, 1], out[k, 2]))
        moment = apply_transposed(r, (out[k, 3], out[k, 4], out[k, 5]))
        for i in range(3):
            out[k, i] = force[i]
            out[k, 3 + i] = moment[i]
    if not line.top_clamped:
        out[n - 1, 3:] = 0.0
    if not line.foot_clamped:
        out[0, 4:] = 0.0  # its spin about t_1 is held
    return out


@inner
def _accelerations(line, mass, quaternion, ends, out):
    """Accelerations (n, 3) [m/s2], e, of the nodes, with which the masses balance what the elements leave at them."""
    n = out.shape[0]
    for k in range(1, n - 1):
        left, right = 0.5 * line.length[k - 1], 0.5 * line.length[k]
        r = matrix_at(quaternion, k)
        axis = (r[0][0], r[1][0], r[2][0])
        force = (ends[k, 0] + ends[k - 1, 6], ends[k, 1] + ends[k - 1, 7], ends[k, 2] + ends[k - 1, 8])
        along = scale(dot(axis, force), axis)
        heavy = left * mass.along[k - 1] + right * mass.along[k]
        wide = left * mass.across[k - 1] + right * mass.across[k]
        _put(out, k, add(scale(-1.0 / heavy, along), scale(-1.0 / wide, subtract(force, along))))
    before, gap = (0.0, 0.0, 0.0), line.length[0]  # of the foot, which stands, and the way from there
    for k in range(1, n - 1):  # from the centres of the lumped masses to the nodes
        here, offset = (out[k, 0], out[k, 1], out[k, 2]), line.offset[k]
        if offset > 0.0 or k == n - 2:
            slope = scale(1.0 / (gap + offset), subtract(here, before))
        else:
            beyond = (out[k + 1, 0], out[k + 1, 1], out[k + 1, 2])
            slope = scale(1.0 / (line.length[k] - offset + line.offset[k + 1]), subtract(beyond, here))
        _put(out, k, subtract(here, scale(offset, slope)))
        before, gap = here, line.length[k] - offset
    for i in range(3):
        out[n - 1, i] = out[n - 2, i] + (out[n - 2, i] - out[n - 3, i]) * line.length[n - 2] / line.length[n - 3]


@inner
def _put(out, k, vector):
    for i in range(3):
        out[k, i] = vector[i]


@inner
def _add_inertia(line, mass, e, rows, acceleration, ends):
    """Add the inertial forces of element e, linear along it, to what it hands to its nodes, `ends` (12,)."""
    h, r = line.length[e], _rows(rows)
    a = apply_transposed(r, (acceleration[e, 0], acceleration[e, 1], acceleration[e, 2]))
    b = apply_transposed(r, (acceleration[e + 1, 0], acceleration[e + 1, 1], acceleration[e + 1, 2]))
    along, across = h * mass.along[e], h * mass.across[e]
    low = (along * (2.0 * a[0] + b[0]) / 6.0, across * (7.0 * a[1] + 3.0 * b[1]) / 20.0, across * (7.0 * a[2] + 3.0 * b[2]) / 20.0)
    high = (along * (a[0] + 2.0 * b[0]) / 6.0, across * (3.0 * a[1] + 7.0 * b[1]) / 20.0, across * (3.0 * a[2] + 7.0 * b[2]) / 20.0)
    arm = h * across / 60.0
    turn_low = (0.0, -arm * (3.0 * a[2] + 2.0 * b[2]), arm * (3.0 * a[1] + 2.0 * b[1]))
    turn_high = (0.0, arm * (2.0 * a[2] + 3.0 * b[2]), -arm * (2.0 * a[1] + 3.0 * b[1]))
    _add(ends, 0, apply(r, low))
    _add(ends, 3, apply(r, turn_low))
    _add(ends, 6, apply(r, high))
    _add(ends, 9, apply(r, turn_high))


@inner
def _rows(nine):
    return ((nine[0], nine[1], nine[2]), (nine[3], nine[4], nine[5]), (nine[6], nine[7], nine[8]))


@inner
def _add(out, first, vector):
    for i in range(3):
        out[first + i] += vector[i]


@inner
def bar_factors(z):
    """Factors (bent alike, bent to an S) on the end moments beyond EI kappa of a bar with z = T h^2 / (4 EI) >= 0."""
    if z < _SHORT:
        alike = 1.0 - z * (1.0 / 15.0 - z * (2.0 / 315.0 - z / 1575.0))
        return alike, 1.0 - z * (1.0 / 35.0 - z * 2.0 / 1575.0)
    root = math.sqrt(z)
    alike = 3.0 * (root / math.tanh(root) - 1.0) / z
    return alike, 15.0 * (1.0 / alike - 1.0) / z


@inner
def _tighten(tension, h, stiffness, rows, plain, ends):
    """Give the ends of an element, `ends` (12,), the bending moments of a bar under tension."""
    r = _rows(rows)
    low = apply_transposed(r, (ends[3], ends[4], ends[5]))
    high = apply_transposed(r, (ends[9], ends[10], ends[11]))
    by_mean, by_shear = bar_factors(0.25 * tension * h * h / stiffness[4])
    two = (by_mean - 1.0) * (0.5 * (high[1] - low[1]) - plain[1]), (by_shear - 1.0) * (0.5 * (high[1] + low[1]) - plain[4])
    if stiffness[5] != stiffness[4]:
        by_mean, by_shear = bar_factors(0.25 * tension * h * h / stiffness[5])
    three = (by_mean - 1.0) * (0.5 * (high[2] - low[2]) - plain[2]), (by_shear - 1.0) * (0.5 * (high[2] + low[2]) - plain[5])
    _add(ends, 3, apply(r, (0.0, two[1] - two[0], three[1] - three[0])))
    _add(ends, 9, apply(r, (0.0, two[1] + two[0], three[1] + three[0])))


@inner
def centreline_length(line_length, strain):
    """Length of the stretched centreline, the integral of |d phi / d S| [m]."""
    total = 0.0
    for e in range(line_length.shape[0]):
        total += line_length[e] * (1.0 + strain[e, 0])
    return total
