"""What moves two FMUs on a power bond, as a scene of any two FMUs names them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from master.coupling.bond import Bond
from master.coupling.choose import coupling
from master.coupling.end import FmuEnd, end_value_ends, impedance_end, mobility_end
from master.coupling.ledger import Ledger
from master.errors import UsageError
from master.fmu.instance import Fmu
from master.results.recorder import Signal
from master.run.drive import OnBond, Row
from master.run.warnings import Remarks
from master.run.wiring import Wiring, loaded
from master.scene.two_fmus import General


@dataclass(frozen=True)
class Cost:
    """Macro steps accepted and rejected, and steps asked of each unit."""

    macro_steps: int
    rejected_steps: int
    impedance_solves: int
    mobility_solves: int


class Bonded(OnBond):
    """Two initialised FMUs; see `master.run.drive.Drive`. Raises UsageError where one claims rollback that it has not."""

    _ends: tuple[FmuEnd, FmuEnd]

    def __init__(self, scene: General, wiring: Wiring) -> None:
        table, rules, bond = scene.bond, scene.coupling, wiring.bond()
        impedance, mobility = wiring.fmus[table.impedance], wiring.fmus[table.mobility]
        self.time = 0.0
        self.units, self.remarks = wiring.fmus, Remarks.of_start(wiring.fmus)
        self._wires, self._macro_step = wiring.connections(), scene.simulation.macro_step
        if rules.scheme == "energy-consistent":
            self._ends = (
                impedance_end(impedance, bond, table.impedance_derivative or None, rules.rollback, table.yielding),
                mobility_end(mobility, bond, table.mobility_derivative or None, rules.rollback),
            )
            self._check_rollback(bond)
        else:
            self._ends = end_value_ends(impedance, mobility, bond)
        reported = [(wiring.fmus[name], scene.units[name].energy) for name in (table.impedance, table.mobility)]
        sources = [(fmu, energy.columns) for fmu, energy in reported if energy is not None]  # of both or, checked before, of neither
        rest = self._macro_step * float(bond.idle_power(self._ends[0].result()))
        self.ledger = Ledger(sources, rules.energy_check, rules.on_violation, bond.idle_power, rest)
        self._coupling = coupling(rules.scheme, *self._ends, bond, self._macro_step, rules.tolerance, self.ledger.check)

    def _check_rollback(self, bond: Bond) -> None:
        """Check that each end that claims to roll back repeats a step, under more than it holds at rest. Raises UsageError."""
        impedance, mobility = self._ends
        flow, effort = mobility.result(), impedance.result()
        for end, held in ((impedance, flow + bond.flow_increments()), (mobility, effort + bond.effort_increments(effort))):
            if end.rollback and not end.restores(self.time, self._macro_step, held):
                claim = f"unit {end.fmu.name} claims to restore a saved state and does not (two steps from one state answer differently)"
                raise UsageError(f"coupling.rollback = true: must be false, for {claim}")

    @property
    def scheme(self) -> str:
        """See `Drive`."""
        fixed = [name for name, fmu in self.units.items() if not fmu.can_vary_step]
        return super().scheme + (f"; no step is halved, for {' and '.join(fixed)} cannot vary it" if fixed else "")

    @property
    def cost(self) -> Cost:
        """What it cost so far."""
        done = self._coupling.counters
        return Cost(done.steps, done.rejected_steps, self._ends[0].solves, self._ends[1].solves)

    def advance(self, end: float) -> None:
        """Take one step, not beyond `end` [s]; the further connections hold what they carry now."""
        for source, output, target, name in self._wires:
            target.set(name, source.get(output))
        super().advance(end)

    def derived(self) -> Row:
        """Nothing beside the ports."""
        return {}


def signals(scene: General, units: Mapping[str, Fmu]) -> list[Signal]:
    """The outputs to record, columns named unit.port and unit.port[i]."""
    found = []
    for unit, table in scene.units.items():
        for name in table.outputs:
            port = units[unit].port(name)
            names = [f"{unit}.{name}"] if port.size == 1 else [f"{unit}.{name}[{i}]" for i in range(1, port.size + 1)]
            found.append(Signal(unit, name, tuple((column, port.unit or "1") for column in names)))
    return found


@contextmanager
def open_bonded(scene: General) -> Iterator[Bonded]:
    """Load, check and initialise the FMUs of a scene; the mobility unit starts with the other's effort.

    Raises UsageError for what the scene has wrong, FmuFailed where an FMU refuses.
    """
    with loaded(scene) as wiring:
        bond, table = wiring.bond(), scene.bond
        impedance, mobility = wiring.fmus[table.impedance], wiring.fmus[table.mobility]
        wiring.connections()
        impedance.initialize(scene.settings[table.impedance]["parameters"], inputs=scene.settings[table.impedance]["inputs"])
        inputs = dict(scene.settings[table.mobility]["inputs"])
        for pair, name in zip(bond.pairs, bond.effort_inputs, strict=True):
            inputs[name] = impedance.get(pair.effort) * (-1.0 if pair.reverse else 1.0)
        mobility.initialize(scene.settings[table.mobility]["parameters"], inputs=inputs)
        yield Bonded(scene, wiring)
