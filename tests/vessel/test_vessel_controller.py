"""The vessel's dynamic positioning: set-point, feed-forward, bumpless start, saturation, anti-windup, sampling grid."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

from vessel_fmu.attitude import along_heading, angles_from_quaternion
from vessel_fmu.dp_controller import control_law, controlled, due_sample, filtered, initial_control, pid, sampled, with_pull, wrap
from vessel_fmu.environment import Current, Environment
from vessel_fmu.parameters import Controller, Start, VesselParameters, values
from vessel_fmu.vessel import Inputs, Vessel

HOLD = 379.6e3  # N, horizontal pull of the 16 in pipe hanging tangentially to the bed; 316.7e3 N at x = 780 m
PAPER = VesselParameters(
    controller=Controller(x=780.0, y=0.0, yaw=0.0),
    hold_force=(HOLD, 0.0, 0.0),
    start=Start(position=(804.72, 0.0, -799.935)),
    environment=Environment(current=Current(velocity=(0.0, 0.8, 0.0), start=10.0)),
)


def pipe_like(state, time):
    """Horizontal pull between the two published values, stiff in sway, pushed and shaken by the current."""
    x, y, _ = state.position
    pull = 316.7e3 + (HOLD - 316.7e3) * (x - 780.0) / 24.72 * abs((x - 780.0) / 24.72) ** 0.5
    wake = (25e3 + 5e3 * np.sin(0.6 * time)) if time > 10.0 else 0.0
    shake = 1.0 + 0.03 * np.sin(0.7 * time) if time > 10.0 else 1.0
    return Inputs(force=np.array([-pull * shake, wake - 3e3 * y, 9e5]))


def simulate(vessel, duration, h, load=pipe_like):
    """Times and states, the start included."""
    state, history = vessel.start(), [(0.0, vessel.start())]
    for k in range(round(duration / h)):
        result = vessel.step(state, k * h, h, load(state, k * h))
        assert result.converged
        state = result.state
        history.append(((k + 1) * h, state))
    return history


@pytest.mark.parametrize("h", [0.1, 1.0])
def test_paper_scene_reaches_the_set_point(h):
    """Paper 4.2: current at 10 s, controller at 30 s, and at 300 s within 1 m and 0.05 m/s of x = 780 m, y = 0."""
    vessel = Vessel(PAPER)
    history = simulate(vessel, 300.0, h)
    _, state = history[-1]
    assert np.hypot(state.position[0] - 780.0, state.position[1]) < 0.2
    assert np.linalg.norm(state.body_velocity[:3]) < 0.02
    assert max(abs(state.position[1]) for _, state in history) < 15.0
    assert_allclose(state.control.reference[0], (780.0, 0.0, 0.0), atol=0.02)


def test_hold_thrust_keeps_the_equilibrium_until_the_start():
    calm = replace(PAPER, environment=Environment(), start=Start(position=(804.72, 0.0, -800.0)))
    vessel = Vessel(replace(calm, controller=None))
    state = simulate(vessel, 60.0, 0.5, lambda *_: Inputs(force=np.array([-HOLD, 0.0, 0.0])))[-1][1]
    assert np.abs(state.position - [804.72, 0.0, 0.0]).max() < 1e-9
    assert_allclose(vessel.thrust(state), (HOLD, 0.0, 0.0))


@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.1])
def test_controller_takes_over_without_a_bump(yaw):
    """The first thrust of the controller is the hold thrust, though the vessel drifts and the pull has changed by then."""
    hold = (-1e5, 2.5e5, -3e6)
    vessel = Vessel(replace(PAPER, hold_force=hold, start=Start(attitude=(0.01, -0.02, yaw), velocity=(0.3, -0.2, 0.1))))
    load = Inputs(force=np.array([-2e5, 1e5, 9e5]), moment=np.array([0.0, 0.0, 1e6]))
    history = simulate(vessel, 30.5, 0.1, lambda *_: load)
    thrusts = np.array([state.control.thrust for _, state in history])
    samples = np.array([state.control.sample for _, state in history])
    assert_allclose(thrusts[samples == -1], np.tile(hold, ((samples == -1).sum(), 1)), rtol=0)
    assert_allclose(thrusts[samples == 0], np.tile(hold, ((samples == 0).sum(), 1)), rtol=1e-12)
    assert (samples == 0).any()


def test_feed_forward_carries_a_changed_pull():
    """PD action alone would stand off by pull / K_p; with the pull fed forward nothing is left, also without integral action."""
    vessel = Vessel(replace(PAPER, controller=Controller(start=0.0, x=804.72, integral_ratio=0.0), environment=Environment()))
    state = simulate(vessel, 200.0, 0.5, lambda _, time: Inputs(force=np.array([-HOLD if time < 5.0 else -0.7 * HOLD, 0.0, 0.0])))[-1][1]
    assert abs(state.position[0] - 804.72) < 1e-2
    assert_allclose(vessel.thrust(state)[0], 0.7 * HOLD, rtol=1e-3)
    assert 0.3 * HOLD / vessel.law.stiffness[0] > 1.0


def test_feed_forward_carries_the_yaw_moment_of_the_hang_off_point():
    """A pull across a point aft of the centre of gravity: its moment is fed forward, so that the heading comes back without integral."""
    free = replace(
        PAPER, controller=Controller(start=0.0, x=804.72, integral_ratio=0.0), hold_force=(0.0, 0.0, 0.0), environment=Environment()
    )
    vessel = Vessel(replace(free, hang_off=(-40.0, 0.0, 0.0)))
    state = simulate(vessel, 300.0, 0.5, lambda *_: Inputs(force=np.array([0.0, 1e5, 0.0])))[-1][1]
    assert_allclose(vessel.thrust(state), (0.0, -1e5, 4e6), atol=10.0)
    assert abs(state.quaternion[3]) < 1e-4
    assert_allclose(state.position[:2], (804.72, 0.0), atol=1e-2)


def test_thrust_is_told_along_the_heading():
    vessel = Vessel(replace(PAPER, hold_force=(2e5, 1e5, 3e6), start=Start(attitude=(0.0, 0.0, np.pi / 2))))
    assert_allclose(vessel.thrust(vessel.start()), (1e5, -2e5, 3e6), rtol=1e-12)


def test_feed_forward_acts_on_accepted_steps_only_and_not_within_the_step():
    """Two trial steps from one state with different pulls have the same thrust: the mobility keeps no trace of the controller."""
    vessel = Vessel(replace(PAPER, controller=Controller(start=0.0, period=0.1)))
    state = simulate(vessel, 1.0, 0.1)[-1][1]
    one, two = (vessel.step(state, 1.0, 0.1, Inputs(force=np.array([f, 0.0, 0.0]))).state.control for f in (-1e5, -9e5))
    assert np.array_equal(one.thrust, two.thrust)
    assert one.pull[0] > two.pull[0]


def test_low_pass_of_the_pull_does_not_depend_on_the_step():
    law, hold = control_law(values(PAPER)), np.array([HOLD, 0.0, 0.0])
    fine = coarse = initial_control(hold, np.zeros(3))
    pull = np.array([-1e5, 2e5, 3e6])
    for _ in range(100):
        fine = with_pull(law, fine, pull, 0.1)
    coarse = with_pull(law, coarse, pull, 10.0)
    assert_allclose(fine.pull, coarse.pull, rtol=1e-12)
    assert_allclose(coarse.pull - pull, np.exp(-1.0) * (-hold - pull), rtol=1e-12)


@pytest.mark.parametrize("dt", [0.05, 3.0, 80.0])
def test_reference_filter_is_the_exact_third_order_lag(dt):
    """(1 + T d/dt)^3 eta = set-point, against the matrix exponential of its companion form."""
    reference, set_point, lag = np.random.default_rng(2).normal(size=(3, 3)), np.array([1.0, -2.0, 0.3]), 20.0
    companion = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(lag**-3), -3.0 * lag**-2, -3.0 / lag]])
    offset = reference - np.array([set_point, np.zeros(3), np.zeros(3)])
    expected = expm(dt * companion) @ offset + np.array([set_point, np.zeros(3), np.zeros(3)])
    assert_allclose(filtered(reference, set_point, lag, dt), expected, rtol=1e-9, atol=1e-12)


def test_thrust_is_saturated_along_the_heading():
    parameters = replace(PAPER, hold_force=(0.0, 0.0, 0.0), start=Start(attitude=(0.0, 0.0, 0.7)))
    law = control_law(values(parameters))
    state = initial_control(np.zeros(3), np.array([804.72, 0.0, 0.7]))
    far = np.array([[700.0, 300.0, -1.5], [0.0] * 3, [0.0] * 3])
    _, thrust = pid(law, far, state.integral, state.pull, np.array([804.72, 0.0, 0.7]), np.zeros(3), 0.5)
    c, s = np.cos(0.7), np.sin(0.7)
    along = (c * thrust[0] + s * thrust[1], -s * thrust[0] + c * thrust[1], thrust[2])
    wanted = law.stiffness * (c * -104.72 + s * 300.0, s * 104.72 + c * 300.0, -2.2)
    assert_allclose(along, np.clip(wanted, -law.limit, law.limit), rtol=1e-12)
    assert abs(along[1]) == pytest.approx(parameters.controller.sway_limit)
    assert abs(along[2]) == pytest.approx(parameters.controller.yaw_limit)


@pytest.mark.parametrize(("tracking", "overshoot"), [(None, 0.0), (1e12, 50.0)])
def test_integral_does_not_wind_up_while_saturated(tracking, overshoot):
    """After 200 s of load beyond the thrust the vessel comes back at once; without back-calculation it shoots 50 m past."""
    weak = Controller(start=0.0, x=804.72, sway_limit=1e5, feed_forward_time=1e9)
    free = replace(PAPER, controller=weak, hold_force=(0.0, 0.0, 0.0), environment=Environment())
    law, vessel = (
        control_law(values(free)),
        Vessel(replace(free, controller=None)),
    )  # the controller stands outside, its thrust comes by a port
    law = law if tracking is None else law._replace(tracking_time=tracking)
    state, memory, offset = vessel.start(), initial_control(np.zeros(3), np.array([804.72, 0.0, 0.0])), []
    for k in range(1000):
        memory = controlled(law, memory, 0.5 * k, state.position, state.quaternion, state.body_velocity)
        thrust = along_heading(angles_from_quaternion(state.quaternion)[2], memory.thrust)
        wind = np.array([0.0, 1.5e5 if k < 400 else 0.0, 0.0])
        state = vessel.step(state, 0.5 * k, 0.5, Inputs(environment_force=wind, control_force=thrust)).state
        offset.append(state.position[1])
    offset = np.array(offset)
    assert offset.max() > 30.0
    assert -offset.min() == pytest.approx(overshoot, abs=5.0)
    assert (abs(offset[-1]) < 0.1) == (tracking is None)


def test_heading_error_takes_the_short_way_round():
    assert wrap(np.pi + 0.1) == pytest.approx(-np.pi + 0.1)
    parameters = replace(PAPER, controller=Controller(start=0.0, yaw=-3.1, x=0.0), hold_force=(0.0, 0.0, 0.0), environment=Environment())
    vessel = Vessel(replace(parameters, start=Start(position=(0.0, 0.0, -800.0), attitude=(0.0, 0.0, 3.1))))
    history = simulate(vessel, 250.0, 0.5, lambda *_: Inputs())
    headings = np.unwrap([2.0 * np.arctan2(state.quaternion[3], state.quaternion[0]) for _, state in history])
    assert headings[-1] == pytest.approx(2.0 * np.pi - 3.1, abs=1e-3)
    assert headings.min() > 3.1 - 1e-6


@pytest.mark.parametrize("h", [0.07, 0.1, 0.3, 0.5, 1.3])
def test_samples_follow_their_own_grid_whatever_the_macro_step(h):
    """A sample is taken in the first step that begins at or after start + k period; none twice, none early, all if h < period."""
    parameters = replace(PAPER, controller=Controller(start=2.0, period=0.5))
    history = simulate(Vessel(parameters), 12.0, h)
    begins = [time - h for time, _ in history[1:]]
    taken = [state.control.sample for _, state in history[1:]]
    for begin, sample in zip(begins, taken, strict=True):
        assert sample == max(-1, int(np.floor((begin - 2.0) / 0.5 + 1e-6)))
    changes = np.flatnonzero(np.diff([-1, *taken]))
    assert_allclose([history[1 + i][1].control.time for i in changes], [begins[i] for i in changes])


def test_thrust_between_samples_is_held():
    vessel = Vessel(replace(PAPER, controller=Controller(start=0.0, period=1.0)))
    history = simulate(vessel, 5.0, 0.1)
    by_sample = {}
    for _, state in history[1:]:
        by_sample.setdefault(state.control.sample, []).append(state.control.thrust)
    assert sorted(by_sample) == [0, 1, 2, 3, 4]
    assert all(np.array_equal(thrust, thrusts[0]) for thrusts in by_sample.values() for thrust in thrusts)


def test_gains_are_those_of_the_pole_placement():
    """MSS PIDnonlinearMIMO: K_p = M w^2, K_d = 2 zeta w M; M = m + A(0) at w_n = 0.05, zeta = 1."""
    law = control_law(values(replace(PAPER, controller=Controller(natural_frequency=0.05, integral_ratio=0.1))))
    mass = np.array([6.3622e6 + 8.46e5, 6.3622e6 + 5.15e6, 2.7261e9 + 2.15e9])
    assert_allclose(law.stiffness, 0.0025 * mass, rtol=1e-3)
    assert_allclose(law.damping, 0.1 * mass, rtol=1e-3)
    assert_allclose(law.integral, 0.1 * 0.05**3 * mass, rtol=1e-3)
    assert_allclose(law.mass, np.diag(Vessel(PAPER).hull.mass)[[0, 1, 5]])


def test_a_reference_that_accelerates_is_fed_forward_by_the_mass():
    law, zero, acceleration = control_law(values(PAPER)), np.zeros(3), np.array([1e-2, 2e-2, 1e-5])
    _, thrust = pid(law, np.array([zero, zero, acceleration]), zero, zero, zero, zero, 0.5)
    assert_allclose(thrust, law.mass * acceleration, rtol=1e-12)


def test_the_current_over_a_step_is_that_of_its_middle():
    ramp = Current(velocity=(0.0, 0.8, 0.0), ramp=20.0)
    still = replace(ramp, ramp=0.0, velocity=(0.0, 0.8 * ramp.time_factor(2.0), 0.0))
    moved = []
    for current in (ramp, still):
        vessel = Vessel(replace(PAPER, controller=None, environment=Environment(current=current)))
        moved.append(vessel.step(vessel.start(), 1.0, 2.0, Inputs()).state.body_velocity)
    assert_allclose(*moved, rtol=1e-12, atol=1e-15)
    assert abs(moved[0][1]) > 1e-4


def test_a_sample_is_not_due_before_the_start():
    law, state = control_law(values(PAPER)), initial_control(np.zeros(3), np.zeros(3))
    assert due_sample(law, state, 29.9) == -1
    assert due_sample(law, state, 30.0 - 1e-9) == 0
    after = sampled(law, state, 0.0, 30.0, np.zeros(3), np.zeros(3))
    assert due_sample(law, after, 30.4) == -1
    assert due_sample(law, after, 31.7) == 3


def test_the_loop_without_a_frequency_of_its_own_is_that_of_a_tenth_of_a_radian_per_second():
    """K_p = M w_n^2, K_d = 2 M w_n, K_i = 0.2 w_n K_p at w_n = 0.1 rad/s."""
    vessel = Vessel(VesselParameters(controller=Controller()))
    law, mass = vessel.law, np.diag(vessel.hull.mass)[[0, 1, 5]]
    assert_allclose(law.stiffness, 0.01 * mass, rtol=1e-12)
    assert_allclose(law.damping, 0.2 * mass, rtol=1e-12)
    assert_allclose(law.integral, 2e-4 * mass, rtol=1e-12)
    assert law.tracking_time == pytest.approx(10.0)


@pytest.mark.parametrize("yaw", [0.6, -2.2])
def test_the_hold_thrust_is_held_against_the_limits_along_the_heading(yaw):
    """All of it ahead: within the surge limit, though sway can hardly push; turned the other way it would be beyond both."""
    hold = (2e5 * np.cos(yaw), 2e5 * np.sin(yaw), 0.0)
    start, weak = Start(attitude=(0.0, 0.0, yaw)), Controller(surge_limit=2.001e5, sway_limit=1.0)
    VesselParameters(controller=weak, hold_force=hold, start=start)
    with pytest.raises(ValueError, match=r"controller\.surge_limit = 199000: must be >= the hold thrust 200000 N"):
        VesselParameters(controller=replace(weak, surge_limit=1.99e5), hold_force=hold, start=start)
    with pytest.raises(ValueError, match=r"controller\.sway_limit = 1: must be >= the hold thrust 200000 N"):
        VesselParameters(controller=weak, hold_force=(-hold[1], hold[0], 0.0), start=start)
