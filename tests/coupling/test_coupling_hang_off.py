"""Pipe and vessel FMUs on the bond: finite rotations, order in the macro step, and the same answer as both solved as one."""

import numpy as np
import pytest

from master.run.pipe_drive import open_drive, pose_gap
from master.run.prepared import prepare
from master.scene import reading
from master.with_units.monolithic import march

SMALL = ["pipe.nodes=12", "simulation.recording_step=100", "simulation.snapshots=[]"]
MOVED = ["environment.current.start=0", "environment.current.ramp=2", "vessel.controller.start=300", "vessel.hang_off=[-20.0, 3.0, 2.0]"]


def moving(name, changes, step, duration):
    return reading.load(name, [*SMALL, *changes, f"simulation.macro_step={step}", f"simulation.duration={duration}"])


def test_two_turns_of_yaw_and_a_roll_of_sixty_degrees_leave_no_gap_and_a_closed_ledger():
    """A pinned pipe held 20 m off the centre; the vessel is thrown into a spin by a moment in roll and yaw, then let go.

    The hull rights itself with at most m_V g GM_T / 2 = 67 MN m, at 45 degrees. 150 MN m in roll, for a moment, heel it beyond 60 degrees;
    one that tumbles for long bends an element of these 12 past half a turn, which ends the run.
    """
    push = (
        "tables.environment=[{time=0, moment=[0,0,0]}, {time=2, moment=[1.5e8,0,3.75e9]}, {time=8, moment=[0,0,3.75e9]}, "
        "{time=30, moment=[0,0,3.75e9]}, {time=31}]"
    )
    changes = ['pipe.top="pinned"', "vessel.hang_off=[-20.0, 3.0, 2.0]", push, "start.release={}", 'coupling.on_violation="stop"']
    loaded = moving("free-decay", changes, 0.1, 40.0)
    with open_drive(loaded.sections, prepare(loaded)) as drive:
        gap, turned, heeled, before = 0.0, 0.0, 0.0, 0.0
        vessel = drive.units["vessel"]
        while drive.time < 40.0:
            drive.advance(40.0)
            roll, yaw = vessel.get(("roll", "yaw"))
            turned += (yaw - before + np.pi) % (2 * np.pi) - np.pi
            before, heeled = yaw, max(heeled, abs(roll))
            gap = max(gap, pose_gap(drive.units["pipe"], vessel, False)["pose_gap", "m"])
        assert abs(turned) >= 4.0 * np.pi
        assert heeled >= np.radians(60.0)
        assert gap <= 1e-9
        assert drive.ledger.largest_closure <= 1e-8 * drive.ledger.exchanged
        assert drive.ledger.interface_residual <= 1e-8 * drive.ledger.exchanged


def final(step, duration=2.0, changes=()):
    loaded = moving("paper", [*MOVED, *changes], step, duration)
    with open_drive(loaded.sections, prepare(loaded)) as drive:
        pipe, vessel = drive.units["pipe"], drive.units["vessel"]
        start = pipe.get("node_position"), vessel.get("position")
        while drive.time < duration:
            drive.advance(duration)
        assert drive.cost.rejected_steps == 0
        found = {name: pipe.get(name) for name in ("node_position", "node_tension", "end_moment", "force", "moment")}
        found |= {name: vessel.get(name) for name in ("position", "velocity", "angular_velocity")}
        return found | {"node_displacement": found["node_position"] - start[0], "displacement": found["position"] - start[1]}


def test_displacements_tension_and_top_moment_are_second_order_in_the_macro_step_down_to_a_millionth():
    """Against the limit that the two finest steps leave when their h^2 is taken off; displacements are those since the start."""
    runs = [final(0.1 / 2**k) for k in range(3, 8)]
    for name in ("node_displacement", "displacement", "node_tension", "end_moment"):
        values = [run[name] for run in runs]
        exact = values[-1] + (values[-1] - values[-2]) / 3.0
        errors = np.array([np.abs(value - exact).max() for value in values[:-1]]) / np.abs(exact).max()
        orders = np.log2(errors[:-1] / errors[1:])[errors[1:] > 1e-8]  # Newton's tolerance shows below that
        assert (np.abs(orders - 2.0) < 0.15).all(), (name, errors, orders)
        assert errors[-1] <= 1e-6, (name, errors)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-13, 1e-15])  # the last two are below what the FMUs' own tolerances allow
@pytest.mark.parametrize("step", [0.05, 0.5])
def test_with_matched_steps_the_fmus_are_pipe_and_vessel_solved_as_one(step, tolerance):
    found = final(step, 4.0, [f"coupling.tolerance={tolerance}"])
    loaded = moving("paper", MOVED, step, 4.0)
    *_, last = march(loaded)[2]
    np.testing.assert_allclose(found["node_position"].reshape(-1, 3), last.pipe.position, rtol=0.0, atol=1e-9 * 1200.0)
    np.testing.assert_allclose(found["position"][:2], last.vessel.position[:2], rtol=1e-9, atol=1e-9)
    means = {"force": -last.force[:3], "moment": -last.force[3:], "velocity": last.velocity[:3], "angular_velocity": last.velocity[3:]}
    for name, mean in means.items():
        np.testing.assert_allclose(found[name], mean, rtol=0.0, atol=1e-9 * np.linalg.norm(mean))


def test_a_load_from_a_table_moves_both_alike():
    push = ["tables.environment=[{time=0}, {time=1.3, force=[2e5, 1e5, 0], moment=[0, 0, 1e6]}, {time=3, force=[0, 3e5, 0]}]"]
    found, (*_, last) = final(0.5, 4.0, push), march(moving("paper", [*MOVED, *push], 0.5, 4.0))[2]
    still = final(0.5, 4.0)
    np.testing.assert_allclose(found["node_position"].reshape(-1, 3), last.pipe.position, rtol=0.0, atol=1e-9 * 1200.0)
    np.testing.assert_allclose(found["position"][:2], last.vessel.position[:2], rtol=1e-9, atol=1e-9)
    assert np.abs(found["position"] - still["position"]).max() > 1e-3
