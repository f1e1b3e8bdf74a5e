"""What every coupling scheme speaks of: an accepted step, the ends it asks, how it fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..fmu.errors import FmuError
from .bond import Matrix, Vector

SLIVER = 1e-9  # of a step: a remainder that is round-off of the time


class End(Protocol):
    """One end of the bond, see `master.coupling.end.FmuEnd`."""

    @property
    def solves(self) -> int: ...

    rollback: bool
    yields: bool
    varies: bool  # takes steps of any length

    def begin(self) -> None: ...
    def solve(self, time: float, step: float, held: Vector) -> Vector: ...
    def result(self) -> Vector: ...
    def mean(self) -> Vector: ...
    def derivative(self) -> Matrix | None: ...
    def meet(self, time: float, step: float, free: Vector, mobility: Matrix) -> tuple[Vector, Vector] | None: ...
    def commit(self) -> None: ...
    def cancel(self) -> None: ...


@dataclass(frozen=True)
class Step:
    """An accepted step: its start, length, mean flow and effort (of the impedance end), bond residual [J], rounds."""

    time: float
    step: float
    flow: Vector
    effort: Vector
    residual: float
    rounds: int


@dataclass
class Counters:
    """Work done so far."""

    steps: int = 0
    rejected_steps: int = 0
    rounds: list[int] = field(default_factory=list)


class CouplingFailed(FmuError):  # noqa: N818
    """No agreement between the ends down to the smallest step; time [s], step [s], residual [J]."""

    def __init__(self, time: float, step: float, residual: float, reason: str) -> None:
        super().__init__(f"coupling failed at {time:.9g} s with a step of {step:.3g} s: {reason}")
        self.time, self.step, self.residual = time, step, residual


Check = Callable[[Step], bool]


def accept(step: Step) -> bool:
    """The check that finds nothing wrong."""
    return True


def within(limit: float, macro_step: float) -> float:
    """The length of the next step [s]: the macro step, or `limit` if that is less or longer by round-off only."""
    return limit if limit < (1 + SLIVER) * macro_step else macro_step


class Scheme(Protocol):
    """A way to couple two ends. A step of it calls, on each end: begin, then solve or meet as often as it can, then commit or cancel."""

    impedance: Any
    mobility: Any
    counters: Counters
    check: Check
    macro_step: float  # s, the longest step

    @property
    def words(self) -> str:
        """What is done, for the report."""

    def advance(self, time: float, limit: float) -> Step:
        """One accepted step from `time` [s], at most to `time` + `limit`. Raises CouplingFailed, FmuFailed."""
