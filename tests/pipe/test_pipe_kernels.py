"""Kernels on their own, against numpy and by hand: elimination, the pinned foot, what recovery takes off a moving line."""

from dataclasses import replace

import numpy as np
import pytest
from pipe_helpers import P16, assembled, bar, loaded, rotation, started, straight
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from pipe_fmu import PipeParameters, constants
from pipe_fmu.element import ends
from pipe_fmu.environment import Environment
from pipe_fmu.line import Water
from pipe_fmu.maths import block_tridiagonal
from pipe_fmu.results import section_forces
from pipe_fmu.statics import stability
from pipe_fmu.step import system
from pipe_fmu.step.residual import largest_residual


def test_elimination_exchanges_rows_where_a_pivot_would_vanish():
    """A zero, and a number at round-off, on the diagonal: the solution is numpy's to 1e-12."""
    a = np.array([[1e-18, 2.0, 1.0], [3.0, 0.0, -1.0], [0.5, 1.0, 1.0]])
    sides = np.array([[1.0, 4.0], [2.0, -1.0], [3.0, 0.5]])
    factors, pivots, many, one = a.copy(), np.empty(3, np.int64), sides.copy(), sides[:, 0].copy()
    assert block_tridiagonal.lu(factors, pivots)
    block_tridiagonal.lu_solve(factors, pivots, many)
    block_tridiagonal.lu_solve_vector(factors, pivots, one)
    np.testing.assert_allclose(many, np.linalg.solve(a, sides), rtol=1e-12)
    np.testing.assert_allclose(one, many[:, 0], rtol=1e-12)


def test_elimination_tells_a_singular_block():
    a = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    assert not block_tridiagonal.lu(a, np.empty(3, np.int64))


@pytest.mark.parametrize("clamped", [True, False])
def test_tangent_of_the_held_foot_is_the_derivative_of_its_residual(clamped):
    """On a linear residual, where the foot is free to turn: rows of (held tangent) x = held residual."""
    _, line = bar(10.0, 3, axial=1e5, shear=1e5, torsion=80.0, bending=100.0, foot_clamped=clamped)
    random = np.random.default_rng(3)
    quaternion = np.tile(np.array([0.8, 0.2, -0.4, 0.4]), (3, 1))
    diagonal, upper, x = random.normal(size=(3, 6, 6)), random.normal(size=(2, 6, 6)), random.normal(size=(3, 6))
    residual = np.zeros((3, 6))
    ends.hold_foot(line, quaternion, x[0])
    residual[0] = diagonal[0] @ x[0] + upper[0] @ x[1]
    ends.hold_foot(line, quaternion, residual[0])
    ends.hold_foot_tangent(line, quaternion, diagonal, upper)
    held = 6 if clamped else 3
    np.testing.assert_allclose((diagonal[0] @ x[0] + upper[0] @ x[1])[held:], residual[0, held:], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(diagonal[0, :held], np.eye(6)[:held])
    assert not x[0, :held].any()
    assert not residual[0, :held].any()
    if not clamped:  # a turn about t1 is taken out, and resisted
        axis = ends.axis_of_foot(quaternion)
        assert abs(np.dot(x[0, 3:], axis)) < 1e-15
        assert np.dot(axis, diagonal[0, 3:, 3:] @ axis) > 0.1 * np.abs(np.diag(diagonal[0, 3:, 3:])).max()


def test_recovery_takes_off_the_drag_of_the_velocities_at_the_ends():
    """The upper of two elements swept about its lower end, c v |v| per length: shares c V^2 h / 12 and / 4 of its ends, by hand.

    The middle node's share accelerates its mass; that inertial force, 0 at the foot and as much again beyond the middle, is carried as by
    a bar under a linear load: h (3, 7) / 20 below, h (7 + 2 x 3, 3 + 2 x 7) / 20 above, per length.
    """
    s, line = bar(12.0, 3, axial=1e8, shear=1e8, torsion=1e6, bending=1e6)
    line = loaded(line, drag=np.full((2, 2), 50.0))
    velocity, still = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), np.zeros((3, 3))
    water, mass = Water(np.zeros(0), np.zeros((0, 3)), True), section_forces.MassPerLength(*np.ones((2, 2)))
    found = section_forces.nodal_wrenches(line, mass, water, *straight(s), velocity, still, np.zeros((2, 7)))
    share = 50.0 * 2.0**2 * 6.0
    carried = -share / 12.0  # by the mass of the middle node, h per unit of density
    ends = np.array([[0.15, 0.35], [0.35 + 0.3, 0.15 + 0.7]]) * carried
    by_hand = [-ends[0, 0], 0.5 * (ends[0, 1] - share / 12.0 - ends[1, 0]), share / 4.0 + ends[1, 1]]
    np.testing.assert_allclose(found[:, 1], by_hand, rtol=1e-12)


@pytest.mark.parametrize("tension", [3e4, -1e3])
def test_a_line_bent_about_its_other_axis_has_the_same_moments_there(tension):
    """EI_2 and EI_3 exchanged and the whole turned about x by a right angle: m_2 becomes m_3, and n_2 becomes n_3."""
    mass, still, nothing = section_forces.MassPerLength(*np.ones((2, 3))), Water(np.zeros(0), np.zeros((0, 3)), False), np.zeros((4, 3))
    angle, found = np.array([0.0, 0.15, 0.2, -0.1]), []
    directions = np.column_stack([np.cos(angle[1:]), np.full(3, 0.02), -np.sin(angle[1:])])
    for turn, (two, three) in ((Rotation.identity(), (2e5, 7e5)), (Rotation.from_euler("x", 90.0, degrees=True), (7e5, 2e5))):
        s, line = bar(20.0, 4, axial=1e7, shear=4e6, torsion=3e5, bending=two, bending_3=three)
        chords = (1.0 + tension / 1e7) * np.diff(s)[:, None] * directions
        position = turn.apply(np.vstack([np.zeros(3), np.cumsum(chords, axis=0)]))
        attitude = (turn * Rotation.from_euler("yz", np.column_stack([angle, 0.1 * angle])) * turn.inv()).as_quat(scalar_first=True)
        strain = np.empty((3, 7))
        system.element_strains(line, position, attitude, strain)
        found.append(section_forces.nodal_wrenches(line, mass, still, position, attitude, nothing, nothing, strain))
    (n1, n2, n3, m1, m2, m3), turned = found[0].T, found[1].T
    assert np.abs([m2, m3]).max(axis=1).min() > 100.0
    np.testing.assert_allclose(turned, [n1, -n3, n2, m1, -m3, m2], rtol=1e-9, atol=1e-9 * np.abs(found[0]).max())


def test_above_the_surface_there_is_no_pressure():
    """The wall carries the effective tension there, and less the pressure's -p_e A_e below."""
    pipe, _, state = started(PipeParameters(section=P16, nodes=8, environment=Environment(depth=700.0)))
    forces = pipe.section_forces(state)
    pressed = pipe.wall_tension(state, forces) - forces.tension
    dry = state.position[:, 2] < -700.0
    assert 0 < dry.sum() < 8
    assert not pressed[dry].any()
    depth = 700.0 + state.position[~dry, 2]
    np.testing.assert_allclose(pressed[~dry], -1025.0 * 9.81 * depth * 0.25 * np.pi * 0.4064**2, rtol=1e-12)


def test_a_node_has_the_walls_of_the_sections_below_and_above_it():
    sections = (replace(P16, length=500.0), replace(P16, length=700.0, wall_thickness=0.0254))
    parameters = PipeParameters(sections=sections)
    below, above = constants.walls(parameters, np.array([0.0, 250.0, 500.0, 501.0, 1200.0]))
    thin, thick = (section.steel_area for section in sections)
    np.testing.assert_allclose(below.area, [thin, thin, thin, thick, thick], rtol=1e-12)
    np.testing.assert_allclose(above.area, [thin, thin, thick, thick, thick], rtol=1e-12)


@pytest.mark.parametrize("clamped", [True, False])
def test_a_tangent_is_definite_down_to_its_lowest_eigenvalue_on_the_free_motions(clamped):
    """Any blocks, not symmetric, on either side of the limit; free motions by projection, eigenvalues by LAPACK."""
    _, line = bar(10.0, 4, axial=1e5, shear=1e5, torsion=80.0, bending=100.0, foot_clamped=clamped, top_clamped=clamped)
    random = np.random.default_rng(4)
    quaternion = np.tile(np.array([0.8, 0.2, -0.4, 0.4]), (4, 1))
    diagonal, lower, upper = random.normal(size=(4, 6, 6)), random.normal(size=(3, 6, 6)), random.normal(size=(3, 6, 6))
    free = np.eye(24)[:, 6:18]
    if not clamped:
        axis = rotation(quaternion[0])[:, 0]
        across = np.zeros((24, 2))
        across[3:6] = np.linalg.svd(axis[None])[2][1:].T
        free = np.hstack([across, free, np.eye(24)[:, 21:]])
    whole = assembled(diagonal, lower, upper)
    lowest = np.linalg.eigvalsh(free.T @ (0.5 * (whole + whole.T)) @ free)[0]
    for beyond in (1e-6, -1e-6):
        assert stability.positive(line, quaternion, (diagonal, lower, upper), np.full((4, 6), beyond - lowest)) == (beyond > 0.0)


def test_size_of_a_residual_counts_forces_and_moments_where_free_and_shows_what_is_no_number():
    residual = np.zeros((3, 6))
    residual[1, 2], residual[1, 4], residual[2, 0], residual[2, 5] = -4.0, 30.0, 70.0, -90.0
    assert largest_residual(residual, 2.0, 10.0, True) == 3.0
    assert largest_residual(residual, 2.0, 10.0, False) == 9.0
    assert largest_residual(residual, 0.5, 10.0, True) == 8.0
    residual[0, 1] = np.nan
    assert np.isnan(largest_residual(residual, 2.0, 10.0, True))
    assert np.isnan(largest_residual(residual, 2.0, 10.0, False))


def test_largest_bending_moment_is_that_between_the_nodes_too():
    """m_2' = n_3, m_3' = -n_2: |m|^2 by Hermite's cubic of its values and slopes, here against scipy's, on steps of an eighth."""
    s = np.array([0.0, 4.0, 10.0])
    moment, shear = np.array([[9.0, 2.0, 1.0], [9.0, 1.0, -3.0], [9.0, -1.0, 0.5]]), np.array([[-0.3, 0.8], [0.4, -4.5], [0.2, 0.6]])
    forces = section_forces.SectionForces(np.zeros(3), shear, moment)
    square = (moment[:, 1:] ** 2).sum(axis=1)
    slope = 2.0 * (moment[:, 1] * shear[:, 1] - moment[:, 2] * shear[:, 0])
    at = np.concatenate([np.linspace(0.0, 4.0, 9), np.linspace(4.0, 10.0, 9)])
    expected = np.sqrt(CubicHermiteSpline(s, square, slope)(at).max())
    assert expected > 1.05 * np.sqrt(square.max())
    assert section_forces.largest_bending_moment(s, forces) == pytest.approx(expected, rel=1e-12)
