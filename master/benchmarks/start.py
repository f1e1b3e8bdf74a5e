"""From the command to the first step, and what importing the packages and compiling the kernels takes, each in new processes."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

from master.errors import RunError

REPEATS = 3
LARGEST_START, LARGEST_COMPILATION = 3.0, 60.0  # s, of CPU time
_IMPORT = "import sys, pipe_fmu, vessel_fmu; from numba.core import event; sys.exit(0)"
_COMPILED = (
    "import numba.core.compiler as c, sys; count = [0]; old = c.compile_extra\n"
    "def counted(*a, **k): count[0] += 1; return old(*a, **k)\n"
    "c.compile_extra = counted\n"
    "import pipe_fmu, vessel_fmu, master.__main__; sys.exit(count[0])"
)
_FIRST = ("run", "paper", "--set", "simulation.duration=0.1", "--set", "simulation.snapshots=[]", "--set", "environment.current.start=0")


def _spent(arguments: list[str], **environment: str) -> tuple[float, float, int]:
    """CPU and wall time [s] of a new Python process and its children, and its exit code."""
    before, begin = os.times(), time.perf_counter()
    done = subprocess.run([sys.executable, *arguments], env=os.environ | environment, capture_output=True, text=True, check=False)
    after, wall = os.times(), time.perf_counter() - begin
    if done.returncode < 0:
        raise RunError(f"{' '.join(arguments)}: killed by signal {-done.returncode}")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return cpu, wall, done.returncode


def compiled_by_import() -> int:
    """How many functions importing the packages compiles."""
    return _spent(["-c", _COMPILED])[2]


def sweep(tick: Callable[[], object]) -> list[dict[str, Any]]:
    """Rows of what was started, its CPU and wall time [s], medians. Raises RunError."""
    rows = []
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as cache:
        first = ["-m", "master", *_FIRST, "-o", folder]
        runs: dict[str, tuple[list[str], dict[str, str], int]] = {
            "import of the packages": (["-c", _IMPORT], {}, REPEATS),
            "pipelay run to the end of a step of 0.1 s, figures included": (first, {}, REPEATS),
            "the same with nothing compiled": (first, {"PIPELAY_CACHE": cache, "NUMBA_CACHE_DIR": f"{cache}/numba"}, 1),
        }
        for what, (arguments, environment, repeats) in runs.items():
            times = []
            for _ in range(repeats):
                cpu, wall, code = _spent(arguments, **environment)
                if code != 0:
                    raise RunError(f"{what}: exit code {code}")
                times.append((cpu, wall))
                tick()
            cpus, walls = zip(*times, strict=True)
            rows.append({"what": what, "cpu_s": statistics.median(cpus), "wall_s": statistics.median(walls)})
    return rows
