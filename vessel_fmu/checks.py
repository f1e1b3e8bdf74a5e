"""Numbers that know their unit and range, and one check of them all.

The same file stands in both units, each of which must be complete by itself; a test keeps the copies equal.
"""

import math
from collections.abc import Iterator
from dataclasses import field, fields, is_dataclass
from typing import Any, Literal, get_args, get_origin

BOUNDS = {
    "above": (">", lambda value, bound: value > bound),
    "min": (">=", lambda value, bound: value >= bound),
    "below": ("<", lambda value, bound: value < bound),
    "max": ("<=", lambda value, bound: value <= bound),
}


def number(default: Any, unit: str | tuple[str, ...], doc: str, **bounds: Any) -> Any:
    """Dataclass field holding a number or a fixed tuple of numbers in `unit`, or in one each, within `bounds` (above, min, below, max);
    beyond `usual`, a pair, it is allowed but `unusual`.
    """
    return field(default=default, metadata={"unit": unit, "doc": doc, **bounds})


def check_fields(instance: Any) -> None:
    """Raise ValueError (key = value: rule) for the first number that is not finite or out of its range."""
    for item in fields(instance):
        value = getattr(instance, item.name)
        if get_origin(item.type) is Literal and value not in get_args(item.type):
            raise ValueError(f"{item.name} = {value!r}: must be one of {', '.join(map(repr, get_args(item.type)))}")
        if "unit" not in item.metadata:
            continue
        if value is None and type(None) in get_args(item.type):
            continue
        entries = [(item.name, value)]
        if isinstance(value, tuple):
            if isinstance(item.default, tuple) and item.default and len(value) != len(item.default):
                raise ValueError(f"{item.name} = {value!r}: must have {len(item.default)} entries")
            entries = [(f"{item.name}[{i}]", entry) for i, entry in enumerate(value, 1)]
        for name, entry in entries:
            check_number(name, entry, item.metadata)


def check_number(name: str, value: Any, metadata: Any) -> None:
    """Raise ValueError if `value` is no finite real number within the bounds of `metadata`."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        unit = metadata["unit"] if isinstance(metadata["unit"], str) else ", ".join(metadata["unit"])
        raise ValueError(f"{name} = {value!r}: must be a number" + (f" ({unit})" if unit not in ("", "1") else ""))
    if not math.isfinite(value):
        raise ValueError(f"{name} = {value}: must be finite")
    for key, (sign, holds) in BOUNDS.items():
        if key in metadata and not holds(value, metadata[key]):
            bound, unit = shown(metadata[key]), metadata["unit"]
            raise ValueError(f"{name} = {shown(value)}: must be {sign} {bound}" + (f" {unit}" if unit not in ("", "1") else ""))


def unusual(instance: Any, path: str) -> Iterator[str]:
    """One line (key = value: usual range) for each number, here and in tables below, so far out that its unit may be wrong."""
    for item in fields(instance):
        value, name = getattr(instance, item.name), f"{path}.{item.name}"
        for part, where in [(one, f"{name}[{i}]") for i, one in enumerate(value, 1)] if isinstance(value, tuple) else [(value, name)]:
            if is_dataclass(part):
                yield from unusual(part, where)
            elif part and "usual" in item.metadata:
                low, high = item.metadata["usual"]
                if not low <= part <= high:
                    yield f"{where} = {part:g}{usually(item.metadata)}"


def usually(metadata: Any) -> str:
    """What is said after a number that is beyond the `usual` of its metadata."""
    unit, (low, high) = metadata["unit"], metadata["usual"]
    return f"{'' if unit == '1' else f' {unit}'}: usually {low:g} to {high:g}; is it in this unit?"


def shown(value: float) -> str:
    """A number as messages have it: an integer with all its digits."""
    return str(value) if isinstance(value, int) else f"{value:g}"
