"""What a scene of pipe and vessel may say: every key with its default, unit and meaning, read off the classes that check it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from master.scene.reading import DEFAULTS, FOUND, Sections
from master.scene.sections import RULES, Coupling, Simulation, Start, Tables, TopMotion
from pipe_fmu import PipeParameters
from pipe_fmu.environment import Environment
from vessel_fmu.parameters import VesselParameters

TABLES = {
    "simulation": Simulation, "environment": Environment, "start": Start, "pipe": PipeParameters, "vessel": VesselParameters,
    "coupling": Coupling, "top_motion": TopMotion, "tables": Tables,
}  # fmt: skip


SWITCH = "off"  # in the place of a default: physics that acts only where its table stands in the scene, be it empty


def listing() -> str:
    """One line a key: name, default (`-` where it must be given or is absent) with the unit, meaning and what is allowed.

    Where a table switches physics on, its own line says so, and the defaults of its keys stand in brackets.
    """
    own = {item.name: item for item in fields(Sections) if "doc" in item.metadata}
    rows = [row for name, kind in TABLES.items() for row in (_table(name, kind, own[name]) if name in own else _rows(name, kind))]
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
            listed = f"{name}[]" if get_origin(hint) is tuple else name
            yield from _table(name, inner, item) if item.default is None else _rows(listed, inner)
        else:
            yield name, f"{_default(name, item)} {_unit(item)}".strip(), _meaning(item, hint)


def _table(name: str, kind: Any, item: Field[Any]) -> Iterator[tuple[str, str, str]]:
    """The rows of a table that switches physics on by standing in a scene, be it empty."""
    yield name, SWITCH, f"{item.metadata['doc']}; acts only where the table [{name}] stands in the scene"
    for key, default, meaning in _rows(name, kind):
        bare = default.split()[0] in ("-", SWITCH) or default.startswith("(")
        yield key, default if bare else f"({default})", meaning


def _default(name: str, item: Field[Any]) -> str:
    default = DEFAULTS.get(name, item.default)
    return "-" if default in (MISSING, None) else json.dumps(default)


def _unit(item: Field[Any]) -> str:
    unit = item.metadata.get("unit", "")
    return "" if unit == "1" else ", ".join(unit) if isinstance(unit, tuple) else str(unit)


def _meaning(item: Field[Any], hint: Any) -> str:
    bounds = [f"{sign} {item.metadata[key]:g}" for key, (sign, _) in RULES.items() if key in item.metadata]
    if "usual" in item.metadata:
        low, high = item.metadata["usual"]
        bounds.append(f"usually {low:g} to {high:g}")
    choices = [f"one of {', '.join(map(json.dumps, get_args(hint)))}"] if get_origin(hint) is Literal else []
    return "; ".join(text for text in (item.metadata.get("doc", ""), *bounds, *choices) if text)
