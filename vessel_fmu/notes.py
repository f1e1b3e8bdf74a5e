"""What a kernel has to say: notes in one vector, each a status and the number of a message template with its values.

A vector of notes (256,) holds their count, then one after another status, number of the template, count of values, values.
"""

from collections.abc import Sequence

import numpy as np

from .attitude import Array
from .compiled import kernel

WARNING, DISCARD, ERROR = 1, 2, 3  # of a note: the step or start is done; not done; a value is refused
SIZE = 256


@kernel
def add_note(notes: Array, status: int, message: int, values: Array) -> None:
    """Append a note with the template number `message` and its `values` to `notes`."""
    at = 1
    for _ in range(int(notes[0])):
        at += 3 + int(notes[at + 2])
    notes[at], notes[at + 1], notes[at + 2] = status, message, len(values)
    for i in range(len(values)):
        notes[at + 3 + i] = values[i]
    notes[0] += 1.0


def blank() -> Array:
    """No notes."""
    return np.zeros(SIZE)


def texts(notes: Array, messages: Sequence[str]) -> list[str]:
    """The notes in words."""
    found, at = [], 1
    for _ in range(int(notes[0])):
        end = at + 3 + int(notes[at + 2])
        found.append(messages[int(notes[at + 1])] % tuple(notes[at + 3 : end].tolist()))
        at = end
    return found
