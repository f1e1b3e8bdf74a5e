"""Scenes of any two FMUs on a power bond: the tables [units], [bond] and [[connections]], checked against the FMUs' ports.

    [units.a]                            # two units, names of one's own
    fmu = "a.fmu"                        # beside the scene file
    parameters = {stiffness = 2.0}
    inputs = {load = [1.0, 0.0, 0.0]}    # held for good, unless connected
    outputs = ["position"]               # recorded
    energy = {stored = ["elastic_energy"], supplied = [], dissipated = ["damper_heat"], bond = "top_work"}
    [bond]
    impedance = "a"                      # takes flows, answers efforts
    mobility = "b"                       # takes efforts, answers flows
    pairs = [{effort = "force", flow = "velocity", floor = 1e-6}]
    [[connections]]                      # further ones, held over each macro step
    from = "a.position"
    to = "b.target"
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from master.bond import Bond, Pair
from master.errors import UsageError
from master.fmi.schema import build
from master.fmu import Fmu, FmuFailed
from master.ledger import Columns
from master.port import Port
from master.sections import Coupling, Section, Simulation, _number


@dataclass(frozen=True)
class Energy:
    """Outputs in which a unit reports its energies [J]: stored, and since the start supplied from outside and dissipated; work
    done on it through the bond."""

    bond: str
    stored: tuple[str, ...] = ()
    supplied: tuple[str, ...] = ()
    dissipated: tuple[str, ...] = ()

    @property
    def columns(self) -> Columns:
        """As the ledger wants them."""
        return Columns(self.stored, self.supplied, self.dissipated, self.bond)


@dataclass(frozen=True)
class Unit:
    """[units.NAME]"""

    fmu: str
    outputs: tuple[str, ...] = ()
    energy: Energy | None = None


@dataclass(frozen=True)
class PairOfPorts(Section):
    """A row of bond.pairs, see `master.bond.Pair`."""

    effort: str
    flow: str
    floor: float = _number("flow that counts as rest", "1", above=0.0)
    effort_input: str = ""
    flow_input: str = ""
    end_effort: str = ""
    end_flow: str = ""
    met_flow: str = ""
    reverse: bool = False


@dataclass(frozen=True)
class BondTable:
    """[bond]; the derivative ports are dF/dV of the impedance unit, F = -effort, and d(flow)/d(effort) of the other.

    `yielding` is the input by which the impedance unit takes the latter, see `master.bond.FmuEnd.meet`.
    """

    impedance: str
    mobility: str
    pairs: tuple[PairOfPorts, ...]
    impedance_derivative: str = ""
    mobility_derivative: str = ""
    yielding: str = ""

    def __post_init__(self) -> None:
        if self.impedance == self.mobility:
            raise ValueError(f"mobility = {self.mobility!r}: must be another unit than impedance")
        if not self.pairs:
            raise ValueError("pairs = []: must have at least one row")
        if self.yielding and not all(pair.met_flow for pair in self.pairs):
            raise ValueError(f"yielding = {self.yielding!r}: must have a met_flow in every pair")


@dataclass(frozen=True)
class General:
    """The tables of a scene of two FMUs; parameters and inputs of the units, and the connections, stay plain mappings."""

    simulation: Simulation
    units: dict[str, Unit]
    bond: BondTable
    settings: Mapping[str, Mapping[str, Mapping[str, Any]]]
    connections: tuple[tuple[str, str], ...] = ()
    coupling: Coupling = field(default_factory=Coupling)
    folder: Path = Path()
    title: str = ""
    description: str = ""

    def __post_init__(self) -> None:
        if len(self.units) != 2:
            raise ValueError(f"units = {', '.join(self.units)}: must be two")
        for key in ("impedance", "mobility"):
            if (name := getattr(self.bond, key)) not in self.units:
                raise ValueError(f"bond.{key} = {name!r}: must be one of {', '.join(self.units)}")
        for key in ("recording_step", "snapshots"):
            if getattr(self.simulation, key):
                raise ValueError(f"simulation.{key}: must be absent in a scene of two FMUs")


def general(mapping: Mapping[str, Any], folder: Path) -> General:
    """The checked tables; FMU files are sought in `folder`. Raises ValueError (key = value: rule)."""
    units = mapping["units"]
    if not isinstance(units, Mapping):
        raise ValueError(f"units = {units!r}: must be a table")
    settings: dict[str, dict[str, Any]] = {}
    tables: dict[str, Unit] = {}
    for name, table in units.items():
        rest = dict(table) if isinstance(table, Mapping) else table
        if isinstance(rest, dict):
            settings[name] = {key: rest.pop(key, {}) for key in ("parameters", "inputs")}
            for key, value in settings[name].items():
                if not isinstance(value, Mapping):
                    raise ValueError(f"units.{name}.{key} = {value!r}: must be a table")
        tables[name] = build(Unit, rest, f"units.{name}")
    rows = mapping.get("connections", [])
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) and set(row) == {"from", "to"} for row in rows):
        raise ValueError(f"connections = {rows!r}: must be a list of tables with from and to, each unit.port")
    known = {key: value for key, value in mapping.items() if key not in ("units", "connections", "simulation", "bond", "coupling")}
    for key in known:
        if key not in ("title", "description"):
            allowed = "simulation, units, bond, connections, coupling, title, description"
            raise ValueError(f"{key} = {str(known[key])[:60]}: unknown key; allowed in a scene of two FMUs: {allowed}")
    for key in ("simulation", "bond"):
        if key not in mapping:
            raise ValueError(f"{key} = nothing: must be given")
    return General(
        build(Simulation, mapping["simulation"], "simulation"),
        tables,
        build(BondTable, mapping["bond"], "bond"),
        settings,
        tuple((str(row["from"]), str(row["to"])) for row in rows),
        build(Coupling, mapping.get("coupling", {}), "coupling"),
        folder,
        **{key: str(value) for key, value in known.items()},
    )


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
        names = (row.effort_input, row.flow_input, row.end_effort, row.end_flow, row.met_flow)
        return Pair(row.effort, row.flow, row.floor, ports[0].size, *names, row.reverse)

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
            found.append(tuple(ends))
        return found  # type: ignore[return-value]

    def port(self, where: str, unit: str, name: str, causality: str) -> Port:
        """The real port of this causality."""
        fmu = self.fmus[unit]
        port = fmu.ports.get(name)
        if port is None:
            there = ", ".join(fmu.names(causality)) or "none"
            raise UsageError(f"{where} = {name!r}: unit {unit} has no such {causality}; there are {there}")
        if port.causality != causality:
            raise UsageError(f"{where} = {name!r}: is of causality {port.causality} in unit {unit}, must be {causality}")
        if port.kind != "Real":
            raise UsageError(f"{where} = {name!r}: is {port.kind} in unit {unit}, must be Real")
        return port

    def check_settings(self) -> None:
        """Recorded outputs, energies, parameters and inputs exist."""
        for unit, table in self.scene.units.items():
            for name in table.outputs:
                self.port(f"units.{unit}.outputs", unit, name, "output")
            if table.energy is not None:
                kinds = {key: getattr(table.energy, key) for key in ("stored", "supplied", "dissipated")} | {"bond": (table.energy.bond,)}
                for key, names in kinds.items():
                    for name in names:
                        self.port(f"units.{unit}.energy.{key}", unit, name, "output")
            for name, value in self.scene.settings[unit]["inputs"].items():
                port = self.port(f"units.{unit}.inputs.{name}", unit, name, "input")
                if (len(value) if isinstance(value, list) else 1) != port.size:
                    raise UsageError(f"units.{unit}.inputs.{name} = {value}: must have {port.size} values")
            for name, value in self.scene.settings[unit]["parameters"].items():
                if (known := self.fmus[unit].ports.get(name)) is None or known.causality in ("output", "input"):
                    there = ", ".join(self.fmus[unit].names("parameter")) or "none"
                    raise UsageError(f"units.{unit}.parameters.{name} = {value}: unknown parameter; there are {there}")


@contextmanager
def loaded(scene: General) -> Iterator[Wiring]:
    """The FMUs of a scene, loaded and checked, not yet initialised. Raises UsageError for what the scene has wrong."""
    with ExitStack() as stack:
        fmus: dict[str, Fmu] = {}
        for name, unit in scene.units.items():
            path = scene.folder / unit.fmu
            if not path.is_file():
                raise UsageError(f"units.{name}.fmu = {unit.fmu!r}: no such file in {scene.folder.resolve()}")
            try:
                fmus[name] = stack.enter_context(Fmu(path, name))
            except FmuFailed as error:
                raise UsageError(f"units.{name}.fmu = {unit.fmu!r}: {error}") from None
        wiring = Wiring(scene, fmus)
        wiring.check_settings()
        yield wiring
