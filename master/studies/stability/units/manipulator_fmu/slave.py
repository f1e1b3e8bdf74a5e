"""Arm and cylinder of the hydraulic manipulator; each integrates its own part by collocation, one step per macro step.

The held mean is the only coupling error: work of the bond is mean force x change of length on both sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from .collocation import GAUSS_NODES, RADAU_NODES, table
from .model import (
    ANGLES,
    FRICTION,
    PISTON,
    START_LENGTH,
    accelerations,
    actuator,
    energies,
    equilibrium,
    mass_matrix,
    pressure_rates,
    spool,
)

CORRECTIONS = 50
ROUND_OFF = 1e-14


@dataclass(frozen=True)
class Manipulator:
    """The benchmark has its data fixed."""


class ArmState(NamedTuple):
    z: np.ndarray  # angles and rates
    speed: float
    mobility: float
    bond_work: float


class CylinderState(NamedTuple):
    pressure: np.ndarray
    length: float
    speed: float
    force: float
    bond_work: float


class ArmUnit:
    NAME = "arm"
    DESCRIPTION = "A two-link arm pushed by an actuator"
    PARAMETERS = Manipulator
    INPUTS: ClassVar = {"force": (1, "N", "push of the actuator, mean over the coming step")}

    @staticmethod
    def outputs(parameters: Manipulator) -> dict[str, tuple[int, str, str]]:
        return {
            "velocity": (1, "m/s", "rate of the actuator's length, mean over the step"),
            "end_velocity": (1, "m/s", "at the end of the step"),
            "mobility": (1, "m/(N.s)", "d(velocity) / d(force)"),
            "length": (1, "m", "of the actuator"),
            "kinetic_energy": (1, "J", "of the arm"),
            "gravity_energy": (1, "J", "of the arm"),
            "bond_work": (1, "J", "work done on the arm by the actuator"),
        }

    def __init__(self, parameters: Manipulator) -> None:
        self.state = self._start()

    @staticmethod
    def _start() -> ArmState:
        return ArmState(np.array([*ANGLES, 0.0, 0.0]), 0.0, 0.0, 0.0)

    def initialize(self, time: float, inputs: dict[str, np.ndarray]) -> str | None:
        self.state = self._start()
        return None

    def step(self, time: float, h: float, inputs: dict[str, np.ndarray]) -> str | None:
        z, force = self.state.z, float(inputs["force"][0])
        coefficients, weights = table(GAUSS_NODES)
        rates = np.tile(accelerations(z, force), (3, 1))
        for _ in range(CORRECTIONS):
            before = rates
            rates = np.array([accelerations(stage, force) for stage in z + h * coefficients @ before])
            if np.abs(rates - before).max() <= ROUND_OFF * (1.0 + np.abs(rates).max()):
                break
        else:
            return f"step of {h:g} s at {time:g} s: no convergence after {CORRECTIONS} corrections"
        new = z + h * weights @ rates
        moved = actuator(new[0])[0] - actuator(z[0])[0]
        middle = 0.5 * (z + new)
        lever = np.array([actuator(middle[0])[1], 0.0])
        slope = 0.5 * h * float(lever @ np.linalg.solve(mass_matrix(middle[0] - middle[1]), lever))
        self.state = ArmState(new, moved / h, slope, self.state.bond_work + force * moved)
        return None

    def output(self, name: str) -> np.ndarray:
        s = self.state
        if name.endswith("_energy"):
            return np.array([energies(s.z)[name == "gravity_energy"]])
        length, lever = actuator(s.z[0])
        values = {"velocity": s.speed, "end_velocity": lever * s.z[2], "mobility": s.mobility, "length": length, "bond_work": s.bond_work}
        return np.array([values[name]])


class CylinderUnit:
    NAME = "cylinder"
    DESCRIPTION = "A hydraulic cylinder with its valve"
    PARAMETERS = Manipulator
    INPUTS: ClassVar = {"velocity": (1, "m/s", "rate of its length, mean over the coming step")}

    @staticmethod
    def outputs(parameters: Manipulator) -> dict[str, tuple[int, str, str]]:
        return {
            "force": (1, "N", "push on the arm, mean over the step"),
            "end_force": (1, "N", "push at the end of the step"),
            "pressure": (2, "Pa", "in the chambers"),
            "length": (1, "m", "of the actuator"),
            "bond_work": (1, "J", "work done on the cylinder by the arm"),
            "supplied_work": (1, "J", "work done on the piston by oil and friction"),
        }

    def __init__(self, parameters: Manipulator) -> None:
        pressure, self._rest = equilibrium()
        self._start = CylinderState(pressure, START_LENGTH, 0.0, PISTON * (pressure[1] - pressure[0]), 0.0)
        self.state = self._start

    def initialize(self, time: float, inputs: dict[str, np.ndarray]) -> str | None:
        self.state = self._start
        return None

    def step(self, time: float, h: float, inputs: dict[str, np.ndarray]) -> str | None:
        s, speed = self.state, float(inputs["velocity"][0])
        coefficients, weights = table(RADAU_NODES)
        openings = [spool(time + c * h, self._rest) for c in RADAU_NODES]
        lengths = s.length + h * speed * RADAU_NODES
        stages = np.tile(s.pressure, (3, 1))
        for _ in range(CORRECTIONS):
            found = [pressure_rates(p, x, speed, k) for p, x, k in zip(stages, lengths, openings, strict=True)]
            rates, slopes = np.array([r for r, _ in found]), np.array([d for _, d in found])
            residual = s.pressure + h * coefficients @ rates - stages
            if np.abs(residual).max() <= 100 * ROUND_OFF * np.abs(stages).max():
                break
            for i in range(2):
                stages[:, i] += np.linalg.solve(np.eye(3) - h * coefficients * slopes[:, i], residual[:, i])
        else:
            return f"step of {h:g} s at {time:g} s: no convergence after {CORRECTIONS} corrections"
        mean = weights @ stages
        force = PISTON * (mean[1] - mean[0]) - FRICTION * speed
        length = s.length + h * speed
        self.state = CylinderState(s.pressure + h * weights @ rates, length, speed, force, s.bond_work - h * force * speed)
        return None

    def output(self, name: str) -> np.ndarray:
        s = self.state
        if name == "pressure":
            return s.pressure
        end = PISTON * (s.pressure[1] - s.pressure[0]) - FRICTION * s.speed
        values = {
            "force": s.force, "end_force": end, "length": s.length, "bond_work": s.bond_work, "supplied_work": -s.bond_work,
        }  # fmt: skip
        return np.array([values[name]])
