"""A scene of a spring and a body, its runs in processes of their own, and what they record."""

import subprocess
import sys
from time import sleep

import numpy as np

SCENE = """
title = "A spring and a body"
[simulation]
duration = 5.0
macro_step = 0.1
[units.coil]
fmu = "spring.fmu"
parameters = {stiffness = 4.0, damping = 0.1}
outputs = ["stretch"]
ENERGY_A
[units.mass]
fmu = "body.fmu"
parameters = {mass = 2.0, start_velocity = [1.0, 0.5, 0.0]}
outputs = ["position"]
ENERGY_B
[bond]
impedance = "coil"
mobility = "mass"
pairs = [
    {effort = "force", flow = "velocity", floor = 1e-6, end_effort = "end_force", end_flow = "end_velocity"},
    {effort = "moment", flow = "angular_velocity", floor = 1e-8},
]
"""

ENERGY = {
    "ENERGY_A": 'energy = {stored = ["kinetic_energy", "elastic_energy"], dissipated = ["drag_dissipation"], bond = "top_work"}',
    "ENERGY_B": 'energy = {stored = ["kinetic_energy", "restoring_energy"], supplied = ["environment_work"], '
    'dissipated = ["damping_dissipation"], bond = "bond_work"}',
}


def failing(kind):
    """The change of the scene after which the spring fails from 2 s on."""
    return f"units.coil.parameters={{stiffness=4.0, 'failure.start'=1.999, 'failure.above'=0.0, 'failure.kind'='{kind}'}}"


def columns(out):
    header = (out / "signals.csv").read_text().partition("\n")[0].split(",")
    values = np.loadtxt(out / "signals.csv", delimiter=",", skiprows=1)
    return dict(zip((name.partition(" [")[0] for name in header), values.T, strict=True))


def command(folder, out, kind):
    return [sys.executable, "-m", "master", "run", str(folder / "tied.toml"), "--set", failing(kind), "-o", str(out)]


def until_slow(out):
    """Until a run has taken some of its slow steps."""
    while not (out / "signals.csv").exists() or (out / "signals.csv").read_bytes().count(b"\n") < 23:
        sleep(0.02)


def begun(folder, out):
    """A run that has taken some of its slow steps."""
    child = subprocess.Popen(command(folder, out, "wait"), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    until_slow(out)
    return child
