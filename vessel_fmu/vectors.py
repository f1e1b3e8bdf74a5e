"""Tables of parameters as vectors of numbers, and names for the parts of a vector."""

from collections import namedtuple
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, Literal, NamedTuple, get_args, get_origin

import numpy as np

from .attitude import Array


class Number(NamedTuple):
    """One number of a table of parameters."""

    name: str  # of the FMI parameter
    value: float  # of one of several texts its place among them, from 1; NaN where the number or its table is absent
    metadata: Any


def numbers(table: Any, tree: Any, path: str = "") -> Iterator[Number]:
    """All numbers of `tree`, an instance of the dataclass `table` or None, in the order of the fields; tables of any length left out."""
    for item in fields(table):
        name, value, kind = path + item.name, getattr(tree, item.name, None), item.type
        kind = get_args(kind)[0] if isinstance(kind, UnionType) else kind
        origin, arguments = get_origin(kind), get_args(kind)
        if is_dataclass(kind):
            yield from numbers(kind, value, f"{name}.")
        elif origin is Literal:
            yield Number(name, np.nan if value is None else 1.0 + arguments.index(value), item.metadata)
        elif origin is not tuple:
            yield Number(name, np.nan if value is None else float(value), item.metadata)
        elif Ellipsis not in arguments:
            for i in range(len(arguments)):
                yield Number(f"{name}[{i + 1}]", np.nan if value is None else float(value[i]), item.metadata)


def vector(tree: Any) -> Array:
    """The numbers (n,) of a table of parameters."""
    return np.array([it.value for it in numbers(type(tree), tree)])


def parts(sizes: Mapping[str, int]) -> Any:
    """Named tuple of slices of a vector that holds vectors of these sizes one after another."""
    ends = np.cumsum(list(sizes.values())).tolist()
    slices = [slice(end - size, end) for end, size in zip(ends, sizes.values(), strict=True)]
    make: Any = namedtuple
    return make("Parts", list(sizes))(*slices)


def total(sizes: Mapping[str, int]) -> int:
    """Size of such a vector."""
    return sum(sizes.values())
