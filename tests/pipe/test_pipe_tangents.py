"""Residual and tangent of the assembled line: gradient of the potentials, mass and stiffness, the same in any frame and on any path."""

import numpy as np
import pytest
from pipe_helpers import bar, dense_equilibrium, rotation, rotation_vector_quaternion, static_system, straight, turned
from rods import matrices


def test_loads_turn_and_unload_leave_no_strain():
    """Path independence and frame indifference: loaded, turned by 2 rad as a whole, unloaded."""
    s, line = bar(10.0, 6, axial=1e5, shear=5e4, torsion=80.0, bending=120.0, bending_3=90.0)
    load = np.zeros(36)
    load[-6:] = [-3.0, 2.0, 4.0, 2.0, -5.0, 3.0]
    free = np.arange(6, 36)
    position, attitude = dense_equilibrium(line, *straight(s), free, load)
    assert sum(static_system(line, position, attitude)[2]) > 1.0
    turn = rotation_vector_quaternion((0.8, -1.6, 0.9))
    r = rotation(turn)
    theta = np.tile([0.8, -1.6, 0.9], (6, 1))
    position, attitude = position @ r.T, turned(position, attitude, np.hstack([0 * position, theta]))[1]
    back = dense_equilibrium(line, position, attitude, free)
    residual, _, potentials = static_system(line, *back)
    assert sum(potentials) < 1e-20
    np.testing.assert_allclose(residual, 0.0, atol=1e-7)
    np.testing.assert_allclose(back[0], straight(s)[0] @ r.T, atol=1e-9)


def test_static_residual_is_the_gradient_of_the_potentials():
    """Elastic and gravity: every nodal unknown of a random line, by central differences."""
    random = np.random.default_rng(0)
    n = 5
    s, line = bar(40.0, n, axial=5e5, shear=2e5, torsion=8e4, bending=2e5, bending_3=5e5, weight=700.0)
    x = random.normal(size=(n, 6)) * [0.3, 0.3, 0.3, 0.2, 0.2, 0.2]
    at = turned(*straight(s), x)
    residual, tangent, _ = static_system(line, *at)
    step = 1e-5
    for k in range(6 * n):
        d = np.zeros(6 * n)
        d[k] = step
        up, down = (static_system(line, *turned(*at, sign * d.reshape(n, 6))) for sign in (1, -1))
        assert (sum(up[2]) - sum(down[2])) / (2 * step) == pytest.approx(residual[k], rel=1e-6, abs=1e-7 * np.abs(residual).max())
        np.testing.assert_allclose(tangent[:, k], (up[0] - down[0]) / (2 * step), atol=1e-7 * np.abs(tangent).max())


def test_tangent_of_a_step_at_rest_is_mass_and_stiffness():
    s, line = bar(100.0, 9, axial=1e7, shear=1e7, torsion=1e5, bending=1e5, weight=300.0, mass=20.0)
    position, attitude = turned(*straight(s), 0.01 * np.random.default_rng(1).normal(size=(9, 6)))
    mass, stiffness = matrices(line, position, attitude)
    np.testing.assert_allclose(stiffness, static_system(line, position, attitude)[1], atol=1e-9 * np.abs(stiffness).max())
    np.testing.assert_allclose(mass[::6, ::6].sum(), 20.0 * 100.0, rtol=1e-6)  # the whole mass moves
