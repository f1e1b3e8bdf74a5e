"""The two halves of a linear oscillator, each with one scalar power port; exact under the mean that is held.

A held velocity or force does work mean x mean x step on the half exactly, so each keeps its energy balance to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from .exact import transition


@dataclass(frozen=True)
class Mass:
    """A mass that a spring and a damper hold to a fixed support."""

    mass: float = field(default=1.0, metadata={"unit": "kg", "above": 0.0, "doc": "mass"})
    stiffness: float = field(default=0.0, metadata={"unit": "N/m", "min": 0.0, "doc": "of its spring"})
    damping: float = field(default=0.0, metadata={"unit": "N.s/m", "min": 0.0, "doc": "of its damper"})
    support: float = field(default=0.0, metadata={"unit": "m", "doc": "position of the support"})
    start_position: float = field(default=0.0, metadata={"unit": "m", "doc": "initial"})
    start_velocity: float = field(default=0.0, metadata={"unit": "m/s", "doc": "initial"})

    def __post_init__(self) -> None:
        if not self.mass > 0.0:
            raise ValueError(f"mass = {self.mass}: must be > 0 kg")


@dataclass(frozen=True)
class Spring:
    """A spring and a damper between the moving end and a mass, which a spring and a damper hold to the ground."""

    mass: float = field(default=0.0, metadata={"unit": "kg", "min": 0.0, "doc": "mass behind the spring; 0: fixed"})
    stiffness: float = field(default=0.0, metadata={"unit": "N/m", "min": 0.0, "doc": "between mass and ground"})
    damping: float = field(default=0.0, metadata={"unit": "N.s/m", "min": 0.0, "doc": "between mass and ground"})
    coupling_stiffness: float = field(default=1.0, metadata={"unit": "N/m", "min": 0.0, "doc": "between end and mass"})
    coupling_damping: float = field(default=0.0, metadata={"unit": "N.s/m", "min": 0.0, "doc": "between end and mass"})
    start_end: float = field(default=0.0, metadata={"unit": "m", "doc": "initial position of the end"})
    start_position: float = field(default=0.0, metadata={"unit": "m", "doc": "initial, of the mass"})
    start_velocity: float = field(default=0.0, metadata={"unit": "m/s", "doc": "initial, of the mass"})

    def __post_init__(self) -> None:
        if not self.mass >= 0.0:
            raise ValueError(f"mass = {self.mass}: must be >= 0 kg")


class State(NamedTuple):
    z: np.ndarray
    mean: float
    held: float
    slope: float
    bond_work: float
    dissipation: float


class _Linear:
    """What both halves share: z' = A z + b u, an answer (row . (mean z, u)), and the energies."""

    A: np.ndarray
    b: np.ndarray
    Q: np.ndarray
    answer: np.ndarray

    def __init__(self) -> None:
        self._transition = cache(lambda h: transition(self.A, self.b, self.Q, h))
        self._state: State

    @property
    def state(self) -> State:
        return self._state

    @state.setter
    def state(self, value: State) -> None:
        self._state = value

    def _start(self, z: list[float]) -> None:
        start = np.array(z)
        self._state = State(start, float(self.answer @ [*start, 0.0]), 0.0, 0.0, 0.0, 0.0)

    def _step(self, h: float, u: float) -> None:
        s, exact = self._state, self._transition(h)
        old = np.append(s.z, u)
        mean = float(self.answer @ np.append(exact.integral @ old / h, u))
        slope = float(self.answer @ np.append(exact.integral[:, -1] / h, 1.0))
        self._state = State(exact.end @ old, mean, u, slope, s.bond_work + h * mean * u, s.dissipation + float(old @ exact.loss @ old))


class MassUnit(_Linear):
    NAME = "mass"
    DESCRIPTION = "A mass on a spring, exact under a held force"
    PARAMETERS = Mass
    INPUTS: ClassVar = {"force": (1, "N", "on the mass, mean over the coming step")}

    @staticmethod
    def outputs(parameters: Mass) -> dict[str, tuple[int, str, str]]:
        return {
            "velocity": (1, "m/s", "mean over the step"),
            "end_velocity": (1, "m/s", "at the end of the step"),
            "mobility": (1, "m/(N.s)", "d(velocity) / d(force)"),
            "position": (1, "m", "of the mass"),
            "kinetic_energy": (1, "J", "of the mass"),
            "elastic_energy": (1, "J", "of the spring"),
            "bond_work": (1, "J", "work done on the mass by the force port"),
            "damping_dissipation": (1, "J", "lost in the damper"),
        }

    def __init__(self, parameters: Mass) -> None:
        super().__init__()
        p = self.p = parameters  # z = (x - support, v)
        self.A = np.array([[0.0, 1.0], [-p.stiffness / p.mass, -p.damping / p.mass]])
        self.b, self.Q = np.array([0.0, 1.0 / p.mass]), np.diag([0.0, p.damping, 0.0])
        self.answer = np.array([0.0, 1.0, 0.0])
        self.initialize(0.0, {})

    def initialize(self, time: float, inputs: dict[str, np.ndarray]) -> str | None:
        self._start([self.p.start_position - self.p.support, self.p.start_velocity])
        return None

    def step(self, time: float, h: float, inputs: dict[str, np.ndarray]) -> str | None:
        self._step(h, float(inputs["force"][0]))
        return None

    def output(self, name: str) -> np.ndarray:
        s, p = self._state, self.p
        values: dict[str, Any] = {
            "velocity": s.mean,
            "end_velocity": s.z[1],
            "mobility": s.slope,
            "position": s.z[0] + p.support,
            "kinetic_energy": 0.5 * p.mass * s.z[1] ** 2,
            "elastic_energy": 0.5 * p.stiffness * s.z[0] ** 2,
            "bond_work": s.bond_work,
            "damping_dissipation": s.dissipation,
        }
        return np.array([values[name]])


class SpringUnit(_Linear):
    NAME = "spring"
    DESCRIPTION = "A spring with a mass behind it, exact under a held velocity of its end"
    PARAMETERS = Spring
    INPUTS: ClassVar = {"velocity": (1, "m/s", "of the end, mean over the coming step")}

    @staticmethod
    def outputs(parameters: Spring) -> dict[str, tuple[int, str, str]]:
        return {
            "force": (1, "N", "pull on what holds the end, mean over the step"),
            "end_force": (1, "N", "pull at the end of the step"),
            "impedance": (1, "N.s/m", "d(force on the end) / d(velocity)"),
            "end": (1, "m", "position of the end"),
            "position": (1, "m", "of the mass"),
            "mass_velocity": (1, "m/s", "of the mass"),
            "kinetic_energy": (1, "J", "of the mass"),
            "elastic_energy": (1, "J", "of both springs"),
            "bond_work": (1, "J", "work done on the end"),
            "damping_dissipation": (1, "J", "lost in both dampers"),
        }

    def __init__(self, parameters: Spring) -> None:
        super().__init__()
        p = self.p = parameters  # z = (end, x, v)
        k, c, K, C = p.coupling_stiffness, p.coupling_damping, p.stiffness, p.damping
        self.answer = np.array([k, -k, -c, c])  # force on the end
        ground, fixed = np.array([0.0, K, C, 0.0]), p.mass == 0.0
        pull = np.zeros(4) if fixed else (self.answer - ground) / p.mass
        self.A = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0 if fixed else 1.0], pull[:3]])
        self.b = np.array([1.0, 0.0, pull[3]])
        slip = np.array([0.0, 0.0, -1.0, 1.0])
        self.Q = c * np.outer(slip, slip) + C * np.diag([0.0, 0.0, 1.0, 0.0])
        self.initialize(0.0, {})

    def initialize(self, time: float, inputs: dict[str, np.ndarray]) -> str | None:
        p = self.p
        self._start([p.start_end, p.start_position, p.start_velocity])
        return None

    def step(self, time: float, h: float, inputs: dict[str, np.ndarray]) -> str | None:
        self._step(h, float(inputs["velocity"][0]))
        return None

    def output(self, name: str) -> np.ndarray:
        s, p = self._state, self.p
        end, x, v = s.z
        values: dict[str, Any] = {
            "force": -s.mean,
            "end_force": -float(self.answer @ [*s.z, s.held]),
            "impedance": s.slope,
            "end": end,
            "position": x,
            "mass_velocity": v,
            "kinetic_energy": 0.5 * p.mass * v**2,
            "elastic_energy": 0.5 * p.stiffness * x**2 + 0.5 * p.coupling_stiffness * (end - x) ** 2,
            "bond_work": s.bond_work,
            "damping_dissipation": s.dissipation,
        }
        return np.array([values[name]])
