"""The two-node element: its strains on exact shapes, its gradients and stiffness against differences, its indifference to the frame."""

import math

import element_twin
import numpy as np
import pytest
from pipe_helpers import rotation, rotation_vector_quaternion, times
from scipy.linalg import expm
from scipy.special import bernoulli, factorial

from pipe_fmu.element import assembly, geometric_stiffness
from pipe_fmu.element import strains as element
from pipe_fmu.line import shear_stiffness
from pipe_fmu.maths import relative_rotation

LENGTH = 7.0
SHARE = np.array([0.91, 0.64])
NO_SHARE = np.zeros(2)
# relative rotations on both sides of every switch between series and closed form (|psi| = 0.2 and 0.6), and a large one
BENDS = [(0.0, 0.0, 0.0), (1e-4, 2e-4, -1e-4), (0.03, -0.15, 0.12), (0.0, 0.2001, 0.0)]
BENDS += [(0.1, -0.4, 0.43), (0.2, 0.4, -0.4), (0.9, -1.1, 0.7)]
SHARES = [pytest.param(SHARE, id="anisotropic"), pytest.param(np.full(2, 0.97), id="isotropic"), pytest.param(NO_SHARE, id="no-share")]


def hat(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


CHORDS = [pytest.param((1.02 * LENGTH, 0.21, -0.34), id="small-angle")]
for _angle in (80.0, 100.0, 150.0):  # deg, between the chord and t1
    _along, _across = 0.9 * LENGTH * math.cos(math.radians(_angle)), 0.9 * LENGTH * math.sin(math.radians(_angle))
    CHORDS.append(pytest.param((_along, 0.6 * _across, -0.8 * _across), id=f"{_angle:g}-degrees"))


def pose(bend, chord=(1.02 * LENGTH, 0.21, -0.34), seed=3):
    """(q1, q2, d): an element turned anywhere, with the relative rotation `bend` and a chord off the mid frame."""
    random = np.random.default_rng(seed)
    q1 = rotation_vector_quaternion(random.normal(size=3))
    q2 = times(q1, rotation_vector_quaternion(bend))
    mid = rotation(times(q1, rotation_vector_quaternion(0.5 * np.array(bend))))
    return q1, q2, mid @ np.array(chord)


def strains(q1, q2, d, share):
    out = np.empty(element.ROWS)
    element.strains(*element.frame(tuple(q1), tuple(q2), tuple(d)), np.dot(d, d) - LENGTH**2, LENGTH, share, out)
    return out


def gradients(q1, q2, d, share):
    out = np.empty((element.ROWS, 9))
    element.gradients(*element.frame(tuple(q1), tuple(q2), tuple(d)), LENGTH, share, out)
    return out


def moved(q1, q2, d, motion):
    """The element after (chord, mean spin, spin difference), a nine of small numbers."""
    mean, difference = motion[3:6], motion[6:9]
    return (
        times(rotation_vector_quaternion(mean - 0.5 * difference), q1),
        times(rotation_vector_quaternion(mean + 0.5 * difference), q2),
        d + motion[:3],
    )


def central(function, step=5e-4):
    """Derivative of `function` of nine with respect to each of them, by differences of fourth order."""
    columns = []
    for motion in step * np.eye(9):
        near, far = (function(k * motion) - function(-k * motion) for k in (1.0, 2.0))
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("chord", CHORDS)
@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("bend", BENDS)
def test_strain_gradients_are_central_differences(bend, share, chord):
    at = pose(bend, chord)
    expected = central(lambda motion: strains(*moved(*at, motion), share))
    np.testing.assert_allclose(gradients(*at, share), expected, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("chord", CHORDS)
@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("bend", BENDS)
def test_geometric_stiffness_is_the_derivative_of_the_gradients(bend, share, chord):
    at = pose(bend, chord)
    stress = np.array([3.0, -1.2, 0.7, 2.1, -0.8, 1.7, 0.9])
    got = np.empty((9, 9))
    geometric_stiffness.geometric_stiffness(*element.frame(*(tuple(x) for x in at)), LENGTH, share, stress, got)
    expected = central(lambda motion: stress @ gradients(*moved(*at, motion), share))
    np.testing.assert_allclose(got, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("chord", CHORDS)
@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("bend", BENDS)
def test_resultant_is_the_stress_times_the_gradients(bend, share, chord):
    at = pose(bend, chord)
    stress = np.array([3.0, -1.2, 0.7, 2.1, -0.8, 1.7, 0.9])
    got = np.empty(9)
    element.resultant(*element.frame(*(tuple(x) for x in at)), LENGTH, share, stress, got)
    np.testing.assert_allclose(got, stress @ gradients(*at, share), atol=1e-13 * np.abs(got).max())


@pytest.mark.parametrize("chord", CHORDS)
@pytest.mark.parametrize("bend", BENDS)
def test_the_kernels_are_the_twin_in_numpy(bend, chord):
    """Strains, sag, energy, and the forces of both nodes as differences of the twin's energy."""
    q1, q2, d = pose(bend, chord)
    stiffness = np.array([3e9, 4e8, 4e8, 6e7, 8e7, 5e7])
    k, share = element_twin.chord_shear(LENGTH, stiffness)
    one, two = (np.zeros(3), rotation(q1)), (np.array(d), rotation(q2))
    strain, sag = element_twin.strains(one, two, LENGTH, stiffness)
    np.testing.assert_allclose(strains(q1, q2, d, share), [*strain, sag], rtol=1e-11, atol=1e-13)
    modulus = LENGTH * np.array([stiffness[0], *k, *stiffness[3:]])
    nine, twelve = (modulus * strain) @ gradients(q1, q2, d, share)[:6], np.empty(12)
    assembly.expand(nine, twelve)
    expected = element_twin.forces(one, two, LENGTH, stiffness)
    np.testing.assert_allclose(twelve, expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("angle", [1.0, 30.0, 80.0, 100.0, 150.0, 179.0])
def test_shear_is_twice_the_tangent_of_half_the_angle_of_the_chord_and_tension_counts_its_sine(angle):
    """A straight element: nothing but the angle a between chord and sections; the extension by bending is a tenth of 4 sin^2(a / 2)."""
    a, size = math.radians(angle), 0.9
    q1, q2, d = pose((0.0, 0.0, 0.0), LENGTH * size * np.array([math.cos(a), 0.6 * math.sin(a), -0.8 * math.sin(a)]))
    got = strains(q1, q2, d, np.full(2, 0.97))
    np.testing.assert_allclose(got[1:3], 2.0 * size * math.tan(0.5 * a) * np.array([0.6, -0.8]), rtol=1e-10)
    assert got[0] == pytest.approx(size - 1.0 + 0.4 * (0.97 * size * math.sin(0.5 * a)) ** 2, rel=1e-12)
    np.testing.assert_allclose(got[3:6], 0.0, atol=1e-15)


@pytest.mark.parametrize("turn", [(0.7, -0.2, 0.4), (0.0, math.pi / 2, 0.0), (-2.0, 1.5, 1.0)])
def test_strains_do_not_feel_a_rigid_motion(turn):
    q1, q2, d = pose((0.1, -0.4, 0.43))
    q = rotation_vector_quaternion(turn)
    before = strains(q1, q2, d, SHARE)[: element.STRAINS]
    after = strains(times(q, q1), times(q, q2), rotation(q) @ d, SHARE)[: element.STRAINS]
    np.testing.assert_allclose(after, before, atol=2e-15)  # rounding of numbers of size 1


def test_gradients_turn_with_the_element_and_leave_rigid_motions_free_of_work():
    q1, q2, d = pose((0.1, -0.4, 0.43))
    q = rotation_vector_quaternion((0.7, -0.2, 0.4))
    rows = gradients(q1, q2, d, SHARE)[: element.STRAINS]
    turned = gradients(times(q, q1), times(q, q2), rotation(q) @ d, SHARE)[: element.STRAINS]
    np.testing.assert_allclose(turned.reshape(-1, 3, 3), rows.reshape(-1, 3, 3) @ rotation(q).T, atol=1e-14)
    np.testing.assert_allclose(np.cross(d, rows[:, :3]) + rows[:, 3:6], 0.0, atol=1e-14)  # moments of the ends balance


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("strain", [0.0, 0.03, -0.02])
@pytest.mark.parametrize("kappa", [(0.0, 0.0, 0.0), (0.0, 0.12, -0.05), (0.21, 0.0, 0.0), (0.0, 0.0, 0.4)])
def test_an_arc_and_a_twisted_bar_are_exact(share, strain, kappa):
    gamma = np.array([1.0 + strain, 0.0, 0.0])
    q1, q2, d = helix(gamma, np.array(kappa))
    got = strains(q1, q2, d, share)
    np.testing.assert_allclose(got[: element.STRAINS], [strain, 0, 0, *kappa], atol=3e-15)


@pytest.mark.parametrize("kappa", [(0.1, 0.12, -0.05), (0.02, -0.3, 0.1), (0.3, 0.03, 0.02)])
def test_length_and_bending_of_a_helix_are_exact_and_its_shear_fourth_order(kappa):
    """What is left of shear: psi_1 psi_2 |psi|^2 / 576 at most, by expansion of the exponential map."""
    kappa = np.array(kappa)
    q1, q2, d = helix(np.array([1.03, 0.0, 0.0]), kappa)
    got = strains(q1, q2, d, NO_SHARE)
    np.testing.assert_allclose(got[[0, 3, 4, 5]], [0.03, *kappa], atol=3e-15)
    psi = LENGTH * kappa
    bound = 1.03 * abs(psi[0]) * math.hypot(psi[1], psi[2]) * (psi @ psi) / 576
    assert np.hypot(got[1], got[2]) <= bound


def helix(gamma, kappa):
    """Ends of a line of constant strain: the exponential map of SE(3)."""
    q1 = rotation_vector_quaternion((0.5, -0.9, 0.3))
    twist = np.zeros((4, 4))
    twist[:3, :3], twist[:3, 3] = hat(kappa), gamma
    motion = expm(LENGTH * twist)
    return q1, times(q1, rotation_vector_quaternion(LENGTH * kappa)), rotation(q1) @ motion[:3, 3]


def test_sag_is_the_rise_of_the_arc_above_its_chord():
    """A flat arc of turn psi stands h psi / 8 above its chord; the parabola x (1 - x) c has c / 4 there."""
    psi = 0.01
    q1, q2, d = helix(np.array([1.0, 0.0, 0.0]), np.array([0.0, psi / LENGTH, 0.0]))
    upright = np.array([math.cos(0.25), 0.0, -math.sin(0.25), 0.0])  # anywhere in the x-z plane
    inverse = q1 * np.array([1, -1, -1, -1])
    turn = times(upright, inverse)
    got = strains(times(turn, q1), times(turn, q2), rotation(turn) @ d, NO_SHARE)[6]
    mid = rotation(times(turn, times(q1, rotation_vector_quaternion((0.0, 0.5 * psi, 0.0)))))
    assert got / 4 == pytest.approx(LENGTH * psi / 8 * mid[2, 2], rel=1e-4)  # the arc bulges along +t3; psi^2 / 100


def test_chord_stiffness_is_that_of_a_timoshenko_bar_with_linear_moment():
    """Cantilever of one element under a tip force: deflection L^3 / 3 EI + L / GA, slope L^2 / 2 EI (Timoshenko)."""
    bending, shear, force = 8.0e4, 3.0e5, 1e-3
    k, p = shear_stiffness(shear, bending, LENGTH)
    share = np.array([p, p])
    rows = gradients(np.array([1.0, 0, 0, 0]), np.array([1.0, 0, 0, 0]), np.array([LENGTH, 0, 0]), share)
    moduli = np.array([1e9, k, k, 5e4, bending, bending])
    wide = np.empty((element.STRAINS, 12))
    for row, out in zip(rows, wide, strict=False):
        assembly.expand(row, out)
    stiffness = LENGTH * wide.T @ (moduli[:, None] * wide)
    tip = np.linalg.solve(stiffness[6:, 6:], force * np.eye(6)[2])
    assert tip[2] == pytest.approx(force * (LENGTH**3 / (3 * bending) + LENGTH / shear), rel=1e-12)
    assert tip[4] == pytest.approx(-force * LENGTH**2 / (2 * bending), rel=1e-12)


def test_assembly_maps_are_transposes_of_chord_and_spins():
    random = np.random.default_rng(1)
    row, x, nine = random.normal(size=9), random.normal(size=12), random.normal(size=(9, 9))
    chord = np.concatenate([x[6:9] - x[0:3], 0.5 * (x[3:6] + x[9:12]), x[9:12] - x[3:6]])
    twelve = np.empty(12)
    assembly.expand(row, twelve)
    assert twelve @ x == pytest.approx(row @ chord, rel=1e-13)
    wide = np.empty((12, 12))
    assembly.expand_matrix(nine, wide)
    assert x @ wide @ x == pytest.approx(chord @ nine @ chord, rel=1e-13)


def test_series_of_the_relative_rotation_are_those_of_bernoullis_numbers():
    """a / sin a = sum (2^2n - 2) |B_2n| a^2n / (2n)!, tan x = sum 4^n (4^n - 1) |B_2n| x^(2n - 1) / (2n)!; either side of their bounds."""
    n = np.arange(1, 30)
    size = np.abs(bernoulli(58)[2::2]) / factorial(2 * n)
    chi = (2.0 ** (2 * n) - 2.0) * size / 4.0**n  # of z^(n - 1), z = 4 a^2
    half = 4.0**n * (4.0**n - 1.0) * size / 4.0 / 4.0 ** (2 * n - 1) * 2.0  # tan(a / 2) / (4 a), x = a / 2 = sqrt(z) / 4
    for z in (0.01, 0.0399, 0.359, 0.361, 2.0):
        expected = [chi @ z ** (n - 1.0), (chi * (n - 1)) @ z ** (n - 2.0), (chi * (n - 1) * (n - 2)) @ z ** (n - 3.0)]
        found = relative_rotation.chi_of(z)
        np.testing.assert_allclose(found[:2], expected[:2], rtol=1e-11)
        assert found[2] == pytest.approx(expected[2], rel=1e-8)  # for tangents only
        expected = [half @ z ** (n - 1.0), (half * (n - 1)) @ z ** (n - 2.0)]
        np.testing.assert_allclose(relative_rotation.half_spin(z), expected, rtol=1e-11)
