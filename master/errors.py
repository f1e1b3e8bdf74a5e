"""The two kinds of failure that reach the user, each as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from master.fmi.failure import where


class UsageError(ValueError):
    """A mistake in the call or the scene, naming key, value and rule; exit code 2."""


class RunError(RuntimeError):
    """A computation that failed: no equilibrium, a step that does not converge, an FMU that refuses; exit code 1."""


@contextmanager
def broken_arithmetic(what: str) -> Iterator[None]:
    """Overflow, division by zero and what follows from them are a RunError that says where, in computing `what`."""
    import numpy as np

    try:
        with np.errstate(all="ignore"):  # what is not finite is found out by what it leads to
            yield
    except UsageError:
        raise
    except (ArithmeticError, ValueError, IndexError) as error:
        raise RunError(f"{what}: {where(error)}") from None
