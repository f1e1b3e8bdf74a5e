"""The vessel's four kernels on plain vectors: against the dataclasses, against the facade, and as machine code without Python."""

import re
from dataclasses import fields, replace

import numpy as np
import pytest
from numba import carray, cfunc, types

from master.fmi import schema
from vessel_fmu import native
from vessel_fmu.environment import Current, Environment
from vessel_fmu.notes import ERROR, blank, texts
from vessel_fmu.parameters import AddedMass, Controller, HullDrag, LinearDamping, Start, VesselParameters
from vessel_fmu.ports import INPUTS, outputs
from vessel_fmu.slave import VesselUnit
from vessel_fmu.vessel import Inputs, Vessel, to_vector

FULL = VesselParameters(
    hang_off=(-30.0, 2.0, 3.0),
    hold_force=(2e5, -1e5, 1e6),
    controller=Controller(start=0.5, period=0.3, y=4.0),
    environment=Environment(current=Current(velocity=(0.3, 0.8, 0.0), start=0.2, ramp=1.0, period=2.0)),
    start=Start(attitude=(0.02, -0.03, 0.4), velocity=(0.5, 0.1, 0.0), angular_velocity=(0.0, 0.01, 0.002)),
)
TABLE = replace(FULL, environment=Environment(current=Current(profile="table", depths=(0.0, 90.0), factors=(0.7, 0.1))))


def random_parameters(rng):
    """Every number off its default by up to a tenth of it, some tables absent."""

    def moved(tree):
        changes = {}
        for item in fields(tree):
            value = getattr(tree, item.name)
            if isinstance(value, float):
                changes[item.name] = value * rng.uniform(0.9, 1.1)
            elif isinstance(value, tuple) and item.name not in ("depths", "factors"):
                changes[item.name] = tuple(one * rng.uniform(0.9, 1.1) for one in value)
        return replace(tree, **changes)

    current = replace(moved(FULL.environment.current), profile=str(rng.choice(["linear", "uniform"])))
    current = rng.choice([None, current, TABLE.environment.current])
    tables = {
        "added_mass": moved(AddedMass()),
        "damping": rng.choice([None, moved(LinearDamping())]),
        "drag": rng.choice([None, moved(HullDrag())]),
        "controller": rng.choice([None, moved(FULL.controller)]),
        "start": moved(FULL.start),
        "environment": replace(moved(FULL.environment), current=current),
    }
    return replace(moved(FULL), **tables)


def constants_of(exported, values):
    """What unit_constants answers: status, constants, words."""
    constants, notes = np.full(native.N_CONSTANTS, np.inf), blank()
    status = native.unit_constants(exported, values, constants, notes)
    return status, constants, texts(notes, native.MESSAGES)


def test_constants_of_changed_values_are_those_of_the_changed_dataclass():
    """From an export with the same tables and other numbers, set one by one under the names that a host knows."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        target, exported = random_parameters(rng), random_parameters(rng)
        for name in ("damping", "drag", "controller"):
            like = getattr(target, name)
            exported = replace(
                exported, **{name: like and replace(like, **{fields(like)[-1].name: 1.5 * getattr(like, fields(like)[-1].name)})}
            )
        sea = replace(exported.environment, current=target.environment.current)
        exported = replace(exported, environment=sea)
        flat, places = schema.flatten(target), native.value_places(exported)
        values = native.values(exported)
        for name, place in places.items():
            it = flat[name]
            values[place] = it.items.index(it.value) + 1 if it.items else it.value
        status, constants, _ = constants_of(native.constants(exported), values)
        assert status == 0
        np.testing.assert_array_equal(constants, native.constants(target))
        assert not np.array_equal(constants, native.constants(exported))
        tabulated = target.environment.current == TABLE.environment.current
        fixed = {f"environment.current.{name}" for name in ("depths", "factors", *(["profile"] if tabulated else []))}
        assert flat.keys() - places.keys() == (fixed if target.environment.current else set())


def changed(parameters, **numbers):
    values, places = native.values(parameters), native.value_places(parameters)
    for name, value in numbers.items():
        values[places[name]] = value
    return values


REFUSED = [
    {"added_mass.sway_yaw": 1e9},
    {"added_mass.heave_pitch": -4e8},
    {"damping.heave_pitch": 2e8},
    {"damping.surge_heave": -1e6},
    {"controller.integral_ratio": 2.5},
    {"controller.damping_ratio": 0.05},
    {"controller.surge_limit": 1e5},
    {"controller.sway_limit": 1e3},
    {"controller.yaw_limit": 1e3},
    {"hold_force[2]": -9e5},
    {"environment.current.profile": 3},
    {},
]


@pytest.mark.parametrize("change", REFUSED, ids=str)
def test_kernel_and_dataclass_refuse_the_same_in_the_same_words(change):
    status, _, words = constants_of(native.constants(FULL), changed(FULL, **change))
    texts = {name: "table" if name.endswith("profile") else value for name, value in change.items()}
    if not change:
        assert (status, words) == (0, [])
        return
    with pytest.raises(ValueError) as refusal:  # noqa: PT011
        schema.override(FULL, texts)
    assert (status, words) == (ERROR, [str(refusal.value)])


def test_a_hold_that_comes_or_goes_for_good_changes_the_ports():
    without = replace(FULL, controller=None)
    still = replace(without, hold_force=(0.0, 0.0, 1e6))
    assert constants_of(native.constants(still), native.values(without))[2] == [
        "hold_force: adds the output hold_energy; such an FMU must be exported anew"
    ]
    assert constants_of(native.constants(without), native.values(still))[2] == [
        "hold_force: changes the output hold_energy; such an FMU must be exported anew"
    ]
    assert ("hold_energy" in outputs(without), "hold_energy" in outputs(still), "hold_energy" in outputs(FULL)) == (True, False, False)


@pytest.mark.parametrize(
    "change", [{}, {"mass": 1e4}, {"environment.depth": 13e3, "hang_off[1]": -400.0, "start.attitude[1]": 0.5}], ids=str
)
def test_the_start_of_changed_values_is_that_of_the_changed_dataclass_with_its_remarks(change):
    target = schema.override(VesselParameters(added_mass=AddedMass(heave_pitch=0.0, sway_yaw=0.0)), change)
    _, constants, _ = constants_of(native.constants(target), native.values(target))
    state, notes = np.empty(native.N_STATE), blank()
    assert native.unit_start(constants, constants, state, np.zeros(native.N_INPUTS), 3.0, state, notes) == 0
    unit = VesselUnit(target)
    unit.initialize(3.0, {name: np.zeros(size) for name, (size, _, _) in INPUTS.items()})
    np.testing.assert_array_equal(state, unit.state)
    assert "\n".join(texts(notes, native.MESSAGES)) == unit.remark
    assert len(texts(notes, native.MESSAGES)) == len(change)


@pytest.mark.parametrize(
    "parameters", [FULL, TABLE, replace(FULL, controller=None, drag=None, damping=None)], ids=["full", "table", "bare"]
)
def test_kernels_unit_and_facade_step_alike_to_the_last_bit(parameters):
    unit, vessel, rng = VesselUnit(parameters), Vessel(parameters), np.random.default_rng(9)
    constants, notes = native.constants(parameters), blank()
    state, vector = vessel.start(), unit.state.copy()
    for k in range(20):
        inputs = {name: 1e5 * rng.normal(size=size) for name, (size, _, _) in INPUTS.items()}
        before, after = vector.copy(), np.empty(native.N_STATE)
        assert native.unit_step(constants, np.concatenate(list(inputs.values())), 0.2 * k, 0.2, vector, after, notes) == 0
        np.testing.assert_array_equal(vector, before)
        assert unit.step(0.2 * k, 0.2, inputs) is None
        pulls = {name: inputs[name] + inputs[f"{name}_change"] for name in ("force", "moment")}
        loads = Inputs(**{name: inputs[name] for name in Inputs._fields} | pulls)
        state, vector = vessel.step(state, 0.2 * k, 0.2, loads).state, after
        assert unit.state.tobytes() == vector.tobytes()
        assert to_vector(state)[: -native.STATE["told"]].tobytes() == vector[: -native.STATE["told"]].tobytes()
    assert parameters.controller is None or state.control.sample > 5


def test_a_step_that_does_not_converge_leaves_the_vector_it_was_to_fill():
    constants, after, notes = native.constants(FULL), np.full(native.N_STATE, 7.0), blank()
    state = VesselUnit(FULL).state
    assert native.unit_step(constants, np.full(native.N_INPUTS, np.nan), 0.0, 0.1, state, after, notes) == 2
    assert (after == 7.0).all()
    assert re.fullmatch(r"vessel: Newton stopped at a relative unbalance of nan after \d+ iterations", texts(notes, native.MESSAGES)[0])


POINTER = types.CPointer(types.float64)
LIBRARY = {"atan2", "expm1", "hypot", "sqrt"}
FAILURES = {  # Python's, on the way out where memory is short; whoever links the code without Python must replace them
    "PyBytes_FromStringAndSize", "PyErr_Clear", "PyErr_SetNone", "PyErr_SetString", "PyErr_WriteUnraisable", "PyUnicode_FromString",
    "Py_DecRef", "numba_do_raise", "numba_gil_ensure", "numba_gil_release", "numba_runtime_build_excinfo_struct", "numba_unpickle",
}  # fmt: skip


def test_kernels_are_machine_code_that_needs_no_blas():
    """Compiled with plain pointers, as for an FMU: the same bits; beside the C library, numba's memory and LLVM's own only FAILURES."""
    constants, state = native.constants(FULL), VesselUnit(FULL).state
    n_constants, n_inputs, n_state, n_notes = native.N_CONSTANTS, native.N_INPUTS, native.N_STATE, len(blank())

    @cfunc(types.int64(POINTER, POINTER, types.float64, types.float64, POINTER, POINTER, POINTER), error_model="numpy")
    def unit_step(constants, inputs, time, h, state, after, notes):
        return native.unit_step(
            carray(constants, n_constants),
            carray(inputs, n_inputs),
            time,
            h,
            carray(state, n_state),
            carray(after, n_state),
            carray(notes, n_notes),
        )

    inputs, after, again, notes = np.linspace(-1e5, 1e5, n_inputs), np.empty(n_state), np.empty(n_state), blank()
    pointers = [array.ctypes.data_as(unit_step.ctypes.argtypes[0]) for array in (constants, inputs, state, after, notes)]
    assert unit_step.ctypes(*pointers[:2], 1.0, 0.1, *pointers[2:]) == 0
    assert native.unit_step(constants, inputs, 1.0, 0.1, state, again, notes) == 0
    assert after.tobytes() == again.tobytes()
    declared = set(re.findall(r"^declare .*?@\"?([\w.$]+)", unit_step._library.get_llvm_str(), re.MULTILINE))
    others = {name for name in declared if not name.startswith(("NRT_", "llvm."))}
    assert others <= LIBRARY | FAILURES
