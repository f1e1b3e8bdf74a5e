"""A unit's constants and start from its values, in kernels: against dataclasses, and against statics from nothing on the same nodes."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from pipe_helpers import HANGING, P12, P16, pitch

from master.fmi import schema
from pipe_fmu import Pipe, PipeParameters, Seabed, Section, native
from pipe_fmu.constants import constants_on
from pipe_fmu.environment import Current, Environment
from pipe_fmu.notes import ERROR, SIZE, texts
from pipe_fmu.parameters import AddedMass
from pipe_fmu.slave import PipeUnit
from pipe_fmu.values import value_places, values
from pipe_fmu.vectors import constants_size, loaded, unpacked

HOSE = Section(
    outer_diameter=0.3, wall_thickness=None, axial_stiffness=1e8, shear_stiffness=1e7, torsional_stiffness=1e4, bending_stiffness=2e4,
    bending_stiffness_3=3e4, mass=120.0,
)  # fmt: skip
CURRENTS = (
    None,
    Current(velocity=(0.3, 0.8, 0.0), start=1.0, ramp=20.0, period=300.0),
    Current(velocity=(0.2, 0.5, 0.1), profile="uniform"),
    Current(velocity=(0.2, 0.5, 0.0), profile="table", depths=(0.0, 90.0, 1200.0), factors=(1.0, 0.7, -0.1)),
)


def drawn(random):
    """Parameters of any kind."""
    sections = [
        P16,
        replace(P12, coating_thickness=0.05, coating_density=700.0, contents_density=900.0, yield_stress=4.5e8),
        replace(P16, drag_normal=0.0, drag_tangential=0.0, displaced_area=0.3, mass=200.0, rotational_inertia=(5.0, 3.0, 2.0)),
        HOSE,
    ]
    single = sections[random.integers(4)]
    several = tuple(replace(sections[i], length=400.0) for i in random.integers(4, size=3)) if random.random() < 0.3 else ()
    bed = Seabed(friction=0.4, reference_weight=(None, 700.0)[random.integers(2)])
    return PipeParameters(
        nodes=int(random.integers(7, 20)),
        mesh="uniform",
        section=single,
        sections=several,
        foot=str(random.choice(["clamped", "pinned"])),
        top=str(random.choice(["clamped", "pinned"])),
        top_quaternion=(HANGING, pitch(1.0))[random.integers(2)],
        internal_damping=float(random.choice([0.0, 0.01])),
        numerical_damping=float(random.choice([0.0, 0.1])),
        max_substeps=int(random.choice([1, 9])),
        reference_force=(1e5, 0.0, -2e5),
        reference_moment=(0.0, 3e5, 0.0),
        added_mass=(None, AddedMass())[random.integers(2)],
        seabed=(None, bed)[random.integers(2)],
        environment=Environment(current=CURRENTS[random.integers(len(CURRENTS))]),
    )


def changed(parameters, random):
    """Every number that a host may set made smaller by up to 7 %, its attitude and sub-steps apart."""
    flat, changes = schema.flatten(parameters), {}
    for name in value_places(parameters):
        if not name.startswith(("top_quaternion", "max_substeps")):
            changes[name] = flat[name].value * float(random.uniform(0.93, 1.0))
    return schema.override(parameters, changes | {"max_substeps": 27})


def refilled(exported, given):
    """Status, constants and words of `unit_constants`."""
    constants, notes = np.full(exported.size, math.nan), np.zeros(SIZE)
    status = native.unit_constants(exported, given, constants, notes)
    return status, constants, texts(notes, native.MESSAGES)


@pytest.mark.parametrize("number", range(50))
def test_constants_from_values_are_those_of_the_changed_dataclass(number):
    random = np.random.default_rng([15, number])
    old = Pipe(drawn(random)).parameters
    new = changed(old, random)
    s = np.array(old.nodes_at)
    exported, wanted = constants_on(old, s), constants_on(new, s)
    status, constants, words = refilled(exported, values(new))
    assert (status, words) == (0, [])
    np.testing.assert_array_equal(constants, wanted)
    unit = unpacked(wanted)
    there = len(unit.line.loads.bed.bearing) > 0, len(unit.line.added_mass) > 0, len(unit.line.damping) > 0
    assert wanted.size == constants_size(len(s), len(unit.sea.levels), *there)
    lengths = [section.length or new.length for section in new.all_sections]
    mass = sum(section.mass_per_length * length for section, length in zip(new.all_sections, lengths, strict=True))
    weight = sum(new.weight(section) * length for section, length in zip(new.all_sections, lengths, strict=True))
    assert unit.line.mass.sum() == pytest.approx(mass, rel=1e-9)
    np.testing.assert_allclose(unit.line.loads.weight @ unit.line.length, weight, rtol=1e-9, atol=1e-9 * mass)
    assert unit.parts == 27


@pytest.mark.parametrize("parameters", [drawn(np.random.default_rng(k)) for k in range(6)], ids=range(6))
def test_every_place_is_that_of_a_scalar_parameter_and_all_others_are_texts_or_fixed(parameters):
    flat, given, places = schema.flatten(parameters), values(parameters), value_places(parameters)
    assert {name: given[i] for name, i in places.items()} == {name: float(flat[name].value) for name in places}
    left = {name for name, one in flat.items() if name not in places and one.kind in ("Real", "Integer")}
    assert {name for name in left if not (parameters.sections and name.startswith("section."))} == {
        "length", "nodes", "top_range", "top_amplitude",
    }  # fmt: skip


BED = Seabed(friction=0.2)
FLOW = Environment(current=Current(velocity=(0.1, 0.4, 0.0), profile="linear", start=2.0, ramp=10.0))
CLAMPED = PipeParameters(nodes=40, top_quaternion=pitch(1.1), environment=Environment(depth=810.0), added_mass=AddedMass())
LAID = PipeParameters(nodes=40, top="pinned", top_position=(950.0, 20.0, -600.0), seabed=BED, environment=FLOW)
HUNG = replace(CLAMPED, top_quaternion=HANGING)


def wall(parameters, thickness):
    return replace(parameters, section=replace(parameters.section, wall_thickness=thickness))


def surroundings(parameters, **changes):
    return replace(parameters, environment=replace(parameters.environment, **changes))


CHANGES = {
    "wall thickness": (CLAMPED, 0.0, wall(CLAMPED, 0.025), 0.0),
    "weight": (CLAMPED, 0.0, replace(CLAMPED, section=replace(CLAMPED.section, contents_density=400.0)), 0.0),
    "depth and density": (LAID, 12.0, surroundings(LAID, depth=700.0, water_density=1000.0), 12.0),
    "current": (LAID, 12.0, surroundings(LAID, current=replace(FLOW.current, velocity=(0.3, -0.5, 0.0))), 12.0),
    "time within the ramp": (LAID, 12.0, LAID, 6.0),
    "time before the current": (LAID, 12.0, LAID, 0.0),
    "time after the start in still water": (LAID, 0.0, LAID, 12.0),
    "top ahead": (CLAMPED, 0.0, replace(CLAMPED, top_position=(794.7189562, 0.0, -800.0)), 0.0),
    "top aside": (LAID, 0.0, replace(LAID, top_position=(950.0, 30.0, -600.0)), 0.0),
    "attitude": (CLAMPED, 0.0, replace(CLAMPED, top_quaternion=pitch(1.2)), 0.0),
    "bed": (LAID, 0.0, replace(LAID, seabed=replace(BED, friction=0.5, damping=2.0)), 0.0),
    "weight on the bed": (LAID, 0.0, wall(LAID, 0.018), 0.0),
    "let go": (CLAMPED, 0.0, HUNG, 0.0),
    "held": (HUNG, 0.0, CLAMPED, 0.0),
    "hanging": (HUNG, 0.0, wall(HUNG, 0.025), 0.0),
}


@pytest.fixture(scope="module")
def started():
    """Units at their start, each made once."""
    made = {}

    def start(parameters, at):
        if (parameters, at) not in made:
            unit = PipeUnit(parameters)
            assert unit.initialize(at, {}) is None
            made[parameters, at] = unit
        return made[parameters, at]

    return start


def begun(unit, parameters, at):
    """Status, words and state of a unit whose parameters are changed before its start, and the time it took [s]."""
    exported = unit.constants
    since = time.perf_counter()
    status, constants, words = refilled(exported, values(parameters))
    assert (status, words) == (0, [])
    state, notes = np.empty_like(unit.state), np.zeros(SIZE)
    status = native.unit_start(constants, exported, unit.state, np.zeros(native.N_INPUTS), at, state, notes)
    return status, texts(notes, native.MESSAGES), state, time.perf_counter() - since


@pytest.mark.parametrize("name", CHANGES)
def test_a_start_with_changed_values_is_that_of_statics_from_nothing(name, started):
    old, exported_at, new, at = CHANGES[name]
    nodes = started(old, exported_at)._pipe.parameters
    new = replace(new, nodes_at=nodes.nodes_at, nodes=nodes.nodes)
    wanted = started(new, at)
    begun(started(old, exported_at), new, at)  # compiles
    status, words, state, seconds = begun(started(old, exported_at), new, at)
    print(f"{name}: {1e3 * seconds:.1f} ms")
    assert status == 0
    assert words == [line for line in wanted.remark.splitlines() if "usually" not in line]
    found, right, pipe = loaded(state, nodes.nodes, new.added_mass is not None), wanted.now, wanted._pipe
    assert found.pipe.time == at
    np.testing.assert_allclose(found.top, right.top, rtol=0, atol=1e-9 * np.abs(right.top).max())
    np.testing.assert_allclose(found.pipe.position, right.pipe.position, rtol=0, atol=1e-9 * np.abs(right.pipe.position).max())
    np.testing.assert_allclose(found.impedance, right.impedance, rtol=0, atol=1e-6 * np.abs(right.impedance).max())
    moments = [pipe.section_forces(one.pipe).moment for one in (found, right)]
    np.testing.assert_allclose(*moments, rtol=0, atol=1e-9 * np.abs(moments[1]).max())
    assert seconds < 0.5


@pytest.mark.parametrize(("parameters", "at"), [(CLAMPED, 0.0), (LAID, 12.0), (HUNG, 0.0)], ids=["clamped", "laid", "hung"])
def test_unchanged_values_start_in_the_exported_state(parameters, at, started):
    unit = started(parameters, at)
    status, _, state, _ = begun(unit, unit._pipe.parameters, at)
    assert status == 0
    np.testing.assert_array_equal(state, unit.state)


def test_what_does_not_bear_on_the_equilibrium_leaves_the_exported_one(started):
    unit = started(CLAMPED, 0.0)
    other = replace(unit._pipe.parameters, added_mass=AddedMass(0.5), reference_force=(1.0, 2.0, 3.0), max_substeps=9)
    status, _, state, _ = begun(unit, other, 7.0)
    assert status == 0
    assert state[0] == 7.0
    np.testing.assert_array_equal(state[1:], unit.state[1:])


def test_where_the_way_cannot_be_gone_the_start_is_refused(started):
    """From a state that is none, no equilibrium is found; the state asked for stays as it was."""
    unit = started(CLAMPED, 0.0)
    exported, nowhere = unit.constants, unit.state.copy()
    loaded(nowhere, CLAMPED.nodes, True).pipe.position[5] = math.nan
    _, constants, _ = refilled(exported, values(wall(unit._pipe.parameters, 0.025)))
    state, notes = np.zeros_like(nowhere), np.zeros(SIZE)
    assert native.unit_start(constants, exported, nowhere, np.zeros(native.N_INPUTS), 0.0, state, notes) == ERROR
    assert texts(notes, native.MESSAGES) == [
        "statics: no equilibrium was found on the way from the exported one; export the FMU anew with these values"
    ]
    assert not state.any()


TUBE = PipeParameters(nodes=8, mesh="uniform", seabed=Seabed(), top_range=10.0)
REFUSED = [
    ({"section.wall_thickness": 0.25}, "section.wall_thickness = 0.25: must be <= the outer radius 0.2032 m"),
    ({"max_substeps": 4}, "max_substeps = 4: must be one of 1, 3, 9, 27, 81, 243, 729"),
    ({"top_position[1]": 1200.0}, "length = 1200: must be at least 1373.54 m, or the line is stretched by more than 5% .*, 1442.22 m"),
    ({"top_position[1]": 970.0}, "top_range = 10: must be at most [0-9.]* m, where the line is stretched by 5%"),
    ({"top_quaternion[1]": 0.5}, r"top_quaternion = \(0.5, 0, 0, 0\): must have length 1, or be all zero"),
]


@pytest.mark.parametrize(("changes", "words"), REFUSED, ids=range(len(REFUSED)))
def test_values_are_refused_in_the_words_of_the_dataclasses(changes, words):
    old = Pipe(TUBE).parameters
    with pytest.raises(ValueError, match=f"^{words}$") as refusal:
        schema.override(old, changes)
    given = values(old)
    for name, value in changes.items():
        given[value_places(old)[name]] = value
    status, _, said = refilled(constants_on(old, np.array(old.nodes_at)), given)
    assert (status, said) == (ERROR, [str(refusal.value)])


def test_a_bed_is_refused_under_a_line_without_weight():
    sections = replace(P16, mass=1025.0 * 0.25, displaced_area=0.25)
    old = Pipe(replace(TUBE, section=replace(sections, mass=300.0))).parameters
    given = values(old)
    given[value_places(old)["section.mass"]] = sections.mass
    with pytest.raises(ValueError, match=r"seabed\.reference_weight = nothing: must be given") as refusal:
        replace(old, section=sections)
    status, _, said = refilled(constants_on(old, np.array(old.nodes_at)), given)
    assert (status, said) == (ERROR, [str(refusal.value)])


@pytest.mark.parametrize("kind", ["internal", "numerical"])
@pytest.mark.parametrize(("old", "new", "verb"), [(0.0, 0.1, "adds"), (0.1, 0.0, "changes")])
def test_a_change_of_outputs_is_refused(kind, old, new, verb):
    name = f"{kind}_damping"
    parameters = replace(Pipe(TUBE).parameters, **{name: old})
    given = values(replace(parameters, **{name: new}))
    status, _, said = refilled(constants_on(parameters, np.array(parameters.nodes_at)), given)
    assert (status, said) == (ERROR, [f"{name}: {verb} the output {kind}_dissipation; such an FMU must be exported anew"])
