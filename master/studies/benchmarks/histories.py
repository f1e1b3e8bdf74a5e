"""What the runs of the pipe alone are compared by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from master.studies.hard_cases import Motion

SAMPLE = 0.4  # s between the instants compared


@dataclass(frozen=True)
class Setting:
    """Contestant, elements, step [s] (of a variable step: its tolerance) and kind of mesh of one run; how often it is timed, and its
    duration [s] where that is less than the case's.
    """

    contestant: str
    elements: int
    step_s: float
    mesh: str = "uniform"
    repeats: int = 3
    span: float | None = None


@dataclass(frozen=True)
class LineCase:
    """A motion of the top, the runs to compare and the run they are compared with, whose uncertainty `check` tells."""

    motion: Motion
    duration: float
    settings: tuple[Setting, ...]
    reference: Setting
    check: Setting
    changes: tuple[str, ...] = ()  # of the scene `heave`, for the same case through the FMUs


@dataclass(frozen=True)
class Histories:
    """What is compared, at the instants: position (k, 3, 3) [m], top force (k, 3) [N], largest bending moment (k,) [N m] (NaN: none)."""

    position: np.ndarray
    top_force: np.ndarray
    bending: np.ndarray

    def until(self, count: int) -> Histories:
        """The first `count` instants."""
        return Histories(self.position[:count], self.top_force[:count], self.bending[:count])

    def distance(self, other: Histories) -> tuple[float, float, float]:
        """Root mean square differences in position [m], top force [N] and largest bending moment [N m]."""
        rows = (self.position - other.position, self.top_force - other.top_force, self.bending - other.bending)
        position, force = (float(np.sqrt((row**2).sum(axis=-1).mean())) for row in rows[:2])
        return position, force, float(np.sqrt((rows[2] ** 2).mean()))


def instants(duration: float) -> np.ndarray:
    """Times (k,) [s] that are compared: multiples of SAMPLE within the duration, both ends left out."""
    return SAMPLE * np.arange(1, round(duration / SAMPLE))
