"""Residual, tangent and potential of the pipe at rest: the static part of the weak form, eq. (94) with the signs of gravity mended."""

import numpy as np

from .assembly import add_matrix, add_vector, clear, expand, expand_matrix
from .columns import columns, fill_straight, line_columns, room
from .compiled import inner, kernel
from .element import ROWS, STRAINS, frame, geometric_stiffness, gradients, strains
from .lane_arrays import grid, group, lane, row
from .lanes import WIDTH, total
from .loads import add_contact, add_drag


@inner
def vector_of(columns, k, at):
    """Components k, k + 1, k + 2 of columns at a node or a group of nodes."""
    return (columns[k, at], columns[k + 1, at], columns[k + 2, at])


@inner
def attitude(quaternion, at):
    """Quaternion, from columns, of a node or a group of nodes."""
    return (quaternion[0, at], quaternion[1, at], quaternion[2, at], quaternion[3, at])


@inner
def chord(position, a, b):
    """phi_b - phi_a from columns of positions, or of displacements."""
    return (position[0, b] - position[0, a], position[1, b] - position[1, a], position[2, b] - position[2, a])


@kernel
def static_system(line, water, position, quaternion, diagonal, lower, upper, residual):
    """Fill the tangent (n, 6, 6), (n-1, 6, 6) x 2 and residual (n, 6) = internal - external forces; boundary rows untouched.

    position (n, 3), quaternion (n, 4). Returns the potentials (elastic, gravity, contact) [J]; the drag of the current has none.
    """
    n = position.shape[0]
    positions, quaternions = np.empty((3, room(n))), columns(quaternion, n, 1.0)
    fill_straight(position, positions)
    clear(diagonal, lower, upper)
    residual[:] = 0.0
    return _assemble(line_columns(line), water, n, positions, quaternions, (diagonal, lower, upper, residual))


@inner
def _assemble(line, water, n, position, quaternion, system):
    """`static_system` on columns (columns.py)."""
    elastic, gravity, pressed = 0.0, 0.0, 0.0
    diagonal, lower, upper, residual = system
    for first in range(0, n - 1, WIDTH):
        a, b, count = group(first), group(first + 1), min(WIDTH, n - 1 - first)
        strain, stress, nine, vector = row(7), row(7), row(9), row(12)
        rows, square, matrix, still, drags = grid(7, 9), grid(9, 9), grid(12, 12), grid(2, 6), (grid(3, 12), grid(3, 12))
        h, share = line.length[a], (line.share[0, a], line.share[1, a])
        rm, u, psi = frame(attitude(quaternion, a), attitude(quaternion, b), chord(position, a, b))
        strains(rm, u, psi, h, share, strain)
        gradients(rm, u, psi, h, share, rows)
        for k in range(STRAINS):
            stress[k] = h * line.stiffness[k, a] * strain[k]
            elastic += 0.5 * total(stress[k] * strain[k])
        weight = h * line.weight[a]
        stress[STRAINS] = -weight / 6.0
        gravity -= total(weight * (0.5 * (position[2, a] + position[2, b]) + strain[STRAINS] / 6.0))
        geometric_stiffness(rm, u, psi, h, share, stress, square)
        for i in range(9):
            nine[i] = 0.0
            for k in range(ROWS):
                nine[i] += stress[k] * rows[k, i]
            for k in range(STRAINS):
                push = h * line.stiffness[k, a] * rows[k, i]
                for j in range(9):
                    square[i, j] += push * rows[k, j]
        expand(nine, vector)
        expand_matrix(square, matrix)
        vector[2] -= 0.5 * weight
        vector[8] -= 0.5 * weight
        if water.drag and water.levels.shape[0] > 0:
            for i in range(6):
                still[0, i] = 0.0
                still[1, i] = 0.0
            depths, coefficients = (position[2, a], position[2, b]), (line.drag[0, a], line.drag[1, a])
            add_drag(rm, u, psi, h, coefficients, still, depths, water.levels, water.velocities, 0.0, True, vector, matrix, drags)
        for m in range(count):
            e = first + m
            ours, block = lane(vector, m), lane(matrix, m)
            if line.bed.shape[0] > 0:
                lies = line.length[e], line.diameter[e], line.weight[e], position[2, e], position[2, e + 1]
                pressed += add_contact(*lies, lane(strain, m)[STRAINS], lane(rows, m)[STRAINS], ours, block, (lane(drags[0], m),))
            add_vector(residual, e, ours)
            add_matrix(diagonal, lower, upper, e, block)
    return elastic, gravity, pressed
