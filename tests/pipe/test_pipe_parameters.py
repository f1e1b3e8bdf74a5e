"""Parameters: every bad value is refused with a line naming key, value and rule; tube formulas; ports and meshes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pipe_helpers import HANGING, P12, P16, P30, TANGENT, pitch, sea

from pipe_fmu import AddedMass, Pipe, PipeParameters, PipeUnit, Seabed, Section
from pipe_fmu.environment import Current, Environment

BAD = [
    (Section, {"outer_diameter": -0.4}, r"outer_diameter = -0\.4: must be > 0 m"),
    (Section, {"outer_diameter": 0.0}, r"outer_diameter = 0: must be > 0 m"),
    (Section, {"wall_thickness": 0.9}, r"wall_thickness = 0\.9: must be <= the outer radius 0\.2032 m"),
    (Section, {"wall_thickness": math.nan}, r"wall_thickness = nan: must be finite"),
    (Section, {"youngs_modulus": math.inf}, r"youngs_modulus = inf: must be finite"),
    (Section, {"youngs_modulus": "stiff"}, r"youngs_modulus = 'stiff': must be a number \(Pa\)"),
    (Section, {"poisson_ratio": 0.6}, r"poisson_ratio = 0\.6: must be <= 0\.5"),
    (Section, {"density": -1.0}, r"density = -1: must be >= 0 kg/m3"),
    (Section, {"drag_normal": -1.2}, r"drag_normal = -1\.2: must be >= 0"),
    (Section, {"rotational_damping": (1.5, -1.5, 1.5)}, r"rotational_damping\[2\] = -1\.5: must be >= 0 N\.s"),
    (Section, {"rotational_damping": (1.5, 1.5)}, r"rotational_damping = \(1\.5, 1\.5\): must have 3 entries"),
    (Section, {"rotational_inertia": (1.0, 0.0, 1.0)}, r"rotational_inertia\[2\] = 0: must be > 0 kg\.m"),
    (Section, {"bending_stiffness": 0.0}, r"bending_stiffness = 0: must be > 0 N\.m2"),
    (Seabed, {"friction": -0.1}, r"friction = -0\.1: must be >= 0"),
    (Seabed, {"friction_speed": 0.0}, r"friction_speed = 0: must be > 0 m/s"),
    (AddedMass, {"coefficient": -1.0}, r"coefficient = -1: must be >= 0"),
    (Environment, {"depth": 0.0}, r"depth = 0: must be > 0 m"),
    (Environment, {"gravity": math.nan}, r"gravity = nan: must be finite"),
    (Current, {"profile": "table"}, r"depths = \(\): must be given with profile = 'table'"),
    (Current, {"profile": "table", "depths": (0.0, 9.0), "factors": (1.0,)}, r"factors = \(1\.0,\): must have as many entries"),
    (Current, {"profile": "table", "depths": (9.0, 0.0), "factors": (1.0, 0.0)}, r"depths = \(9\.0, 0\.0\): must ascend"),
    (Current, {"ramp": -1.0}, r"ramp = -1: must be >= 0 s"),
    (PipeParameters, {"length": 900.0}, r"length = 900: must be at least 1080\.68 m, or .* by more than 5%.* 1134\.71 m"),
    (PipeParameters, {"top_range": 200.0}, r"top_range = 200: must be at most 168\.729 m, where the line is stretched by 5%"),
    (PipeParameters, {"nodes": 2}, r"nodes = 2: must be >= 3"),
    (PipeParameters, {"nodes": True}, r"nodes = True: must be a number"),
    (PipeParameters, {"internal_damping": -0.1}, r"internal_damping = -0\.1: must be >= 0 s"),
    (PipeParameters, {"numerical_damping": 0.7}, r"numerical_damping = 0\.7: must be <= 0\.5"),
    (PipeParameters, {"top_quaternion": (1.0, 1.0, 0.0, 0.0)}, r"top_quaternion = .*: must have length 1, or be all zero"),
    (PipeParameters, {"top_position": (800.0, 0.0, math.nan)}, r"top_position\[3\] = nan: must be finite"),
    (PipeParameters, {"sections": (Section(),)}, r"sections\[1\]\.length: must be given"),
    (PipeParameters, {"sections": (Section(length=700.0),)}, r"length = 1200: must equal the sum of the sections' lengths, 700 m"),
]


@pytest.mark.parametrize(("kind", "values", "message"), BAD)
def test_bad_value_is_refused_with_key_value_and_rule(kind, values, message):
    with pytest.raises(ValueError, match=message) as caught:
        kind(**values)
    assert "\n" not in str(caught.value)


def test_more_sections_than_elements_are_refused():
    sections = tuple(Section(length=400.0) for _ in range(3))
    with pytest.raises(ValueError, match=r"nodes = 3: must exceed the number of sections, 3"):
        Pipe(PipeParameters(nodes=3, sections=sections))


@pytest.mark.parametrize(
    ("section", "mass", "weight", "axial", "bending", "torsion", "shear", "inertia", "displaced"),
    [
        (P16, 210.34, 759.1, 5.547e9, 1.0268e8, 7.899e7, 1.138e9, 7.788, 0.12972),
        (P12, 154.06, 683.1, 4.062e9, 4.691e7, 3.609e7, 8.352e8, 3.558, 0.08237),
        (P30, 635.16, 1657.4, 1.6992e10, 1.1206e9, 8.620e8, 3.481e9, 83.78, 0.45484),
    ],
)
def test_tube_formulas_give_the_listed_pipe_sets(section, mass, weight, axial, bending, torsion, shear, inertia, displaced):
    """parameters of the 16, 12 3/4 and 30 inch sets, to their printed digits; shear factor 0.533 there, Cowper's here (0.7 %)."""
    ea, ga, gj, ei, ei_3 = section.stiffness
    assert section.mass_per_length == pytest.approx(mass, rel=5e-5)
    assert (section.mass_per_length - 1025.0 * section.outer_area) * 9.81 == pytest.approx(weight, rel=1e-4)
    assert [ea, ei, gj] == pytest.approx([axial, bending, torsion], rel=2e-4)
    assert ei_3 == ei
    assert ga == pytest.approx(shear, rel=2e-2)
    assert section.inertia == pytest.approx((inertia, inertia / 2, inertia / 2), rel=2e-4)
    assert section.outer_area == pytest.approx(displaced, rel=5e-5)


def test_coating_and_contents_add_mass_and_only_coating_adds_buoyancy():
    bare, full = Section(), Section(contents_density=1000.0, coating_thickness=0.05, coating_density=2400.0)
    inner, outer = bare.radii
    ring = math.pi * ((outer + 0.05) ** 2 - outer**2)
    assert full.mass_per_length == pytest.approx(bare.mass_per_length + 1000.0 * math.pi * inner**2 + 2400.0 * ring, rel=1e-12)
    assert full.outer_area == pytest.approx(bare.outer_area + ring, rel=1e-12)
    assert full.stiffness == bare.stiffness
    assert full.hydrodynamic_diameter == pytest.approx(0.5064)


def test_stiffnesses_given_directly_replace_the_tubes_one_by_one():
    section = Section(axial_stiffness=1.0, bending_stiffness=2.0, bending_stiffness_3=3.0, mass=4.0, displaced_area=5.0)
    tube = Section().stiffness
    assert section.stiffness == (1.0, tube[1], tube[2], 2.0, 3.0)
    assert (section.mass_per_length, section.outer_area) == (4.0, 5.0)


CABLE = {"axial_stiffness": 1e8, "shear_stiffness": 1e7, "torsional_stiffness": 1e4, "bending_stiffness": 1e4, "mass": 100.0}


def test_a_cable_without_a_wall_has_its_stiffnesses_and_no_stress():
    section = Section(wall_thickness=None, **CABLE)
    assert section.stiffness == (1e8, 1e7, 1e4, 1e4, 1e4)
    pipe = Pipe(PipeParameters(section=replace(section, displaced_area=0.01), top="pinned", top_quaternion=HANGING))
    found, state = pipe.start(0.0)
    assert found.converged
    assert not pipe.von_mises(state, pipe.section_forces(state)).any()


@pytest.mark.parametrize("missing", CABLE)
def test_a_section_without_a_wall_needs_every_stiffness(missing):
    given = {key: value for key, value in CABLE.items() if key != missing}
    with pytest.raises(ValueError, match=f"{missing}: must be given where there is no wall_thickness"):
        Section(wall_thickness=None, **given)


@pytest.mark.parametrize("end", ["foot", "top"])
def test_an_unknown_end_condition_is_refused(end):
    with pytest.raises(ValueError, match=f"{end} = 'welded': must be"):
        Pipe(PipeParameters(**{end: "welded"}))


def test_the_only_section_with_a_length_other_than_the_pipes_is_refused():
    with pytest.raises(ValueError, match="length"):
        Pipe(PipeParameters(section=Section(length=600.0)))


@pytest.mark.parametrize("nodes", [3, 4, 10, 48, 200])
@pytest.mark.parametrize("mesh", ["adapted", "uniform"])
def test_mesh_has_the_nodes_asked_for_from_foot_to_top(nodes, mesh):
    s = Pipe(PipeParameters(nodes=nodes, mesh=mesh)).s
    assert len(s) == nodes
    assert (s[0], s[-1]) == (0.0, 1200.0)
    assert (np.diff(s) > 0).all()
    if mesh == "uniform":
        np.testing.assert_allclose(np.diff(s), 1200.0 / (nodes - 1), rtol=1e-3)


def test_adapted_mesh_is_fine_at_clamps_and_touchdown_and_changes_gently():
    attitude = pitch(math.radians(60.0))
    hanging = np.diff(Pipe(PipeParameters(top_position=TANGENT, top_quaternion=attitude)).s)
    assert max(hanging[0], hanging[-1]) < 0.7 * hanging.mean()
    pipe = Pipe(PipeParameters(top_position=(700.0, 0.0, -800.0), top_quaternion=HANGING, top="pinned", seabed=Seabed()))
    lying = np.diff(pipe.s)
    finest = pipe.s[np.argmin(lying)]
    assert 150.0 < finest < 300.0  # the catenary leaves the bed at 212 m
    for h in (hanging, lying):
        assert (np.abs(np.diff(np.log(h))) < math.log(2.5)).all()


def test_nodes_placed_by_hand_stay_where_they_are_put():
    at = (0.0, 100.0, 250.0, 700.0, 1100.0, 1200.0)
    assert tuple(Pipe(PipeParameters(nodes=6, nodes_at=at)).s) == at
    with pytest.raises(ValueError, match=r"nodes = 5: must be the number of entries of nodes_at, 6"):
        PipeParameters(nodes=5, nodes_at=at)
    with pytest.raises(ValueError, match=r"nodes_at = .*: must ascend from 0 to the length 1200 m"):
        PipeParameters(nodes=6, nodes_at=(0.0, 100.0, 90.0, 700.0, 1100.0, 1200.0))


def test_sections_begin_and_end_at_nodes_and_carry_their_own_properties():
    sections = (replace(P16, length=333.0), replace(P30, length=500.0), replace(P12, length=367.0))
    pipe = Pipe(PipeParameters(sections=sections, seabed=Seabed()))
    for joint in (333.0, 833.0):
        assert np.abs(pipe.s - joint).min() < 1e-9
    middle = 0.5 * (pipe.s[1:] + pipe.s[:-1])
    which = np.searchsorted([333.0, 833.0], middle)
    np.testing.assert_allclose(pipe.line.stiffness[:, 0], [sections[k].stiffness[0] for k in which])
    np.testing.assert_allclose(pipe.line.loads.bed.diameter, [sections[k].outer_diameter for k in which])
    total = sum(one.mass_per_length * one.length for one in sections)
    assert pipe.line.mass.sum() == pytest.approx(total, rel=1e-12)


def test_ports_are_there_only_for_the_physics_that_is_named():
    optional = {"contact_energy", "contact_dissipation", "internal_dissipation", "numerical_dissipation"}
    assert not optional & set(PipeUnit.outputs(PipeParameters()))
    named = PipeParameters(seabed=Seabed(), internal_damping=0.01, numerical_damping=0.01)
    assert optional <= set(PipeUnit.outputs(named))


def test_every_port_has_a_value_of_its_size_that_is_finite():
    damped = {"internal_damping": 0.01, "numerical_damping": 0.01}
    parameters = PipeParameters(nodes=10, seabed=Seabed(friction=0.3), added_mass=AddedMass(), environment=sea(800.0, 0.5), **damped)
    unit = PipeUnit(parameters)
    assert unit.initialize(0.0, {}) is None
    assert unit.step(0.0, 0.1, {"velocity": np.array([0.1, 0.0, 0.0]), "angular_velocity": np.zeros(3), "mobility": np.zeros(36)}) is None
    for name, (size, _, _) in PipeUnit.outputs(parameters).items():
        value = unit.output(name)
        assert value.shape == (size,), name
        assert np.isfinite(value).all(), name


def test_ports_report_works_and_forces_with_the_sign_of_the_pull_on_the_vessel():
    """top_work is the work done on the pipe: minus force port times velocity times time."""
    unit = PipeUnit(PipeParameters(nodes=16))
    assert unit.initialize(0.0, {}) is None
    assert unit.output("force")[2] > 0.0  # the pipe pulls the vessel down
    velocity = np.array([0.2, 0.1, -0.4])
    work = 0.0
    for k in range(5):
        assert unit.step(0.1 * k, 0.1, {"velocity": velocity, "angular_velocity": np.zeros(3), "mobility": np.zeros(36)}) is None
        work -= 0.1 * unit.output("force") @ velocity
    assert unit.output("top_work")[0] == pytest.approx(work, rel=1e-12)
    energies = sum(unit.output(f"{kind}_energy")[0] for kind in ("kinetic", "elastic", "gravity"))
    lost = unit.output("drag_dissipation")[0] + unit.output("rotational_dissipation")[0]
    fresh = PipeUnit(PipeParameters(nodes=16))
    assert fresh.initialize(0.0, {}) is None
    start = sum(fresh.output(f"{kind}_energy")[0] for kind in ("kinetic", "elastic", "gravity"))
    assert energies - start == pytest.approx(work - lost, abs=1e-9 * abs(work) + 1e-14 * abs(start) * 10)


def test_state_is_a_value_to_set_and_pickle():
    import pickle

    unit = PipeUnit(PipeParameters(nodes=10))
    assert unit.initialize(0.0, {}) is None
    inputs = {"velocity": np.array([0.2, 0.0, 0.1]), "angular_velocity": np.zeros(3), "mobility": np.zeros(36)}
    unit.step(0.0, 0.1, inputs)
    saved = pickle.loads(pickle.dumps(unit.state))
    unit.step(0.1, 0.1, inputs)
    after = unit.output("force").copy()
    unit.step(0.2, 0.1, inputs)
    unit.state = saved
    unit.step(0.1, 0.1, inputs)
    np.testing.assert_array_equal(unit.output("force"), after)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_shear_factor_is_cowpers_for_a_thin_tube_and_for_a_solid_round_bar(poisson):
    """G. R. Cowper (1966): 2 (1 + v) / (4 + 3 v) and 6 (1 + v) / (7 + 6 v)."""
    for wall, expected in ((1e-7, 2.0 * (1.0 + poisson) / (4.0 + 3.0 * poisson)), (0.5, 6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson))):
        section = Section(outer_diameter=1.0, wall_thickness=wall, poisson_ratio=poisson)
        shear_modulus = 0.5 * section.youngs_modulus / (1.0 + poisson)
        assert section.stiffness[1] / (shear_modulus * section.steel_area) == pytest.approx(expected, rel=1e-6)
