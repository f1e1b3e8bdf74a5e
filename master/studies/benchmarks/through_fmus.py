"""Runs through real FMUs and the master, each in a process of its own: the packages that the FMUs carry are imported nowhere here."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from io import StringIO
from typing import Any

import numpy as np

from master.results.recorder import SIGNALS, Recorder
from master.run.pipe_drive import open_drive
from master.run.prepared import prepare
from master.run.simulate import row
from master.scene import reading

_REACHED = 1e-9  # s; an instant this close to the end of a step is reached


def apart(function: Callable[..., Any], *arguments: Any) -> Any:
    """What `function` returns in a new process with one thread; what it raises is raised here."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(function, arguments)


def march(
    name: str, changes: Sequence[str], times: np.ndarray, ports: Sequence[tuple[str, str]], recorded: bool = False
) -> tuple[float, list[np.ndarray]]:
    """CPU time [s] of the master's steps, with the ledger's check and, if `recorded`, with the recording of `pipelay run`; and the values
    (k, n) of each of the `ports`, (unit, port), at `times` (k,) [s]. Raises RunError.
    """
    loaded = reading.load(name, [*changes, f"simulation.duration={float(times[-1])!r}"])
    simulation, spent = loaded.sections.simulation, 0.0
    found: list[list[np.ndarray]] = [[] for _ in ports]
    with open_drive(loaded.sections, prepare(loaded)) as drive:
        recorder = Recorder(drive.units, simulation.recording_step, simulation.snapshots, SIGNALS, StringIO())
        for t in times.tolist():
            begin = time.process_time()
            while drive.time < t - _REACHED:
                drive.advance(float(times[-1]))
                if recorded:
                    recorder.sample(drive.time, row(drive))
            spent += time.process_time() - begin
            for values, (unit, port) in zip(found, ports, strict=True):
                values.append(drive.units[unit].get(port))
    return spent, [np.array(values) for values in found]
