"""The types of the arrays of numbers, and of tuples of them."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = TypeVar("Kind", bound=type)


def distinct(kind: Kind) -> Kind:
    """A type of tuples that none of another package in the process (an FMU brings its own) passes for: numba knows those that stand
    within tuples by their names alone."""
    kind.__name__ = f"{kind.__module__}.{kind.__name__}"
    return kind
