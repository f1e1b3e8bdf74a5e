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
share (h_right - h_left) / 6 ahead of the node: with elements that are exact at their nodes the inertia of a smooth motion across the
line then acts as if it were distributed, to fourth order (along it, and that of rotation, to second), and conserves as a rigid body's
does (a consistent matrix would need couples that turn with the element).
"""

import math

import numpy as np

from .assembly import add_matrix, add_vector, clear, expand, expand_matrix
from .columns import columns, fill, fill_straight, line_columns, room, take
from .compiled import inner, kernel
from .element import ROWS, STRAINS, frame, geometric_stiffness, gradients, resultant, strains
from .lane_arrays import grid, group, lane, row
from .lanes import WIDTH, above, below, largest, total
from .loads import add_drag, add_mean_contact, bed_on_sag
from .node_kernel import CONTACT, CURRENT, DRAG, INTERNAL, NUMERICAL, add_nodes, turn_columns
from .so3 import add, dot, exp, left_jacobian, multiply, scale
from .static_kernel import attitude, chord, vector_of

_PATH = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15), 1.0)  # three Gauss points and the end
_MIDDLE, _END = 1, 3
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)
_CLOSURE_ANGLE = 0.02  # rad per step; below it three Gauss points are exact to round-off
_NO_MOTION = 1e-300  # square of a motion


@kernel
def element_strains(line, position, quaternion, out):
    """Strains and sags (n - 1, 7) of a configuration."""
    n = position.shape[0]
    line = line_columns(line)
    positions, quaternions, found = np.empty((3, room(n))), columns(quaternion, n, 1.0), np.empty((ROWS, room(n)))
    fill_straight(position, positions)
    for first in range(0, n - 1, WIDTH):
        a, b = group(first), group(first + 1)
        rm, u, psi = frame(attitude(quaternions, a), attitude(quaternions, b), chord(positions, a, b))
        one = row(7)
        strains(rm, u, psi, line.length[a], (line.share[0, a], line.share[1, a]), one)
        for k in range(ROWS):
            found[k, a] = one[k]
    take(found, out)


@kernel
def old_columns(position, quaternion, velocity, rate, flow, strain):
    """Columns of the old state, and those that an assembly fills: increments, attitudes on the path, strains at its end."""
    n = position.shape[0]
    p = room(n)
    positions = np.empty((3, p))
    fill_straight(position, positions)
    old = (
        positions,
        columns(quaternion, n, 1.0),
        columns(velocity, n, 1.0),
        columns(rate, n, 1.0),
        columns(flow, n, 1.0),
        columns(strain, n, 1.0),
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
def step_system(line, water, h, position, quaternion, velocity, rate, flow, strain, x, new_strain, fresh, sharp, system, works):
    """Residual of the step for trial increments `x` (n, 6), and the tangent if `fresh`, into `system` = (diagonal, lower, upper, residual).

    `sharp`: see add_mean_contact.

    position, velocity (n, 3), quaternion (n, 4), rate (n, 3) body rates, flow (n, 3) or (0, 3) body velocity of the added mass,
    strain (n - 1, 7): old state. Fills new_strain (n - 1, 7) and works (6,). Returns (force scale [N], moment scale [N m]).
    """
    old, new = old_columns(position, quaternion, velocity, rate, flow, strain)
    scales = assemble(line_columns(line), water, h, old, new, x, fresh, sharp, system, works)
    take(new[2], new_strain)
    return scales


@inner
def assemble(line, water, h, old, new, x, fresh, sharp, system, works):
    """`step_system` on columns (columns.py)."""
    moves, turned, _ = new
    diagonal, lower, upper, residual = system
    if fresh:
        clear(diagonal, lower, upper)
    residual[:] = 0.0
    n = x.shape[0]
    fill(x, moves)
    _follow(moves, old[1], n, turned)
    sums, peaks = row(6), row(2)
    for k in range(6):
        sums[k] = 0.0
    for k in range(2):
        peaks[k] = 0.0
    for first in range(0, n - 1, WIDTH):
        _add_elements(line, water, h, old, new, first, min(WIDTH, n - 1 - first), fresh, sharp, system, sums, peaks)
    for first in range(0, n, WIDTH):
        add_nodes(line, first, min(WIDTH, n - first), h, old, moves, turned, fresh, diagonal, residual, sums)
    for k in range(6):
        works[k] = total(sums[k])
    return largest(peaks[0]), largest(peaks[1])


@inner
def _follow(moves, quaternion, n, turned):
    """Attitudes of the nodes at the points of the path, and beyond the last of them."""
    for first in range(0, room(n), WIDTH):
        at = group(first)
        theta, q = vector_of(moves, 3, at), attitude(quaternion, at)
        for g in range(4):
            now = multiply(exp(scale(_PATH[g], theta)), q)
            turned[g, 0, at], turned[g, 1, at], turned[g, 2, at], turned[g, 3, at] = now


@inner
def _add_elements(line, water, h, old, new, first, count, fresh, sharp, system, sums, peaks):
    """Internal forces, weight, drag and bed of the `count` elements from `first` on."""
    position, strain = old[0], old[5]
    moves, turned, new_strain = new
    a, b = group(first), group(first + 1)
    length, share = line.length[a], (line.share[0, a], line.share[1, a])
    d, dd = chord(position, a, b), chord(moves, a, b)
    t1, t2 = vector_of(moves, 3, a), vector_of(moves, 3, b)
    rows, mean, final = grid(7, 9), grid(7, 9), grid(7, 9)
    stress, nine, motion, vector = row(7), row(9), row(9), row(12)
    square, twelve = grid(9, 9), grid(12, 12)

    rm, u, psi = frame(attitude(turned[_END], a), attitude(turned[_END], b), add(d, dd))
    strains(rm, u, psi, length, share, stress)
    for k in range(ROWS):
        new_strain[k, a] = stress[k]
    if fresh:
        gradients(rm, u, psi, length, share, final)
    ahead = _stress(line, h, a, strain, new_strain, stress, sums)
    turn = max(dot(t1, t1), dot(t2, t2))
    large = not below(turn, _CLOSURE_ANGLE**2)
    by_row = fresh or large or line.bed.shape[0] > 0
    for i in range(9):
        nine[i] = 0.0
        for k in range(ROWS):
            mean[k, i] = 0.0
    middle = frame(attitude(turned[_MIDDLE], a), attitude(turned[_MIDDLE], b), add(d, scale(0.5, dd)))
    for g in range(3):
        rm, u, psi = frame(attitude(turned[g], a), attitude(turned[g], b), add(d, scale(_PATH[g], dd)))
        if by_row:
            gradients(rm, u, psi, length, share, rows)
            for k in range(ROWS):
                for i in range(9):
                    mean[k, i] += _WEIGHTS[g] * rows[k, i]
        else:
            resultant(rm, u, psi, length, share, stress, rows[0])
            for i in range(9):
                nine[i] += _WEIGHTS[g] * rows[0, i]
    if large:
        _close(mean, motion, dd, t1, t2, length, above(turn, _CLOSURE_ANGLE**2), a, strain, new_strain)
    if by_row:
        for i in range(9):
            for k in range(ROWS):
                nine[i] += stress[k] * mean[k, i]
    expand(nine, vector)
    for i in range(3):
        peaks[0] = max(peaks[0], math.fabs(vector[i]))
        peaks[1] = max(peaks[1], math.fabs(vector[3 + i]))
    weight = length * line.weight[a]
    vector[2] -= 0.5 * weight
    vector[8] -= 0.5 * weight
    if fresh and line.bed.shape[0] > 0:
        for m in range(count):
            e = first + m
            old_z = (position[2, e], position[2, e + 1], strain[STRAINS, e])
            new_z = (old_z[0] + moves[2, e], old_z[1] + moves[2, e + 1], new_strain[STRAINS, e])
            lane(stress, m)[STRAINS] += bed_on_sag(line.length[e], h, line.diameter[e], line.weight[e], line.bed[0], old_z, new_z)
    if fresh:
        _tangent(line, a, middle, share, stress, ahead, mean, final, square)
        expand_matrix(square, twelve)
    if water.drag or line.bed.shape[0] > 0:
        ends, drags = grid(2, 6), (grid(3, 12), grid(3, 12))
        for i in range(6):
            ends[0, i] = moves[i, a] / h
            ends[1, i] = moves[i, b] / h
        if water.drag:
            depths = (position[2, a] + 0.5 * moves[2, a], position[2, b] + 0.5 * moves[2, b])
            rm, u, psi = middle
            coefficients = (line.drag[0, a], line.drag[1, a])
            stream = water.levels, water.velocities
            dissipated, supplied = add_drag(rm, u, psi, length, coefficients, ends, depths, *stream, 1.0 / h, fresh, vector, twelve, drags)
            sums[DRAG] += h * dissipated
            sums[CURRENT] += h * supplied
        if line.bed.shape[0] > 0:
            for m in range(count):
                e = first + m
                old_z = (position[2, e], position[2, e + 1], strain[STRAINS, e])
                new_z = (old_z[0] + moves[2, e], old_z[1] + moves[2, e + 1], new_strain[STRAINS, e])
                bed = line.length[e], h, line.diameter[e], line.weight[e], line.bed
                sag_rows = lane(mean, m)[STRAINS], lane(final, m)[STRAINS]
                into = lane(vector, m), lane(twelve, m), (lane(drags[0], m),)
                lane(sums, m)[CONTACT] += add_mean_contact(*bed, old_z, new_z, lane(ends, m), *sag_rows, fresh, sharp, *into)
    if fresh:
        turn_columns(left_jacobian(t1), twelve, 12, 3)
        turn_columns(left_jacobian(t2), twelve, 12, 9)
    diagonal, lower, upper, residual = system
    for m in range(count):
        add_vector(residual, first + m, lane(vector, m))
        if fresh:
            add_matrix(diagonal, lower, upper, first + m, lane(twelve, m))


@inner
def _stress(line, h, a, strain, new_strain, stress, sums):
    """Mean section forces times length into `stress` (7,), with the works of damping; returns d stress / d strain over length x stiffness
    less a half."""
    length = line.length[a]
    late = line.numerical_damping
    lag = line.damping[a] if line.damping.shape[0] > 0 else 0.0 * length
    ahead = lag / h + late
    for k in range(STRAINS):
        modulus = length * line.stiffness[k, a]
        change = new_strain[k, a] - strain[k, a]
        stress[k] = modulus * (0.5 * (strain[k, a] + new_strain[k, a]) + ahead * change)
        sums[INTERNAL] += modulus * lag / h * change * change
        sums[NUMERICAL] += modulus * late * change * change
    stress[STRAINS] = -length * line.weight[a] / 6.0
    return ahead


@inner
def _tangent(line, a, middle, share, stress, ahead, mean, final, square):
    """Derivative of the mean force: half of the geometric stiffness half way, and the stiffness of the strains at the end."""
    rm, u, psi = middle
    length = line.length[a]
    geometric_stiffness(rm, u, psi, length, share, stress, square)
    for i in range(9):
        for j in range(9):
            square[i, j] *= 0.5
    for k in range(STRAINS):
        modulus = length * line.stiffness[k, a] * (0.5 + ahead)
        for i in range(9):
            push = modulus * mean[k, i]
            for j in range(9):
                square[i, j] += push * final[k, j]


@inner
def _close(mean, motion, dd, t1, t2, length, wanted, a, old, new):
    """Make mean . motion = new - old exactly where `wanted` is 1, by the least change along the relative motion of the ends."""
    norm = 0.0 * length
    for i in range(3):
        motion[i] = dd[i]
        motion[3 + i] = 0.5 * (t1[i] + t2[i])
        motion[6 + i] = t2[i] - t1[i]
        norm += motion[i] * motion[i] + length * length * motion[6 + i] * motion[6 + i]
    norm = max(norm, _NO_MOTION)
    for k in range(ROWS):
        gap = new[k, a] - old[k, a]
        for i in range(9):
            gap -= mean[k, i] * motion[i]
        gap *= wanted / norm
        for i in range(3):
            mean[k, i] += gap * motion[i]
            mean[k, 6 + i] += gap * length * length * motion[6 + i]
