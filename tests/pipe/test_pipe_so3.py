"""Rotations and the block tridiagonal elimination of the pipe against plain numpy and scipy."""

import math

import numpy as np
import pytest
from pipe_helpers import assembled, rotation, rotation_vector_quaternion, times
from scipy.linalg import expm

from pipe_fmu.maths import block_tridiagonal, so3

ANGLES = [0.0, 1e-9, 1e-5, 1.9e-4, 2.1e-4, 1e-3, 0.3, 1.0, 2.0, 3.0, 3.14]
AXIS = np.array([0.36, -0.48, 0.8])


def hat(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_is_the_matrix_exponential_of_the_skew_matrix(angle):
    q = so3.exp(tuple(angle * AXIS))
    np.testing.assert_allclose(so3.matrix(q), expm(angle * hat(AXIS)), atol=4e-15)  # a few roundings of numbers of size 1
    np.testing.assert_allclose(so3.matrix(q), rotation(q), atol=1e-15)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_log_inverts_exp_for_both_signs_of_the_quaternion(angle, sign):
    q = tuple(sign * x for x in so3.exp(tuple(angle * AXIS)))
    np.testing.assert_allclose(so3.log(q), angle * AXIS, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_root_squared_is_the_rotation_and_turns_by_half_the_angle(angle, sign):
    q = tuple(sign * x for x in so3.exp(tuple(angle * AXIS)))
    half = so3.root(q)
    np.testing.assert_allclose(so3.log(half), 0.5 * angle * AXIS, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(so3.matrix(so3.multiply(half, half)), so3.matrix(q), atol=4e-15)


def test_product_turns_first_with_the_right_factor():
    p, q = so3.exp((0.4, -1.1, 0.7)), so3.exp((-0.9, 0.2, 0.5))
    np.testing.assert_allclose(so3.matrix(so3.multiply(p, q)), rotation(p) @ rotation(q), atol=1e-15)
    np.testing.assert_allclose(so3.multiply(p, q), times(np.array(p), np.array(q)), atol=1e-15)
    np.testing.assert_allclose(so3.multiply(so3.conjugate(p), p), (1, 0, 0, 0), atol=1e-15)


def test_matrix_application_and_vector_products_are_numpys():
    m = so3.matrix(so3.exp((0.4, -1.1, 0.7)))
    a, b = (0.3, -2.0, 1.7), (-1.2, 0.4, 0.9)
    np.testing.assert_allclose(so3.apply(m, a), np.array(m) @ a, rtol=1e-14)
    np.testing.assert_allclose(so3.apply_transposed(m, a), np.array(m).T @ a, rtol=1e-14)
    np.testing.assert_allclose(so3.cross(a, b), np.cross(a, b), rtol=1e-14)
    assert so3.dot(a, b) == pytest.approx(np.dot(a, b), rel=1e-14)


@pytest.mark.parametrize("angle", [0.0, 5e-4, 0.9e-3, 1.1e-3, 0.02, 0.7, 2.5])
def test_left_jacobian_is_the_spin_of_a_changing_rotation_vector(angle):
    theta = angle * AXIS
    step = 1e-5
    jacobian = np.array([so3.left_jacobian_transposed(tuple(theta), tuple(row)) for row in np.eye(3)])
    for k, direction in enumerate(np.eye(3)):
        up = rotation_vector_quaternion(theta + step * direction)
        down = rotation_vector_quaternion(theta - step * direction)
        spin = np.array(so3.log(tuple(times(up, down * [1, -1, -1, -1])))) / (2 * step)
        np.testing.assert_allclose(jacobian[:, k], spin, atol=1e-9)  # central difference: step^2 and 1e-16 / step
    np.testing.assert_allclose(jacobian @ theta, theta, atol=1e-15)  # a rotation vector is the spin along itself


def test_log_of_the_smallest_turns_keeps_its_third_order():
    half = 0.9e-5 * AXIS
    np.testing.assert_allclose(so3.log((math.sqrt(1.0 - half @ half), *half)), 2.0 * (1.0 + half @ half / 6.0) * half, rtol=1e-12)


@pytest.mark.parametrize("angle", [0.9e-3, 1.1e-3])
def test_left_jacobian_of_small_turns_is_its_power_series(angle):
    """J_l = sum of hat^k / (k + 1)!; the terms of order four and five are round-off here."""
    skew = hat(angle * AXIS)
    series = np.eye(3) + skew / 2 + skew @ skew / 6 + skew @ skew @ skew / 24 + skew @ skew @ skew @ skew / 120
    got = np.array([so3.left_jacobian_transposed(tuple(angle * AXIS), tuple(row)) for row in np.eye(3)])
    tolerance = 2e-15 if angle < 1e-3 else 1e-11  # the closed form loses digits where the series ends
    np.testing.assert_allclose(got, series, rtol=0.0, atol=tolerance)


def test_normalize_keeps_the_rotation():
    q = np.array(so3.exp((0.4, -1.1, 0.7)))
    np.testing.assert_allclose(so3.normalize(tuple(1.7 * q)), q, rtol=1e-15)


@pytest.fixture
def blocks():
    random = np.random.default_rng(7)
    n = 9
    diagonal = random.normal(size=(n, 6, 6)) + 5.0 * np.eye(6)
    diagonal[:, 0, 0] = 0.0  # elimination without pivoting would divide by zero
    return diagonal, random.normal(size=(n - 1, 6, 6)), random.normal(size=(n - 1, 6, 6)), random.normal(size=(n, 6))


def factorized(blocks):
    diagonal, lower, upper, _ = blocks
    return block_tridiagonal.factorize(diagonal, lower, upper)


def test_elimination_and_substitution_solve_the_dense_system_for_every_right_hand_side(blocks):
    diagonal, lower, upper, right = blocks
    whole = assembled(diagonal, lower, upper)
    assert factorized(blocks)
    for side in (right, np.roll(right, 1, axis=0)):
        expected = np.linalg.solve(whole, -side.ravel()).reshape(-1, 6)
        x, condensed = np.empty_like(side), side.copy()
        block_tridiagonal.condense(lower, condensed)
        block_tridiagonal.substitute(diagonal, upper, condensed, np.linalg.solve(diagonal[-1], -condensed[-1]), x)
        np.testing.assert_allclose(x, expected, rtol=1e-11)  # condition of the blocks


def test_elimination_keeps_its_digits_where_a_pivot_is_next_to_nothing(blocks):
    """1e-13 in columns of numbers about 1, whose last is zero: taken as a pivot it would cost all but three digits."""
    diagonal, lower, upper, right = blocks
    diagonal[:, 0, 0], diagonal[:, 5, 0] = 1e-13, 0.0
    expected = np.linalg.solve(assembled(diagonal, lower, upper), -right.ravel()).reshape(-1, 6)
    x = np.empty_like(right)
    assert factorized(blocks)
    block_tridiagonal.condense(lower, right)
    block_tridiagonal.substitute(diagonal, upper, right, np.linalg.solve(diagonal[-1], -right[-1]), x)
    np.testing.assert_allclose(x, expected, rtol=1e-9)


def test_what_is_left_at_the_top_is_the_schur_complement(blocks):
    diagonal, lower, upper, _ = blocks
    whole = assembled(diagonal, lower, upper)
    schur = whole[-6:, -6:] - whole[-6:, :-6] @ np.linalg.solve(whole[:-6, :-6], whole[:-6, -6:])
    factorized(blocks)
    np.testing.assert_allclose(diagonal[-1], schur, rtol=1e-10, atol=1e-11)


def test_singular_systems_are_reported_not_divided_by_zero(blocks):
    blocks[0][0] = 0.0
    assert not factorized(blocks)
    assert not block_tridiagonal.lu(np.zeros((3, 3)), np.empty(3, np.int64))
    assert not block_tridiagonal.lu(np.full((2, 2), math.nan), np.empty(2, np.int64))
