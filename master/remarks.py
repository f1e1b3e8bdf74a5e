"""What the units of a run say of its steps by their logs: warnings that the report must not lose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from master.fmu import Fmu


@dataclass
class Remarks:
    """What each unit said of its start; of how many accepted steps it said something, and its words of the first."""

    start: dict[str, str] = field(default_factory=dict)
    count: dict[str, int] = field(default_factory=dict)
    first: dict[str, str] = field(default_factory=dict)

    @staticmethod
    def of_start(units: Mapping[str, Fmu]) -> Remarks:
        """What units just initialised say of their start."""
        return Remarks({name: fmu.remark for name, fmu in units.items() if fmu.remark})

    def note(self, units: Mapping[str, Fmu]) -> None:
        """Take in what the units say of the step just accepted."""
        for name, fmu in units.items():
            if fmu.remark:
                self.count[name] = self.count.get(name, 0) + 1
                self.first.setdefault(name, fmu.remark)
