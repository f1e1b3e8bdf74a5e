"""What a run asks of whatever moves its FMUs, and what all that do so on a bond have in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from master.coupling.ledger import Ledger
from master.coupling.scheme import Scheme
from master.fmu.instance import Fmu
from master.run.warnings import Remarks

SNAP = 1e-10  # of a step: a time this close to a multiple of it is that multiple; round-off does not add up
Row = dict[tuple[str, str], float]


class Drive(Protocol):
    """Initialised units at `time` [s], advanced by one accepted macro step at a time; the ledger is kept with every step."""

    time: float
    ledger: Ledger
    remarks: Remarks

    @property
    def units(self) -> Mapping[str, Fmu]:
        """The FMUs by name."""

    @property
    def scheme(self) -> str:
        """The coupling in words."""

    @property
    def cost(self) -> Any:
        """What it cost so far, a dataclass of counts."""

    def advance(self, end: float) -> None:
        """Take one step, not beyond `end` [s]. Raises RunError, of which EnergyCheckFailed is one."""

    def derived(self) -> Row:
        """Values to record that no port holds, by (name, unit)."""


class OnBond:
    """What every drive with two FMUs on a power bond does alike."""

    time: float
    units: Mapping[str, Fmu]
    remarks: Remarks
    _macro_step: float
    _coupling: Scheme

    @property
    def scheme(self) -> str:
        """See `Drive`."""
        return self._coupling.words

    def advance(self, end: float) -> None:
        """See `Drive`."""
        step = self._coupling.advance(self.time, end - self.time)
        self.time = snapped(step.time + step.step, self._macro_step, end)
        self.remarks.note(self.units, self.time)


def snapped(time: float, step: float, end: float) -> float:
    """`time`, or the multiple of `step` or the `end` that it misses by round-off only."""
    for exact in (end, round(time / step) * step):
        if abs(time - exact) < SNAP * step:
            return exact
    return time
