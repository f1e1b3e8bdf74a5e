"""Ctrl-C and requests to terminate: what they do to a command as a whole, and to the stepping of a run."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from master.errors import RunError

SIGNALS = (signal.SIGINT, signal.SIGTERM)
SAME = 0.5  # s within which two signals are one request
_asked = threading.Event()


@contextmanager
def breakable() -> Iterator[None]:
    """Either signal raises KeyboardInterrupt, so that what is open is closed and removed on the way out.

    An FMU that is loading may swallow the exception, and complain of something else or go on: what follows in the block finds
    `postponed` asked already. One Ctrl-C comes twice, from the terminal and from the parent (see `master.process.child`): its second must
    not cut into the closing.
    """
    last = -math.inf

    def stop(*_: object) -> None:
        nonlocal last
        before, last = last, time.monotonic()
        _asked.set()
        if last - before > SAME:
            raise KeyboardInterrupt

    with _handling(stop):
        try:
            unblock()  # what came while this process began comes now
            yield
        except RunError:
            if _asked.is_set():
                raise KeyboardInterrupt from None
            raise
        finally:
            _asked.clear()


def block() -> None:
    """Let neither signal come before `unblock`, in this process and those that it forks."""
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)


def unblock() -> None:
    """Let both signals come again."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


@contextmanager
def postponed() -> Iterator[threading.Event]:
    """An event that either signal sets, and nothing else happens: a step is never cut in two."""
    with _handling(lambda *_: _asked.set()):
        try:
            yield _asked
        finally:
            _asked.clear()


@contextmanager
def _handling(handler: Callable[..., None]) -> Iterator[None]:
    """`handler` for both signals; nothing outside the main thread, which alone they reach."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = [signal.signal(which, handler) for which in SIGNALS]
    try:
        yield
    finally:
        for which, old in zip(SIGNALS, before, strict=True):
            signal.signal(which, old)
