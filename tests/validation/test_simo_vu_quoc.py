"""Simo, J. C., and Vu-Quoc, L. (1986), On the dynamics of flexible beams under large overall motions, J. Appl. Mech. 53, and (1988), On the
dynamics in space of rods undergoing large motions, Comput. Methods Appl. Mech. Eng. 66: free flight and a right-angle cantilever, with
momenta, energy and their orders."""

import math
from itertools import pairwise

import numpy as np
from pipe_helpers import bar, centres, free_step, rotation, rotation_vector_quaternion, straight
from rods import at_rest, energy


def hat_load(peak_at, until):
    """Mean over (a, b) of a load that rises from 0 to 1 at `peak_at` and falls to 0 at `until`, linear between."""

    def impulse(t):
        t = min(t, until)
        rising = 0.5 * min(t, peak_at) ** 2 / peak_at
        left = max(t - peak_at, 0.0)
        return rising + left - 0.5 * left**2 / (until - peak_at)

    return lambda a, b: (impulse(b) - impulse(a)) / (b - a)


def momenta(line, state):
    """Linear and angular momentum about the origin."""
    position, attitude, velocity, rate = state
    p = line.mass[:, None] * velocity
    spins = [rotation(q) @ (j * w) for q, j, w in zip(attitude, line.inertia, rate, strict=True)]
    return p.sum(axis=0), np.cross(centres(line, position, attitude), p).sum(axis=0) + np.sum(spins, axis=0)


def spaghetti(h, end, load, mean, bending, nodes=11):
    """(line, states) of the free rod from (6, 0) to (0, 8) under `load` (6,) times `mean` at its lower end."""
    s, line = bar(10.0, nodes, axial=1e4, shear=1e4, torsion=bending, bending=bending, inertia=1.0)
    line = line._replace(inertia=line.inertia * [20.0, 10.0, 10.0])
    position, attitude = straight(s, (-0.6, 0.8, 0.0), rotation_vector_quaternion((0.0, 0.0, math.atan2(0.8, -0.6))))
    states = [at_rest(position + np.array([6.0, 0.0, 0.0]), attitude)]
    nodal = np.concatenate([load, np.zeros(6 * nodes - 6)])
    for k in range(round(end / h)):
        states.append(free_step(line, states[-1], h, load=mean(k * h, (k + 1) * h) * nodal))
    return line, states


def test_simo_and_vu_quoc_flying_spaghetti_in_space():
    """Simo and Vu-Quoc (1988): EA = GA = 1e4, EI = GJ = 500, rho A = 1, J = (20, 10, 10); T rises to 200 at 2.5 s and is gone at 5 s.

    Force T / 10 along e1, moments -T / 2 about e2 and -T about e3. Analytic: momentum 50, from 5 s on the centre at (3 + 5 (t - 2.5), 4).
    After that energy and linear momentum stand to 1e-12; the angular momentum is the impulse of the loads' moments, by the path of the
    loaded end, and wavers, both to second order.
    """
    wavering, missing, ends = [], [], []
    load, mean = np.array([20.0, 0.0, 0.0, 0.0, -100.0, -200.0]), hat_load(2.5, 5.0)
    for h in (0.1, 0.05):
        line, states = spaghetti(h, 10.0, load, mean, 500.0)
        free = states[round(5.0 / h) :]
        linear, angular = (np.array(a) for a in zip(*(momenta(line, state) for state in free), strict=True))
        np.testing.assert_allclose(linear, np.tile([50.0, 0.0, 0.0], (len(free), 1)), atol=1e-10)
        total = [energy([line], state) for state in free]
        assert np.ptp(total) < 1e-11 * total[0]
        centre = line.mass @ centres(line, *free[-1][:2]) / line.mass.sum()
        np.testing.assert_allclose(centre, [3.0 + 5.0 * 7.5, 4.0, 0.0], atol=1e-9)
        wavering.append(np.linalg.norm(angular - angular[0], axis=1).max() / np.linalg.norm(angular[0]))
        ends.append(free[-1][0][0])
        impulse = np.zeros(3)
        for k, (old, new) in enumerate(pairwise(states[: round(5.0 / h) + 1])):
            moment = load[3:] + np.cross(0.5 * (old[0][0] + new[0][0]), load[:3])
            impulse += h * mean(k * h, (k + 1) * h) * moment
        missing.append(np.linalg.norm(angular[0] - momenta(line, states[0])[1] - impulse) / np.linalg.norm(impulse))
    for error in (wavering, missing):
        assert error[0] < 1e-3
        assert math.log2(error[0] / error[1]) > 1.8
    np.testing.assert_allclose(ends[0], ends[1], atol=0.2)


def test_simo_and_vu_quoc_flying_spaghetti_in_its_plane():
    """Simo and Vu-Quoc (1986): as in space, EI = 100, force 8 along e1 and moment -80 about e3 for 2.5 s, then none. Momentum 20.

    A plane motion stays one, to round-off; energy and linear momentum stand, angular momentum to second order.
    """
    wavering = []
    for h in (0.1, 0.05):
        line, states = spaghetti(h, 6.0, [8.0, 0.0, 0.0, 0.0, 0.0, -80.0], lambda a, b: float(b < 2.5 + 1e-9), 100.0)
        free = states[round(2.5 / h) :]
        linear, angular = (np.array(a) for a in zip(*(momenta(line, state) for state in free), strict=True))
        np.testing.assert_allclose(linear, np.tile([20.0, 0.0, 0.0], (len(free), 1)), atol=1e-10)
        total = [energy([line], state) for state in free]
        assert np.ptp(total) < 1e-11 * total[0]
        assert np.abs(free[-1][0][:, 2]).max() < 1e-10
        wavering.append(np.ptp(angular[:, 2]) / abs(angular[0, 2]))
    assert math.log2(wavering[0] / wavering[1]) > 1.8


def elbow(h, nodes):
    """(times, heights of elbow and tip, energies, work of the kick) of the right-angle cantilever over 30 s."""
    s, arm = bar(10.0, nodes, axial=1e6, shear=1e6, torsion=1e3, bending=1e3, inertia=1.0)
    arm = arm._replace(inertia=arm.inertia * [20.0, 10.0, 10.0])
    inner, attitude = straight(s)
    outer, across = straight(s, (0.0, 1.0, 0.0), rotation_vector_quaternion((0.0, 0.0, 0.5 * math.pi)))
    state = at_rest(np.vstack([inner, outer + inner[-1]]), np.vstack([attitude, across]))
    load, mean = np.zeros(12 * nodes - 6), hat_load(1.0, 2.0)
    load[6 * nodes - 4] = 50.0
    rows, work = [], 0.0
    for k in range(round(30.0 / h)):
        before = state[0][nodes - 1, 2]
        state = free_step([arm, arm], state, h, load=mean(k * h, (k + 1) * h) * load, held=range(6))
        work += 50.0 * mean(k * h, (k + 1) * h) * (state[0][nodes - 1, 2] - before)
        rows.append(((k + 1) * h, state[0][nodes - 1, 2], state[0][-1, 2], energy([arm, arm], state), work))
    return np.array(rows).T


def test_simo_and_vu_quoc_right_angle_cantilever():
    """Simo and Vu-Quoc (1988): two arms of 10, EA = GA = 1e6, EI = GJ = 1e3, rho A = 1, J = (20, 10, 10); 2 s kick of 50 at the elbow.

    Published curves: free swings for 30 s, the elbow's to about 6, the tip's to about 10, as long as an arm; read to half a unit. The
    energy is the work of the kick and stands. Histories, 5 elements an arm and 0.125 s, to 0.3 of those at half the step, on half the mesh.
    """
    t, *heights, total, work = elbow(0.125, 6)
    np.testing.assert_allclose(total, work, atol=1e-10 * total[-1])
    assert np.ptp(work[t > 2.0 - 1e-9]) == 0.0
    np.testing.assert_allclose(np.abs(heights).max(axis=1), [6.0, 10.0], atol=0.5)
    for _, *others, _, _ in (elbow(0.0625, 6), elbow(0.125, 11)):
        stride = len(others[0]) // len(t)
        np.testing.assert_allclose([other[stride - 1 :: stride] for other in others], heights, atol=0.3)
