"""Dynamic benchmarks of the field: free flight and a right-angle cantilever, with momenta, energy and their orders."""

import math
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from pipe_helpers import bar, centres, free_step, rotation, rotation_vector_quaternion, static_system, straight
from scipy.integrate import solve_ivp


def at_rest(position, attitude):
    """State of rest."""
    zero = np.zeros_like(position)
    return position, attitude, zero, zero


def hat_load(peak_at, until):
    """Mean over (a, b) of a load that rises from 0 to 1 at `peak_at` and falls to 0 at `until`, linear between."""

    def impulse(t):
        t = min(t, until)
        rising = 0.5 * min(t, peak_at) ** 2 / peak_at
        left = max(t - peak_at, 0.0)
        return rising + left - 0.5 * left**2 / (until - peak_at)

    return lambda a, b: (impulse(b) - impulse(a)) / (b - a)


def energy(lines, state):
    """Kinetic and elastic energy [J]."""
    first, total = 0, 0.0
    for line in lines:
        position, attitude, velocity, rate = (a[first : first + len(line.mass)] for a in state)
        first += len(line.mass)
        total += 0.5 * line.mass @ (velocity**2).sum(axis=1) + 0.5 * (line.inertia * rate**2).sum()
        total += sum(static_system(line, position, attitude)[2])
    return total


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


SOFT = {"axial": 400.0, "shear": 150.0, "bending": 0.02, "inertia": 1e-3}  # a rubber rod of 1 m and 1 kg
GRAVITY = 9.81


def spectral_pendulum(modes, times):
    """Tips (len(times), 2), along e1 and e3, of the soft rod let go from the horizontal: Legendre series, nothing of pipe_fmu.

    Plane Simo-Reissner rod hinged at s = 0, phi' = (1 + e) t + g n, t = (cos a, sin a): Lagrange's equations of the coefficients of the
    angle a, the extension e and the shear g, integrated by Dormand and Prince's eighth-order method.
    """
    x, w = legendre.leggauss(2 * modes + 8)
    w = 0.5 * w
    shapes = legendre.legvander(x, modes - 1)
    slopes = 2.0 * np.array([legendre.legval(x, legendre.legder(one)) for one in np.eye(modes)]).T
    sums = 0.5 * np.array([legendre.legval(x, legendre.legint(one, lbnd=-1)) for one in np.eye(len(x))]).T
    from_hinge = sums @ np.linalg.inv(legendre.legvander(x, len(x) - 1))

    def fields(y):
        angle, extension, shear = (shapes @ y.reshape(3, modes).T).T
        t, n = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        return extension, shear, t, n, (1.0 + extension) * t + shear * n

    def motion(_, y):
        extension, shear, t, n, stretch = fields(y[: 3 * modes])
        turning, growing, sliding = (shapes @ y[3 * modes :].reshape(3, modes).T).T
        across = (1.0 + extension) * n - shear * t
        ways = [from_hinge @ np.hstack([v[:, None] * shapes for v in parts]) for parts in zip(across, t, n, strict=True)]
        drift = from_hinge @ (2.0 * turning * (growing * n - sliding * t) - turning**2 * stretch).T
        mass = sum(way.T @ (w[:, None] * way) for way in ways)
        mass[:modes, :modes] += shapes.T @ (SOFT["inertia"] * w[:, None] * shapes)
        force = -ways[0].T @ (w * drift[:, 0]) - ways[1].T @ (w * (drift[:, 1] - GRAVITY))
        force[:modes] -= SOFT["bending"] * slopes.T @ (w * (slopes @ y[:modes]))
        force[modes : 2 * modes] -= SOFT["axial"] * shapes.T @ (w * extension)
        force[2 * modes :] -= SOFT["shear"] * shapes.T @ (w * shear)
        return np.concatenate([y[3 * modes :], np.linalg.solve(mass, force)])

    found = solve_ivp(motion, (0.0, times[-1]), np.zeros(6 * modes), method="DOP853", rtol=1e-8, atol=1e-10, t_eval=times)
    return np.array([fields(y[: 3 * modes])[4] @ w for y in found.y.T])


def test_swinging_pendulum_of_a_soft_rod():
    """EA = 400, GA = 150, EI = 0.02, 1 m, 1 kg, let go from the horizontal: the tip against a spectral solution for 0.8 s, a swing across.

    Ours is within 4e-3 m with 16 elements and 0.01 s, 1.2e-3 with 32 and 0.005 s (the spectral one, 12 modes: 5e-4); the energy stands.
    """
    times = 0.2 * np.arange(1, 5)
    exact = spectral_pendulum(12, times)
    for elements, h, tolerance in ((16, 0.01, 4e-3), (32, 0.005, 1.2e-3)):
        stiffness = {"axial": SOFT["axial"], "shear": SOFT["shear"], "torsion": SOFT["bending"], "bending": SOFT["bending"]}
        s, line = bar(1.0, elements + 1, weight=GRAVITY, inertia=SOFT["inertia"], **stiffness)
        states = [at_rest(*straight(s))]
        for _ in range(round(times[-1] / h)):
            states.append(free_step(line, states[-1], h, held=[0, 1, 2, 3, 5]))
        tips = np.array([states[round(t / h)][0][-1, [0, 2]] for t in times])
        np.testing.assert_allclose(tips, exact, atol=tolerance)
        np.testing.assert_allclose([energy([line], state) for state in states], 0.0, atol=1e-11)
