"""FMUs in machine code: call by call the same as those run by Python, in a host without anything else, on Windows, from bytes of another
process."""

import json
import os
import resource
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import c_host
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from toy_face import compiled

from master.__main__ import main
from master.fmi.native import windows, zig
from master.fmu.errors import FmuFailed, StepRejected
from master.fmu.instance import Fmu
from master.run.prepared import prepare
from master.scene import reading

SUPPORT = Path(__file__).parents[1] / "support"
UNITS = ("pipe", "vessel")
GLIBC = ("libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0", "librt.so.1", "libutil.so.1")
ALL = [
    "pipe.added_mass={}", "pipe.seabed={friction=0.5}", "pipe.internal_damping=0.01", "pipe.numerical_damping=0.05",
    "pipe.section.yield_stress=450e6", "pipe.section.contents_density=800", "pipe.max_substeps=9", "start.x=810",
]  # fmt: skip
SNAP = ["top_motion.amplitude=[0.0, 0.0, 6.0]", "top_motion.period=8.0"]


def drawn(number):
    """Changes of the paper's scene, line number `number` always the same."""
    random = np.random.default_rng(number)
    return [
        f"pipe.nodes={random.integers(8, 40)}",
        f"pipe.section.wall_thickness={random.uniform(0.015, 0.03):.6f}",
        f"environment.current.velocity=[{random.uniform(-0.5, 0.5):.3f}, {random.uniform(-1, 1):.3f}, 0.0]",
        f"start.x={random.uniform(760, 830):.3f}",
        f"vessel.controller.period={random.choice([0.25, 0.4, 0.7])}",
        "vessel.controller.start=1.0",
        "environment.current.start=0.5",
    ]


SCENES = {
    "paper": ("paper", ["vessel.controller.start=1", "environment.current.start=0.5"]),
    "pipelay": ("pipelay", []),
    "heave": ("heave", []),
    "snap": ("heave", SNAP),
    "free-decay": ("free-decay", []),
    "all physics": ("paper", ALL),
    **{f"random {number}": ("paper", drawn(number)) for number in range(3)},
}
LOOSE = {"newton_residual": np.inf}  # round-off itself


def load(name):
    scene, changes = SCENES[name]
    return reading.load(scene, changes)


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    return c_host.compiled(tmp_path_factory.mktemp("host"))


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    assert main(["export", "-o", str(folder)]) == 0
    return folder


def shaken(fmus, unit, k):
    """Set the same inputs in all `fmus`."""
    push = np.array([0.3 * np.sin(0.7 * k), 0.1, 0.4 * np.cos(0.5 * k)])
    loads = {"force": 1e6 * push, "environment_moment": 1e7 * push}
    held = {"velocity": push, "angular_velocity": 0.01 * push} if unit == "pipe" else loads
    for fmu in fmus:
        for name, value in held.items():
            fmu.set(name, value)


class Scales:
    """What differences are measured by: the largest value that a port has had, and, for those that are zero but for round-off, the last
    digits of the largest value of all ports of its unit of measure.
    """

    def __init__(self):
        self.ports, self.units = {}, {}

    def allowed(self, port, value):
        size = float(np.abs(value).max())
        largest = self.ports[port.name] = max(size, self.ports.get(port.name, 0.0))
        of_unit = self.units[port.unit] = max(size, self.units.get(port.unit, 0.0))
        return LOOSE.get(port.name, 1e-9) * largest + 1e-12 * of_unit


def agree(one, other, names, scales, what):
    for _ in range(2):  # the scales first
        allowed = {name: scales.allowed(other.port(name), other.get(name)) for name in names}
    for name in names:
        assert np.abs(one.get(name) - other.get(name)).max() <= allowed[name], f"{name} {what}"


@pytest.fixture(scope="module")
def both_kinds():
    """For every scene its FMUs in machine code and those run by Python."""
    mappings = json.dumps([load(name).mapping for name in SCENES], default=str)
    fmus = []
    for kind in ([], ["--python"]):
        command = [sys.executable, "-P", str(SUPPORT / "prepare_many.py"), *kind]
        done = subprocess.run(command, input=mappings, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        fmus.append(json.loads(done.stdout))
    return dict(zip(SCENES, zip(*fmus, strict=True), strict=True))


@pytest.mark.parametrize("name", SCENES)
def test_call_by_call_it_is_the_fmu_run_by_python(name, both_kinds):
    native, python = both_kinds[name]
    for unit in native:
        with Fmu(native[unit]) as ours, Fmu(python[unit]) as theirs:
            both, scales = (ours, theirs), Scales()
            assert ours.ports.keys() == theirs.ports.keys()
            for fmu in both:
                fmu.initialize()
            assert ours.remark == theirs.remark
            for k in range(25):
                agree(ours, theirs, theirs.names("output"), scales, f"of {unit} at step {k}")
                shaken(both, unit, k)
                for fmu in both:
                    fmu.step(0.1 * k, 0.1)
                assert ours.remark == theirs.remark
            if unit == "pipe":
                words = []
                for fmu in both:
                    fmu.set("velocity", [0.0, 0.0, 900.0])
                    state = fmu.snapshot()
                    with pytest.raises(StepRejected) as refused:
                        fmu.step(2.5, 10.0)
                    words.append(str(refused.value).partition(", residual")[0].replace("Pipe", ""))
                    fmu.restore(state)
                assert words[0] == words[1]


WRONG = {
    "an unknown time": lambda fmu: fmu.step(7.0, 0.1),
    "a step of no length": lambda fmu: fmu.step(0.0, 0.0),
    "a step of NaN": lambda fmu: fmu.step(0.0, float("nan")),
    "initialising twice": lambda fmu: fmu.initialize(),
    "a parameter too late": lambda fmu: fmu._set_parameter("environment.depth", 700.0),
    "an output set": lambda fmu: fmu._call("set", fmu._fmu.setReal, [fmu.port(fmu.names("output")[0]).references[0]], [1.0]),
    "a wrong reference": lambda fmu: fmu._call("get", fmu._fmu.getReal, [10**6]),
    "a text asked for as a number": lambda fmu: fmu._call("get", fmu._fmu.getReal, fmu.port("configuration").references),
    "an input that is not finite": lambda fmu: (fmu.set(fmu.names("input")[0], float("nan")), fmu.step(0.0, 0.1)),
}


@pytest.mark.parametrize("unit", UNITS)
def test_what_is_wrong_is_answered_in_the_same_words(unit):
    scene = load("paper")
    said = []
    for kind in ([], ["--python"]):
        with Fmu(prepare(scene, kind)[unit]) as fmu:
            fmu.initialize()
            words = []
            for wrong in WRONG.values():
                with pytest.raises((FmuFailed, StepRejected)) as refused:
                    wrong(fmu)
                words.append((type(refused.value).__name__, str(refused.value)))
            said.append(words)
    for what, ours, theirs in zip(WRONG, *said, strict=True):
        assert ours == theirs, what


@pytest.mark.parametrize("unit", UNITS)
def test_a_fixed_parameter_is_refused_by_name_and_a_free_one_acts(unit):
    path = prepare(load("paper"))[unit]
    with Fmu(path) as fmu, pytest.raises(FmuFailed, match=r"configuration = .*: is fixed at export; export the FMU anew with it"):
        fmu.initialize({"configuration": "{}"})
    if unit == "vessel":
        with Fmu(path) as fmu, Fmu(path) as plain:
            fmu.initialize({"controller.surge_limit": 4e5, "environment.depth": 800.0})
            plain.initialize()
            for one in (fmu, plain):
                one.set("environment_force", [-8e5, 0.0, 0.0])  # the controller answers it
                for k in range(1000):
                    one.step(0.1 * k, 0.1)
            assert abs(fmu.get("thrust")[0]) <= 4e5 < abs(plain.get("thrust")[0])
        with Fmu(path) as fmu, pytest.raises(FmuFailed, match=r"controller.period = 0: must be > 0 s"):
            fmu.initialize({"controller.period": 0.0})


CONTINUED = """
import json, sys
from master.fmu.instance import Fmu
path, data, steps = json.loads(sys.argv[1])
with Fmu(path) as fmu:
    fmu.initialize()
    fmu.restore(fmu.deserialize(bytes.fromhex(data)))
    for k in range(*steps):
        fmu.step(0.1 * k, 0.1)
    print(json.dumps({name: fmu.get(name).tolist() for name in fmu.names("output")}))
"""


@pytest.mark.parametrize("unit", UNITS)
def test_the_bytes_of_a_state_continue_in_another_process_to_the_last_bit(unit):
    path = prepare(load("paper"))[unit]
    with Fmu(path) as fmu:
        fmu.initialize()
        for k in range(10):
            shaken([fmu], unit, k)
            fmu.step(0.1 * k, 0.1)
        data = fmu.serialize(fmu.snapshot())
        for k in range(10, 20):
            fmu.step(0.1 * k, 0.1)
        command = [sys.executable, "-c", CONTINUED, json.dumps([str(path), data.hex(), [10, 20]])]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        for name, value in json.loads(done.stdout).items():
            np.testing.assert_array_equal(fmu.get(name), value, err_msg=name)
        with pytest.raises(FmuFailed, match="state"):
            fmu.deserialize(data[:-8])
    other = prepare(reading.load("paper", ["pipe.nodes=30", "vessel.metacentric_height=3"]))[unit]
    with Fmu(other) as fmu, pytest.raises(FmuFailed, match="state: of another FMU"):
        fmu.deserialize(data)


@pytest.mark.parametrize("unit", UNITS)
def test_an_export_is_sound_small_and_has_all_platforms(exported, unit):
    assert not validate_fmu(str(exported / f"{unit}.fmu"))
    names = zipfile.ZipFile(exported / f"{unit}.fmu").namelist()
    title = unit.capitalize()
    assert {f"binaries/linux64/{title}.so", f"binaries/win64/{title}.dll", f"binaries/darwin64/{title}.dylib"} <= set(names)
    assert not any(name.endswith(".py") for name in names)
    of_macos = zipfile.ZipFile(exported / f"{unit}.fmu").read(f"binaries/darwin64/{title}.dylib")
    magic, n, *parts = struct.unpack_from(">12I", of_macos)
    assert (magic, n, parts[::5]) == (0xCAFEBABE, 2, [0x01000007, 0x0100000C])  # x86-64, arm64
    for kind, _, at, size, _ in (parts[:5], parts[5:]):
        assert at % 2**14 == 0
        assert at + size <= len(of_macos)
        assert struct.unpack_from("<2I", of_macos, at) == (0xFEEDFACF, kind)
    assert any(name.startswith("documentation/licenses/pipelay/") for name in names)
    assert (exported / f"{unit}.fmu").stat().st_size < 2.2e6
    text = zipfile.ZipFile(exported / f"{unit}.fmu").read("documentation/index.html").decode()
    assert text.count("(fixed at export)") >= 1


def started(command):
    """What a host prints in an empty environment, and the CPU time [s] that it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = c_host.run(command)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert (done.returncode, done.stderr) == (0, "")
    return np.array(list(map(float, done.stdout.split()))), after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.fixture(scope="module")
def bare(tmp_path_factory, host):
    """Root of a system with the C library, the host program and nothing else."""
    chroot = shutil.which("chroot", path=f"{os.environ['PATH']}:/usr/sbin")
    if not chroot or subprocess.run([chroot, "/", "true"]).returncode:
        pytest.skip("this user may not chroot, which hides this machine's Python")
    root = tmp_path_factory.mktemp("bare root")
    listed = subprocess.run(["ldd", host], capture_output=True, text=True, check=True).stdout.split()
    library, linker = (next(word for word in listed if name in word and word[0] == "/") for name in ("/libc.so.6", "/ld-linux"))
    for path in (Path(linker), *(Path(library).with_name(name) for name in GLIBC)):
        if path.exists():
            place = root / path.relative_to("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place)
    shutil.copy(host, root / "host")
    return chroot, root


@pytest.mark.parametrize("unit", UNITS)
def test_a_c_host_in_an_empty_system_gets_what_fmpy_gets_and_starts_at_once(exported, bare, unit):
    chroot, root = bare
    port, inputs = ("force", {"velocity[3]": 0.2}) if unit == "pipe" else ("position", {"force[1]": 1e5})
    c_host.unpacked(exported / f"{unit}.fmu", root / unit)
    names = [f"{port}[{i}]" for i in (1, 2, 3)]
    command = [chroot, str(root), *c_host.command("/host", root / unit, Path("/", unit), names, inputs)]
    seen, cpu = started(command)
    with Fmu(exported / f"{unit}.fmu") as fmu:
        fmu.initialize()
        name, value = next(iter(inputs.items()))
        held = fmu.get(name.partition("[")[0])
        held[int(name[-2]) - 1] = value
        fmu.set(name.partition("[")[0], held)
        for k in range(5):
            fmu.step(0.1 * k, 0.1)
        np.testing.assert_array_equal(seen, fmu.get(port))
    assert cpu < 0.5  # s of CPU, ten steps and a start of a process with it


HOST = {"kernel32": "LoadLibraryA GetProcAddress GetStdHandle WriteFile ExitProcess"}


def header(folders):
    """couple.h for FMUs unpacked side by side, seen from the folder above them."""
    lines = ["#define STEP 0.05", "#define COUNT 400"]
    references = {}
    for unit, folder in folders.items():
        with Fmu(folder.with_suffix(".fmu")) as fmu:
            references[unit] = {name: list(port.references) for name, port in fmu.ports.items()}
            lines.append(f'#define {unit.upper()} LIBRARY("{unit}", "{unit.capitalize()}"), "{unit}/resources", "{fmu.guid}"')
    pairs = {
        "MOTION": ("vessel", ("end_velocity", "end_angular_velocity")), "MOVED": ("pipe", ("velocity", "angular_velocity")),
        "PULL": ("pipe", ("force_change", "moment_change")), "PULLED": ("vessel", ("force_change", "moment_change")),
        "WANTED": ("pipe", ("top_position", "force", "top_work", "node_moment")),
    }  # fmt: skip
    for name, (unit, ports) in pairs.items():
        lines.append(f"#define {name} {{{', '.join(str(r) for port in ports for r in references[unit][port])}}}")
    lines += [
        "#ifdef _WIN32", '#define LIBRARY(unit, name) unit "\\\\binaries\\\\win64\\\\" name ".dll"', "#else",
        '#define LIBRARY(unit, name) "./" unit "/binaries/linux64/" name ".so"', "#endif",
    ]  # fmt: skip
    return "\n".join([*lines, ""])


def test_on_windows_both_fmus_coupled_for_20_s_give_what_they_give_on_linux(exported, tmp_path):
    wine = shutil.which("wine64") or shutil.which("wine64", path="/usr/lib/wine") or shutil.which("wine")
    if wine is None:
        pytest.skip("wine64 is not installed: the Windows libraries are linked, but not run")
    folders = {unit: tmp_path / unit for unit in UNITS}
    for unit, folder in folders.items():
        shutil.copy(exported / f"{unit}.fmu", folder.with_suffix(".fmu"))
        c_host.unpacked(folder.with_suffix(".fmu"), folder)
    (tmp_path / "couple.h").write_text(header(folders))
    source = [str(SUPPORT / "couple_host.c"), "-I", str(tmp_path), "-O2"]
    cache = compiled().parent
    zig.run([*zig.COMMAND, "cc", *source, "-ldl", "-o", str(tmp_path / "couple")], cache, "host")
    end = windows.arguments(tmp_path, "mainCRTStartup", HOST)
    zig.run([*zig.COMMAND, "cc", "-target", "x86_64-windows-gnu", *source, "-o", str(tmp_path / "couple.exe"), *end], cache, "host")
    with tempfile.TemporaryDirectory() as prefix:
        environment = os.environ | {"WINEPREFIX": prefix, "WINEDEBUG": "-all"}
        done = subprocess.run([wine, "couple.exe"], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
    here = subprocess.run(["./couple"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, here.returncode) == (0, 0), done.stdout + done.stderr + here.stdout + here.stderr
    ours, theirs = (np.array(list(map(float, text.split()))) for text in (done.stdout, here.stdout))
    assert len(ours) > 100
    np.testing.assert_allclose(ours[:7], theirs[:7], rtol=1e-9)
    np.testing.assert_allclose(ours[7:], theirs[7:], atol=1e-9 * np.abs(theirs[7:]).max())
