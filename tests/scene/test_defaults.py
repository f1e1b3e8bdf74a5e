"""What a scene does that says no more than it must: motion fades in, steel damps, the controller keeps the vessel where it starts."""

import math
import tomllib

import numpy as np
import pytest

from master.__main__ import main
from master.errors import UsageError
from master.run.pipe_drive import top_tension
from master.scene import keys, physics
from master.scene.reading import BUILT_IN, DEFAULTS, from_mapping, load
from master.scene.remarks import CONTROLLER
from master.scene.sections import Simulation, TopMotion
from master.with_units.statics import equilibrium
from pipe_fmu.slave import PipeUnit
from vessel_fmu.parameters import Controller
from vessel_fmu.vessel import Inputs, Vessel

HEAVING = {
    "environment": {"depth": 800.0},
    "pipe": {"length": 1000.0, "top": "pinned", "section": {"outer_diameter": 0.32385, "wall_thickness": 0.0206}},
    "start": {"x": 500.0, "z": -800.0},
    "top_motion": {"amplitude": [0.0, 0.0, 2.0], "period": 9.0},
}
FLOATING = {
    "environment": {"depth": 800.0},
    "pipe": {"length": 1000.0, "section": HEAVING["pipe"]["section"]},
    "vessel": {"hang_off": [-30.0, 2.0, 3.0], "controller": {"start": 0.0}},
    "start": {"x": 500.0, "yaw": 0.5},
}


class Read:
    """The ports of a unit, as a drive reads them."""

    def __init__(self, unit):
        self.unit = unit

    def get(self, names):
        return np.concatenate([self.unit.output(name) for name in names])


def heaved(end, motion=(), pipe=()):
    """Smallest and largest top tension [N] of the heaving line, and all that its unit remarks."""
    mapping = HEAVING | {"top_motion": HEAVING["top_motion"] | dict(motion), "pipe": HEAVING["pipe"] | dict(pipe)}
    scene = from_mapping(mapping, "heaving")
    unit = PipeUnit(equilibrium(scene).pipe)
    assert unit.initialize(0.0, {}) is None
    still = {"angular_velocity": np.zeros(3), "mobility": np.zeros(36)}
    tensions, remarks = [], unit.remark.splitlines()
    for k in range(round(end / 0.1)):
        assert unit.step(0.1 * k, 0.1, still | {"velocity": scene.sections.top_motion.mean_velocity(0.1 * k, 0.1)}) is None
        tensions += top_tension(Read(unit)).values()
        remarks += unit.remark.splitlines()
    return min(tensions), max(tensions), remarks


def test_a_heaving_line_starts_without_a_blow():
    """Published in the issue from a ramp of three periods, and from damping alone: 526 to 885 kN, against -1404 to 2181 kN of a sine
    that starts at once in an undamped line, where the axial wave of the jump, v sqrt(EA m), comes on top."""
    least, most, remarks = heaved(45.0)
    assert least == pytest.approx(526e3, rel=5e-3)
    assert most == pytest.approx(885e3, rel=5e-3)
    assert not remarks
    least, _, remarks = heaved(9.0, {"ramp": 0.0}, {"internal_damping": 0.0})
    assert least < -1e6
    assert remarks[0].startswith("the line is in compression at S = ")


def test_a_motion_fades_in_over_two_periods_unless_the_scene_says_otherwise():
    motion = TopMotion(amplitude=(0.0, 0.0, 2.0), period=9.0)
    assert motion.fade_in == 18.0
    assert TopMotion(amplitude=(0.0, 0.0, 2.0), period=9.0, ramp=0.0).fade_in == 0.0
    assert np.abs(motion.mean_velocity(0.0, 0.1)).max() < 1e-3 * motion.speed
    assert motion.speed == pytest.approx(2.0 * 2.0 * math.pi / 9.0)


def test_steel_damps_where_a_scene_names_no_damping():
    """Kelvin-Voigt damping of time tau has the ratio pi tau / T at a period T: 0.5 % at 3.14 s."""
    assert math.pi * DEFAULTS["pipe.internal_damping"] / 3.14 == pytest.approx(0.005, rel=1e-3)
    assert equilibrium(from_mapping(HEAVING, "steel")).pipe.internal_damping == DEFAULTS["pipe.internal_damping"]
    undamped = HEAVING | {"pipe": HEAVING["pipe"] | {"internal_damping": 0.0}}
    assert equilibrium(from_mapping(undamped, "none")).pipe.internal_damping == 0.0
    for name in ("paper", "free-decay", "heave"):  # compared with what has none
        assert tomllib.loads((BUILT_IN / f"{name}.toml").read_text())["pipe"]["internal_damping"] == 0.0


def test_the_controller_keeps_the_vessel_where_it_starts():
    at = equilibrium(from_mapping(FLOATING, "kept"))
    named, start = at.vessel.controller, at.vessel.start
    assert (named.x, named.y, named.yaw) == (*start.position[:2], 0.5)
    vessel = Vessel(at.vessel)
    state = vessel.start()
    for k in range(200):
        state = vessel.step(state, 0.5 * k, 0.5, Inputs(force=-at.found.top[:3], moment=-at.found.top[3:])).state
    assert np.abs(vessel.position(state) - start.position).max() < 1e-3
    away = FLOATING | {"vessel": FLOATING["vessel"] | {"controller": {"x": 530.0}}}
    assert equilibrium(from_mapping(away, "away")).vessel.controller.x == 530.0


def test_shapes_are_recorded_twice_a_second_and_not_without_end():
    assert Simulation(duration=300.0, macro_step=0.1).recorded_every == 0.5
    assert Simulation(duration=10800.0, macro_step=0.1).recorded_every == 5.4
    assert Simulation(duration=300.0, macro_step=0.1, recording_step=2.0).recorded_every == 2.0


REFUSED = {
    "attitude of a pinned top": ("heave", ["start.departure=1.0"], "start.departure = 1: must be absent with pipe.top = 'pinned'"),
    "of a vessel too": ("paper", ['pipe.top="pinned"', "start.departure=1.0"], "start.departure = 1: must be absent with pipe.top"),
    "heading of nothing": ("heave", ["start.yaw=0.3"], "start.yaw = 0.3: must be absent without [vessel] or start.departure"),
    "tolerance of no iteration": ("paper", ['coupling={scheme="serial", tolerance=1e-6}'], "coupling.tolerance = 1e-06: must be 1e-09 or"),
    "rollback of no iteration": ("paper", ['coupling={scheme="parallel", rollback=false}'], "coupling.rollback = false: must be true or"),
    "degrees of heading": ("paper", ["vessel.controller.yaw=45"], "vessel.controller.yaw = 45: must be <= 3.14"),
}


@pytest.mark.parametrize(("name", "changes", "message"), REFUSED.values(), ids=REFUSED)
def test_a_key_that_contradicts_its_scene_is_refused(name, changes, message):
    with pytest.raises(UsageError) as caught:
        equilibrium(load(name, changes))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_remarks_know_the_defaults_of_the_controller():
    assert {key: getattr(Controller(), key) for key in CONTROLLER} == CONTROLLER


@pytest.fixture(scope="module")
def listed():
    """Rows (default, meaning) of `pipelay keys` by name."""
    rows = [line.split("  ", 1) for line in keys.listing().splitlines()]
    cells = [(name, [cell for cell in rest.split("  ") if cell.strip()]) for name, rest in rows]
    return {name.strip(): (rest[0].strip(), rest[-1].strip()) for name, rest in cells}


SWITCHES = ("environment.current", "start.release", "pipe.added_mass", "pipe.seabed", "vessel", "vessel.controller", "top_motion", "tables")


def test_keys_marks_what_acts_only_where_its_table_stands(listed):
    assert {name for name, (default, _) in listed.items() if default == keys.SWITCH} == set(SWITCHES)
    for name, (default, meaning) in listed.items():
        if name in SWITCHES:
            assert f"acts only where the table [{name}] stands" in meaning
            continue
        switched = name.startswith(tuple(f"{switch}." for switch in SWITCHES))
        assert default.split()[0] == "-" or default.startswith("(") == switched, name
    assert listed["pipe.internal_damping"][0] == "0.005 s"


def test_keys_says_of_every_vector_in_which_frame_it_is(listed):
    vectors = [name for name, (default, _) in listed.items() if default.strip("(").startswith("[") and default.count(",") >= 2]
    vectors += ["top_motion.amplitude", "pipe.section.rotational_inertia"]
    assert len(vectors) >= 7
    for name in vectors:
        meaning = listed[name][1]
        assert any(f"in {frame}" in meaning for frame in ("e", "b", "t", "frame t", "the section's frame t")), f"{name}: {meaning}"


PHYSICS = {  # a name in the line, and the output that the pipe has with it
    "seabed": "contact_energy",
    "internal damping (0.02 s)": "internal_dissipation",
    "numerical damping (0.1)": "numerical_dissipation",
}


def test_the_line_on_physics_names_what_the_units_have(capsys):
    changes = ["pipe.seabed={}", "pipe.internal_damping=0.02", "pipe.numerical_damping=0.1"]
    for count in range(len(changes) + 1):
        scene = load("heave", [*changes[:count], "pipe.nodes=6"])
        on, _, off = physics.acting(scene).partition("; without ")
        ports = PipeUnit.outputs(equilibrium(scene).pipe)
        for (name, port), given in zip(PHYSICS.items(), range(1, 4), strict=True):
            assert (name in on.split(", ")) == (port in ports) == (given <= count)
            assert (name.partition(" (")[0] in off.split(", ")) == (given > count)
    on, off = (part.split(", ") for part in physics.acting(load("pipelay")).split("; without "))
    assert {"drag", "current", "seabed", "added mass of the pipe", "internal damping (0.005 s)", "positioning"} <= set(on)
    assert set(off) == {"friction on the bed", "numerical damping", "loads on the hull"}
    assert main(["statics", "pipelay"]) == 0
    assert f"physics         {physics.acting(load('pipelay'))}" in capsys.readouterr().out
