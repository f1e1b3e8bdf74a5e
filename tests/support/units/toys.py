"""The toy units as FMU files, and a spring tied to a body ready to be stepped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from master.coupling.bond import Bond
from master.coupling.choose import coupling
from master.coupling.end import FmuEnd, end_value_ends, impedance_end, mobility_end
from master.coupling.hang_off import hang_off
from master.coupling.ledger import Action, Columns, Ledger
from master.coupling.scheme import Check, Scheme
from master.fmi.build import Recipe, build_fmu
from master.fmu.instance import Fmu
from master.studies import stability

HERE = Path(__file__).parent
SPRING = Recipe(HERE / "spring_fmu", "slave.SpringUnit", {}, "Six springs")
BODY = Recipe(Path(stability.__file__).parent / "units" / "body_fmu", "slave.BodyUnit", {})
SPRING_COLUMNS = Columns(("kinetic_energy", "elastic_energy"), ("current_work",), ("drag_dissipation",), "top_work")
BODY_COLUMNS = Columns(("kinetic_energy", "restoring_energy"), ("environment_work",), ("damping_dissipation",), "bond_work")


def spring_recipe(**parameters: Any) -> Recipe:
    """A spring FMU with other defaults (the failure's outputs and parameters exist only if it is named here)."""
    return Recipe(HERE / "spring_fmu", "slave.SpringUnit", parameters, "Six springs")


def build_pair(folder: Path, **parameters: Any) -> tuple[Path, Path]:
    """Files of a spring with these defaults and of a body."""
    return build_fmu(spring_recipe(**parameters), folder / "spring.fmu"), build_fmu(BODY, folder / "body.fmu")


@dataclass
class Pair:
    """A coupled spring and body."""

    spring: Fmu
    body: Fmu
    coupling: Scheme
    ledger: Ledger

    def run(self, step: float, end: float) -> None:
        """To `end` in macro steps of `step`, shorter ones where the coupling wants them."""
        for i in range(round(end / step)):
            self.run_one(i * step, step)

    def run_one(self, time: float, step: float) -> None:
        """One macro step."""
        limit = time + step
        while limit - time > 1e-9 * step:
            time += self.coupling.advance(time, limit - time).step

    @property
    def state(self) -> np.ndarray:
        """Stretch of the spring, end velocity of the body, (12,)."""
        return np.concatenate([self.spring.get("stretch"), self.body.get(("end_velocity", "end_angular_velocity"))])


@contextmanager
def tied(
    files: tuple[Path, Path],
    spring: Mapping[str, Any],
    body: Mapping[str, Any],
    step: float,
    scheme: str = "energy-consistent",
    by_port: bool = True,
    action: Action = "stop",
    tolerance: float = 1e-10,
    checked: bool = True,
    rollback: tuple[bool, bool] = (True, True),
) -> Iterator[Pair]:
    """Spring and body FMU, initialised and coupled; `by_port` False leaves the master to difference quotients,
    `rollback` says which of the two can."""
    with Fmu(files[0], "spring") as a, Fmu(files[1], "body") as b:
        a.initialize(spring)
        b.initialize(body)
        bond = hang_off()
        ledger = Ledger([(a, SPRING_COLUMNS), (b, BODY_COLUMNS)], action=action)
        check: Check = ledger.check if checked else lambda _: True
        ends = _ends(a, b, bond, scheme, by_port, rollback)
        yield Pair(a, b, coupling(scheme, *ends, bond, step, tolerance, check), ledger)


def _ends(a: Fmu, b: Fmu, bond: Bond, scheme: str, by_port: bool, rollback: tuple[bool, bool]) -> tuple[FmuEnd, FmuEnd]:
    if scheme == "energy-consistent":
        named = ("impedance", "mobility") if by_port else (None, None)
        return impedance_end(a, bond, named[0], rollback[0]), mobility_end(b, bond, named[1], rollback[1])
    return end_value_ends(a, b, bond)
