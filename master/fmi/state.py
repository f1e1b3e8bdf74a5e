"""A slave's state as bytes for another process, and back: plain numbers and texts, so that reading bytes of any origin runs no code.

The bytes are `MAGIC` with the format's version, the SHA-256 of the rest (it finds damage, it proves no origin), the length of the header
(uint32), the header (JSON), and the values, little-endian, in the order of the header's layout. A layout lists path, type and shape of
every value of a tree of tuples; bytes are read only where it is that of the reader's own tree. Travels inside every exported FMU.
"""

from __future__ import annotations

import hashlib
import json
import math
import struct
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

MAGIC = b"pipelay state 1\n"
_SUM, _LENGTH = hashlib.sha256().digest_size, struct.Struct("<I")
_SCALARS = ((bool | np.bool_, "bool", "?"), (int | np.integer, "int", "<i8"), (float | np.floating, "float", "<f8"))
Layout = list[list[Any]]  # of every value: path, type, shape


class Snapshot(NamedTuple):
    """Everything a rollback needs; the unit's state is an immutable value, so this is a handful of references."""

    guid: str
    phase: str
    time: float
    changed: Mapping[str, Any]  # parameters set by the host
    inputs: np.ndarray
    unit: Any  # None without an initialised unit


def to_bytes(it: Snapshot) -> bytes:
    """The bytes of a snapshot. Raises ValueError for a unit's state that is no tree of tuples, numbers and arrays."""
    leaves = list(_leaves((it.inputs, it.unit)))
    about = {"guid": it.guid, "phase": it.phase, "time": it.time, "changed": it.changed, "layout": [_kind(*leaf) for leaf in leaves]}
    header = json.dumps(about, allow_nan=False).encode()
    values = [np.asarray(value, _dtype(value)).tobytes() for _, value in leaves]
    content = b"".join([_LENGTH.pack(len(header)), header, *values])
    return MAGIC + hashlib.sha256(content).digest() + content


def read_header(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The header and the values' bytes. Raises ValueError where these are not the whole, undamaged bytes of a snapshot."""
    content = data[len(MAGIC) + _SUM :]
    whole = data.startswith(MAGIC + hashlib.sha256(content).digest()) and len(content) >= _LENGTH.size
    end = _LENGTH.size + (_LENGTH.unpack_from(content)[0] if whole else 0)
    if not whole or end > len(content):
        raise ValueError(f"state: cannot be read back: these {len(data)} bytes are not those of a state, or not all of them")
    try:
        header = json.loads(content[_LENGTH.size : end])
    except (ValueError, RecursionError) as error:
        raise ValueError(f"state: cannot be read back: its header is no JSON: {error}") from None
    kinds = {"guid": str, "phase": str, "time": float, "changed": dict, "layout": list}
    if not isinstance(header, dict) or {key: type(value) for key, value in header.items()} != kinds or not math.isfinite(header["time"]):
        raise ValueError(f"state: cannot be read back: its header must have {', '.join(kinds)}")
    return header, content[end:]


def rebuild(blank: Any, layout: Layout, data: bytes) -> Any:
    """The tree like `blank`, the inputs and the unit's state, with the values of `data`. Raises ValueError where `layout` is another."""
    leaves = list(_leaves(blank))
    expected = [_kind(*leaf) for leaf in leaves]
    for found, own in zip(layout, expected, strict=False):
        if found != own:
            raise ValueError(f"state: of another layout: has {found!r:.200}, must have {own}")
    dtypes = [np.dtype(_dtype(value)) for _, value in leaves]
    sizes = [dtype.itemsize * np.size(value) for dtype, (_, value) in zip(dtypes, leaves, strict=True)]
    if len(layout) != len(expected) or len(data) != sum(sizes):
        raise ValueError(f"state: of another layout: {len(layout)} values of {len(data)} bytes, must be {len(expected)} of {sum(sizes)}")
    values, start = [], 0
    for (_, own), dtype, size in zip(leaves, dtypes, sizes, strict=True):
        value = np.frombuffer(data[start : start + size], dtype).reshape(np.shape(own))
        values.append(value.astype(dtype.newbyteorder("=")) if isinstance(own, np.ndarray) else value.item())
        start += size
    return _grown(blank, iter(values))


def _leaves(tree: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(tree, tuple):
        for name, item in zip(getattr(tree, "_fields", range(len(tree))), tree, strict=True):
            yield from _leaves(item, f"{path}.{name}" if path else str(name))
    elif tree is not None:
        yield path, tree


def _kind(path: str, value: Any) -> list[Any]:
    if isinstance(value, np.ndarray):
        return [path, _dtype(value), list(value.shape)]
    return [path, next((name for kind, name, _ in _SCALARS if isinstance(value, kind)), ""), []]


def _dtype(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.dtype.kind in "fib":
        return value.dtype.newbyteorder("<").str
    for kind, _, dtype in _SCALARS:
        if isinstance(value, kind):
            return dtype
    raise ValueError(f"state: cannot be serialised: it holds a {type(value).__name__}")


def _grown(tree: Any, values: Iterator[Any]) -> Any:
    if isinstance(tree, tuple):
        items = [_grown(item, values) for item in tree]
        return tree._make(items) if hasattr(tree, "_make") else tuple(items)
    return None if tree is None else next(values)
