"""Hosts that are not ours on exported files, and what they are measured against.

As a program, ``hosts.py FOLDER [SECONDS [HOST ...]]`` runs the paper's scene in all of them, at macro steps of 0.05 and 0.01 s, keeps their
result files in FOLDER and prints a table as CSV: error of the hang-off position against pipe and vessel solved as one system at 0.01 s,
energy that the bond made over the energy that went through it, wall time with loading. Each host runs in a process of its own with a
package folder of its own.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from master.__main__ import main
from master.fmu.instance import Fmu
from master.scene import reading
from master.with_units.monolithic import march

PROGRAM = Path(__file__).with_name("run_host.py")
COSIM = ("libcosimpy==0.0.6",)
PACKAGES = {  # host -> what pip installs for it
    "own": (),
    "fmpy_ssp": (),
    "libcosim": COSIM,
    "ecco_file": COSIM,
    "ecco": COSIM,
    "ecos": ("ecospy==0.7.2",),
    "cofmupy": ("CoFmuPy==1.0.0", "fmpy==0.3.20", "networkx==3.2.1", "pandas", "python-dateutil", "six", "plotly", "narwhals", "rich",
                "pygments", "markdown-it-py", "mdurl", "confluent-kafka"),
}  # fmt: skip
SPACING = 0.05  # s between the instants that are compared
Array = NDArray[np.float64]


class NotHereError(Exception):
    """The host cannot be had on this machine; says why."""


def install(host: str, folder: Path) -> Path:
    """The folder with the packages of a host. Raises NotHereError."""
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(folder), *PACKAGES[host]]
    if PACKAGES[host] and not folder.is_dir():
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise NotHereError(f"{PACKAGES[host][0]} cannot be installed: {done.stderr.strip().splitlines()[-1]}")
    return folder


def run(host: str, exported: Path, packages: Path, step: float, end: float) -> tuple[Array, float]:
    """Rows (time, position (3), works (2)) of a host's run to `end` [s], and its wall time [s]. Raises NotHereError."""
    began, result = time.perf_counter(), exported / f"{host}_{step}.jsonl"
    command = [sys.executable, str(PROGRAM), host, str(exported), str(step), str(end), str(result)]
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": str(packages)}, capture_output=True, text=True)
    if "libtbb.so.12" in done.stderr:
        raise NotHereError("ecospy needs the system library libtbb12")
    if done.returncode:
        raise RuntimeError(f"{host}: {done.stderr[-2000:]}")
    return np.array([json.loads(line) for line in result.read_text().splitlines()]), time.perf_counter() - began


def reference(name: str, changes: Sequence[str], step: float, end: float) -> Array:
    """Hang-off position (n, 3) [m] every 0.05 s of pipe and vessel solved as one system in steps of `step` [s].

    In a process of its own: one that has run FMUs would put their types into kernels it compiles, and keep these for others to fail on.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as elsewhere:
        return elsewhere.submit(_solved_as_one, name, changes, step, end).result()


def _solved_as_one(name: str, changes: Sequence[str], step: float, end: float) -> Array:
    _, vessel, moments = march(reading.load(name, changes), step, end)
    rows = [vessel.hang_off_pose(vessel.position(m.vessel), m.vessel.quaternion)[0] for m in moments]
    return np.array(rows)[:: round(SPACING / step)][1:]


def exchange(exported: Path, times: Sequence[float]) -> Array:
    """Rows as of `run` of the parallel exchange that a host without iteration must do, by FMI calls of our own, in steps to `times`.

    Each unit holds over a step what the other had at its beginning, by the wires of the OSP structure.
    """
    flows, efforts = ("end_velocity", "end_angular_velocity"), ("force", "moment")
    with Fmu(exported / "pipe.fmu", "pipe") as pipe, Fmu(exported / "vessel.fmu", "vessel") as vessel:
        pipe.initialize()
        pull = pipe.get(efforts)
        vessel.initialize(inputs=dict(zip(efforts, (pull[:3], pull[3:]), strict=True)))
        rows, now = [], 0.0
        for after in times:
            flow, pull = vessel.get(flows), pipe.get(efforts)
            pipe.set(("velocity", "angular_velocity"), flow)
            vessel.set(efforts, pull)
            pipe.step(now, after - now, final=True)
            vessel.step(now, after - now, final=True)
            now = after
            rows.append([now, *vessel.get("hang_off_position"), *pipe.get("top_work"), *vessel.get("bond_work")])
    return np.array(rows)


def error(rows: Array, exact: Array) -> float:
    """Largest difference [m] of the position to that of `exact` (n, 3), every 0.05 s."""
    return float(np.abs(sampled(rows, len(exact)) - exact).max())


def sampled(rows: Array, n: int) -> Array:
    """Positions (n, 3) [m] of `rows` every 0.05 s."""
    times = SPACING * np.arange(1, n + 1)
    return np.column_stack([np.interp(times, rows[:, 0], rows[:, i]) for i in (1, 2, 3)])


def residual(rows: Array) -> float:
    """Energy that the bond made, over what went through it, at its largest."""
    return float(np.abs(rows[:, 4] + rows[:, 5]).max() / np.abs(rows[:, 4]).max())


def table(folder: Path, end: float, hosts: Sequence[str]) -> None:
    """Run the hosts to `end` [s] and print the table."""
    changes = [f"simulation.duration={end}", "simulation.snapshots=[]"]
    main(["export", "-o", str(folder / "files"), *(f"--set={change}" for change in changes)])
    kept = folder / f"reference_{end}.npy"
    if not kept.is_file():
        np.save(kept, reference("paper", changes, 0.01, end))
    exact, lines = np.load(kept), csv.writer(sys.stdout)
    lines.writerow(["host", "step s", "steps", "error m", "bond energy / exchanged", "wall s"])
    for host in hosts:
        for step in (0.05, 0.01):
            try:
                rows, wall = run(host, folder / "files", install(host, folder / host), step, end)
            except (NotHereError, RuntimeError) as reason:
                lines.writerow([host, step, str(reason).strip().splitlines()[-1]])
                continue
            lines.writerow([host, step, len(rows), f"{error(rows, exact):.2e}", f"{residual(rows):.1e}", f"{wall:.1f}"])
            sys.stdout.flush()


if __name__ == "__main__":
    table(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 300.0, sys.argv[3:] or list(PACKAGES))
