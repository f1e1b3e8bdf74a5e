"""Cost of a step and memory against the number of nodes, beside one banded LAPACK solve of the same size."""

from __future__ import annotations

import multiprocessing
import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import solve_banded

from master.errors import RunError
from master.studies.benchmarks.line import PIPE
from master.studies.hard_cases import swing
from pipe_fmu import Pipe

COUNTS = (100, 300, 1000, 3000, 10_000)
LARGEST_EXPONENT, LARGEST_MB, LARGEST_RATIO = 1.1, 400.0, 6.0
_BAND = 11  # unknowns either side of the diagonal, six a node
_STEPS, _STEP_S = 15, 0.1


def measure(nodes: int) -> dict[str, Any]:
    """CPU times [s] of a step and of the banded solve, medians taken in turn, and peak memory [MB] of this process. Raises RunError."""
    pipe, motion, still = Pipe(replace(PIPE, nodes=nodes, mesh="uniform")), swing(2.0, 12.0), np.zeros(3)
    found, state = pipe.start(0.0)
    if not found.converged:
        raise RunError(f"statics with {nodes} nodes failed, residual {found.residual:.1e}")
    steps, corrections = [], []
    for k in range(_STEPS + 1):
        velocity = (motion((k + 1) * _STEP_S)[0] - motion(k * _STEP_S)[0]) / _STEP_S
        begin = time.process_time()
        result = pipe.step(state._replace(time=k * _STEP_S), velocity, still, _STEP_S)
        steps.append(time.process_time() - begin)
        if not result.converged:
            raise RunError(f"{nodes} nodes: no convergence at {k * _STEP_S:g} s, residual {result.residual:.1e}")
        state = result.state
        corrections.append(result.iterations)
    memory = _peak_memory()
    step = statistics.median(steps[1:])  # the first loads the compiled step
    random = np.random.default_rng(0)
    band, right = random.normal(size=(2 * _BAND + 1, 6 * nodes)), random.normal(size=6 * nodes)
    band[_BAND] += 20.0
    solves = []
    for _ in range(_STEPS):
        begin = time.process_time()
        solve_banded((_BAND, _BAND), band, right, check_finite=False)
        solves.append(time.process_time() - begin)
    banded = statistics.median(solves)
    mean = float(np.mean(corrections[1:]))
    return {"nodes": nodes, "step_s": step, "corrections": mean, "banded_solve_s": banded, "ratio": step / banded, "memory_MB": memory}


def _peak_memory() -> float:
    """Largest resident memory of this process so far [MB]; `getrusage` counts that of the process it was started from."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024.0


def sweep(counts: Sequence[int], tick: Callable[[], object]) -> list[dict[str, Any]]:
    """A row for every count, each from a process of its own with one thread. Raises RunError."""
    rows = []
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    context = multiprocessing.get_context("spawn")
    for nodes in counts:
        with context.Pool(1) as pool:
            rows.append(pool.apply(measure, (nodes,)))
        tick()
    return rows


def verdicts(rows: Sequence[dict[str, Any]]) -> list[tuple[str, float, float]]:
    """What is limited, what was found, and the limit; cost of a step ~ nodes^exponent, fitted."""
    nodes, cost = (np.log([row[key] for row in rows]) for key in ("nodes", "step_s"))
    return [
        ("exponent of cost in nodes", float(np.polyfit(nodes, cost, 1)[0]), LARGEST_EXPONENT),
        ("memory at the most nodes [MB]", rows[-1]["memory_MB"], LARGEST_MB),
        ("step over one banded solve, largest", max(row["ratio"] for row in rows), LARGEST_RATIO),
    ]
