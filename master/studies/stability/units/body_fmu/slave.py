"""A rigid body of equal moments of inertia on springs and dampers, midpoint rule.

Takes the mean force and moment over the step, returns the mean velocities; the step is discretely passive for any length. A
shaking force and moment, a cosine each, act as their exact mean over the step.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

_V3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Body:
    """Top-level parameters."""

    mass: float = field(default=1.0, metadata={"unit": "kg", "above": 0.0, "doc": "mass"})
    inertia: float = field(default=1.0, metadata={"unit": "kg.m2", "above": 0.0, "doc": "moment of inertia"})
    damping: float = field(default=0.0, metadata={"unit": "N.s/m", "min": 0.0, "doc": "linear"})
    stiffness: float = field(default=0.0, metadata={"unit": "N/m", "min": 0.0, "doc": "restoring"})
    start_velocity: tuple[float, float, float] = field(default=_V3, metadata={"unit": "m/s", "doc": "initial"})
    start_rotation: tuple[float, float, float] = field(default=_V3, metadata={"unit": "rad/s", "doc": "initial"})
    load: tuple[float, float, float] = field(default=_V3, metadata={"unit": "N", "doc": "constant external force"})
    holding_moment: tuple[float, float, float] = field(default=_V3, metadata={"unit": "N.m", "doc": "constant external moment"})
    shaking_force: tuple[float, float, float] = field(default=_V3, metadata={"unit": "N", "doc": "amplitude"})
    shaking_moment: tuple[float, float, float] = field(default=_V3, metadata={"unit": "N.m", "doc": "amplitude"})
    period: float = field(default=10.0, metadata={"unit": "s", "above": 0.0, "doc": "of the shaking"})
    start: tuple[float, float, float] = field(default=_V3, metadata={"unit": "m", "doc": "initial position"})
    start_quaternion: tuple[float, float, float, float] = field(
        default=(1.0, 0.0, 0.0, 0.0), metadata={"unit": "1", "doc": "initial attitude, scalar first"}
    )

    def __post_init__(self) -> None:
        if not self.mass > 0.0:
            raise ValueError(f"mass = {self.mass}: must be > 0 kg")


class State(NamedTuple):
    x: np.ndarray
    quaternion: np.ndarray
    v: np.ndarray
    mean: np.ndarray
    h: float
    bond_work: float
    environment_work: float
    damping_dissipation: float


def _turned(quaternion: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """`quaternion` after a turn by the spatial rotation vector `theta`."""
    half = 0.5 * float(np.linalg.norm(theta))
    c, u = np.cos(half), 0.5 * np.sinc(half / np.pi) * theta
    q, w = quaternion[0], quaternion[1:]
    turned = np.array([c * q - u @ w, *(c * w + q * u + np.cross(u, w))])
    return turned / np.linalg.norm(turned)


class BodyUnit:
    NAME = "body"
    DESCRIPTION = "A rigid body"
    PARAMETERS = Body
    INPUTS: ClassVar = {"force": (3, "N", "on the body"), "moment": (3, "N.m", "on the body")}

    @staticmethod
    def outputs(parameters: Body) -> dict[str, tuple[int, str, str]]:
        return {
            "velocity": (3, "m/s", "mean over the step"),
            "angular_velocity": (3, "rad/s", "mean over the step"),
            "end_velocity": (3, "m/s", "at the end of the step"),
            "end_angular_velocity": (3, "rad/s", "at the end of the step"),
            "mobility": (36, "", "dV/dF, row by row"),
            "position": (6, "", "displacement and rotation"),
            "place": (3, "m", "position in space"),
            "quaternion": (4, "1", "attitude, scalar first"),
            "kinetic_energy": (1, "J", "of the motion"),
            "restoring_energy": (1, "J", "stored"),
            "bond_work": (1, "J", "work done on the body by the force port"),
            "environment_work": (1, "J", "work of the constant load"),
            "damping_dissipation": (1, "J", "lost"),
        }

    def __init__(self, parameters: Body) -> None:
        self.p = parameters
        self.m = np.array([parameters.mass] * 3 + [parameters.inertia] * 3)
        self.load = np.array([*parameters.load, *parameters.holding_moment])
        self.shaking = np.array([*parameters.shaking_force, *parameters.shaking_moment])
        self.state = self._start()

    def _start(self) -> State:
        v = np.array([*self.p.start_velocity, *self.p.start_rotation])
        return State(np.zeros(6), np.array(self.p.start_quaternion), v, v, 0.0, 0.0, 0.0, 0.0)

    def initialize(self, time: float, inputs: dict[str, np.ndarray]) -> str | None:
        self.state = self._start()
        return None

    def step(self, time: float, h: float, inputs: dict[str, np.ndarray]) -> str | None:
        s, p = self.state, self.p
        pull = np.concatenate([inputs["force"], inputs["moment"]])
        rate = 2.0 * np.pi / p.period
        load = self.load + self.shaking * (np.sin(rate * (time + h)) - np.sin(rate * time)) / (rate * h)
        mean = (2 * self.m * s.v / h + pull + load - p.stiffness * s.x) / self._stiffness(h)
        work = (h * pull @ mean, h * load @ mean, h * p.damping * mean @ mean)
        totals = (s.bond_work + work[0], s.environment_work + work[1], s.damping_dissipation + work[2])
        self.state = State(s.x + h * mean, _turned(s.quaternion, h * mean[3:]), 2 * mean - s.v, mean, h, *totals)
        return None

    def _stiffness(self, h: float) -> np.ndarray:
        return 2 * self.m / h + self.p.damping + self.p.stiffness * h / 2

    def output(self, name: str) -> np.ndarray:
        s = self.state
        if name in ("velocity", "angular_velocity"):
            return s.mean[:3] if name == "velocity" else s.mean[3:]
        if name in ("end_velocity", "end_angular_velocity"):
            return s.v[:3] if name == "end_velocity" else s.v[3:]
        if name == "mobility":
            return (np.diag(1 / self._stiffness(s.h)) if s.h else np.zeros((6, 6))).ravel()
        if name == "position":
            return s.x
        if name == "place":
            return np.array(self.p.start) + s.x[:3]
        if name == "quaternion":
            return s.quaternion
        if name == "kinetic_energy":
            return np.array([0.5 * self.m @ s.v**2])
        if name == "restoring_energy":
            return np.array([0.5 * self.p.stiffness * s.x @ s.x])
        return np.array([getattr(s, name)])
