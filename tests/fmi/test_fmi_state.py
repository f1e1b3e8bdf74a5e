"""State, life and description of the real units: what a rollback, a move to another process, and many lives must leave as it was, and
that what an exported FMU says of itself is so."""

import gc
import importlib
import os
import runpy
import subprocess
import sys
import time
import weakref
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import c_host
import fmpy
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd
from fmpy.validation import validate_fmu
from numba import types

import pipe_fmu
from master.__main__ import main
from master.fmi.build import Recipe, build_fmu, bundled_package
from master.fmi.description import base_unit
from master.fmi.system import CHANGES, OMS, SSC, SSD, WIRES, Wire
from master.fmu.errors import FmuFailed
from master.fmu.instance import Fmu
from pipe_fmu.step.state import PipeState

STEP = 0.1
UNITS = ("pipe", "vessel")
LIVES = 50
MODERATE = {"velocity": 0.5, "angular_velocity": 0.02, "force": 1e5, "moment": 1e5}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("with spaces")
    assert main(["export", "-o", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def by_python(tmp_path_factory):
    folder = tmp_path_factory.mktemp("by python")
    assert main(["export", "--python", "-o", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    parameters = {"nodes": 6, "mesh": "uniform", "foot": "pinned", "top": "pinned"}
    return build_fmu(Recipe(Path(pipe_fmu.__file__).parent, "slave.PipeUnit", parameters), tmp_path_factory.mktemp("small") / "pipe.fmu")


def walk(fmu: Fmu, start: int, count: int) -> list[np.ndarray]:
    """All outputs after each of `count` steps under inputs that follow from the step's number."""
    seen = []
    for i in range(start, start + count):
        rng = np.random.default_rng(i)
        for name in (name for name in MODERATE if name in fmu.names("input")):  # in one order in every process
            fmu.set(name, MODERATE[name] * rng.normal(size=3))
        fmu.step(STEP * i, STEP)
        seen.append(fmu.get(tuple(fmu.names("output"))))
    return seen


@pytest.mark.parametrize("unit", UNITS)
def test_a_rollback_repeats_every_output_to_the_last_bit(exported, unit):
    with Fmu(exported / f"{unit}.fmu") as fmu:
        fmu.initialize()
        walk(fmu, 0, 3)
        state = fmu.snapshot()
        first = walk(fmu, 3, 4)
        for _ in range(2):
            walk(fmu, 7, 2)
            fmu.restore(state)
            np.testing.assert_array_equal(walk(fmu, 3, 4), first)


PROGRAM = """
import sys
from test_fmi_state import Fmu, walk
with Fmu(sys.argv[1]) as fmu:
    fmu.initialize()
    if sys.argv[3] == "write":
        walk(fmu, 0, 3)
        with open(sys.argv[2], "wb") as file:
            file.write(fmu.serialize(fmu.snapshot()))
    else:
        with open(sys.argv[2], "rb") as file:
            fmu.restore(fmu.deserialize(file.read()))
    print([row.tobytes().hex() for row in walk(fmu, 3, 3)])
"""


@pytest.mark.parametrize("unit", UNITS)
def test_a_serialised_state_goes_on_in_a_new_process_to_the_last_bit(exported, unit, tmp_path):
    environment = {**os.environ, "PYTHONPATH": f"{Path(__file__).parent}{os.pathsep}{Path(__file__).parents[1] / 'support'}"}
    command = [sys.executable, "-c", PROGRAM, str(exported / f"{unit}.fmu"), str(tmp_path / "state")]
    one, two = (subprocess.run([*command, what], env=environment, capture_output=True, text=True, check=True) for what in ("write", "read"))
    assert len(one.stdout) > 1000
    assert one.stdout == two.stdout


def test_a_state_costs_a_small_part_of_a_step(exported):
    """Get, set and free of the paper's pipe: 8 us against steps of 200 us, so that rolling back is no reason to do without."""
    states, steps = [], []
    with Fmu(exported / "pipe.fmu") as fmu:
        fmu.initialize()
        for i in range(300):
            began = time.perf_counter()
            state = fmu.snapshot()
            fmu.restore(state)
            fmu.release(state)
            between = time.perf_counter()
            fmu.step(STEP * i, STEP)
            states.append(between - began)
            steps.append(time.perf_counter() - between)
    assert np.median(states) < 0.2 * np.median(steps)


def test_instances_of_two_exports_keep_apart_in_one_process(exported, small):
    with Fmu(exported / "pipe.fmu", "a") as a, Fmu(exported / "pipe.fmu", "b") as b, Fmu(small, "c") as c:
        for fmu in (a, b, c):
            fmu.initialize()
        first = walk(a, 0, 4)
        for i in range(4):
            np.testing.assert_array_equal(walk(b, i, 1)[0], first[i])
            walk(c, i, 1)
        assert c.port("node_tension").size == 6 != a.port("node_tension").size


def test_pipes_of_two_packages_are_two_types_to_the_compiler(by_python):
    """Else a kernel compiled where an FMU was first would be kept with the FMU's type in it, and fail in processes without the FMU."""
    bundled = importlib.import_module(f"{bundled_package(by_python / 'pipe.fmu').__name__}.step.state")
    tuples = []  # alive together: numba lets equal names be one type
    for cls in (bundled.PipeState, PipeState):
        state = types.NamedTuple([types.float64] * len(cls._fields), cls)
        tuples.append(types.Tuple([types.boolean, state]))
        assert state in tuples[-1].dtype.types


@pytest.mark.parametrize("unit", UNITS)
def test_many_lives_of_an_instance_hold_memory(small, exported, unit):
    """Blocks of Python's memory tell a leak of one object a life; the resident memory what else was not given back."""

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def live() -> tuple[int, int]:
        for _ in range(LIVES):
            with Fmu(small if unit == "pipe" else exported / "vessel.fmu") as fmu:
                fmu.initialize()
                state = fmu.snapshot()
                walk(fmu, 0, 2)
                fmu.restore(state)
                fmu._fmu.reset()
                fmu.initialize()
                fmu._fmu.terminate()
        gc.collect()
        return sys.getallocatedblocks(), resident()

    live()  # tables and arenas take their size, with room for what the host's own garbage is between two collections
    rounds = np.array([live() for _ in range(4)])
    blocks, memory = np.diff(rounds, axis=0).min(axis=0)  # a leak shows in every round, an arena more of the process in one
    assert blocks < LIVES * 4
    assert memory < LIVES * 8e3  # bytes


@pytest.mark.parametrize("unit", UNITS)
def test_an_instance_is_gone_when_it_is_let_go(by_python, unit, tmp_path):
    """It holds no reference to itself: a process with many lives does not grow until its garbage collector comes."""
    resources = str(c_host.unpacked(by_python / f"{unit}.fmu", tmp_path / "unit") / "resources")
    server = runpy.run_path(f"{resources}/runtime.py")["load"](resources).__self__
    slave = server.slave_class(instance_name="it", resources=resources, visible=False)
    gc.disable()
    try:
        slave.setup_experiment(0.0)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        state = slave._get_fmu_state()
        assert slave.do_step(0.0, STEP)
        slave.get_real([i for i, variable in enumerate(slave.variables()) if variable.causality == "output" and variable.kind == "Real"])
        slave._set_fmu_state(state)
        living = weakref.ref(slave)
        del slave
        assert living() is None
    finally:
        gc.enable()


# what it says of itself


@pytest.mark.parametrize("unit", UNITS)
def test_the_description_is_complete_and_no_problems_are_found(exported, unit):
    """FMI 2.0.4, 2.2: who made it and when; every variable explained, every number with its unit, every port with its size."""
    path = exported / f"{unit}.fmu"
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        model = ElementTree.fromstring(archive.read("modelDescription.xml"))
        page = archive.read("documentation/index.html").decode()
    assert all(model.get(key) for key in ("author", "license", "version", "generationDateAndTime", "generationTool", "description"))
    variables = list(model.iter("ScalarVariable"))
    assert [v.get("name") for v in variables if not v.get("description") or not v.get("variability")] == []
    numbers = [(v, v[0]) for v in variables if v[0].tag == "Real"]
    assert [v.get("name") for v, kind in numbers if not kind.get("unit")] == []
    scaled = {"N", "N.m", "m", "m/s", "rad/s", "rad", "J", "Pa"}
    ports = [(v, kind) for v, kind in numbers if v.get("causality") != "parameter" and kind.get("unit") in scaled]
    assert [v.get("name") for v, kind in ports if not float(kind.get("nominal", 0.0)) > 0.0] == []
    for heading in ("Equations", "Limits of validity", "Inputs", "Outputs", "Parameters"):
        assert f">{heading}</h" in page
    assert all(f"<td>{v.get('name').partition('[')[0]}" in page for v in variables)


@pytest.mark.parametrize("unit", UNITS)
def test_matrices_of_mixed_units_have_those_of_their_blocks(exported, unit):
    """A row times what it is multiplied with has the unit of the answer: mobility m/s and rad/s per N and N.m, impedance the reverse."""
    units = {v.name: v.unit for v in fmpy.read_model_description(str(exported / f"{unit}.fmu")).modelVariables}
    flow, effort = ("m/s", "rad/s"), ("N", "N.m")
    named = {"mobility": (flow, effort)} | ({"impedance": (effort, flow)} if unit == "pipe" else {})
    for name, (answers, causes) in named.items():
        for i in range(6):
            for j in range(6):
                given, answer, cause = (base_unit(it) for it in (units[f"{name}[{6 * i + j + 1}]"], answers[i // 3], causes[j // 3]))
                product = {key: given.get(key, 0) + cause.get(key, 0) for key in given | cause}
                assert {key: power for key, power in product.items() if power} == answer, (name, i, j)


def test_both_ends_of_a_bond_have_one_nominal_value(exported):
    """What one end gives has the nominal value of what the other takes."""
    nominal = {}
    for unit in UNITS:
        variables = fmpy.read_model_description(str(exported / f"{unit}.fmu")).modelVariables
        nominal[unit] = {v.name: float(v.nominal) for v in variables if v.causality != "parameter" and v.nominal}
    means = (Wire("vessel", name, "pipe", name) for name in ("velocity", "angular_velocity"))
    pairs = [*WIRES, *CHANGES, *means]
    for source, output, target, taken in pairs:
        for i in (1, 2, 3):
            assert nominal[source][f"{output}[{i}]"] == nominal[target][f"{taken}[{i}]"]


@pytest.mark.parametrize("unit", UNITS)
def test_an_fmu_run_by_python_holds_the_binary_of_linux_alone_and_an_entry_to_its_licences(by_python, unit):
    """FMI 2.0.4, 2.3. PythonFMU's library for Windows cannot load without a Python of its version on the path."""
    with zipfile.ZipFile(by_python / f"{unit}.fmu") as archive:
        names = archive.namelist()
        entry = archive.read("documentation/licenses/license.txt").decode()
    assert {name.split("/")[1] for name in names if name.startswith("binaries/")} == {"linux64"}
    assert entry.startswith(f"{unit.capitalize()}: MIT, ")
    folders = {name.split("/")[2] for name in names if name.startswith("documentation/licenses/")} - {"license.txt"}
    assert folders == {"pipelay", "pythonfmu"}


def test_the_ssp_tells_omsimulator_its_fixed_step(exported):
    """OMSimulator reads the step and the kind of master from its own annotation of the system alone."""
    with zipfile.ZipFile(exported / "system.ssp") as archive:
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
    spaces = {"ssd": SSD, "ssc": SSC, "oms": OMS}
    path = "ssd:System/ssd:Annotations/ssc:Annotation[@type='org.openmodelica']/oms:Annotations/oms:SimulationInformation/"
    assert float(root.find(f"{path}oms:FixedStepMaster", spaces).get("stepSize")) == STEP  # s, the macro step of the paper's scene
    order = [child.tag.partition("}")[2] for child in root.find("ssd:System", spaces)]
    assert order == ["Elements", "Connections", "Annotations"]  # as the schema has them
    assert read_ssd(str(exported / "system.ssp")).system.connections


@pytest.mark.parametrize("unit", UNITS)
def test_outputs_keep_to_their_ranges_and_sizes(exported, unit):
    """Ranges hold throughout; the largest value of a kind of output is not a thousand times its nominal one."""
    variables = [v for v in fmpy.read_model_description(str(exported / f"{unit}.fmu")).modelVariables if v.causality == "output"]
    low, high, nominal = (
        np.array([float(getattr(v, key) or otherwise) for v in variables])
        for key, otherwise in (("min", -np.inf), ("max", np.inf), ("nominal", np.inf))
    )
    with Fmu(exported / f"{unit}.fmu") as fmu:
        fmu.initialize()
        seen = np.array(walk(fmu, 0, 20))
    assert (seen >= low).all()
    assert (seen <= high).all()
    assert (np.abs(seen) < 1e3 * nominal).all()


def test_corrections_are_counted_by_a_discrete_integer(exported):
    model = fmpy.read_model_description(str(exported / "pipe.fmu"))
    variable = next(v for v in model.modelVariables if v.name == "newton_iterations")
    assert (variable.type, variable.variability, variable.initial, variable.min) == ("Integer", "discrete", "calculated", "0")
    assert (variable.unit, variable.nominal) == (None, None)  # as FMI has integers
    others = [v for v in model.modelVariables if v.causality == "output" and v.name != "newton_iterations"]
    assert {(v.type, v.variability) for v in others} == {("Real", "continuous")}
    with Fmu(exported / "pipe.fmu") as fmu:
        fmu.initialize()
        assert fmu.get("newton_iterations") == [0.0]
        fmu.set("velocity", [0.2, -0.1, 0.3])
        fmu.step(0.0, STEP)
        [count] = fmu._fmu.getInteger([variable.valueReference])
        assert 1 <= count <= 20
        mixed = fmu.get(("pipe_length", "newton_iterations", "newton_residual"))
        np.testing.assert_array_equal(mixed, [fmu.get("pipe_length")[0], count, fmu.get("newton_residual")[0]])
        assert fmu._fmu.getReal([variable.valueReference]) == list(fmu.get("newton_iterations"))  # CoFmuPy reads every output so


@pytest.mark.parametrize("kind", ["machine code", "by Python"])
def test_what_it_says_it_can_do_it_can(exported, by_python, kind):
    """Steps of any length meet at one place; state as in the tests above; what is not offered is refused, not done badly."""
    folder = exported if kind == "machine code" else by_python
    for unit in UNITS:
        model = fmpy.read_model_description(str(folder / f"{unit}.fmu")).coSimulation
        assert (model.canHandleVariableCommunicationStepSize, model.canGetAndSetFMUstate, model.canSerializeFMUstate) == (True,) * 3
        assert (model.canInterpolateInputs, model.providesDirectionalDerivative) == (False,) * 2
        assert model.needsExecutionTool == (kind == "by Python")
        assert (model.canBeInstantiatedOnlyOncePerProcess, model.canRunAsynchronuously, model.maxOutputDerivativeOrder) == (False, False, 0)
    with Fmu(folder / "pipe.fmu") as fmu:
        fmu.initialize()
        start, velocity, time = fmu.get("top_position"), np.array([0.2, -0.1, 0.3]), 0.0
        fmu.set("velocity", velocity)
        for step in (0.1, 0.013, 0.4, 1e-3, 0.25):
            fmu.step(time, step)
            time += step
            np.testing.assert_allclose(fmu.get("top_position"), start + velocity * time, atol=1e-11)
        with pytest.raises(FmuFailed, match="directional derivatives: not offered"):
            fmu.derivatives("force", "velocity")


@pytest.mark.parametrize("unit", UNITS)
def test_a_nanosecond_is_a_step_at_a_time_that_differs_by_round_off(exported, unit):
    """200 steps of 0.05 s add up to 10.000000000000002 s; the host goes on at 10 s."""
    with Fmu(exported / f"{unit}.fmu") as fmu:
        fmu.initialize()
        time = 0.0
        for _ in range(200):
            fmu.step(time, 0.05)
            time += 0.05
        assert time > 10.0
        before = fmu.get(tuple(name for name in fmu.names("output") if name.endswith(("position", "quaternion"))))
        fmu.step(10.0, 1e-9)
        after = fmu.get(tuple(name for name in fmu.names("output") if name.endswith(("position", "quaternion"))))
        np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-8)  # m: slower than 10 m/s


def test_the_vessel_starts_with_the_pull_of_the_pipe_so_that_both_rest_where_nothing_is_connected(exported):
    with Fmu(exported / "pipe.fmu") as pipe, Fmu(exported / "vessel.fmu") as vessel:
        pipe.initialize()
        vessel.initialize()
        pull = pipe.get(("force", "moment"))
        np.testing.assert_allclose(vessel.get(("force", "moment")), pull, rtol=0.0, atol=1e-9 * np.abs(pull).max())
        np.testing.assert_allclose(pipe.get(("force_change", "moment_change")), 0.0, rtol=0.0, atol=1e-9 * np.abs(pull).max())
        before = vessel.get("hang_off_position")
        for i in range(10):
            vessel.step(STEP * i, STEP)
        np.testing.assert_allclose(vessel.get("hang_off_position"), before, rtol=0.0, atol=1e-9)


def test_a_change_of_the_pull_is_added_to_it_and_counted_from_the_start(exported):
    """Whole pull on one vessel, start values and change on another: the same motion, of another pipe than the exported one too."""
    with Fmu(exported / "pipe.fmu") as pipe, Fmu(exported / "vessel.fmu", "a") as whole, Fmu(exported / "vessel.fmu", "b") as changed:
        pipe.initialize({"section.contents_density": 200.0})
        for vessel in (whole, changed):
            vessel.initialize()
        at_rest = changed.get(("force", "moment"))
        pipe.set("velocity", [0.3, 0.1, -0.2])
        for i in range(5):
            pipe.step(STEP * i, STEP)
            pull, change = pipe.get(("force", "moment")), pipe.get(("force_change", "moment_change"))
            np.testing.assert_allclose(at_rest + change, pull, rtol=0.0, atol=1e-14 * np.abs(pull).max())
            whole.set(("force", "moment"), pull)
            changed.set(("force_change", "moment_change"), change)
            for vessel in (whole, changed):
                vessel.step(STEP * i, STEP)
            np.testing.assert_allclose(changed.get("hang_off_position"), whole.get("hang_off_position"), rtol=0.0, atol=1e-11)
        assert np.abs(change).max() > 1e3
