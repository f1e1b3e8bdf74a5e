"""Forces of the vessel against their potentials, powers and the published hydrostatics."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vessel_fmu.attitude import exp_quaternion, mean_rotation, multiply, rotation_matrix
from vessel_fmu.hydrodynamics import add_drag, add_restoring, hull_constants, restoring_energy
from vessel_fmu.parameters import HullDrag, VesselParameters, mass_matrix
from vessel_fmu.rigid_body import add_coriolis

HULL = hull_constants(VesselParameters())


def random_rotation(rng):
    return rotation_matrix(exp_quaternion(rng.uniform(-2.0, 2.0, 3), 1.0))


def restoring_force(heave, rotation):
    """Static force on the hull (6,), in b."""
    force, down = np.zeros(6), rotation[2].copy()
    add_restoring(HULL.stiffness, heave, down, down, np.zeros(6), 0.0, force)
    return -force


@pytest.mark.parametrize("seed", range(5))
def test_restoring_is_minus_the_gradient_of_its_potential(seed):
    rng = np.random.default_rng(seed)
    heave, rotation, d = rng.normal(), random_rotation(rng), 1e-5
    gradient = np.empty(6)
    for i, unit in enumerate(np.eye(3)):
        shifted = [restoring_energy(HULL.stiffness, heave + s * d * (rotation @ unit)[2], rotation) for s in (1, -1)]
        turned = [restoring_energy(HULL.stiffness, heave, rotation @ rotation_matrix(exp_quaternion(unit, s * d))) for s in (1, -1)]
        gradient[i], gradient[3 + i] = np.diff(shifted[::-1])[0] / (2 * d), np.diff(turned[::-1])[0] / (2 * d)
    force = restoring_force(heave, rotation)
    assert_allclose(force[:3], -gradient[:3], atol=1e-6 * np.abs(force[:3]).max())
    assert_allclose(force[3:], -gradient[3:], atol=1e-6 * np.abs(force[3:]).max())


@pytest.mark.parametrize("seed", range(5))
def test_restoring_moment_has_no_vertical_component(seed):
    rng = np.random.default_rng(seed)
    rotation = random_rotation(rng)
    moment = rotation @ restoring_force(0.3, rotation)[3:]
    assert abs(moment[2]) < 1e-14 * np.abs(moment).max()


def test_stiffness_at_rest_is_that_of_mss_supply():
    """C33, C44, C55 about the centre of gravity in the ShipX output of the MSS supply vessel."""
    d = 1e-6
    heave = -restoring_force(d, np.eye(3))[2] / d
    roll = -restoring_force(0.0, rotation_matrix(exp_quaternion(np.array([1.0, 0.0, 0.0]), d)))[3] / d
    pitch = -restoring_force(0.0, rotation_matrix(exp_quaternion(np.array([0.0, 1.0, 0.0]), d)))[4] / d
    assert_allclose([heave, roll, pitch], [13910359.0, 133797350.0, 6467778000.0], rtol=2e-4)


def test_mass_is_symmetric_positive_definite_and_that_of_mss_supply():
    mass = mass_matrix(VesselParameters())
    assert np.array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass)[0] > 0.0
    published = [6362208.5 + 846253.2, 6362208.5 + 2816921.5, 6362208.5 + 7897997.9]
    published += [287307129.1 + 88812376.3, 2726142869.1 + 3357171472.8, 2726143000.0 + 1170076000.0]
    assert_allclose(np.diag(mass), published, rtol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_coriolis_force_has_no_power(seed):
    nu, force = np.random.default_rng(seed).normal(size=6), np.zeros(6)
    add_coriolis(HULL.mass, nu, force)
    assert abs(nu @ force) < 1e-14 * np.abs(nu * force).sum()


@pytest.mark.parametrize("seed", range(5))
def test_coriolis_force_is_kirchhoffs(seed):
    """dP/dt = P x w + f, dL/dt = L x w + P x v + m for the momenta P, L = M nu of any symmetric M (Kirchhoff; Lamb, ch. VI)."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 6))
    mass, nu, force = root @ root.T, rng.normal(size=6), np.zeros(6)
    momentum = mass @ nu
    add_coriolis(mass, nu, force)
    assert_allclose(force[:3], -np.cross(momentum[:3], nu[3:]), rtol=1e-12)
    assert_allclose(force[3:], -np.cross(momentum[3:], nu[3:]) - np.cross(momentum[:3], nu[:3]), rtol=1e-12)


def drag_of(nu):
    force = np.zeros(6)
    add_drag(HULL.surge_drag, HULL.strips, np.asarray(nu, dtype=float), force)
    return force


@pytest.mark.parametrize("seed", range(20))
def test_drag_takes_power_whatever_the_relative_velocity(seed):
    nu = np.random.default_rng(seed).normal(size=6)
    assert nu @ drag_of(nu) > 0.0


def test_drag_is_that_of_the_cross_flow_principle():
    """Beam current: 1/2 rho C_d L T v^2 amidships; yaw about midships: 1/2 rho C_d T L^4 / 32 r^2; ahead: frontal area."""
    drag = HullDrag()
    pressure = 0.5 * 1025.0 * drag.cross_flow_coefficient * drag.draft
    beam = drag_of([0.0, 0.8, 0.0, 0.0, 0.0, 0.0])
    assert_allclose(beam[1], pressure * drag.length * 0.8**2, rtol=1e-12)
    assert_allclose(beam[5], drag.midship * beam[1], rtol=1e-12)
    r = 0.01
    yawing = drag_of([0.0, -drag.midship * r, 0.0, 0.0, 0.0, r])
    assert abs(yawing[1]) < 1e-6
    assert_allclose(yawing[5], pressure * drag.length**4 / 32.0 * r**2, rtol=5e-3)
    ahead = drag_of([1.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert_allclose(ahead[0], 0.5 * 1025.0 * drag.surge_coefficient * drag.beam * drag.draft * 1.5**2, rtol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.5, 0.999999, 1.000001, 2.0, 3.0, 6.0])
def test_mean_rotation_gives_the_chord_of_the_turn(angle):
    """exp(theta) - I = A(theta) [theta]x, and A is the mean of exp(s theta) by Gauss quadrature."""
    w, h = np.array([0.6, -0.64, 0.48]) * 2.0, 0.5 * angle
    theta, mean = h * w, mean_rotation(np.array([0.6, -0.64, 0.48]) * 2.0, h)
    cross = np.array([[0.0, -theta[2], theta[1]], [theta[2], 0.0, -theta[0]], [-theta[1], theta[0], 0.0]])
    assert_allclose(mean @ cross, rotation_matrix(exp_quaternion(w, h)) - np.eye(3), atol=3e-16 * (1.0 + angle))
    station, weight = np.polynomial.legendre.leggauss(24)
    quadrature = sum(0.5 * b * rotation_matrix(exp_quaternion(w, 0.5 * (1 + a) * h)) for a, b in zip(station, weight, strict=True))
    assert_allclose(mean, quadrature, atol=1e-14)


def test_quaternion_product_is_the_product_of_the_rotations():
    p, q = (exp_quaternion(np.random.default_rng(seed).normal(size=3), 1.3) for seed in (1, 2))
    assert_allclose(rotation_matrix(multiply(p, q)), rotation_matrix(p) @ rotation_matrix(q), atol=1e-15)
    assert_allclose(rotation_matrix(exp_quaternion(np.array([0.0, 0.0, 1.0]), 0.3))[:, 0], [np.cos(0.3), np.sin(0.3), 0.0], atol=1e-16)
