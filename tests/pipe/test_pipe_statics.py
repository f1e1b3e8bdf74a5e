"""Statics against independent solutions: two-point boundary value problems, published figures, the elastic catenary."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
import reference_bvp
from pipe_helpers import (
    HANGING,
    P16,
    PEER,
    SECTIONS,
    TANGENT,
    TANGENT_ATTITUDE,
    pitch,
    rotation,
    sea,
    started,
    static_system,
    turned,
)
from scipy.optimize import fsolve

from pipe_fmu import PipeParameters, Seabed

LENGTH, HEIGHT = 1200.0, 800.0
TUBES = [*SECTIONS]


def line(name, distance, angle=None, current=None, **changes):
    """Pipe of 1200 m in 800 m: top clamped at `angle` above the horizontal, or pinned."""
    return started(
        PipeParameters(
            section=SECTIONS[name],
            top="pinned" if angle is None else "clamped",
            top_position=(distance, 0.0, -HEIGHT),
            top_quaternion=HANGING if angle is None else pitch(angle),
            environment=sea(HEIGHT, current),
            **changes,
        )
    )


def exact(name, distance, angle=None, current=0.0, **changes):
    return reference_bvp.solve(reference_bvp.TUBES[name], LENGTH, distance, HEIGHT, angle, current=current, **changes)


def relative(value, truth):
    return np.linalg.norm(np.asarray(value) - truth) / np.linalg.norm(truth)


ANGLE = math.radians(67.380135)


def test_published_figures_of_the_peer_pipe_at_the_tangent_catenary():
    """Two-point boundary value problem at tolerance 1e-8: top force, both end moments, vertical force at the foot."""
    _, found, _ = started(PipeParameters(section=PEER, top_position=TANGENT, top_quaternion=TANGENT_ATTITUDE))
    top, foot = found.top, found.foot
    assert top[0] == pytest.approx(500511.39, rel=2e-6)
    assert -top[2] == pytest.approx(1202574.09, rel=2e-6)
    assert top[4] == pytest.approx(29120.4, abs=5e-3 * 220743.3)
    assert -foot[4] == pytest.approx(220743.3, rel=1e-3)
    assert -foot[2] == pytest.approx(375.8, abs=2.0)  # a small difference of large forces
    np.testing.assert_allclose(top[[1, 3, 5]], 0.0, atol=1e-6)  # the line stays in its plane


def test_the_reference_itself_reproduces_the_published_figures():
    _, _, force, moment, _, _ = reference_bvp.solve(reference_bvp.PEER, LENGTH, TANGENT[0], HEIGHT, ANGLE).at([0.0, LENGTH])
    np.testing.assert_allclose(force[:, 1], [500511.39, 0.0, -1202574.09], rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(moment[1], [220743.3, 29120.4], atol=0.06)  # the digits given
    assert force[2, 0] == pytest.approx(375.8, abs=0.06)


def accuracy(pipe, state, solution):
    """Relative errors: tension at foot and top, largest bending moment, end moments (over a tenth of the largest if they are small)."""
    forces = pipe.section_forces(state)
    _, q, _, moment, tension, _ = solution.at([0.0, LENGTH])
    dense = solution.at(np.linspace(0.0, LENGTH, 12001))[3]
    largest = np.linalg.norm(dense[1:], axis=0).max()
    ends = []
    for k in (0, -1):
        wanted = rotation(q[:, k]) @ moment[:, k]
        got = rotation(state.quaternion[k]) @ forces.moment[k]
        ends.append(np.linalg.norm(got - wanted) / max(np.linalg.norm(wanted), 0.1 * largest))
    tensions = forces.tension[[0, -1]] / tension - 1
    return *np.abs(tensions), abs(pipe.largest_bending_moment(forces) / largest - 1), *ends


@pytest.mark.parametrize("current", [0.0, 0.8])
@pytest.mark.parametrize(
    ("name", "distance", "angle"), [(name, TANGENT[0], ANGLE) for name in TUBES] + [("P16", 671.0, None), ("P12", 867.0, None)]
)
def test_free_line_agrees_with_the_boundary_value_problem_to_its_ends(name, distance, angle, current):
    """48 nodes: tensions 1e-4, largest moment 1e-3, clamp moments 5e-3; 0.75, 0.9 and 0.97 of the taut distance."""
    pipe, found, state = line(name, distance, angle, current)
    assert found.stable
    errors = accuracy(pipe, state, exact(name, distance, angle, current))
    assert (np.array(errors) < [1e-4, 1e-4, 1e-3, 5e-3, 5e-3]).all()


def worst_in_a_current(mesh, order):
    """Largest errors over the three pipes, 48 nodes, top clamped, cross current; order 2: a plain element."""
    found = []
    for name in TUBES:
        pipe, _, state = line(name, TANGENT[0], ANGLE, 0.8, mesh=mesh)
        if order == 2:
            stiffness = pipe.line.stiffness.copy()
            stiffness[:, 1:3] = SECTIONS[name].stiffness[1]
            pipe.line = pipe.line._replace(share=0.0 * pipe.line.share, stiffness=stiffness)
            _, state = pipe.start(0.0)
        tension, top, largest, *ends = accuracy(pipe, state, exact(name, TANGENT[0], ANGLE, 0.8))
        found.append([max(tension, top), largest, max(ends)])
    return np.array(found).max(axis=0)


def test_order_and_mesh_each_buy_a_tenth_of_the_moments_error_and_together_a_thousandth():
    """Equal plain elements miss the clamp moments by a fifth and more (as is known of them); either cure alone does not suffice."""
    plain, graded, higher, both = (worst_in_a_current(*way) for way in (("uniform", 2), ("adapted", 2), ("uniform", 4), ("adapted", 4)))
    for name, errors in (("plain", plain), ("graded", graded), ("higher order", higher), ("both", both)):
        sys.stdout.write(f"{name:13} tension {errors[0]:.0e}, largest moment {errors[1]:.0e}, clamp moments {errors[2]:.0e}\n")
    assert plain[2] > 0.2
    for one in (graded, higher):
        assert (one[1:] < 0.2 * plain[1:]).all()
        assert (both[1:] < 0.02 * one[1:]).all()


@pytest.mark.parametrize("name", TUBES)
def test_line_on_the_bed_agrees_with_the_boundary_value_problem_to_its_ends(name):
    pipe, found, state = line(name, 780.0, None, 0.8 if name == "P16" else None, seabed=Seabed())
    assert found.stable
    solution = exact(name, 780.0, current=0.8 if name == "P16" else 0.0, bed=True, tolerance=1e-6)
    assert (np.array(accuracy(pipe, state, solution)) < [1e-4, 1e-4, 1e-3, 5e-3, 5e-3]).all()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_a_tolerance_gives_a_mesh_that_keeps_it(tolerance):
    pipe, _, state = line("P16", TANGENT[0], ANGLE, tolerance=tolerance)
    errors = accuracy(pipe, state, exact("P16", TANGENT[0], ANGLE))[:3]
    assert max(errors) < tolerance
    assert len(pipe.s) <= {1e-2: 30, 1e-3: 60, 1e-4: 120}[tolerance]


@pytest.mark.parametrize("at", [755.0, 780.0, 792.0, 804.72])
def test_a_tolerance_is_kept_in_the_whole_range_of_the_top(at):
    """The touchdown point wanders by a quarter of the line, up to the clamped foot: tensions, largest moment and, beside it, the foot's."""
    pipe, _, _ = line("P16", 780.0, seabed=Seabed(), top_range=25.0, tolerance=2e-3)
    there = replace(pipe.parameters, top_position=(at, 0.0, -HEIGHT), top_range=0.0)
    pipe, _, state = started(there)
    *errors, foot, _ = accuracy(pipe, state, exact("P16", at, bed=True, tolerance=1e-6))
    assert max(errors) < 2e-3
    assert foot < 10 * 2e-3  # relative to as little as a tenth of the largest moment
    assert len(pipe.s) <= 100


@pytest.mark.parametrize(("name", "foot", "distance"), [("P16", "clamped", 780.0), ("P12", "pinned", 780.0), ("P30", "clamped", 560.0)])
def test_pinned_line_in_a_current_agrees_with_the_boundary_value_problem(name, foot, distance):
    pipe, found, state = line(name, distance, None, 0.8, foot=foot)
    position, _, force, _, _, _ = exact(name, distance, None, 0.8, foot=foot).at(pipe.s)
    assert relative(found.top[:3], force[:, -1]) < 1e-5
    assert relative(-found.foot[:3], force[:, 0]) < 5e-5
    np.testing.assert_allclose(found.top[3:], 0.0, atol=1e-3)
    np.testing.assert_allclose(state.position, position.T, atol=4e-3)  # of 1200 m


@pytest.mark.parametrize("name", TUBES)
def test_nodes_stand_where_the_boundary_value_problem_has_them(name):
    pipe, _, state = line(name, TANGENT[0], ANGLE, 0.8)
    position = exact(name, TANGENT[0], ANGLE, 0.8).at(pipe.s)[0]
    np.testing.assert_allclose(state.position, position.T, atol=2e-3)  # of 1200 m


@pytest.mark.parametrize("name", TUBES)
def test_line_on_the_bed_lies_and_lifts_off_where_the_boundary_value_problem_does(name):
    pipe, found, state = line(name, 780.0, None, seabed=Seabed())
    solution = exact(name, 780.0, bed=True, tolerance=1e-6)
    position, _, force, _, _, _ = solution.at(pipe.s)
    assert found.stable
    assert relative(found.top[:3], force[:, -1]) < 1e-4
    np.testing.assert_allclose(state.position, position.T, atol=1e-2)
    lifted = np.argmax(state.position[:, 2] < -SECTIONS[name].outer_diameter / 8)
    dense = np.linspace(0.0, LENGTH, 12001)
    exact_lift = dense[np.argmax(solution.at(dense)[0][2] < -SECTIONS[name].outer_diameter / 8)]
    assert pipe.s[lifted - 1] - 1.0 <= exact_lift <= pipe.s[lifted] + 1.0  # touchdown lies in the same element


def test_weight_reactions_and_bed_balance():
    pipe, found, state = line("P16", 700.0, None, seabed=Seabed())
    x, weights = np.polynomial.legendre.leggauss(4)
    x = 0.5 * (x + 1.0)
    z = state.position[:-1, 2, None] * (1 - x) + state.position[1:, 2, None] * x + state.strain[:, 6, None] * x * (1 - x)
    w = reference_bvp.TUBES["P16"].weight
    bed = float(np.sum(reference_bvp.bed_reaction(z, 0.4064, w) * weights * 0.5 * pipe.line.length[:, None]))
    assert bed > 100.0 * w
    assert -found.top[2] - found.foot[2] + bed == pytest.approx(w * LENGTH, rel=1e-9)


@pytest.mark.parametrize("name", TUBES)
def test_reactions_carry_the_submerged_weight(name):
    _, found, _ = line(name, TANGENT[0], ANGLE)
    reactions = found.top[:3] + found.foot[:3]
    np.testing.assert_allclose(reactions, [0, 0, -reference_bvp.TUBES[name].weight * LENGTH], atol=1e-6 * -reactions[2])


def test_a_line_on_the_bed_from_the_foot_lies_at_zero():
    pipe, _, state = line("P16", 560.0, None, seabed=Seabed())
    lying = pipe.s < 200.0  # the touchdown is at 380 m
    assert lying.sum() > 3
    np.testing.assert_allclose(state.position[lying, 2], 0.0, atol=1e-4)


def test_without_bending_stiffness_it_is_the_elastic_catenary():
    """Closed form of Irvine (1981): x = H s / EA + H / w (asinh((V0 + w s) / H) - asinh(V0 / H)), both ends pinned."""
    section = replace(P16, bending_stiffness=1e4)  # a ten-thousandth of the pipe's
    pipe, found, state = started(
        PipeParameters(section=section, foot="pinned", top="pinned", top_position=(780.0, 0.0, -800.0), top_quaternion=HANGING)
    )
    w, axial = reference_bvp.TUBES["P16"].weight, section.stiffness[0]

    def shape(s, force, foot):
        x = force * s / axial + force / w * (np.arcsinh((foot + w * s) / force) - np.arcsinh(foot / force))
        z = s * (foot + 0.5 * w * s) / axial + force / w * (np.hypot(1, (foot + w * s) / force) - np.hypot(1, foot / force))
        return x, z

    force, foot = fsolve(lambda f: np.array(shape(LENGTH, *(f * 1e5))) - [780.0, 800.0], [3.0, -0.4], xtol=1e-12) * 1e5
    assert found.top[0] == pytest.approx(force, rel=1e-5)
    assert -found.top[2] == pytest.approx(foot + w * LENGTH, rel=1e-6)
    x, z = shape(pipe.s, force, foot)
    np.testing.assert_allclose(state.position, np.column_stack([x, 0 * x, -z]), atol=3e-3)


def errors(nodes, current):
    pipe, found, state = line("P30", TANGENT[0], ANGLE, current, nodes=nodes, mesh="uniform")
    position, _, force, moment, _, _ = exact("P30", TANGENT[0], ANGLE, current or 0.0).at(pipe.s)
    forces = pipe.section_forces(state)
    return np.array(
        [
            np.abs(state.position - position.T).max(),
            np.linalg.norm(found.top[:3] - force[:, -1]),
            np.linalg.norm(forces.moment[:, 1:] - moment.T[:, 1:], axis=1).max(),
        ]
    )


def test_fourth_order_in_space():
    """Positions, top force and moments at the nodes, equal elements of 25 and 12.5 m against a bending length of 40 m."""
    orders = np.log2(errors(49, None) / errors(97, None))
    assert (orders > 3.5).all()


def test_fourth_order_in_space_in_a_current_but_for_the_last_digits_of_the_force():
    """Positions and moments; the top force falls with the second power from 2e-5 at 25 m (bending in two planes at the clamps)."""
    coarse, fine = errors(49, 0.8), errors(97, 0.8)
    assert (np.log2(coarse / fine)[[0, 2]] > 3.5).all()
    assert np.log2(coarse / fine)[1] > 1.9
    assert coarse[1] < 3e-5 * 2.2e6


def test_turning_the_whole_scene_turns_the_solution():
    """Objectivity: heading 60 degrees, pinned ends, no current."""
    turn = np.array([[0.5, -math.sqrt(0.75), 0.0], [math.sqrt(0.75), 0.5, 0.0], [0.0, 0.0, 1.0]])
    ends = {"foot": "pinned", "top": "pinned", "top_quaternion": HANGING}
    _, found, state = started(PipeParameters(top_position=(780.0, 0.0, -800.0), **ends))
    there = tuple(turn @ [780.0, 0.0, -800.0])
    _, turned, state_turned = started(PipeParameters(top_position=there, **ends))
    np.testing.assert_allclose(state_turned.position, state.position @ turn.T, atol=1e-6)
    np.testing.assert_allclose(turned.top[:3], turn @ found.top[:3], rtol=1e-8, atol=1e-3)


@pytest.mark.parametrize("departure", [-60.0, -20.0, 20.0, 60.0])
def test_the_top_is_held_where_it_is_told_far_from_its_natural_angle(departure):
    angle = ANGLE + math.radians(departure)
    _, found, state = line("P16", TANGENT[0], angle)
    assert found.stable
    np.testing.assert_allclose(rotation(state.quaternion[-1]), rotation(pitch(angle)), atol=1e-12)
    np.testing.assert_allclose(state.position[-1], TANGENT, atol=1e-9)
    reference_force = exact("P16", TANGENT[0], angle).at([LENGTH])[2][:, 0]
    assert relative(found.top[:3], reference_force) < 1e-4


def test_stiffness_of_the_top_is_the_difference_of_equilibria():
    pipe, found, _ = line("P16", 780.0, ANGLE)
    step = 1e-3
    for k in range(3):
        ends = []
        for sign in (1, -1):
            top = np.array([780.0, 0.0, -HEIGHT])
            top[k] += sign * step
            ends.append(pipe.equilibrium(tuple(top), np.array(pitch(ANGLE))).top)
        slope = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(found.stiffness[:, k], slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max())


@pytest.mark.parametrize("nodes", [3, 12, 150, 300])
def test_statics_converge_at_every_mesh(nodes):
    _, found, _ = line("P16", 780.0, ANGLE, 0.8, nodes=nodes)
    assert found.stable


@pytest.mark.parametrize("current", [0.2, 1.2, 2.5])
def test_statics_converge_quickly_in_any_current(current):
    _, found, _ = line("P16", 780.0, None, current)
    assert found.iterations < 60


def test_nearly_vertical_pipe_agrees_with_the_boundary_value_problem():
    """J-lay: 850 m of pipe in 800 m of water, the top held at 89 degrees."""
    angle = math.radians(89.0)
    _, found, _ = started(PipeParameters(length=850.0, top_position=(100.0, 0.0, -800.0), top_quaternion=pitch(angle), seabed=Seabed()))
    solution = reference_bvp.solve(reference_bvp.TUBES["P16"], 850.0, 100.0, 800.0, angle, bed=True, tolerance=1e-6)
    assert found.stable
    assert relative(found.top[:3], solution.at([850.0])[2][:, 0]) < 1e-4


def test_line_lying_on_the_bed_with_its_top_on_it_is_carried_by_the_bed():
    """Top at z = 0: no catenary hangs there; the bed carries every node at z = 0, the ends nothing of the weight."""
    pipe, found, _ = started(PipeParameters(top="pinned", top_quaternion=HANGING, top_position=(1199.99, 0.0, 0.0), seabed=Seabed()))
    assert abs(found.top[2]) < 1e-9 * (pipe.line.loads.weight @ pipe.line.length)
    assert abs(found.position[:, 2]).max() < 1e-9


def test_tangent_on_the_bed_is_the_derivative_of_the_residual_and_long_lying_elements_are_stable():
    """Elements up to 160 m lie on the bed: their weight and its reaction bear on their arcs, second derivatives included.

    A lying line under tension resists sideways motion (a planar line that rests is stable if no other mode is soft).
    """
    pipe, found, state = line("P12", 0.6 * math.sqrt(LENGTH**2 - HEIGHT**2), None, foot="pinned", seabed=Seabed())
    assert found.stable
    n = len(pipe.s)
    assert pipe.line.length.max() > 100.0
    random = 1e-3 * np.random.default_rng(4).normal(size=(n, 6))
    pose = turned(state.position, state.quaternion, random)
    tangent = static_system(pipe.line, *pose)[1]
    for k in (9, 11, 14, 16):  # second and third node: roll, turn sideways; up, pitch
        x = np.zeros(6 * n)
        x[k] = 1e-6
        up, down = (static_system(pipe.line, *turned(*pose, sign * x.reshape(n, 6)))[0] for sign in (1, -1))
        slope = (up - down) / 2e-6
        np.testing.assert_allclose(tangent[:, k], slope, atol=1e-5 * np.abs(slope).max())
