"""Bed, drag, current and weight: the published laws, their potentials and their powers."""

import math

import numpy as np
import pytest
from pipe_helpers import rotation, rotation_vector_quaternion, times
from reference_bvp import bed_reaction

from pipe_fmu.element import assembly, strains
from pipe_fmu.environment import Current
from pipe_fmu.loads import bed, current, drag

DIAMETER, WEIGHT = 0.4, 760.0
SCRATCH = np.empty((2, 3, 12))
LIFT_OFF, KNEE = -DIAMETER / 8, -DIAMETER / 8 + DIAMETER / 20


def on_bed(damping=0.0, friction=0.0, friction_speed=1e-3):
    """The bed under one element."""
    return bed.Bed(np.array([WEIGHT]), np.array([DIAMETER]), damping, friction, friction_speed)


def test_the_bed_carries_a_pipe_lying_on_it_with_its_weight():
    _, force, stiffness = bed.contact(0.0, DIAMETER, WEIGHT)
    assert force == pytest.approx(WEIGHT, rel=1e-14)
    assert stiffness == pytest.approx(WEIGHT / (0.1 * DIAMETER), rel=1e-14)


def test_the_bed_is_the_published_law():
    for z in np.linspace(-0.1, 0.3, 401):
        assert bed.contact(z, DIAMETER, WEIGHT)[1] == pytest.approx(float(bed_reaction(z, DIAMETER, WEIGHT)), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("at", [LIFT_OFF, KNEE])
def test_the_bed_is_continuous_with_its_slope_at_lift_off_and_knee(at):
    below, above = (np.array(bed.contact(at + side * 1e-12, DIAMETER, WEIGHT)) for side in (-1, 1))
    np.testing.assert_allclose(below, above, rtol=1e-9, atol=1e-5)  # slope of the stiffness times 2e-12 m


def test_force_and_stiffness_of_the_bed_are_the_derivatives_of_its_potential():
    step = 1e-6
    for z in (-0.049, -0.04, -0.031, -0.02, 0.0, 0.1):
        up, here, down = (bed.contact(x, DIAMETER, WEIGHT) for x in (z + step, z, z - step))
        assert (up[0] - down[0]) / (2 * step) == pytest.approx(here[1], rel=1e-7, abs=1e-5)
        assert (up[1] - down[1]) / (2 * step) == pytest.approx(here[2], rel=1e-7)


@pytest.mark.parametrize(
    ("old", "new"), [(-0.2, 0.1), (0.1, -0.2), (-0.045, -0.035), (-0.04, 0.0), (0.0, 1e-3), (0.0, 1e-7), (-0.2, -0.1), (KNEE, KNEE + 2e-7)]
)
def test_mean_reaction_times_the_way_is_the_potential_exactly(old, new):
    force, slope = bed.mean_contact(old, new, DIAMETER, WEIGHT)
    gain = bed.contact(new, DIAMETER, WEIGHT)[0] - bed.contact(old, DIAMETER, WEIGHT)[0]
    assert force * (new - old) == pytest.approx(gain, rel=1e-10, abs=1e-14)
    step = 1e-5
    up, down = (bed.mean_contact(old, new + s, DIAMETER, WEIGHT)[0] for s in (step, -step))
    assert slope == pytest.approx((up - down) / (2 * step), rel=1e-3, abs=1e-2)  # the law has kinks in its curvature


def element_pose():
    """(rm, u, psi), d, positions and old pose of a bent element near the bed."""
    q1 = np.array([1.0, 0.0, 0.0, 0.0])
    q2 = rotation_vector_quaternion((0.02, 0.05, -0.03))
    d = np.array([10.0, 0.3, -0.02])
    return q1, q2, d


def test_element_on_the_bed_has_the_gradient_of_its_potential():
    q1, q2, d = element_pose()
    z1, h = -0.03, 10.0
    share = np.zeros(2)

    def potential(x, vector):
        a = times(rotation_vector_quaternion(x[3:6]), q1)
        b = times(rotation_vector_quaternion(x[9:12]), q2)
        chord = d + x[6:9] - x[0:3]
        rm, u, psi = strains.frame(tuple(a), tuple(b), tuple(chord))
        strain, rows = np.empty(7), np.empty((7, 9))
        strains.strains(rm, u, psi, np.dot(u, u) - h * h, h, share, strain)
        strains.gradients(rm, u, psi, h, share, rows)
        points, wide = np.empty((4, 2)), np.empty(12)
        lies = on_bed(), 0, h, z1 + x[2], z1 + d[2] + x[8], strain[6]
        energy, on_sag = bed.press(*lies, points)
        assert energy == pytest.approx(bed.potential(*lies), rel=1e-14)
        assembly.expand(on_sag * rows[6], wide)
        vector += wide
        bed.add_press(points, vector)
        return energy

    force = np.zeros(12)
    energy = potential(np.zeros(12), force)
    assert energy > 0.0
    expected = []
    for k in range(12):
        x = np.zeros(12)
        x[k] = 1e-6
        expected.append((potential(x, np.zeros(12)) - potential(-x, np.zeros(12))) / 2e-6)
    np.testing.assert_allclose(force, expected, rtol=1e-6, atol=1e-5 * WEIGHT)


STEP = 0.1  # s


def mean_contact(law, ends, new_z, dt=STEP):
    vector, matrix = np.zeros(12), np.zeros((12, 12))
    row = np.zeros(9)
    old_z = np.array([-0.02, 0.01, 0.005])
    sides = old_z, np.array(new_z), ends, row, row
    lost = bed.add_mean_contact(on_bed(*law), 0, 10.0, dt, *sides, True, True, vector, matrix, SCRATCH)
    return lost, vector


@pytest.mark.parametrize("way", [(0.008, 0.008), (-0.01, -0.03), (0.03, -0.01)])
def test_bed_damping_takes_power_whichever_way_the_pipe_moves(way):
    new_z = [-0.02 + way[0], 0.01 + way[1], 0.005]
    ends = np.zeros((2, 6))
    ends[:, 2] = np.array(way) / STEP
    lost, damped = mean_contact([1.0, 0.0, 1e-3], ends, new_z)
    free, elastic = mean_contact([0.0, 0.0, 1e-3], ends, new_z)
    assert free == 0.0
    assert lost > 0.0
    assert (damped - elastic)[[2, 8]] @ way == pytest.approx(lost, rel=1e-12)


def test_the_bed_never_holds_a_pipe_that_leaves_it():
    """Lifted at 3 m/s with a dashpot of 1 s/m the elastic reaction is taken away whole, not turned into suction."""
    new_z = [-0.02 - 0.03, 0.01 - 0.03, 0.005]
    ends = np.zeros((2, 6))
    ends[:, 2] = -3.0
    lost, damped = mean_contact([1.0, 0.0, 1e-3], ends, new_z, dt=0.01)
    _, elastic = mean_contact([0.0, 0.0, 1e-3], ends, new_z, dt=0.01)
    assert elastic[[2, 8]].sum() > 0.0
    np.testing.assert_array_equal(damped, 0.0)
    assert lost == pytest.approx(0.03 * elastic[[2, 8]].sum(), rel=1e-12)


def test_friction_opposes_sliding_and_saturates_at_coulombs_force():
    """Uniform sliding far above the friction speed: the force is mu times the mean reaction; its power is the dissipation."""
    ends = np.zeros((2, 6))
    ends[:, 0], ends[:, 1] = 0.3, -0.4
    new_z = [-0.02, 0.01, 0.005]
    lost, vector = mean_contact([0.0, 0.6, 1e-6], ends, new_z)
    _, normal = mean_contact([0.0, 0.0, 1e-6], ends, new_z)
    reaction = normal[2] + normal[8]
    assert reaction > 0.0
    np.testing.assert_allclose([vector[0] + vector[6], vector[1] + vector[7]], 0.6 * reaction * np.array([0.6, -0.8]), rtol=1e-9)
    assert lost == pytest.approx(0.6 * reaction * 0.5 * 0.1, rel=1e-9)


def test_friction_below_its_speed_is_viscous():
    ends = np.zeros((2, 6))
    ends[:, 0] = 1e-7
    _, vector = mean_contact([0.0, 0.6, 1e-3], ends, [-0.02, 0.01, 0.005])
    _, normal = mean_contact([0.0, 0.0, 1e-3], ends, [-0.02, 0.01, 0.005])
    assert vector[0] + vector[6] == pytest.approx(0.6 * (normal[2] + normal[8]) * 1e-4, rel=1e-6)


def test_tangent_of_the_friction_is_the_derivative_by_the_way_slid():
    """At about the friction speed, sliding askew, elements' ends at different velocities."""
    ends, dt = np.zeros((2, 6)), 0.1
    ends[:, :2] = [[8e-4, -5e-4], [3e-4, 9e-4]]

    def sliding(velocities):
        vector, matrix = np.zeros(12), np.zeros((12, 12))
        z, row = np.array([-0.02, 0.01, 0.005]), np.zeros(9)
        law = on_bed(0.0, 0.5, 1e-3)
        bed.add_mean_contact(law, 0, 10.0, dt, z, z, velocities, row, row, True, True, vector, matrix, SCRATCH)
        return vector, matrix

    _, tangent = sliding(ends)
    for node, way in ((0, 0), (0, 1), (1, 0), (1, 1)):
        change = np.zeros((2, 6))
        change[node, way] = 1e-8
        slope = (sliding(ends + change)[0] - sliding(ends - change)[0]) / (2e-8 * dt)
        np.testing.assert_allclose(tangent[[0, 1, 6, 7], 6 * node + way], slope[[0, 1, 6, 7]], rtol=1e-6)


def test_drag_is_morisons_across_and_along():
    across = drag.drag((0.0, 3.0, 4.0), (1.0, 0.0, 0.0), 7.0, 200.0)[0]
    np.testing.assert_allclose(across, [0, 200 * 5 * 3, 200 * 5 * 4], rtol=1e-14)
    along = drag.drag((-3.0, 0.0, 0.0), (1.0, 0.0, 0.0), 7.0, 200.0)[0]
    np.testing.assert_allclose(along, [-7 * 9, 0, 0], rtol=1e-14)


def test_drag_dissipates_for_any_velocity_and_direction():
    random = np.random.default_rng(5)
    for _ in range(200):
        v, t = random.normal(size=3), random.normal(size=3)
        t /= np.linalg.norm(t)
        force = np.array(drag.drag(tuple(v), tuple(t), 7.0, 200.0)[0])
        assert force @ v > 0.0
        turn = rotation(rotation_vector_quaternion(random.normal(size=3)))
        turned = drag.drag(tuple(turn @ v), tuple(turn @ t), 7.0, 200.0)[0]
        np.testing.assert_allclose(turned, turn @ force, rtol=1e-10, atol=1e-10)


def test_drag_derivative_is_a_central_difference():
    v, t = np.array([0.3, -1.1, 0.6]), np.array([0.6, 0.0, 0.8])
    _, a, b, c, v_n = drag.drag(tuple(v), tuple(t), 7.0, 200.0)
    slope = a * np.eye(3) + b * np.outer(t, t) + c * np.outer(v_n, v_n)
    for k in range(3):
        x = 1e-6 * np.eye(3)[k]
        up, down = (np.array(drag.drag(tuple(v + s * x), tuple(t), 7.0, 200.0)[0]) for s in (1, -1))
        np.testing.assert_allclose(slope[:, k], (up - down) / 2e-6, rtol=1e-7, atol=1e-6)


def test_drag_at_rest_is_zero_with_a_finite_derivative():
    force, *coefficients = drag.drag((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 7.0, 200.0)
    assert force == (0.0, 0.0, 0.0)
    assert coefficients[:3] == [0.0, 0.0, 0.0]


def element_drag(ends, current, d=(10.0, 0.0, 0.0), q1=(1.0, 0.0, 0.0, 0.0), q2=(1.0, 0.0, 0.0, 0.0), rate=0.0):
    vector, matrix = np.zeros(12), np.zeros((12, 12))
    rm, u, psi = strains.frame(tuple(q1), tuple(q2), tuple(d))
    levels = np.array([-800.0, 0.0])
    flow = np.array([current, current], dtype=float)
    power = drag.add_mean_drag(
        rm, u, psi, 10.0, np.array([7.0, 200.0]), ends, np.array([-50.0, -40.0]), levels, flow, rate, True, vector, matrix, SCRATCH
    )
    return power, vector, matrix


def test_drag_power_on_the_nodes_is_dissipation_less_current_power():
    random = np.random.default_rng(2)
    ends = random.normal(size=(2, 6))
    (lost, supplied), vector, _ = element_drag(ends, (0.3, 0.8, 0.0), (9.9, 0.5, -1.0), q2=rotation_vector_quaternion((0.1, 0.2, 0.1)))
    assert lost > 0.0
    assert vector @ ends.ravel() == pytest.approx(lost - supplied, rel=1e-12)


@pytest.mark.parametrize("axis", np.eye(3))
def test_drag_on_a_bent_element_in_rigid_rotation_is_that_of_its_arc(axis):
    """Objectivity: points of the arc move with omega x r; else a line in a cross current would gather torque from the drag."""
    d, psi = np.array([9.9, 0.5, -1.0]), np.array([0.05, -0.3, 0.1])
    ends = np.array([[0, 0, 0, *axis], [*np.cross(axis, d), *axis]])  # about the first node
    (lost, _), vector, _ = element_drag(ends, (0.0, 0.0, 0.0), tuple(d), q2=rotation_vector_quaternion(psi))
    frame = rotation(rotation_vector_quaternion(0.5 * psi))
    sag = 0.5 * np.cross(d, frame @ psi)
    power = 0.0
    for x in 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3.0):
        tangent = frame @ (np.eye(3)[0] + np.cross((x - 0.5) * psi, np.eye(3)[0]))
        tangent /= np.linalg.norm(tangent)
        v = np.cross(axis, x * d + x * (1 - x) * sag)
        power += 5.0 * np.dot(drag.drag(tuple(v), tuple(tangent), 7.0, 200.0)[0], v)
    assert lost == pytest.approx(power, rel=1e-12)
    assert vector @ ends.ravel() == pytest.approx(power, rel=1e-12)


def test_still_pipe_in_a_uniform_current_gets_the_fixed_end_forces_of_a_beam():
    """Uniform load q: q h / 2 and q h^2 / 12 at each end; the work is the current's."""
    (lost, supplied), vector, _ = element_drag(np.zeros((2, 6)), (0.0, 0.8, 0.0))
    q = 200 * 0.64
    assert lost == pytest.approx(supplied, rel=1e-12)
    np.testing.assert_allclose(vector[[1, 7]], -q * 10 / 2, rtol=1e-12)  # minus the force on the pipe
    np.testing.assert_allclose(vector[[5, 11]], [-q * 100 / 12, q * 100 / 12], rtol=1e-12)


def test_current_on_an_arc_is_that_at_the_depth_of_its_points():
    """An arc from -50 to -50 m that hangs 0.5 m below its chord, in a current that vanishes at -50 m: z + 50 = 2 x (1 - x) in it."""
    bend = np.array([0.0, 0.4, 0.0])
    ends = (rotation_vector_quaternion(sign * 0.5 * bend) for sign in (-1, 1))
    frame = strains.frame(*(tuple(q) for q in ends), (10.0, 0.0, 0.0))
    levels, flow = np.array([-51.0, -49.0]), np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    vector, matrix = np.zeros(12), np.zeros((12, 12))
    depths = np.array([-50.0, -50.0])
    drag.add_mean_drag(*frame, 10.0, np.array([7.0, 200.0]), np.zeros((2, 6)), depths, levels, flow, 0.0, True, vector, matrix, SCRATCH)
    assert vector[1] + vector[7] == pytest.approx(-10.0 * 200.0 * (2.0 / 6.0) ** 2, rel=1e-12)  # x (1 - x) = 1 / 6 at the Gauss points


def test_element_drag_tangent_is_the_derivative_with_respect_to_velocity():
    random = np.random.default_rng(3)
    ends = random.normal(size=(2, 6))
    ends[:, 3:] *= 0.0
    pose = {"d": (9.9, 0.5, -1.0), "q2": rotation_vector_quaternion((0.1, 0.2, 0.1))}
    _, _, fast = element_drag(ends, (0.3, 0.8, 0.0), **pose, rate=1e9)  # what the rotation of t1 adds does not grow with the rate
    got = fast / 1e9
    for k in range(12):
        x = np.zeros(12)
        x[k] = 1e-5
        up, down = (element_drag(ends + s * x.reshape(2, 6), (0.3, 0.8, 0.0), **pose)[1] for s in (1, -1))
        np.testing.assert_allclose(got[:, k], (up - down) / 2e-5, rtol=1e-6, atol=1e-3)


def test_current_is_linear_between_levels_and_constant_beyond():
    levels, speeds = np.array([-800.0, -100.0, 0.0]), np.array([[0.0, 0.8, 0.0], [0.0, 0.5, 0.1], [0.0, 0.0, 0.0]])
    assert current.current_at(-900.0, levels, speeds) == (0.0, 0.8, 0.0)
    assert current.current_at(5.0, levels, speeds) == (0.0, 0.0, 0.0)
    for z in (-800.0, -450.0, -100.0, -30.0, 0.0):
        expected = [np.interp(z, levels, speeds[:, k]) for k in range(3)]
        np.testing.assert_allclose(current.current_at(z, levels, speeds), expected, atol=1e-15)


def test_current_starts_ramps_and_reverses_when_told():
    assert Current(velocity=(0.0, 0.8, 0.0), start=10.0).time_factor(9.999) == 0.0
    assert Current(velocity=(0.0, 0.8, 0.0), start=10.0).time_factor(10.0) == 1.0
    assert Current(start=10.0, ramp=4.0).time_factor(12.0) == pytest.approx(0.5)
    assert Current(start=10.0, ramp=4.0).time_factor(14.0) == 1.0
    reversing = Current(start=10.0, period=5.0)
    assert [reversing.time_factor(t) for t in (12.0, 17.0, 22.0)] == [1.0, -1.0, 1.0]


def test_current_profiles_over_the_depth():
    assert Current(profile="linear").shape(800.0) == ((0.0, 800.0), (1.0, 0.0))
    assert Current(profile="uniform").shape(800.0) == ((0.0, 800.0), (1.0, 1.0))
    table = Current(profile="table", depths=(0.0, 50.0), factors=(1.0, 0.3), velocity=(1.0, 0.0, 0.0))
    assert table.shape(800.0) == ((0.0, 50.0), (1.0, 0.3))
