"""All numeric parameters of a pipe as one vector: those of the pipe and its surroundings, then a row for each section."""

import numpy as np

from . import section
from .arrays import Array
from .parameters import PipeParameters, Section
from .tables import numbers

_LEFT_OUT = ("length", "nodes", "tolerance", "nodes_at", "top_amplitude", "section", "sections")  # they shape the mesh
_FIXED = ("top_range", "section.length")  # the rules need the one, and the other says nothing that `length` does not
NAMES = tuple(name for name, _ in numbers(PipeParameters, None, _LEFT_OUT))
N_GLOBAL, N_SECTION = len(NAMES), len(section.NAMES)


def place(name: str) -> int:
    """Where in the values a number of the pipe or its surroundings is, or the first of several."""
    return NAMES.index(name if name in NAMES else f"{name}[1]")


def values(parameters: PipeParameters) -> Array:
    """All numbers (N_GLOBAL + N_SECTION times the number of sections,), NaN where one is absent."""
    found = [value for _, value in numbers(PipeParameters, parameters, _LEFT_OUT)]
    for one in parameters.all_sections:
        found += [value for _, value in numbers(Section, one)]
    return np.array(found)


def value_places(parameters: PipeParameters) -> dict[str, int]:
    """FMI name to the place in the values, of the numbers that may change after an export with these parameters."""
    names = list(NAMES)
    if not parameters.sections:
        names += [f"section.{name}" for name in section.NAMES]
    given = values(parameters)
    return {name: i for i, name in enumerate(names) if name not in _FIXED and not np.isnan(given[i])}
