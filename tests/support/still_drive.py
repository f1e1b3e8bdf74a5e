"""Stand-ins for the units of a run, at rest, so that the command line is tested without any."""

import os
import signal
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from master.coupling.ledger import EnergyCheckFailed
from master.fmu.errors import StepRejected
from master.run import simulate
from master.run.pipe_drive import Cost
from master.run.warnings import Remarks


class Ports:
    """Named ports with fixed values."""

    def __init__(self, **values):
        self.values = {name: np.atleast_1d(np.array(value, dtype=float)) for name, value in values.items()}
        self.ports = self.values

    def get(self, names):
        return np.concatenate([self.values[n] for n in ((names,) if isinstance(names, str) else names)])


class StillDrive:
    """Units at rest that exchange a little energy; `fate` says what happens at 1 s."""

    scheme, remarks = "energy-consistent", Remarks()
    ledger = SimpleNamespace(
        kinds={"pipe.kinetic_energy": "stored"},
        names=["pipe.kinetic_energy", "interface_residual", "closure", "exchanged"],
        row=[3.0, 0.0, 1e-9, 1e3],
        complaint="",
        verdict=lambda: "energy check passed: quite",
        summary=lambda: {"exchanged_energy_J": 1e3, "interface_residual_J": 1e-8, "ledger_closure_J": 1e-9},
    )

    def __init__(self, fate="nothing"):
        s = np.linspace(0.0, 1200.0, 5)
        self.time, self.fate, self.cost = 0.0, fate, Cost()
        pipe = Ports(
            force=(1, 2, 3),
            moment=(0, 0, 0),
            top_position=(800, 0, -800),
            pipe_length=1200.1,
            largest_tension=9e5,
            largest_bending_moment=2e5,
            largest_von_mises=1e8,
            s=s,
            node_position=np.column_stack([s, 0 * s, -s]).ravel(),
            node_tension=500.0 + s,
            node_wall_tension=500.0 + s,
            node_moment=np.zeros(15),
            node_shear=np.zeros(10),
        )
        vessel = Ports(position=(800, 0, -800), roll=0, pitch=0, yaw=0, body_velocity=np.zeros(6))
        self.units = {"pipe": pipe, "vessel": vessel}

    def advance(self, end):
        if self.time >= 1.0 and self.fate == "fail":
            raise StepRejected("Pipe: step of 0.1 s at 1 s: no convergence")
        if self.time >= 1.0 and self.fate == "interrupt":
            os.kill(os.getpid(), signal.SIGINT)
        if self.time >= 1.0 and self.fate == "leak":
            raise EnergyCheckFailed("energy check failed at 1.1 s: closure error 1 J")
        self.time = min(round(self.time + 0.1, 9), end)
        self.cost = Cost(macro_steps=round(self.time / 0.1))

    def derived(self):
        return {("pose_gap", "m"): 1e-15, ("pose_gap_angle", "rad"): 0.0, ("top_tension", "N"): 9e5}


@pytest.fixture
def still(monkeypatch):
    def arrange(fate="nothing"):
        monkeypatch.setattr(simulate, "prepare", lambda scene: None)
        monkeypatch.setattr(simulate, "open_drive", lambda sections, fmus: nullcontext(StillDrive(fate)))

    return arrange


SHORT = ["--set", "simulation.duration=2"]
