"""What the elements hand to their nodes at an instant: section forces, eqs. (20)-(23), with the viscous part of internal damping, less
weight (28), drag (29)-(31) and the bed's elastic reaction. See results/section_forces.py.
"""

from ..element.assembly import expand
from ..compiled import inner
from ..element.strains import ROWS, STRAINS, frame, gradients
from ..simd.lane_arrays import grid, group, lane, row
from ..simd.lanes import WIDTH
from ..loads import add_instant_loads, even_on_sag
from ..maths.so3 import apply, cross, matrix, scale
from ..simd.columns import attitude, chord


@inner
def matrix_at(quaternion, k):
    """Rotation matrix of node k, as three rows."""
    return matrix((quaternion[k, 0], quaternion[k, 1], quaternion[k, 2], quaternion[k, 3]))


@inner
def node_motion(line, quaternion, velocity, rate, velocities, spins):
    """Velocities and angular velocities (n, 3), e, of the nodes, from those of the centres of their masses (step/nodes.py)."""
    for k in range(quaternion.shape[0]):
        r = matrix_at(quaternion, k)
        spin = apply(r, (rate[k, 0], rate[k, 1], rate[k, 2]))
        swing = cross(spin, scale(line.offset[k], (r[0][0], r[1][0], r[2][0])))
        for i in range(3):
            velocities[k, i] = velocity[k, i] - swing[i]
            spins[k, i] = spin[i]


@inner
def end_forces(line, water, position, quaternion, velocity, spin, strain, ends, frames, plain):
    """What the elements hand to their nodes, less their weight, drag and bed, into `ends` (n - 1, 12), e; the line in columns.

    frames (n - 1, 9): R_m row by row; plain (n - 1, 6), in that frame: mean moment, and moment of the chord's shear force at either end.
    """
    for first in range(0, ends.shape[0], WIDTH):
        a, b = group(first), group(first + 1)
        stress, nine, vector, motion, mean = row(7), row(9), row(12), row(9), row(15)
        rows, unused, moves, drags = grid(7, 9), grid(12, 12), grid(2, 6), (grid(3, 12), grid(3, 12))
        points, by_sag = grid(4, 2), row(12)
        h = line.length[a]
        rm, u, psi = frame(attitude(quaternion, a), attitude(quaternion, b), chord(position, a, b))
        gradients(rm, u, psi, h, (line.share[0, a], line.share[1, a]), rows)
        for i in range(3):
            moves[0, i], moves[1, i] = velocity[i, a], velocity[i, b]
            moves[0, 3 + i], moves[1, 3 + i] = spin[i, a], spin[i, b]
            motion[i] = moves[1, i] - moves[0, i]
            motion[3 + i] = 0.5 * (moves[0, 3 + i] + moves[1, 3 + i])
            motion[6 + i] = moves[1, 3 + i] - moves[0, 3 + i]
        for k in range(STRAINS):
            stress[k] = strain[k, a]
            if line.damping.shape[0] > 0:
                for i in range(9):
                    stress[k] += line.damping[a] * rows[k, i] * motion[i]
            stress[k] *= h * line.stiffness[k, a]
        stress[STRAINS] = even_on_sag(line.loads, a, h)
        couple = cross((0.0, stress[1] / h, stress[2] / h), u)
        for i in range(3):
            mean[i], mean[3 + i] = stress[3 + i] / h, 0.5 * couple[i]
            for j in range(3):
                mean[6 + 3 * i + j] = rm[i][j]
        for i in range(9):
            nine[i] = 0.0
            for k in range(ROWS):
                nine[i] += stress[k] * rows[k, i]
        expand(nine, vector)
        count, scratch = min(WIDTH, ends.shape[0] - first), (unused, drags, points, by_sag)
        add_instant_loads(line, water, first, count, (rm, u, psi), position, strain[STRAINS], moves, rows[STRAINS], vector, scratch)
        for m in range(count):
            e, ours, means = first + m, lane(vector, m), lane(mean, m)
            for i in range(12):
                ends[e, i] = ours[i]
            for i in range(6):
                plain[e, i] = means[i]
            for i in range(9):
                frames[e, i] = means[6 + i]
