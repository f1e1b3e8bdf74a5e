"""The vessel's parameters and its ports: what is refused and how, and what a master may rely on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import pipe_fmu
import vessel_fmu
from vessel_fmu.environment import Current, Environment
from vessel_fmu.parameters import AddedMass, Controller, HullDrag, LinearDamping, Start, VesselParameters
from vessel_fmu.slave import VesselUnit
from vessel_fmu.vessel import Vessel

REFUSED = [
    (lambda: VesselParameters(mass=-1.0), "mass = -1: must be > 0 kg"),
    (lambda: VesselParameters(inertia=(1e8, 0.0, 1e9)), r"inertia[2] = 0: must be > 0 kg.m2"),
    (lambda: VesselParameters(hang_off=(0.0, float("nan"), 0.0)), r"hang_off[2] = nan: must be finite"),
    (lambda: VesselParameters(hang_off=(0.0, 0.0)), "hang_off = (0.0, 0.0): must have 3 entries"),
    (lambda: VesselParameters(metacentric_height="big"), "metacentric_height = 'big': must be a number (m)"),
    (lambda: VesselParameters(waterplane_area=0.0), "waterplane_area = 0: must be > 0 m2"),
    (lambda: VesselParameters(departure_angle=float("inf")), "departure_angle = inf: must be finite"),
    (lambda: VesselParameters(added_mass=AddedMass(sway_yaw=1e9)), "must leave the 6 x 6 mass matrix positive definite"),
    (lambda: VesselParameters(controller=Controller(), hold_force=(0.0, 7e5, 0.0)), "sway_limit = 600000: must be >= the hold thrust 7"),
    (lambda: AddedMass(heave=-1.0), "heave = -1: must be >= 0 kg"),
    (lambda: LinearDamping(sway=-2.0), "sway = -2: must be >= 0 N.s/m"),
    (lambda: LinearDamping(sway_yaw=1e9), "must leave the damping positive semidefinite"),
    (lambda: HullDrag(draft=0.0), "draft = 0: must be > 0 m"),
    (lambda: HullDrag(surge_coefficient=-0.1), "surge_coefficient = -0.1: must be >= 0"),
    (lambda: Controller(period=0.0), "period = 0: must be > 0 s"),
    (lambda: Controller(natural_frequency=-0.1), "natural_frequency = -0.1: must be > 0 rad/s"),
    (lambda: Controller(integral_ratio=2.5), "integral_ratio = 2.5: must be < 2 damping_ratio = 2"),
    (lambda: Controller(surge_limit=True), "surge_limit = True: must be a number (N)"),
    (lambda: Start(position=(0.0, 0.0, float("-inf"))), r"position[3] = -inf: must be finite"),
    (lambda: Environment(water_density=0.0), "water_density = 0: must be > 0 kg/m3"),
    (lambda: Current(ramp=-1.0), "ramp = -1: must be >= 0 s"),
]


@pytest.mark.parametrize(("make", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_bad_parameter_is_refused_with_key_value_and_rule(make, message):
    with pytest.raises(ValueError) as refusal:  # noqa: PT011
        make()
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


INPUTS = {name: np.zeros(size) for name, (size, _, _) in VesselUnit.INPUTS.items()}


def unit(**changes):
    vessel = VesselUnit(replace(VesselParameters(hang_off=(-30.0, 0.0, 2.0)), **changes))
    assert vessel.initialize(0.0, INPUTS) is None
    return vessel


def test_a_hold_thrust_for_good_supplies_nothing():
    """A constant force: what it gives on a way it takes back on the way back."""
    vessel = unit(hold_force=(3e5, 1e5, 0.0), start=Start(velocity=(1.0, 0.5, 0.0)))
    for k in range(10):
        assert vessel.step(0.5 * k, 0.5, INPUTS) is None
    x, y, _ = vessel.output("position")
    given = 3e5 * x + 1e5 * y
    assert abs(given) > 1e6
    assert abs(vessel.output("control_work")[0]) < 1e-9 * abs(given)


def test_every_port_has_its_declared_size_before_and_after_a_step():
    vessel = unit()
    for _ in range(2):
        for name, (size, _, description) in VesselUnit.outputs(vessel.parameters).items():
            assert vessel.output(name).shape == (size,)
            assert np.isfinite(vessel.output(name)).all()
            assert description
        assert vessel.step(0.0, 0.1, INPUTS | {"force": np.array([-3e5, 1e4, 9e5])}) is None
    with pytest.raises(KeyError):
        vessel.output("wind")


def test_ports_add_up_to_the_energy_balance():
    """What the unit reports of itself closes: d(energies) = d(works) - d(dissipations)."""
    vessel = unit(environment=Environment(current=Current(velocity=(0.0, 0.8, 0.0))), controller=Controller(start=1.0))
    total = dict.fromkeys(("before", "after"), 0.0)
    inputs = INPUTS | {
        "force": np.array([-3e5, 1e4, 9e5]),
        "environment_moment": np.array([1e6, 0.0, 1e6]),
        "control_force": np.array([1e4, 0.0, 1e5]),
        "environment_force_b": np.array([2e4, 1e4, 0.0]),
        "environment_moment_b": np.array([0.0, 1e6, 2e5]),
    }
    for moment in total:
        energies = sum(vessel.output(name)[0] for name in ("kinetic_energy", "restoring_energy"))
        works = sum(vessel.output(f"{name}_work")[0] for name in ("bond", "control", "environment", "current"))
        total[moment] = energies - works + vessel.output("damping_dissipation")[0] + vessel.output("drag_dissipation")[0]
        for k in range(100):
            assert vessel.step(0.1 * k, 0.1, inputs) is None
    assert total["after"] == pytest.approx(total["before"], abs=1e-12 * vessel.output("bond_work")[0])


def test_output_pose_integrates_the_output_velocity():
    vessel, h = unit(), 0.5
    inputs = INPUTS | {"force": np.array([-3e5, 1e5, 9e5]), "moment": np.array([1e7, 1e7, 1e8])}
    before = vessel.output("hang_off_position")
    for k in range(20):
        assert vessel.step(h * k, h, inputs) is None
        after = vessel.output("hang_off_position")
        assert_allclose(after - before, h * vessel.output("velocity"), atol=1e-12)
        before = after


def test_mean_and_end_velocity_are_those_of_the_path_of_the_hang_off_point():
    """Over a step both ends of which are known, the end velocity is the derivative of the pose, by differences of a short step."""
    start = Start(velocity=(2.0, -1.0, 0.3), angular_velocity=(0.05, -0.04, 0.1), attitude=(0.2, -0.1, 1.0))
    vessel = unit(start=start)
    end = np.concatenate([vessel.output("end_velocity"), vessel.output("end_angular_velocity")])
    mean = np.concatenate([vessel.output("velocity"), vessel.output("angular_velocity")])
    assert_allclose(end, mean, rtol=1e-14)  # at the start there is no step behind
    vessel.step(0.0, 2.0, INPUTS)
    end = np.concatenate([vessel.output("end_velocity"), vessel.output("end_angular_velocity")])
    before = vessel.output("hang_off_position")
    vessel.step(2.0, 1e-6, INPUTS)
    assert_allclose(np.concatenate([vessel.output("velocity"), vessel.output("angular_velocity")]), end, atol=1e-6)
    assert_allclose((vessel.output("hang_off_position") - before) / 1e-6, end[:3], atol=1e-6)


def test_setting_the_state_restores_every_output():
    vessel = unit(controller=Controller(start=0.0))
    inputs = INPUTS | {"force": np.array([-3e5, 1e4, 9e5])}
    vessel.step(0.0, 0.1, inputs)
    saved = vessel.state
    names = VesselUnit.outputs(vessel.parameters)
    before = {name: vessel.output(name).copy() for name in names}
    vessel.step(0.1, 1.0, inputs)
    assert not np.array_equal(vessel.output("position"), before["position"])
    vessel.state = saved
    assert all(np.array_equal(vessel.output(name), before[name]) for name in names)


def test_failed_step_is_told_in_one_line_and_leaves_the_state():
    vessel = unit()
    before = vessel.state
    message = vessel.step(0.0, 0.1, INPUTS | {"force": np.full(3, np.nan)})
    assert message is not None
    assert message.startswith("vessel: Newton stopped")
    assert vessel.state is before


def test_attitude_angles_are_those_of_the_start():
    vessel = unit(start=Start(attitude=(0.1, -0.2, 2.5)))
    assert_allclose([vessel.output(name)[0] for name in ("roll", "pitch", "yaw")], (0.1, -0.2, 2.5), rtol=1e-14)


def test_hull_without_damping_drag_and_controller_has_none():
    vessel = unit(damping=None, drag=None, start=Start(velocity=(3.0, 2.0, 1.0)))
    for k in range(50):
        vessel.step(0.1 * k, 0.1, INPUTS)
    assert vessel.output("damping_dissipation")[0] == 0.0
    assert vessel.output("drag_dissipation")[0] == 0.0
    assert not vessel.output("thrust").any()


@pytest.mark.parametrize("name", ["checks.py", "compiled.py", "environment.py"])
def test_both_units_carry_the_same(name):
    """Each unit is complete by itself; what both need stands in both, word for word."""
    ours, theirs = (Path(package.__file__).with_name(name).read_text(encoding="utf-8") for package in (vessel_fmu, pipe_fmu))
    assert ours == theirs


def test_current_reverses_and_ramps_as_named():
    """The hull takes the surface velocity at the middle of the step."""
    sea = Environment(current=Current(velocity=(0.0, 0.8, 0.0), profile="uniform", start=10.0, ramp=4.0, period=50.0))
    body = Vessel(VesselParameters(environment=sea))
    assert_allclose([body.surface_current(t)[1] for t in (9.9, 12.0, 20.0, 61.0, 111.0)], (0.0, 0.4, 0.8, -0.8, 0.8))


def test_the_static_load_of_a_hold_on_even_keel_is_the_hold():
    vessel = Vessel(VesselParameters(hang_off=(-30.0, 0.0, 2.0), hold_force=(1e5, 2e5, 3e6), start=Start()))
    state = vessel.start()
    x, y, _ = vessel.position(state)
    force, moment = vessel.static_load(np.array([x, y, -vessel.depth]), state.quaternion)
    assert_allclose(force, [1e5, 2e5, 0.0], rtol=1e-12)
    assert_allclose(moment, [0.0, 0.0, 3e6], rtol=1e-12)
