"""What a scene of pipe and vessel may say: every key with its default, unit and meaning, read off the classes that check it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from master.scene import FOUND
from master.sections import RULES, Coupling, Simulation, Start, Tables, TopMotion
from pipe_fmu import PipeParameters
from pipe_fmu.environment import Environment
from vessel_fmu.parameters import VesselParameters

TABLES = {
    "simulation": Simulation, "environment": Environment, "start": Start, "pipe": PipeParameters, "vessel": VesselParameters,
    "coupling": Coupling, "top_motion": TopMotion, "tables": Tables,
}  # fmt: skip


def listing() -> str:
    """One line a key: name, default (`-` where it must be given or is absent) with the unit, meaning and what is allowed."""
    rows = [row for name, kind in TABLES.items() for row in _rows(name, kind)]
    widths = [max(len(row[i]) for row in rows) for i in range(2)]
    return "\n".join("  ".join((*(text.ljust(width) for text, width in zip(row, widths, strict=False)), row[2])).rstrip() for row in rows)


def _rows(path: str, kind: Any) -> Iterator[tuple[str, str, str]]:
    hints = get_type_hints(kind)
    for item in fields(kind):
        hint, name = hints[item.name], f"{path}.{item.name}"
        if name in FOUND:
            continue
        inner = next((one for one in (hint, *get_args(hint)) if is_dataclass(one)), None)
        if name == "pipe.sections":
            yield f"{name}[]", "-", "from foot to top: keys of pipe.section, which gives what they do not say"
        elif inner is not None:
            yield from _rows(f"{name}[]" if get_origin(hint) is tuple else name, inner)
        else:
            yield name, f"{_default(item)} {_unit(item)}".strip(), _meaning(item, hint)


def _default(item: Field[Any]) -> str:
    return "-" if item.default in (MISSING, None) else json.dumps(item.default)


def _unit(item: Field[Any]) -> str:
    unit = item.metadata.get("unit", "")
    return "" if unit == "1" else ", ".join(unit) if isinstance(unit, tuple) else str(unit)


def _meaning(item: Field[Any], hint: Any) -> str:
    bounds = [f"{sign} {item.metadata[key]:g}" for key, (sign, _) in RULES.items() if key in item.metadata]
    choices = [f"one of {', '.join(map(json.dumps, get_args(hint)))}"] if get_origin(hint) is Literal else []
    return "; ".join(text for text in (item.metadata.get("doc", ""), *bounds, *choices) if text)
