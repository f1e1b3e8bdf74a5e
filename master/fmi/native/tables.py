"""The data of a unit in machine code, `resources/unit.bin`, which its C face (face.c) reads: constants, start state, variables, messages.

Little-endian, every number of 8 bytes, then a pool of texts, to which the tables point by offset. At its head stand a number that the
library has too (see `kinship` of machine.py) and the checksum of all that follows.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

MAGIC = b"pipelay unit 1\n\0"
CAUSALITIES = ("input", "output", "parameter")
KINDS = ("Real", "Integer", "Boolean", "String")
MOST_GROUPS = 64  # of outputs: the face keeps a bit for each
LONGEST_GUID = 63  # bytes; it stands in every state
_VARIABLE = struct.Struct("<8q2d2q")


@dataclass(frozen=True)
class Row:
    """One scalar variable; its value reference is its place in the list."""

    name: str
    causality: str
    kind: str = "Real"
    index: int = 0  # in the inputs, outputs or parameters
    group: int = 0  # of an output
    text: str = ""  # value of a String
    rule: str = ""  # what the host reads of a value out of range, "must be > 0 m"
    minimum: float | None = None
    maximum: float | None = None
    above: bool = False  # the minimum itself is refused
    below: bool = False  # the maximum itself is refused
    fixed: bool = False  # at export
    items: tuple[str, ...] = ()  # of an enumeration, whose value is a number from 1 on

    @property
    def words(self) -> str:
        """The rule, of an enumeration the numbers of its items."""
        return f"must be one of {', '.join(f'{i} ({item})' for i, item in enumerate(self.items, 1))}" if self.items else self.rule


class _Texts:
    """A pool of zero-terminated texts, each of them once."""

    def __init__(self) -> None:
        self.places: dict[str, int] = {}
        self.size = 0
        self.place("")

    def place(self, text: str) -> int:
        """Offset of `text`. Raises ValueError where it holds a zero byte."""
        if "\0" in text:
            raise ValueError(f"text = {text!r:.80}: must hold no zero byte")
        if text not in self.places:
            self.places[text] = self.size
            self.size += len(text.encode()) + 1
        return self.places[text]

    def bytes(self) -> bytes:
        """The pool, filled up to a multiple of 8 bytes."""
        content = b"".join(text.encode() + b"\0" for text in self.places)
        return content + b"\0" * (-len(content) % 8)


def unit_file(
    name: str,
    guid: str,
    variables: Sequence[Row],
    messages: Iterable[str],
    *,
    kernels: int,
    constants: ArrayLike,
    state: ArrayLike,
    inputs: ArrayLike,
    parameters: ArrayLike,
    n_outputs: int,
    n_groups: int,
) -> bytes:
    """The bytes of unit.bin of a unit with these vectors, as exported (`inputs`: start values). Raises ValueError where they do not fit."""
    vectors = [np.asarray(vector, "<f8").ravel() for vector in (constants, state, inputs, parameters)]
    if len(guid.encode()) > LONGEST_GUID:
        raise ValueError(f"guid = {guid!r:.80}: must have at most {LONGEST_GUID} bytes")
    if not 0 <= n_groups <= MOST_GROUPS:
        raise ValueError(f"n_groups = {n_groups}: must be at most {MOST_GROUPS}")
    sizes = {"input": vectors[2].size, "output": n_outputs, "parameter": vectors[3].size}
    for row in variables:
        _check(row, sizes, n_groups)
    if missing := set(range(sizes["input"])) - {row.index for row in variables if row.causality == "input"}:
        raise ValueError(f"inputs {sorted(missing)}: have no variable")
    texts = _Texts()
    rows = b"".join(_packed(row, texts) for row in variables)
    places = [texts.place(message) for message in messages]
    about = [texts.place(guid), texts.place(name)]
    pool = texts.bytes()
    counts = [
        *(vector.size for vector in vectors[:3]),
        n_outputs,
        vectors[3].size,
        n_groups,
        len(variables),
        len(places),
        len(pool),
        *about,
    ]
    data = b"".join(vector.tobytes() for vector in vectors)
    content = b"".join([struct.pack("<11q", *counts), data, rows, struct.pack(f"<{len(places)}q", *places), pool])
    return MAGIC + struct.pack("<QQ", kernels, checksum(content)) + content


def checksum(content: bytes) -> int:
    """FNV-1a of 64 bits, as the face has it."""
    total = 0xCBF29CE484222325
    for byte in content:
        total = (total ^ byte) * 0x100000001B3 % 2**64
    return total


def _check(row: Row, sizes: dict[str, int], n_groups: int) -> None:
    if row.causality not in CAUSALITIES or row.kind not in KINDS or (row.kind == "String" and row.causality != "parameter"):
        raise ValueError(f"{row.name}: {row.causality} of kind {row.kind}: there is no such variable")
    if row.kind != "String" and not 0 <= row.index < sizes[row.causality]:
        raise ValueError(f"{row.name}: index = {row.index}: must be below {sizes[row.causality]}, the number of {row.causality}s")
    if row.causality == "output" and not 0 <= row.group < n_groups:
        raise ValueError(f"{row.name}: group = {row.group}: must be below {n_groups}")


def _packed(row: Row, texts: _Texts) -> bytes:
    count = row.causality == "output" and row.kind == "Integer"
    flags = row.above + 2 * row.below + 4 * row.fixed + 8 * count
    index = texts.place(row.text) if row.kind == "String" else row.index
    group = row.group if row.causality == "output" else 0
    minimum, maximum = (-np.inf if row.minimum is None else row.minimum), (np.inf if row.maximum is None else row.maximum)
    kinds = CAUSALITIES.index(row.causality), KINDS.index(row.kind)
    return _VARIABLE.pack(
        *kinds, index, group, texts.place(row.name), texts.place(row.words), flags, len(row.items), minimum, maximum, 0, 0
    )
