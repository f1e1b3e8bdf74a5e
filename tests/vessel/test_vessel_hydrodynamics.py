"""Forces of the vessel against their potentials, powers and the published hydrostatics."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import PchipInterpolator

from vessel_fmu.attitude import exp_quaternion, mean_rotation, multiply, rotation_matrix
from vessel_fmu.hydrodynamics import add_drag, add_restoring, hull_constants, restoring_energy
from vessel_fmu.parameters import AddedMass, HullDrag, VesselParameters, values
from vessel_fmu.rigid_body import add_coriolis

HULL = hull_constants(values(VesselParameters()))


def random_rotation(rng):
    return rotation_matrix(exp_quaternion(rng.uniform(-2.0, 2.0, 3), 1.0))


def restoring_force(heave, rotation):
    """Static force on the hull (6,), in b."""
    force, down = np.zeros(6), rotation[2].copy()
    add_restoring(HULL.stiffness, HULL.flotation, heave, down, down, np.zeros(6), 0.0, force)
    return -force


@pytest.mark.parametrize("seed", range(5))
def test_restoring_is_minus_the_gradient_of_its_potential(seed):
    rng = np.random.default_rng(seed)
    heave, rotation, d = rng.normal(), random_rotation(rng), 1e-5
    gradient = np.empty(6)

    def potential(heave, rotation):
        return restoring_energy(HULL.stiffness, HULL.flotation, heave, rotation)

    for i, unit in enumerate(np.eye(3)):
        shifted = [potential(heave + s * d * (rotation @ unit)[2], rotation) for s in (1, -1)]
        turned = [potential(heave, rotation @ rotation_matrix(exp_quaternion(unit, s * d))) for s in (1, -1)]
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


@pytest.mark.parametrize("h", [1e-3, 0.1, 1.0, 5.0])
@pytest.mark.parametrize("seed", range(3))
def test_mean_restoring_over_a_step_does_the_work_of_its_potential(seed, h):
    """Discrete gradient: h nu . g_mean = U_new - U_old for any mean velocity nu and any step, with the lift at the centre of flotation."""
    rng = np.random.default_rng(seed)
    heave, old, nu, force = rng.normal(), random_rotation(rng), np.concatenate([rng.normal(size=3), 0.3 * rng.normal(size=3)]), np.zeros(6)
    mean = old @ mean_rotation(nu[3:], h)
    add_restoring(HULL.stiffness, HULL.flotation, heave, old[2], mean[2], nu, h, force)
    new, moved = old @ rotation_matrix(exp_quaternion(nu[3:], h)), heave + h * (mean @ nu[:3])[2]
    before, after = (restoring_energy(HULL.stiffness, HULL.flotation, *pose) for pose in ((heave, old), (moved, new)))
    assert abs(h * nu @ force - (after - before)) < 1e-14 * (np.abs(h * nu * force).sum() + before + after)


MSS_C = np.diag([0.0, 0.0, 13910359.0, 133797350.0, 6467778000.0, 0.0])  # about the centre of gravity, ShipX output of MSS supply
MSS_C[2, 4] = MSS_C[4, 2] = 70729128.0


def test_stiffness_at_rest_is_that_of_mss_supply():
    """The whole matrix C, heave-pitch coupling included, about the centre of gravity; largest entry of a row sets the scale."""
    d, columns = 1e-6, []
    for i, unit in enumerate(np.eye(6)):
        turned = rotation_matrix(exp_quaternion(unit[3:], d))
        columns.append(-restoring_force(d * unit[2], turned) / d if i > 1 else np.zeros(6))
    scale = np.sqrt(np.outer(np.diag(MSS_C), np.diag(MSS_C)))
    assert_allclose(np.column_stack(columns), MSS_C, rtol=2e-4, atol=2e-5 * scale.max())


def test_mass_is_symmetric_positive_definite_and_that_of_mss_supply():
    mass = HULL.mass
    assert np.array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass)[0] > 0.0
    published = [6362208.5 + 846253.2, 6362208.5 + 7897997.9, 287307129.1 + 88812376.3, 2726142869.1 + 3357171472.8]
    assert_allclose(np.diag(mass)[[0, 2, 3, 4]], published, rtol=1e-4)
    identified = [1.134e7, 4.452e9]  # sway and yaw of the low-frequency model of Fossen, Sagatun and Sorensen in MSS supply.m
    assert_allclose(np.diag(mass)[[1, 5]], identified, rtol=0.1)


FREQUENCY = (0.2094395, 0.418879, 0.6283185, 0.8377581, 1.047198, 1.256637, 1.570796, 2.094395, 3.141593)  # rad/s
RADIATION = {  # MSS supply (ShipX) about the centre of gravity, SI units: A at the first of these frequencies, B at all
    "sway": (5.3723e6, (7183.2, 2.3651e5, 1.4712e6, 3.3752e6, 4.3333e6, 4.3103e6, 3.604e6, 2.3951e6, 1.0812e6)),
    "yaw": (2.2084e9, (1.8919e6, 6.0945e7, 3.8988e8, 1.0277e9, 1.5502e9, 1.6887e9, 1.5027e9, 1.0743e9, 5.5683e8)),
    "sway_yaw": (1.7018e7, (17333.0, 6.5879e5, 5.2253e6, 1.5817e7, 2.4949e7, 2.6578e7, 2.1945e7, 1.3899e7, 5.7397e6)),
}


@pytest.mark.parametrize("entry", RADIATION)
def test_added_mass_of_slow_sway_and_yaw_follows_from_the_radiation_by_kramers_kronig(entry):
    """A(0) = A(w) - 2 w^2 / pi PV int B(s) / (s^2 (s^2 - w^2)) ds, B falling like s^-3 beyond the data."""
    at, damping = RADIATION[entry]
    w, last, s = FREQUENCY[0], FREQUENCY[-1], np.linspace(0.0, FREQUENCY[-1], 20001)[1:]
    curve = PchipInterpolator((0.0, *FREQUENCY), (0.0, *(b / f**2 for b, f in zip(damping, FREQUENCY, strict=True))))
    smooth = (curve(s) - curve(w)) / np.where(np.isclose(s, w), np.inf, s**2 - w**2)
    integral = smooth.sum() * s[0] + curve(w) * np.log((last - w) / (last + w)) / (2.0 * w) + damping[-1] / (6.0 * last**3)
    assert getattr(AddedMass(), entry) == pytest.approx(at - 2.0 * w**2 / np.pi * integral, rel=0.02)


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
