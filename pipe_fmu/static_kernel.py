"""Residual, tangent and potential of the pipe at rest: the static part of the weak form, eq. (94) with the signs of gravity mended."""

import numpy as np

from .assembly import add_matrix, add_outer, add_vector, clear, expand, expand_matrix
from .compiled import inner, kernel
from .element import ROWS, STRAINS, frame, geometric_stiffness, gradients, strains
from .loads import add_contact, add_drag, bed_on_sag


@inner
def chord(position, e):
    """phi_2 - phi_1 of element e."""
    return (
        position[e + 1, 0] - position[e, 0],
        position[e + 1, 1] - position[e, 1],
        position[e + 1, 2] - position[e, 2],
    )


@inner
def spin(quaternion, i):
    """Quaternion of node i as a tuple."""
    return (quaternion[i, 0], quaternion[i, 1], quaternion[i, 2], quaternion[i, 3])


@kernel
def static_system(line, water, position, quaternion, diagonal, lower, upper, residual):
    """Fill the tangent (n, 6, 6), (n-1, 6, 6) x 2 and residual (n, 6) = internal - external forces; boundary rows untouched.

    position (n, 3), quaternion (n, 4). Returns the potentials (elastic, gravity, contact) [J]; the drag of the current has none.
    """
    clear(diagonal, lower, upper)
    residual[:] = 0.0
    strain = np.empty(ROWS)
    rows = np.empty((ROWS, 9))
    stress = np.empty(ROWS)
    nine = np.empty(9)
    square = np.empty((9, 9))
    vector = np.empty(12)
    matrix = np.empty((12, 12))
    still = np.zeros((2, 6))
    depths = np.empty(3)  # z of the nodes, and the sag
    scratch = np.empty((2, 3, 12))
    elastic, gravity, pressed = 0.0, 0.0, 0.0
    for e in range(line.length.shape[0]):
        h = line.length[e]
        rm, u, psi = frame(spin(quaternion, e), spin(quaternion, e + 1), chord(position, e))
        strains(rm, u, psi, h, line.share[e], strain)
        gradients(rm, u, psi, h, line.share[e], rows)
        for k in range(STRAINS):
            stress[k] = h * line.stiffness[e, k] * strain[k]
            elastic += 0.5 * stress[k] * strain[k]
        weight = h * line.weight[e]
        stress[STRAINS] = -weight / 6.0
        gravity -= weight * (0.5 * (position[e, 2] + position[e + 1, 2]) + strain[STRAINS] / 6.0)
        nine[:] = 0.0
        for k in range(ROWS):
            for i in range(9):
                nine[i] += stress[k] * rows[k, i]
        depths[0], depths[1], depths[2] = position[e, 2], position[e + 1, 2], strain[STRAINS]
        if line.bed.shape[0] > 0:
            stress[STRAINS] += bed_on_sag(h, 1.0, line.diameter[e], line.weight[e], 0.0, depths, depths)
        geometric_stiffness(rm, u, psi, h, line.share[e], stress, square)
        for k in range(STRAINS):
            add_outer(square, h * line.stiffness[e, k], rows[k], rows[k])
        expand(nine, vector)
        expand_matrix(square, matrix)
        vector[2] -= 0.5 * weight
        vector[8] -= 0.5 * weight
        if water.drag and water.levels.shape[0] > 0:
            add_drag(rm, u, psi, h, line.drag[e], still, depths, water.levels, water.velocities, 0.0, True, vector, matrix, scratch)
        if line.bed.shape[0] > 0:
            pressed += add_contact(
                h, line.diameter[e], line.weight[e], depths[0], depths[1], strain[STRAINS], rows[STRAINS], vector, matrix, scratch
            )
        add_vector(residual, e, vector)
        add_matrix(diagonal, lower, upper, e, matrix)
    return elastic, gravity, pressed
