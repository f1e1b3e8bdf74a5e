"""Sea and gravity: depth, water and a current that varies with depth and time.

The same file stands in both units, each of which must be complete by itself; a test keeps the copies equal.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from .checks import check_fields, number

NEEDS_TABLE = "must be given with profile = 'table', and only then"


def time_factor(time: float, start: float, ramp: float, period: float) -> float:
    """Factor of a current at `time`: 0 before `start`, then a raised cosine of length `ramp`; the sign changes every `period`, all in s."""
    since = time - start
    if since < 0.0:
        return 0.0
    factor = 0.5 * (1.0 - math.cos(math.pi * since / ramp)) if since < ramp else 1.0
    return -factor if period > 0.0 and since / period % 2.0 >= 1.0 else factor


@dataclass(frozen=True)
class Current:
    """Current of one heading; `velocity` at the surface times a factor of depth times a factor of time."""

    velocity: tuple[float, float, float] = number((0.0, 0.0, 0.0), "m/s", "velocity at the surface, in e", usual=(-5.0, 5.0))
    profile: Literal["linear", "uniform", "table"] = field(
        default="linear", metadata={"doc": "shape over the depth: linear to zero at the bed, uniform, or the table"}
    )
    depths: tuple[float, ...] = number((), "m", "depths below the surface of the table, ascending", min=0.0)
    factors: tuple[float, ...] = number((), "1", "factors on the surface velocity at those depths")
    start: float = number(0.0, "s", "time at which the current is switched on")
    ramp: float = number(0.0, "s", "duration of the raised-cosine ramp after start", min=0.0)
    period: float = number(0.0, "s", "time after which the sign reverses, over and over; 0 is never", min=0.0)

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.profile == "table") != bool(self.depths):
            raise ValueError(f"depths = {self.depths!r}: {NEEDS_TABLE}")
        if len(self.factors) != len(self.depths):
            raise ValueError(f"factors = {self.factors!r}: must have as many entries as depths ({len(self.depths)})")
        if any(b <= a for a, b in zip(self.depths, self.depths[1:], strict=False)):
            raise ValueError(f"depths = {self.depths!r}: must ascend")

    def time_factor(self, time: float) -> float:
        """Factor of time at `time` [s]."""
        return time_factor(time, self.start, self.ramp, self.period)

    def shape(self, depth: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Depths below the surface [m] and factors of the profile in water of `depth` [m]; linear between, constant beyond."""
        if self.profile == "table":
            return self.depths, self.factors
        return (0.0, depth), ((1.0, 0.0) if self.profile == "linear" else (1.0, 1.0))


@dataclass(frozen=True)
class Environment:
    """Sea and gravity."""

    depth: float = number(800.0, "m", "water depth", above=0.0, usual=(1.0, 12e3))
    water_density: float = number(1025.0, "kg/m3", "density of sea water", above=0.0, usual=(950.0, 1250.0))
    gravity: float = number(9.81, "m/s2", "acceleration of gravity", above=0.0, usual=(9.7, 9.9))
    current: Current | None = field(default=None, metadata={"doc": "switches on a current"})

    def __post_init__(self) -> None:
        check_fields(self)
