"""Section forces and stresses along the line: against the boundary value problem, the reactions, and hand formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest
import reference_bvp
from pipe_helpers import HANGING, P16, SECTIONS, TANGENT, TANGENT_ATTITUDE, march, pitch, rotation, sea, started

from pipe_fmu import PipeParameters, PipeUnit, Seabed
from pipe_fmu.results.section_forces import SectionForces

ANGLE = math.radians(67.380135)


def clamped(name, current, **changes):
    base = {"top_position": TANGENT, "top_quaternion": TANGENT_ATTITUDE, "environment": sea(800.0, current)}
    return PipeParameters(section=SECTIONS[name], **(base | changes))


@pytest.mark.parametrize("current", [None, 0.8])
@pytest.mark.parametrize("name", SECTIONS)
def test_section_forces_at_the_nodes_agree_with_the_boundary_value_problem(name, current):
    """Errors: tension 2e-5, shear 2e-3 (and attitudes of 3e-5), bending 3e-3 (P12, bending length 9 m), torque 1e-3."""
    pipe, _, state = started(clamped(name, current))
    got = pipe.section_forces(state)
    solution = reference_bvp.solve(reference_bvp.TUBES[name], 1200.0, TANGENT[0], 800.0, ANGLE, current=current or 0.0)
    _, _, _, moment, tension, shear = solution.at(pipe.s)
    assert np.abs(got.tension - tension).max() < 2e-5 * tension.max()
    assert np.abs(got.shear.T - shear).max() < 3e-5 * tension.max() + 2e-3 * np.abs(shear).max()
    assert np.abs(got.moment.T[1:] - moment[1:]).max() < 3e-3 * np.abs(moment[1:]).max()
    assert np.abs(got.moment[:, 0] - moment[0]).max() < 1e-3 * np.abs(moment[1:]).max()  # torque


def test_a_pinned_top_leaves_no_torque_in_a_cross_current():
    """Round section: m_1' = 0, so a line free to spin at its top carries no torque anywhere."""
    pipe, _, state = started(clamped("P16", 0.8, top="pinned", top_quaternion=HANGING))
    moment = pipe.section_forces(state).moment
    assert np.abs(moment[:, 0]).max() < 2e-4 * np.abs(moment[:, 1:]).max()


@pytest.mark.parametrize("bed", [None, Seabed()])
def test_end_forces_are_the_reactions_and_end_moments_to_the_error_of_the_element(bed):
    """Moments of the reactions are those of the element's cubic, recovered ones those of a bar under tension: 1e-4 of the moment apart."""
    pipe, found, state = started(clamped("P16", 0.8, seabed=bed))
    forces = pipe.section_forces(state)
    for k, end in ((-1, found.top), (0, -found.foot)):
        recovered = pipe.spatial(state, forces, k)
        np.testing.assert_allclose(recovered[:3], end[:3], rtol=0.0, atol=1e-9 * np.linalg.norm(end[:3]))
        np.testing.assert_allclose(recovered[3:], end[3:], rtol=0.0, atol=1e-4 * pipe.largest_bending_moment(forces))


@pytest.mark.parametrize(("mesh", "error"), [("adapted", 1e-5), ("uniform", 6e-3)])
@pytest.mark.parametrize("name", SECTIONS)
def test_clamp_moments_agree_with_the_boundary_value_problem(name, mesh, error):
    """Also where equal elements are 2.6 times as long as the line bends in: their own end moments err by 5e-2."""
    pipe, _, state = started(clamped(name, 0.8, mesh=mesh))
    got = pipe.section_forces(state).moment
    solution = reference_bvp.solve(reference_bvp.TUBES[name], 1200.0, TANGENT[0], 800.0, ANGLE, current=0.8)
    moment = solution.at(pipe.s)[3].T
    largest = np.linalg.norm(moment[:, 1:], axis=1).max()
    for end in (0, -1):
        np.testing.assert_allclose(got[end], moment[end], rtol=0.0, atol=error * largest)


def test_tension_on_a_straight_hanging_part_grows_with_the_weight():
    pipe, _, state = started(clamped("P16", None))
    tension = pipe.section_forces(state).tension
    height = -state.position[:, 2]
    w = reference_bvp.TUBES["P16"].weight
    inner = slice(8, -8)  # away from the clamps the shear carries nothing: dT = w dz
    np.testing.assert_allclose(np.diff(tension)[inner], w * np.diff(height)[inner], rtol=2e-3)


def test_largest_ports_are_the_largest_nodal_values_and_the_end_wrench_is_the_pull():
    unit = PipeUnit(clamped("P16", 0.8))
    assert unit.initialize(0.0, {}) is None
    n = 48
    moment = unit.output("node_moment").reshape(n, 3)
    at_nodes = np.hypot(moment[:, 1], moment[:, 2]).max()
    assert at_nodes * (1.0 - 1e-14) <= unit.output("largest_bending_moment")[0] <= 1.05 * at_nodes  # to round-off
    assert unit.output("largest_tension")[0] == unit.output("node_tension").max()
    np.testing.assert_allclose(unit.output("end_force"), unit.output("force"), rtol=1e-6, atol=1.0)
    np.testing.assert_allclose(unit.output("end_moment"), unit.output("moment"), atol=1e-4 * at_nodes)
    assert unit.output("node_position").reshape(n, 3)[-1] == pytest.approx(TANGENT)
    assert unit.output("s")[-1] == 1200.0


def test_stretched_length_is_the_length_under_the_mean_tension():
    """Fig. 4 of the paper: stretch = integral of T / EA, 0.12 m for P16."""
    pipe, _, state = started(clamped("P16", None))
    tension = reference_bvp.solve(reference_bvp.TUBES["P16"], 1200.0, TANGENT[0], 800.0, ANGLE).at(np.linspace(0, 1200, 4001))[4]
    stretch = pipe.stretched_length(state) - 1200.0
    assert stretch == pytest.approx(tension.mean() * 1200.0 / P16.stiffness[0], rel=1e-3)


def stress_by_hand(tension, bending, torque, outside, inside, a, b, displaced):
    """Lame's tube under pressures, axial force and moments: the largest von Mises stress over both faces and both sides."""
    area, second = math.pi * (b * b - a * a), 0.25 * math.pi * (b**4 - a**4)
    axial_force = tension - outside * displaced + inside * math.pi * a * a
    worst = 0.0
    for r in (a, b):
        constant = (inside * a * a - outside * b * b) / (b * b - a * a)
        varying = (inside - outside) * a * a * b * b / ((b * b - a * a) * r * r)
        hoop, radial = constant + varying, constant - varying
        shear = torque * r / (2 * second)
        for side in (1, -1):
            tensor = np.diag([axial_force / area + side * bending * r / second, hoop, radial])
            tensor[0, 1] = tensor[1, 0] = shear
            deviator = tensor - np.trace(tensor) / 3 * np.eye(3)
            worst = max(worst, math.sqrt(1.5 * np.sum(deviator**2)))
    return worst


@pytest.mark.parametrize("contents", [0.0, 900.0])
@pytest.mark.parametrize("coating", [0.0, 0.05])
def test_von_mises_stress_is_lame_and_bending_by_hand(contents, coating):
    section = replace(P16, contents_density=contents, coating_thickness=coating, coating_density=2500.0)
    pipe, _, state = started(PipeParameters(section=section, top="pinned", top_quaternion=HANGING))
    n = len(pipe.s)
    random = np.random.default_rng(6)
    forces = SectionForces(random.normal(size=n) * 1e6, np.zeros((n, 2)), random.normal(size=(n, 3)) * 2e5)
    got = pipe.von_mises(state, forces)
    for k in range(n):
        depth = 800.0 + state.position[k, 2]
        bending = math.hypot(forces.moment[k, 1], forces.moment[k, 2])
        outer = 0.4064 / 2 + coating
        pressures = 1025 * 9.81 * depth, contents * 9.81 * depth
        radii = 0.4064 / 2 - 0.0222, 0.4064 / 2
        by_hand = stress_by_hand(forces.tension[k], bending, forces.moment[k, 0], *pressures, *radii, math.pi * outer**2)
        assert got[k] == pytest.approx(by_hand, rel=1e-10)


def test_pressure_alone_gives_the_stress_of_a_capped_tube():
    """Zero effective tension, no moments: wall force -p_e A_e, and by Lame sigma = sqrt(3) p b^2 / (b^2 - a^2) inside, exactly."""
    pipe, _, state = started(PipeParameters(top="pinned", top_quaternion=HANGING))
    n = len(pipe.s)
    slack = SectionForces(np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3)))
    got = pipe.von_mises(state, slack)
    a, b = P16.radii
    pressure = 1025 * 9.81 * (800 + state.position[:, 2])
    np.testing.assert_allclose(pipe.wall_tension(state, slack), -pressure * math.pi * b * b, rtol=1e-12)
    np.testing.assert_allclose(got, math.sqrt(3) * pressure * b * b / (b * b - a * a), rtol=1e-10, atol=1e-3)


@pytest.mark.parametrize("walls", [(0.040, 0.012), (0.012, 0.040)])
def test_stress_at_a_joint_is_that_of_the_thin_wall_on_either_side(walls):
    sections = tuple(replace(P16, length=length, wall_thickness=wall) for length, wall in zip((500.0, 700.0), walls, strict=True))
    pipe, _, state = started(PipeParameters(sections=sections, top="pinned", top_quaternion=HANGING))
    n, joint = len(pipe.s), int(np.argmin(np.abs(pipe.s - 500.0)))
    forces = SectionForces(np.full(n, 4e5), np.zeros((n, 2)), np.tile([2e4, 1e5, -5e4], (n, 1)))
    outside = 1025 * 9.81 * (800.0 + state.position[joint, 2])
    b = 0.4064 / 2
    by_hand = [stress_by_hand(4e5, math.hypot(1e5, 5e4), 2e4, outside, 0.0, b - wall, b, math.pi * b * b) for wall in walls]
    assert max(by_hand) == by_hand[int(np.argmin(walls))]
    assert pipe.von_mises(state, forces)[joint] == pytest.approx(max(by_hand), rel=1e-10)


def test_forces_at_the_end_of_a_step_follow_the_mean_over_the_steps_around_it():
    """A moving line: the end wrench between two mean wrenches, to 1 % of the swing."""
    pipe, _, start = started(clamped("P16", None))

    def motion(t):
        return np.array([0.0, 0.0, -2.0 * (1 - math.exp(-((t / 5) ** 4))) * math.sin(0.5 * t)]), 0.0

    states, results = march(pipe, start, motion, 0.1, 140)
    top = np.array([result.top[:3] for result in results])
    swing = np.ptp(np.linalg.norm(top, axis=1))
    for k in range(40, 138, 5):
        forces = pipe.section_forces(states[k])
        end = rotation(states[k].quaternion[-1]) @ np.append(forces.tension[-1], forces.shear[-1])
        assert np.linalg.norm(end - 0.5 * (top[k - 1] + top[k])) < 0.01 * swing


def test_reversed_pitch_reverses_the_bending_moment_of_the_top():
    """A top held above its natural angle is bent one way, below it the other; m_2 > 0 lifts t1."""
    signs = []
    for offset in (0.1, -0.1):
        pipe, _, state = started(clamped("P16", None, top_quaternion=pitch(ANGLE + offset)))
        signs.append(np.sign(pipe.section_forces(state).moment[-1, 1]))
    assert signs == [1.0, -1.0]
