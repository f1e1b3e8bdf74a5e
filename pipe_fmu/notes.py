"""What a unit has to say, from its kernels: notes, each the number of a template and the numbers that belong in it.

`notes` (SIZE,) begins with their count; each is a status, the number of a template, the count of its values and the values. The same file
stands in both units, each of which must be complete by itself; a test keeps the copies equal.
"""

from collections.abc import Sequence

from .arrays import Array
from .compiled import kernel

SIZE = 256
WARNING, DISCARD, ERROR = 1, 2, 3  # FMI's


@kernel
def note(notes, status, template, values):
    """Add a note with a tuple of values; one that finds no room is left out."""
    at = 1
    for _ in range(int(notes[0])):
        at += 3 + int(notes[at + 2])
    if at + 3 + len(values) <= notes.shape[0]:
        notes[0] += 1.0
        notes[at], notes[at + 1], notes[at + 2] = float(status), float(template), float(len(values))
        for i in range(len(values)):
            notes[at + 3 + i] = values[i]


def texts(notes: Array, templates: Sequence[str]) -> list[str]:
    """The notes in words."""
    out, at = [], 1
    for _ in range(int(notes[0])):
        count = int(notes[at + 2])
        out.append(templates[int(notes[at + 1])] % tuple(notes[at + 3 : at + 3 + count]))
        at += 3 + count
    return out
