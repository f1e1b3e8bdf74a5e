"""What a kernel has to say: notes in one vector, each a status and the number of a message template with its values.

A vector of notes (256,) holds their count, then one after another status, number of the template, count of values, values.
"""

from collections.abc import Sequence

import numpy as np

from .attitude import Array
from .compiled import kernel

WARNING, DISCARD, ERROR = 1.0, 2.0, 3.0  # of a note: the step or start is done; not done; a value is refused
SIZE = 256


@kernel
def add_note(notes: Array, status: float, message: float, count: float, first: float, second: float) -> None:
    """Append a note with the template number `message` and `count` of the two values to `notes`; no integers, for one compiled version."""
    at = 1
    for _ in range(int(notes[0])):
        at += 3 + int(notes[at + 2])
    notes[at], notes[at + 1], notes[at + 2] = status, message, count
    if count > 0.0:
        notes[at + 3] = first
    if count > 1.0:
        notes[at + 4] = second
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
