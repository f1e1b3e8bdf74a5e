"""Locks between processes, on files and folders that are there anyway: gone with the process that holds them, however it ends."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: nothing is locked
    fcntl = None  # type: ignore[assignment]


@contextlib.contextmanager
def locked(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold `path`, which exists, for this process alone; where a file system knows no locks, without one.

    Raises BlockingIOError where another process holds it and `wait` is false, OSError where it cannot be opened.
    """
    if fcntl is None:
        yield
        return
    descriptor = os.open(path, os.O_RDONLY)  # not inherited by other programs
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            raise
        except OSError:
            pass
        yield
    finally:
        os.close(descriptor)
