"""Manufactured solution of eqs. (25), (26): a smooth motion in space, the loads that make it exact, and the orders of its error.

Nothing of the loads comes from pipe_fmu: they are differences of eighth order of the chosen motion. The motion: a plane rod with the
angle a(S, t) and the stretch g(S, t), twisted evenly, on a plane that turns about an oblique axis. With equal bending stiffnesses and an
even twist its moment GJ k t + EI (a' + T a'') b needs no distributed couple but that of the section's inertia; its shear force follows
from eq. (26). Beside it, without inertia, a cantilever under force and torque by an integration of the same equations from its foot.
"""

import math
from itertools import pairwise

import numpy as np
from pipe_helpers import STILL, bar, dense_equilibrium, free_step, rotation, rotation_vector_quaternion, times
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipe_fmu.results import section_forces
from pipe_fmu.step import system

LENGTH, MASS, EA, GA, GJ, EI, TIME = 10.0, 2.0, 1e5, 1e9, 80.0, 100.0, 0.1  # TIME: of the internal damping
INERTIA = np.array([0.4, 0.2, 0.2])
TWIST = 0.05
AXIS = np.array([1.0, -2.0, 2.0]) / 3.0
END = 0.4


def slope(f, x, d=0.03):
    """f'(x) by central differences of eighth order."""
    return sum(c * (f(x + k * d) - f(x - k * d)) for k, c in ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))) / d


def angle(s, t):
    return (0.5 + 0.4 * math.sin(1.1 * t)) * np.sin(0.35 * s + 0.3 * t)


def stretch(s, t):
    return 1.0 + 1e-3 * (1.0 + 0.5 * math.sin(2.0 * t)) * np.cos(0.3 * s)


def plane(t):
    return rotation_vector_quaternion(0.3 * math.sin(0.9 * t) * AXIS)


def tangent(s, t):
    """(..., 3)."""
    a = angle(s, t)
    return np.stack([np.cos(a), 0.0 * a, -np.sin(a)], axis=-1) @ rotation(plane(t)).T


def position(s, t):
    """(m, 3): the integral of the stretched tangent, by 24 Gauss points, and a drift."""
    x, w = np.polynomial.legendre.leggauss(24)
    at = 0.5 * s[:, None] * (1.0 + x)
    return 0.5 * s[:, None] * np.einsum("ijk,j->ik", tangent(at, t) * stretch(at, t)[..., None], w) + [0.2 * t, 0.0, 0.0]


def attitudes(s, t):
    """Quaternions (m, 4)."""
    plain = (times(plane(t), rotation_vector_quaternion((0.0, a, 0.0))) for a in angle(s, t))
    return np.array([times(q, rotation_vector_quaternion((TWIST * x, 0.0, 0.0))) for x, q in zip(s, plain, strict=True)])


def frames(s, t):
    """(m, 3, 3)."""
    return np.array([rotation(q) for q in attitudes(s, t)])


def damped(strain, t):
    """Strain and `lag` times its rate; `strain` a function of time."""
    return strain(t) + TIME * slope(strain, t)


def moment(s, t):
    bending = EI * damped(lambda at: slope(lambda x: angle(x, at), s), t)
    return GJ * TWIST * tangent(s, t) + bending[..., None] * rotation(plane(t))[:, 1]


def force(s, t):
    """Axial force by the law, shear force by moment balance m' + r' x n = 0 of the whole moment, viscous part included."""
    t1 = tangent(s, t)
    axial = EA * damped(lambda at: stretch(s, at) - 1.0, t)
    return axial[..., None] * t1 + np.cross(t1, slope(lambda x: moment(x, t), s)) / stretch(s, t)[..., None]


def velocity(s, t):
    return slope(lambda at: position(s, at), t)


def spins(s, t):
    """Angular velocities (m, 3), e."""
    w = slope(lambda at: frames(s, at), t) @ frames(s, t).transpose(0, 2, 1)
    return np.stack([w[:, 2, 1], w[:, 0, 2], w[:, 1, 0]], axis=-1)


def angular_momentum(s, t):
    r = frames(s, t)
    return np.einsum("nij,j,nkj,nk->ni", r, INERTIA, r, spins(s, t))


def rotation_between(one, two):
    """Rotation vectors (m, 3), e, from the frames `one` to `two`."""
    r = two @ one.transpose(0, 2, 1)
    turn = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=-1)
    return turn / (2.0 * np.sinc(np.arccos(0.5 * (np.trace(r, axis1=1, axis2=2) - 1.0)) / math.pi))[:, None]


def shares(s, t, density):
    """Work of a distributed load `density`(S) (m, 3) on parabolic arcs: (n - 1, 6) for the lower, for the upper end of every element.

    An arc (1 - x) r_1 + x r_2 + x (1 - x) (d x psi) / 2 with d the chord, psi the relative rotation; its variation is exact to first order.
    """
    h = np.diff(s)
    x, w = np.polynomial.legendre.leggauss(4)
    x, w = 0.5 * (1.0 + x), 0.5 * w
    f = h[:, None, None] * w[:, None] * density((s[:-1, None] + h[:, None] * x).ravel()).reshape(len(h), 4, 3)
    first, second, bulge = (np.einsum("ejk,j->ek", f, shape) for shape in (1.0 - x, x, x * (1.0 - x)))
    r = frames(s, t)
    psi = rotation_between(r[:-1], r[1:])
    pair, couple = 0.5 * np.cross(psi, bulge), 0.5 * np.cross(bulge, np.diff(position(s, t), axis=0))
    both = 0.5 * np.cross(psi, couple)
    return np.hstack([first - pair, both - couple]), np.hstack([second + pair, both + couple])


def loads(s, t):
    """Nodal loads (6 n,): the distributed one's, the couples of the sections' inertia, the ends' forces and moments."""
    lower, upper = shares(s, t, lambda at: MASS * slope(lambda x: velocity(at, x), t) - slope(lambda x: force(x, t), at))
    out = np.zeros((len(s), 6))
    out[:-1] += lower
    out[1:] += upper
    out[:, 3:] += np.convolve(np.diff(s), [0.5, 0.5])[:, None] * slope(lambda x: angular_momentum(s, x), t)
    ends = s[[0, -1]]
    out[[0, -1]] += np.array([[-1.0], [1.0]]) * np.hstack([force(ends, t), moment(ends, t)])
    return out.ravel()


def section_wrenches(line, s, state):
    """Section forces and moments (n, 6), material, of a state; to the recovery the distributed load is an inertial force the more."""
    x, q, v, rate = state
    strain = np.empty((len(s) - 1, 7))
    system.element_strains(line, x, q, strain)
    mass = section_forces.MassPerLength(*np.full((2, len(s) - 1), MASS))
    return section_forces.nodal_wrenches(line, mass, STILL, x, q, v, rate, strain)


def errors(elements, h):
    """Errors at END of nodes and frames [m, 1], section forces and moments [N, N m] (but near the foot); from the exact state at 0.

    The recovery takes the foot for one that stands, which this one does not: what it says of the lowest quarter is left out.
    """
    s, line = bar(LENGTH, elements + 1, axial=EA, shear=GA, torsion=GJ, bending=EI, mass=MASS, inertia=1.0)
    line = line._replace(inertia=line.inertia * INERTIA, damping=np.full(elements, TIME))
    v = velocity(s, 0.0) + slope(lambda t: line.offset[:, None] * tangent(s, t), 0.0)
    rate = np.einsum("nji,nj->ni", frames(s, 0.0), spins(s, 0.0))
    state = position(s, 0.0), attitudes(s, 0.0), v, rate
    for k in range(round(END / h)):
        state = free_step(line, state, h, load=loads(s, (k + 0.5) * h))
    wrench = section_wrenches(line, s, state)
    n, m = (np.einsum("nji,nj->ni", frames(s, END), f(s, END)) for f in (force, moment))
    pose = state[0] - position(s, END), np.array([rotation(q) for q in state[1]]) - frames(s, END)
    upper = slice(elements // 4 + 1, None)
    return *pose, (wrench[:, :3] - n)[upper], (wrench[:, 3:] - m)[upper]


def largest(fields):
    return np.array([np.abs(field).max() for field in fields])


def test_second_order_in_time():
    """Nodes, frames, section forces and moments: what halving the step changes, from 0.2 s and from 0.1 s."""
    found = [errors(8, h) for h in (0.2, 0.1, 0.05)]
    first, second = (largest(a - b for a, b in zip(*pair, strict=True)) for pair in pairwise(found))
    assert (np.log2(first / second) > 1.9).all()


def test_fourth_order_in_space():
    """Nodes and frames from 4 to 8 elements, section forces and moments from 8 to 16, the error in time taken out by Richardson's rule.

    Section forces: two at least, for axial inertia is lumped at the nodes, which errs by h^2 / 12 of its second derivative; moments and the
    line's shape depend on inertia across, which is of fourth order.
    """
    fine = {}
    for elements in (4, 8, 16):
        fields = zip(errors(elements, 0.05), errors(elements, 0.025), strict=True)
        fine[elements] = largest((4.0 * fine - coarse) / 3.0 for coarse, fine in fields)
    assert (np.log2(fine[4] / fine[8])[:2] > 3.6).all()
    force, moment = np.log2(fine[8] / fine[16])[2:]
    assert force > 2.0
    assert moment > 3.4


def cantilever(s, stiffness, force, moment):
    """Positions, attitudes (n, 4) and tip moment of a line from the origin under a dead tip force, by its moment at the foot."""

    def slope(_, y):
        r, m = y[3:12].reshape(3, 3), y[12:]
        gamma, k = np.array([1.0, 0.0, 0.0]) + r.T @ force / stiffness[:3], r.T @ m / stiffness[3:]
        hat = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
        return np.concatenate([r @ gamma, (r @ hat).ravel(), -np.cross(r @ gamma, force)])

    start = np.concatenate([np.zeros(3), np.eye(3).ravel(), moment])
    y = solve_ivp(slope, (0.0, s[-1]), start, method="DOP853", rtol=1e-11, atol=1e-11, t_eval=s).y.T
    quaternions = Rotation.from_matrix(y[:, 3:12].reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return y[:, :3], quaternions, y[-1, 12:]


def test_torque_and_bending_together_keep_the_fourth_order():
    """Foot moment (8, 20, 10), GJ = 80, EI = 100: two radians of bending, one of twist; nodes and frames, 8 to 16 elements."""
    both, force = [], np.array([3.0, 2.0, -4.0])
    for elements in (8, 16):
        s, line = bar(LENGTH, elements + 1, axial=EA, shear=GA, torsion=GJ, bending=EI)
        position, quaternion, moment = cantilever(s, np.array([EA, GA, GA, GJ, EI, EI]), force, np.array([8.0, 20.0, 10.0]))
        load = np.zeros((elements + 1, 6))
        load[-1] = *force, *moment
        x, q = dense_equilibrium(line, position, quaternion, np.arange(6, 6 * elements + 6), load=load.ravel())
        turn = np.array([rotation(a) - rotation(b) for a, b in zip(q, quaternion, strict=True)])
        both.append(largest((x - position, turn)))
    assert (np.log2(both[0] / both[1]) > 3.8).all()
