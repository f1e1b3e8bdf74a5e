"""Scenes of any two FMUs on a power bond: the tables [units], [bond] and [[connections]]; see `master.run.wiring` for the ports.

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

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from master.coupling.ledger import Columns
from master.fmi.schema import build
from master.scene.sections import Coupling, SceneTable, Simulation, _number


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
class PairOfPorts(SceneTable):
    """A row of bond.pairs, see `master.coupling.bond.Pair`."""

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

    `yielding` is the input by which the impedance unit takes the latter, see `master.coupling.end.FmuEnd.meet`.
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
            raise ValueError(f"{key}: must be given")
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
