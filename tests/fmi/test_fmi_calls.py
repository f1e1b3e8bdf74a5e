"""Random sequences of FMI calls, right and wrong: each answered as the standard has it, and the process lives."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from units.toys import SPRING

import pipe_fmu
import vessel_fmu
from master.fmi.build import Recipe, build_fmu

PROGRAM = Path(__file__).parents[1] / "support" / "fuzz_calls.py"
SECONDS = 15.0  # for each of four runs: a minute
PIPE = Recipe(Path(pipe_fmu.__file__).parent, "slave.PipeUnit", {"nodes": 6})
VESSEL = Recipe(Path(vessel_fmu.__file__).parent, "slave.VesselUnit", {})


RUNS = [
    pytest.param(SPRING, 0, {}, id="spring"),
    pytest.param(VESSEL, 1, {}, id="vessel"),
    pytest.param(PIPE, 2, {}, id="pipe"),
    pytest.param(PIPE, 3, {"PIPELAY_PYTHON": sys.executable}, id="pipe in a process of its own"),
]


@pytest.mark.parametrize(("recipe", "seed", "given"), RUNS)
def test_no_sequence_of_calls_ends_the_process_or_passes_for_good_where_it_is_not(recipe, seed, given, tmp_path):
    fmu = build_fmu(recipe, tmp_path / "with spaces" / "unit.fmu")
    command = [sys.executable, str(PROGRAM), str(fmu), str(seed), str(SECONDS)]
    environment = {**os.environ, "TMPDIR": str(fmu.parent), **given}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300.0 + SECONDS)
    last = done.stderr[done.stderr.rfind("instantiate") :]
    assert done.returncode == 0, f"seed {seed}, exit code {done.returncode}, calls:\n{last}"
    calls, steps = map(int, done.stdout.split())
    assert calls > 1000
    assert steps > 100
