"""Two FMUs of the stability cases, built, coupled by any scheme and stepped through FMPy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from master.coupling.bond import Bond, Pair
from master.coupling.choose import coupling
from master.coupling.end import FmuEnd, impedance_end, mobility_end
from master.coupling.ledger import Columns, Ledger
from master.coupling.scheme import Scheme
from master.fmi.build import Recipe, cached_fmu
from master.fmi.native.export import native_fmu
from master.fmi.native.machine import own_platform
from master.fmu.instance import Fmu

UNITS = Path(__file__).parent / "units"
MASS = Recipe(UNITS / "linear_fmu", "slave.MassUnit", {})
SPRING = Recipe(UNITS / "linear_fmu", "slave.SpringUnit", {})
ARM = Recipe(UNITS / "manipulator_fmu", "slave.ArmUnit", {})
CYLINDER = Recipe(UNITS / "manipulator_fmu", "slave.CylinderUnit", {})
BODY = Recipe(UNITS / "body_fmu", "slave.BodyUnit", {})
END = 1e-9  # of a step: a time this close to the end is the end


@dataclass(frozen=True)
class Half:
    """One FMU of a pair: file, parameters, the ports it exchanges at the end of a step, its energies."""

    file: Path
    parameters: Mapping[str, Any]
    ends: tuple[str, ...]
    columns: Columns


@dataclass
class Pairing:
    """Two coupled FMUs at `time` [s]."""

    impedance: Fmu
    mobility: Fmu
    coupling: Scheme
    ledger: Ledger
    time: float

    def run(self, end: float) -> Iterator[float]:
        """Step to `end`; the time after every accepted step."""
        while end - self.time > END * self.coupling.macro_step:
            start, rest = self.time, end - self.time
            whole = self.coupling.macro_step - (start % self.coupling.macro_step)  # stay on the grid of macro steps
            limit = whole if whole > END * self.coupling.macro_step else whole + self.coupling.macro_step
            self.time = start + self.coupling.advance(start, min(limit, rest)).step
            yield self.time


def scalar_bond() -> Bond:
    """A force and a velocity."""
    return Bond((Pair("force", "velocity", 1e-6, 1),))


@contextmanager
def paired(
    impedance: Half,
    mobility: Half,
    bond: Bond,
    scheme: str,
    step: float,
    tolerance: float = 1e-9,
    start: float = 0.0,
    rollback: bool = True,
) -> Iterator[Pairing]:
    """Both FMUs initialised, coupled with macro steps of `step` [s]; the ledger warns at most. Raises FmuFailed."""
    with Fmu(impedance.file, "impedance") as a, Fmu(mobility.file, "mobility") as b:
        a.initialize(impedance.parameters, start)
        b.initialize(mobility.parameters, start)
        ledger = Ledger([(a, impedance.columns), (b, mobility.columns)], action="warn")
        if scheme == "energy-consistent":
            ends = impedance_end(a, bond, rollback=rollback), mobility_end(b, bond, rollback=rollback)
        else:
            ends = FmuEnd(a, bond.flows, impedance.ends), FmuEnd(b, bond.efforts, mobility.ends)
        yield Pairing(a, b, coupling(scheme, *ends, bond, step, tolerance, ledger.check), ledger, start)


def built(recipe: Recipe, folder: Path) -> Path:
    """The FMU of a recipe: in machine code, if its package has the kernels for it, else run by Python, in `folder`."""
    return native_fmu(recipe, [own_platform()]) if (recipe.package / "native.py").is_file() else cached_fmu(recipe, folder)
