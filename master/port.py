"""Named ports of an FMU: a scalar variable, or all of ``name[1]`` to ``name[n]``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Port:
    """A scalar or vector variable."""

    name: str
    size: int
    unit: str
    causality: str
    kind: str
    description: str
    references: tuple[int, ...]


def read_ports(model: Any) -> dict[str, Port]:
    """Ports of FMPy's model description, in its order, which is also that of a vector's elements."""
    groups: dict[str, list[Any]] = {}
    for variable in model.modelVariables:
        groups.setdefault(re.sub(r"\[\d+\]$", "", variable.name), []).append(variable)
    return {
        name: Port(name, len(group), it.unit or "", it.causality, it.type, it.description or "", references)
        for name, group in groups.items()
        for it, references in [(group[0], tuple(variable.valueReference for variable in group))]
    }
