"""The time step: energy identity, dissipations, momenta, orders, tangent, impedance, and what it does when it fails."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pipe_helpers import (
    HANGING,
    P16,
    STILL,
    TANGENT,
    TANGENT_ATTITUDE,
    balance,
    bar,
    centres,
    free_step,
    march,
    pitch,
    rotation,
    rotation_vector_quaternion,
    sea,
    started,
    step_system,
    straight,
)

from pipe_fmu import AddedMass, PipeParameters, PipeUnit, Seabed
from pipe_fmu.step import integrator
from pipe_fmu.step import system as step_kernel
from pipe_fmu.step.state import WORKS

TWO = (replace(P16, length=500.0), replace(P16, length=700.0, wall_thickness=0.0254, coating_thickness=0.02, coating_density=2000.0))
BED = {"seabed": Seabed(damping=1.0, friction=0.5), "top_position": (780.0, 0.0, -800.0)}
PINNED_TOP = {"top": "pinned", "top_quaternion": HANGING}
SCENES = {
    "current": {},
    "bed": BED,
    "added-mass": {"added_mass": AddedMass(1.0)},
    "internal-damping": {"internal_damping": 0.02},
    "numerical-damping": {"numerical_damping": 0.1},
    "sections": {"sections": TWO},
    "pinned-foot": {"foot": "pinned"},
    "pinned-top": PINNED_TOP,
}
SCENES["everything"] = {key: value for part in SCENES.values() for key, value in part.items() if part is not PINNED_TOP}


def scene(name, **changes):
    base = {"nodes": 24, "top_position": TANGENT, "top_quaternion": TANGENT_ATTITUDE, "environment": sea(800.0, 0.8)}
    return PipeParameters(**(base | SCENES[name] | changes))


def sway(t):
    """Top motion in all directions with pitch; a metre and a half, periods about 10 s, smooth start."""
    rise = 1.0 - math.exp(-((t / 3.0) ** 2))
    way = [1.0 * math.sin(0.4 * t), 0.8 * rise * math.sin(0.5 * t + 0.3), -1.5 * math.sin(0.6 * t)]
    return rise * np.array(way), 0.04 * rise * math.sin(0.55 * t)


def keeps_the_energy_identity(pipe, old, new):
    """Energy created <= 1e-10 of summed absolute works and changes + 1e-14 of energies, and no dissipation negative."""
    created, allowed = balance(pipe, old, new)
    lost = dict(zip(WORKS, new.works - old.works, strict=True))
    del lost["current"]
    return abs(created) <= allowed and min(lost.values()) >= 0.0


@pytest.mark.parametrize("name", SCENES)
def test_energy_identity_and_dissipations_at_any_step(name):
    pipe, _, start = started(scene(name))
    for h, count in ((1e-3, 10), (0.01, 10), (0.1, 20), (0.5, 16), (1.0, 12), (2.0, 8)):
        states, _ = march(pipe, start, sway, h, count)
        for old, new in pairwise(states):
            assert keeps_the_energy_identity(pipe, old, new), f"step of {h} s at {old.time} s"


@pytest.mark.parametrize("name", SCENES)
def test_energy_identity_at_five_seconds_where_newton_converges(name):
    """Half of a period of the top's motion in one step; what does not converge is passed over, and is less than half of the steps."""
    pipe, _, state = started(scene(name))
    converged = 0
    for k in range(8):
        (here, tilt), (there, turn) = sway(5.0 * k), sway(5.0 * (k + 1))
        result = pipe.step(state, (there - here) / 5.0, np.array([0.0, (turn - tilt) / 5.0, 0.0]), 5.0)
        if result.converged:
            assert keeps_the_energy_identity(pipe, state, result.state)
            state, converged = result.state, converged + 1
    assert converged > 4


@pytest.mark.parametrize("moving", [False, True], ids=["from-rest", "moving"])
@pytest.mark.parametrize("name", SCENES)
def test_a_step_of_any_length_down_to_a_tenth_of_a_picosecond_changes_the_state_in_proportion(name, moving):
    """Whatever is left of a host's last step: the line moves by its mean velocity, to the round-off of positions, and no energy is made."""
    pipe, _, state = started(scene(name))
    if moving:
        states, _ = march(pipe, state, sway, 0.05, 40)
        state = states[-1]
    velocity = np.array([0.4, 0.2, -0.9]) + (state.velocity[-1] if moving else 0.0)
    for late in (0.0, 1e6):
        for h in 10.0 ** -np.arange(2.0, 14.0):
            old = state._replace(time=late) if late else state
            result = pipe.step(old, velocity, np.zeros(3), h)
            assert result.converged, h
            moved = np.abs(result.state.position - old.position).max()
            assert moved <= 3.0 * h * max(np.abs(velocity).max(), np.abs(old.velocity).max()) + 3e-13
            np.testing.assert_allclose(result.state.position[-1] - old.position[-1], h * velocity, rtol=0.0, atol=3e-13)
            created, allowed = balance(pipe, old, result.state)
            assert abs(created) <= allowed, h


LYING = {"length": 1200.0, "top": "pinned", "top_quaternion": (0.0, 0.0, 0.0, 0.0), "top_position": (1199.9999, 0.0, -0.01)}
LYING_MOTIONS = {
    "still": lambda t: (np.zeros(3), 0.0),
    "hauled": lambda t: (np.array([-0.3 * (1.0 - math.cos(0.5 * t)), 0.0, 0.0]), 0.0),
    "lifted": lambda t: (np.array([-0.015, 0.01, -0.05]) * t * t / (1.0 + t), 0.0),
}


@pytest.mark.parametrize("motion", LYING_MOTIONS)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_line_that_lies_keeps_the_energy_identity_with_a_factor_of_three_to_spare_at_any_step(friction, motion):
    """It stores next to nothing by which round-off could be excused: T d is work that an error d of an element's length does."""
    pipe, _, start = started(PipeParameters(section=P16, nodes=24, seabed=Seabed(friction=friction), environment=sea(100.0), **LYING))
    swept, _ = march(pipe, start, LYING_MOTIONS[motion], 0.05, 60)
    for h in (0.05, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        states = swept if h == 0.05 else march(pipe, swept[-1], LYING_MOTIONS[motion], h, 20)[0]
        worst = max(abs(created) / allowed for created, allowed in (balance(pipe, old, new) for old, new in pairwise(states)))
        assert worst < 1.0 / 3.0, h


def test_the_chords_of_a_state_are_the_differences_of_its_positions_and_the_excess_that_of_their_squares():
    pipe, _, start = started(scene("everything"))
    states, _ = march(pipe, start, sway, 0.1, 100)
    chord = np.diff(states[-1].position, axis=0)
    np.testing.assert_allclose(states[-1].chord[:, :3], chord, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(states[-1].chord[:, 3], np.sum(chord**2, axis=1) - pipe.line.length**2, rtol=0.0, atol=1e-9)


def test_each_dissipation_is_there_when_named_and_only_then():
    present = {
        "bed": "contact",
        "internal-damping": "internal",
        "numerical-damping": "numerical",
    }
    for name, extra in {"current": None, **present}.items():
        pipe, _, start = started(scene(name))
        states, _ = march(pipe, start, sway, 0.2, 15)
        works = dict(zip(WORKS, states[-1].works, strict=True))
        assert works["drag"] > 0.0
        assert works["current"] != 0.0
        assert works["rotational"] > 0.0
        for kind in present.values():
            assert (works[kind] > 0.0) == (kind == extra)


def test_rotational_damping_takes_from_the_energy_what_its_moment_brakes():
    """So strong that it takes a good share of what goes through the top: an error of its moment against its work would show."""
    pipe, _, start = started(scene("current", section=replace(P16, rotational_damping=(3e6, 2e6, 4e6))))
    states, _ = march(pipe, start, sway, 0.1, 20)
    for old, new in pairwise(states):
        assert keeps_the_energy_identity(pipe, old, new)
    lost = dict(zip(WORKS, states[-1].works - start.works, strict=True))
    assert lost["rotational"] > 0.01 * lost["drag"]


def test_bed_friction_and_bed_damping_each_dissipate():
    lost = []
    for bed in (Seabed(damping=0.0, friction=0.0), Seabed(damping=1.0, friction=0.0), Seabed(damping=0.0, friction=0.5)):
        pipe, _, start = started(scene("bed", seabed=bed))
        states, _ = march(pipe, start, sway, 0.2, 15)
        lost.append(states[-1].works[WORKS.index("contact")])
    assert lost[0] == 0.0
    assert lost[1] > 1.0
    assert lost[2] > 1.0


def test_internal_damping_quiets_an_axial_wave():
    """Kelvin-Voigt: kinetic energy left after a jerk of the top falls with the damping time."""
    left = []
    for time in (0.0, 0.05):
        pipe, _, start = started(scene("current", internal_damping=time, environment=sea(800.0)))
        states, _ = march(pipe, start, lambda t: (np.array([0.0, 0.0, -min(t, 0.1)]), 0.0), 0.02, 60)
        left.append(pipe.energies(states[-1])[0])
    assert left[1] < 0.5 * left[0]


def test_time_reverses_without_dissipation():
    """The conserving step is symmetric: thrown back with the opposite velocities the line returns to where it came from."""
    still = replace(P16, drag_normal=0.0, drag_tangential=0.0, rotational_damping=(0.0, 0.0, 0.0))
    pipe, _, start = started(scene("current", section=still, environment=sea(800.0)))
    there, _ = march(pipe, start, sway, 0.1, 10)
    last = there[-1]
    back = last._replace(velocity=-last.velocity, rate=-last.rate, last=-last.last, before=-last.before, time=0.0)
    home, _ = march(pipe, back, lambda t: sway(1.0 - t), 0.1, 10)
    np.testing.assert_allclose(home[-1].position, start.position, atol=1e-6)
    np.testing.assert_allclose(home[-1].velocity, 0.0, atol=1e-5)


def tumbling():
    """A free bar bent to an arc, tumbling and swaying."""
    s, line = bar(10.0, 7, axial=1e5, shear=5e4, torsion=80.0, bending=120.0, bending_3=90.0, mass=2.0, inertia=1e-2)
    kappa, omega = 0.15, np.array([0.5, -0.8, 0.6])
    position = np.column_stack([np.sin(kappa * s) / kappa, 0 * s, -(1 - np.cos(kappa * s)) / kappa])
    attitude = np.array([pitch(kappa * x) for x in s])
    velocity = np.cross(omega, centres(line, position, attitude)) + [1.0, 0.3, -0.4] + 0.3 * np.sin(s)[:, None] * [0.0, 1.0, 0.5]
    return line, (position, attitude, velocity, np.array([rotation(q).T @ omega for q in attitude]))


def momenta(line, state):
    position, attitude, velocity, rate = state
    p = line.mass[:, None] * velocity
    centre = centres(line, position, attitude)
    spins = [rotation(q) @ (j * w) for q, j, w in zip(attitude, line.inertia, rate, strict=True)]
    return p.sum(axis=0), np.cross(centre, p).sum(axis=0) + np.sum(spins, axis=0)


def test_a_free_line_keeps_its_linear_momentum_exactly_and_its_angular_momentum_to_second_order():
    """A step is symmetric in time: whatever is not kept errs by an even power of it, here the second. Linear momentum: to round-off."""
    line, start = tumbling()
    linear, angular = momenta(line, start)
    errors = []
    for h in (0.04, 0.02, 0.01):
        state = start
        for _ in range(round(0.4 / h)):
            state = free_step(line, state, h)
        p, spin = momenta(line, state)
        np.testing.assert_allclose(p, linear, rtol=1e-13)
        errors.append(np.linalg.norm(spin - angular) / np.linalg.norm(angular))
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("angle", [0.1, 0.5])
def test_mean_force_of_a_rigid_turn_is_the_average_of_the_turning_force(angle):
    """Stretched line turned as a whole in one step: magnitude sinc(angle / 2) of the tension (0.98962 at 0.5 rad), to 1e-3."""
    tension, axial, n = 9e5, 5e9, 9
    s, line = bar(100.0, n, axial=axial, shear=1e9, torsion=1e8, bending=1e8)
    line = line._replace(mass=0.0 * line.mass, inertia=0.0 * line.inertia)
    position, attitude = straight(s)
    position = position * (1 + tension / axial)
    theta = np.array([0.0, angle, 0.0])
    turn = rotation(rotation_vector_quaternion(theta))
    x = np.hstack([position @ turn.T - position, np.tile(theta, (n, 1))])
    zero = np.zeros((n, 3))
    ends = step_system(line, (position, attitude, zero, zero), x, 1.0)[0].reshape(n, 6)
    average = tension * np.array([math.sin(angle) / angle, 0.0, -(1 - math.cos(angle)) / angle])
    assert np.linalg.norm(average) / tension == pytest.approx(math.sin(0.5 * angle) / (0.5 * angle), rel=1e-12)
    np.testing.assert_allclose(ends[-1, :3], average, atol=1e-3 * tension)
    np.testing.assert_allclose(ends[0, :3], -average, atol=1e-3 * tension)
    np.testing.assert_allclose(ends[1:-1], 0.0, atol=1e-9 * tension)  # and nothing in between


@pytest.mark.parametrize("name", ["current", "bed", "internal-damping", "numerical-damping", "added-mass"])
def test_tangent_of_the_step_is_the_derivative_of_its_residual(name):
    """At small increments; what is left out (second order of the step, friction's and drag's turning) stays below 1e-3."""
    pipe, _, state = started(scene(name, nodes=6, length=150.0, top_position=(100.0, 0.0, -90.0), **PINNED_TOP, environment=sea(90.0, 0.8)))
    random = np.random.default_rng(1)
    h, n = 0.1, 6
    old = state.position, state.quaternion, 0.05 * random.normal(size=(n, 3)), 1e-3 * random.normal(size=(n, 3))
    x = np.hstack([h * old[2], 1e-4 * random.normal(size=(n, 3))])
    water = pipe.water(0.0)
    tangent = step_system(pipe.line, old, x, h, water)[1]
    got = np.empty_like(tangent)
    for k in range(6 * n):
        d = np.zeros(6 * n)
        d[k] = 1e-6
        up, down = (step_system(pipe.line, old, x + sign * d.reshape(n, 6), h, water)[0] for sign in (1, -1))
        got[:, k] = (up - down) / 2e-6
    for rows in (slice(0, 3), slice(3, 6)):
        for columns in (slice(0, 3), slice(3, 6)):
            a, b = (m.reshape(n, 6, n, 6)[:, rows, :, columns] for m in (tangent, got))
            np.testing.assert_allclose(a, b, atol=1e-3 * np.abs(b).max())


def still_bar(n, **changes):
    """(line, state of rest) of a bar without mass, straight along e1."""
    s, line = bar(12.0 * (n - 1), n, axial=5e6, shear=1e6, torsion=1e4, bending=2e4, **changes)
    line = line._replace(mass=0.0 * line.mass, inertia=0.0 * line.inertia)
    return line, (*straight(s), np.zeros((n, 3)), np.zeros((n, 3)))


def test_a_bar_spun_about_its_own_axis_feels_nothing():
    """Its ends move alike and do not turn against each other: there is no way to close the path integral along, and none is needed."""
    line, old = still_bar(3)
    x = np.zeros((3, 6))
    x[:, 3] = 0.4
    residual, *_ = step_system(line, old, x, 1.0)
    np.testing.assert_allclose(residual, 0.0, atol=1e-9)


def test_what_an_element_feels_does_not_depend_on_how_others_turn():
    """Nodes that hardly move, computed side by side with one that turns by half a radian."""
    line, old = still_bar(6)
    x = 1e-9 * np.random.default_rng(5).normal(size=(6, 6))
    alone = step_system(line, old, x, 1.0)[0].reshape(6, 6)
    x[5, 4] = 0.5
    beside = step_system(line, old, x, 1.0)[0].reshape(6, 6)
    assert np.abs(alone[:4]).max() > 1e-4
    np.testing.assert_array_equal(beside[:4], alone[:4])


def test_a_step_is_measured_by_the_largest_force_and_moment_at_an_end_of_an_element():
    """A bar stretched by 1e-3 and a bar bent to curvature kappa: mean of before and after, EA e / 2 and EI kappa / 2."""
    line, old = still_bar(3)
    scales = []
    for stretched, kappa in ((1e-3, 0.0), (0.0, 1e-4)):
        x = np.zeros((3, 6))
        x[:, 0] = stretched * old[0][:, 0]
        x[:, 2], x[:, 4] = -0.5 * kappa * old[0][:, 0] ** 2, kappa * old[0][:, 0]
        system = np.empty((3, 6, 6)), np.empty((2, 6, 6)), np.empty((2, 6, 6)), np.empty((3, 6))
        state = *old, np.zeros((0, 3)), np.zeros((2, 7))
        scales.append(step_kernel.step_system(line, STILL, 1.0, *state, x, np.empty((2, 7)), True, True, system, np.empty(6)))
    assert scales[0] == pytest.approx((0.5 * 5e6 * 1e-3, 0.0), rel=1e-6, abs=1e-6)
    assert scales[1][1] == pytest.approx(0.5 * 2e4 * 1e-4, rel=5e-3)


def test_tangent_of_a_step_is_exact_for_any_turn_where_no_force_acts():
    """A bar turned by 0.4 rad as a whole, at the velocities at which its masses, ahead of the nodes, neither slow nor speed up."""
    s, line = bar(24.0, 3, axial=5e6, shear=1e6, torsion=1e4, bending=2e4, mass=2.0)
    line = line._replace(offset=np.array([0.5, -0.3, 0.2]), inertia=0.0 * line.inertia, damping=np.full(2, 0.1))
    position, attitude = straight(s)
    theta, h, n = np.array([0.2, -0.3, 0.17]), 0.1, 3
    turn = rotation(rotation_vector_quaternion(theta))
    x = np.hstack([position @ turn.T - position, np.tile(theta, (n, 1))])
    moved = (position + line.offset[:, None] * [1.0, 0.0, 0.0]) @ (turn.T - np.eye(3))
    old = position, attitude, moved / h, np.zeros((n, 3))
    residual, tangent, *_ = step_system(line, old, x, h)
    got = np.empty_like(tangent)
    for k in range(6 * n):
        d = np.zeros(6 * n)
        d[k] = 1e-6
        up, down = (step_system(line, old, x + sign * d.reshape(n, 6), h)[0] for sign in (1, -1))
        got[:, k] = (up - down) / 2e-6
    assert np.abs(residual).max() < 1e-6
    np.testing.assert_allclose(tangent, got, rtol=1e-6, atol=1e-8 * np.abs(got).max())


@pytest.mark.parametrize("name", ["current", "pinned-top", "added-mass"])
def test_impedance_is_the_difference_of_top_forces_by_top_velocities(name):
    pipe, _, start = started(scene(name))
    state = march(pipe, start, sway, 0.1, 5)[0][-1]
    v, w, h = np.array([0.2, 0.1, -0.3]), np.array([0.0, 0.01, 0.0]), 0.1
    impedance = pipe.step(state, v, w, h).impedance
    for k in range(6):
        change = np.zeros(6)
        change[k] = 1e-5
        up, down = (pipe.step(state, v + sign * change[:3], w + sign * change[3:], h).top for sign in (1, -1))
        slope = (up - down) / 2e-5
        np.testing.assert_allclose(impedance[:, k], slope, atol=5e-3 * np.abs(slope).max() + 1e-6 * np.abs(impedance).max())
    if name == "pinned-top":
        assert not pipe.step(state, v, w, h).top[3:].any()
        assert not impedance[3:].any()
        assert not impedance[:, 3:].any()
    assert np.linalg.eigvalsh(impedance + impedance.T)[0] > -1e-6 * np.abs(impedance).max()  # it resists


@pytest.mark.parametrize("name", ["current", "pinned-top", "added-mass"])
@pytest.mark.parametrize("mass", [1e3, 1e7])
def test_a_top_that_yields_meets_the_law_of_what_holds_it_and_feels_the_force_of_its_own_motion(name, mass):
    pipe, _, start = started(scene(name))
    state, h = march(pipe, start, sway, 0.1, 5)[0][-1], 0.2
    a = np.random.default_rng(1).normal(size=(6, 6))
    mobility = 0.5 * h / mass * (np.diag([1.0] * 3 + [0.1] * 3) + 0.01 * a @ a.T)  # of a body held off its centre
    pull = pipe.step(state, np.zeros(3), np.zeros(3), h).top
    free = np.array([0.2, 0.1, -0.3, 0.0, 0.01, 0.0]) + mobility @ pull
    met = pipe.step(state, free[:3], free[3:], h, mobility)
    assert met.converged
    velocity = met.state.last[-1]
    held = slice(0, 3) if name == "pinned-top" else slice(0, 6)
    np.testing.assert_allclose(velocity[held], (free - mobility @ met.top)[held], rtol=0.0, atol=1e-9 * np.abs(free).max())
    told = pipe.step(state, velocity[:3], velocity[3:], h)
    np.testing.assert_allclose(met.top, told.top, rtol=0.0, atol=1e-9 * np.abs(told.top).max())


@pytest.mark.parametrize(("speed", "h"), [(0.2, 0.1), (0.2, 1e-5), (20.0, 1e-6), (2e-3, 1e-7)])
@pytest.mark.parametrize("mass", [1e2, 1e7])
def test_a_top_that_yields_leaves_a_line_at_rest_by_that_law_too(mass, speed, h):
    """The guess, rest, balances the pipe, but knows nothing of what the top is told."""
    pipe, _, start = started(scene("current", environment=sea(800.0, 0.0)))
    mobility = 0.5 * h / mass * np.diag([1.0] * 3 + [0.1] * 3)
    pull = pipe.step(start, np.zeros(3), np.zeros(3), h).top
    free = speed * np.array([1.0, 0.0, -0.5, 0.0, 0.05, 0.0]) + mobility @ pull
    met = pipe.step(start, free[:3], free[3:], h, mobility)
    assert met.converged
    velocity = met.state.last[-1]
    np.testing.assert_allclose(velocity, free - mobility @ met.top, rtol=0.0, atol=1e-9 * np.abs(free).max())
    assert np.abs(velocity).max() > 0.0


@pytest.mark.parametrize("size", [1e-4, 0.05])
@pytest.mark.parametrize("name", ["current", "everything"])
def test_residual_is_the_same_with_and_without_its_tangent(name, size):
    pipe, _, state = started(scene(name, nodes=10))
    random = np.random.default_rng(2)
    x = size * random.normal(size=(10, 6))
    water = pipe.water(0.0)
    both = []
    for fresh in (True, False):
        system = np.empty((10, 6, 6)), np.empty((9, 6, 6)), np.empty((9, 6, 6)), np.empty((10, 6))
        strain, works = np.empty((9, 7)), np.empty(6)
        old = state.position, state.quaternion, state.velocity, state.rate, state.added_mass_velocity, state.strain
        scales = step_kernel.step_system(pipe.line, water, 0.1, *old, x, strain, fresh, True, system, works)
        both.append((system[3], strain, works, scales))
    for one, other in zip(*both, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12 * np.abs(one).max())


def with_added_mass():
    """Straight line along e1 with 40 kg/m of its own and 25 kg/m of water across."""
    s, line = bar(60.0, 7, axial=1e8, shear=1e8, torsion=1e6, bending=1e6, mass=40.0)
    ends = np.diff(s, prepend=s[0], append=s[-1])
    across = 25.0 * 0.5 * (ends[:-1] + ends[1:])
    return line._replace(added_mass=np.column_stack([0.0 * across, across, across])), *straight(s)


@pytest.mark.parametrize(("way", "mass"), [(0, 40.0), (1, 65.0), (2, 65.0)])
def test_added_mass_resists_acceleration_across_and_not_along(way, mass):
    """From rest to v in a step of mean velocity v / 2: force = m v / h, over the whole line."""
    line, position, attitude = with_added_mass()
    h, v = 0.1, 0.3 * np.eye(3)[way]
    x = np.hstack([np.tile(0.5 * h * v, (7, 1)), np.zeros((7, 3))])
    zero = np.zeros((7, 3))
    force = step_system(line, (position, attitude, zero, zero), x, h)[0].reshape(7, 6)[:, :3].sum(axis=0)
    np.testing.assert_allclose(force, mass * 60.0 * v / h, atol=1e-6)


def test_steady_oblique_motion_feels_munks_moment():
    """Kirchhoff: a body towed steadily at v needs the moment v x M_a v, and no force, whatever the angle."""
    line, position, attitude = with_added_mass()
    h, v = 0.1, np.array([0.6, 0.2, -0.3])
    velocity = np.tile(v, (7, 1))
    x = np.hstack([h * velocity, np.zeros((7, 3))])
    residual = step_system(line, (position, attitude, velocity, 0 * velocity), x, h, flow=velocity)[0].reshape(7, 6)
    np.testing.assert_allclose(residual[:, :3], 0.0, atol=1e-6)
    moment = residual[:, 3:].sum(axis=0)
    np.testing.assert_allclose(moment, 60.0 * np.cross(v, [0.0, 25.0 * v[1], 25.0 * v[2]]), atol=1e-6)


def ramped(t):
    """Smooth start to speed: three derivatives vanish at t = 0."""
    rise = 1.0 - math.exp(-((t / 4.0) ** 4))
    return rise * np.array([0.6 * math.sin(0.5 * t), 0.5 * math.sin(0.4 * t), -1.0 * math.sin(0.5 * t)]), 0.02 * rise * math.sin(0.5 * t)


def test_second_order_in_time():
    """Positions and top force at 8 s, against steps sixteen times shorter; axial ringing damped by the material."""
    pipe, _, start = started(scene("added-mass", internal_damping=0.05))
    found = []
    for h in (0.1, 0.05, 0.00625):
        states, results = march(pipe, start, ramped, h, round(8.0 / h) + 1)
        force = 0.5 * (results[-1].top + results[-2].top)  # means over the steps before and after 8 s
        found.append((states[-2].position, force[:3]))
    for k in range(2):
        coarse, fine = (np.linalg.norm(found[i][k] - found[2][k]) for i in range(2))
        assert math.log2(coarse / fine) > 1.85


def test_newton_needs_few_corrections_at_a_tenth_of_a_second():
    pipe, _, start = started(scene("bed", nodes=48))
    _, results = march(pipe, start, sway, 0.1, 60)
    assert np.median([result.iterations for result in results]) <= 4
    assert all(result.residual <= 1e-9 for result in results)


def test_no_motion_of_the_top_leaves_the_equilibrium_alone():
    for name in ("current", "bed", "pinned-top"):
        pipe, found, start = started(scene(name))
        states, results = march(pipe, start, lambda t: (np.zeros(3), 0.0), 0.1, 20)
        np.testing.assert_allclose(states[-1].position, start.position, atol=1e-6)
        np.testing.assert_allclose(results[-1].top, found.top, rtol=1e-6, atol=1e-6 * np.abs(found.top).max())


def test_the_top_goes_exactly_where_it_is_told():
    pipe, _, start = started(scene("current"))
    v, w = np.array([0.3, -0.2, 0.5]), np.array([0.02, -0.05, 0.03])
    state = start
    for _ in range(10):
        state = pipe.step(state, v, w, 0.1).state
    np.testing.assert_allclose(state.position[-1], np.array(TANGENT) + v, atol=1e-12)
    turn = rotation(rotation_vector_quaternion(w)) @ rotation(np.array(TANGENT_ATTITUDE))
    np.testing.assert_allclose(rotation(state.quaternion[-1]), turn, atol=1e-13)
    assert state.time == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["current", "pinned-foot"])
def test_the_foot_stays_where_it_is_held(name):
    """Nothing creeps in by the extrapolated guess, which no correction moves at the foot."""
    pipe, _, start = started(scene(name))
    states, _ = march(pipe, start, sway, 0.2, 100)
    np.testing.assert_allclose(states[-1].position[0], start.position[0], atol=1e-15)


def test_a_step_that_cannot_converge_says_so_and_leaves_the_state_alone():
    pipe, _, start = started(scene("current"))
    kept = [np.array(part, copy=True) for part in start]
    result = pipe.step(start, np.array([4000.0, 0.0, 0.0]), np.array([0.0, 300.0, 0.0]), 1.0)
    assert not result.converged
    assert result.state is start
    assert not result.residual <= 1e-9
    assert all(np.array_equal(a, b) for a, b in zip(kept, start, strict=True))
    assert pipe.step(start, np.zeros(3), np.zeros(3), 0.1).converged


def test_states_are_values_that_no_step_changes():
    pipe, _, start = started(scene("everything"))
    one = march(pipe, start, sway, 0.1, 3)[0][-1]
    kept = [np.array(part, copy=True) for part in one]
    first = pipe.step(one, np.array([0.3, 0.0, 0.1]), np.zeros(3), 0.1)
    again = pipe.step(one, np.array([0.3, 0.0, 0.1]), np.zeros(3), 0.1)
    assert all(np.array_equal(a, b) for a, b in zip(kept, one, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(first.state, again.state, strict=True))  # rollback repeats bit for bit


def test_unit_reports_a_failed_step_in_one_line_and_keeps_its_state():
    unit = PipeUnit(scene("current"))
    still = {"velocity": np.zeros(3), "angular_velocity": np.zeros(3), "mobility": np.zeros(36)}
    assert unit.initialize(0.0, still) is None
    before = unit.state
    message = unit.step(0.0, 1.0, still | {"velocity": np.array([4000.0, 0.0, 0.0]), "angular_velocity": np.array([0.0, 300.0, 0.0])})
    assert message is not None
    assert "\n" not in message
    assert "no convergence" in message
    assert unit.state is before
    assert unit.step(0.0, 0.1, still) is None


def test_a_step_that_would_twist_an_element_past_half_a_turn_is_refused():
    """Its rotation vector would jump from pi to -pi, and torque and energy with it; Newton's method does not see that."""
    s, line = bar(100.0, 3, axial=1e8, shear=1e8, torsion=1e4, bending=1e7, inertia=0.1)
    position = np.outer(1.001 * s, [1.0, 0.0, 0.0])
    twisted = np.array([rotation_vector_quaternion([angle * math.pi, 0.0, 0.0]) for angle in (0.0, 0.9, 1.89)])
    start = integrator.rest(line, position, twisted, 0.0)
    less, more = (integrator.step(line, STILL, start, np.zeros(3), np.array([spin, 0.0, 0.0]), 1e-3) for spin in (30.0, 33.0))
    assert less.converged
    gained = sum(integrator.energy_of(line, less.state)) - sum(integrator.energy_of(line, start))
    assert gained == pytest.approx(less.state.top_work, rel=1e-9)
    assert "past half a turn" in more.flaw
    assert not more.converged
    assert more.state is start
