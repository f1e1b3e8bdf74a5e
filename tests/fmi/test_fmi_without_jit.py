"""NUMBA_DISABLE_JIT, which many set to debug code of their own: the kernels can only run compiled; they do, or say so in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import vessel_fmu
from master.fmi.build import Recipe, build_fmu

WITHOUT = {"NUMBA_DISABLE_JIT": "1"}
PROGRAM = """
import sys
from master.fmu.instance import Fmu
with Fmu(sys.argv[1]) as fmu:
    fmu.initialize(inputs={"force": [1e5, 2e5, 3e5]})
    fmu.step(0.0, 0.1)
    print(fmu.get(tuple(fmu.names("output"))).tobytes().hex())
"""


def run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *map(str, arguments)], env=os.environ | environment, capture_output=True, text=True)


def test_the_program_answers_as_without_it():
    one, two = (run("-m", "master", "statics", "paper", "--json", **given) for given in ({}, WITHOUT))
    assert (two.returncode, two.stderr) == (0, "")
    assert one.stdout == two.stdout


@pytest.mark.parametrize("inside", [True, False], ids=["Python host", "process of its own"])
def test_an_fmu_gives_the_same_to_the_last_bit(tmp_path, inside):
    """In a host's Python that has it set it cannot run, and starts a Python of its own."""
    fmu = build_fmu(Recipe(Path(vessel_fmu.__file__).parent, "slave.VesselUnit", {}), tmp_path / "vessel.fmu")
    given = {} if inside else {"PIPELAY_PYTHON": sys.executable}
    run("-c", PROGRAM, fmu)  # compiles
    one, two = (run("-c", PROGRAM, fmu, **more) for more in (given, given | WITHOUT))
    assert [(it.returncode, it.stderr) for it in (one, two)] == [(0, "")] * 2
    assert one.stdout == two.stdout


@pytest.mark.parametrize("package", ["pipe_fmu", "vessel_fmu"])
def test_the_units_themselves_say_so_in_one_line(package):
    done = run("-c", f"import {package}.slave", **WITHOUT)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "ImportError: NUMBA_DISABLE_JIT is set, but the kernels can only run compiled"
