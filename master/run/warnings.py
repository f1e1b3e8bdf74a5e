"""What the units of a run say of their start and of its steps by their logs: warnings that the report must not lose."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from master.fmu.instance import Fmu

_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")


@dataclass
class Told:
    """Remarks that differ in their numbers only: how many, time and words of the first and of the last."""

    times: int
    first_s: float
    first: str
    last_s: float
    last: str


@dataclass
class Remarks:
    """What each unit said of its start, and of accepted steps, by kind."""

    start: dict[str, list[str]] = field(default_factory=dict)
    steps: dict[str, dict[str, Told]] = field(default_factory=dict)

    @staticmethod
    def of_start(units: Mapping[str, Fmu]) -> Remarks:
        """What units just initialised say of their start."""
        return Remarks({name: fmu.remark.splitlines() for name, fmu in units.items() if fmu.remark})

    def note(self, units: Mapping[str, Fmu], time: float) -> None:
        """Take in what the units say of the step just accepted, which ended at `time` [s]."""
        for name, fmu in units.items():
            for words in fmu.remark.splitlines():
                kinds = self.steps.setdefault(name, {})
                told = kinds.setdefault(_NUMBER.sub("", words), Told(0, time, words, time, words))
                told.times, told.last_s, told.last = told.times + 1, time, words

    def summary(self) -> dict[str, list[dict[str, Any]]]:
        """The remarks on steps by unit, as summary.json has them."""
        return {name: [asdict(told) for told in kinds.values()] for name, kinds in self.steps.items()}
