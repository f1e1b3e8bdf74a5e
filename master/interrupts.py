"""Ctrl-C and requests to terminate: what they do to a command as a whole, and to the stepping of a run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from master.errors import RunError


@contextmanager
def breakable() -> Iterator[None]:
    """Either signal raises KeyboardInterrupt, so that what is open is closed and removed on the way out.

    An FMU that is loading may swallow the exception and complain of something else: that counts as interrupted too.
    """
    asked = threading.Event()

    def stop(*_: object) -> None:
        asked.set()
        raise KeyboardInterrupt

    with _handling(stop):
        try:
            yield
        except RunError:
            if asked.is_set():
                raise KeyboardInterrupt from None
            raise


@contextmanager
def postponed() -> Iterator[threading.Event]:
    """An event that either signal sets, and nothing else happens: a step is never cut in two."""
    asked = threading.Event()
    with _handling(lambda *_: asked.set()):
        yield asked


@contextmanager
def _handling(handler: Callable[..., None]) -> Iterator[None]:
    """`handler` for both signals; nothing outside the main thread, which alone they reach."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(which, handler) for which in signals]
    try:
        yield
    finally:
        for which, old in zip(signals, before, strict=True):
            signal.signal(which, old)
