"""Parameters of the spring unit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Failure:
    """A planted failure: between two times every step longer than `above` fails, in one way or another."""

    above: float = field(default=0.0, metadata={"unit": "s", "min": 0.0, "doc": "longest step that succeeds"})
    start: float = field(default=0.0, metadata={"unit": "s", "doc": "failing from here"})
    end: float = field(default=1e9, metadata={"unit": "s", "doc": "to here"})
    kind: Literal["message", "arithmetic", "bug", "nan", "crash", "abort", "exit", "wait", "remark"] = field(
        default="message", metadata={"doc": "how it fails"}
    )


@dataclass(frozen=True)
class Section:
    """One of several springs side by side."""

    share: float = field(metadata={"unit": "1", "above": 0.0, "doc": "share of the stiffness"})
    name: str = field(default="", metadata={"doc": "label"})


@dataclass(frozen=True)
class Spring:
    """Top-level parameters."""

    stiffness: float = field(default=1.0, metadata={"unit": "N/m", "min": 0.0, "doc": "linear stiffness"})
    hardening: float = field(default=0.0, metadata={"unit": "N/m3", "min": 0.0, "doc": "cubic stiffness"})
    damping: float = field(default=0.0, metadata={"unit": "N.s/m", "min": 0.0, "doc": "viscous"})
    turning: float = field(default=1.0, metadata={"unit": "N.m/rad", "min": 0.0, "doc": "angular stiffness"})
    inertia: float = field(default=0.0, metadata={"unit": "kg", "min": 0.0, "doc": "mass that moves with the top"})
    offset: tuple[float, float, float] = field(default=(0.0,) * 3, metadata={"unit": "m", "doc": "initial stretch"})
    coils: int = field(default=3, metadata={"min": 1, "max": 9, "doc": "a number without effect"})
    compiled: bool = field(default=False, metadata={"doc": "use the numba kernel"})
    gain: float = field(default=1.0, metadata={"unit": "1", "doc": "factor on the force port; -1 is a sign error"})
    swap: bool = field(default=False, metadata={"doc": "force port on the wrong axes"})
    failure: Failure | None = field(default=None, metadata={"doc": "planted failure"})
    sections: tuple[Section, ...] = field(default=(), metadata={"doc": "parts"})

    def __post_init__(self) -> None:
        if not self.stiffness >= 0.0:
            raise ValueError(f"stiffness = {self.stiffness}: must be >= 0 N/m")
        if math.hypot(*self.offset) > 1e3:
            raise ValueError(f"offset = {list(self.offset)}: must be shorter than 1000 m")
