"""Random sequences of FMI calls, right and wrong: each answered as the standard has it, and the process lives."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from units.toys import build_pair

PROGRAM = Path(__file__).parent / "fuzz_calls.py"
SECONDS = 15.0  # for each of four seeds: a minute


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return build_pair(tmp_path_factory.mktemp("fmus with spaces"))[0]


@pytest.mark.parametrize("seed", range(4))
def test_no_sequence_of_calls_ends_the_process_or_passes_for_good_where_it_is_not(fmu, tmp_path, seed):
    environment = {**os.environ, "PIPELAY_CACHE": str(tmp_path), "TMPDIR": str(fmu.parent)}
    command = [sys.executable, str(PROGRAM), str(fmu), str(seed), str(SECONDS)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=10 * SECONDS)
    last = done.stderr[done.stderr.rfind("instantiate") :]
    assert done.returncode == 0, f"seed {seed}, exit code {done.returncode}, calls:\n{last}"
    assert int(done.stdout) > 1000
