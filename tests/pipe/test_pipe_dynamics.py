"""Published and peer-computed histories: heave and snap of the peer pipe, Low and Langley's jumper."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from pipe_helpers import HANGING, TANGENT, TANGENT_ATTITUDE, balance, heave_case, march, rotation, started

from pipe_fmu import AddedMass, PipeParameters, Section
from pipe_fmu.environment import Environment


def heave(amplitude, period):
    """Top motion of the comparison: up first, 24 s raised-cosine ramp."""

    def motion(t):
        ramp = 0.5 * (1 - math.cos(math.pi * t / 24)) if t < 24 else 1.0
        return np.array([0.0, 0.0, -amplitude * math.sin(2 * math.pi * t / period) * ramp]), 0.0

    return motion


@cache
def heave_history():
    pipe, _, start = started(heave_case())
    states, results = march(pipe, start, heave(2.0, 12.0), 0.1, 3000)
    return pipe, states, results


def top_forces(results):
    return np.array([np.linalg.norm(result.top[:3]) for result in results]) / 1e3


def test_heave_case_has_the_top_force_of_the_converged_peer():
    """Mean 1288.2, least 1091.6 and largest 1482.5 kN to 0.1 %: 300 s, 48 nodes, 0.1 s (largest: once periodic, from 48 s)."""
    force = top_forces(heave_history()[2])
    assert force.mean() == pytest.approx(1288.2, rel=1e-3)
    assert force.min() == pytest.approx(1091.6, rel=1e-3)
    assert force[480:].max() == pytest.approx(1482.5, rel=1e-3)


def test_heave_case_takes_three_corrections_a_step_and_closes_its_energy():
    pipe, states, results = heave_history()
    assert np.median([result.iterations for result in results]) <= 3
    assert max(result.iterations for result in results) <= 4
    creation = [balance(pipe, a, b)[0] for a, b in pairwise(states)]
    exchanged = np.abs(np.diff([state.top_work for state in states])).sum()
    assert np.abs(np.cumsum(creation)).max() <= 1e-10 * exchanged


def test_snap_case_has_the_peak_force_two_codes_agree_on():
    """Amplitude 6 m, period 8 s: the line goes slack and snaps; peak 3.93 MN to 2 %, no code's 13 MN."""
    pipe, _, start = started(heave_case())
    _, results = march(pipe, start, heave(6.0, 8.0), 0.05, 1000)
    force = top_forces(results)
    assert force.max() == pytest.approx(3930.0, rel=0.02)
    assert force.min() < 100.0


def jumper(**changes):
    """Low and Langley (2006): 170 m flexible jumper between (-100, 0, -55) and (0, 0, -5)."""
    section = Section(
        outer_diameter=0.396,
        wall_thickness=0.01,
        axial_stiffness=5e8,
        shear_stiffness=1e8,
        bending_stiffness=120.8e3,
        torsional_stiffness=1e5,
        mass=165.0,
        drag_normal=1.0,
        drag_tangential=0.0,
        rotational_damping=(0.0, 0.0, 0.0),
    )
    return PipeParameters(
        length=170.0,
        section=section,
        foot="pinned",
        top="pinned",
        top_position=(100.0, 0.0, -50.0),
        top_quaternion=HANGING,
        added_mass=AddedMass(1.0),
        environment=Environment(depth=55.0, water_density=1000.0, gravity=9.807),
        **changes,
    )


def test_low_and_langley_jumper_at_rest():
    """Published OrcaFlex statics: tension 47.11 (top) and 26.6 (bottom), top vertical 45.71, horizontal 11.40 kN."""
    _, found, _ = started(jumper(nodes=41))
    assert np.linalg.norm(found.top[:3]) == pytest.approx(47.11e3, abs=10.0)
    assert np.linalg.norm(found.foot[:3]) == pytest.approx(26.6e3, abs=50.0)
    assert -found.top[2] == pytest.approx(45.71e3, abs=10.0)
    assert found.top[0] == pytest.approx(11.40e3, abs=10.0)


# Low and Langley (2006), dynamic case 1: top tension [kN] every 1.5 s of the period from 40.5 s on, read from the published curve
CASE_1 = [47.02, 46.68, 46.31, 46.64, 47.7, 49.63, 51.24, 52.21, 51.92, 50.02, 47.38, 44.35, 42.1, 41.58, 42.19, 43.35, 44.99, 46.51, 47.02]


def test_low_and_langley_jumper_under_top_motion():
    """Dynamic case 1: top x = 10 sin(2 pi t / 27) m, here with a ramp of 10 s; published tension history to 1 kN."""
    pipe, _, start = started(jumper(nodes=31))

    def motion(t):
        ramp = 0.5 * (1 - math.cos(math.pi * t / 10)) if t < 10 else 1.0
        return np.array([10 * math.sin(2 * math.pi * t / 27) * ramp, 0.0, 0.0]), 0.0

    states, results = march(pipe, start, motion, 0.15, 455)
    middle = np.array([state.time for state in states[1:]]) - 0.075
    tension = np.interp(np.arange(40.5, 67.6, 1.5), middle, top_forces(results))
    np.testing.assert_allclose(tension, CASE_1, atol=0.6)


def test_still_water_and_no_drag_for_minutes_do_not_drift_in_energy():
    """A free swing without any dissipation: the energy a kick leaves is there after 1000 steps, to 1e-9 of the kick's work."""
    section = Section(drag_normal=0.0, drag_tangential=0.0, rotational_damping=(0.0, 0.0, 0.0))
    pipe, _, start = started(PipeParameters(section=section, nodes=16, top="pinned", top_quaternion=HANGING))
    states, _ = march(pipe, start, lambda t: (np.array([0.5 * min(t, 2.0), 0.5 * min(t, 2.0), 0.0]), 0.0), 0.2, 1010)
    total = [sum(pipe.energies(state)) for state in states[10:]]
    kick = abs(states[10].top_work)
    assert max(total) - min(total) < 1e-9 * kick + 1e-14 * 1010 * abs(total[0])
    assert pipe.energies(states[-1])[0] > 1e-3 * kick  # still swinging


@pytest.mark.parametrize("coefficient", [0.0, 1.0])
def test_added_mass_of_zero_is_none_and_of_one_slows_the_line(coefficient):
    without, _, start = started(heave_case(nodes=16))
    water, _, again = started(heave_case(nodes=16, added_mass=AddedMass(coefficient)))
    plain = march(without, start, heave(2.0, 12.0), 0.1, 50)[0][-1]
    wet = march(water, again, heave(2.0, 12.0), 0.1, 50)[0][-1]
    same = np.allclose(plain.position, wet.position, atol=1e-9)
    assert same == (coefficient == 0.0)


def test_added_mass_is_that_of_the_displaced_water_across_and_nothing_along():
    """Kinetic energy of a line translating as a whole: m (v.v) / 2 + C_A rho A_e v_n^2 / 2 per length."""
    parameters = heave_case(nodes=16, added_mass=AddedMass(0.7))
    pipe, _, state = started(parameters)
    v = np.array([0.4, 0.3, -0.2])
    t1 = np.array([rotation(q)[:, 0] for q in state.quaternion])
    moving = state._replace(
        velocity=np.tile(v, (16, 1)),
        added_mass_velocity=np.array([rotation(q).T @ v for q in state.quaternion]),
    )
    lengths = np.diff(pipe.s)
    share = 0.5 * (np.append(lengths, 0.0) + np.append(0.0, lengths))
    section = parameters.section
    across = v @ v - (t1 @ v) ** 2
    expected = 0.5 * share @ (section.mass_per_length * (v @ v) + 0.7 * 1025.0 * section.outer_area * across)
    assert pipe.energies(moving)[0] == pytest.approx(expected, rel=1e-12)


def test_ten_turns_of_the_top_twist_the_line_by_ten_turns():
    """No rotation is lost past 180 degrees (an element takes less): torque GJ 20 pi / L everywhere, the top back in its attitude."""
    pipe, _, start = started(PipeParameters(top_position=TANGENT, top_quaternion=TANGENT_ATTITUDE, internal_damping=0.05))
    axis = rotation(TANGENT_ATTITUDE)[:, 0]
    state = start
    for k in range(250):
        rate = 20 * math.pi * max(math.cos(math.pi * k / 200) - math.cos(math.pi * (k + 1) / 200), 0.0) / 2 / 0.2
        result = pipe.step(state, np.zeros(3), rate * axis if k < 200 else np.zeros(3), 0.2)
        assert result.converged
        state = result.state
    torque = pipe.section_forces(state).moment[:, 0]
    np.testing.assert_allclose(torque, PipeParameters().section.stiffness[2] * 20 * math.pi / 1200, rtol=1e-3)
    np.testing.assert_allclose(rotation(state.quaternion[-1]), rotation(TANGENT_ATTITUDE), atol=1e-12)
