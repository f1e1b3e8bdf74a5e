"""State bytes of any origin: read back where they are those of this FMU, else refused in one line; they never run code."""

import ast
import ctypes
import hashlib
import json
import pickle
import struct
from pathlib import Path

import numpy as np
import pytest
from units.spring_fmu.slave import SpringUnit
from units.toys import BODY, SPRING, spring_recipe

import pipe_fmu
import vessel_fmu
from master.fmi import schema, state
from master.fmi.build import Recipe, _sources, build_fmu
from master.fmu.instance import Fmu
from master.studies.stability.units.body_fmu.slave import BodyUnit
from master.studies.stability.units.linear_fmu.slave import MassUnit
from master.studies.stability.units.linear_fmu.slave import SpringUnit as LinearSpringUnit
from master.studies.stability.units.manipulator_fmu.slave import ArmUnit, CylinderUnit
from pipe_fmu.slave import PipeUnit
from vessel_fmu.slave import VesselUnit

PIPE = Recipe(Path(pipe_fmu.__file__).parent, "slave.PipeUnit", {"nodes": 6})
VESSEL = Recipe(Path(vessel_fmu.__file__).parent, "slave.VesselUnit", {})
FLOWS = ("velocity", "angular_velocity")
FMI2_ERROR = 3


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return build_fmu(spring_recipe(stiffness=2.0), tmp_path_factory.mktemp("fmus") / "spring.fmu")


@pytest.fixture
def spring(file):
    with Fmu(file, "spring") as fmu:
        fmu.initialize({"hardening": 3.0})
        step(fmu, 0, 3)
        yield fmu


def step(fmu: Fmu, first: int, count: int) -> list[list[float]]:
    seen = []
    for i in range(first, first + count):
        fmu.set(FLOWS, np.random.default_rng(i).normal(size=6))
        fmu.step(0.1 * i, 0.1)
        seen.append(fmu.get(tuple(fmu.names("output"))).tolist())
    return seen


def refused(fmu: Fmu, data: bytes) -> str:
    """The one line of the FMU's log on these bytes; its outputs must not change."""
    before, pointer = fmu.get(tuple(fmu.names("output"))), ctypes.c_void_p()
    fmu.messages.clear()
    assert fmu._fmu.dll.fmi2DeSerializeFMUstate(fmu._component, data, ctypes.c_size_t(len(data)), ctypes.byref(pointer)) == FMI2_ERROR
    assert not pointer
    np.testing.assert_array_equal(fmu.get(tuple(fmu.names("output"))), before)
    ((status, text),) = fmu.messages
    assert status == FMI2_ERROR
    assert "\n" not in text
    return text


def parts(data: bytes) -> tuple[dict, bytes]:
    content = data[len(state.MAGIC) + 32 :]
    (length,) = struct.unpack_from("<I", content)
    return json.loads(content[4 : 4 + length]), content[4 + length :]


def sealed(header: object, values: bytes, length: int | None = None) -> bytes:
    """Bytes as a forger makes them, who knows the format."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    content = struct.pack("<I", len(text) if length is None else length) + text + values
    return state.MAGIC + hashlib.sha256(content).digest() + content


class Bomb:
    def __init__(self, path: Path) -> None:
        self.path = str(path)

    def __reduce__(self):
        return (open, (self.path, "w"))


def test_bytes_that_would_run_a_command_when_unpickled_are_refused_and_run_nothing(spring, tmp_path):
    bomb = pickle.dumps(Bomb(tmp_path / "run"))
    held = pickle.dumps((spring.guid, "initialised", 0.3, b"", {}, Bomb(tmp_path / "run")))
    for content in (bomb, held):
        for data in (content, hashlib.sha256(content).digest() + content, sealed(content, b""), sealed(b"{}", content)):
            assert "state: cannot be read back" in refused(spring, data)
    assert not (tmp_path / "run").exists()
    pickle.loads(bomb).close()
    assert (tmp_path / "run").exists()  # it would have
    step(spring, 3, 1)


def test_every_damage_is_found(spring):
    data = spring.serialize(spring.snapshot())
    for i in range(0, len(data), 7):
        refused(spring, data[:i])
        refused(spring, data[:i] + bytes([data[i] ^ 1 << i % 8]) + data[i + 1 :])
    refused(spring, data + b"\0")
    assert step(spring, 3, 1)


def test_forged_bytes_are_refused_by_guid_phase_parameters_and_layout(spring):
    header, values = parts(spring.serialize(spring.snapshot()))
    layout = header["layout"]
    names = [name for name, _, _ in layout]
    assert names == ["0", "1.x", "1.v", "1.mean_force", "1.impedance", "1.top_work", "1.drag_dissipation"]
    for key, value, message in (
        ("guid", "of another", "of another FMU, with the GUID of another"),
        ("phase", "asleep", "it is asleep"),
        ("phase", "not initialised", "it is not initialised, with the state of a unit"),
        ("time", float("nan"), "its header must have guid, phase, time"),
        ("time", "soon", "its header must have guid, phase, time"),
        ("changed", {"hardening": True}, "hardening = True: must be a parameter, and a value of its type"),
        ("changed", {"grip": 1.0}, "grip = 1.0: must be a parameter, and a value of its type"),
        ("changed", {"hardening": float("inf")}, "hardening = inf: must be finite"),
        ("changed", {"configuration": 1}, "configuration = 1: must be a parameter, and a value of its type"),
        ("changed", {"stiffness": -1.0}, "stiffness = -1.0: must be >= 0"),
        ("layout", [["0", "<f8", [6]], ["1.y", *layout[1][1:]], *layout[2:]], "of another layout: has ['1.y', '<f8', [6]]"),
        ("layout", [layout[0], ["1.x", "<f8", [3, 2]], *layout[2:]], "of another layout: has ['1.x', '<f8', [3, 2]]"),
        ("layout", [layout[0], ["1.x", "<i8", [6]], *layout[2:]], "of another layout: has ['1.x', '<i8', [6]]"),
        ("layout", [layout[0], ["1.x", "|O", [6]], *layout[2:]], "of another layout: has ['1.x', '|O', [6]]"),
        ("layout", layout[:-1], "of another layout: 6 values of"),
        ("layout", [*layout, ["1.more", "float", []]], "of another layout: 8 values of"),
        ("layout", layout[:1], "it is initialised, without the state of a unit"),
        ("layout", [], "it is initialised, without the state of a unit"),
    ):
        assert message in refused(spring, sealed(header | {key: value}, values)), key
    assert "of another layout" in refused(spring, sealed(header, values + bytes(8)))
    assert "its header must have" in refused(spring, sealed({**header, "more": 1}, values))
    assert "its header is no JSON" in refused(spring, sealed(b"[" * 100_000, values))
    assert "not those of a state" in refused(spring, sealed(header, values, length=2**32 - 1))
    spring.deserialize(sealed(header, values))  # the right ones are taken
    step(spring, 3, 1)


def test_an_older_version_of_the_format_is_refused(spring):
    data = spring.serialize(spring.snapshot())
    assert "not those of a state" in refused(spring, data.replace(b"state 1", b"state 0", 1))


@pytest.mark.parametrize("parameters", [{}, {"stiffness": 5.0, "offset": [0.1, 0.0, 0.0]}])
def test_a_state_is_taken_up_to_the_last_bit_by_an_instance_that_was_never_initialised(file, parameters):
    """Without the statics of an initialisation, with the parameters that were set where it was saved."""
    with Fmu(file) as one, Fmu(file) as two:
        one.initialize(parameters)
        step(one, 0, 3)
        data = one.serialize(one.snapshot())
        two.restore(two.deserialize(data))
        assert step(two, 3, 3) == step(one, 3, 3)
        assert data == one.serialize(one.deserialize(data))


CONTROLLED = {"controller": {"x": 780.0, "y": 0.0}}
UNITS = {
    "pipe": (PipeUnit, {"nodes": 6}),
    "pipe with all physics": (PipeUnit, {"nodes": 6, "added_mass": {}, "internal_damping": 0.01, "numerical_damping": 0.1, "seabed": {}}),
    "vessel": (VesselUnit, {}),
    "vessel with a controller": (VesselUnit, CONTROLLED),
    "spring": (SpringUnit, {}),
    "body": (BodyUnit, {}),
    "mass": (MassUnit, {}),
    "linear spring": (LinearSpringUnit, {}),
    "arm": (ArmUnit, {}),
    "cylinder": (CylinderUnit, {}),
}


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_has_the_layout_of_all_its_states_from_its_making_on(name):
    unit_class, parameters = UNITS[name]
    unit = unit_class(schema.build(unit_class.PARAMETERS, parameters))
    blank, inputs = unit.state, {port: np.zeros(about[0]) for port, about in unit_class.INPUTS.items()}
    assert unit.initialize(0.0, inputs) is None
    for time in (None, 0.0, 0.1):
        assert time is None or unit.step(time, 0.1, inputs) is None
        snapshot = state.Snapshot("it", "initialised", 0.1, {}, np.zeros(3), unit.state)
        header, values = state.read_header(state.to_bytes(snapshot))
        _, again = state.rebuild((np.zeros(3), blank), header["layout"], values)
        assert state.to_bytes(snapshot._replace(unit=again)) == state.to_bytes(snapshot)
        assert type(again) is type(unit.state)


@pytest.mark.parametrize("recipe", [PIPE, VESSEL, SPRING, BODY], ids=lambda recipe: recipe.name)
def test_nothing_that_travels_in_an_fmu_can_unpickle_or_run_text(recipe):
    """numba's own cache is pickled: see the folder it lies in."""
    for name, text in _sources(recipe).items():
        for node in ast.walk(ast.parse(text)) if name.endswith(".py") else ():
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", "")]
            assert not {"pickle", "cPickle", "marshal", "shelve", "dill"} & {str(module).partition(".")[0] for module in modules}, name
            assert not (isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("eval", "exec")), name
