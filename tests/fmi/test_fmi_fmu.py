"""Exported FMUs: what the standard asks, what a rollback needs, and errors that leave the process alive."""

import importlib
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import get_args, get_type_hints
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from units.spring_fmu.parameters import Failure
from units.toys import BODY, SPRING, build_pair, spring_recipe

from master.fmi import licenses
from master.fmi.build import Recipe, build_fmu, bundled_package, cached_fmu
from master.fmi.cache import cache_folder
from master.fmi.description import base_unit
from master.fmu.errors import FmuError, FmuFailed, StepFailed, StepRejected
from master.fmu.instance import Fmu

FAILING = {"failure": {"above": 1e9}, "sections": [{"share": 0.5, "name": "a <b> & 'c'"}]}
FLOWS, EFFORTS = ("velocity", "angular_velocity"), ("force", "moment")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIPELAY_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module")
def files(folder):
    return build_pair(folder, **FAILING)


@pytest.fixture
def spring(files):
    with Fmu(files[0], "spring") as fmu:
        fmu.initialize({"stiffness": 2.0, "hardening": 3.0, "offset": [0.1, 0.0, -0.2]})
        yield fmu


def model(path: Path) -> ElementTree.Element:
    return ElementTree.fromstring(zipfile.ZipFile(path).read("modelDescription.xml"))


# the standard


def test_fmpy_finds_no_problems(files):
    for path in files:
        assert validate_fmu(str(path)) == []


def test_a_plain_host_runs_it(files):
    result = fmpy.simulate_fmu(str(files[1]), stop_time=1.0, output_interval=0.1, start_values={"load[1]": 2.0}, output=["position[1]"])
    assert result["position[1]"][-1] == pytest.approx(1.0)  # a = 2 m/s2 for 1 s


def test_outputs_depend_on_no_input_so_that_hosts_see_no_loop(files):
    structure = model(files[0]).find("ModelStructure")
    outputs = structure.findall("Outputs/Unknown")
    assert len(outputs) == len([v for v in model(files[0]).iter("ScalarVariable") if v.get("causality") == "output"])
    assert {unknown.get("dependencies") for unknown in outputs} == {""}
    variables = list(model(files[0]).iter("ScalarVariable"))
    for unknown in structure.findall("InitialUnknowns/Unknown"):
        assert {variables[int(i) - 1].get("causality") for i in unknown.get("dependencies").split()} == {"parameter"}


def test_variables_carry_unit_range_and_description(files):
    variables = {v.get("name"): v for v in model(files[0]).iter("ScalarVariable")}
    assert variables["force[3]"][0].attrib == {"unit": "N"}
    assert variables["stiffness"].attrib["description"] == "linear stiffness"
    assert variables["stiffness"][0].attrib == {"start": "1.0", "min": "0.0", "unit": "N/m"}
    assert variables["coils"][0].attrib == {"start": "3", "min": "1", "max": "9"}
    assert variables["failure.above"].get("variability") == "fixed"
    assert model(files[0]).find("CoSimulation").get("needsExecutionTool") == "true"  # a Python on the machine
    assert model(files[1]).get("description") == "A rigid body"


def test_a_choice_of_texts_is_an_enumeration_with_its_items(files):
    """FMI 2.0.4, 2.2.3: numbers from 1 on, names of types that are not those of variables; a host sets and gets the numbers."""
    variable = next(v for v in fmpy.read_model_description(str(files[0])).modelVariables if v.name == "failure.kind")
    assert (variable.type, variable.start, variable.declaredType.name) == ("Enumeration", "1", "failure.kind.items")
    items = [(item.name, int(item.value)) for item in variable.declaredType.items]
    assert items == list(zip(get_args(get_type_hints(Failure)["kind"]), range(1, 10), strict=True))
    with Fmu(files[0]) as fmu:
        for given, number in (("arithmetic", 2), (3, 3)):
            fmu._set_parameter("failure.kind", given)
            assert fmu._fmu.getInteger([variable.valueReference]) == [number]
        fmu.initialize({"failure.above": 0.0})
        with pytest.raises(StepFailed, match="planted bug"):  # the third
            fmu.step(0.0, 0.1)
    with zipfile.ZipFile(files[0]) as archive:
        assert "<td>failure.kind</td><td>1</td><td></td><td>message</td>" in archive.read("documentation/index.html").decode()


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("kg/m3", {"kg": 1, "m": -3}),
        ("N.s2/m2", {"kg": 1, "m": -1}),
        ("Pa", {"kg": 1, "m": -1, "s": -2}),
        ("N.m/(rad.s)", {"kg": 1, "m": 2, "s": -3, "rad": -1}),
        ("1", {}),
        ("deg", {"rad": 1, "factor": np.pi / 180}),
    ],
)
def test_units_by_base_exponents(unit, exponents):
    assert base_unit(unit) == exponents


def test_unknown_unit_is_refused_at_export():
    with pytest.raises(ValueError, match="is not among kg, m, s"):
        base_unit("N.furlong")


def test_archive_holds_documentation_and_icon(files):
    with zipfile.ZipFile(files[0]) as archive:
        page = archive.read("documentation/index.html").decode()
        assert archive.read("model.png")[:8] == b"\x89PNG\r\n\x1a\n"
    assert "<td>force</td><td>3</td><td>N</td>" in page
    assert "a &lt;b&gt; &amp;" in page


def test_equal_recipes_give_equal_files_and_changes_another_name(folder):
    one, two = build_fmu(SPRING, folder / "one.fmu"), build_fmu(SPRING, folder / "two.fmu")
    with zipfile.ZipFile(one) as a, zipfile.ZipFile(two) as b:
        different = [name for name in a.namelist() if a.read(name) != b.read(name)]
    assert different in ([], ["modelDescription.xml"])  # the date of generation, if a second passed
    made = cached_fmu(SPRING, folder)
    before = made.stat().st_ino
    assert cached_fmu(Recipe(SPRING.package, SPRING.unit, {}, "Six springs"), folder) == made
    assert made.stat().st_ino == before
    assert cached_fmu(spring_recipe(stiffness=2.0), folder) != made


def test_exported_defaults_are_what_was_baked_in(folder):
    path = build_fmu(spring_recipe(stiffness=7.0, offset=[1.0, 0.0, 0.0]), folder / "baked.fmu")
    with Fmu(path) as fmu:
        fmu.initialize()
        assert fmu.get("force").tolist() == [-7.0, 0.0, 0.0]


def test_configuration_replaces_the_defaults_and_single_parameters_override_it(files):
    with Fmu(files[0]) as fmu:
        fmu.initialize({"configuration": '{"stiffness":5.0,"offset":[2,0,0],"failure":{}}', "offset": [3.0, 0.0, 0.0]})
        assert fmu.get("force").tolist() == [-15.0, 0.0, 0.0]


def test_output_is_defined_in_initialisation_mode(files):
    with Fmu(files[0]) as fmu:
        fmu._fmu.setupExperiment()
        fmu._fmu.enterInitializationMode()
        fmu._fmu.setReal(fmu.port("offset").references, [2.0, 0.0, 0.0])
        assert fmu.get("force")[0] == -2.0
        fmu._fmu.setReal(fmu.port("offset").references, [3.0, 0.0, 0.0])
        assert fmu.get("force")[0] == -3.0


def test_bundled_package_is_the_one_the_fmu_runs(files):
    package = bundled_package(files[0])
    with Fmu(files[0]) as fmu:
        fmu.initialize()
        assert sys.modules[package.__name__] is package
    assert importlib.import_module(f"{package.__name__}.slave").SpringUnit.NAME == "spring"


# state


def walk(fmu: Fmu, count: int, start: float = 0.0) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    seen = []
    for i in range(count):
        fmu.set(FLOWS, rng.normal(size=6))
        fmu.step(start + 0.1 * i, 0.1)
        seen.append(fmu.get((*EFFORTS, "impedance", "top_work", "stretch")))
    return seen


def test_rollback_is_bitwise(spring):
    state = spring.snapshot()
    first = walk(spring, 5)
    for _ in range(3):
        spring.restore(state)
        np.testing.assert_array_equal(walk(spring, 5), first)
    spring.release(state)


def test_rollback_restores_inputs_and_time_too(spring):
    spring.set(FLOWS, np.ones(6))
    state = spring.snapshot()
    spring.step(0.0, 0.1)
    after = spring.get("stretch")
    spring.set(FLOWS, np.zeros(6))
    spring.restore(state)
    spring.step(0.0, 0.1)
    np.testing.assert_array_equal(spring.get("stretch"), after)


def test_serialised_state_continues_bitwise_in_another_instance(spring, files):
    walk(spring, 3)
    data = spring.serialize(spring.snapshot())
    expected = walk(spring, 3, 0.3)
    with Fmu(files[0]) as other:
        other.initialize()
        other.restore(other.deserialize(data))
        np.testing.assert_array_equal(walk(other, 3, 0.3), expected)
        with pytest.raises(FmuFailed, match="state: cannot be read back"):
            other.restore(other.deserialize(data[:-9]))


def test_instances_of_one_process_do_not_meet(files):
    with Fmu(files[0], "soft") as soft, Fmu(files[0], "hard") as hard:
        soft.initialize({"stiffness": 1.0, "offset": [1, 0, 0]})
        hard.initialize({"stiffness": 9.0, "offset": [1, 0, 0]})
        walk(soft, 2)
        assert hard.get("force")[0] == -9.0


def test_a_rebuilt_unit_runs_its_new_code_beside_the_old(folder, files):
    copy = shutil.copytree(SPRING.package, folder / "spring_fmu", ignore=shutil.ignore_patterns("__pycache__"))
    source = (copy / "slave.py").read_text()
    (copy / "slave.py").write_text(source.replace("-p.gain * s.mean_force", "-1000 * s.mean_force"))
    rebuilt = build_fmu(Recipe(copy, SPRING.unit, {}), folder / "rebuilt.fmu")
    with Fmu(files[0]) as old, Fmu(rebuilt) as new:
        for fmu in (old, new):
            fmu.initialize({"offset": [1.0, 0.0, 0.0]})
        assert (old.get("force")[0], new.get("force")[0]) == (-1.0, -1000.0)


# errors


def test_a_failed_step_is_a_discard_with_the_units_words_and_changes_nothing(files):
    with Fmu(files[0], "spring") as fmu:
        fmu.initialize({"failure.above": 0.2})
        fmu.set(FLOWS, np.ones(6))
        with pytest.raises(StepRejected, match=r"^spring: step of 0.5 s at 0 s: planted failure: .* 50 % left$"):
            fmu.step(0.0, 0.5)
        assert fmu.get("stretch").tolist() == [0.0] * 6
        fmu.step(0.0, 0.2)
        assert fmu.get("stretch")[0] == pytest.approx(0.2)


def test_broken_arithmetic_is_a_failed_step_and_a_bug_is_not(files):
    for kind, error in (("arithmetic", StepRejected), ("bug", StepFailed)):
        with Fmu(files[0]) as fmu:
            fmu.initialize({"failure.above": 0.0, "failure.kind": kind})
            for _ in range(3):  # PythonFMU alone would not survive the second
                with pytest.raises(error, match=r"planted .*slave.py, line \d+"):
                    fmu.step(0.0, 0.1)


WRONG_STEPS = {
    r"step of -0.1 s at 0.0 s: must be finite, and the step > 0 s": lambda fmu: fmu.step(0.0, -0.1),
    r"step of 0.0 s at 0.0 s: must be finite": lambda fmu: fmu.step(0.0, 0.0),
    r"step of nan s at 0.0 s: must be finite": lambda fmu: fmu.step(0.0, np.nan),
    r"step of inf s at 0.0 s: must be finite": lambda fmu: fmu.step(0.0, np.inf),
    r"step of 0.1 s at nan s: must be finite": lambda fmu: fmu.step(np.nan, 0.1),
    r"time = 3.0: the FMU stands at 0.0 s": lambda fmu: fmu.step(3.0, 0.1),
    r"velocity\[2\] = nan: must be finite": lambda fmu: (fmu.set("velocity", [0, np.nan, 0]), fmu.step(0.0, 0.1)),
    r"angular_velocity\[1\] = inf: must be": lambda fmu: (fmu.set("angular_velocity", [np.inf, 0, 0]), fmu.step(0, 0.1)),
    r"stiffness = 3.0: a parameter cannot be set after init": lambda fmu: fmu.set("stiffness", 3.0),
    r"force\[1\] = 1.0: an output cannot be set": lambda fmu: fmu.set("force", [1.0, 2.0, 3.0]),
    r"has no port 'nonsense'; inputs and outputs: velocity,": lambda fmu: fmu.get("nonsense"),
}


@pytest.mark.parametrize("message", WRONG_STEPS)
def test_a_wrong_call_is_refused_twice_and_the_fmu_lives(spring, message):
    for _ in range(2):
        with pytest.raises(FmuError, match=message):
            WRONG_STEPS[message](spring)
    spring.set(FLOWS, np.zeros(6))
    spring.step(0.0, 0.1)


WRONG_STARTS = {
    "stiffness = -1.0: must be >= 0 N/m": {"stiffness": -1.0},
    "stiffness = nan: must be finite": {"stiffness": float("nan")},
    "offset = .*: must be shorter than 1000 m": {"offset": [800.0, 800.0, 0.0]},
    "statics: no equilibrium at a stretch of 950 m .100 % of it.": {"offset": [950.0, 0.0, 0.0]},
    "has no parameter 'stifness'; there are stiffness,": {"stifness": 1.0},
    "offset = .*: must have 3 values": {"offset": [1.0, 2.0]},
    "coils = 2.5: must be of type Integer": {"coils": 2.5},
    "failure.kind = 12: must be one of 1 .message., 2 .arithmetic.,": {"failure.kind": 12},
    "failure.kind = 0: must be one of 1 .message., 2 .arithmetic.,": {"failure.kind": 0},
    "failure.kind = 2.5: must be one of message, arithmetic,": {"failure.kind": 2.5},
    "configuration = 'no': must be JSON": {"configuration": "no"},
    "configuration.stifness = 1: unknown key": {"configuration": '{"stifness": 1}'},
    "configuration: changes the output failing; such an FMU must be exported anew": {"configuration": "{}"},
    "failure.kind = odd: must be one of message, arithmetic,": {"failure.kind": "odd"},
    "sections = .*: must be JSON": {"sections": "[1,"},
}


@pytest.mark.parametrize("message", WRONG_STARTS)
def test_a_wrong_parameter_is_refused_in_one_line(files, message):
    with Fmu(files[0], "spring") as fmu, pytest.raises(FmuFailed, match=message) as caught:
        fmu.initialize(WRONG_STARTS[message])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("times", [(0.0, -1.0), (2.0, 1.0), (0.0, np.nan), (np.nan, 1.0), (np.inf, np.inf)])
def test_a_stop_before_the_start_and_times_that_are_no_numbers_are_refused(files, times):
    with Fmu(files[1]) as fmu, pytest.raises(FmuFailed, match=r"(start|stop) time = .*: must be"):
        fmu._call("setup", fmu._fmu.setupExperiment, startTime=times[0], stopTime=times[1])


def begun(fmu: Fmu, stop: float | None) -> None:
    fmu._fmu.setupExperiment(startTime=0.0, stopTime=stop)
    fmu._fmu.enterInitializationMode()
    fmu._fmu.exitInitializationMode()


def test_a_step_beyond_a_defined_stop_time_is_an_error_and_changes_nothing(files):
    """FMI 2.0.4, 2.1.6: past a defined stop time the FMU has to return fmi2Error; round-off of the host's sum is no step beyond."""
    with Fmu(files[1], "body") as fmu:
        begun(fmu, 1.0)
        fmu.set(EFFORTS, np.ones(6))
        time = 0.0
        for _ in range(10):
            fmu.step(time, 0.1)
            time += 0.1
        before = fmu.get("position")
        assert before[0] == pytest.approx(0.5)
        for step in (0.1, 1e-3, 1e-6):
            with pytest.raises(StepFailed, match=r"body: step of .* step to 1.* s: the stop time is 1.0 s"):
                fmu.step(time, step)
        np.testing.assert_array_equal(fmu.get("position"), before)
    with Fmu(files[1]) as fmu:
        begun(fmu, 1.0)
        with pytest.raises(StepFailed, match=r"the stop time is 1\.0 s"):
            fmu.step(0.0, 1.0001)
        fmu.step(0.0, 1.0)
    with Fmu(files[1]) as fmu:
        begun(fmu, None)
        fmu.step(0.0, 1e6)


def test_a_state_goes_on_beyond_the_stop_time_of_the_run_that_saved_it(files):
    with Fmu(files[1]) as one, Fmu(files[1]) as two:
        begun(one, 1.0)
        begun(two, 9.0)
        one.step(0.0, 1.0)
        two.restore(two.deserialize(one.serialize(one.snapshot())))
        two.step(1.0, 8.0)
        with pytest.raises(StepFailed, match=r"the stop time is 9\.0 s"):
            two.step(9.0, 1.0)


@pytest.mark.parametrize("interval", [0.1, 0.3, 0.07])
def test_fmpy_reaches_its_stop_time_whatever_its_interval(files, interval):
    wanted = {"start_values": {"load[1]": 2.0}, "output": ["position[1]"]}
    result = fmpy.simulate_fmu(str(files[1]), stop_time=1.0, output_interval=interval, **wanted)
    assert result["time"][-1] == pytest.approx(1.0)
    assert result["position[1]"][-1] == pytest.approx(1.0)


@pytest.mark.parametrize("count", [200, 20_000])
def test_a_step_however_short_is_taken_at_a_time_that_differs_by_round_off(files, count):
    """Steps of 0.05 s add up to 10.000000000000002 s, and to 1000 s less 4e-10 s; then the host asks for the round time."""
    with Fmu(files[1]) as fmu:
        fmu.initialize(inputs={"force": [1.0, 0.0, 0.0]})
        time = 0.0
        for _ in range(count):
            fmu.step(time, 0.05)
            time += 0.05
        assert time != 0.05 * count
        before = fmu.get("velocity")[0]
        fmu.step(0.05 * count, 1e-9)
        fmu.step(0.05 * count + 1e-9, 0.05)
        assert fmu.get("velocity")[0] - before == pytest.approx(0.05, rel=1e-6)
        with pytest.raises(StepRejected, match="the FMU stands at"):
            fmu.step(0.05 * count + 0.051, 1e-9)


def test_step_before_initialisation_is_refused(files):
    with Fmu(files[0]) as fmu, pytest.raises(StepRejected, match="step at 0 s: the FMU is not initialised"):
        fmu.step(0.0, 0.1)


def test_no_file_and_no_fmu_are_refused(tmp_path):
    (tmp_path / "text.fmu").write_text("not a zip archive")
    for name in ("text.fmu", "absent.fmu"):
        with pytest.raises(FmuFailed, match=f"{name}: not a readable FMU"):
            Fmu(tmp_path / name)


# processes


PROGRAM = """
import sys, glob
from master.fmu.errors import FmuFailed
from master.fmu.instance import Fmu
fmus = [Fmu(sys.argv[1], f"s{i}") for i in range(6)]
for fmu in fmus:
    for _ in range(3):
        try:
            fmu.initialize({"stiffness": -1.0})
        except FmuFailed as error:
            assert "must be >= 0" in str(error)
for fmu in fmus[:5]:
    fmu.close()
with Fmu(sys.argv[1]) as fmu:
    fmu.initialize({"compiled": True, "hardening": 1.0, "offset": [1, 0, 0]})
    kernel = next(module for name, module in sys.modules.items() if name.endswith(".kernel"))
    stats = kernel.cubic_mean.stats
    print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), kernel.__file__)
"""


def test_compiled_kernels_are_found_again_and_the_process_survives_every_refusal(files, tmp_path):
    environment = {**os.environ, "PIPELAY_CACHE": str(tmp_path)}
    command = [sys.executable, "-c", PROGRAM, str(files[0])]
    runs = [subprocess.run(command, env=environment, capture_output=True, text=True, check=True) for _ in range(2)]
    (hits, misses, place), (hits_again, misses_again, same) = (run.stdout.split() for run in runs)
    assert (hits, misses, hits_again, misses_again) == ("0", "1", "1", "0")
    assert place == same
    assert place.startswith(str(tmp_path))
    assert [run.stderr for run in runs] == ["", ""]


@pytest.mark.parametrize("home", [True, False])
def test_an_unwritable_cache_is_no_obstacle_and_builder_and_fmu_go_to_the_same_place(files, tmp_path, monkeypatch, home):
    """A file in the way, of the whole place or of one kind of files: root may write to what is read-only."""
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "units").write_text("in the way")
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("PIPELAY_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path / ("home" if home else "file")))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)  # to be found anew
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(files[0])], capture_output=True, text=True)
    assert done.returncode == 0
    place = tmp_path / "home" / ".cache" / "pipelay" if home else tmp_path / f"pipelay-{os.getuid()}"
    assert str(place / "units") in done.stdout
    assert cache_folder("units") == place / "units"
    assert cache_folder("fmus") == tmp_path / "cache" / "fmus"



def test_licence_files_are_taken_and_modules_of_such_a_name_are_not(tmp_path, monkeypatch):
    texts = {"notched/licenses.py": "", "notched/NOTICE.txt": "seen", "notched-1.dist-info/licenses/LICENSE": "free",
             "notched-1.dist-info/METADATA": "Name: notched\nVersion: 1\n"}  # fmt: skip
    for name, text in (texts | {"notched-1.dist-info/RECORD": "".join(f"{name},,\n" for name in texts)}).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    taken = {path.rpartition("/")[2]: text for path, text in licenses.of_package("notched").items()}
    assert taken == {"notched_NOTICE.txt": b"seen", "notched-1.dist-info_licenses_LICENSE": b"free"}


def test_building_and_running_in_one_process_leaves_the_import_path_alone(folder):
    before = list(sys.path)
    build_fmu(BODY, folder / "again.fmu")
    assert sys.path == before
