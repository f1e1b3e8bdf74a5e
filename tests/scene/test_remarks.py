"""What a run remarks: keys that cannot act, units that slipped, lines and vessels beyond what their equations bear."""

import json
import re
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from master.__main__ import main
from master.errors import RunError, UsageError
from master.run.warnings import Remarks
from master.scene import reading, remarks
from master.with_units.statics import equilibrium
from master.with_units.statics_report import report
from pipe_fmu import Pipe, PipeParameters, Section, validity
from pipe_fmu.slave import PipeUnit
from vessel_fmu.parameters import Start, VesselParameters
from vessel_fmu.slave import VesselUnit

STILL = {"velocity": np.zeros(3), "angular_velocity": np.zeros(3), "mobility": np.zeros(36)}


def started(name="heave", changes=()):
    unit = PipeUnit(equilibrium(reading.load(name, changes)).pipe)
    assert unit.initialize(0.0, {}) is None
    return unit


def number(pattern, text):
    """The number in the place of `#` of a pattern."""
    return float(re.search(re.escape(pattern).replace("\\#", "#").replace("#", r"([-+.e\d]+)"), text)[1])


def test_a_line_below_the_sea_floor_is_remarked_where_there_is_no_bed():
    unit = started(changes=["start.x=780.0"])
    deepest = unit.output("node_position")[2::3].max()
    assert deepest > 0.5
    assert number("hangs # m below the sea floor", unit.remark) == pytest.approx(deepest, rel=0.05)
    assert not started(changes=["start.x=780.0", "pipe.seabed={}"]).remark


def test_a_line_above_the_surface_is_remarked():
    assert not started(changes=["environment.depth=795.0"]).remark
    unit = started(changes=["environment.depth=790.0"])
    assert number("rises # m above the surface at S = ", unit.remark) == pytest.approx(10.0)
    assert number("above the surface at S = # m", unit.remark) == pytest.approx(1200.0)


def test_a_line_in_compression_is_remarked():
    """A top that is thrust down at 2 m/s pushes the line at once."""
    unit = started()
    assert unit.step(0.0, 0.05, STILL | {"velocity": np.array([0.0, 0.0, 2.0])}) is None
    assert unit.output("node_tension").min() < 0.0
    assert number("effective tension # kN", unit.remark) < 0.0
    assert "in compression" in unit.remark


def test_utilisation_is_the_stress_over_the_yield_stress_of_its_own_section():
    parameters = equilibrium(reading.load("heave")).pipe
    steel = parameters.section
    soft = (replace(steel, length=200.0, yield_stress=1e8), replace(steel, length=1000.0, yield_stress=5e8))
    pipe = Pipe(replace(parameters, sections=soft, nodes_at=(), nodes=49))
    _, state = pipe.start(0.0)
    forces = pipe.section_forces(state)
    stress = pipe.von_mises(state, forces)
    below = pipe.s < 200.0 - 1e-6
    assert pipe.utilisation(state, forces) == pytest.approx(max(stress[below].max() / 1e8, stress[~below].max() / 5e8), rel=2e-2)
    one = Pipe(replace(parameters, section=replace(steel, yield_stress=2e8)))
    _, state = one.start(0.0)
    forces = one.section_forces(state)
    assert one.utilisation(state, forces) == pytest.approx(one.largest_von_mises(state, forces) / 2e8, rel=1e-12)


def test_a_line_past_yield_is_remarked_and_has_its_utilisation_in_the_table(capsys):
    assert "largest_utilisation" not in PipeUnit.outputs(PipeParameters())
    unit = started(changes=["pipe.section.yield_stress=1e8"])
    used = unit.output("largest_utilisation")[0]
    assert used == pytest.approx(unit.output("largest_von_mises")[0] / 1e8)
    assert unit.remark == f"past yield: the largest stress is {used:.3g} of the yield stress"
    assert not started(changes=["pipe.section.yield_stress=4e8"]).remark
    assert main(["statics", "heave", "--set", "pipe.section.yield_stress=1e8"]) == 0
    printed = capsys.readouterr().out
    assert f"MPa, utilisation {used:.3f} (von Mises)" in printed
    assert unit.remark in printed


def test_a_remark_comes_again_when_it_is_half_as_bad_again_and_goes_back_with_the_state():
    """The line sinks at 0.1 m/s; a step that is taken back and repeated says the same."""
    unit, sink = started(), STILL | {"velocity": np.array([-0.5, 0.0, 0.0])}
    depths = []
    for k in range(200):
        before = unit.state
        assert unit.step(0.2 * k, 0.2, sink) is None
        said = unit.remark
        unit.state = before
        assert unit.step(0.2 * k, 0.2, sink) is None
        assert unit.remark == said
        if said:
            depths.append(number("hangs # m below", said))
    assert depths[0] == pytest.approx(0.2032, abs=0.03)  # more than its radius
    assert len(depths) > 2
    assert all(after > 1.45 * before for before, after in pairwise(depths))


def test_a_vessel_beyond_what_its_restoring_holds_for_is_remarked():
    inputs = {name: np.zeros(size) for name, (size, _, _) in VesselUnit.INPUTS.items()}

    def remark(roll, pitch):
        unit = VesselUnit(VesselParameters(start=Start(attitude=(roll, pitch, 0.0))))
        assert unit.initialize(0.0, inputs) is None
        return unit.remark

    assert remark(0.34, -0.08) == ""
    assert remark(0.36, 0.0) == "the vessel's roll is 20.6 degrees; its restoring holds to some 20"
    assert remark(-0.5, 0.1).splitlines()[1] == "the vessel's pitch is 5.73 degrees; its restoring holds to some 5"
    unit = VesselUnit(VesselParameters())
    unit.initialize(0.0, inputs)
    assert unit.step(0.0, 2.0, inputs | {"environment_moment": np.array([0.0, 2e9, 0.0])}) is None
    assert unit.remark.startswith("the vessel's pitch is ")


SLIPS = {
    "diameter in mm": ("heave", "pipe.section={outer_diameter=406.4, wall_thickness=25}", "pipe.section.outer_diameter = 406.4 m: usually"),
    "its weight": ("heave", "pipe.section={outer_diameter=406.4, wall_thickness=25}", "N/m in water, which no line does"),
    "EA in MN": ("heave", "pipe.section.axial_stiffness=6205", "pipe.section.axial_stiffness = 6205 N: usually"),
    "EA in kN": ("heave", "pipe.section.axial_stiffness=6205e3", "% at S = "),
    "density in t/m3": ("heave", "pipe.section.density=7.85", "has a mean density of "),
    "yield stress in MPa": ("heave", "pipe.section.yield_stress=448", "pipe.section.yield_stress = 448 Pa: usually"),
    "water in t/m3": ("heave", "environment.water_density=1.025", "environment.water_density = 1.025 kg/m3: usually"),
    "current in cm/s": ("heave", "environment.current.velocity=[0.0, 80.0, 0.0]", "environment.current.velocity[2] = 80 m/s: usually"),
    "gravity in cm": ("heave", "environment.gravity=981", "environment.gravity = 981 m/s2: usually"),
    "mass of the hull in t": ("paper", "vessel.mass=6362", "vessel.mass = 6362 kg: usually"),
    "bent beyond any steel": ("heave", "start.x=300", "% at S = "),
}


@pytest.mark.parametrize(("name", "change", "words"), SLIPS.values(), ids=SLIPS)
def test_a_slip_of_units_is_remarked(name, change, words):
    """In the remarks of the equilibrium, or beside the reason why there is none."""
    try:
        said = report(reading.load(name, [change]))["remarks"]
    except (RunError, UsageError) as error:
        said = [str(error)]
    assert any(words in text for text in said), said


def test_a_modulus_in_kilopascal_is_remarked_and_steel_is_not():
    soft = PipeParameters(section=Section(youngs_modulus=207e6))
    assert validity.of_parameters(soft) == ["pipe.section.youngs_modulus = 2.07e+08 Pa: usually 5e+08 to 1e+12; is it in this unit?"]
    assert not validity.of_parameters(PipeParameters())


SCENE = {
    "macro step": ("heave", ["simulation.macro_step=6"], "simulation.macro_step = 6: coarser than a twentieth of top_motion.period = 12 s"),
    "jump": ("heave", ["top_motion.ramp=0"], "top_motion.ramp = 0: the motion starts with a jump of 1.05 m/s"),
    "short ramp": ("heave", ["top_motion.ramp=1"], "top_motion.ramp = 1: the motion starts within less than a period"),
    "no motion": ("heave", ["top_motion.amplitude=[0,0,0]"], "top_motion.amplitude = (0, 0, 0): moves nothing"),
    "late controller": ("paper", ["simulation.duration=30"], "vessel.controller.start = 30: does not act before the end"),
    "late current": ("paper", ["simulation.duration=10"], "environment.current.start = 10: does not act before the end"),
    "late snapshot": ("paper", ["simulation.duration=20"], "simulation.snapshots: 30 s lie after the end"),
    "fast controller": ("paper", ["simulation.macro_step=1"], "vessel.controller.period = 0.5: sampled only once in "),
    "no current": ("heave", ["environment.current.velocity=[0,0,0]"], "environment.current: does not act without a velocity"),
    "nodes": ("heave", ["pipe.tolerance=1e-3"], "pipe.nodes = 48: does not act beside pipe.tolerance"),
    "common section": ("heave", ["pipe.sections=[{length=1200, density=8e3}]"], "pipe.section.density = 7850.0: does not act, as all"),
    "friction speed": ("heave", ["pipe.seabed={friction_speed=0.1}"], "pipe.seabed.friction_speed = 0.1: does not act without"),
    "density": ("heave", ["pipe.section.mass=300"], "pipe.section.density = 7850: does not act beside mass"),
    "coating": ("heave", ["pipe.section.coating_density=900"], "pipe.section.coating_density = 900: does not act without"),
}


@pytest.mark.parametrize(("name", "changes", "words"), SCENE.values(), ids=SCENE)
def test_what_cannot_act_in_a_scene_is_remarked(name, changes, words):
    found = remarks.of(reading.load(name, changes))["scene"]
    assert any(text.startswith(words) for text in found), found


def test_every_key_of_a_section_acts_or_is_known_to_have_others_in_its_stead():
    """Each key is moved, beside others that stand instead of the tube's: what follows from the section moves too, or it is in the list."""

    def derived(section):
        return (
            section.stiffness, section.inertia, section.mass_per_length, section.outer_area, section.hydrodynamic_diameter, section.radii,
            section.contents_density, section.drag_normal, section.drag_tangential, section.rotational_damping, section.yield_stress,
        )  # fmt: skip

    tube = Section(contents_density=800.0, coating_thickness=0.05, coating_density=900.0)
    direct = {
        "axial_stiffness": 6e9, "shear_stiffness": 1e9, "torsional_stiffness": 1e8, "bending_stiffness": 1e8, "mass": 300.0,
        "displaced_area": 0.2, "rotational_inertia": (9.0, 5.0, 5.0), "bending_stiffness_3": 2e8, "yield_stress": 4e8,
    }  # fmt: skip

    def idle(section):
        names = [item.name for item in fields(Section) if item.name not in direct and item.name not in ("length", "rotational_damping")]
        moved = {name: replace(section, **{name: 1.1 * getattr(section, name)}) for name in names}
        return {name for name in names if derived(moved[name]) == derived(section)}

    assert not idle(tube)
    for key, others in remarks.INSTEAD.items():
        assert key in idle(replace(tube, **{other: direct[other] for other in others}))
        for other in others:  # all of them are needed
            assert key not in idle(replace(tube, **{one: direct[one] for one in others if one != other}))
    assert idle(replace(tube, **direct)) == set(remarks.INSTEAD)


def test_remarks_that_differ_in_their_numbers_are_of_one_kind():
    class Said:
        def __init__(self, remark):
            self.remark = remark

    told = Remarks()
    told.note({"pipe": Said("hangs 0.3 m below\nin compression: -1.2e+03 kN"), "vessel": Said("")}, 1.0)
    told.note({"pipe": Said("hangs 12 m below")}, 2.0)
    first = {"times": 2, "first_s": 1.0, "first": "hangs 0.3 m below", "last_s": 2.0, "last": "hangs 12 m below"}
    words = "in compression: -1.2e+03 kN"
    assert told.summary() == {"pipe": [first, {"times": 1, "first_s": 1.0, "first": words, "last_s": 1.0, "last": words}]}


BELOW = "the line hangs"


@pytest.mark.parametrize(("name", "kinds"), [("paper", [BELOW]), ("pipelay", []), ("heave", []), ("free-decay", [])])
def test_built_in_scenes_are_remarked_only_where_an_engineer_wants_it(name, kinds, tmp_path, capsys):
    """`paper` has no bed, and its line dips below z = 0 as the vessel moves in; the others stay within their equations."""
    changes = ["simulation.macro_step=0.5", "pipe.nodes=24"]
    assert main(["run", name, *(f"--set={change}" for change in changes), "-o", str(tmp_path)]) == 0
    summary, printed = json.loads((tmp_path / "summary.json").read_text()), capsys.readouterr().out
    assert summary["start_remarks"] == {}
    assert [remark["first"][: len(BELOW)] for remark in summary["remarks"].get("pipe", [])] == kinds
    assert set(summary["remarks"]) <= {"pipe"}
    assert f"physics            {summary['physics']}" in printed or f"physics          {summary['physics']}" in printed
    assert ("pipe remark " in printed) == bool(kinds)


def test_remarks_on_the_scene_and_the_start_are_in_table_and_summary(tmp_path, capsys):
    changes = ["simulation.duration=12", "simulation.macro_step=6", "pipe.nodes=12", "pipe.section.yield_stress=1e8"]
    assert main(["run", "heave", *(f"--set={change}" for change in changes), "-o", str(tmp_path)]) == 0
    summary, printed = json.loads((tmp_path / "summary.json").read_text()), capsys.readouterr().out
    (coarse,), (yielded,) = summary["start_remarks"]["scene"], summary["start_remarks"]["pipe"]
    assert coarse.startswith("simulation.macro_step = 6: coarser")
    assert yielded.startswith("past yield")
    assert summary["utilisation_max"] == pytest.approx(summary["von_mises_max_Pa"] / 1e8)
    assert f"utilisation {summary['utilisation_max']:.3f}" in printed
    assert coarse in printed
    assert yielded in printed
