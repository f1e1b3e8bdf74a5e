"""Hosts that are not ours run the exported files, each in a process and with a package folder of its own."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp

from master import scene
from master.__main__ import main
from master.monolithic import march

PROGRAM = Path(__file__).parent / "run_host.py"
PACKAGES = {"libcosim": "libcosimpy==0.0.6", "ecco": "libcosimpy==0.0.6", "ecos": "ecospy==0.7.2"}
ALLOWED = {"ecco": 4e-3}  # m; it chooses its step by itself
END = 6.0  # s
CHANGES = ["environment.current.start=0", "environment.current.ramp=2", "vessel.controller.start=1", f"simulation.duration={END}",
           "simulation.snapshots=[]"]  # fmt: skip


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    assert main(["export", "-o", str(folder), *(f"--set={change}" for change in CHANGES)]) == 0
    return folder


@pytest.fixture(scope="module")
def reference():
    """Hang-off position (n, 3) every 0.05 s of pipe and vessel solved as one system."""
    _, vessel, moments = march(scene.load("paper", CHANGES), 0.01, END)
    rows = [vessel.hang_off_pose(vessel.position(m.vessel), m.vessel.quaternion)[0] for m in moments]
    return np.array(rows)[5::5]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder of a host's package, installed when first asked for."""
    folders = {}

    def folder_of(package):
        if package not in folders:
            folders[package] = tmp_path_factory.mktemp("host")
            command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(folders[package]), package]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                pytest.skip(f"{package} cannot be installed: {done.stderr.strip().splitlines()[-1]}")
        return folders[package]

    return folder_of


def run(host, exported, packages, step):
    """Rows (time, position, works) of a host's run, and its wall time, s."""
    began = time.perf_counter()
    result = exported / f"{host}_{step}.jsonl"
    command = [sys.executable, str(PROGRAM), host, str(exported), str(step), str(END), str(result)]
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": str(packages)}, capture_output=True, text=True)
    if "libtbb.so.12" in done.stderr:
        pytest.skip("ecospy needs the system library libtbb12")
    assert done.returncode == 0, done.stderr[-2000:]
    return np.array([json.loads(line) for line in result.read_text().splitlines()]), time.perf_counter() - began


@pytest.mark.parametrize("host", PACKAGES)
def test_a_foreign_host_comes_closer_to_the_monolithic_solution_with_shorter_steps(host, exported, reference, installed, tmp_path):
    files = shutil.copytree(exported, tmp_path / "files")
    errors = []
    for step in (0.05, 0.01):
        rows, wall = run(host, files, installed(PACKAGES[host]), step)
        times = 0.05 * np.arange(1, len(reference) + 1)
        inside = times <= rows[-1, 0] + 1e-9
        position = np.column_stack([np.interp(times[inside], rows[:, 0], rows[:, i]) for i in (1, 2, 3)])
        error = np.abs(position - reference[inside]).max()
        residual = np.abs(rows[:, 4] + rows[:, 5]).max() / np.abs(rows[:, 4]).max()
        sys.stdout.write(f"{host:9} H {step} s: {len(rows)} steps, {error:.1e} m, bond energy {residual:.1e}, wall {wall:.1f} s\n")
        assert rows[-1, 0] >= END - 1e-6
        assert error < ALLOWED.get(host, 5e-4)
        assert residual < (5e-3 if host == "ecco" else 0.3 * step)  # of first order in the step
        errors.append(error)
    if host != "ecco":
        assert errors[1] < 0.4 * errors[0]


def test_fmpy_simulates_the_ssp(exported, reference):
    """It sets all inputs to zero in the first step, so that the vessel is let go for so long: an offset of the velocity remains."""
    step = 0.05
    result = simulate_ssp(str(exported / "system.ssp"), stop_time=END - 0.5 * step, step_size=step)
    velocity = np.column_stack([np.append(0.0, result[f"vessel.end_velocity[{i}]"]) for i in (1, 2, 3)])
    moved = np.cumsum(0.5 * step * (velocity[1:] + velocity[:-1]), axis=0)
    error = np.abs(moved - (reference - reference[0])).max()
    sys.stdout.write(f"fmpy SSP  H {step} s: {len(result)} steps, {error:.1e} m\n")
    assert len(result) == round(END / step)
    assert error < 0.03
