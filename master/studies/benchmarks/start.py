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
_COMPILED = (
    "import sys; from numba.core import event\n"
    "with event.install_recorder('numba:compile') as seen: import pipe_fmu, vessel_fmu, master.commands\n"
    "sys.exit(len(seen.buffer))"
)
_FIRST = (
    "from master import run, scene\n"
    "from master.run.drive import open_drive\n"
    "from master.run.prepared import prepare\n"
    "loaded = scene.load('paper')\n"
    "with open_drive(loaded.sections, prepare(loaded)) as drive: drive.advance(1.0)"
)


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
    with tempfile.TemporaryDirectory() as cache:
        runs: dict[str, tuple[str, dict[str, str], int]] = {
            "import of the packages": ("import pipe_fmu, vessel_fmu", {}, REPEATS),
            "run up to the end of its first step": (_FIRST, {}, REPEATS + 1),
            "the same with nothing compiled": (_FIRST, {"PIPELAY_CACHE": cache, "NUMBA_CACHE_DIR": f"{cache}/numba"}, 1),
        }
        for what, (code, environment, repeats) in runs.items():
            times = []
            for _ in range(repeats):
                cpu, wall, exit_code = _spent(["-c", code], **environment)
                if exit_code != 0:
                    raise RunError(f"{what}: exit code {exit_code}")
                times.append((cpu, wall))
                tick()
            cpus, walls = zip(*times, strict=True)
            rows.append({"what": what, "cpu_s": statistics.median(cpus), "wall_s": statistics.median(walls)})
    return rows


def verdicts(rows: list[dict[str, Any]]) -> list[tuple[str, float, float]]:
    """What is limited, what was found, and the limit."""
    _, first, fresh = (row["cpu_s"] for row in rows)
    return [
        ("functions compiled by importing the packages", float(compiled_by_import()), 0.0),
        ("CPU time of a run up to its first step [s]", first, LARGEST_START),
        ("CPU time of compiling everything [s]", fresh - first, LARGEST_COMPILATION),
    ]
