"""The libraries of pipe and vessel with their data, where a host does everything wrong: under sanitizers, in threads, made and freed again.

The C face is compiled with traps for undefined behaviour, and once with AddressSanitizer, once with memory that ends at a page which
nobody may touch: that finds out the kernels as well, which no sanitizer has compiled. zig links the former but has no runtime for it; gcc's
is taken, and the case is skipped where there is none.
"""

import os
import random
import shutil
import subprocess
import sys
import threading
import zipfile
import zlib
from ctypes import byref
from pathlib import Path

import pytest
from face_fuzz import Unit
from toy_face import ERROR, OK, Toy, library

SUPPORT = Path(__file__).parents[1] / "support"
UNITS = ("pipe", "vessel")
SECONDS = "15"  # for each of four runs: a minute
UNDEFINED = ("-fsanitize=undefined", "-fsanitize-trap=undefined")
GUARD = SUPPORT / "guard.h"
FLAGS = {
    "plain": (),
    "addresses": (*UNDEFINED, "-fsanitize=address"),
    "guarded pages": (*UNDEFINED, "-include", str(GUARD), f"-DGUARD={zlib.crc32(GUARD.read_bytes())}"),
}


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """A function from the kind of flags and the unit to its library and resources, in an unpacked FMU."""
    made = {}

    def folders(kind):
        if kind not in made:
            made[kind] = tmp_path_factory.mktemp("exported")
            command = [sys.executable, "-P", SUPPORT / "sanitized.py", made[kind], *FLAGS[kind]]
            done = subprocess.run(command, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr[-2000:]
            for unit in UNITS:
                zipfile.ZipFile(made[kind] / f"{unit}.fmu").extractall(made[kind] / unit)
        return made[kind]

    def parts(kind, unit):
        folder = folders(kind) / unit
        return next((folder / "binaries/linux64").iterdir()), str(folder / "resources")

    return parts


def address_sanitizer():
    """What a process needs that loads a library with it."""
    gcc = shutil.which("gcc")
    words = [str(gcc), "-print-file-name=libasan.so.8"]
    path = Path(subprocess.run(words, capture_output=True, text=True).stdout.strip()) if gcc else Path()
    if not path.is_absolute():
        pytest.skip("gcc's runtime of AddressSanitizer (libasan.so.8) is not installed; zig has none")
    return {"LD_PRELOAD": str(path), "ASAN_OPTIONS": "detect_leaks=0"}  # of which Python has its own


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("kind", ["addresses", "guarded pages"])
def test_random_calls_find_no_fault(unit, kind, unpacked):
    environment = os.environ | {"PYTHONPATH": str(SUPPORT)} | (address_sanitizer() if kind == "addresses" else {})
    made, resources = unpacked(kind, unit)
    command = [sys.executable, SUPPORT / "face_fuzz.py", made, resources, SECONDS, "1"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr[-4000:]
    calls, steps = map(int, done.stdout.split())
    assert calls > 20_000
    assert steps > 500


@pytest.mark.parametrize("unit", UNITS)
def test_the_data_of_another_version_or_unit_are_refused_in_one_line(unit, unpacked, tmp_path):
    made, resources = unpacked("plain", unit)
    guid, words = Unit.described(Path(resources).parent).guid, "of another version or unit than the library; take both from one FMU"
    data = Path(resources, "unit.bin").read_bytes()
    other = Path(unpacked("plain", next(it for it in UNITS if it != unit))[1], "unit.bin").read_bytes()
    for foreign in (data[:16] + bytes(8) + data[24:], other):
        (tmp_path / "unit.bin").write_bytes(foreign)
        it = Toy(library(made), str(tmp_path), guid)
        assert not it.handle
        assert it.log == [(ERROR, "logStatusError", f"resources: {tmp_path}/unit.bin: {words}")]


def trajectory(lib, resources, unit, seed):
    """All outputs of an instance that starts with a changed parameter and is pushed about."""
    dice, it, seen = random.Random(seed), Toy(lib, resources, unit.guid, mute=True), []
    outputs = [place for place, kind in enumerate(unit.kinds) if kind == "Real" and place not in unit.starts]
    inputs = [place for place in unit.starts if place < outputs[0]]
    it.call("EnterInitializationMode")
    assert it.set("Real", (unit.names.index("environment.water_density"), 1000.0 + seed)) == OK
    assert it.call("ExitInitializationMode") == OK
    for i in range(40):
        assert it.set("Real", *((place, unit.starts[place] + dice.uniform(-0.1, 0.1)) for place in inputs)) == OK
        assert it.step(0.1 * i, 0.1) == OK
        seen += it.get("Real", *outputs)
    it.free()
    return seen


@pytest.mark.parametrize("unit", UNITS)
def test_two_instances_in_threads_are_equal_to_serial_to_the_last_bit(unit, unpacked):
    made, resources = unpacked("plain", unit)
    lib, known = library(made), Unit.described(Path(resources).parent)
    serial, found = [trajectory(lib, resources, known, seed) for seed in range(2)], {}

    def run(seed):
        found[seed] = trajectory(lib, resources, known, seed)

    threads = [threading.Thread(target=run, args=(seed,)) for seed in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[seed] for seed in range(2)] == serial


@pytest.mark.parametrize("unit", UNITS)
def test_10000_instances_leave_no_memory(unit, unpacked):
    made, resources = unpacked("plain", unit)
    lib, known = library(made), Unit.described(Path(resources).parent)

    def cycle(n):
        for _ in range(n):
            it = Toy(lib, resources, known.guid, mute=True).ready()
            assert it.step(0.0, 0.1) == OK
            it.state()  # freed with the instance
            it.call("FreeFMUstate", byref(it.state()))
            it.free()
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))

    before = cycle(500)
    assert cycle(10_000) - before < 1000  # kB
