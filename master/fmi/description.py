"""What ``modelDescription.xml`` needs beyond PythonFMU: units, ranges, dependencies, initial unknowns (FMI 2.0.4, 2.2).

Dependencies. Every output is a mean over, or a value at the end of, the step just done, so at a communication point no
output depends on an input: ``dependencies=""``, and a host sees no algebraic loop between two coupled FMUs. At
initialisation an output depends on the parameters alone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, SubElement

_DERIVED: dict[str, dict[str, float]] = {
    **{base: {base: 1} for base in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Hz": {"s": -1},
    "deg": {"rad": 1, "factor": math.pi / 180},
    "1": {},
}
_VARIABILITY = {"input": "continuous", "output": "continuous", "parameter": "fixed"}


@dataclass(frozen=True)
class Variable:
    """One scalar variable; its value reference is its place in the list."""

    name: str
    causality: str
    kind: str = "Real"
    unit: str = ""
    doc: str = ""
    start: float | int | bool | str | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    items: tuple[str, ...] = ()  # of an enumeration; `start` is a number from 1 on


def scalar_names(name: str, size: int) -> list[str]:
    """FMI names of a port: the name itself, or ``name[1]`` to ``name[size]``."""
    return [name] if size == 1 else [f"{name}[{i}]" for i in range(1, size + 1)]


def base_unit(unit: str) -> dict[str, float]:
    """SI base exponents (and ``factor``) of a unit such as ``N.m``, ``kg/m3``, ``N.s2/m2``.

    Raises ValueError for a symbol it does not know.
    """
    total: dict[str, float] = {}
    for place, part in enumerate(unit.split("/")):
        for term in part.strip("()").split("."):
            match = re.fullmatch(r"([A-Za-z]+|1)(-?\d+)?", term)
            if match is None or match[1] not in _DERIVED:
                raise ValueError(f"unit = {unit!r}: {term!r} is not among {', '.join(_DERIVED)}")
            power = int(match[2] or 1) * (-1 if place else 1)
            for base, exponent in _DERIVED[match[1]].items():
                if base == "factor":
                    total[base] = total.get(base, 1.0) * exponent**power
                else:
                    total[base] = total.get(base, 0) + exponent * power
    return {base: exponent for base, exponent in total.items() if exponent != 0}


def fill(root: Element, variables: Sequence[Variable]) -> None:
    """Put units, variables and the model structure into the frame that PythonFMU made of a slave without variables."""
    units = sorted({variable.unit for variable in variables if variable.unit})
    if units:
        root.insert(1, _unit_definitions(units))  # the schema wants it straight after CoSimulation
    if enumerations := [variable for variable in variables if variable.items]:
        root.insert(2 if units else 1, _type_definitions(enumerations))
    table, structure = root.find("ModelVariables"), root.find("ModelStructure")
    assert table is not None
    assert structure is not None
    for reference, variable in enumerate(variables):
        table.append(_scalar_variable(variable, reference))
    outputs = [i for i, variable in enumerate(variables, 1) if variable.causality == "output"]
    parameters = [i for i, variable in enumerate(variables, 1) if variable.causality == "parameter"]
    if outputs:
        _unknowns(SubElement(structure, "Outputs"), outputs, [])
        _unknowns(SubElement(structure, "InitialUnknowns"), outputs, parameters)


def _unit_definitions(units: Iterable[str]) -> Element:
    definitions = Element("UnitDefinitions")
    for unit in units:
        exponents = {key: f"{value:.17g}" for key, value in base_unit(unit).items()}
        SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", exponents)
    return definitions


def _type_definitions(enumerations: Iterable[Variable]) -> Element:
    definitions = Element("TypeDefinitions")
    for variable in enumerations:
        table = SubElement(SubElement(definitions, "SimpleType", name=_type_name(variable)), "Enumeration")
        for value, item in enumerate(variable.items, 1):
            SubElement(table, "Item", name=item, value=str(value))
    return definitions


def _type_name(variable: Variable) -> str:
    """Of the enumeration's type, which must not be the name of a variable."""
    return f"{variable.name}.items"


def _scalar_variable(variable: Variable, reference: int) -> Element:
    about = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
    counts = variable.causality == "output" and variable.kind == "Integer"
    about["variability"] = "discrete" if counts else _VARIABILITY[variable.causality]
    if variable.causality != "input":
        about["initial"] = "calculated" if variable.causality == "output" else "exact"
    if variable.doc:
        about["description"] = variable.doc
    element = Element("ScalarVariable", about)
    details: dict[str, Any] = {"start": variable.start, "min": variable.minimum, "max": variable.maximum, "nominal": variable.nominal}
    details |= {"unit": variable.unit or None, "declaredType": _type_name(variable) if variable.items else None}
    SubElement(element, variable.kind, {key: _text(value) for key, value in details.items() if value is not None})
    return element


def _unknowns(parent: Element, unknowns: Iterable[int], dependencies: Sequence[int]) -> None:
    text = " ".join(map(str, dependencies))
    for index in unknowns:
        SubElement(parent, "Unknown", index=str(index), dependencies=text)


def _text(value: float | int | bool | str) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
