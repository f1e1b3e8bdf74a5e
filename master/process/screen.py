"""What the program says on its standard streams, which may be closed, full, or know few characters: none of it fails a computation.

Text from scenes, files and FMUs reaches a terminal with its control characters escaped.
"""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any, TextIO

from master.errors import RunError
from master.fmi.failure import visible

SLOW = 8.0  # s without a sign of life before a word about compiling
COMPILING = "a first run compiles the numerical kernels, which takes about a minute; later runs find them again"


def secure_streams() -> None:
    """Occupy the numbers of the standard streams that are closed, lest the next file get one, and let none refuse a character."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns of a home that cannot be written
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def say(text: str, *, result: bool = False) -> None:
    """Print lines on the standard output; where they are the `result` itself, raise RunError, or BrokenPipeError, if they are lost."""
    try:
        if sys.stdout is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        sys.stdout.write(visible(text, "\n") + "\n")
        sys.stdout.flush()
    except OSError as error:
        drop(sys.stdout)
        if not result:
            return
        if isinstance(error, BrokenPipeError):
            raise
        raise RunError(f"standard output: cannot be written ({error.strerror})") from None


def complain(message: str, code: int) -> int:
    """Print one line on the error stream; returns the exit code."""
    try:
        sys.stderr.write(f"pipelay: {visible(message)}\n")
        sys.stderr.flush()
    except OSError:
        drop(sys.stderr)
    return code


def drop(stream: Any) -> None:
    """Let a stream that cannot be written to lead nowhere: what it still holds would fail the end of the process."""
    with contextlib.suppress(OSError, ValueError, AttributeError):  # it is none, or no file
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def terminal() -> TextIO:
    """The stream at which somebody sits: the error stream, else the standard output if that is a terminal."""
    return sys.stdout if sys.stdout is not None and sys.stdout.isatty() and not sys.stderr.isatty() else sys.stderr


@contextlib.contextmanager
def patience(stream: TextIO) -> Iterator[Callable[[], None]]:
    """Say why it takes long, if it does and `stream` is a terminal, unless the block ends, or the function given is called, before."""

    def explain() -> None:
        from tqdm import tqdm  # spares a bar that is shown

        with contextlib.suppress(OSError):
            tqdm.write(COMPILING, stream)

    timer = threading.Timer(SLOW, explain)
    timer.daemon = True
    if stream.isatty():
        timer.start()
    try:
        yield timer.cancel
    finally:
        timer.cancel()
