"""Files that tell other hosts how pipe and vessel are connected: SSP 1.0, and those of the Open Simulation Platform (OSP).

Hosts without rollback exchange values once a step. What suits them is the vessel's velocity at the end of its step, held by
the pipe over the next one, and the pipe's mean pull, held by the vessel: of first order in the step, and stable for vessels well
above the mass that moves with the pipe's end (in the paper's scene at 0.05 s at 640 t, not at 190 t). A master that iterates
connects the vessel's mean velocity instead (`master.coupling.bond`).

The SSP connects the change of the pull from a reference, the pull at rest, which the vessel's unconnected `force` and `moment` have
for their start values: a host that puts zeros into connected inputs at its start, as FMPy does, then starts right. The OSP's hosts
exchange values before they step, and their power bonds need the whole pull.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .description import base_unit, scalar_names

SSD, SSC = "http://ssp-standard.org/SSP1/SystemStructureDescription", "http://ssp-standard.org/SSP1/SystemStructureCommon"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
OSP_SYSTEM = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"
OSP_MODEL = "https://open-simulation-platform.com/OspModelDescription/1.0.0"
ECCO_BOND = 0  # surge, where the vessel's positioning moves the pipe
ECCO_RANGE = 20.0  # longest step over the shortest
ECCO = {
    "SafetyFactor": 0.99, "MinimumChangeRate": 0.2, "MaximumChangeRate": 1.5, "ProportionalGain": 0.2, "IntegralGain": 0.15,
    "RelativeTolerance": 1e-3, "AbsoluteTolerance": 0.1,
}  # fmt: skip


class Wire(NamedTuple):
    """A connection of two vector ports of three components."""

    source: str
    output: str
    target: str
    input: str


WIRES = (
    Wire("vessel", "end_velocity", "pipe", "velocity"),
    Wire("vessel", "end_angular_velocity", "pipe", "angular_velocity"),
    Wire("pipe", "force", "vessel", "force"),
    Wire("pipe", "moment", "vessel", "moment"),
)
SEEN = {"pipe": ("top_position[1]", "top_position[2]", "top_position[3]", "top_work"),  # outputs beside the connections
        "vessel": ("hang_off_position[1]", "hang_off_position[2]", "hang_off_position[3]", "bond_work")}  # fmt: skip
CHANGES = (
    *WIRES[:2],
    Wire("pipe", "force_change", "vessel", "force_change"),
    Wire("pipe", "moment_change", "vessel", "moment_change"),
)
PORTS = {  # unit -> (port element of the OSP, name, its effort and flow: element, FMI name, unit)
    "pipe": (
        ("LinearMechanicalPort", "hang-off", ("Force", "force", "N"), ("LinearVelocity", "velocity", "m/s")),
        ("AngularMechanicalPort", "hang-off section", ("Torque", "moment", "N.m"), ("AngularVelocity", "angular_velocity", "rad/s")),
    ),
    "vessel": (
        ("LinearMechanicalPort", "hang-off", ("Force", "force", "N"), ("LinearVelocity", "end_velocity", "m/s")),
        ("AngularMechanicalPort", "hang-off section", ("Torque", "moment", "N.m"), ("AngularVelocity", "end_angular_velocity", "rad/s")),
    ),
}


SSP, OSP, OSP_ECCO = "system.ssp", "OspSystemStructure.xml", "OspSystemStructure_ecco.xml"
OSP_MODELS = {name: f"{name.capitalize()}_OspModelDescription.xml" for name in PORTS}  # the OSP wants the FMI model name before it
EXPORTED = (*(f"{name}.fmu" for name in PORTS), SSP, OSP, OSP_ECCO, *OSP_MODELS.values())


def write_system(fmus: Mapping[str, Path], folder: Path, macro_step: float, duration: float) -> list[Path]:
    """system.ssp, the two OSP structures and the models' port descriptions for the FMUs `pipe` and `vessel`; step and end in s."""
    structure = structure_description(macro_step, duration)
    files = {
        OSP: osp_structure(fmus, macro_step),
        OSP_ECCO: osp_structure(fmus, macro_step, ECCO_BOND),
    }
    files |= {OSP_MODELS[name]: osp_model(name) for name in fmus}
    written = [folder / SSP]
    with zipfile.ZipFile(written[0], "w") as archive:
        archive.writestr("SystemStructure.ssd", _text(structure), zipfile.ZIP_DEFLATED)
        for name, path in fmus.items():
            archive.write(path, f"resources/{name}.fmu")
    for name, root in files.items():
        (folder / name).write_bytes(_text(root))
        written.append(folder / name)
    return written


def structure_description(macro_step: float, duration: float) -> Element:
    """SystemStructure.ssd: both FMUs and plain connections; parameters and all other inputs keep the FMUs' start values.

    The step stands in an annotation: SSP 1.0 has no place for it, and OMSimulator takes the system for one without co-simulation otherwise.
    """
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    about = {"version": "1.0", "name": "pipelay", "generationTool": "pipelay", "generationDateAndTime": now}
    root = Element("ssd:SystemStructureDescription", {"xmlns:ssd": SSD, "xmlns:ssc": SSC, "xmlns:oms": OMS, **about})
    system = SubElement(root, "ssd:System", name="pipelay")
    elements = SubElement(system, "ssd:Elements")
    for name in PORTS:
        about = {"name": name, "source": f"resources/{name}.fmu", "type": "application/x-fmu-sharedlibrary"}
        connectors = SubElement(SubElement(elements, "ssd:Component", about), "ssd:Connectors")
        for wire in CHANGES:
            for kind, unit, port in (("output", wire.source, wire.output), ("input", wire.target, wire.input)):
                for scalar in scalar_names(port, 3) if unit == name else ():
                    SubElement(SubElement(connectors, "ssd:Connector", name=scalar, kind=kind), "ssc:Real")
        for scalar in SEEN[name]:
            SubElement(SubElement(connectors, "ssd:Connector", name=scalar, kind="output"), "ssc:Real")
    connections = SubElement(system, "ssd:Connections")
    for wire in CHANGES:
        for start, end in _scalars(wire):
            ends = {"startElement": wire.source, "startConnector": start, "endElement": wire.target, "endConnector": end}
            SubElement(connections, "ssd:Connection", ends)
    annotation = SubElement(SubElement(system, "ssd:Annotations"), "ssc:Annotation", type="org.openmodelica")
    information = SubElement(SubElement(annotation, "oms:Annotations"), "oms:SimulationInformation")
    tolerances = {"absoluteTolerance": "0.0001", "relativeTolerance": "0.0001"}  # of no effect with fixed steps
    SubElement(information, "oms:FixedStepMaster", {"description": "oms-ma", "stepSize": repr(macro_step), **tolerances})
    SubElement(root, "ssd:DefaultExperiment", startTime="0", stopTime=repr(duration))
    return root


def osp_structure(fmus: Mapping[str, Path], macro_step: float, bond: int | None = None) -> Element:
    """OspSystemStructure.xml: plain connections, fixed steps; or steps by ECCO from the power of the scalar `bond`, 0 to 5.

    One only: the reader of libcosim 0.11 (libcosimpy 0.0.6) refuses a second one. All six can be given through its interface.
    """
    root = Element("OspSystemStructure", xmlns=OSP_SYSTEM, version="0.1")
    SubElement(root, "BaseStepSize").text = repr(macro_step)
    SubElement(root, "Algorithm").text = "fixedStep" if bond is None else "ecco"
    simulators = SubElement(root, "Simulators")
    for name, path in fmus.items():
        SubElement(simulators, "Simulator", name=name, source=path.name)
    connections = SubElement(root, "Connections")
    for k, wire in enumerate(WIRES):
        for i, (start, end) in enumerate(_scalars(wire)):
            bonded = bond == 3 * (k % 2) + i  # of flow and effort alike
            connection = SubElement(connections, "VariableConnection", {"powerBond": "hang-off"} if bonded else {})
            for unit, name, causality in ((wire.source, start, "output"), (wire.target, end, "input")):
                SubElement(connection, "Variable", {"simulator": unit, "name": name} | ({"causality": causality} if bonded else {}))
    if bond is not None:
        parameters = SubElement(root, "EccoConfiguration")
        steps = {"StepSize": macro_step, "MinimumStepSize": macro_step / ECCO_RANGE, "MaximumStepSize": macro_step}
        for name, value in {**steps, **ECCO}.items():
            SubElement(parameters, name).text = repr(value)
    return root


def osp_model(unit: str) -> Element:
    """The hang-off of a unit as mechanical ports of the OSP."""
    root = Element("OspModelDescription", xmlns=OSP_MODEL, version="1.0")
    definitions = SubElement(root, "UnitDefinitions")
    for symbol in sorted({part[2] for port in PORTS[unit] for part in port[2:]}):
        exponents = {key: f"{value:g}" for key, value in base_unit(symbol).items()}
        SubElement(SubElement(definitions, "Unit", name=symbol), "BaseUnit", exponents)
    groups = SubElement(root, "VariableGroups")
    for element, name, *parts in PORTS[unit]:
        port = SubElement(groups, element, name=name)
        for kind, variable, symbol in parts:
            group = SubElement(port, kind, name=f"{name} {kind}")
            for scalar in scalar_names(variable, 3):
                SubElement(group, "Variable", ref=scalar, unit=symbol)
    return root


def _scalars(wire: Wire) -> Iterator[tuple[str, str]]:
    return zip(scalar_names(wire.output, 3), scalar_names(wire.input, 3), strict=True)


def _text(root: Element) -> bytes:
    indent(root)
    return tostring(root, encoding="utf-8", xml_declaration=True)
