"""What a step does in the elements: internal forces, eqs. (20)-(23), by the strains of element/strains.py, and loads; see system.py."""

import math

from ..compiled import inner
from ..element.assembly import add_matrix, add_vector, expand, expand_matrix
from ..element.geometric_stiffness import geometric_stiffness
from ..element.strains import ROWS, STRAINS, frame, gradients, growth, resultant, strains
from ..loads import add_mean_loads, even_on_sag, lies, press_mean_sag
from ..maths.so3 import add, dot, left_jacobian, scale
from ..simd.columns import attitude, chord, vector_of
from ..simd.lane_arrays import grid, group, lane, row
from ..simd.lanes import above, below
from .nodes import END, MIDDLE, PATH, turn_columns
from .state import INTERNAL, NUMERICAL

_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)  # of the Gauss points of the path
_CLOSURE_ANGLE = 0.02  # rad per step; below it three Gauss points are exact to round-off
_NO_MOTION = 1e-300  # square of a motion


@inner
def add_elements(line, water, first, count, h, old, new, with_tangent, newton_friction, system, sums, peaks):
    """Add internal forces and loads of the `count` elements from `first` on to `system`; arrays as in step.system.assemble.

    Adds works to `sums` (len(WORKS),), and raises `peaks` (2,) to the largest force and moment at an end of an element.
    """
    strain, chords = old[5], old[6]
    moves, turned, new_strain = new
    a, b = group(first), group(first + 1)
    length, share = line.length[a], (line.share[0, a], line.share[1, a])
    by_sag = lies(line.loads)
    d, dd = vector_of(chords, 0, a), chord(moves, a, b)
    mean, final, stress, nine, vector = grid(7, 9), grid(7, 9), row(7), row(9), row(12)
    square, twelve, ends, drags = grid(9, 9), grid(12, 12), grid(2, 6), (grid(3, 12), grid(3, 12))
    rm, u, psi = frame(attitude(turned[END], a), attitude(turned[END], b), add(d, dd))
    strains(rm, u, psi, chords[3, a] + growth(d, dd), length, share, stress)
    for k in range(ROWS):
        new_strain[k, a] = stress[k]
    if with_tangent:
        gradients(rm, u, psi, length, share, final)
    ahead = _stress(line, h, a, strain, new_strain, stress, sums)
    _mean_force(a, b, length, share, d, moves, turned, strain, new_strain, with_tangent or by_sag, stress, mean, nine)
    expand(nine, vector)
    for i in range(3):
        peaks[0] = max(peaks[0], math.fabs(vector[i]))
        peaks[1] = max(peaks[1], math.fabs(vector[3 + i]))
    middle = frame(attitude(turned[MIDDLE], a), attitude(turned[MIDDLE], b), add(d, scale(0.5, dd)))
    if with_tangent:
        if by_sag:
            press_mean_sag(line.loads, first, count, line.length, h, old, new, stress)
        _tangent(line, a, middle, share, stress, ahead, mean, final, square)
        expand_matrix(square, twelve)
    for i in range(6):
        ends[0, i], ends[1, i] = moves[i, a] / h, moves[i, b] / h
    want, into = (with_tangent, newton_friction), (vector, twelve, drags, sums)
    add_mean_loads(line, water, first, count, (h, old, new), middle, ends, (mean, final), want, into)
    if with_tangent:
        turn_columns(left_jacobian(vector_of(moves, 3, a)), twelve, 12, 3)
        turn_columns(left_jacobian(vector_of(moves, 3, b)), twelve, 12, 9)
    diagonal, lower, upper, residual = system
    for m in range(count):
        add_vector(residual, first + m, lane(vector, m))
        if with_tangent:
            add_matrix(diagonal, lower, upper, first + m, lane(twelve, m))


@inner
def _mean_force(a, b, length, share, d, moves, turned, strain, new_strain, by_row, stress, mean, nine):
    """`stress` (7,) times the gradients averaged over the path, into `nine` (9,); these into `mean` (7, 9) if `by_row`."""
    dd, t1, t2 = chord(moves, a, b), vector_of(moves, 3, a), vector_of(moves, 3, b)
    turn = max(dot(t1, t1), dot(t2, t2))
    large = not below(turn, _CLOSURE_ANGLE**2)
    by_row = by_row or large
    rows = grid(7, 9)
    for i in range(9):
        nine[i] = 0.0
        for k in range(ROWS):
            mean[k, i] = 0.0
    for g in range(3):
        rm, u, psi = frame(attitude(turned[g], a), attitude(turned[g], b), add(d, scale(PATH[g], dd)))
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
        _close(mean, dd, t1, t2, length, above(turn, _CLOSURE_ANGLE**2), a, strain, new_strain)
    if by_row:
        for i in range(9):
            for k in range(ROWS):
                nine[i] += stress[k] * mean[k, i]


@inner
def _stress(line, h, a, strain, new_strain, stress, sums):
    """Mean section forces times length into `stress` (7,), with the works of damping; returns d stress / d strain over length x stiffness
    less a half."""
    length = line.length[a]
    lag = line.damping[a] if line.damping.shape[0] > 0 else 0.0 * length
    ahead = lag / h + line.numerical_damping
    for k in range(STRAINS):
        modulus = length * line.stiffness[k, a]
        change = new_strain[k, a] - strain[k, a]
        stress[k] = modulus * (0.5 * (strain[k, a] + new_strain[k, a]) + ahead * change)  # eqs. (20), (21)
        sums[INTERNAL] += modulus * lag / h * change * change
        sums[NUMERICAL] += modulus * line.numerical_damping * change * change
    stress[STRAINS] = even_on_sag(line.loads, a, length)
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
def _close(mean, dd, t1, t2, length, wanted, a, old, new):
    """Make mean . motion = new - old exactly where `wanted` is 1, by the least change along the relative motion of the ends."""
    motion, norm = row(9), 0.0 * length
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
