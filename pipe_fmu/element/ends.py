"""How the ends are held: the foot, eq. (33), and the top, each clamped or pinned, imposed on residual and tangent; and the pipe as its top
feels it."""

import math

import numpy as np

from ..compiled import inner, kernel
from ..maths.block_tridiagonal import SIZE, lu, lu_solve, lu_solve_vector
from ..maths.so3 import dot, matrix


@inner
def axis_of_foot(quaternion):
    """Direction t1 of the foot."""
    rm = matrix((quaternion[0, 0], quaternion[0, 1], quaternion[0, 2], quaternion[0, 3]))
    return (rm[0][0], rm[1][0], rm[2][0])


@inner
def hold_foot(line, quaternion, vector):
    """Take from `vector` (6,) of the foot what it may not do, eq. (33), or from its residual what holds it, without power, eq. (88).

    A guess and a correction move it by round-off, which the reaction of a very short step makes work of.
    """
    for k in range(SIZE if line.foot_clamped else 3):
        vector[k] = 0.0
    if line.foot_clamped:
        return
    axis = axis_of_foot(quaternion)
    along = dot((vector[3], vector[4], vector[5]), axis)
    for i in range(3):
        vector[3 + i] -= along * axis[i]


@inner
def hold_foot_tangent(line, quaternion, diagonal, upper):
    """Impose the foot on the tangent: clamped, or pinned (position held, no spin about t1, so that the line's twist is determined).

    The spin about t1 is held by a stiffness as large as those beside it: against a smaller one their round-off moves it.
    """
    block, coupling = diagonal[0], upper[0]
    for i in range(SIZE if line.foot_clamped else 3):
        for j in range(SIZE):
            block[i, j] = 1.0 if i == j else 0.0
            coupling[i, j] = 0.0
    if line.foot_clamped:
        return
    axis = axis_of_foot(quaternion)
    stiffness = max(math.fabs(block[3, 3]), math.fabs(block[4, 4]), math.fabs(block[5, 5]))
    for j in range(SIZE):
        along = block[3, j] * axis[0] + block[4, j] * axis[1] + block[5, j] * axis[2]
        across = coupling[3, j] * axis[0] + coupling[4, j] * axis[1] + coupling[5, j] * axis[2]
        for i in range(3):
            block[3 + i, j] -= axis[i] * along
            coupling[3 + i, j] -= axis[i] * across
            if j >= 3:
                block[3 + i, j] += stiffness * axis[i] * axis[j - 3]


@kernel
def _free_rotation(block, sides):
    """Solve the rotation rows of the top's block (6, 6) for `sides` (3, m), in place; False if singular."""
    a = np.empty((3, 3))
    pivots = np.empty(3, np.int64)
    for i in range(3):
        for j in range(3):
            a[i, j] = block[3 + i, 3 + j]
    if not lu(a, pivots):
        return False
    lu_solve(a, pivots, sides)
    return True


@kernel
def top_correction(line, block, right, wanted, move):
    """Correction of the top node into `move` (6,): `wanted` where prescribed, solved for where free. False if singular."""
    for i in range(SIZE):
        move[i] = wanted[i]
    if line.top_clamped:
        return True
    sides = np.empty((3, 1))
    for i in range(3):
        sides[i, 0] = -right[3 + i]
        for j in range(3):
            sides[i, 0] -= block[3 + i, j] * wanted[j]
    fine = _free_rotation(block, sides)
    for i in range(3):
        move[3 + i] = sides[i, 0]
    return fine


@kernel
def yielding(line, block, right, tangent, held, mobility, move):
    """Correction of the top into `move` (6,) with which it meets held = displacement + mobility x force; False if singular.

    held (6,): displacement from here to where the top would be without a force; mobility (6, 6): displacement over force;
    tangent: the pipe's, as its top feels it.
    """
    a, wanted = np.empty((SIZE, SIZE)), np.zeros(SIZE)
    pivots, force = np.empty(SIZE, np.int64), np.empty(SIZE)
    if not top_correction(line, block, right, wanted, move):
        return False
    for i in range(SIZE):  # what the top would feel if it stayed; a pinned one turns
        force[i] = right[i] if line.top_clamped or i < 3 else 0.0
        if not line.top_clamped and i < 3:
            for j in range(3, SIZE):
                force[i] += block[i, j] * move[j]
    for i in range(SIZE):
        wanted[i] = held[i]
        for j in range(SIZE):
            wanted[i] -= mobility[i, j] * force[j]
            a[i, j] = 1.0 if i == j else 0.0
            for k in range(SIZE):
                a[i, j] += mobility[i, k] * tangent[k, j]
    if not lu(a, pivots):
        return False
    lu_solve_vector(a, pivots, wanted)
    return top_correction(line, block, right, wanted, move)


@kernel
def condense_top(line, block, out):
    """Tangent d(force, moment) / d(displacement, rotation) at the top into `out` (6, 6); a pinned top has no moment."""
    for i in range(SIZE):
        for j in range(SIZE):
            out[i, j] = block[i, j]
    if line.top_clamped:
        return
    sides = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            sides[i, j] = block[3 + i, j]
    _free_rotation(block, sides)
    for i in range(SIZE):
        for j in range(SIZE):
            if i >= 3 or j >= 3:
                out[i, j] = 0.0
            else:
                for k in range(3):
                    out[i, j] -= block[i, 3 + k] * sides[k, j]
