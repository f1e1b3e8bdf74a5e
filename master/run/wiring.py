"""The FMUs of a scene of any two, loaded, and its names checked against their ports."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

from master.coupling.bond import Bond, Pair
from master.errors import UsageError
from master.fmu.errors import FmuFailed
from master.fmu.instance import Fmu
from master.fmu.ports import ENERGY, POWER, Port
from master.scene.two_fmus import General, PairOfPorts

TYPES: dict[str, tuple[type, ...]] = {  # of FMI variables; others are texts
    "Real": (float, int), "Integer": (int,), "Boolean": (bool,), "Enumeration": (str, int),
}  # fmt: skip
WHOLE = 1e-12  # of a number: this close it is whole but for round-off


class Wiring:
    """Ports of two loaded FMUs, found by the names a scene gives; raises UsageError naming the key."""

    def __init__(self, scene: General, fmus: Mapping[str, Fmu]) -> None:
        self.scene, self.fmus = scene, fmus

    def bond(self) -> Bond:
        """The bond with the sizes of its ports."""
        table = self.scene.bond
        rows = [self._pair(f"bond.pairs[{i}]", row) for i, row in enumerate(table.pairs, 1)]
        matrices = (
            ("impedance_derivative", table.impedance, "output"),
            ("mobility_derivative", table.mobility, "output"),
            ("yielding", table.impedance, "input"),
        )
        for key, unit, causality in matrices:
            if name := getattr(table, key):
                port, size = self.port(f"bond.{key}", unit, name, causality), sum(pair.size for pair in rows)
                if port.size != size * size:
                    raise UsageError(f"bond.{key} = {name!r}: has {port.size} values, must have {size} x {size}")
        return Bond(tuple(rows))

    def _pair(self, where: str, row: PairOfPorts) -> Pair:
        table = self.scene.bond
        asked = [
            ("effort", row.effort, table.impedance, "output"),
            ("flow", row.flow, table.mobility, "output"),
            ("effort_input" if row.effort_input else "effort", row.effort_input or row.effort, table.mobility, "input"),
            ("flow_input" if row.flow_input else "flow", row.flow_input or row.flow, table.impedance, "input"),
            ("end_effort", row.end_effort, table.impedance, "output"),
            ("end_flow", row.end_flow, table.mobility, "output"),
            ("met_flow", row.met_flow, table.impedance, "output"),
        ]
        ports = [self.port(f"{where}.{key}", unit, name, causality) for key, name, unit, causality in asked if name]
        for port in ports[1:]:
            if port.size != ports[0].size:
                raise UsageError(f"{where}: {ports[0].name} has {ports[0].size} values and {port.name} {port.size}; must be equal")
        self._check_power(where, ports)
        names = (row.effort_input, row.flow_input, row.end_effort, row.end_flow, row.met_flow)
        return Pair(row.effort, row.flow, row.floor, ports[0].size, *names, row.reverse)

    def _check_power(self, where: str, ports: list[Port]) -> None:
        """Effort times flow is a power in W, each unit the same at both ends, as far as the FMUs say."""
        effort, flow, effort_input, flow_input, *_ = ports
        _check_unit(where, effort, effort_input)
        _check_unit(where, flow, flow_input)
        if effort.measure and flow.measure and not (effort.measure * flow.measure).same(POWER):
            raise UsageError(f"{where}: {effort.name} [{effort.unit}] times {flow.name} [{flow.unit}] must be a power in W")

    def connections(self) -> list[tuple[Fmu, str, Fmu, str]]:
        """Source and target of the further connections."""
        found = []
        for i, row in enumerate(self.scene.connections, 1):
            ends, ports = [], []
            for key, place, causality in zip(("from", "to"), row, ("output", "input"), strict=True):
                unit, _, name = place.partition(".")
                if unit not in self.fmus:
                    raise UsageError(f"connections[{i}].{key} = {place!r}: must begin with one of {', '.join(self.fmus)} and a dot")
                ports.append(self.port(f"connections[{i}].{key}", unit, name, causality))
                ends += [self.fmus[unit], name]
            if ports[0].size != ports[1].size:
                raise UsageError(f"connections[{i}]: {row[0]} has {ports[0].size} values and {row[1]} {ports[1].size}; must be equal")
            _check_unit(f"connections[{i}]", *ports)
            found.append(tuple(ends))
        return found  # type: ignore[return-value]

    def port(self, where: str, unit: str, name: str, causality: str, kinds: tuple[str, ...] = ("Real",)) -> Port:
        """The port of this causality and one of these kinds."""
        fmu = self.fmus[unit]
        port = fmu.ports.get(name)
        if port is None:
            there = ", ".join(fmu.names(causality)) or "none"
            raise UsageError(f"{where} = {name!r}: unit {unit} has no such {causality}; there are {there}")
        if port.causality != causality:
            raise UsageError(f"{where} = {name!r}: is of causality {port.causality} in unit {unit}, must be {causality}")
        if port.kind not in kinds:
            raise UsageError(f"{where} = {name!r}: is {port.kind} in unit {unit}, must be {' or '.join(kinds)}")
        return port

    def check_steps(self) -> None:
        """No step but the macro step is asked of a unit that cannot vary it."""
        simulation = self.scene.simulation
        for unit, fmu in self.fmus.items():
            if fmu.can_vary_step:
                continue
            steps = simulation.duration / simulation.macro_step
            if abs(steps - round(steps)) > WHOLE * steps:
                rule = f"must be a multiple of macro_step = {simulation.macro_step:g} s, which unit {unit} cannot vary"
                raise UsageError(f"simulation.duration = {simulation.duration:g}: {rule}")
            if self.scene.coupling.on_violation == "refine":
                raise UsageError(f"coupling.on_violation = 'refine': must be stop or warn, for unit {unit} cannot vary its step")

    def check_settings(self) -> None:
        """Recorded outputs, energies, parameters and inputs exist; of the two units on the bond none or both report energies."""
        ends = (self.scene.bond.impedance, self.scene.bond.mobility)
        silent = [unit for unit in ends if self.scene.units[unit].energy is None]
        if len(silent) == 1:
            raise UsageError(f"units.{silent[0]}.energy: must be given, as for the other unit on the bond, or for neither")
        for unit, table in self.scene.units.items():
            for name in table.outputs:
                self.port(f"units.{unit}.outputs", unit, name, "output", ("Real", "Integer"))
            if table.energy is not None:
                kinds = {key: getattr(table.energy, key) for key in ("stored", "supplied", "dissipated")} | {"bond": (table.energy.bond,)}
                for key, names in kinds.items():
                    for name in names:
                        port = self.port(f"units.{unit}.energy.{key}", unit, name, "output")
                        if port.measure and not port.measure.same(ENERGY):
                            raise UsageError(f"units.{unit}.energy.{key} = {name!r}: is in {port.unit}, must be in J")
            for name, value in self.scene.settings[unit]["inputs"].items():
                port = self.port(f"units.{unit}.inputs.{name}", unit, name, "input")
                _check_value(f"units.{unit}.inputs.{name}", value, port)
            for name, value in self.scene.settings[unit]["parameters"].items():
                if (known := self.fmus[unit].ports.get(name)) is None or known.causality in ("output", "input"):
                    there = ", ".join(self.fmus[unit].names("parameter")) or "none"
                    raise UsageError(f"units.{unit}.parameters.{name} = {value}: unknown parameter; there are {there}")
                _check_value(f"units.{unit}.parameters.{name}", value, known)


def _check_unit(where: str, source: Port, target: Port) -> None:
    """Both ports in the same unit, as far as the FMUs say."""
    if source.measure and target.measure and not source.measure.same(target.measure):
        raise UsageError(f"{where}: {source.name} is in {source.unit} and {target.name} in {target.unit}; must be the same")


@contextmanager
def loaded(scene: General) -> Iterator[Wiring]:
    """The FMUs of a scene, loaded and checked, not yet initialised. Raises UsageError for what the scene has wrong."""
    with ExitStack() as stack:
        fmus: dict[str, Fmu] = {}
        for name, unit in scene.units.items():
            path = scene.folder / unit.fmu
            if not os.path.isfile(path):  # nor one of a name that cannot be
                raise UsageError(f"units.{name}.fmu = {unit.fmu!r}: no such file in {scene.folder.resolve()}")
            try:
                fmus[name] = stack.enter_context(Fmu(path, name))
            except FmuFailed as error:
                raise UsageError(f"units.{name}.fmu = {unit.fmu!r}: {error}") from None
        wiring = Wiring(scene, fmus)
        wiring.check_settings()
        wiring.check_steps()
        yield wiring


def _check_value(key: str, value: Any, port: Port) -> None:
    """A setting has the size and the type of its port. Raises UsageError."""
    values = value if isinstance(value, list) else [value]
    if len(values) != port.size:
        raise UsageError(f"{key} = {value!r}: must have {port.size} value{'s' * (port.size > 1)}")
    allowed = TYPES.get(port.kind, (str,))
    for one in values:
        if not isinstance(one, allowed) or (isinstance(one, bool) and port.kind != "Boolean"):
            raise UsageError(f"{key} = {value!r}: must be of type {port.kind}")
