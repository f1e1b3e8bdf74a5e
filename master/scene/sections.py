"""The scene's sections that the master itself reads; [pipe], [vessel] and [environment] belong to the units."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any, Literal

import numpy as np

RULES: dict[str, tuple[str, Callable[[float, float], bool]]] = {
    "above": (">", lambda value, bound: value > bound),
    "min": (">=", lambda value, bound: value >= bound),
    "below": ("<", lambda value, bound: value < bound),
    "max": ("<=", lambda value, bound: value <= bound),
}


def _number(doc: str, unit: str, **bounds: Any) -> Any:
    """Dataclass field of one number or several in `unit`; `bounds`: min, max, above, below, and its `default`."""
    default = {"default": bounds.pop("default")} if "default" in bounds else {}
    return field(**default, metadata={"doc": doc, "unit": unit, **bounds})


@dataclass(frozen=True)
class SceneTable:
    """A table of numbers that checks its ranges when made; ValueError reads "key = value: rule"."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            for number in value if isinstance(value, tuple) else (value,):
                for key, (sign, holds) in RULES.items():
                    if key in item.metadata and number is not None and not holds(number, item.metadata[key]):
                        unit = item.metadata["unit"]
                        bound = f"{item.metadata[key]:g}" + (f" {unit}" if unit != "1" else "")
                        raise ValueError(f"{item.name} = {number:g}: must be {sign} {bound}")


@dataclass(frozen=True)
class Simulation(SceneTable):
    """[simulation]: how long, in what steps, and what is kept; statics need no such table."""

    duration: float = _number("time simulated; statics alone need no [simulation]", "s", above=0.0)
    macro_step: float = _number("step of the coupling, the largest where it adapts", "s", above=0.0)
    recording_step: float | None = _number(
        "time between recorded shapes, once a step at most; absent: 0.5 s, or duration / 2000 if longer", "s", above=0.0, default=None
    )
    snapshots: tuple[float, ...] = _number(
        "instants drawn in figure 3 beside start and end; of which there are none after the end", "s", min=0.0, default=()
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.macro_step > self.duration:
            raise ValueError(f"macro_step = {self.macro_step:g}: must be <= duration = {self.duration:g} s")

    @property
    def recorded_every(self) -> float:
        """Time between recorded shapes [s]."""
        return self.recording_step or max(0.5, self.duration / 2000.0)


@dataclass(frozen=True)
class Coupling(SceneTable):
    """[coupling]: how the units are coupled, and the energy check."""

    scheme: Literal["energy-consistent", "serial", "parallel"] = field(
        default="energy-consistent", metadata={"doc": "how the two units are coupled"}
    )
    tolerance: float = _number("energy the bond may make in a step, relative", "1", above=0.0, below=1.0, default=1e-9)
    energy_check: float = _number("limit of closure and of what the bond makes, over what is exchanged", "1", above=0.0, default=1e-8)
    on_violation: Literal["stop", "refine", "warn"] = field(default="stop", metadata={"doc": "what a failed energy check does"})
    rollback: bool = field(default=True, metadata={"doc": "whether steps may be taken back; else units are solved once a step"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.on_violation == "refine" and not (self.rollback and self.scheme == "energy-consistent"):
            raise ValueError("on_violation = 'refine': must be stop or warn where a step is not repeated")
        if self.scheme != "energy-consistent":
            for name in ("tolerance", "rollback"):
                if (value := getattr(self, name)) != (usual := type(self).__dataclass_fields__[name].default):
                    given, allowed = json.dumps(value), json.dumps(usual)
                    raise ValueError(f"{name} = {given}: must be {allowed} or absent with scheme = '{self.scheme}', which never iterates")


@dataclass(frozen=True)
class Release(SceneTable):
    """[start.release]: lets the vessel go displaced from its equilibrium, at rest."""

    heave: float = _number("down from the equilibrium", "m", default=0.0)
    roll: float = _number("starboard down", "rad", min=-0.5, max=0.5, default=0.0)
    pitch: float = _number("bow up", "rad", min=-0.5, max=0.5, default=0.0)


@dataclass(frozen=True)
class Start(SceneTable):
    """[start]: where the vessel's hang-off point, or the top of a pipe alone, is held in the equilibrium."""

    x: float = _number("forward of the foot", "m")
    y: float = _number("starboard of the foot", "m", default=0.0)
    z: float | None = _number("top of a pipe alone, down (negative); a vessel floats at its own", "m", below=0.0, default=None)
    yaw: float = _number("heading", "rad", min=-math.pi, max=math.pi, default=0.0)
    departure: float | None = _number(
        "pitch of the held pipe over the bow direction; absent: the pipe's own",
        "rad",
        min=-math.pi,
        max=math.pi,
        default=None,
    )
    release: Release | None = field(default=None, metadata={"doc": "lets the vessel go beside its equilibrium"})


@dataclass(frozen=True)
class TopMotion(SceneTable):
    """[top_motion]: harmonic displacement of the top of a pipe alone, faded in by a half cosine; held where there is no such table."""

    amplitude: tuple[float, float, float] = _number("amplitudes along x, y, z, in e", "m", usual=(-50.0, 50.0))
    period: float = _number("period", "s", above=0.0)
    ramp: float | None = _number(
        "time of the fade-in; absent: two periods; 0: the motion starts with a jump of velocity", "s", min=0.0, default=None
    )

    @property
    def fade_in(self) -> float:
        """Time of the fade-in [s]."""
        return 2.0 * self.period if self.ramp is None else self.ramp

    @property
    def speed(self) -> float:
        """Largest speed of the motion [m/s], with which it would start without fade-in."""
        return 2.0 * math.pi / self.period * math.hypot(*self.amplitude)

    def displacement(self, time: float) -> np.ndarray:
        """Displacement (3,) [m] from the start at `time` [s]."""
        ramp = self.fade_in
        fade = 0.5 * (1.0 - math.cos(math.pi * time / ramp)) if time < ramp else 1.0
        return np.array(self.amplitude) * (fade * math.sin(2.0 * math.pi * time / self.period))

    def mean_velocity(self, time: float, step: float) -> np.ndarray:
        """Mean velocity (3,) [m/s] over a step: the exact change of position over its length, which cannot drift."""
        return (self.displacement(time + step) - self.displacement(time)) / step


@dataclass(frozen=True)
class Load(SceneTable):
    """A row of [[tables.environment]]: force and moment on the vessel at its centre of gravity, in the frame of [tables]."""

    time: float = _number("instant", "s")
    force: tuple[float, float, float] = _number("force, in e or b as tables.frame says", "N", default=(0.0, 0.0, 0.0))
    moment: tuple[float, float, float] = _number("moment, in e or b as tables.frame says", "N.m", default=(0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Tables:
    """[tables]: loads over time, linear between their rows, constant before the first and after the last."""

    environment: tuple[Load, ...]
    frame: Literal["e", "b"] = field(default="e", metadata={"doc": "axes of forces and moments: fixed (e), or the hull's own (b)"})

    def __post_init__(self) -> None:
        if not self.environment:
            raise ValueError("environment = []: must have at least one row")
        times = [row.time for row in self.environment]
        for i, (before, after) in enumerate(pairwise(times), 2):
            if not after > before:
                raise ValueError(f"environment[{i}].time = {after:g}: must be > {before:g} s, the row before")


def mean_load(rows: Sequence[Load], time: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean force (3,) [N] and moment (3,) [N.m] of a table over [time, time + step], exact for the broken line."""
    knots = np.array([row.time for row in rows])
    inside = knots[(knots > time) & (knots < time + step)]
    instants = np.concatenate([[time], inside, [time + step]])
    values = np.array([[*row.force, *row.moment] for row in rows])
    at = np.column_stack([np.interp(instants, knots, column) for column in values.T])
    mean = np.sum(0.5 * (at[1:] + at[:-1]) * np.diff(instants)[:, None], axis=0) / step
    return mean[:3], mean[3:]
