"""Sub-steps for hosts that cannot roll back: where one step fails the parts arrive, and what they return is conjugate to what was held."""

import pickle
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from pipe_helpers import balance, heave_case, rotation, started

from master.fmi.build import Recipe, build_fmu
from master.fmi.schema import to_mapping
from master.studies.hard_cases import cases
from pipe_fmu import PipeParameters, PipeUnit, substeps
from pipe_fmu import __file__ as source
from pipe_fmu.step.integrator import STIFF, StepResult

HARD = (("top moved 50 m in a second", 1.0, 20, 81), ("bed with friction, violent", 2.0, 12, 27))  # name, step s, steps, max_substeps
WARNING, DISCARD = 1, 2  # fmi2Status
SPIN = np.array([0.01, -0.02, 0.03])


def hard(name):
    return next(case for case in cases() if case.name == name)


def flows(case, h, count):
    """Mean velocities (count, 3) of the top over the steps."""
    return np.diff([case.motion(k * h)[0] for k in range(count + 1)], axis=0) / h


def begun(parameters):
    unit = PipeUnit(parameters)
    assert unit.initialize(0.0, {}) is None
    return unit


def held(velocity, spin=(0.0, 0.0, 0.0)):
    return {"velocity": np.array(velocity), "angular_velocity": np.array(spin), "mobility": np.zeros(36)}


def divided(pipe, state, velocity, spin, h, most, longest=np.inf):
    """A step of h [s] of which no part longer than `longest` is tried: its result, the number of parts and the shortest."""
    *result, parts, shortest = substeps.divide(pipe.line, pipe.sea, state, np.array(velocity), spin, h, STIFF, most, longest)
    return StepResult(*result), parts, shortest


@pytest.mark.parametrize(("name", "h", "count", "most"), HARD)
def test_where_a_step_fails_its_parts_arrive_with_the_energy_identity_kept_over_the_whole(name, h, count, most):
    case = hard(name)
    whole, parts = begun(case.pipe), begun(replace(case.pipe, max_substeps=most))
    refused, remarks = None, []
    for k, velocity in enumerate(flows(case, h, count)):
        old = parts.now.pipe
        assert parts.step(k * h, h, held(velocity)) is None
        new, pull = parts.now.pipe, parts.output("force")
        created, allowed = balance(parts._pipe, old, new)
        assert abs(created) <= allowed, f"step at {k * h} s: {parts.remark}"
        work = h * float(-pull @ velocity)
        assert new.top_work - old.top_work == pytest.approx(work, rel=1e-11, abs=1e-14 * abs(new.top_work) + 1e-9)
        np.testing.assert_allclose(new.position[-1], old.position[-1] + h * velocity, atol=1e-12 * np.abs(new.position).max())
        remarks.append(parts.remark)
        if refused is None:  # both are still in the same state
            refused = whole.step(k * h, h, held(velocity))
            assert ("sub-steps" in parts.remark) == (refused is not None)
    assert "no convergence after" in refused
    assert "sub-steps" not in refused
    told = [line for remark in remarks for line in remark.splitlines() if "sub-steps of" in line]
    assert 1 < len(told) < count  # and the other steps are done in one
    assert all("done in" in line and "corrections" in line for line in told)


def test_a_step_that_fails_in_parts_too_says_so_and_leaves_the_state_alone():
    unit = begun(heave_case(nodes=12, max_substeps=3))
    assert unit.step(0.0, 0.1, held([0.1, 0.0, 0.2])) is None
    before = unit.state
    message = unit.step(0.1, 9.0, held([0.0, 0.0, 400.0]))  # far beyond its length
    assert message is not None
    assert "\n" not in message
    assert "step of 9 s at t = 0.1 s: no convergence after" in message
    assert "nor in sub-steps of 3 s" in message
    assert unit.state is before


def test_partial_success_leaves_nothing_behind():
    """Parts that were done before one failed are gone: the state is as it was, bit for bit."""
    pipe, _, start = started(heave_case(nodes=12))
    kept = [np.array(part, copy=True) for part in start]
    result, parts, _ = divided(pipe, start, [0.0, 0.0, -80.0], np.zeros(3), 1.0, 27)  # the line is taut after some of the parts
    assert not result.converged
    assert parts > 0
    assert all(np.array_equal(a, b) for a, b in zip(kept, result.state, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(kept, start, strict=True))


@pytest.mark.parametrize("longest", [0.2, 0.1])
def test_the_parts_end_in_the_pose_of_one_step_and_their_mean_wrench_does_their_work(longest):
    """Held angular velocity: exp(h w) of the start, however divided; h (F.v + M.w) is the sum of the works to round-off."""
    pipe, _, start = started(heave_case(nodes=12, top="clamped"))
    v, h = np.array([0.3, -0.2, 0.5]), 0.6
    result, parts, shortest = divided(pipe, start, v, SPIN, h, 81, longest + 1e-9)
    one = pipe.step(start, v, SPIN, h)
    assert result.converged
    assert parts == {0.2: 3, 0.1: 9}[longest]
    assert shortest == pytest.approx(h / parts, rel=1e-15)
    assert result.state.time == start.time + h
    np.testing.assert_allclose(result.state.position[-1], one.state.position[-1], rtol=1e-15)
    np.testing.assert_allclose(rotation(result.state.quaternion[-1]), rotation(one.state.quaternion[-1]), atol=1e-15)
    assert h * float(result.top @ [*v, *SPIN]) == pytest.approx(result.state.top_work, rel=1e-13)
    created, allowed = balance(pipe, start, result.state)
    assert abs(created) <= allowed
    assert result.state.works[0] > 0.0


@pytest.mark.parametrize(("longest", "count"), [(0.2, 3), (0.1, 9)])
def test_the_inertia_of_the_top_is_in_the_mean_force_as_in_one_step(longest, count):
    """A top of 1e9 kg: mean force = mass x change of its velocity / h (the line's pull is 1e-3 of it); velocity 2 v - v_old, spins too."""
    pipe, _, state = started(heave_case(nodes=12, top="clamped"))
    mass, inertia = 1e9, 1e9
    pipe.line = pipe.line._replace(
        mass=np.append(pipe.line.mass[:-1], mass), inertia=np.vstack([pipe.line.inertia[:-1], 3 * [inertia]]), offset=0.0 * pipe.line.offset
    )
    h = 0.6
    for v, w in (([0.3, -0.2, 0.5], SPIN), ([0.1, 0.4, 0.2], -SPIN)):
        result, parts, _ = divided(pipe, state, v, w, h, 81, longest + 1e-9)
        new = result.state
        assert parts == count
        np.testing.assert_allclose(new.velocity[-1], 2 * np.array(v) - state.velocity[-1], atol=1e-13)
        np.testing.assert_allclose(new.rate[-1], 2 * rotation(state.quaternion[-1]).T @ w - state.rate[-1], atol=1e-13)
        push = mass * (new.velocity[-1] - state.velocity[-1]) / h
        np.testing.assert_allclose(result.top[:3], push, atol=5e-3 * np.linalg.norm(push))
        spins = [inertia * rotation(at.quaternion[-1]) @ at.rate[-1] for at in (state, new)]
        np.testing.assert_allclose(result.top[3:], (spins[1] - spins[0]) / h, atol=5e-3 * np.linalg.norm(spins[1]) / h)
        state = new


def test_the_impedance_after_a_divided_step_is_that_of_its_last_part_and_resists():
    pipe, _, start = started(heave_case(nodes=12, top="clamped"))
    v = np.array([0.2, 0.1, -0.3])
    result, parts, length = divided(pipe, start, v, SPIN, 0.3, 27, 0.11)
    state = start
    for _ in range(parts):
        last = pipe.step(state, v, SPIN, length)
        state = last.state
    assert parts == 3
    np.testing.assert_array_equal(result.impedance, last.impedance)
    assert np.linalg.eigvalsh(result.impedance + result.impedance.T)[0] > -1e-6 * np.abs(result.impedance).max()


def test_the_state_after_a_divided_step_travels_as_bytes_and_continues_bit_for_bit():
    name, h, count, most = HARD[0]
    case = hard(name)
    one, other = (begun(replace(case.pipe, max_substeps=most)) for _ in range(2))
    velocity = flows(case, h, count)
    for k in range(3):
        assert one.step(k * h, h, held(velocity[k])) is None
    assert "sub-steps" in one.remark
    other.state = pickle.loads(pickle.dumps(one.state, protocol=5))
    for _ in range(2):
        for port in one.outputs(case.pipe):
            np.testing.assert_array_equal(one.output(port), other.output(port), err_msg=port)
        assert one.step(3 * h, h, held(velocity[3])) is None
        assert other.step(3 * h, h, held(velocity[3])) is None


def test_without_sub_steps_the_unit_hands_on_the_one_step_bit_for_bit():
    unit = begun(heave_case(nodes=12))
    start = unit.now.pipe
    assert unit.step(0.0, 0.2, held([0.1, 0.0, 0.2])) is None
    result = unit._pipe.step(start, np.array([0.1, 0.0, 0.2]), np.zeros(3), 0.2)
    assert all(np.array_equal(a, b) for a, b in zip(unit.now.pipe, result.state, strict=True))
    assert np.array_equal(unit.now.top, result.top)
    assert unit.remark == ""


@pytest.mark.parametrize("value", [0, 2, 6, 2187, 1.5])
def test_the_number_of_parts_is_a_power_of_three(value):
    with pytest.raises(ValueError, match=f"max_substeps = {value}: must be "):
        PipeParameters(max_substeps=value)


def simulated(path, case, h, count, **start):
    """What FMPy's own fixed-step loop makes of the FMU under a case's motion in `count` calls of its step, and what the FMU logs."""
    log, calls = [], []
    names = [f"velocity[{i}]" for i in (1, 2, 3)]
    kinds = [(name, float) for name in ("time", *names)]
    signal = np.array([(k * h, *v) for k, v in enumerate(flows(case, h, count + 1))], dtype=kinds)
    rows = fmpy.simulate_fmu(
        str(path),
        stop_time=count * h,
        output_interval=h,
        input=signal,
        output=[f"{name}[{i}]" for name in ("force", "top_position") for i in (1, 2, 3)] + ["top_work"],
        start_values=start,
        debug_logging=True,
        logger=lambda *told: log.append((told[2], told[4].decode())),
        step_finished=lambda time, _: calls.append(time) or len(calls) < count,
    )
    return rows, log


def test_a_plain_fixed_step_host_gets_on_with_sub_steps_and_not_without(tmp_path):
    """FMPy's loop asks for a discarded step again, and again in vain; with sub-steps it arrives, each division a warning."""
    name, h, count, most = HARD[0]
    case = hard(name)
    path = build_fmu(Recipe(Path(source).parent, "slave.PipeUnit", to_mapping(case.pipe)), tmp_path / "pipe.fmu")
    rows, log = simulated(path, case, h, 4)
    stands = rows["time"][-1]
    assert stands < 4 * h
    again = f"step of {h:g} s at t = {stands:g} s: no convergence after"
    assert sum(status == DISCARD and again in line for status, line in log) == 4 - round(stands / h)
    rows, log = simulated(path, case, h, count, max_substeps=most)
    np.testing.assert_allclose(rows["time"], h * np.arange(count + 1))
    told = [line for status, line in log if status == WARNING and "done in" in line and "sub-steps of" in line]
    assert 1 < len(told) < count
    velocity = flows(case, h, count)
    work = np.cumsum([-h * sum(row[f"force[{i + 1}]"] * v[i] for i in range(3)) for row, v in zip(rows[1:], velocity, strict=True)])
    np.testing.assert_allclose(rows["top_work"][1:], work, rtol=1e-10)
    moved = [rows[f"top_position[{i}]"][-1] - rows[f"top_position[{i}]"][0] for i in (1, 2, 3)]
    np.testing.assert_allclose(moved, case.motion(count * h)[0], atol=1e-9)
