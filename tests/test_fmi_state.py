"""State and life of the real units: what a rollback, a move to another process, and many lives must leave as it was."""

import gc
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import pipe_fmu
from master.__main__ import main
from master.fmi.build import Recipe, build_fmu
from master.fmu import Fmu

STEP = 0.1
UNITS = ("pipe", "vessel")
MODERATE = {"velocity": 0.5, "angular_velocity": 0.02, "force": 1e5, "moment": 1e5}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("with spaces")
    assert main(["export", "-o", str(folder)]) == 0
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
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
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


def test_many_lives_of_an_instance_hold_memory(small):
    """Blocks of Python's memory tell a leak of one object a life; the resident memory what else was not given back."""

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def live(count: int) -> tuple[int, int]:
        for _ in range(count):
            with Fmu(small) as fmu:
                fmu.initialize()
                state = fmu.snapshot()
                walk(fmu, 0, 2)
                fmu.restore(state)
                fmu._fmu.reset()
                fmu.initialize()
                fmu._fmu.terminate()
        gc.collect()
        return sys.getallocatedblocks(), resident()

    live(40)  # tables and arenas take their size
    blocks, memory = live(40)
    more_blocks, more_memory = live(60)
    assert more_blocks - blocks < 60 * 4
    assert more_memory - memory < 60 * 8e3  # bytes
