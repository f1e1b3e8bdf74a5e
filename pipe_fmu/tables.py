"""Tables of parameters as vectors of numbers."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, get_args, get_origin

Numbers = Iterator[tuple[str, float]]


def numbers(table: Any, tree: Any, left_out: tuple[str, ...] = (), path: str = "") -> Numbers:
    """Name and value of every number of `tree`, an instance of the dataclass `table` or None, in the order of the fields.

    NaN where a number or its table is absent. Texts and lists of any length are not among them, nor the fields that are `left_out`.
    """
    for item in fields(table):
        name, value, kind = path + item.name, getattr(tree, item.name, None), item.type
        kind = get_args(kind)[0] if isinstance(kind, UnionType) else kind
        if name in left_out:
            continue
        if is_dataclass(kind):
            yield from numbers(kind, value, left_out, f"{name}.")
        elif kind in (float, int):
            yield name, _number(value)
        elif get_origin(kind) is tuple and Ellipsis not in get_args(kind):
            for i in range(len(get_args(kind))):
                yield f"{name}[{i + 1}]", _number(None if value is None else value[i])


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
