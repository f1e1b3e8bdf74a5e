"""Pipe and vessel of the paper's scene in a host that is not Python: with the exporting Python there, and without any."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import c_host
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from master.__main__ import main
from master.fmi import licenses, portable
from master.fmu.instance import Fmu

STEP, COUNT = 0.1, 5
INPUTS = {
    "pipe": {"velocity[1]": 0.4, "velocity[2]": -0.3, "velocity[3]": 0.2, "angular_velocity[2]": 0.02},
    "vessel": {"force[1]": -4e5, "force[2]": 1e5, "force[3]": 9e5, "moment[2]": 2e5},
}
OUTPUTS = {
    "pipe": ("force", "moment", "top_position", "top_quaternion", "impedance", "elastic_energy", "top_work", "node_tension"),
    "vessel": ("velocity", "angular_velocity", "end_velocity", "mobility", "position", "kinetic_energy", "bond_work"),
}
GLIBC = ("libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0", "librt.so.1", "libutil.so.1")
UNITS = ("pipe", "vessel")
CHROOT = shutil.which("chroot", path=f"{os.environ['PATH']}:/usr/sbin")


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    return c_host.compiled(tmp_path_factory.mktemp("host"))


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    assert main(["export", "-o", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def carrying(tmp_path_factory):
    folder = tmp_path_factory.mktemp("portable")
    assert main(["export", "--portable", "-o", str(folder)]) == 0
    yield folder
    shutil.rmtree(folder)  # 400 MB


@pytest.fixture(scope="module")
def bare(tmp_path_factory, host):
    """Root of a system with the C library, the host program and nothing else."""
    if not CHROOT or subprocess.run([CHROOT, "/", "true"]).returncode:
        pytest.skip("this user may not chroot, which hides this machine's Python")
    root = tmp_path_factory.mktemp("bare root")
    listed = subprocess.run(["ldd", host], capture_output=True, text=True, check=True).stdout.split()
    library, linker = (next(word for word in listed if name in word and word[0] == "/") for name in ("/libc.so.6", "/ld-linux"))
    for path in (Path(linker), *(Path(library).with_name(name) for name in GLIBC)):
        if path.exists():
            place = root / path.relative_to("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place)
    (root / "tmp").mkdir()
    shutil.copy(host, root / "host")
    yield root
    shutil.rmtree(root)


PROGRAM = """
import json, sys
from master.fmu.instance import Fmu
path, inputs, outputs, step, count = json.loads(sys.argv[1])
with Fmu(path) as fmu:
    fmu.initialize()
    for name, value in inputs.items():
        port, index = name.partition("[")[0], int(name[-2]) - 1
        held = fmu.get(port)
        held[index] = value
        fmu.set(port, held)
    for i in range(count):
        fmu.step(step * i, step)
    print(json.dumps({name: fmu.get(name).tolist() for name in outputs}))
"""


def in_python(fmu: Path, unit: str) -> dict[str, np.ndarray]:
    """Outputs after the steps of the C host, taken by FMPy in a process of its own."""
    command = [sys.executable, "-c", PROGRAM, json.dumps([str(fmu), INPUTS[unit], OUTPUTS[unit], STEP, COUNT])]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {name: np.array(value) for name, value in json.loads(done.stdout).items()}


def command(host: str, unit: str, folder: Path, seen_as: Path, expected: dict[str, np.ndarray]) -> list[str]:
    names = [f"{name}[{i + 1}]" if len(value) > 1 else name for name, value in expected.items() for i in range(len(value))]
    return c_host.command(host, folder, seen_as, names, INPUTS[unit], STEP, COUNT)


def values(done: subprocess.CompletedProcess[str]) -> np.ndarray:
    assert (done.returncode, done.stderr) == (0, "")
    return np.array(list(map(float, done.stdout.split())))


def kernels_in(cache: Path) -> dict[Path, int]:
    """Compiled kernels below a folder, with the time at which each was written."""
    return {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb[ci]")}


@pytest.mark.parametrize("unit", UNITS)
def test_a_c_host_gets_what_fmpy_gets_to_the_last_bit_and_compiles_nothing(host, plain, unit, tmp_path):
    cache = os.environ.get("PIPELAY_CACHE", str(Path.home() / ".cache" / "pipelay"))
    expected = in_python(plain / f"{unit}.fmu", unit)
    compiled = kernels_in(Path(cache))
    folder = c_host.unpacked(plain / f"{unit}.fmu", tmp_path / "a new place")  # the kernels are found again all the same
    seen = values(c_host.run(command(str(host), unit, folder, folder, expected), PIPELAY_CACHE=cache))
    folders = {path.parent for path in compiled}  # another worker of the tests may fill one of its own
    assert compiled
    assert {path: when for path, when in kernels_in(Path(cache)).items() if path.parent in folders} == compiled
    np.testing.assert_array_equal(seen, np.concatenate(list(expected.values())))
    assert all(np.abs(value).max() > 0.0 for value in expected.values())


@pytest.mark.parametrize("unit", UNITS)
def test_a_portable_fmu_runs_on_a_system_without_python_to_the_last_bit_and_compiles_nothing(plain, carrying, bare, unit):
    expected = in_python(carrying / f"{unit}.fmu", unit)
    c_host.unpacked(carrying / f"{unit}.fmu", bare / unit)
    shipped = {path.name for path in (bare / unit / "resources").rglob("*.nb[ci]")}
    done = c_host.run([CHROOT, str(bare), *command("/host", unit, bare / unit, Path("/", unit), expected)])
    np.testing.assert_array_equal(values(done), np.concatenate(list(expected.values())))
    others = in_python(plain / f"{unit}.fmu", unit)  # kernels for this very processor: round-off of another order
    for name, value in expected.items():
        np.testing.assert_allclose(value, others[name], rtol=0.0, atol=1e-8 * np.abs(others[name]).max(), err_msg=name)
    assert len(shipped) > 5
    assert {path.name for path in bare.glob(f"tmp/*/units/{unit}_*/**/*.nb[ci]")} == shipped


def test_a_plain_fmu_says_there_that_its_python_is_gone(plain, bare):
    folder = c_host.unpacked(plain / "pipe.fmu", bare / "plain")
    done = c_host.run([CHROOT, str(bare), *command("/host", "pipe", folder, Path("/plain"), {})])
    assert done.returncode == 1
    assert f"Python {portable.interpreter()}: No such file or directory; set PIPELAY_PYTHON" in done.stderr


def test_a_portable_fmu_leaves_no_process_behind(carrying):
    def children() -> list[str]:
        return Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()

    before = children()
    with Fmu(carrying / "vessel.fmu") as one, Fmu(carrying / "vessel.fmu") as two:
        one.initialize()
        two.initialize()
        assert len(children()) == len(before) + 2  # one a library; each instance has unpacked its own
    assert children() == before


def test_licences_travel_and_no_problems_are_found(carrying, bare):
    for unit in UNITS:
        assert validate_fmu(str(carrying / f"{unit}.fmu")) == []
    held = c_host.unpacked(carrying / "vessel.fmu", bare / "held")
    assert not fmpy.read_model_description(str(carrying / "vessel.fmu")).coSimulation.needsExecutionTool
    named = {path.name for path in (held / licenses.FOLDER).iterdir()}
    carried = {path.name for path in (held / portable.HOME / "lib").glob("*.so*")}
    assert named >= {"python", "numpy", "numba", "llvmlite", "pythonfmu", "pipelay"}
    assert carried <= named | {path for path in carried if path.startswith("libpython")}
