"""Six uncoupled springs k x + h x^3 with dampers and a mass on their moving end; discretely passive for any step.

Stands in for the pipe: takes the mean velocity over the step, returns the mean pull on what moves it.
"""

from __future__ import annotations

import math
import os
import signal
from time import sleep
from typing import ClassVar, NamedTuple

import numpy as np

from .parameters import Spring


class State(NamedTuple):
    x: np.ndarray
    v: np.ndarray
    mean_force: np.ndarray
    impedance: np.ndarray
    top_work: float
    drag_dissipation: float


class SpringUnit:
    NAME = "spring"
    DESCRIPTION = "Six springs with dampers"
    PARAMETERS = Spring
    INPUTS: ClassVar = {
        "velocity": (3, "m/s", "mean velocity of the top over the step"),
        "angular_velocity": (3, "rad/s", "mean angular velocity of the top over the step"),
    }

    @staticmethod
    def outputs(parameters: Spring) -> dict[str, tuple[int, str, str]]:
        table = {
            "force": (3, "N", "mean pull on the body"),
            "moment": (3, "N.m", "mean moment on the body"),
            "end_force": (3, "N", "pull at the end of the step"),
            "end_moment": (3, "N.m", "moment at the end of the step"),
            "impedance": (36, "", "dF/dV, row by row"),
            "stretch": (6, "", "displacement and rotation of the top"),
            "kinetic_energy": (1, "J", "of the mass on the top"),
            "elastic_energy": (1, "J", "stored"),
            "top_work": (1, "J", "work done on the spring through its top"),
            "drag_dissipation": (1, "J", "lost in the damper"),
        }
        if parameters.failure is not None:
            table["failing"] = (1, "1", "1 where the failure is planted")
        return table

    def __init__(self, parameters: Spring) -> None:
        self.p = parameters
        self.remark = ""
        self.k = np.array([parameters.stiffness] * 3 + [parameters.turning] * 3)
        self.state = State(np.zeros(6), np.zeros(6), np.zeros(6), np.zeros((6, 6)), 0.0, 0.0)

    def initialize(self, time: float, inputs: dict[str, np.ndarray]) -> str | None:
        x = np.array([*self.p.offset, 0.0, 0.0, 0.0])
        if x[0] > 900.0:
            return f"statics: no equilibrium at a stretch of {x[0]:g} m (100 % of it)"
        self.state = State(x, np.zeros(6), self._force(x, x), np.diag(self.k), 0.0, 0.0)
        if self.p.failure is not None and self.p.failure.kind == "remark":
            self.remark = "planted at the start, 10 % heard"
        return None

    def _cubic(self, old: np.ndarray, new: np.ndarray) -> np.ndarray:
        if self.p.compiled:
            from .kernel import cubic_mean

            return cubic_mean(old, new)
        return 0.25 * (old + new) * (old**2 + new**2)

    def _force(self, old: np.ndarray, new: np.ndarray) -> np.ndarray:
        return self.k * (old + new) / 2 + self.p.hardening * self._cubic(old, new)

    def step(self, time: float, h: float, inputs: dict[str, np.ndarray]) -> str | None:
        planted = self.p.failure
        if planted is not None and planted.start <= time < planted.end and h > planted.above:
            if planted.kind == "bug":
                raise RuntimeError("planted bug, 100 % certain")
            if planted.kind == "arithmetic":
                raise FloatingPointError("invalid value encountered in a planted place")
            if planted.kind == "crash":
                signal.raise_signal(signal.SIGSEGV)
            if planted.kind == "abort":
                os.abort()
            if planted.kind == "exit":
                os._exit(0)
            if planted.kind == "wait":
                sleep(0.1)
            if planted.kind == "message":
                return "planted failure: residual 1.0 after 20 iterations, 50 % left"
            self.remark = "planted remark, 50 % heard" if planted.kind == "remark" else ""
            broken = math.nan if planted.kind == "nan" else 0.0
        else:
            self.remark, broken = "", 0.0
        old, v = self.state.x, np.concatenate([inputs["velocity"], inputs["angular_velocity"]])
        new = old + h * v
        end = 2 * v - self.state.v if self.p.inertia else v
        force = broken + self._force(old, new) + self.p.damping * v + self.p.inertia * (end - self.state.v) / h
        slope = self.k / 2 + self.p.hardening * 0.25 * (old**2 + 2 * old * new + 3 * new**2)
        diagonal = h * slope + self.p.damping + 2 * self.p.inertia / h
        work = self.state.top_work + h * force @ v
        lost = self.state.drag_dissipation + h * self.p.damping * v @ v
        self.state = State(new, end, force, np.diag(diagonal), work, lost)
        return None

    def output(self, name: str) -> np.ndarray:
        s, p = self.state, self.p
        if name in ("force", "moment"):
            pull = -np.roll(s.mean_force, 1) if p.swap else -p.gain * s.mean_force
            return pull[:3] if name == "force" else pull[3:]
        if name in ("end_force", "end_moment"):
            end = -(self._force(s.x, s.x) + p.damping * s.v)
            return end[:3] if name == "end_force" else end[3:]
        if name == "impedance":
            return s.impedance.ravel()
        if name == "stretch":
            return s.x
        if name == "kinetic_energy":
            return np.array([0.5 * p.inertia * s.v @ s.v])
        if name == "elastic_energy":
            return np.array([0.5 * self.k @ s.x**2 + 0.25 * p.hardening * np.sum(s.x**4)])
        if name == "failing":
            return np.ones(1)
        return np.array([getattr(s, name)])
