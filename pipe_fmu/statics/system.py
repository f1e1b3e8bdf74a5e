"""Residual, tangent and potential of the pipe at rest: the static part of the weak form, eq. (94) with the signs of gravity mended."""

import numpy as np

from ..compiled import kernel
from ..element.assembly import add_matrix, add_vector, clear, expand, expand_matrix
from ..element.geometric_stiffness import geometric_stiffness
from ..element.strains import ROWS, STRAINS, excess, frame, gradients, strains
from ..loads import NO_ENERGY, add_static_loads, press_sag, summed
from ..simd.columns import attitude, chord


@kernel
def static_system(line, water, position, quaternion, diagonal, lower, upper, residual, pull):
    """Fill the tangent (n, 6, 6), (n-1, 6, 6) x 2 and residual (n, 6) = internal - external forces, eq. (94).

    Boundary rows are untouched.

    position (n, 3), quaternion (n, 4); `pull` (n, 6) is filled with minus the drag, which the residual contains.
    Returns the potentials [J], elastic and those of loads.ENERGIES; the drag of the current has none. The tangent is exact.
    """
    clear(diagonal, lower, upper)
    residual[:] = 0.0
    pull[:] = 0.0
    strain = np.empty(ROWS)
    rows = np.empty((ROWS, 9))
    stress = np.empty(ROWS)
    nine = np.empty(9)
    square = np.empty((9, 9))
    vector = np.empty(12)
    drag = np.zeros(12)
    matrix = np.empty((12, 12))
    row = np.empty(12)
    points = np.zeros((4, 2))
    elastic, stored = 0.0, NO_ENERGY
    for e in range(line.length.shape[0]):
        h = line.length[e]
        arc = frame(attitude(quaternion.T, e), attitude(quaternion.T, e + 1), chord(position.T, e, e + 1))
        strains(*arc, excess(arc[1], h), h, line.share[e], strain)
        gradients(*arc, h, line.share[e], rows)
        for k in range(STRAINS):
            stress[k] = h * line.stiffness[e, k] * strain[k]
            elastic += 0.5 * stress[k] * strain[k]
        z1, z2 = position[e, 2], position[e + 1, 2]
        gained, stress[STRAINS] = press_sag(line.loads, e, h, z1, z2, strain[STRAINS], points)
        stored = summed(stored, gained)
        nine[:] = 0.0
        for k in range(ROWS):
            for i in range(9):
                nine[i] += stress[k] * rows[k, i]
        geometric_stiffness(*arc, h, line.share[e], stress, square)
        for k in range(STRAINS):
            for i in range(9):
                push = h * line.stiffness[e, k] * rows[k, i]
                for j in range(9):
                    square[i, j] += push * rows[k, j]
        expand(nine, vector)
        expand_matrix(square, matrix)
        drag[:] = 0.0
        add_static_loads(line, water, e, arc, z1, z2, rows[STRAINS], points, row, vector, matrix, drag)
        add_vector(pull, e, drag)
        add_vector(residual, e, vector)
        add_matrix(diagonal, lower, upper, e, matrix)
    return elastic, *stored
