"""A soft rod swings: against a spectral solution of its equations that uses nothing of pipe_fmu."""

import numpy as np
from numpy.polynomial import legendre
from pipe_helpers import bar, free_step, straight
from rods import at_rest, energy
from scipy.integrate import solve_ivp

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
