"""One discretely passive time step of the pipe, eqs. (25), (26) with the corrected signs.

Unknowns: displacement and rotation vector of every node over the step, x = (phi_new - phi_old, theta), R_new = exp(theta) R_old. With

- v_new = 2 dphi / h - v_old, body rates W_new = 2 R_old^T theta / h - W_old, spatial angular momentum R J W;
- section forces C (strain_old + strain_new) / 2 through the strain gradients averaged over the path phi_old + s dphi, exp(s theta) R_old
  (three Gauss points; what they leave of strain_new - strain_old, and it is round-off below 0.02 rad, is closed by a
  discrete-gradient correction along the relative motion, which touches neither the linear momentum nor a rigid turn);
- drag at mean velocity and mid rotation, the bed by a discrete gradient, weight through the exact change of its potential;

the work of the top equals the change of kinetic, elastic, gravity and contact energy plus the dissipations less the work of the current,
for any h, to the tolerance of Newton's method. A free line keeps its linear momentum exactly, its angular momentum to second order in h
(3e-6 of it over 10 steps of 0.04 s of a bar tumbling at 1 rad/s, 8e-7 over 20 of 0.02 s). The mass is lumped, the centre of a node's
share ahead of the node as far as the couples m h^2 / 12 of its elements ask, (h_right - h_left) / 6 in one section: with elements that
are exact at their nodes the inertia of a smooth motion across the line then acts as if it were distributed, to fourth order (along it,
and that of rotation, to second), and conserves as a rigid body's does (a consistent matrix would need couples that turn with the element).
"""

import math

import numpy as np

from ..compiled import inner, kernel
from ..element.assembly import clear
from ..element.strains import ROWS, chords, excess, frame, strains
from ..line import line_columns
from ..maths.so3 import exp, multiply, scale
from ..simd.columns import attitude, chord, columns, fill, fill_column, fill_straight, room, take, vector_of
from ..simd.lane_arrays import group, row
from ..simd.lanes import WIDTH, largest, total
from .elements import add_elements
from .nodes import PATH, add_nodes
from .state import WORKS

_COUNT = len(WORKS)


@kernel
def element_strains(line, position, quaternion, out):
    """Strains and sags (n - 1, 7) of a configuration."""
    n = position.shape[0]
    line = line_columns(line)
    positions, quaternions, found = np.empty((3, room(n))), columns(quaternion, n, 1.0), np.empty((ROWS, room(n)))
    fill_straight(position, positions)
    for first in range(0, n - 1, WIDTH):
        a, b = group(first), group(first + 1)
        d, h, one = chord(positions, a, b), line.length[a], row(7)
        rm, u, psi = frame(attitude(quaternions, a), attitude(quaternions, b), d)
        strains(rm, u, psi, excess(d, h), h, (line.share[0, a], line.share[1, a]), one)
        for k in range(ROWS):
            found[k, a] = one[k]
    take(found, out)


@kernel
def old_columns(position, quaternion, velocity, rate, added_mass_velocity, strain, chord):
    """Columns of the old state (of positions, z alone), and those that an assembly fills: increments, attitudes on the path, strains at its
    end.
    """
    n = position.shape[0]
    p = room(n)
    z = np.empty(p)
    fill_column(position, 2, z)
    old = (
        z,
        columns(quaternion, n, 1.0),
        columns(velocity, n, 1.0),
        columns(rate, n, 1.0),
        columns(added_mass_velocity, n, 1.0),
        columns(strain, n, 1.0),
        columns(chord, n, 1.0),
    )
    return old, (np.empty((6, p)), np.empty((4, 4, p)), np.empty((ROWS, p)))


@kernel
def folded(length, old, new):
    """Whether the turn between the ends of an element, from strains `old` to `new` (n - 1, 7), went past half a turn: its rotation vector
    then jumps to the other end of the same axis, and the strain energy with it."""
    for e in range(length.shape[0]):
        change = 0.0
        for i in range(3, 6):
            change += (new[e, i] - old[e, i]) ** 2
        if math.sqrt(change) * length[e] > math.pi:
            return True
    return False


@kernel
def step_system(
    line, water, h, position, quaternion, velocity, rate, added_mass_velocity, strain, x, new_strain, with_tangent, newton_friction,
    system, works,
):  # fmt: skip
    """Residual of the step for trial increments `x` (n, 6), and the tangent if asked for, into `system`: diagonal, lower, upper, residual.

    `newton_friction`: see loads.bed.add_mean_contact.

    position, velocity (n, 3), quaternion (n, 4), rate (n, 3) body rates, added_mass_velocity (n, 3) or (0, 3) in the section's frame,
    strain (n - 1, 7): old state, whose chords are those of the positions. Fills new_strain (n - 1, 7) and works (len(WORKS),). Returns
    (force scale [N], moment scale [N m]).
    """
    old, new = old_columns(position, quaternion, velocity, rate, added_mass_velocity, strain, chords(line.length, position))
    scales = assemble(line_columns(line), water, h, old, new, x, with_tangent, newton_friction, system, works)
    take(new[2], new_strain)
    return scales


@inner
def assemble(line, water, h, old, new, x, with_tangent, newton_friction, system, works):
    """`step_system`, the weak form (91)-(93) of a step, on columns (simd/columns.py)."""
    moves, turned, _ = new
    diagonal, lower, upper, residual = system
    if with_tangent:
        clear(diagonal, lower, upper)
    residual[:] = 0.0
    n = x.shape[0]
    fill(x, moves)
    _follow(moves, old[1], n, turned)
    sums, peaks = row(_COUNT), row(2)
    for k in range(_COUNT):
        sums[k] = 0.0
    for k in range(2):
        peaks[k] = 0.0
    for first in range(0, n - 1, WIDTH):
        add_elements(line, water, first, min(WIDTH, n - 1 - first), h, old, new, with_tangent, newton_friction, system, sums, peaks)
    for first in range(0, n, WIDTH):
        add_nodes(line, first, min(WIDTH, n - first), h, old, moves, turned, with_tangent, diagonal, residual, sums)
    for k in range(_COUNT):
        works[k] = total(sums[k])
    return largest(peaks[0]), largest(peaks[1])


@inner
def _follow(moves, quaternion, n, turned):
    """Attitudes of the nodes at the points of the path, and beyond the last of them."""
    for first in range(0, room(n), WIDTH):
        at = group(first)
        theta, q = vector_of(moves, 3, at), attitude(quaternion, at)
        for g in range(4):
            now = multiply(exp(scale(PATH[g], theta)), q)
            turned[g, 0, at], turned[g, 1, at], turned[g, 2, at], turned[g, 3, at] = now
