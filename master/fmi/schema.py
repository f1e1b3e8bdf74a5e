"""Parameters of a unit as three equal forms: frozen dataclass tree, nested mapping (TOML, JSON), flat list (FMI).

Part of every exported FMU, so this module imports the standard library only. Field types understood: float, int,
bool, str, Literal (of texts: an enumeration), fixed tuples of numbers, tuple[X, ...], a nested dataclass, and ``X | None`` of any of them
(None = absent). Field metadata: ``unit`` (or one each for a fixed tuple), ``doc``, ``min``/``max`` and the strict
``above``/``below``; ranges are the dataclass's own business (``__post_init__`` raises ``ValueError("key = value: rule")``), here
the path is put before it.
"""

from __future__ import annotations

import difflib
import json
import math
import re
import types
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

T = TypeVar("T")
_KINDS = {float: "Real", int: "Integer", bool: "Boolean", str: "String"}
_RULES = {float: "must be a number", int: "must be an integer", bool: "must be true or false", str: "must be a text"}


@dataclass(frozen=True)
class Parameter:
    """One scalar FMI parameter: its FMI type, value (of an enumeration the item's name) and what the field says about it."""

    kind: str
    value: float | int | bool | str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    doc: str = ""
    items: tuple[str, ...] = ()  # of an enumeration
    above: bool = False  # the minimum itself is refused
    below: bool = False  # the maximum itself is refused

    @property
    def rule(self) -> str:
        """What a number out of range is told."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        low = [f"{'>' if self.above else '>='} {self.minimum:g}{unit}"] if self.minimum is not None else []
        high = [f"{'<' if self.below else '<='} {self.maximum:g}{unit}"] if self.maximum is not None else []
        return f"must be {' and '.join(low + high)}" if low or high else ""


def build(cls: type[T], mapping: Mapping[str, Any], path: str = "") -> T:
    """The dataclass tree `cls` from a nested mapping.

    Raises ValueError with one line ``path.key = value: rule`` for an unknown key, a missing one, a wrong type, a
    number that is not finite, and whatever the dataclasses refuse themselves.
    """
    if isinstance(mapping, cls):
        return mapping
    if not isinstance(mapping, Mapping):
        raise _fault(path, mapping, "must be a table")
    known = {field.name: field for field in fields(cls) if field.init}  # type: ignore[arg-type]
    for key, value in mapping.items():
        if key not in known:
            near = difflib.get_close_matches(str(key), known, 1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            raise _fault(_join(path, key), value, f"unknown key{hint}; allowed: {', '.join(known)}")
    hints = get_type_hints(cls)
    values = {}
    for name, field in known.items():
        if name in mapping:
            values[name] = _convert(hints[name], mapping[name], _join(path, name))
        elif field.default is MISSING and field.default_factory is MISSING:
            raise _fault(_join(path, name), None, "must be given")
    try:
        return cls(**values)
    except ValueError as error:
        raise ValueError(_join(path, str(error))) from None


def to_mapping(tree: Any) -> dict[str, Any]:
    """Nested mapping of plain values (JSON, TOML); fields that are None are left out."""
    pairs = ((field.name, getattr(tree, field.name)) for field in fields(tree) if field.init)
    return {name: _plain(value) for name, value in pairs if value is not None}


def to_json(tree: Any) -> str:
    """The tree as one line of JSON; floats keep every bit."""
    return json.dumps(to_mapping(tree), separators=(",", ":"))


def from_json(cls: type[T], text: str, path: str = "configuration") -> T:
    """Inverse of `to_json`. Raises ValueError as `build` does."""
    return build(cls, _loads(text, path), path)


def flatten(tree: Any) -> dict[str, Parameter]:
    """Dotted FMI names to `Parameter`: ``seabed.friction``, ``hang_off[1]``; lists of any length are one JSON text."""
    flat: dict[str, Parameter] = {}
    _flatten(tree, "", flat)
    return flat


def override(tree: T, changes: Mapping[str, Any]) -> T:
    """A new tree with the flat names in `changes` replaced. Raises ValueError as `build` does."""
    mapping = to_mapping(tree)
    for name, value in changes.items():
        *parents, last = name.split(".")
        table: Any = mapping
        for parent in parents:
            table = table.get(parent, {}) if isinstance(table, dict) else {}
        key, index = re.fullmatch(r"(\w*)(?:\[(\d+)\])?", last).groups()  # type: ignore[union-attr]
        if key not in table or (index and not 1 <= int(index) <= len(table[key])):
            raise _fault(name, value, f"unknown parameter; allowed: {', '.join(flatten(tree))}")
        if index:
            table[key][int(index) - 1] = value
        else:
            table[key] = _loads(value, name) if isinstance(table[key], list) else value
    return build(type(tree), mapping)


def _is_finite(value: float | int) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond all floats
        return False


def _convert(hint: Any, value: Any, where: str) -> Any:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        inner = [argument for argument in arguments if argument is not type(None)]
        return None if value is None else _convert(inner[0], value, where)
    if origin is Literal:
        if value not in arguments:
            raise _fault(where, value, f"must be one of {', '.join(map(repr, arguments))}")
        return value
    if origin is tuple:
        return _convert_tuple(arguments, value, where)
    if is_dataclass(hint):
        return build(hint, value, where)  # type: ignore[arg-type]
    accepted = (float, int) if hint is float else hint
    if not isinstance(value, accepted) or (isinstance(value, bool) and hint is not bool):
        raise _fault(where, value, _RULES[hint])
    if hint is float and not _is_finite(value):
        raise _fault(where, value, "must be finite")
    return hint(value)


def _convert_tuple(arguments: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise _fault(where, value, "must be a list")
    hints = (arguments[0],) * len(value) if arguments[-1] is Ellipsis else arguments
    if len(value) != len(hints):
        raise _fault(where, value, f"must have {len(hints)} values")
    return tuple(_convert(hints[i], item, f"{where}[{i + 1}]") for i, item in enumerate(value))


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return to_mapping(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def _flatten(tree: Any, path: str, flat: dict[str, Parameter]) -> None:
    hints = get_type_hints(type(tree))
    for field in fields(tree):
        name, value, about = _join(path, field.name), getattr(tree, field.name), field.metadata
        if not field.init or value is None:
            continue
        if is_dataclass(value):
            _flatten(value, name, flat)
        elif isinstance(value, tuple):
            if _any_length(hints[field.name]):
                text = json.dumps(_plain(value), separators=(",", ":"))
                flat[name] = Parameter("String", text, doc=f"{about.get('doc', '')} (JSON)".strip())
            else:
                flat.update({f"{name}[{i + 1}]": _parameter(item, about, i) for i, item in enumerate(value)})
        elif items := _items(hints[field.name]):
            flat[name] = Parameter("Enumeration", value, doc=about.get("doc", ""), items=items)
        else:
            flat[name] = _parameter(value, about)


def _parameter(value: Any, about: Mapping[str, Any], place: int = 0) -> Parameter:
    kind = _KINDS[type(value)]
    if kind not in ("Real", "Integer"):
        return Parameter(kind, value, doc=about.get("doc", ""))
    # FMI has no strict bounds: the closed interval is stated, the unit itself refuses the end point
    lowest, highest = about.get("min", about.get("above")), about.get("max", about.get("below"))
    units = about.get("unit", "") if kind == "Real" else ""  # FMI gives units to reals only
    unit = units if isinstance(units, str) else units[place]
    return Parameter(kind, value, unit, lowest, highest, about.get("doc", ""), above="above" in about, below="below" in about)


def _items(hint: Any) -> tuple[str, ...]:
    """The texts that a Literal, or one that may be absent, allows."""
    if get_origin(hint) in (Union, types.UnionType):
        return next((items for argument in get_args(hint) if (items := _items(argument))), ())
    return get_args(hint) if get_origin(hint) is Literal and all(isinstance(item, str) for item in get_args(hint)) else ()


def _any_length(hint: Any) -> bool:
    if get_origin(hint) in (Union, types.UnionType):
        return any(_any_length(argument) for argument in get_args(hint))
    return get_origin(hint) is tuple and get_args(hint)[-1] is Ellipsis


def _loads(text: Any, where: str) -> Any:
    try:
        return json.loads(text)
    except (TypeError, ValueError, RecursionError) as error:
        raise _fault(where, text, f"must be JSON: {error}") from None


def _join(path: str, key: Any) -> str:
    return f"{path}.{key}" if path else str(key)


def _fault(where: str, value: Any, rule: str) -> ValueError:
    if value is None:
        return ValueError(f"{where}: {rule}")
    shown = repr(value) if isinstance(value, str | list | dict) else str(value)
    shown = shown if len(shown) <= 80 else shown[:77] + "..."
    return ValueError(f"{where} = {shown}: {rule}")
