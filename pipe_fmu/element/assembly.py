"""From elements to the nodes: residuals and tangents in block tridiagonal form.

An element's rows of nine (chord, mean spin, spin difference) reach its nodes through d = phi_2 - phi_1, (theta_1 + theta_2) / 2 and
theta_2 - theta_1. A node's six unknowns are (displacement, spin), all in e.
"""

from ..compiled import inner


@inner
def expand(row, out):
    """Row of nine to the twelve nodal unknowns (phi_1, theta_1, phi_2, theta_2)."""
    for i in range(3):
        out[i] = -row[i]
        out[3 + i] = 0.5 * row[3 + i] - row[6 + i]
        out[6 + i] = row[i]
        out[9 + i] = 0.5 * row[3 + i] + row[6 + i]


@inner
def add_vector(residual, e, vector):
    """Add an element's twelve to `residual` (n, 6)."""
    for i in range(6):
        residual[e, i] += vector[i]
        residual[e + 1, i] += vector[6 + i]


@inner
def add_matrix(diagonal, lower, upper, e, matrix):
    """Add an element's 12 x 12 to the block tridiagonal matrix."""
    for i in range(6):
        for j in range(6):
            diagonal[e, i, j] += matrix[i, j]
            upper[e, i, j] += matrix[i, 6 + j]
            lower[e, i, j] += matrix[6 + i, j]
            diagonal[e + 1, i, j] += matrix[6 + i, 6 + j]


@inner
def add_outer(matrix, factor, left, right):
    """matrix += factor left right^T, of the twelve."""
    for i in range(12):
        f = factor * left[i]
        if f != 0.0:
            for j in range(12):
                matrix[i, j] += f * right[j]


@inner
def expand_matrix(nine, out):
    """9 x 9 in (chord, mean spin, spin difference) to 12 x 12 in the nodal unknowns."""
    for i in range(3):  # rows first, in the places of phi_1, theta_1 and theta_2
        for j in range(9):
            mean, half = 0.5 * nine[3 + i, j], nine[6 + i, j]
            out[i, j] = -nine[i, j]
            out[3 + i, j] = mean - half
            out[9 + i, j] = mean + half
    for i in range(12):
        if 6 <= i < 9:
            continue
        for j in range(3):
            chord, mean, half = out[i, j], 0.5 * out[i, 3 + j], out[i, 6 + j]
            out[i, j] = -chord
            out[i, 3 + j] = mean - half
            out[i, 6 + j] = chord
            out[i, 9 + j] = mean + half
    for i in range(3):
        for j in range(12):
            out[6 + i, j] = -out[i, j]


@inner
def clear(diagonal, lower, upper):
    """Zero the tangent."""
    diagonal[:] = 0.0
    lower[:] = 0.0
    upper[:] = 0.0
