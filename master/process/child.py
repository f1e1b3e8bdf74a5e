"""A command in a process of its own, so that one is left to say so where an FMU takes its process with it.

The child is forked before anything heavy is imported; it is the command, on the same terminal, and the parent only waits. Signals
that reach the parent are passed on, so that Ctrl-C comes twice to the child, which ignores both but within `breakable` or `postponed`
of `master.process.signals`. The child ends with its parent.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass

from master.process.signals import SIGNALS, block, unblock


@dataclass(frozen=True)
class Death:
    """How a process ended that did not come to its end, in words, and its number."""

    how: str
    process: int


def guarded(work: Callable[[], int]) -> int | Death:
    """The exit code of `work`, which runs in a child, or how the child died. Without fork (Windows) `work` runs right here."""
    if not hasattr(os, "fork"):
        return work()
    heard, told = os.pipe()
    block()  # until there is somebody in either process to take them
    child = os.fork()
    if child == 0:
        os.close(heard)
        for which in SIGNALS:
            signal.signal(which, signal.SIG_IGN)
        threading.Thread(target=_end_with_reader, args=(told,), daemon=True).start()
        try:
            return work()
        finally:
            with contextlib.suppress(BrokenPipeError):
                os.write(told, b".")  # an end of its own accord
    os.close(told)

    def pass_on(which: int, _: object) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, which)

    for which in SIGNALS:
        signal.signal(which, pass_on)
    unblock()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code < 0:
        return Death(f"was ended by {signal.Signals(-code).name}", child)
    accord = bool(select.select([heard], [], [], 0)[0] and os.read(heard, 1))
    return code if accord else Death(f"was ended from within, with exit code {code}", child)


def _end_with_reader(pipe: int) -> None:
    """Ask this process to terminate once nobody holds the other end of `pipe`."""
    waiting = select.poll()
    waiting.register(pipe, 0)  # an error is reported unasked
    waiting.poll()
    os.kill(os.getpid(), signal.SIGTERM)
