"""From the command to the first step, and what importing the packages and compiling the kernels takes, each in new processes; and what a
plain host in an empty environment needs for the start of an FMU in machine code, its step and a scalar get."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from master.errors import RunError
from master.fmi.loader import compiler
from master.fmi.native.machine import own_platform
from master.run.prepared import prepare
from master.scene.reading import load

REPEATS = 3
HOST, STEPS = Path(__file__).with_name("start_host.c"), 2000
FIGURES = ("start [ms]", "start with another section [ms]", "step [us]", "scalar get [us]", "FMU [MB]")
LARGEST = (20.0, 1000.0, 110.0, 0.2, 2.1)
LARGEST_START, LARGEST_COMPILATION = 3.0, 60.0  # s, of CPU time
_COMPILED = (
    "import sys; from numba.core import event\n"
    "with event.install_recorder('numba:compile') as seen: import pipe_fmu, vessel_fmu, master.commands\n"
    "sys.exit(len(seen.buffer))"
)
_FIRST = (
    "from master.run.pipe_drive import open_drive\n"
    "from master.run.prepared import prepare\n"
    "from master.scene.reading import load\n"
    "loaded = load('paper')\n"
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


def hosted() -> dict[str, float]:
    """Start [ms] of the pipe of 48 nodes at its exported values and with a changed section, step and scalar get [us], size [MB]: medians.

    Raises RunError.
    """
    with tempfile.TemporaryDirectory() as folder:
        fmu = prepare(load("heave", ["pipe.nodes=48"]), ["--export", folder])["pipe"]
        zipfile.ZipFile(fmu).extractall(folder)
        model = ElementTree.parse(Path(folder, "modelDescription.xml")).getroot()
        host = Path(folder, "host")
        subprocess.run([*compiler(), "-O2", "-o", str(host), str(HOST), "-ldl", "-lm"], check=True)
        library = next(Path(folder, "binaries", own_platform().folder).iterdir())
        wall = next(v for v in model.iter("ScalarVariable") if v.get("name") == "section.wall_thickness")
        changed = f"{wall.get('valueReference')}={1.01 * float(wall[0].get('start', ''))!r}"
        words = [str(host), str(library), Path(folder, "resources").as_uri(), model.get("guid", ""), str(STEPS)]
        plain, other = (np.median([_timed([*words, *more]) for _ in range(REPEATS)], axis=0) for more in ([], [changed]))
        size = fmu.stat().st_size / 1e6
    return dict(zip(FIGURES, [plain[0], other[0], plain[1], plain[2], size], strict=True))


def _timed(command: list[str]) -> list[float]:
    done = subprocess.run(command, env={}, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RunError(f"the host ended with {done.returncode}: {done.stderr.strip()}")
    return [float(word) for word in done.stdout.split()[:3]]


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
        *((f"plain host, pipe of 48 nodes: {what}", value, limit) for (what, value), limit in zip(hosted().items(), LARGEST, strict=True)),
    ]
