"""Statics of whole scenes: turned about the vertical, on fine meshes, without [simulation], and the frame of loads on the hull."""

import json
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from master.__main__ import main
from master.errors import RunError, UsageError
from master.run.pipe_drive import open_drive
from master.run.prepared import prepare
from master.scene import reading
from master.scene.reading import from_mapping
from master.with_units.monolithic import march
from master.with_units.statics import equilibrium, released
from master.with_units.statics_report import report
from vessel_fmu.vessel import Vessel

STEEL = {"outer_diameter": 0.4064, "wall_thickness": 0.025}
ALONE = {
    "environment": {"depth": 810.0},
    "pipe": {"length": 1200.0, "foot": "pinned", "top": "clamped", "section": STEEL},
    "start": {"x": 805.0, "z": -800.0, "departure": 1.0},
}
FLOATING = {
    "environment": {"depth": 800.0, "current": {"velocity": [0.4, 0.7, 0.0]}},
    "pipe": {"length": 1200.0, "foot": "pinned", "seabed": {}, "section": STEEL},
    "vessel": {"hang_off": [-40.0, 5.0, 5.0]},
    "start": {"x": 780.0},
}
DEPARTING = FLOATING | {"start": {"x": 780.0, "departure": 1.1}}
HALF_A_TURN = FLOATING | {  # from how the line hangs, one way or the other: all else lies in a plane
    "environment": {"depth": 800.0}, "vessel": {"hang_off": [-40.0, 0.0, 5.0]}, "start": {"x": 780.0, "yaw": math.pi, "departure": 2.0},
}  # fmt: skip
BACKWARDS = ALONE | {"start": {"x": 780.0, "z": -800.0, "yaw": math.pi, "departure": 1.1}}
TURNED_TOP = ALONE | {"environment": FLOATING["environment"], "pipe": ALONE["pipe"] | {"seabed": {}}}


def turned(mapping, angle):
    """The scene turned about the vertical through the foot."""
    cosine, sine = math.cos(angle), math.sin(angle)

    def around(x, y):
        return cosine * x - sine * y, sine * x + cosine * y

    start, environment = mapping["start"], dict(mapping["environment"])
    x, y = around(start["x"], start.get("y", 0.0))
    if "current" in environment:
        environment["current"] = {"velocity": [*around(*environment["current"]["velocity"][:2]), 0.0]}
    yaw = start.get("yaw", 0.0) + angle
    return mapping | {"environment": environment, "start": start | {"x": x, "y": y, "yaw": math.remainder(yaw, 2.0 * math.pi)}}


@pytest.mark.parametrize("degrees", [37.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize(
    "mapping",
    [ALONE, TURNED_TOP, FLOATING, DEPARTING, HALF_A_TURN, BACKWARDS],
    ids=["alone", "current and bed", "vessel", "departure", "half a turn", "backwards"],
)
def test_a_scene_turned_about_the_vertical_has_the_same_tensions_and_moments(mapping, degrees):
    angle = math.radians(degrees)
    before, after = (report(from_mapping(one, "turned")) for one in (mapping, turned(mapping, angle)))
    for name in ("tension_N", "bending_moment_N_m", "shear_N"):
        assert_allclose(after[name], before[name], atol=1e-6 * np.abs(before[name]).max())
    turn = Rotation.from_euler("z", angle)
    for name in ("top_force_e_N", "top_moment_e_N_m", "foot_force_e_N"):
        assert_allclose(after[name], turn.apply(before[name]), atol=1e-6 * np.linalg.norm(before[name]))
    assert_allclose(after["position_e_m"], turn.apply(before["position_e_m"]), atol=1e-5)
    if after["hold_force_N"] is not None:
        held = np.array(before["hold_force_N"])
        expected = [*turn.apply([*held[:2], 0.0])[:2], held[2]]
        assert_allclose(after["hold_force_N"], expected, atol=1e-6 * np.linalg.norm(held[:2]))


@pytest.mark.parametrize("departure", [1.1, 2.0])
def test_a_top_turned_by_half_a_turn_is_led_out_of_the_plane_the_same_way_whatever_round_off_says(departure):
    """The least change of the heading decides between the two mirror images, each as good: here each is asked for by a hair."""
    start = HALF_A_TURN["start"] | {"departure": departure}
    scenes = [HALF_A_TURN | {"start": start | {"yaw": yaw}} for yaw in (math.pi, 3.14158, -3.14158)]
    exact, more, less = (report(from_mapping(one, "hair")) for one in scenes)
    mirror = np.array([-1.0, 1.0, -1.0])  # of a moment, in the plane of the line
    size = np.linalg.norm(more["top_moment_e_N_m"])
    assert_allclose(less["top_moment_e_N_m"], mirror * more["top_moment_e_N_m"], rtol=0.0, atol=1e-8 * size)
    images = (np.array(one["top_moment_e_N_m"]) - exact["top_moment_e_N_m"] for one in (more, less))
    assert min(np.linalg.norm(gap) for gap in images) < 1e-4 * size


def test_a_held_top_is_pitched_first_and_then_turned_to_its_heading():
    """R = R_z(yaw) R_y(departure), as under a vessel: t1 lies `departure` over the heading."""
    found = equilibrium(from_mapping(turned(ALONE, 2.0), "heading")).found
    top = Rotation.from_quat(np.roll(found.quaternion[-1], -1)).as_matrix()
    expected = [math.cos(2.0) * math.cos(1.0), math.sin(2.0) * math.cos(1.0), -math.sin(1.0)]
    assert_allclose(top[:, 0], expected, atol=1e-14)
    assert_allclose(top[:, 1], [-math.sin(2.0), math.cos(2.0), 0.0], atol=1e-14)


@pytest.mark.parametrize(
    ("nodes", "hang_off", "yaw"),
    [(400, [-40, 5, 5], 0.5), (400, [-40, 0, 0], 0.0), (400, [30, -8, 3], -2.0), (800, [-40, 5, 5], -2.0), (2000, [-40, 5, 5], 0.5)],
)
def test_a_vessel_on_a_fine_mesh_finds_the_equilibrium_of_a_coarse_one(nodes, hang_off, yaw):
    changes = [f"vessel.hang_off={hang_off}", f"start.yaw={yaw}"]
    fine, coarse = (equilibrium(reading.load("paper", [*changes, f"pipe.nodes={n}"])).vessel.start for n in (nodes, 100))
    assert_allclose(fine.position, coarse.position, atol=1e-3)
    assert_allclose(fine.attitude, coarse.attitude, atol=1e-5)


def test_a_vessel_that_cannot_be_balanced_is_refused(monkeypatch):
    """A lift that jumps by a millionth of the pull where it would balance it: 3e-7 of it are left, up or down."""
    loaded, load = reading.load("paper", ["pipe.nodes=400", "vessel.hang_off=[-40, 5, 5]"]), Vessel.static_load
    height = equilibrium(loaded).vessel.start.position[2]

    def unbalanced(vessel, position, *arguments):
        force, moment = load(vessel, position, *arguments)
        return force - np.array([0.0, 0.0, math.copysign(0.3, position[2] - height)]), moment

    monkeypatch.setattr(Vessel, "static_load", unbalanced)
    with pytest.raises(RunError, match="the vessel finds no equilibrium in heave, roll and pitch"):
        equilibrium(loaded)


@pytest.fixture
def alone(tmp_path):
    lines = ["[environment]", "depth = 810.0", "[pipe]", "length = 1200.0", 'foot = "pinned"', "[pipe.section]"]
    lines += ["outer_diameter = 0.4064", "wall_thickness = 0.025", "[start]", "x = 805.0", "z = -800.0"]
    path = tmp_path / "alone.toml"
    path.write_text("\n".join(lines))
    return str(path)


def test_statics_of_a_pipe_alone_need_neither_a_motion_nor_a_simulation(alone, capsys):
    assert main(["statics", alone, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["top_force_e_N"][0] == pytest.approx(-found["foot_force_e_N"][0], rel=1e-8)


@pytest.mark.parametrize("command", [["run"], ["export", "--scene"]])
def test_a_scene_without_a_simulation_is_not_run_and_says_in_one_line_what_to_give(alone, tmp_path, capsys, command):
    out = tmp_path / "out"
    assert main([*command, alone, "-o", str(out)]) == 2
    assert capsys.readouterr().err == "pipelay: simulation: must be given, with duration and macro_step, to run or export a scene\n"
    assert not out.exists()


def test_a_pipe_alone_without_a_motion_is_held_at_its_top(alone):
    """At rest in still water; pushed by a current that comes later, with no work at the top."""
    for changes, moves in (([], False), (["environment.current={velocity=[0, 0.8, 0], start=0.5}"], True)):
        loaded = reading.load(alone, ["simulation={duration=3, macro_step=0.1}", *changes])
        with open_drive(loaded.sections, prepare(loaded)) as drive:
            pipe = drive.units["pipe"]
            top, nodes = pipe.get("top_position"), pipe.get("node_position")
            while drive.time < 3.0:
                drive.advance(3.0)
            moved = np.abs(pipe.get("node_position") - nodes).max()
            assert moved > 1e-2 if moves else moved < 1e-8
            assert np.array_equal(pipe.get("top_position"), top)
            assert drive.scheme == "the top is held"
            assert not drive.ledger.complaint


def test_a_load_in_the_axes_of_the_hull_turns_with_it_and_keeps_the_energy():
    """[tables] frame = "b": both FMUs as both models in one, the ledger closed, and along the hull what frame "e" does at no heading."""
    rows = "[{time=0}, {time=1, force=[0, 3e5, 0], moment=[0, 2e7, 1e7]}]"
    changes = ["pipe.nodes=12", "simulation.duration=4", "simulation.recording_step=9", "simulation.snapshots=[]"]
    ends = {}
    for frame, yaw in (("b", 0.0), ("e", 0.0), ("b", 1.5)):
        loaded = reading.load("free-decay", [*changes, f"tables={{environment={rows}, frame='{frame}'}}", f"start.yaw={yaw}"])
        with open_drive(loaded.sections, prepare(loaded)) as drive:
            while drive.time < 4.0:
                drive.advance(4.0)
            ends[frame, yaw] = drive.units["vessel"].get("body_velocity")
            assert drive.ledger.largest_closure <= 1e-8 * drive.ledger.exchanged
        *_, last = march(loaded)[2]
        assert_allclose(ends[frame, yaw], last.vessel.body_velocity, atol=1e-8)
    assert_allclose(ends["b", 0.0], ends["e", 0.0], atol=2e-3)
    assert ends["b", 1.5][1] > 0.9 * ends["b", 0.0][1] > 0.0
    with pytest.raises(UsageError, match="must be one of"):
        reading.load("free-decay", [f"tables={{environment={rows}, frame='n'}}"])


def test_a_released_vessel_starts_by_so_much_deeper_rolled_and_pitched_and_the_pipe_hangs_from_there():
    moved = {"heave": 1.5, "roll": 0.04, "pitch": 0.1}
    free = from_mapping(FLOATING | {"start": {"x": 780.0, "yaw": 0.3, "release": moved}}, "released")
    at = equilibrium(free)
    found = released(free, at)
    assert_allclose(found.vessel.start.position, np.add(at.vessel.start.position, (0.0, 0.0, 1.5)), atol=1e-12)
    assert_allclose(found.vessel.start.attitude, np.add(at.vessel.start.attitude, (0.04, 0.1, 0.0)), atol=1e-12)
    roll, pitch, yaw = found.vessel.start.attitude
    lever = Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply([-40.0, 5.0, 5.0])
    assert_allclose(found.found.position[-1], found.vessel.start.position + lever, atol=1e-9)
