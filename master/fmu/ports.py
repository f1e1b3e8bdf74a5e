"""Named ports of an FMU: a scalar variable, or all of ``name[1]`` to ``name[n]``."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

SAME = 1e-9  # of a factor: what rounds in a unit's definition


@dataclass(frozen=True)
class Measure:
    """A unit: how many of the SI's it is, and the exponents of kg, m, s, A, K, mol, cd; angles count as numbers."""

    factor: float
    exponents: tuple[int, ...]

    def __mul__(self, other: Measure) -> Measure:
        return Measure(self.factor * other.factor, tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def same(self, other: Measure) -> bool:
        """Whether numbers in either unit mean the same."""
        return self.exponents == other.exponents and math.isclose(self.factor, other.factor, rel_tol=SAME)


ENERGY = Measure(1.0, (1, 2, -2, 0, 0, 0, 0))
POWER = Measure(1.0, (1, 2, -3, 0, 0, 0, 0))


@dataclass(frozen=True)
class Port:
    """A scalar or vector variable; `measure` None: the FMU does not say what its unit means."""

    name: str
    size: int
    unit: str
    causality: str
    kind: str
    description: str
    references: tuple[int, ...]
    measure: Measure | None = None
    items: tuple[tuple[str, int], ...] = ()  # of an enumeration: names and numbers


def read_ports(model: Any) -> dict[str, Port]:
    """Ports of FMPy's model description, in its order, which is also that of a vector's elements."""
    units = {unit.name: _measure(unit.baseUnit) for unit in model.unitDefinitions if unit.baseUnit is not None}
    groups: dict[str, list[Any]] = {}
    for variable in model.modelVariables:
        groups.setdefault(re.sub(r"\[\d+\]$", "", variable.name), []).append(variable)
    return {
        name: Port(name, len(group), it.unit or "", it.causality, it.type, it.description or "", references, units.get(it.unit), _items(it))
        for name, group in groups.items()
        for it, references in [(group[0], tuple(variable.valueReference for variable in group))]
    }


def _items(variable: Any) -> tuple[tuple[str, int], ...]:
    return tuple((item.name, int(item.value)) for item in getattr(variable.declaredType, "items", ()))


def _measure(base: Any) -> Measure:
    exponents = (base.kg, base.m, base.s, base.A, base.K, base.mol, base.cd)
    return Measure(float(base.factor), tuple(int(exponent or 0) for exponent in exponents))
